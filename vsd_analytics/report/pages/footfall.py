"""The page of footfall: how many people cross the counting lines of a floor, beside what is usual, and next week."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from itertools import groupby
from typing import Final

from markupsafe import Markup

from vsd_analytics.answer import Answer, Answers, Row, Value, value_of
from vsd_analytics.figures.footfall import MOST_RECORDED
from vsd_analytics.report.draw.line_chart import LineDay, line_chart
from vsd_analytics.report.draw.trend_chart import NARROW
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.site.model import Floor, Site
from vsd_analytics.version import VERSION
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

NAMED_MAX: Final = 3
"""Lines that the first sentence names; of more it says how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FootfallRow:
    """A row of a table: the name of a line, and texts."""

    name: str
    cells: tuple[str, ...]
    position: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LineWeeksView:
    """The last weeks of a line, drawn; empty without a number."""

    name: str
    chart: Markup
    said: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FootfallPage:
    """Everything the template may use.

    Attributes:
        site, floor: Names; the floor is empty where the site has only one.
        week, days: The week and its days.
        title: Title of the window.
        headline: One sentence, without a full stop.
        said: What is above or below its usual range, as sentences.
        lines: A row for each line.
        line_notes: Why numbers are missing, and days of one year only.
        weeks: The last weeks of each line.
        next_days: Names of the open days of next week.
        next: A row for each line that has a number.
        next_notes: What the calendar says of next week, and why numbers are missing.
        style, style_hash: The page's only style, and its hash for the content security policy.
        is_exact: It is the operator's.
        is_made_up: The data are those of `vsd demo`.
        made_by: The program.
    """

    site: str
    floor: str
    week: str
    days: str
    title: str
    headline: str
    said: tuple[str, ...]
    lines: tuple[FootfallRow, ...]
    line_notes: tuple[str, ...]
    weeks: tuple[LineWeeksView, ...]
    next_days: tuple[str, ...]
    next: tuple[FootfallRow, ...]
    next_notes: tuple[str, ...]
    weeks_read: str
    next_read: str
    style: Markup
    style_hash: str
    is_exact: bool
    is_made_up: bool
    made_by: str


def footfall_html(
    answers: Answers, site: Site, floor: Floor, monday: date, *, is_exact: bool, is_made_up: bool = False
) -> str:
    """Return the page as one self-contained HTML file, in the language in force.

    Args:
        answers: `footfall`, `footfall_weeks` and `footfall_next`.
        site: The site.
        floor: The floor.
        monday: First day of the week.
        is_exact: Nothing is hidden.
        is_made_up: The data are those of `vsd demo`.
    """
    week, history, coming = (answers[name] for name in ("footfall", "footfall_weeks", "footfall_next"))
    style = shipped_style("report.css") + shipped_style("footfall.css")
    name = f"{monday:%G-W%V}"
    days = sorted({_date(row) for row in coming.rows})
    next_rows, next_notes = _next(coming, days)
    page = FootfallPage(
        site=site.name,
        floor="" if len(site.floors) == 1 else floor.name,
        week=name,
        days=fmt.days_span(monday, monday + timedelta(days=6)),
        title=say("footfall.title", site=site.name, week=name),
        headline=_headline(week.rows),
        said=(*_said(week.rows), *_special(week), *(() if is_exact else _few(week.rows))),
        lines=tuple(_line(row) for row in week.rows),
        line_notes=_line_notes(week.rows),
        weeks=tuple(_weeks(list(rows)) for _, rows in groupby(history.rows, key=lambda row: row["line_id"])),
        next_days=tuple(f"{fmt.day_short(day)} {day.day}" for day in days),
        next=next_rows,
        next_notes=next_notes,
        weeks_read=say("footfall.weeks_read", share=fmt.percent(MOST_RECORDED)),
        next_read=say("footfall.next_read", share=fmt.percent(site.settings.forecast_share)),
        style=Markup(style),
        style_hash=policy_hash(style),
        is_exact=is_exact,
        is_made_up=is_made_up,
        made_by=say("today.made_by", version=VERSION),
    )
    return rendered("footfall.html.j2", page)


def _few(rows: Sequence[Row]) -> Iterable[str]:
    """Yield that a reader's numbers may hold crossings of closed hours, which are few (`figures.footfall`)."""
    if any(value_of(row, "n_open").value is not None for row in rows):
        yield say("footfall.few")


def _headline(rows: Sequence[Row]) -> str:
    known = [n for row in rows if (n := value_of(row, "n_open").value) is not None]
    if not known:
        return say("footfall.headline_none")
    return say("footfall.headline", plural=len(known), lines=fmt.count(len(known)), n=fmt.count(sum(known)))


def _said(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return sentences on lines above and below their usual range."""
    sentences = []
    for side in ("above", "below"):
        names = [str(row["name"]) for row in rows if _position(row) == side]
        if names:
            shown = terms.joined(f"“{n}”" for n in names) if len(names) <= NAMED_MAX else fmt.count(len(names))
            sentences.append(terms.capital(say(f"footfall.{side}", plural=len(names), n=shown)) + ".")
    if not sentences and any(_position(row) == "within" for row in rows):
        sentences.append(say("footfall.all_usual"))
    return (*sentences, say("footfall.twice")) if len(rows) > 1 else tuple(sentences)


def _special(answer: Answer) -> tuple[str, ...]:
    """Return what the calendar says of the week, as sentences."""
    notes = _calendar(answer)
    return (*notes, say("footfall.ordinary")) if notes else ()


def _calendar(answer: Answer) -> tuple[str, ...]:
    """Return the notes of an answer, as sentences."""
    return tuple(fmt.ended(terms.capital(text)) for _, note in answer.notes if (text := reason_text(note)))


def _position(row: Row) -> str | None:
    """Return where a line lies beside its usual range; None where either is not known, or hidden."""
    shown = all(value_of(row, name).value is not None for name in ("per_open_h", "usual_lo"))
    return str(row["beside_usual"]) if shown and row["beside_usual"] is not None else None


def _line(row: Row) -> FootfallRow:
    lo, hi = (value_of(row, name).value for name in ("usual_lo", "usual_hi"))
    usual = fmt.MISSING if lo is None or hi is None else say("footfall.range", lo=fmt.number(lo), hi=fmt.number(hi))
    position = _position(row)
    cells = (
        fmt.count(value_of(row, "n_open").value),
        fmt.number(value_of(row, "per_open_h").value),
        usual,
        fmt.MISSING if position is None else say(f"footfall.beside_{position}"),
        *(fmt.signed(value_of(row, name).value) for name in ("change_week", "change_year")),
    )
    return FootfallRow(name=str(row["name"]), cells=cells, position=position)


def _line_notes(rows: Sequence[Row]) -> tuple[str, ...]:
    columns = ("n_open", "per_open_h", "usual_lo", "change_week", "change_year")
    special = dict.fromkeys(name for row in rows for name in _texts(row["special_days"]))
    differ = (say("footfall.days_differ", names=terms.joined(list(special))),) if special else ()
    return (*differ, *_why_missing(value_of(row, column) for row in rows for column in columns))


def _texts(cell: object) -> tuple[str, ...]:
    return tuple(str(each) for each in cell) if isinstance(cell, tuple | list) else ()


def _why_missing(values: Iterable[Value]) -> tuple[str, ...]:
    reasons = dict.fromkeys(reason_text(value.reason) for value in values if value.value is None and value.reason)
    return tuple(say("footfall.dash", reason=reason or "") for reason in reasons)


def _weeks(rows: Sequence[Row]) -> LineWeeksView:
    """Return the drawing of the weeks of a line."""
    name = str(rows[0]["name"])
    values = [(date.fromisoformat(_monday(str(row["week"]))), value_of(row, "per_open_h")) for row in rows]
    if not any(value.value for _, value in values):
        why = next((value.reason for _, value in reversed(values) if value.reason), None)
        return LineWeeksView(name=name, chart=Markup(), said=say("footfall.dash", reason=reason_text(why) or ""))
    days = [
        LineDay(
            day=day, n_left=None, n_right=None, n_both=0.0 if value.value is None else value.value,
            is_recorded=value.value is not None, is_whole=value.value is not None,
        )
        for day, value in values
    ]  # fmt: skip
    weeks = "; ".join(f"{row['week']}: {fmt.number(value.value)}" for row, (_, value) in zip(rows, values, strict=True))
    return LineWeeksView(
        name=name,
        said="",
        chart=line_chart(days, width=NARROW, label=say("footfall.week_label", name=name, weeks=weeks), is_weekly=True),
    )


def _monday(week: str) -> str:
    return datetime.strptime(f"{week}-1", "%G-W%V-%u").date().isoformat()


def _next(coming: Answer, days: Sequence[date]) -> tuple[tuple[FootfallRow, ...], tuple[str, ...]]:
    """Return a row for each line of which something is expected, and notes."""
    rows = []
    for _, of_line in groupby(coming.rows, key=lambda row: row["line_id"]):
        by_day = {_date(row): row for row in of_line}
        expected = {day: value_of(row, "n_expected").value for day, row in by_day.items()}
        if not any(n is not None for n in expected.values()):
            continue
        busy = [(value_of(row, "n_busiest"), row) for row in by_day.values()]
        busiest = max((b for b in busy if b[0].value is not None), key=lambda b: b[0].value or 0.0, default=None)
        cells = tuple(fmt.count(None if (n := expected.get(day)) is None else round(n)) for day in days)
        rows.append(FootfallRow(name=str(next(iter(by_day.values()))["name"]), cells=(*cells, _busiest(busiest))))
    missing = _why_missing(value_of(row, "n_expected") for row in coming.rows)
    return tuple(rows), (*_calendar(coming), *missing)


def _busiest(busiest: tuple[Value, Row] | None) -> str:
    if busiest is None:
        return fmt.MISSING
    value, row = busiest
    hour = int(str(row["busiest_hour"]))
    lo, hi = (fmt.count(None if end is None else round(end)) for end in (value.lo, value.hi))
    return say("footfall.busiest", day=fmt.day_short(_date(row)), hour=fmt.hour_label(hour), lo=lo, hi=hi)


def _date(row: Row) -> date:
    day = row["local_date"]
    return day if isinstance(day, date) else date.fromisoformat(str(day))
