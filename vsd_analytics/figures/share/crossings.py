"""What readers may know of crossings: nothing that tells how few came late, and no single hour of few people.

A week of a counting line can change after it was shared: a door counter sends its sums late, or others than before. Who
has both versions has their difference. So what left is remembered (`earlier`), and a week whose sums changed by too
little does not leave again. What is expected of hours is computed from hours as readers may know them: those with few
crossings have equal parts of their sum.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.answer import Answer, Reason, Row, Value, value_of
from vsd_analytics.figures.share.counts import Mask, is_small
from vsd_analytics.figures.share.earlier import SharedLine, read_lines, remember
from vsd_analytics.figures.share.weeks import CHANGED, OTHER_PEOPLE
from vsd_analytics.site.model import Site

Floats = NDArray[np.float64]
Week = tuple[str, date]
"""A line, empty for the doors of the floor, and the Monday of a week."""
_WEEKS: Final = "footfall_weeks"
_COUNTED: Final = ("lines", "line_days", "line_hours", "doors", "door_days", "footfall", _WEEKS)
"""Answers whose counts are remembered."""
_MADE_OF: Final = ("line_peaks", "footfall_next")
"""Answers that are made of the same crossings."""
_OF_THE_WEEK: Final = ("n_open", "per_open_h")
"""Columns of `footfall` that earlier weeks do not enter."""
_YEAR: Final = timedelta(weeks=52)


def evened_hours(n: Floats, recorded_h: Floats, *, mask: Mask) -> Floats:
    """Return crossings by hour of some weeks, with equal parts of their sum in the hours of each week that have few.

    The fewest other crossings of the week join them until they are two hours and enough people; where that cannot be,
    the week has no hour that readers may know.

    Args:
        n: Crossings, shape (n_weeks, n_hours).
        recorded_h: Recorded hours, same shape; in parts of an hour, its crossings have as small a part.
        mask: Tells which counts are small.

    Returns:
        The same shape; NaN in weeks of which readers may know no hour.
    """
    parts = n.astype(np.float64)
    for week_n, h in zip(parts, recorded_h, strict=True):
        few = [int(k) for k in np.flatnonzero(h > 0) if mask.hides(week_n[k])]
        others = sorted(
            (k for k in np.flatnonzero(h > 0) if week_n[k] > 0 and k not in few), key=lambda k: (week_n[k], k)
        )
        while few and others and (len(few) == 1 or mask.hides(week_n[few].sum())):
            few.append(int(others.pop(0)))
        if len(few) == 1 or (few and mask.hides(week_n[few].sum())):
            week_n[:] = np.nan
        elif few:
            week_n[few] = week_n[few].sum() * h[few] / h[few].sum()
    return parts


def crossings_again(answers: Iterable[Answer], site: Site, *, below: int) -> list[Answer]:
    """Return answers for readers without crossings of weeks that changed by too little since they were shared.

    What is left is remembered. Only weeks leave, so answers of other days are not looked at.

    Args:
        answers: Exact answers that leave together.
        site: The project.
        below: Counts from 1 to `below` - 1 are small.

    Raises:
        DiskError: E304 to E306, the disk refused; then nothing may be shared.
    """
    every = list(answers)
    asked = [answer for answer in every if answer.name in (*_COUNTED, *_MADE_OF)]
    holds = asked[0].holds_for if asked else None
    if holds is None or holds.first.weekday() or holds.last - holds.first != timedelta(days=6):
        return every
    floor_id, monday = str(holds.floor_id), holds.first
    told: dict[Week, dict[str, int]] = {}
    for answer in asked:
        for week, name, count in _told(answer):
            told.setdefault(week, {})[name] = count
    before: dict[Week, list[SharedLine]] = {}
    for then in read_lines(site):
        if then.floor_id == floor_id:
            before.setdefault((then.line_id, then.monday), []).append(then)
    held: dict[Week, Reason] = {}
    for week, n in told.items():
        reasons = (_why_not(n, then, site.settings.people, below) for then in before.get(week, ()))
        if (why := next((reason for reason in reasons if reason is not None), None)) is not None:
            held[week] = why
    doors = ("", monday)
    if doors in told and (of_lines := [why for (_, line_monday), why in held.items() if line_monday == monday]):
        held.setdefault(doors, of_lines[0])  # all doors less the others would tell the line
    leaves = [SharedLine(floor_id, *week, n, site.settings.people) for week, n in told.items() if week not in held]
    remember(site, leaves)
    return [_without(answer, held, monday) if answer in asked else answer for answer in every] if held else every


def _told(answer: Answer) -> Iterable[tuple[Week, str, int]]:
    """Yield the counts of an answer: whose, of which week, under which name; what is unknown is 0."""
    if answer.name not in _COUNTED:
        return
    for row in answer.rows:
        place = "".join(f"{row[key]} " for key in ("local_date", "local_hour") if key in row)
        for column in answer.columns:
            if column.kind == "count" and column.audience == "anybody":
                yield _week_of(answer, row), f"{place}{column.name}", _count(row, column.name)
        if "n_year" in row:
            line_id, monday = _week_of(answer, row)
            yield (line_id, monday - _YEAR), "n_open", _count(row, "n_year")


def _week_of(answer: Answer, row: Row) -> Week:
    line_id = str(row.get("line_id", ""))
    return line_id, _monday(str(row["week"])) if "week" in row else answer.holds_for.first


def _monday(week: str) -> date:
    return datetime.strptime(f"{week}-1", "%G-W%V-%u").date()


def _count(row: Row, name: str) -> int:
    return round(value_of(row, name).value or 0)


def _why_not(n: Mapping[str, int], then: SharedLine, people: str, below: int) -> Reason | None:
    """Return why sums may not leave after others did; None where they may."""
    changes = [abs(n[name] - then.n[name]) for name in n.keys() & then.n.keys()]
    if then.people != people and any(changes):
        return OTHER_PEOPLE
    return CHANGED if any(is_small(change, below=below) for change in changes) else None


def _without(answer: Answer, held: Mapping[Week, Reason], monday: date) -> Answer:
    """Return an answer without what is made of weeks that do not leave again."""

    def shown(row: Row) -> Row:
        week = _week_of(answer, row)
        of_line = [why for (line_id, _), why in held.items() if line_id == week[0]]
        if not of_line:
            return row
        is_held = week in held
        if answer.name in ("footfall", "footfall_next"):
            kept = () if is_held or answer.name == "footfall_next" else _OF_THE_WEEK
        elif is_held:
            kept = ()
        else:
            return row
        why = held.get(week, of_line[0])
        hidden = {name: Value.missing(why) for name, cell in row.items() if isinstance(cell, Value)}
        facts = dict.fromkeys({"beside_usual", "busiest_hour"} & row.keys())
        return {**row, **hidden, **facts, **{name: row[name] for name in kept}}

    return replace(answer, rows=tuple(shown(row) for row in answer.rows))
