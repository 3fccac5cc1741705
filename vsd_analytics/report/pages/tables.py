"""Rows of the page's tables, ready to be looped over by the templates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from itertools import groupby
from typing import Final

from markupsafe import Markup

from vsd_analytics.figures.week.model_recording import CameraRecord, Outage
from vsd_analytics.figures.week.results import HourCell
from vsd_analytics.report.draw import svg
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say

HELD_BACK: Final = "\u2026"
BLOCK_DAYS: Final = 7
"""Days beside each other in a table: as many as fit a phone."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of the timetable.

    Attributes:
        style: CSS classes: colour step, part, low, hatch, cl (closed), to (not over), hb (held back).
        text: Text of the cell; empty for no data.
        note: What only screen readers hear.
    """

    style: str
    text: str
    note: str


@dataclass(frozen=True, slots=True)
class TimetableRow:
    """One local hour.

    Attributes:
        label: Hour in two digits.
        is_second: True for the second of two equal hours.
        until: Last hour of a run of hours without any data, in two digits; empty for a single hour.
        cells: Monday to Sunday.
        mean: Mean of its full cells; None without one.
        bar: That mean as a small drawing.
    """

    label: str
    is_second: bool
    cells: tuple[Cell, ...]
    mean: float | None
    bar: Markup
    until: str = ""


@dataclass(frozen=True, slots=True)
class TimetableRows:
    """The whole timetable.

    Attributes:
        days: Monday to Sunday.
        rows: One per local hour that is open on any day.
        day_means: One per day; None without a full hour.
        used: States that occur, so that the legend says no more than needed.
        has_means: True when any mean can be given.
    """

    days: tuple[date, ...]
    rows: tuple[TimetableRow, ...]
    day_means: tuple[float | None, ...]
    used: frozenset[str] = field(default_factory=frozenset)
    has_means: bool = False


def timetable(report: WeekReport) -> TimetableRows:
    """Lay the hours of the week out as a timetable: hours down, days across; hours closed all week are left out."""
    cells = report.when.cells
    days = tuple(date.fromordinal(report.week.monday.toordinal() + k) for k in range(report.week.days))
    at = {(c.day, c.hour, c.fold): c for c in cells}
    rows = sorted({(c.hour, c.fold) for c in cells if c.state != "closed"})
    if rows:
        inner = {(h, 0) for h in range(rows[0][0], rows[-1][0] + 1)}
        rows = sorted(inner | set(rows))
    is_whole_week = len(cells) >= 24 * len(days) - 1

    def absent(fold: int) -> Cell:
        """An hour that is not in the report: skipped by the clocks, or closed where only open hours are given."""
        if fold or is_whole_week:
            return Cell("nx", "", say("when.cell_no_hour"))
        return Cell("cl", fmt.MISSING, say("when.cell_closed"))

    means = {m.hour: m.value for m in report.when.hour_means}
    largest = max((v for v in means.values() if v is not None), default=0.0)
    out = [
        TimetableRow(
            label=f"{hour:02d}",
            is_second=bool(fold),
            cells=tuple(_cell(at[key], report) if (key := (d, hour, fold)) in at else absent(fold) for d in days),
            mean=None if fold else means.get(hour),
            bar=svg.mean_bar(None if fold else means.get(hour), largest=largest),
        )
        for hour, fold in rows
    ]
    used = frozenset(word for row in out for cell in row.cells for word in cell.style.split())
    by_day = {m.day: m.value for m in report.when.day_means}
    return TimetableRows(
        days=days,
        rows=joined(out),
        day_means=tuple(by_day.get(d) for d in days),
        used=used,
        has_means=any(v is not None for v in by_day.values()),
    )


def blocks(table: TimetableRows) -> tuple[TimetableRows, ...]:
    """Return a timetable in parts of at most seven days, each as wide as a week."""

    def part(start: int) -> TimetableRows:
        days = slice(start, start + BLOCK_DAYS)
        rows = tuple(replace(row, cells=row.cells[days]) for row in table.rows)
        return replace(table, days=table.days[days], rows=rows, day_means=table.day_means[days])

    return tuple(part(start) for start in range(0, len(table.days), BLOCK_DAYS))


def joined(rows: Sequence[TimetableRow]) -> tuple[TimetableRow, ...]:
    """Return the rows with runs of three or more that hold no data on any day written as one."""
    joined: list[TimetableRow] = []
    for is_blank, run in groupby(rows, key=lambda r: all(c.style in ("hatch", "cl", "nx") for c in r.cells)):
        run_rows = list(run)
        alike = len({r.cells for r in run_rows}) == 1
        if is_blank and alike and len(run_rows) >= 3:
            run_rows = [replace(run_rows[0], until=run_rows[-1].label)]
        joined += run_rows
    return tuple(joined)


def step_of(value: float, steps: tuple[float, ...]) -> int:
    """Return the colour step of a value: 0 for none, else 1 to 5, the number of lower ends it reaches."""
    return 0 if value <= 0 else min(5, max(1, sum(value >= s for s in steps)))


def highest_hour(report: WeekReport) -> float:
    """Return the greatest number of the timetable, 0 without one."""
    cells = [c for c in report.when.cells if not (c.is_held_back or c.is_masked)]
    values = (c.scaled if c.state == "low_data" and c.scaled is not None else c.violations for c in cells)
    return max((value for value in values if value is not None), default=0.0)


def _cell(cell: HourCell, report: WeekReport) -> Cell:
    if cell.state == "closed":
        return Cell("cl", fmt.MISSING, say("when.cell_closed"))
    if cell.state == "not_over":
        return Cell("to", "", say("when.cell_not_over"))
    if cell.state == "no_data":
        return Cell("hatch", "", say("when.cell_no_data"))
    steps = report.rules.hour_steps
    if cell.is_held_back:
        return Cell("hb", HELD_BACK, say("when.cell_held"))
    if cell.state == "low_data":
        if cell.is_masked:
            return Cell("b1 low", fmt.masked(report.rules.mask_below), say("when.cell_rough"))
        value = cell.scaled if cell.scaled is not None else cell.violations
        if value is None:
            return Cell("hatch", "", say("when.cell_no_data"))
        return Cell(f"b{step_of(value, steps)} low", fmt.count(value), say("when.cell_rough"))
    part = cell.state == "partial" or cell.cameras_down > 0
    style, note = (" part", say("when.cell_incomplete")) if part else ("", "")
    if cell.is_masked:
        return Cell(f"b1{style}", fmt.masked(report.rules.mask_below), note)
    if cell.violations is None:
        return Cell("hatch", "", say("when.cell_no_data"))
    return Cell(f"b{step_of(cell.violations, steps)}{style}", fmt.count(cell.violations), note)


@dataclass(frozen=True, slots=True)
class StripRow:
    """One camera of the table of recorded hours.

    Attributes:
        camera: The camera.
        strips: Monday to Sunday.
    """

    camera: CameraRecord
    strips: tuple[Markup, ...]


def strips(report: WeekReport) -> tuple[StripRow, ...]:
    """Draw what each camera recorded, on one axis of hours for all."""
    cameras = report.coverage.cameras
    hours = [h for c in cameras for d in c.days for h, share in enumerate(d.hourly_share) if share is not None]
    first, last = min(hours, default=0), max(hours, default=23)
    return tuple(
        StripRow(camera=c, strips=tuple(svg.strip(d, first_hour=first, last_hour=last) for d in c.days))
        for c in cameras
    )


@dataclass(frozen=True, slots=True)
class StripBlock:
    """At most seven days of the table of recorded hours.

    Attributes:
        days: The days.
        rows: Each camera and, by day, its strip and its share.
    """

    days: tuple[date, ...]
    rows: tuple[tuple[CameraRecord, tuple[tuple[Markup, float | None], ...]], ...]


def strip_blocks(rows: Sequence[StripRow]) -> tuple[StripBlock, ...]:
    """Return the table of recorded hours in parts as wide as a week; none without a camera."""
    if not rows:
        return ()
    every = [
        (row.camera, [(drawing, day.share) for drawing, day in zip(row.strips, row.camera.days, strict=True)])
        for row in rows
    ]
    days = [day.day for day in rows[0].camera.days]
    return tuple(
        StripBlock(
            days=tuple(days[start : start + BLOCK_DAYS]),
            rows=tuple((camera, tuple(cells[start : start + BLOCK_DAYS])) for camera, cells in every),
        )
        for start in range(0, len(days), BLOCK_DAYS)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class OutageRow:
    """An outage and whose it was."""

    who: str
    outage: Outage


def outage_row(outage: Outage, names: Mapping[str, str]) -> OutageRow:
    """Return an outage with the names of its cameras."""
    everyone = len(outage.camera_ids) == len(names) > 1
    who = say("data.all_cameras") if everyone else terms.joined(names.get(c, c) for c in outage.camera_ids)
    return OutageRow(who=who, outage=outage)


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a legend: its CSS class and its words."""

    style: str
    text: str


def legend(steps: tuple[float, ...], *, is_count: bool, highest: float = 0.0) -> tuple[Step, ...]:
    """Write the steps of a ramp: 0.5–1, 1–2, ..., 8+; counts as under 50, 50–99, ..., 200+ (or to the highest)."""
    plain = [fmt.plain(s) for s in steps]
    texts = []
    for i, lower in enumerate(steps):
        upper = steps[i + 1] if i + 1 < len(steps) else None
        if upper is None:
            is_reached = is_count and fmt.count(highest) != fmt.count(lower) and highest > lower
            texts.append(f"{plain[i]}\u2013{fmt.count(highest)}" if is_reached else f"{plain[i]}+")
        elif is_count and lower == 0:
            texts.append(say("when.legend_under", n=fmt.plain(upper)))
        elif is_count:
            texts.append(f"{fmt.plain(lower)}\u2013{fmt.plain(upper - 1)}")
        else:
            texts.append(f"{plain[i]}\u2013{plain[i + 1]}")
    return tuple(Step(f"b{min(i, 4) + 1}", t) for i, t in enumerate(texts))
