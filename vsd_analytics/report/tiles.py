"""The key figures below the headline: two headline numbers, then facts; abnormal weeks show only what they know."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from vsd_analytics.report import format as fmt
from vsd_analytics.report import words
from vsd_analytics.report.model import Estimate, WeekReport
from vsd_analytics.report.things import weakest_camera


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
                else _framed((_often(report), _risky(report), _recorded(report)))
            )
        case _:
            rest = [t for t in (_spot(report), _hour(report), _recorded(report)) if t is not None]
            return _framed((_often(report), _risky(report), *rest))


def _framed(items: tuple[Tile, ...]) -> tuple[Tile, ...]:
    """Set the headline numbers large (all, when there are at most three) and mark the first of each row."""
    few = len(items) <= 3
    return tuple(
        replace(t, is_large=few or i < 2, is_first=i == 0 or (i == 2 and not few)) for i, t in enumerate(items)
    )


def sentences(parts: Iterable[str]) -> str:
    """Join the parts that say something as sentences."""
    return " ".join(words.sentence(p) for p in parts if p)


def _change(report: WeekReport, estimate: Estimate) -> tuple[str, str]:
    """Return delta and direction: the change where it is clear, else the verdict."""
    if report.state != "normal" or estimate.state != "ok":
        return "", "same"
    if estimate.verdict in ("clear_fall", "clear_rise"):
        return fmt.fewer_more(estimate.change), words.direction(estimate.verdict)
    return words.verdict_words(estimate), "same"


def _against(report: WeekReport, estimate: Estimate) -> list[str]:
    if report.state != "normal" or report.previous is None or estimate.previous is None:
        return [fmt.likely_level(estimate)]
    return [f"week {report.previous.number}: {fmt.number(estimate.previous)}", fmt.likely_change(estimate)]


def _often(report: WeekReport) -> Tile:
    often = report.level.often
    if often.value is None:
        value = "Not measurable" if often.state == "not_measurable" else "Too few to print"
        return Tile(title="How often", value=value, note=sentences([often.reason or ""]), is_wordy=True)
    delta, direction = _change(report, often)
    note = sentences([*_against(report, often), "same hours compared" if often.change is not None else ""])
    return Tile(
        title="How often",
        unit="violations per open hour",
        value=fmt.number(often.value),
        note=note,
        delta=delta,
        direction=direction,
    )


def _risky(report: WeekReport) -> Tile:
    risky, exposure = report.level.risky, report.level.exposure_h
    title = "How risky"
    if risky.state == "not_measurable" or risky.value is None:
        value = "Not measurable" if risky.state == "not_measurable" else "Too little data"
        return Tile(title=title, value=value, note=sentences([risky.reason or ""]), is_wordy=True)
    delta, direction = _change(report, risky)
    people = words.with_people(report.level.people.change, report.level.people.verdict)
    seen = f"{fmt.count(exposure)} person-hours seen" if exposure is not None else ""
    if seen and people and report.state == "normal":
        seen += f", {people.removeprefix('with ')}"
    note = sentences([*_against(report, risky), seen])
    return Tile(
        title=title,
        unit="violations per person-hour",
        value=fmt.number(risky.value),
        note=note,
        delta=delta,
        direction=direction,
    )


def _spot(report: WeekReport) -> Tile | None:
    spot = report.busiest_spot
    if spot is None:
        return None
    note = f"{fmt.percent(spot.share)} of all violations"
    if spot.floor_share is not None:
        note += f", on {fmt.percent(spot.floor_share)} of the floor"
    return Tile(title="Busiest spot", value=spot.name, note=sentences([note]))


def _hour(report: WeekReport) -> Tile | None:
    busiest = report.busiest_hour
    if busiest is None:
        return None
    shown = fmt.masked(report.rules.mask_below) if busiest.is_masked else fmt.count(busiest.violations)
    note = f"{shown} violations in that hour"
    if busiest.ratio_to_mean is not None and not busiest.is_masked:
        note += f", {fmt.number(busiest.ratio_to_mean)} times the average hour"
    at = f"{fmt.day_short(busiest.start.date())} {fmt.clock(busiest.start)}"
    return Tile(title="Busiest hour", value=at, note=sentences([note]))


def _recorded(report: WeekReport) -> Tile:
    coverage = report.coverage
    if coverage.scheduled_h == 0:
        return Tile(title="Data recorded", value="None was due", note="No opening hour in this week.", is_wordy=True)
    note = [f"{fmt.number(coverage.recorded_h)} of {fmt.number(coverage.scheduled_h)} camera-hours"]
    camera = weakest_camera(report)
    if camera is not None and report.state == "normal":
        lost = camera.scheduled_h - camera.recorded_h
        if lost >= 1:
            note.append(f"{words.camera_name(camera.name)} missed most")
    if coverage.is_inferred:
        note.append("Inferred from gaps")
    return Tile(
        title="Data recorded",
        value=fmt.percent(coverage.share),
        note=sentences(note),
        link="data",
        link_text="See what is missing" if coverage.share < 1 else "See the hours",
    )


def _rough(report: WeekReport) -> Tile:
    often = report.level.often
    value = f"about {fmt.number(often.value)}" if often.value is not None else "Too little data"
    return Tile(
        title="How often",
        unit="violations per recorded hour" if often.value is not None else "",
        value=value,
        note=sentences([often.reason or "Rough, and not compared"]),
        is_wordy=often.value is None,
    )


def _none(report: WeekReport) -> Tile:
    often = report.level.often
    note = f"likely fewer than {fmt.one_in(often.hi)} open hours" if often.hi else ""
    return Tile(title="How often", unit="violations per open hour", value="0", note=sentences([note]))


def _seen(report: WeekReport) -> Tile:
    coverage = report.coverage
    if coverage.seen_h is None:
        return Tile(
            title="Hours with people seen", value="Not known", note="The engine sends no positions.", is_wordy=True
        )
    value = f"{fmt.number(coverage.seen_h)} of {fmt.number(coverage.open_h)}"
    note = "So the cameras were working." if coverage.seen_h else "Nobody was seen at all: check the cameras."
    return Tile(title="Hours with people seen", value=value, note=note)


def _last_record(report: WeekReport) -> Tile:
    last = [c.last_record for c in report.coverage.cameras if c.last_record is not None]
    if not last:
        return Tile(title="Last data received", value="None found", note="From no camera.", is_wordy=True)
    newest = max(last)
    at_once = len(last) > 1 and (newest - min(last)).total_seconds() <= 60
    note = (
        "From all cameras at once."
        if at_once and len(last) == len(report.coverage.cameras)
        else "From the last camera."
    )
    return Tile(title="Last data received", value=fmt.instant_short(newest), note=note, is_wordy=True)


def _before_after(report: WeekReport) -> tuple[Tile, Tile] | None:
    change = report.settings_change
    if change is None or change.often_before is None or change.often_after is None:
        return None
    names = f"Before, at {change.before}", f"After, at {change.after}"
    if change.name == "calibration":
        names = "How often, before the calibration", "How often, since the calibration"
    parts = zip(names, (change.often_before, change.often_after), strict=True)
    before, after = (
        Tile(
            title=name,
            value=fmt.number(e.value),
            unit="violations per open hour",
            note=sentences([fmt.likely_level(e) or "too few days for a likely range"]),
        )
        for name, e in parts
    )
    return before, after
