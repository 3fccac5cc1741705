"""The days of one period, for a changed area and the areas it is compared with: the input of before and after.

The numerator may be anything that adds up over days (violations, person-hours in violation), the denominator likewise
(person-hours, recorded open hours). Where the numerator is a time, `events` holds the violations it is made of: they
say how much the period knows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class PeriodDays:
    """One period, day by day.

    Attributes:
        n: Numerator of the changed area, such as violations or person-hours in violation, shape (n_days,).
        x_h: Denominator there, person-hours or recorded open hours, same shape; 0 or NaN = not recorded.
        comparison_n: Numerator of each comparison area, shape (n_areas, n_days).
        comparison_x_h: Denominator there, same shape; 0 or NaN = not recorded.
        weekday: Weekday of each day, shape (n_days,), any integers.
        week: Number of the week each day lies in, same shape.
        events: Violations of the changed area, shape (n_days,); None = `n` counts them.
        comparison_events: Violations of each comparison area, shape (n_areas, n_days); None = `comparison_n` counts
            them.
    """

    n: Floats
    x_h: Floats
    comparison_n: Floats
    comparison_x_h: Floats
    weekday: Ints
    week: Ints
    events: Floats | None = None
    comparison_events: Floats | None = None

    @property
    def n_events(self) -> float:
        """Return the violations of the changed area."""
        return float((self.n if self.events is None else self.events).sum())

    @property
    def n_comparison_events(self) -> float:
        """Return the violations of all comparison areas."""
        return float((self.comparison_n if self.comparison_events is None else self.comparison_events).sum())

    @property
    def n_areas(self) -> int:
        """Return the number of comparison areas."""
        return int(self.comparison_n.shape[0])


def checked(period: PeriodDays) -> PeriodDays:
    """Return a period as arrays of floats, 0 where nothing was recorded.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    n, x_h = (np.asarray(v, dtype=np.float64) for v in (period.n, period.x_h))
    others_n, others_x_h = (
        np.atleast_2d(np.asarray(v, dtype=np.float64)) for v in (period.comparison_n, period.comparison_x_h)
    )
    if n.ndim != 1 or n.shape != x_h.shape or others_n.shape != others_x_h.shape:
        raise ValueError("numerators and denominators must have one shape")
    weekday, week = (np.asarray(v, dtype=np.int64) for v in (period.weekday, period.week))
    if not others_n.shape[1:] == weekday.shape == week.shape == n.shape:
        raise ValueError("every day needs counts of all areas, a weekday and a week")
    x_h, others_x_h = np.nan_to_num(x_h, nan=0.0), np.nan_to_num(others_x_h, nan=0.0)
    n, others_n = np.where(x_h > 0, n, 0.0), np.where(others_x_h > 0, others_n, 0.0)
    events = _events(period.events, x_h)
    others_events = _events(period.comparison_events, others_x_h)
    for values in (n, x_h, others_n, others_x_h, events, others_events):
        if values is not None and (not np.isfinite(values).all() or (values < 0).any()):
            raise ValueError("counts and hours must be finite and not negative")
    return PeriodDays(n, x_h, others_n, others_x_h, weekday, week, events, others_events)


def of_areas(period: PeriodDays, keep: Bools | Ints) -> PeriodDays:
    """Return a period with some of its comparison areas."""
    events = None if period.comparison_events is None else period.comparison_events[keep]
    rows = period.comparison_n[keep], period.comparison_x_h[keep]
    return PeriodDays(period.n, period.x_h, *rows, period.weekday, period.week, period.events, events)


def of_days(period: PeriodDays, keep: Bools | Ints) -> PeriodDays:
    """Return some days of a period."""
    return PeriodDays(
        period.n[keep],
        period.x_h[keep],
        period.comparison_n[:, keep],
        period.comparison_x_h[:, keep],
        period.weekday[keep],
        period.week[keep],
        None if period.events is None else period.events[keep],
        None if period.comparison_events is None else period.comparison_events[:, keep],
    )


def recorded(period: PeriodDays) -> PeriodDays:
    """Return the days on which the changed area and any comparison area were recorded."""
    return of_days(period, (period.x_h > 0) & (period.comparison_x_h.sum(axis=0) > 0))


def as_if_changed(period: PeriodDays, area: int) -> PeriodDays:
    """Return a period in which a comparison area takes the place of the changed one, which is left out."""
    others = np.arange(period.n_areas) != area
    events = period.comparison_events
    return PeriodDays(
        period.comparison_n[area],
        period.comparison_x_h[area],
        period.comparison_n[others],
        period.comparison_x_h[others],
        period.weekday,
        period.week,
        None if events is None else events[area],
        None if events is None else events[others],
    )


def _events(events: Floats | None, x_h: Floats) -> Floats | None:
    if events is None:
        return None
    counts = np.asarray(events, dtype=np.float64).reshape(x_h.shape)
    return np.asarray(np.where(x_h > 0, counts, 0.0), dtype=np.float64)
