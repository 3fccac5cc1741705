"""Sections beyond the week and its map, words and drawings: weeks, causes, logged changes, outlook, unusual hours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import Causes, LoggedChangeEffect, Target, TrendWeek
from vsd_analytics.report.draw import svg
from vsd_analytics.report.draw.trend_chart import NARROW, WIDE, Measure, chart, known
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.year_line import year_line
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

NO_BAR = Markup("")
SMALL_MOVE = 0.05
"""Causes that moved less than this, relatively, are not named."""

CHART_WEEKS: Final = 3
"""With fewer weeks a line would join two dots: the table says more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrendPanel:
    """One measure over the weeks: its title, the line below it, and the drawing in two widths."""

    title: str
    sub: str
    wide: Markup
    narrow: Markup


@dataclass(frozen=True, slots=True, kw_only=True)
class TrendRow:
    """One week of the table behind the charts: texts."""

    number: int
    start: str
    violation_rate: str
    violation_rate_likely: str
    close: str
    close_likely: str
    recorded: str
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrendView:
    """The weeks.

    Attributes:
        heading: Name of the section.
        panels: How often, share of time too close; none with fewer than two figures.
        marks: Letter, moment and text of logged changes.
        notes: What a reader must know beside.
        rows: The table.
        differs: Why the week before reads otherwise in the comparison; empty where it does not.
        has_gaps: True when a week is one.
        has_usual: True when a usual range is drawn.
        has_others: True when a week has other cameras.
    """

    heading: str
    panels: tuple[TrendPanel, ...]
    marks: tuple[tuple[str, str, str], ...]
    notes: tuple[str, ...]
    rows: tuple[TrendRow, ...]
    differs: str
    has_gaps: bool
    has_usual: bool
    has_others: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class BarRow:
    """A change with its bar: texts. The head above the rows of one subject: its name and a note."""

    name: str
    bar: Markup = NO_BAR
    words: str = ""
    detail: str = ""
    direction: str = "same"
    is_head: bool = False
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class BarTable:
    """Changes with their bars, and what they say together."""

    title: str
    sub: str
    axis: Markup = NO_BAR
    rows: tuple[BarRow, ...] = ()
    sentence: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Listed:
    """A short figure made of lines; without title and lines it is only refused, in its notes."""

    title: str = ""
    sub: str = ""
    lines: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def trend(report: WeekReport) -> TrendView | None:
    """Return the weeks; None without any."""
    weekly_trend = report.trend
    if weekly_trend is None or not weekly_trend.weeks:
        return None
    weeks = weekly_trend.weeks
    panels = []
    for measure in ("violation_rate", "close"):
        n = sum(known(w, measure) is not None for w in weeks)
        if n >= CHART_WEEKS:
            panels.append(_panel(report, measure))
    notes = []
    if len(weeks) == 1:
        notes.append(say("trend.one"))
    if weekly_trend.state != "ok":
        notes.append(say("trend.too_few"))
    if year := year_line(report.answers):
        notes.append(year)
    ahead = outlook(report)
    why = None if report.outlook is None else report.outlook.reason
    if ahead is not None and not ahead.lines and not _is_named_by_trend(report, why, "forecast.weeks"):
        notes += ahead.notes
    if weekly_trend.left_out and panels and report.state != "no_data":
        cameras = terms.joined(terms.camera_name(c) for c in weekly_trend.left_out)
        key = "trend.left_out_little" if report.is_little_recorded else "trend.left_out"
        notes.append(say(key, plural=len(weekly_trend.left_out), cameras=cameras))
    marks = [
        (m.label, fmt.instant_short(m.at), f"{fmt.ended(m.text)} {m.area_name + '.' if m.area_name else ''}".strip())
        for m in weekly_trend.marks
    ]
    return TrendView(
        heading=say("trend.title" if len(weeks) == 10 else "trend.title_so_far"),
        panels=tuple(panels),
        marks=tuple(marks) if panels else (),
        notes=tuple(n for n in notes if n),
        rows=tuple(_row(w) for w in weeks),
        differs=_differs(report),
        has_gaps=any(w.violation_rate is None for w in weeks),
        has_usual=weekly_trend.usual_violation_rate is not None or weekly_trend.usual_close is not None,
        has_others=any(w.missing for w in weeks),
    )


def _is_named_by_trend(report: WeekReport, reason: Reason | None, code: str) -> bool:
    """Tell whether the section of the weeks already says that more recorded weeks are needed."""
    is_short = report.trend is not None and bool(report.trend.weeks) and report.trend.state != "ok"
    return is_short and reason is not None and reason.code == code


def trend_title(report: WeekReport, measure: Measure) -> str:
    """Return the title of one measure over the weeks: whether this week lies in their usual range."""
    weeks = report.trend.weeks if report.trend is not None else ()
    if report.trend is None or not weeks or known(weeks[-1], measure) is None:
        return say("titles.trend_gap", week=report.week.number)
    usual = report.trend.usual_violation_rate if measure == "violation_rate" else report.trend.usual_close
    if usual is None:
        if report.trend.holidays:
            return say("titles.trend_holiday", week=report.week.number)
        n = sum(known(w, measure) is not None for w in weeks)
        return say("titles.trend_few", plural=n, n=fmt.count(n))
    return say(f"titles.trend_{usual.position}", week=report.week.number)


def causes(report: WeekReport) -> BarTable | None:
    """Return what moved the time spent close, as one sentence with three bars; None where it is not computed."""
    decomposition = report.causes
    if decomposition is None or report.previous is None or not report.level.violation_rate.value:
        return None
    distance = fmt.distance(report.rules.distance_m, report.rules.distance_unit)
    title, sub = say("causes.title"), say("causes.sub", distance=distance, before=report.previous.number)
    if decomposition.close is None:
        return BarTable(title=title, sub=sub, notes=(say("causes.none", reason=_because(decomposition.reason)),))
    if not _is_clear(report, decomposition.close):
        return BarTable(
            title=title, sub=sub, notes=(say("causes.unclear", distance=distance, before=report.previous.number),)
        )
    parts = {
        "people": Estimate(value=None, change=decomposition.people),
        "layout": Estimate(value=None, change=decomposition.layout),
        "behaviour": Estimate(
            value=None,
            change=decomposition.behaviour,
            change_lo=decomposition.behaviour_lo,
            change_hi=decomposition.behaviour_hi,
        ),
    }
    limit = svg.change_limit(parts.values())
    rows = tuple(
        BarRow(
            name=say(f"causes.{name}"),
            bar=svg.change_bar(e, limit=limit),
            words=fmt.signed(e.change),
            detail=fmt.likely_signed(e),
            direction="same",
        )
        for name, e in parts.items()
    )
    return BarTable(
        title=title, sub=sub, axis=svg.change_axis(limit), rows=rows, sentence=_cause(decomposition, distance)
    )


def change_effects(report: WeekReport) -> BarTable | None:
    """Return the effects of logged changes with their bars, and what they rest on; None without any effect."""
    effects = [r for r in report.change_effects if r.state == "ok" and _measured(r)]
    if not effects:
        return None
    limit = svg.change_limit(e for r in effects for _, e in _measured(r))
    return BarTable(
        title=say("change_effects.title"),
        sub=say("change_effects.sub", confidence=fmt.percent(report.rules.confidence)),
        axis=svg.change_axis(limit),
        rows=tuple(row for r in effects for row in _change_effect(r, limit)),
        notes=tuple(dict.fromkeys(say(f"change_effects.assumes_{r.design}") for r in effects)),
    )


def outlook(report: WeekReport) -> Listed | None:
    """Return the section on the next week's forecast; None where violations cannot be counted."""
    forecast = report.outlook
    if forecast is None or report.level.violation_rate.state == "not_measurable":
        return None
    sub = say("next.sub")
    if not forecast.highest:
        return Listed(notes=(say("next.why", week=forecast.number, reason=_because(forecast.reason)),))
    lines = []
    for h in forecast.highest:
        hour = f"{fmt.weekday(h.day)} {fmt.hour_label(h.hour)}"
        is_ranged = h.lo is not None and h.hi is not None
        key = "next.hour_range" if is_ranged else "next.hour"
        lines.append(say(key, hour=hour, rate=fmt.number(h.value), low=fmt.number(h.lo), high=fmt.number(h.hi)))
    top = forecast.highest[0]
    hour = f"{fmt.weekday(top.day)} {fmt.hour_label(top.hour)}"
    notes = [say("next.mean", rate=fmt.number(forecast.mean)), say("next.range")]
    score = forecast.score
    if score is None:
        notes.append(say("next.no_score"))
    else:
        notes.append(say("next.score", error=fmt.percent(score.error), naive=fmt.percent(score.error_naive)))
        if score.hit_rate is not None:
            notes.append(say("next.score_hit", share=fmt.percent(score.hit_rate), n=fmt.count(score.n_hours)))
    return Listed(
        title=say("titles.outlook", hour=hour, week=forecast.number), sub=sub, lines=tuple(lines), notes=tuple(notes)
    )


def unusual(report: WeekReport) -> Listed | None:
    """Return the hours far from usual; None where none could be judged, or the only one is in the lead already."""
    unusual_hours = report.unusual
    if unusual_hours is None or (unusual_hours.n_unusual == 1 and unusual_hours.first is not None):
        return None
    sub = say("when.unusual_sub")
    if unusual_hours.state != "ok" and _is_named_by_trend(report, unusual_hours.reason, "unusual.weeks"):
        return None
    if unusual_hours.state != "ok":
        return Listed(notes=(say("when.unusual_why", reason=_because(unusual_hours.reason)),))
    lines = [
        say(
            "when.unusual_row" if r.violations is not None else "when.unusual_row_held",
            hour=f"{fmt.weekday(r.day)} {fmt.hour_label(r.hour)}",
            n=fmt.count(r.violations),
            usual=fmt.number(r.usual),
            low=fmt.number(r.lo),
            high=fmt.number(r.hi),
        )
        for r in unusual_hours.rows
    ]
    n = unusual_hours.n_unusual
    title = say("titles.unusual", plural=n, n=n) if n else say("titles.unusual_none")
    return Listed(title=title, sub=sub, lines=tuple(lines))


def readings_note(report: WeekReport) -> str:
    """Return how far the second reading can be trusted, or why there is none; empty where nothing is counted."""
    readings = report.readings
    if readings is None:
        return ""
    if readings.between is None:
        return say("reading.none", reason=_because(readings.reason))
    precision, recall = fmt.percent(readings.precision_lo), fmt.percent(readings.recall_lo)
    if readings.between_share is None:
        return say("reading.note_plain", precision=precision, recall=recall)
    share = fmt.percent(readings.between_share)
    if readings.between_lo is not None and readings.between_hi is not None:
        low, high = fmt.percent(readings.between_lo), fmt.percent(readings.between_hi)
        share = say("reading.share", share=share, low=low, high=high)
    return say("reading.note", share=share, precision=precision, recall=recall)


def _because(reason: Reason | None) -> str:
    """Return a reason as the end of a sentence, without its full stop."""
    return (reason_text(reason) or say("words.too_little_data").lower()).rstrip(".")


def _panel(report: WeekReport, measure: Measure) -> TrendPanel:
    weekly_trend = report.trend
    assert weekly_trend is not None
    ends = {"first": weekly_trend.weeks[0].number, "last": weekly_trend.weeks[-1].number}
    label = say(f"trend.label_{measure}", **ends)
    sub = say(f"trend.sub_{measure}", distance=fmt.distance(report.rules.distance_m, report.rules.distance_unit))
    return TrendPanel(
        title=say(f"trend.{measure}", title=trend_title(report, measure)),
        sub=sub
        + (
            _target(weekly_trend.target_violation_rate)
            if measure == "violation_rate" and weekly_trend.target_violation_rate is not None
            else ""
        ),
        wide=chart(weekly_trend, measure, width=WIDE, label=label),
        narrow=chart(weekly_trend, measure, width=NARROW, label=label),
    )


def _target(target: Target) -> str:
    """Write the target and where this week lies, after the heading of the chart."""
    key = f"trend.target_{target.position}" if target.position else "trend.target"
    return say(key, n=fmt.number(target.value))


def _row(week: TrendWeek) -> TrendRow:
    violation_rate, close = known(week, "violation_rate"), known(week, "close")
    note = reason_text(week.reason)
    if week.missing:
        cameras = terms.joined(terms.camera_name(c) for c in week.missing)
        note = say("trend.without", plural=len(week.missing), cameras=cameras)
    if violation_rate is None and week.violation_rate is not None:
        note = reason_text(week.violation_rate.reason) or note
    return TrendRow(
        number=week.number,
        start=fmt.date_short(week.monday),
        violation_rate=fmt.number(violation_rate.value if violation_rate else None),
        violation_rate_likely=_range(violation_rate),
        close=fmt.percent(close.value if close else None),
        close_likely=_range(close, written=fmt.percent),
        recorded=fmt.percent(week.coverage),
        note=terms.sentence(note) if note else "",
    )


def _range(e: Estimate | None, *, written: Callable[[float | None], str] = fmt.number) -> str:
    if e is None or e.lo is None or e.hi is None:
        return fmt.MISSING
    return say("format.and", first=written(e.lo), last=written(e.hi))


def _differs(report: WeekReport) -> str:
    """Say why the week before reads otherwise in the comparison, where it does."""
    before = report.trend.weeks[-2] if report.trend is not None and len(report.trend.weeks) > 1 else None
    violation_rate = known(before, "violation_rate") if before is not None else None
    there = report.level.violation_rate.previous
    if violation_rate is None or there is None or fmt.number(violation_rate.value) == fmt.number(there):
        return ""
    assert before is not None
    return say("trend.differs", week=before.number, here=fmt.number(violation_rate.value), there=fmt.number(there))


def _is_clear(report: WeekReport, close: float) -> bool:
    """Tell whether a figure of the week clearly changed the way the time spent close did: else no part is named."""
    way = "clear_fall" if close < 0 else "clear_rise"
    share = report.level.close_time_share
    return way in (report.level.violation_rate.verdict, None if share is None else share.verdict)


def _cause(decomposition: Causes, distance: str) -> str:
    close = decomposition.close or 0.0
    parts = {
        "people": decomposition.people or 0.0,
        "layout": decomposition.layout or 0.0,
        "behaviour": decomposition.behaviour or 0.0,
    }
    same_way = {k: v for k, v in parts.items() if v * close > 0}
    name, size = max(same_way.items(), key=lambda item: abs(item[1]), default=("", 0.0))
    if abs(size) < SMALL_MOVE:
        largest = say("causes.nothing")
    else:
        largest = say(f"causes.mostly_{name}_{'fell' if size < 0 else 'rose'}")
    if abs(close) < SMALL_MOVE:
        return say("causes.sentence_same", distance=distance, largest=say("causes.nothing") if not name else largest)
    return say("causes.sentence", change=fmt.less_more(close), distance=distance, largest=largest)


def _measured(effect: LoggedChangeEffect) -> list[tuple[str, Estimate]]:
    """Return the effect of a change, and the change of the whole floor; other figures of it are in the JSON file."""
    figures = (("running", effect.running), ("net", effect.net))
    return [(kind, e) for kind, e in figures if e is not None and e.change is not None]


def _change_effect(effect: LoggedChangeEffect, limit: float) -> tuple[BarRow, ...]:
    """Return what a change did, below whom it is compared with and what speaks against the comparison."""
    n = effect.n_weeks or 0
    parts = [say(f"change_effects.{effect.design}", plural=n, n=n, areas=terms.joined(effect.compared_with))]
    people = effect.people
    if people is not None and people.change is not None:
        is_same = round(people.change * 100) == 0
        parts.append(
            say("change_effects.people_same")
            if is_same
            else say("change_effects.people", change=fmt.fewer_more(people.change))
        )
    if effect.doubts:
        parts.append(say("change_effects.doubt", doubts="; ".join(reason_text(d).rstrip(".") for d in effect.doubts)))
    about = say("change_effects.what", area=effect.area_name, date=fmt.date_short(effect.at.date()))
    rows = [BarRow(name=fmt.ended(effect.text), note=" ".join([about, *parts]), is_head=True)]
    for kind, e in _measured(effect):
        is_judged = kind == "running"  # a change has one verdict
        clear = is_judged and e.verdict in ("clear_fall", "clear_rise")
        verdict = terms.verdict_words(e) if is_judged else fmt.signed(e.change)
        rows.append(
            BarRow(
                name=say(f"change_effects.{kind}"),
                bar=svg.change_bar(e, limit=limit),
                words=say("changed.clear", verdict=verdict, change=fmt.signed(e.change)) if clear else verdict,
                detail=fmt.likely_signed(e) or reason_text(e.reason),
                direction=terms.direction(e.verdict) if is_judged else "same",
            )
        )
    return tuple(rows)
