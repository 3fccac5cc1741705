"""Counting lines and doors as the page shows them: people to either side by day, and people inside by the doors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Final

from markupsafe import Markup

from vsd_analytics.answer import Answer, Row, Value, value_of
from vsd_analytics.figures.lines import ONE_NUMBER
from vsd_analytics.report.draw.line_chart import LineDay, line_chart
from vsd_analytics.report.draw.trend_chart import NARROW, WIDE
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

LINES_MAX: Final = 4
"""Lines that a page shows; all are in the JSON file."""
DAYS_MAX: Final = 7
"""With more days, the table of people inside has no rows of days."""
_SIDES: Final = (("left", "n_to_left"), ("right", "n_to_right"))
_INSIDE: Final = ("people", "people_in_view", "most_people", "drift")
_WHOLE: Final = frozenset({"most_people", "drift"})
"""Numbers of people, not means, in rows of one day."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineView:
    """A line: its name, its days drawn where somebody crossed, and sentences."""

    name: str
    wide: Markup
    narrow: Markup
    said: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class InsideRow:
    """A week or a day: people inside by the doors, people in view, the most inside, people left over; texts."""

    name: str
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinesView:
    """The section.

    Attributes:
        lines: The first lines of vsd.toml.
        rest: How many more there are, in a sentence; empty for none.
        inside: People inside by the doors; empty where the floor has no doors, and where nothing is known.
        inside_notes: How to read it, and why numbers are missing; empty where the floor has no doors.
    """

    lines: tuple[LineView, ...]
    rest: str
    inside: tuple[InsideRow, ...]
    inside_notes: tuple[str, ...]


def lines_and_doors(report: WeekReport) -> LinesView | None:
    """Return the lines and doors of a report; None where it has no lines, or the site asks for no section of them."""
    whole, days = report.answers.get("lines"), report.answers.get("line_days")
    if whole is None or days is None or not has_lines(report):
        return None
    rest = len(whole.rows) - LINES_MAX
    inside, notes = _inside(report.answers.get("doors"), report.answers.get("door_days"))
    return LinesView(
        lines=tuple(_line(row, list(days.where(line_id=str(row["line_id"])))) for row in whole.rows[:LINES_MAX]),
        rest=say("lines.rest", plural=rest, n=fmt.count(rest)) if rest > 0 else "",
        inside=inside,
        inside_notes=notes,
    )


def has_lines(report: WeekReport) -> bool:
    """Tell whether the report has lines and the site asks for their section."""
    whole = report.answers.get("lines")
    return report.rules.show_lines and whole is not None and bool(whole.rows)


def _line(row: Row, rows: Sequence[Row]) -> LineView:
    name, days = str(row["name"]), [_day(each) for each in rows]
    wide = narrow = Markup("")
    if any(n for day in days for n, *_ in day.bars):
        by_day = "; ".join(f"{_day_name(d.day)}: {', '.join(fmt.count(n) for n, *_ in d.bars)}" for d in days)
        label = say(
            "lines.label_both" if _has_one_number(row) else "lines.label",
            name=name,
            left=row["left"],
            right=row["right"],
            days=by_day,
        )
        wide, narrow = (line_chart(days, width=width, label=label) for width in (WIDE, NARROW))
    return LineView(name=name, wide=wide, narrow=narrow, said=_said(row))


def _day(row: Row) -> LineDay:
    left, right = (value_of(row, column) for _, column in _SIDES)
    return LineDay(
        day=_date(row),
        n_left=left.value,
        n_right=right.value,
        n_both=value_of(row, "n_both").value if _has_one_number(row) else None,
        is_recorded=bool(row["recorded_h"]) and (left.state != "not_measurable" or _has_one_number(row)),
        is_whole=not row["unrecorded_open_h"],
    )


def _has_one_number(row: Row) -> bool:
    """Tell whether a counter counts both ways in one number."""
    left, right = (value_of(row, column) for _, column in _SIDES)
    return left.value is None and right.value is None and left.reason == ONE_NUMBER


def _said(row: Row) -> tuple[str, ...]:
    values = [value_of(row, column) for _, column in _SIDES]
    reasons = {_why(value) for value in values if value.value is None}
    if _has_one_number(row):
        both = value_of(row, "n_both")
        if both.value is None:
            sentences = [say("lines.unknown", reason=_why(both))]
        else:
            sentences = [say("lines.both", n=fmt.count(both.value), left=row["left"], right=row["right"])]
    elif len(reasons) == 1 and all(value.value is None for value in values):
        sentences = [say("lines.unknown", reason=reasons.pop())]
    else:
        sentences = [
            say(f"lines.no_{side}", side=row[side], reason=_why(value))
            if value.value is None
            else say(f"lines.{side}", side=row[side], n=fmt.count(value.value))
            for (side, _), value in zip(_SIDES, values, strict=True)
        ]
    share = row["recorded_open_share"]
    if isinstance(share, float):
        sentences.append(say("lines.recorded" if share == 1 else "lines.recorded_part", share=fmt.percent(share)))
    return tuple(sentences)


def _inside(doors: Answer | None, days: Answer | None) -> tuple[tuple[InsideRow, ...], tuple[str, ...]]:
    """Return the table of people inside, and its notes."""
    if doors is None or days is None:
        return (), ()
    if not doors.rows:
        return (), (say("lines.no_inside", reason=reason_text(doors.nothing) or say("words.too_little_data")),)
    whole = doors.rows[0]
    if all(value_of(whole, name).value is None for name in _INSIDE):
        reasons = dict.fromkeys(_why(value_of(whole, name)) for name in _INSIDE)
        return (), tuple(say("lines.no_inside", reason=reason) for reason in reasons)
    rows = [(say("lines.whole"), whole)]
    if len(days.rows) <= DAYS_MAX:
        rows += [(_day_name(_date(row)), row) for row in days.rows if row["open_h"]]
    missing = dict.fromkeys(_why(v) for _, r in rows for v in (value_of(r, n) for n in _INSIDE) if v.value is None)
    known_h, open_h = (float(str(whole[name])) for name in ("known_open_h", "open_h"))
    notes = [] if known_h == open_h else [say("lines.inside_part", known=fmt.number(known_h), open=fmt.number(open_h))]
    notes.append(say("lines.inside_read"))
    per_1000 = value_of(whole, "drift_per_1000").value
    if per_1000 is not None:
        notes.append(say("lines.per_1000", n=fmt.number(per_1000)))
    notes += [say("lines.dash", reason=reason) for reason in missing]
    return tuple(InsideRow(name=name, cells=_cells(row)) for name, row in rows), tuple(notes)


def _cells(row: Row) -> tuple[str, ...]:
    values = ((name, value_of(row, name).value) for name in _INSIDE)
    return tuple(fmt.count(n) if name in _WHOLE and n == round(n or 0) else fmt.number(n) for name, n in values)


def _date(row: Row) -> date:
    day = row["local_date"]
    return day if isinstance(day, date) else date.fromisoformat(str(day))


def _day_name(day: date) -> str:
    return f"{fmt.day_short(day)} {day.day}"


def _why(value: Value) -> str:
    return reason_text(value.reason) or say("words.too_little_data")
