"""Violations per m2 per open hour on the floor grid, smoothed over the floor people can walk on."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, date, datetime, timedelta
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.panels import Array, Flags, positions
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.week import bands as heat
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_map import Extent, MapBand
from vsd_analytics.figures.week.uncertain_floor import uncertain_floor
from vsd_analytics.figures.week.walkable import Walkable
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Fixture

TRUNCATE = 3.0
"""Standard deviations beyond which a violation adds nothing worth masking."""


class FloorGrid:
    """The cells of the floor to draw.

    Args:
        data: The week.
        extent: x0, y0, x1, y1 of the floor, metres.

    Attributes:
        cell_m: Side of a cell.
        shape: Rows (y) and columns (x).
        origin: Lower left corner of cell [0, 0], floor metres.
    """

    def __init__(self, data: WeekData, extent: Extent) -> None:
        self._data = data
        self.cell_m = FLOOR_CELL_M
        x0, y0, x1, y1 = extent
        self._first = (int(np.floor(x0 / self.cell_m)), int(np.floor(y0 / self.cell_m)))
        self.shape = (
            int(np.ceil(y1 / self.cell_m)) - self._first[1],
            int(np.ceil(x1 / self.cell_m)) - self._first[0],
        )
        self.origin = (self._first[0] * self.cell_m, self._first[1] * self.cell_m)

    @cached_property
    def walkable(self) -> Walkable | None:
        """Return the floor people can walk on; None where no fixture is described."""
        rings = [f.polygon for f in fixed_fixtures(self._data)]
        return Walkable(rings, cell_m=self.cell_m, origin_m=self.origin, shape=self.shape) if rings else None

    @cached_property
    def uncertain(self) -> BaseGeometry:
        """Return the floor on which distances are too uncertain to colour it."""
        return uncertain_floor(self._data, self._data.cameras)

    @cached_property
    def _is_uncertain(self) -> Flags:
        x, y = self.axes()
        return np.asarray(shapely.contains_xy(self.uncertain, x[None, :], y[:, None]))

    def rows_of(self, cy: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the rows of cells, floor(y / cell_m); outside the grid below 0 or beyond the last."""
        return np.asarray(cy - self._first[1])

    def columns_of(self, cx: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the columns of cells, floor(x / cell_m)."""
        return np.asarray(cx - self._first[0])

    def axes(self) -> tuple[Array, Array]:
        """Return the floor x of each column's middle and the floor y of each row's."""
        x, y = (
            (first + 0.5 + np.arange(n, dtype=np.float64)) * self.cell_m
            for first, n in zip(self._first, self.shape[::-1], strict=True)
        )
        return x, y

    def smooth(self, values: Array) -> Array:
        """Return values smoothed by the settings' `smoothing_m`, along the floor where fixtures are described."""
        from scipy.ndimage import gaussian_filter

        sigma = self._data.site.settings.smoothing_m / self.cell_m
        if self.walkable is not None:
            return self.walkable.smooth(values, sigma_cells=sigma)
        return np.asarray(gaussian_filter(values, sigma, mode="constant"))

    def density(self, period: Period, *, used: Flags) -> Density:
        """Return the density of a period.

        Density of a cell = sum over cameras of (violations there / the camera's recorded open hours) / cell area, over
        the camera-hours `used`, smoothed; 0 on floor whose distances are too uncertain.

        Args:
            period: Its days.
            used: Camera-hours that count, shape (n_cameras, n_hours).
        """
        counts, rates = self._sums(period, used)
        if self.walkable is not None:
            counts, rates = self.walkable.on_floor(counts), self.walkable.on_floor(rates)
        smooth = np.where(self._is_uncertain, 0.0, self.smooth(rates / self.cell_m**2))
        return Density(grid=self, values=smooth, counts=counts, settings_of=self._data)

    def bands(self, values: Array, *, steps: tuple[float, ...]) -> tuple[MapBand, ...]:
        """Return the outlines of the floor where values reach each step, without what lies below fixtures."""
        if self.walkable is None:
            return heat.heat_bands(values, cell_m=self.cell_m, origin_m=self.origin, steps=steps)
        drawn = self.walkable.outlined(values)
        bands = heat.heat_bands(drawn, cell_m=self.cell_m, origin_m=self.origin, steps=steps)
        return self.walkable.clipped(bands, values)

    def _sums(self, period: Period, used: Flags) -> tuple[Array, Array]:
        """Return violations, and violations per recorded open hour, by cell."""
        data = self._data
        rows = data.warehouse.table(
            "select camera_id, hour_start_ms, cx, cy, count(*)::double as n from violations "
            "where floor_id = $floor and is_open and cx is not null and local_date between $first and $last "
            "group by all order by all",
            {"floor": data.floor.floor_id, "first": period.first, "last": period.last},
        )
        camera = positions(rows["camera_id"], data.ids, otherwise=-1)
        hour = np.searchsorted(data.hours.start_ms, rows["hour_start_ms"].to_numpy())
        x, y = self.columns_of(rows["cx"].to_numpy()), self.rows_of(rows["cy"].to_numpy())
        inside = (x >= 0) & (y >= 0) & (x < self.shape[1]) & (y < self.shape[0])
        inside &= used[camera, hour] & period.whole.cameras[camera]
        recorded_h = (data.hours.recorded_s * used)[:, period.is_inside].sum(axis=1) / 3600
        n = rows["n"].to_numpy()[inside]
        counts, rates = np.zeros(self.shape), np.zeros(self.shape)
        at = (y[inside], x[inside])
        np.add.at(counts, at, n)
        np.add.at(rates, at, n / recorded_h[camera[inside]])
        return counts, rates


class Density:
    """A density by cell and the violations behind it.

    Attributes:
        values: Violations per m2 per open hour, shape of the grid.
        counts: Violations by cell, same shape.
    """

    def __init__(self, *, grid: FloorGrid, values: Array, counts: Array, settings_of: WeekData) -> None:
        self._grid, self.values, self.counts = grid, values, counts
        self._settings = settings_of.site.settings

    def near(self, own: Flags) -> float:
        """Return the violations that made a patch: those in it and within reach of the smoothing."""
        from scipy.ndimage import binary_dilation

        reach = TRUNCATE * self._settings.smoothing_m / self._grid.cell_m
        rows, columns = (slice(max(0, int(i.min() - reach)), int(i.max() + reach) + 1) for i in np.nonzero(own))
        near = binary_dilation(own[rows, columns], iterations=max(1, round(reach)))
        return float(self.counts[rows, columns][near].sum())

    def without_small(self) -> Array:
        """Return the values without coloured patches of floor made by fewer violations than may be printed."""
        settings, mask = self._settings, Mask(int(self._settings.mask_below))
        if self.counts.sum() >= mask.least(0) and self.values.max() < settings.heat_steps[0]:
            return self.values

        def is_left_out(own: Flags) -> bool:
            return mask.hides(self.near(own))

        return without_patches(self.values, least=settings.heat_steps[0], is_left_out=is_left_out)


def without_patches(values: Array, *, least: float, is_left_out: Callable[[Flags], bool]) -> Array:
    """Return values with 0 in those patches of neighbouring cells of at least `least` that are to be left out."""
    from scipy.ndimage import label

    patches, n_patches = label(values >= least)
    kept = values.copy()
    for own in (patches == k for k in range(1, n_patches + 1)):
        if is_left_out(own):
            kept[own] = 0.0
    return kept


def floor_fixtures(data: WeekData) -> tuple[Fixture, ...]:
    """Return the fixtures on the floor at the end of the week."""
    return _standing(data, _instant(data.this.span_ms[1] - 1))


def fixtures_before(data: WeekData) -> tuple[Fixture, ...]:
    """Return those that stood there at the end of the week before."""
    return _standing(data, _instant(data.this.span_ms[0] - 1))


def fixtures_at(data: WeekData, day: date) -> tuple[Fixture, ...]:
    """Return those that stood there at the end of a day."""
    return _standing(data, data.midnight(day + timedelta(days=1)) - timedelta(seconds=1))


def fixed_fixtures(data: WeekData) -> tuple[Fixture, ...]:
    """Return those that stood in one place all through this week and the one before: nobody walked there in either."""
    first, end = data.midnight(data.monday - data.span), data.midnight(data.monday + data.span)
    return tuple(f for f in _listed(data) if f.is_there(first, until=end))


def _standing(data: WeekData, at: datetime) -> tuple[Fixture, ...]:
    return tuple(f for f in _listed(data) if f.is_there(at))


def _instant(ms: int) -> datetime:
    return datetime.fromtimestamp(ms // 1000, tz=UTC)


def _listed(data: WeekData) -> tuple[Fixture, ...]:
    return tuple(f for f in data.site.fixtures if f.floor_id == data.floor.floor_id)
