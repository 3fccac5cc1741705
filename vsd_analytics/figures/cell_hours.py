"""Who stood in which cell of a floor, hour by hour, and what random mixing would bring into violation (M16 to M20).

The mart `cell_hours` as arrays, for maps and for the test of hotspots.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import Final, NotRequired, TypedDict, Unpack

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.floor_days import NO_FLOOR, Flags, Floats, Grid, Ints, grid_over
from vsd_analytics.figures.slots import NO_POSITIONS, NOTHING_OPEN
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Floor
from vsd_analytics.stats.decomposition import closeness, nearby
from vsd_analytics.warehouse.warehouse import Warehouse

CELL_M: Final = 0.5
"""Side of the cells of the maps M16 to M19: part of their definition, and a multiple of the stored cells."""
NOBODY: Final = Reason("nobody.seen_open")


class CellRange(TypedDict):
    """Which cells of which days are asked for.

    Attributes:
        floor: The floor.
        cell_m: Side of the cells, a multiple of `cell_m` of vsd.toml; 0.5 m where it is left out.
        first: First local day; the warehouse's where it is left out or None.
        last: Last local day; likewise.
    """

    floor: Floor
    cell_m: NotRequired[float]
    first: NotRequired[date | None]
    last: NotRequired[date | None]


@dataclass(frozen=True, slots=True, eq=False)
class CellHours:
    """Camera-hours and cells.

    Attributes:
        grid: The cells; None where nothing can be shown.
        state, reason: Why there is no grid.
        is_everything: No camera-hour was left out for what its engine does not send.
        used: The camera-hours, columns of `_USED`.
        hour: Of each row, its place among the used camera-hours.
        cell: Of each row, its cell: row of the grid times its columns, and column.
        exposure_s: Of each row, person-seconds.
        violation_s: Of each row, person-seconds in violation, where each person stands.
    """

    grid: Grid | None
    state: State
    reason: Reason | None
    is_everything: bool
    used: pa.Table
    hour: Ints
    cell: Ints
    exposure_s: Floats
    violation_s: Floats

    def summed(self, values: Floats, by: Ints | None = None, n: int = 1) -> Floats:
        """Return sums by cell, shape of the grid; with `by`, below n, one map of each: shape (n, ...)."""
        assert self.grid is not None
        sums = np.zeros((n, *self.grid.shape))
        np.add.at(sums.reshape(-1), self.cell if by is None else by * sums[0].size + self.cell, values)
        return sums if by is not None else sums[0]

    def where(self, kept: Flags) -> CellHours:
        """Return some of the rows, of the same camera-hours and grid."""
        parts = {name: getattr(self, name)[kept] for name in ("hour", "cell", "exposure_s", "violation_s")}
        return replace(self, **parts)

    def between(self, first: date, last: date) -> CellHours:
        """Return the camera-hours of some days alone, of the same grid; those of this one are in order of days."""
        day = self.used["local_date"].to_numpy().astype("datetime64[D]")
        ends = np.array([first, last + timedelta(days=1)], dtype="datetime64[D]")
        start, end = (int(n) for n in np.searchsorted(day, ends))
        if end - start == self.used.num_rows:
            return self
        rows = slice(*np.searchsorted(self.hour, [start, end]))
        return replace(
            self,
            used=self.used.slice(start, end - start),
            hour=self.hour[rows] - start,
            cell=self.cell[rows],
            exposure_s=self.exposure_s[rows],
            violation_s=self.violation_s[rows],
        )

    def keyed(self, *names: str) -> tuple[Ints, int]:
        """Return the number of each used camera-hour's group by some columns, in order, and how many there are."""
        return _keyed(self.used, *names)


def cell_hours(
    warehouse: Warehouse, *, needs_distances: bool = True, least_share: float | None = None, **asked: Unpack[CellRange]
) -> CellHours:
    """Return the camera-hours of some days, and who stood in which cell in them.

    Args:
        warehouse: Its marts are read.
        needs_distances: Leave out camera-hours of which time in violation is unknown.
        least_share: Least recorded share of a camera-hour; None = of those that enter rates.
        **asked: Floor, cells and days.
    """
    floor, cell_m = asked["floor"], asked.get("cell_m", CELL_M)
    share = warehouse.site.settings.partial_hour_share if least_share is None else least_share
    days = asked.get("first") or warehouse.first, asked.get("last") or warehouse.last
    used = camera_hours(warehouse, floor, *days, least_share=share)
    knows_people, knows_distances = (used[f"knows_{what}"].to_numpy() for what in ("people", "distances"))
    chosen = used.filter(pa.array(knows_people & (knows_distances | (not needs_distances))))
    rows = cells_of(warehouse, floor, chosen, cell_m=cell_m)
    is_everything = chosen.num_rows == used.num_rows

    def without(state: State, reason: Reason) -> CellHours:
        none, nothing = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.float64)
        return CellHours(None, state, reason, is_everything, chosen, none, none, nothing, nothing)

    if not used.num_rows:
        return without("not_enough_data", NOTHING_OPEN)
    if not knows_people.any():
        return without("not_measurable", NO_POSITIONS)
    if not chosen.num_rows:
        return without("not_measurable", NO_FLOOR)
    if not rows.num_rows:
        if chosen["exposure_s"].to_numpy().sum() > 0:
            return without("not_measurable", NO_FLOOR)
        return without("not_enough_data", NOBODY)
    grid = grid_over(rows["cx"].to_numpy(), rows["cy"].to_numpy(), floor=floor, cell_m=cell_m)
    if isinstance(grid, Reason):
        return without("not_measurable", grid)
    hours = on_grid(grid, chosen, rows, is_everything=is_everything)
    return hours if len(hours.hour) else without("not_enough_data", Reason("nobody.on_plan"))


def on_grid(grid: Grid, used: pa.Table, rows: pa.Table, *, is_everything: bool) -> CellHours:
    """Return camera-hours and the rows of their cells (`cells_of`) as arrays, without cells beyond a grid."""
    hour, cx, cy, exposure_s, violation_s = (c.to_numpy() for c in rows.columns)
    at = cy - grid.cy, cx - grid.cx
    cell = at[0] * grid.shape[1] + at[1]  # of the type of cx and cy
    if any(len(i) and (i.min() < 0 or i.max() >= n) for i, n in zip(at, grid.shape, strict=True)):
        inside = np.all([(i >= 0) & (i < n) for i, n in zip(at, grid.shape, strict=True)], axis=0)
        hour, cell, exposure_s, violation_s = (v[inside] for v in (hour, cell, exposure_s, violation_s))
    return CellHours(grid, "ok", None, is_everything, used, hour, cell, exposure_s, violation_s)


def camera_hours(warehouse: Warehouse, floor: Floor, first: date, last: date, *, least_share: float) -> pa.Table:
    """Return the open camera-hours of some days in order, columns of `_USED`, from a least recorded share on."""
    asked = {"floor": floor.floor_id, "share": least_share, "first": first, "last": last}
    return warehouse.table(_USED, asked)


def cells_of(warehouse: Warehouse, floor: Floor, used: pa.Table, *, cell_m: float) -> pa.Table:
    """Return place among the camera-hours `used`, cx, cy, person-seconds and those in violation, in order."""
    return warehouse.table(
        f"{_OF_USED} select number, floor(cx * $side + 1e-9)::bigint as cx, floor(cy * $side + 1e-9)::bigint as cy, "
        "sum(exposure_open_s)::double as exposure_s, sum(violation_open_s)::double as violation_s "
        "from cell_hours inner join used using (camera_id, hour_start_ms) "
        "where floor_id = $floor and local_date between $first and $last "
        "group by all having sum(exposure_open_s) > 0 order by all",
        {**_asked(floor, used), "numbers": list(range(used.num_rows)), "side": FLOOR_CELL_M / cell_m},
    )


def _asked(floor: Floor, used: pa.Table) -> dict[str, object]:
    """Return the values of `_OF_USED`, and the days of the camera-hours: files of other days are not read."""
    ends = pc.min_max(used["local_date"]).as_py()
    return {
        "cameras": used["camera_id"].to_pylist(),
        "hours": used["hour_start_ms"].to_pylist(),
        "floor": floor.floor_id,
        "first": ends["min"],
        "last": ends["max"],
    }


def mixed_s(warehouse: Warehouse, floor: Floor, data: CellHours) -> Floats:
    """Return the person-seconds that random mixing would bring into violation, of each row's (`maps.excess_map`).

    NaN in camera-hours where it is unknown who was in view together.
    """
    return next(mixed_of_pieces(warehouse, floor, [data]))


def mixed_of_pieces(warehouse: Warehouse, floor: Floor, pieces: Sequence[CellHours]) -> Iterator[Floats]:
    """Yield what `mixed_s` returns of the pieces of one range: the same numbers as of all its rows at once.

    Args:
        warehouse: Its marts are read.
        floor: The floor.
        pieces: At least one; days in order, of the same grid.
    """
    grid = pieces[0].grid
    assert grid is not None
    used = pa.concat_tables([piece.used for piece in pieces])
    (of_camera, n), (of_hour, n_hours) = _keyed(used, "camera_id", "local_hour"), _keyed(used, "local_hour")
    together_h = np.bincount(of_camera, weights=used["recorded_h"].to_numpy(), minlength=n)
    starts = np.cumsum([0, *(piece.used.num_rows for piece in pieces)])
    people, density = np.zeros(n), np.zeros((n_hours, *grid.shape))
    for piece, start in zip(pieces, starts[:-1], strict=True):
        group = of_camera[start:][piece.hour]
        np.add.at(people, group, piece.exposure_s)
        place = (of_hour[start:] * density[0].size)[piece.hour] + piece.cell
        np.add.at(density.reshape(-1), place, piece.exposure_s / 3600 / together_h[group])
    people = people / 3600 / together_h
    near = nearby(density, closeness(cell_m=grid.cell_m, distance_m=warehouse.site.settings.distance_m))
    others = _others(warehouse, floor, used)
    for piece, start in zip(pieces, starts[:-1], strict=True):
        share = near.take((of_hour[start:] * density[0].size)[piece.hour] + piece.cell)
        share /= np.where(people > 0, people, 1.0)[of_camera[start:]][piece.hour]
        share *= -others[start:][piece.hour]
        mixed = np.expm1(share, out=share)
        mixed *= -piece.exposure_s
        yield mixed


def _keyed(used: pa.Table, *names: str) -> tuple[Ints, int]:
    number, n = np.zeros(used.num_rows, dtype=np.int64), 1
    for name in names:
        values, place = np.unique(used[name].to_numpy(), return_inverse=True)
        keys, number = np.unique(number * len(values) + place, return_inverse=True)
        n = len(keys)
    return number, n


def _others(warehouse: Warehouse, floor: Floor, used: pa.Table) -> Floats:
    """Return how many others a person has in view on average, 2 P / X, of each used camera-hour; NaN = unknown."""
    rows = warehouse.rows(
        "select camera_id, hour_start_ms, 2 * copresent_pair_s::double / person_s::double as others "
        "from crowding_hours where floor_id = $floor and person_s > 0",
        {"floor": floor.floor_id},
    )
    known = {(row["camera_id"], row["hour_start_ms"]): row["others"] for row in rows}
    keys = zip(used["camera_id"].to_pylist(), used["hour_start_ms"].to_pylist(), strict=True)
    return np.array([known.get(key) for key in keys], dtype=np.float64)


_OF_USED: Final = (
    "with used as (select unnest($cameras::varchar[]) as camera_id, unnest($hours::bigint[]) as hour_start_ms, "
    "unnest($numbers::bigint[]) as number)"
)
_USED: Final = """
select
    camera_id,
    hour_start_ms,
    local_hour,
    local_date,
    recorded_open_s::double / 3600 as recorded_h,
    coalesce(exposure_open_s, 0)::double as exposure_s,
    exposure_open_s is not null as knows_people,
    violation_s is not null as knows_distances
from camera_hours
where
    floor_id = $floor and open_s > 0 and recorded_open_s > 0 and recorded_open_s >= $share * open_s
    and local_date between $first and $last
order by hour_start_ms, camera_no
"""
