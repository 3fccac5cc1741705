"""One window of the search for hotspots: the test over its days, with what a logged change restarts (M20).

The test is `vsd_analytics.stats.hotspots`, over cells of 1 m, on person-time where each person stands and on what
random mixing of the same crowd and map would make of it (`cell_hours.mixed_of_pieces`). A cell enters it when the
cameras see at least 80 % of the disc of the legal distance around it: at the border of the view neighbours are missing.
A change of the log in an area leaves out the days until then of the cells in it and within the legal distance of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Final, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.answer import Reason
from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures.cell_hours import mixed_of_pieces
from vsd_analytics.figures.cell_weeks import SIDE_M, CellWeeks
from vsd_analytics.figures.floor_days import Cube, FloorDays, Grid
from vsd_analytics.figures.share.together import Ints, evened_days
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.site.model import Floor
from vsd_analytics.stats import hotspots as test
from vsd_analytics.warehouse.warehouse import Warehouse

CELL_M: Final = SIDE_M
"""Side of the cells that are tested: the smoothing makes finer ones alike, and their tests cost power."""
SIGMA_M: Final = 1.0
"""Standard deviation of the smoothing of person-time."""
SEEN_SHARE: Final = 0.8
"""Share of the disc of the legal distance around a cell that cameras must see."""
UNTOLD: Final = Reason("map.together_unknown")

State = Literal["ok", "not_enough_data", "not_measurable"]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """The test over one window."""

    last: date
    days: slice
    state: State
    reason: Reason | None
    cube: Cube | None = None
    tested: test.Hotspots | None = None
    is_border_known: bool = True
    changed: tuple[LoggedChange, ...] = ()

    def changed_on(self, inside: Flags) -> date | None:
        """Return the day of the last change of the window in or near some cells."""
        return max((c.day for c in self.changed if (c.near & inside).any()), default=None)


@dataclass(frozen=True, slots=True, eq=False)
class LoggedChange:
    """A change of the log: its local day, the first day that counts after it, and the cells in or near its area."""

    day: date
    counts_from: date
    near: Flags


@dataclass(frozen=True, slots=True, eq=False)
class FloorWindows:
    """What all windows of a floor share."""

    warehouse: Warehouse
    data: FloorDays
    hours: CellWeeks | None
    changes: tuple[LoggedChange, ...]


def floor_windows(warehouse: Warehouse, data: FloorDays) -> FloorWindows:
    """Return what all windows of a floor share, read once."""
    if data.grid is None:
        return FloorWindows(warehouse, data, None, ())
    hours = CellWeeks(warehouse, data.floor)
    return FloorWindows(
        warehouse, data, hours if hours.grid is not None else None, _changes(warehouse, data, data.grid)
    )


def _changes(warehouse: Warehouse, data: FloorDays, grid: Grid) -> tuple[LoggedChange, ...]:
    """Return the changes of the log in areas of this floor; one of the whole site is near no place."""
    site = warehouse.site
    drawn = {a.area_id: shapely.Polygon(a.polygon) for a in site.areas if a.floor_id == data.floor.floor_id}
    x, y = np.meshgrid(grid.x_m(np.arange(grid.shape[1])), grid.y_m(np.arange(grid.shape[0])))
    middles, settles = shapely.points(x, y), timedelta(days=1 + int(site.settings.washout_days) // 2)
    changes = []
    for entry in read_log(site):
        if entry.area_id in drawn:
            day = entry.at.astimezone(site.zone).date()
            near = shapely.distance(drawn[entry.area_id], middles) <= site.settings.distance_m
            changes.append(LoggedChange(day, day + settles, near))
    return tuple(changes)


def window_of(floor: FloorWindows, last: date) -> Window:
    """Return the test over the window that ends with `last`, or why it cannot be made."""
    warehouse, data = floor.warehouse, floor.data
    settings = warehouse.site.settings
    n_days = int(settings.hotspot_days)
    first = last - timedelta(days=n_days - 1)
    days = data.span(first, last)
    if (why := data.why_unknown(days) or _why_no_places(warehouse, data.floor, last, n_days)) is not None:
        return Window(last, days, "not_measurable", why)
    if data.why_no_grid is not None:
        return Window(last, days, "not_measurable", data.why_no_grid)
    covered = int(data.is_used[:, days].any(axis=0).sum())
    if covered < settings.hotspot_min_days or data.grid is None:
        why = Reason(
            "hotspots.days",
            has=covered,
            n=n_days,
            share=settings.min_coverage,
            least=settings.hotspot_min_days,
        )
        return Window(last, days, "not_enough_data", why)
    cube = data.cube(days)
    if cube.n.sum() < settings.hotspot_min_violations:
        why = Reason("hotspots.violations", least=settings.hotspot_min_violations, days=n_days)
        return Window(last, days, "not_enough_data", why, cube)
    person_time = _person_time(floor, days)
    if person_time is None:
        return Window(last, days, "not_measurable", UNTOLD, cube)
    changed = tuple(c for c in floor.changes if first <= c.day <= last)
    recorded = cube.is_recorded.copy()
    for change in changed:
        recorded[: max(0, data.index(change.counts_from) - days.start), change.near] = False
    seen = data.seen_share(days, radius_m=settings.distance_m, cells=np.asarray(cube.exposure_h.any(axis=0)))
    together = warehouse.counted_together.get(data.floor.floor_id, ())
    close_h, *others = person_time
    window_hotspots = test.hotspots(
        evened_days(close_h, recorded, [_days_of(starts, data, days) for starts in together]),
        *others,
        sigma_cells=SIGMA_M / CELL_M,
        is_recorded=recorded,
        is_eligible=None if seen is None else np.nan_to_num(seen) >= SEEN_SHARE,
        q_max=settings.hotspot_false_share,
        min_ratio=settings.hotspot_min_ratio,
        min_days=int(settings.hotspot_min_days),
        confidence=settings.confidence,
    )
    return Window(last, days, "ok", None, cube, window_hotspots, seen is not None, changed)


def _person_time(floor: FloorWindows, days: slice) -> tuple[NDArray[np.float64], ...] | None:
    """Return person-hours in violation, in all and of random mixing, by day and cell; None where that is unknown."""
    data, hours = floor.data, floor.hours
    if hours is None or hours.grid is None or data.grid is None:
        return None
    pieces = hours.window(data.day(days.start), data.day(days.stop - 1))
    if not pieces:
        return None
    shape = (days.stop - days.start, *data.grid.shape)
    totals, is_any = [np.zeros(shape) for _ in range(3)], False
    place_of = _places(hours.grid, data.grid)
    mixed_by_piece = mixed_of_pieces(floor.warehouse, data.floor, pieces)
    for piece, mixed in zip(pieces, mixed_by_piece, strict=True):
        since = piece.used["local_date"].to_numpy().astype("datetime64[D]") - np.datetime64(data.day(days.start))
        day = since.astype(np.int64)
        camera = np.array([data.camera_index(c) for c in piece.used["camera_id"].to_pylist()], dtype=np.int64)
        place = place_of[piece.cell]
        used = (place >= 0) & np.isfinite(mixed) & data.is_used[camera, days.start + day][piece.hour]
        is_any |= bool(used.any())
        kept = slice(None) if used.all() else np.flatnonzero(used)
        place = place[kept] + (day * totals[0][0].size)[piece.hour[kept]]
        for total, values in zip(totals, (piece.violation_s, piece.exposure_s, mixed), strict=True):
            np.add.at(total.reshape(-1), place, values[kept] / 3600)
    return tuple(totals) if is_any else None


def _places(grid: Grid, other: Grid) -> Ints:
    """Return the number of each cell of a grid in another one with cells of the same side; -1 where it is beyond."""
    row, column = (np.arange(n)[:, None] for n in grid.shape)
    row, column = row + grid.cy - other.cy, column.T + grid.cx - other.cx
    inside = (row >= 0) & (row < other.shape[0]) & (column >= 0) & (column < other.shape[1])
    return np.where(inside, row * other.shape[1] + column, -1).ravel()


def _days_of(starts: Iterable[int], data: FloorDays, days: slice) -> Ints:
    """Return the local days of hours that start at UTC instants, as positions in a window."""
    local = (datetime.fromtimestamp(ms / 1000, data.zone).date() for ms in starts)
    at: Ints = np.unique([data.index(day) - days.start for day in local]).astype(np.int64)
    inside: Ints = at[(at >= 0) & (at < days.stop - days.start)]
    return inside


def untested_by_change(look: Window) -> Flags | None:
    """Return the cells that a change left untested: nothing of them is known yet."""
    if look.tested is None or not look.changed:
        return None
    near = np.logical_or.reduce([c.near for c in look.changed])
    return np.asarray(near & ~look.tested.cells.is_tested)


def _why_no_places(warehouse: Warehouse, floor: Floor, last: date, n_days: int) -> Reason | None:
    row = warehouse.rows(
        "select count(*) as n, count(*) filter (where cx is null) as n_unplaced from violations "
        "where floor_id = $floor and is_open and local_date between $first and $last",
        {"floor": floor.floor_id, "first": last - timedelta(days=n_days - 1), "last": last},
    )[0]
    return NO_POSITIONS if row["n_unplaced"] * 2 > row["n"] else None
