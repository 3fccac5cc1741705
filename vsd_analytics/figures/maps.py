"""Maps of a floor as arrays: where people are, are close, are at risk, and are closer than chance (M16 to M19).

All four are sums over the camera-hours that enter rates, cell by cell, from the mart `cell_hours`. Both use the place
of the person, so time in violation is a part of time in view everywhere. What a camera did not record is in no sum and
in no denominator.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Unpack

import numpy as np

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.cell_hours import CellHours, CellRange, cell_hours, mixed_s
from vsd_analytics.figures.floor_days import Flags, Floats, Grid
from vsd_analytics.site.model import Floor
from vsd_analytics.stats import hotspots as test
from vsd_analytics.warehouse.warehouse import Warehouse

SIGMA_M: Final = 1.0
"""Standard deviation of the smoothing of risk and excess."""
MIN_EXPOSURE_H: Final = 0.25
"""Person-hours (smoothed) a cell of 0.5 m needs for a risk; larger cells need as much."""
MIN_EXPECTED_S: Final = 10.0
"""Person-seconds (smoothed) that must be expected in violation for a ratio."""

UNTOLD: Final = Reason("map.together_unknown")


@dataclass(frozen=True, slots=True, eq=False)
class CellMap:
    """One map of a floor.

    Attributes:
        metric: Catalogue id, M16 to M19.
        grid: The cells; None where nothing can be shown.
        values: Shape of the grid, row 0 at the bottom of the floor; NaN where nothing is known. None without a grid.
        exposure_h: Person-hours per cell, same shape, as measured; None likewise.
        denominator: What the whole map rests on: recorded open camera-hours (M16, M17), person-hours (M18),
            person-hours expected in violation (M19); None without a grid.
        state: "ok" when there is a map.
        reason: Why there is none.
    """

    metric: str
    grid: Grid | None
    values: Floats | None
    exposure_h: Floats | None
    denominator: float | None
    state: State
    reason: Reason | None

    @property
    def unit(self) -> Reason:
        """Return the unit of the values."""
        return Reason(f"unit.{self.metric}")


@dataclass(frozen=True, slots=True, eq=False)
class ExcessMap(CellMap):
    """The map of excess (M19): what `CellMap` has, and what it is made of.

    Attributes:
        observed_h: Person-hours in violation per cell, as measured; None without a grid.
        expected_h: Those that random mixing would make; likewise.
        is_clear: Cells of hotspots: clearly above what crowding explains on the whole floor (`stats.hotspots`), days as
            clusters; None with fewer than `hotspot_min_days` recorded days.
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


def cell_maps(warehouse: Warehouse, **asked: Unpack[CellRange]) -> CellMaps:
    """Return the four maps, reading the marts once; formulas at each map's own function.

    Args:
        warehouse: Its days.
        **asked: Floor, cells and days: `CellRange`.

    Example:
        >>> vsd.cell_maps(warehouse, floor=floor, cell_m=1.0).risk.metric
        'M18'
    """
    data = cell_hours(warehouse, **asked)
    people = data if data.is_everything else cell_hours(warehouse, needs_distances=False, **asked)
    return CellMaps(_exposure(people), _burden(data), _risk(data), _excess(warehouse, asked["floor"], data))


def exposure_map(warehouse: Warehouse, **asked: Unpack[CellRange]) -> CellMap:
    """Return where people are: person-seconds per m² and recorded open hour (M16); arguments as for `cell_maps`.

    value = sum over cameras of (person-seconds of the camera in the cell / its recorded open hours) / area of the cell,
    so that a camera that was down does not pale its part of the floor. NaN where nobody was seen.

    Example:
        >>> vsd.exposure_map(warehouse, floor=floor, cell_m=1.0).unit
        Reason('unit.M16')
    """
    return _exposure(cell_hours(warehouse, needs_distances=False, **asked))


def burden_map(warehouse: Warehouse, **asked: Unpack[CellRange]) -> CellMap:
    """Return where people are too close: person-seconds in violation per m² and recorded open hour (M17).

    Arguments and formula as for `exposure_map`, of person-seconds with somebody closer than the legal distance.

    Example:
        >>> vsd.burden_map(warehouse, floor=floor, cell_m=1.0).values.shape
        (16, 23)
    """
    return _burden(cell_hours(warehouse, **asked))


def risk_map(warehouse: Warehouse, **asked: Unpack[CellRange]) -> CellMap:
    """Return the share of person-time in violation, cell by cell (M18); arguments as for `cell_maps`.

    Person-seconds in violation and in view are smoothed by the same Gaussian of 1 m; the numerator is a part of the
    denominator everywhere, so the share lies between 0 and 1. NaN where fewer than 0.25 person-hours were spent.

    Example:
        >>> shares = vsd.risk_map(warehouse, floor=floor).values
        >>> bool((shares[shares == shares] <= 1).all())  # NaN, where nothing is known, is not equal to itself
        True
    """
    return _risk(cell_hours(warehouse, **asked))


def excess_map(warehouse: Warehouse, **asked: Unpack[CellRange]) -> ExcessMap:
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

    Example:
        >>> vsd.excess_map(warehouse, floor=floor).is_clear is None  # a test needs 14 recorded days
        True
    """
    return _excess(warehouse, asked["floor"], cell_hours(warehouse, **asked))


def _exposure(data: CellHours) -> CellMap:
    return _per_hour("M16", data, data.exposure_s)


def _burden(data: CellHours) -> CellMap:
    return _per_hour("M17", data, data.violation_s)


def _per_hour(metric: str, data: CellHours, values_s: Floats) -> CellMap:
    if data.grid is None:
        return CellMap(metric, None, None, None, None, data.state, data.reason)
    camera, n_cameras = data.keyed("camera_id")
    recorded_h = np.bincount(camera, weights=data.used["recorded_h"].to_numpy(), minlength=n_cameras)
    rate = values_s / recorded_h[camera[data.hour]]
    exposure_h = data.summed(data.exposure_s) / 3600
    values = np.where(exposure_h > 0, data.summed(rate) / data.grid.cell_m**2, np.nan)
    return CellMap(metric, data.grid, values, exposure_h, float(recorded_h.sum()), "ok", None)


def _risk(data: CellHours) -> CellMap:
    if data.grid is None:
        return CellMap("M18", None, None, None, None, data.state, data.reason)
    exposure_h, violation_h = (data.summed(v) / 3600 for v in (data.exposure_s, data.violation_s))
    near, encounter_rate = (test.smoothed(v, SIGMA_M / data.grid.cell_m) for v in (exposure_h, violation_h))
    is_known = (near >= MIN_EXPOSURE_H) & (exposure_h > 0)
    share = np.divide(encounter_rate, near, out=np.full(near.shape, np.nan), where=is_known)
    return CellMap("M18", data.grid, np.minimum(share, 1.0), exposure_h, float(exposure_h.sum()), "ok", None)


def _excess(warehouse: Warehouse, floor: Floor, data: CellHours) -> ExcessMap:
    if data.grid is None:
        return ExcessMap("M19", None, None, None, None, data.state, data.reason, None, None, None)
    cell_m, expected_s = data.grid.cell_m, mixed_s(warehouse, floor, data)
    is_together_known = np.isfinite(expected_s)
    if not is_together_known.any():
        return ExcessMap("M19", None, None, None, None, "not_enough_data", UNTOLD, None, None, None)
    if not is_together_known.all():  # who was in view together is unknown there: neither observed nor expected
        data, expected_s = data.where(is_together_known), expected_s[is_together_known]
    observed, expected = (data.summed(v) for v in (data.violation_s, expected_s))
    near, mixed = (test.smoothed(v, SIGMA_M / cell_m) for v in (observed, expected))
    exposure_h = data.summed(data.exposure_s) / 3600
    is_known = (mixed >= MIN_EXPECTED_S) & (exposure_h > 0)
    values = np.divide(near, mixed, out=np.full(near.shape, np.nan), where=is_known)
    return ExcessMap(
        "M19", data.grid, values, exposure_h, float(expected.sum()) / 3600, "ok", None,
        observed_h=observed / 3600, expected_h=expected / 3600,
        is_clear=_clear(warehouse, data, expected_s, is_known),
    )  # fmt: skip


def _clear(warehouse: Warehouse, data: CellHours, expected_s: Floats, is_known: Flags) -> Flags | None:
    """Return the cells that pass the test of the hotspots."""
    assert data.grid is not None
    settings = warehouse.site.settings
    day, n_days = data.keyed("local_date")
    if n_days < settings.hotspot_min_days:
        return None
    by_day = (data.summed(v / 3600, day[data.hour], n_days) for v in (data.violation_s, data.exposure_s, expected_s))
    hotspots = test.hotspots(
        *by_day,
        sigma_cells=SIGMA_M / data.grid.cell_m,
        is_eligible=is_known,
        q_max=settings.hotspot_false_share,
        min_ratio=settings.hotspot_min_ratio,
        min_exposure_h=0.0,  # cells are known by what is expected in them
        min_days=int(settings.hotspot_min_days),
    )
    return np.asarray(hotspots.cells.is_hot)
