"""The key figures below the headline: two headline numbers, then facts; abnormal weeks show only what they know."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from markupsafe import Markup

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import Target, Usual
from vsd_analytics.report.draw.trend_chart import spark
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.things_to_know import weakest_camera
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One key figure.

    Attributes:
        title: What it is.
        value: The figure, formatted.
        note: One or two short sentences.
        unit: What the value counts, set small beside it.
        delta: Change or verdict in words; empty for none.
        direction: good, bad or same; colours the delta.
        is_large: One of the two headline numbers.
        is_first: First of its row.
        is_wordy: The value is words, so it is set smaller.
        link: Anchor of the proof; empty for none.
        link_text: Words of that link.
        also: The second reading, or another line below; empty for none.
        line: The last weeks as a small line; empty for none.
    """

    title: str
    value: str
    note: str
    unit: str = ""
    delta: str = ""
    direction: str = "same"
    is_large: bool = False
    is_first: bool = False
    is_wordy: bool = False
    link: str = ""
    link_text: str = ""
    also: str = ""
    line: str | Markup = ""


def tiles(report: WeekReport) -> tuple[Tile, ...]:
    """Return the key figures of the week, in reading order."""
    match report.state:
        case "no_data":
            return _framed((_recorded(report), _last_record(report)))
        case "too_incomplete":
            return _framed((_rough(report), _recorded(report)))
        case "empty":
            return _framed((_none(report), _seen(report), _recorded(report)))
        case "settings_changed":
            both = _before_after(report)
            return (
                _framed((*both, _recorded(report)))
                if both
                else _framed((_violation_rate(report), _close(report), _recorded(report)))
            )
        case _:
            rest = [t for t in (_hour(report), _recorded(report)) if t is not None]
            return _framed((_violation_rate(report), _close(report), *rest))


def _framed(items: tuple[Tile, ...]) -> tuple[Tile, ...]:
    """Set the headline numbers large (all, when there are at most three) and mark the first."""
    few = len(items) <= 3
    return tuple(replace(t, is_large=few or i < 2, is_first=i == 0) for i, t in enumerate(items))


def sentences(parts: Iterable[str]) -> str:
    """Join the parts that say something as sentences."""
    return " ".join(terms.sentence(p) for p in parts if p)


def _change(report: WeekReport, estimate: Estimate, *, is_counted: bool = True) -> tuple[str, str]:
    """Return delta and direction: the change where it is clear, else the verdict."""
    if report.state != "normal" or estimate.state != "ok":
        return "", "same"
    if estimate.verdict in ("clear_fall", "clear_rise"):
        written = fmt.fewer_more if is_counted else fmt.less_more
        return written(estimate.change), terms.direction(estimate.verdict)
    return terms.verdict_words(estimate), "same"


def _against(
    report: WeekReport, estimate: Estimate, usual: Usual | None, written: Callable[[float | None], str]
) -> list[str]:
    """Return what a headline number is set beside: the week before over the same hours, and the usual range."""
    if report.state != "normal" or report.previous is None or estimate.previous is None:
        beside = [fmt.likely_level(estimate, written=written)]
    else:
        beside = [say("tiles.week_before", week=report.previous.number, rate=written(estimate.previous))]
    if usual is not None:
        beside.append(say("tiles.usual", low=written(usual.lo), high=written(usual.hi)))
    return beside


def _between(report: WeekReport) -> str:
    """Return how often by the second reading; empty where there is none."""
    readings = report.readings
    if readings is None or readings.between is None or readings.all is None:
        return ""
    between, every = readings.between.violation_rate, readings.all.violation_rate
    if between.value is None or every.value is None:
        return ""
    rate = fmt.number(between.value)
    if not readings.left_out:
        return say("tiles.between", rate=rate)
    without = terms.joined(terms.camera_name(c) for c in readings.left_out)
    return say("tiles.between_part", rate=rate, all=fmt.number(every.value), cameras=without)


def _violation_rate(report: WeekReport) -> Tile:
    violation_rate, title = report.level.violation_rate, say("tiles.violation_rate")
    if violation_rate.value is None:
        value = say("tiles.not_measurable") if violation_rate.state == "not_measurable" else say("tiles.too_few")
        return Tile(title=title, value=value, note=sentences([reason_text(violation_rate.reason)]), is_wordy=True)
    delta, direction = _change(report, violation_rate)
    return Tile(
        title=title,
        unit=say("tiles.violations_per_open_hour"),
        value=fmt.number(violation_rate.value),
        note=sentences(
            [
                *_against(
                    report, violation_rate, report.trend.usual_violation_rate if report.trend else None, fmt.number
                ),
                target_words(report.trend.target_violation_rate if report.trend else None),
            ]
        ),
        delta=delta,
        direction=direction,
        also=_between(report),
        line=spark(report.trend, "violation_rate"),
    )


def target_words(target: Target | None) -> str:
    """Return where a week lies beside its floor's target, as a sentence without its full stop; empty for no target."""
    if target is None:
        return ""
    return say(f"tiles.target_{target.position}" if target.position else "tiles.target", n=fmt.number(target.value))


def _close(report: WeekReport) -> Tile:
    close, title = report.level.close_time_share, say("tiles.close")
    if close is None or close.value is None:
        is_unknown = close is None or close.state == "not_measurable"
        value = say("tiles.not_measurable" if is_unknown else "tiles.too_little")
        return Tile(
            title=title, value=value, note=sentences([reason_text(close.reason) if close else ""]), is_wordy=True
        )
    delta, direction = _change(report, close, is_counted=False)
    return Tile(
        title=title,
        unit=say("tiles.close_unit"),
        value=fmt.percent(close.value),
        note=sentences(_against(report, close, report.trend.usual_close if report.trend else None, fmt.percent)),
        delta=delta,
        direction=direction,
        also=_person_hours(report),
        line=spark(report.trend, "close"),
    )


def _person_hours(report: WeekReport) -> str:
    """Return how much time of people was seen; empty where it is not known."""
    exposure = report.level.exposure_h
    return "" if exposure is None else say("tiles.person_hours", hours=fmt.count(exposure))


def _hour(report: WeekReport) -> Tile | None:
    busiest = report.busiest_hour
    if busiest is None:
        return None
    key = "tiles.in_that_hour" if busiest.ratio_to_mean is None else "tiles.in_that_hour_times"
    note = say(key, n=fmt.count(busiest.violations), times=fmt.number(busiest.ratio_to_mean))
    at = f"{fmt.day_short(busiest.start.date())} {fmt.clock(busiest.start)}"
    if not report.week.is_week:
        at = fmt.instant_short(busiest.start)
    return Tile(title=say("tiles.hour"), value=at, note=sentences([note]))


def _recorded(report: WeekReport) -> Tile:
    coverage, title = report.coverage, say("tiles.recorded")
    if coverage.scheduled_h == 0:
        return Tile(title=title, value=say("tiles.none_due"), note=say("tiles.none_due_text"), is_wordy=True)
    recorded, scheduled = fmt.number(coverage.recorded_h), fmt.number(coverage.scheduled_h)
    note = [say("tiles.camera_hours", recorded=recorded, scheduled=scheduled)]
    camera = weakest_camera(report)
    is_known = report.story is not None and any(t.target == "data" for t in report.story.things)
    if camera is not None and not is_known and report.state == "normal" and camera.scheduled_h - camera.recorded_h >= 1:
        note.append(say("tiles.missed_most", camera=terms.camera_name(camera.name)))
    if coverage.is_inferred:
        note.append(say("tiles.inferred"))
    return Tile(
        title=title,
        value=fmt.percent(coverage.share),
        note=sentences(note),
        link="data",
        link_text=say("tiles.see_missing" if coverage.share < 1 else "tiles.see_hours"),
    )


def _rough(report: WeekReport) -> Tile:
    violation_rate = report.level.violation_rate
    is_known = violation_rate.value is not None
    return Tile(
        title=say("tiles.violation_rate"),
        unit=say("tiles.violations_per_recorded_hour") if is_known else "",
        value=say("tiles.about", rate=fmt.number(violation_rate.value)) if is_known else say("tiles.too_little"),
        note=sentences([reason_text(violation_rate.reason) or say("tiles.rough")]),
        is_wordy=not is_known,
    )


def _none(report: WeekReport) -> Tile:
    violation_rate = report.level.violation_rate
    note = say("tiles.fewer_than", rate=fmt.one_in(violation_rate.hi)) if violation_rate.hi else ""
    unit = say("tiles.violations_per_open_hour")
    return Tile(title=say("tiles.violation_rate"), unit=unit, value="0", note=sentences([note]))


def _seen(report: WeekReport) -> Tile:
    coverage, title = report.coverage, say("tiles.seen")
    if coverage.seen_h is None:
        why = sentences([reason_text(report.level.encounter_rate.reason)]) or say("tiles.no_positions")
        return Tile(title=title, value=say("tiles.not_known"), note=why, is_wordy=True)
    value = say("tiles.seen_of", seen=fmt.number(coverage.seen_h), open=fmt.number(coverage.open_h))
    return Tile(title=title, value=value, note=say("tiles.working" if coverage.seen_h else "tiles.nobody"))


def _last_record(report: WeekReport) -> Tile:
    last, title = [c.last_record for c in report.coverage.cameras if c.last_record is not None], say("tiles.last")
    if not last:
        return Tile(title=title, value=say("tiles.none_found"), note=say("tiles.from_none"), is_wordy=True)
    newest = max(last)
    at_once = len(last) > 1 and (newest - min(last)).total_seconds() <= 60
    is_all = at_once and len(last) == len(report.coverage.cameras)
    note = say("tiles.all_at_once" if is_all else "tiles.from_last")
    return Tile(title=title, value=fmt.instant_short(newest), note=note, is_wordy=True)


def _before_after(report: WeekReport) -> tuple[Tile, Tile] | None:
    change = report.settings_change
    if change is None or change.violation_rate_before is None or change.violation_rate_after is None:
        return None
    names = say("tiles.before_at", value=change.before), say("tiles.after_at", value=change.after)
    if change.name == "calibration":
        names = say("tiles.before_calibration"), say("tiles.after_calibration")
    parts = zip(names, (change.violation_rate_before, change.violation_rate_after), strict=True)
    before, after = (
        Tile(
            title=name,
            value=fmt.number(e.value),
            unit=say("tiles.violations_per_open_hour"),
            note=sentences([fmt.likely_level(e) or say("tiles.few_days")]),
        )
        for name, e in parts
    )
    return before, after
