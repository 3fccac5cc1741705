"""Maps of a floor as arrays: where people are, are close, are at risk, and are closer than chance (M16 to M19).

All four are sums over the camera-hours that enter rates, cell by cell, from the mart `cell_hours`. Both use the place
of the person, so time in violation is a part of time in view everywhere. What a camera did not record is in no sum and
in no denominator.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date
from typing import Final, NotRequired, TypedDict, Unpack

import numpy as np
import pyarrow as pa

from vsd_analytics.figures.floor_days import NO_FLOOR, Flags, Floats, Grid, Ints, grid_over
from vsd_analytics.figures.slots import NO_POSITIONS, NOTHING_OPEN
from vsd_analytics.result import Reason, State
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Floor
from vsd_analytics.stats import hotspots as test
from vsd_analytics.stats.decomposition import closeness, nearby
from vsd_analytics.warehouse.warehouse import Warehouse

CELL_M: Final = 0.5
"""Side of the cells of the maps M16 to M19: part of their definition, and a multiple of the stored cells."""
SIGMA_M: Final = 1.0
"""Standard deviation of the smoothing of risk and excess."""
MIN_EXPOSURE_H: Final = 0.25
"""Person-hours (smoothed) a cell of 0.5 m needs for a risk; larger cells need as much."""
MIN_EXPECTED_S: Final = 10.0
"""Person-seconds (smoothed) that must be expected in violation for a ratio."""

UNTOLD: Final = Reason("map.together_unknown")
NOBODY: Final = Reason("nobody.seen_open")


class MapRange(TypedDict):
    """What a map is asked for.

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
class CellMap:
    """One map of a floor.

    Attributes:
        metric: Catalogue id, M16 to M19.
        unit: Of the values, in words.
        grid: The cells; None where nothing can be shown.
        values: Shape of the grid, row 0 at the bottom of the floor; NaN where nothing is known. None without a grid.
        exposure_h: Person-hours per cell, same shape, as measured; None likewise.
        denominator: What the whole map rests on: recorded open camera-hours (M16, M17), person-hours (M18),
            person-hours expected in violation (M19); None without a grid.
        state: "ok" when there is a map.
        reason: Why there is none.
    """

    metric: str
    unit: str
    grid: Grid | None
    values: Floats | None
    exposure_h: Floats | None
    denominator: float | None
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True, eq=False)
class ExcessMap(CellMap):
    """The map of excess (M19): what `CellMap` has, and what it is made of.

    Attributes:
        observed_h: Person-hours in violation per cell, as measured; None without a grid.
        expected_h: Those that random mixing would make; likewise.
        is_clear: Cells in which the ratio is clearly above that of the whole floor, days as clusters; None with fewer
            than `hotspot_min_days` recorded days.
    """

    observed_h: Floats | None
    expected_h: Floats | None
    is_clear: Flags | None


@dataclass(frozen=True, slots=True, eq=False)
class CellMaps:
    """The four maps of a floor: exposure (M16), burden (M17), risk (M18), excess (M19)."""

    exposure: CellMap
    burden: CellMap
    risk: CellMap
    excess: ExcessMap


def cell_maps(warehouse: Warehouse, **asked: Unpack[MapRange]) -> CellMaps:
    """Return the four maps, reading the marts once; formulas at each map's own function.

    Args:
        warehouse: Its days.
        **asked: Floor, cells and days: `MapRange`.
    """
    data = _load(warehouse, **asked)
    people = data if data.is_everything else _load(warehouse, needs_distances=False, **asked)
    return CellMaps(_exposure(people), _burden(data), _risk(data), _excess(warehouse, asked["floor"], data))


def exposure_map(warehouse: Warehouse, **asked: Unpack[MapRange]) -> CellMap:
    """Return where people are: person-seconds per m² and recorded open hour (M16); arguments as for `cell_maps`.

    value = sum over cameras of (person-seconds of the camera in the cell / its recorded open hours) / area of the cell,
    so that a camera that was down does not pale its part of the floor. NaN where nobody was seen.
    """
    return _exposure(_load(warehouse, needs_distances=False, **asked))


def burden_map(warehouse: Warehouse, **asked: Unpack[MapRange]) -> CellMap:
    """Return where people are too close: person-seconds in violation per m² and recorded open hour (M17).

    Arguments and formula as for `exposure_map`, of person-seconds with somebody closer than the legal distance.
    """
    return _burden(_load(warehouse, **asked))


def risk_map(warehouse: Warehouse, **asked: Unpack[MapRange]) -> CellMap:
    """Return the share of person-time in violation, cell by cell (M18); arguments as for `cell_maps`.

    Person-seconds in violation and in view are smoothed by the same Gaussian of 1 m; the numerator is a part of the
    denominator everywhere, so the share lies between 0 and 1. NaN where fewer than 0.25 person-hours were spent.
    """
    return _risk(_load(warehouse, **asked))


def excess_map(warehouse: Warehouse, **asked: Unpack[MapRange]) -> ExcessMap:
    """Return time in violation over the time that random mixing would make, cell by cell (M19).

    A person in cell c would, if everybody stood independently of each other, have Poisson many neighbours closer than
    the legal distance, on average

        mu = M f(c),   M = 2 P / X,   f(c) = sum_c' K(c - c') x(c') / x

    with M the number of others that a person of that camera and hour has in view on average (P pair-time, X
    person-time: `crowding_hours`), K the chance that two people of two cells are closer than the distance
    (`stats.decomposition.closeness`), and x the map of person-time of that hour of the day over the range. Expected is
    the sum of person-time in the cell times 1 - exp(-mu). Observed and expected are smoothed by the same Gaussian of
    1 m before they are divided; NaN where fewer than 10 person-seconds are expected.

    1 is the value that crowd and layout explain. Above 1, people stay together or queue; below 1, they keep apart. With
    M rather than the mean number of people less one, it also holds for hours with hardly anybody. Hours of the day
    share one map over the range: the map of a single quiet hour is little else than the ways of those few themselves.
    Arguments as for `cell_maps`.
    """
    return _excess(warehouse, asked["floor"], _load(warehouse, **asked))


@dataclass(frozen=True, slots=True, eq=False)
class _CellHours:
    """Camera-hours and cells: `hour` is a row's place among the used camera-hours, `at` its cell of the grid.

    `is_everything`: no camera-hour that enters rates was left out for what its engine does not send.
    """

    grid: Grid | None
    state: State
    reason: Reason | None
    is_everything: bool
    used: pa.Table
    hour: Ints
    at: tuple[Ints, Ints]
    exposure_s: Floats
    violation_s: Floats

    def summed(self, values: Floats, by: Ints | None = None, n: int = 1) -> Floats:
        """Return sums by cell, shape of the grid; with `by`, below n, one map of each: shape (n, ...)."""
        assert self.grid is not None
        made = np.zeros((n, *self.grid.shape))
        np.add.at(made, (np.zeros(len(values), dtype=np.int64) if by is None else by, *self.at), values)
        return made if by is not None else made[0]

    def where(self, kept: Flags) -> _CellHours:
        """Return some of the rows, of the same camera-hours and grid."""
        row, column = self.at
        at = row[kept], column[kept]
        parts = {name: getattr(self, name)[kept] for name in ("hour", "exposure_s", "violation_s")}
        return replace(self, at=at, **parts)

    def keyed(self, *names: str) -> tuple[Ints, int]:
        """Return the number of each used camera-hour's group by some columns, in order, and how many there are."""
        number, n = np.zeros(self.used.num_rows, dtype=np.int64), 1
        for name in names:
            values, place = np.unique(self.used[name].to_numpy(), return_inverse=True)
            found, number = np.unique(number * len(values) + place, return_inverse=True)
            n = len(found)
        return number, n


def _exposure(data: _CellHours) -> CellMap:
    return _per_hour("M16", "person-seconds per m² and recorded open hour", data, data.exposure_s)


def _burden(data: _CellHours) -> CellMap:
    return _per_hour("M17", "person-seconds in violation per m² and recorded open hour", data, data.violation_s)


def _per_hour(metric: str, unit: str, data: _CellHours, values_s: Floats) -> CellMap:
    if data.grid is None:
        return CellMap(metric, unit, None, None, None, None, data.state, data.reason)
    camera, n_cameras = data.keyed("camera_id")
    recorded_h = np.bincount(camera, weights=data.used["recorded_h"].to_numpy(), minlength=n_cameras)
    rate = values_s / recorded_h[camera[data.hour]]
    exposure_h = data.summed(data.exposure_s) / 3600
    values = np.where(exposure_h > 0, data.summed(rate) / data.grid.cell_m**2, np.nan)
    return CellMap(metric, unit, data.grid, values, exposure_h, float(recorded_h.sum()), "ok", None)


def _risk(data: _CellHours) -> CellMap:
    unit = "share of person-time in violation"
    if data.grid is None:
        return CellMap("M18", unit, None, None, None, None, data.state, data.reason)
    exposure_h, violation_h = (data.summed(v) / 3600 for v in (data.exposure_s, data.violation_s))
    near, risky = (test.smoothed(v, SIGMA_M / data.grid.cell_m) for v in (exposure_h, violation_h))
    is_known = (near >= MIN_EXPOSURE_H) & (exposure_h > 0)
    share = np.divide(risky, near, out=np.full(near.shape, np.nan), where=is_known)
    return CellMap("M18", unit, data.grid, np.minimum(share, 1.0), exposure_h, float(exposure_h.sum()), "ok", None)


def _excess(warehouse: Warehouse, floor: Floor, data: _CellHours) -> ExcessMap:
    unit = "time in violation over that of random mixing"
    if data.grid is None:
        return ExcessMap("M19", unit, None, None, None, None, data.state, data.reason, None, None, None)
    cell_m, expected_s = data.grid.cell_m, _expected_s(warehouse, floor, data)
    is_together_known = np.isfinite(expected_s)
    if not is_together_known.any():
        return ExcessMap("M19", unit, None, None, None, None, "not_enough_data", UNTOLD, None, None, None)
    if not is_together_known.all():  # who was in view together is unknown there: neither observed nor expected
        data, expected_s = data.where(is_together_known), expected_s[is_together_known]
    observed, expected = (data.summed(v) for v in (data.violation_s, expected_s))
    near, mixed = (test.smoothed(v, SIGMA_M / cell_m) for v in (observed, expected))
    exposure_h = data.summed(data.exposure_s) / 3600
    is_known = (mixed >= MIN_EXPECTED_S) & (exposure_h > 0)
    values = np.divide(near, mixed, out=np.full(near.shape, np.nan), where=is_known)
    return ExcessMap(
        "M19", unit, data.grid, values, exposure_h, float(expected.sum()) / 3600, "ok", None,
        observed_h=observed / 3600, expected_h=expected / 3600,
        is_clear=_clear(warehouse, data, expected_s, is_known),
    )  # fmt: skip


def _expected_s(warehouse: Warehouse, floor: Floor, data: _CellHours) -> Floats:
    """Return the person-seconds that random mixing would make of each row's (formula: `excess_map`)."""
    assert data.grid is not None
    distance_m = warehouse.site.settings.distance_m
    of_camera, n = data.keyed("camera_id", "local_hour")
    of_hour, n_hours = data.keyed("local_hour")
    recorded_h = data.used["recorded_h"].to_numpy()
    together_h = np.bincount(of_camera, weights=recorded_h, minlength=n)
    group = of_camera[data.hour]
    people = np.bincount(group, weights=data.exposure_s, minlength=n) / 3600 / together_h
    density = data.summed(data.exposure_s / 3600 / together_h[group], of_hour[data.hour], n_hours)
    near = nearby(density, closeness(cell_m=data.grid.cell_m, distance_m=distance_m))
    others = _others(warehouse, floor, data.used)
    share = near[of_hour[data.hour], *data.at] / np.where(people > 0, people, 1.0)[group]
    return np.asarray(data.exposure_s * -np.expm1(-others[data.hour] * share), dtype=np.float64)


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


def _clear(warehouse: Warehouse, data: _CellHours, expected_s: Floats, is_known: Flags) -> Flags | None:
    """Return the cells that pass the test of the hotspots with what is expected by mixing as exposure."""
    assert data.grid is not None
    settings = warehouse.site.settings
    day, n_days = data.keyed("local_date")
    if n_days < settings.hotspot_min_days:
        return None
    observed, expected = (data.summed(v / 3600, day[data.hour], n_days) for v in (data.violation_s, expected_s))
    found = test.hotspots(
        observed,
        expected,
        sigma_cells=SIGMA_M / data.grid.cell_m,
        is_eligible=is_known,
        q_max=settings.hotspot_false_share,
        min_ratio=settings.hotspot_min_ratio,
        min_exposure_h=MIN_EXPECTED_S / 3600,
        min_days=int(settings.hotspot_min_days),
    )
    return np.asarray(found.cells.is_hot)


def _load(
    warehouse: Warehouse,
    *,
    floor: Floor,
    cell_m: float = CELL_M,
    first: date | None = None,
    last: date | None = None,
    needs_distances: bool = True,
) -> _CellHours:
    """Return the camera-hours that enter rates, and who stood in which cell in them."""
    settings = warehouse.site.settings
    days = {"first": first or warehouse.first, "last": last or warehouse.last}
    used = warehouse.table(_USED, {"floor": floor.floor_id, "share": settings.partial_hour_share, **days})
    knows_people, knows_distances = (used[f"knows_{what}"].to_numpy() for what in ("people", "distances"))
    chosen = used.filter(pa.array(knows_people & (knows_distances | (not needs_distances))))
    rows = warehouse.table(
        "with used as (select unnest($cameras::varchar[]) as camera_id, unnest($hours::bigint[]) as hour_start_ms, "
        "unnest($numbers::bigint[]) as number) "
        "select number, floor(cx * $side + 1e-9)::bigint as cx, floor(cy * $side + 1e-9)::bigint as cy, "
        "sum(exposure_open_s)::double as exposure_s, sum(violation_open_s)::double as violation_s "
        "from cell_hours inner join used using (camera_id, hour_start_ms) where floor_id = $floor "
        "group by all having sum(exposure_open_s) > 0 order by all",
        {
            "cameras": chosen["camera_id"].to_pylist(),
            "hours": chosen["hour_start_ms"].to_pylist(),
            "numbers": list(range(chosen.num_rows)),
            "floor": floor.floor_id,
            "side": FLOOR_CELL_M / cell_m,
        },
    )
    hour, cx, cy, exposure_s, violation_s = (c.to_numpy() for c in rows.columns)
    is_everything = chosen.num_rows == used.num_rows

    def without(state: State, reason: Reason) -> _CellHours:
        none, nothing = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.float64)
        return _CellHours(None, state, reason, is_everything, chosen, none, (none, none), nothing, nothing)

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
    grid = grid_over(cx, cy, floor=floor, cell_m=cell_m)
    if isinstance(grid, Reason):
        return without("not_measurable", grid)
    at = cy - grid.cy, cx - grid.cx
    inside = np.all([(i >= 0) & (i < n) for i, n in zip(at, grid.shape, strict=True)], axis=0)
    if not inside.any():
        return without("not_enough_data", Reason("nobody.on_plan"))
    hour, row, column, exposure_s, violation_s = (v[inside] for v in (hour, *at, exposure_s, violation_s))
    return _CellHours(grid, "ok", None, is_everything, chosen, hour, (row, column), exposure_s, violation_s)


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
