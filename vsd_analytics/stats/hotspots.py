"""Where is it riskier than elsewhere, beyond chance: an exposure-adjusted, day-clustered, moderated test of cells.

Of the violations n and person-hours x of each day d and floor cell, both smoothed by the same Gaussian (n~, x~):

    u_d = n~_d - R_d x~_d,   R_d = sum n_d / sum x_d   (the site's own rate that day, which takes out the day)
    U = sum_d u_d,  M = sum_d R_d x~_d,  s^2 = D/(D-1) (sum_d u_d^2 - U^2/D)   (how much days differ)
    V = a M + b M^2   (two-term variance function, fitted over cells: what a cell of this size usually varies)
    t = U / sqrt((d0 V + (D-1) s^2) / (d0 + D-1))   on d0 + D-1 degrees of freedom, one-sided.

Cells pass at a false discovery rate (Benjamini & Hochberg 1995) and a least ratio. Neighbours (8) that pass are one
hotspot, unless their excess U falls to half of the lower of two peaks between them: then they are two. Counts alone
would find where people are; this finds where a person-hour is riskier. Moderation after Smyth (Statistical
Applications in Genetics and Molecular Biology 3, 2004). False alarms and power: docs/statistics.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.special import stdtr

from vsd_analytics.stats.quantiles import t_quantile
from vsd_analytics.stats.watershed import watershed

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

PRIOR_DF: Final = 10.0
"""Weight of the variance function, in days (d0)."""
CUBE_AXES: Final = 3
"""Counts are days by rows by columns."""
TRUNCATE: Final = 3.0
"""The Gaussian is cut off at this many standard deviations."""
SADDLE_SHARE: Final = 0.5
"""Two peaks of excess are two hotspots when it falls to this share of the lower one between them."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """What the test says of each floor cell; all arrays have the shape (n_rows, n_columns), NaN where not tested.

    Attributes:
        observed: Smoothed violations over all days.
        expected: What they would be at the site's rate of each day, M.
        ratio: observed / expected.
        t: The moderated t.
        q: Least false discovery rate at which the cell passes.
        is_tested: Cells with enough days and exposure.
        is_hot: Cells that pass.
        label: Number of the hotspot a cell belongs to, from 1; 0 = none.
    """

    observed: Floats
    expected: Floats
    ratio: Floats
    t: Floats
    q: Floats
    is_tested: Bools
    is_hot: Bools
    label: Ints


@dataclass(frozen=True, slots=True)
class PlaceRate:
    """How the rate of a place compares with the site's, as counted (nothing is smoothed).

    Attributes:
        n: Violations in the place.
        expected: What they would be at the site's rate of each day.
        exposure_h: Person-hours in the place.
        n_days: Days on which any of it was recorded.
        ratio: n / expected.
        lo, hi: Day-clustered interval of the ratio, never narrower than that of independent violations; None where the
            days do not allow one.
    """

    n: float
    expected: float
    exposure_h: float
    n_days: int
    ratio: float
    lo: float | None
    hi: float | None

    @property
    def excess_per_day(self) -> float:
        """Return (n - expected) per recorded day: what could be saved."""
        return (self.n - self.expected) / self.n_days


@dataclass(frozen=True, slots=True)
class Spot:
    """One hotspot.

    Attributes:
        number: Its rank by excess per day, from 1.
        label: Its number in `Cells.label`.
        n_cells: Cells it has.
        row, column: Its place: the mean of its cells' indices weighted by their smoothed excess.
        peak_row, peak_column: Its cell with the greatest smoothed excess.
        q: The least q of its cells.
        rate: Its violations beside those expected.
    """

    number: int
    label: int
    n_cells: int
    row: float
    column: float
    peak_row: int
    peak_column: int
    q: float
    rate: PlaceRate


@dataclass(frozen=True, slots=True, eq=False)
class Hotspots:
    """The cells, and the hotspots by excess per day, greatest first."""

    cells: Cells
    spots: tuple[Spot, ...]
    n_days: int


@dataclass(frozen=True, slots=True, eq=False)
class _CellDays:
    """Checked input: what was not recorded is 0 in both, and False in `recorded`."""

    counts: Floats
    exposure: Floats
    recorded: Bools
    rate: Floats

    @property
    def expected(self) -> Floats:
        return self.rate[:, None, None] * self.exposure


def hotspots(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    *,
    sigma_cells: float,
    is_recorded: npt.ArrayLike | None = None,
    is_eligible: npt.ArrayLike | None = None,
    q_max: float = 0.05,
    min_ratio: float = 1.25,
    min_exposure_h: float = 0.25,
    min_days: int = 14,
    confidence: float = 0.95,
) -> Hotspots:
    """Test every floor cell for a rate above the site's (formulas: this module).

    Args:
        n: Violations by day and cell, shape (n_days, n_rows, n_columns).
        x_h: Person-hours, same shape.
        sigma_cells: Standard deviation of the smoothing, in cells.
        is_recorded: Whether the cell's camera recorded that day, same shape; None = every day, everywhere. What was
            not recorded is no zero: such days are left out for the cell.
        is_eligible: Cells that may be tested, shape (n_rows, n_columns); None = all. The others count for the site's
            rate and for their neighbours.
        q_max: False discovery rate at which cells pass.
        min_ratio: Least ratio of observed to expected.
        min_exposure_h: Least person-hours, smoothed, for a cell to be tested.
        min_days: Least recorded days for a cell to be tested; also at least 2.
        confidence: Level of the spots' intervals.

    Returns:
        Cells and hotspots; no cell is tested, and there is no hotspot, with fewer days than `min_days`.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or not finite.
    """
    days = _checked(n, x_h, is_recorded)
    recorded = days.recorded
    smooth_n, smooth_x = (smoothed(v, sigma_cells) for v in (days.counts, days.exposure))
    smooth_x = np.where(recorded, smooth_x, 0.0)
    mu = days.rate[:, None, None] * smooth_x
    u = np.where(recorded, smooth_n - mu, 0.0)
    n_days = recorded.sum(axis=0)
    total, expected = u.sum(axis=0), mu.sum(axis=0)
    is_tested = (n_days >= max(2, min_days)) & (smooth_x.sum(axis=0) >= min_exposure_h) & (expected > 0)
    is_tested &= days.exposure.sum(axis=0) > 0
    if is_eligible is not None:
        is_tested &= np.asarray(is_eligible, dtype=bool)
    t = _moderated_t(u, total, expected, n_days=n_days, is_tested=is_tested)
    q = np.full(t.shape, np.nan)
    q[is_tested] = benjamini_hochberg(stdtr(PRIOR_DF + n_days[is_tested] - 1, -t[is_tested]))
    ratio = 1 + _divide(total, expected)
    is_hot = is_tested & (np.nan_to_num(q, nan=1.0) <= q_max) & (ratio >= min_ratio)
    label = watershed(total, is_hot, saddle_share=SADDLE_SHARE)
    observed, expected, ratio, t = (
        np.where(is_tested, values, np.nan) for values in (total + expected, expected, ratio, t)
    )
    cells = Cells(observed, expected, ratio, t, q, is_tested, is_hot, label)
    spots = [_spot(k, cells, days, confidence) for k in range(1, int(label.max(initial=0)) + 1)]
    spots.sort(key=lambda s: (-s.rate.excess_per_day, s.label))
    ranked = tuple(replace(s, number=i) for i, s in enumerate(spots, 1))
    return Hotspots(cells, ranked, int(recorded.any(axis=(1, 2)).sum()))


def place_rate(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    inside: npt.ArrayLike,
    *,
    is_recorded: npt.ArrayLike | None = None,
    confidence: float = 0.95,
) -> PlaceRate | None:
    """Return how the rate of some cells compares with the site's, whether or not they are a hotspot.

    var(ln ratio) = D/(D-1) sum_d (n_d - ratio m_d)^2 / n^2 over the D recorded days, at least 1/n; Student t on D-1.

    Args:
        n: Violations by day and cell, shape (n_days, n_rows, n_columns).
        x_h: Person-hours, same shape.
        inside: The cells, shape (n_rows, n_columns).
        is_recorded: As for `hotspots`.
        confidence: Level of the interval.

    Returns:
        None where none of them was recorded, or nobody was in them, or there were no violations anywhere.
    """
    return _place_rate(_checked(n, x_h, is_recorded), np.asarray(inside, dtype=bool), confidence)


def benjamini_hochberg(p: npt.ArrayLike) -> Floats:
    """Return q, the least false discovery rate at which each test passes: min over larger p of p m / rank.

    Source: Benjamini & Hochberg, Controlling the false discovery rate, J. R. Statist. Soc. B 57 (1995).

    Args:
        p: P values, shape (m,).
    """
    values = np.asarray(p, dtype=np.float64)
    order = np.argsort(values, kind="stable")
    stepped = values[order] * len(values) / np.arange(1, len(values) + 1)
    q = np.empty(len(values))
    q[order] = np.minimum(1.0, np.minimum.accumulate(stepped[::-1])[::-1])
    return q


def _checked(n: npt.ArrayLike, x_h: npt.ArrayLike, is_recorded: npt.ArrayLike | None) -> _CellDays:
    counts, exposure = np.asarray(n, dtype=np.float64), np.asarray(x_h, dtype=np.float64)
    if counts.ndim != CUBE_AXES or counts.shape != exposure.shape:
        raise ValueError("violations and person-hours must have one shape: days, rows, columns")
    if not (
        np.isfinite(counts).all() and np.isfinite(exposure).all() and (counts >= 0).all() and (exposure >= 0).all()
    ):
        raise ValueError("violations and person-hours must be finite and not negative")
    recorded = np.ones(counts.shape, dtype=bool) if is_recorded is None else np.asarray(is_recorded, dtype=bool)
    if recorded.shape != counts.shape:
        raise ValueError("is_recorded must have the shape of the counts")
    counts, exposure = np.where(recorded, counts, 0.0), np.where(recorded, exposure, 0.0)
    by_day = exposure.sum(axis=(1, 2))
    recorded = recorded & (by_day > 0)[:, None, None]
    counts = np.where(recorded, counts, 0.0)
    return _CellDays(counts, exposure, recorded, _divide(counts.sum(axis=(1, 2)), by_day))


def smoothed(values: Floats, sigma_cells: float) -> Floats:
    """Return maps smoothed by a Gaussian along their last two axes, cut off at `TRUNCATE` standard deviations."""
    sigma = (*(0,) * (values.ndim - 2), sigma_cells, sigma_cells)
    return np.asarray(ndimage.gaussian_filter(values, sigma=sigma, mode="constant", truncate=TRUNCATE))


def _moderated_t(u: Floats, total: Floats, expected: Floats, *, n_days: Ints, is_tested: Bools) -> Floats:
    days = np.maximum(n_days, 2)
    spread = days / (days - 1) * np.maximum((u**2).sum(axis=0) - total**2 / days, 0.0)
    linear, square = _variance_function(spread[is_tested], expected[is_tested])
    usual = linear * expected + square * expected**2
    pooled = (PRIOR_DF * usual + (days - 1) * spread) / (PRIOR_DF + days - 1)
    return _divide(total, np.sqrt(pooled))


def _variance_function(spread: Floats, expected: Floats) -> tuple[float, float]:
    """Return a and b of V = a M + b M^2, by least squares of s^2 / M on M over cells; neither is negative."""
    if not len(expected):
        return 1.0, 0.0
    y = spread / expected
    apart = expected - expected.mean()
    square = float(apart @ y / (apart @ apart)) if float(apart @ apart) > 0 else 0.0
    if square <= 0:
        return float(y.mean()), 0.0
    linear = float(y.mean()) - square * float(expected.mean())
    return (linear if linear > 0 else 0.1 * float(y.mean())), square


def _spot(label: int, cells: Cells, days: _CellDays, confidence: float) -> Spot:
    inside = cells.label == label
    rows, columns = np.nonzero(inside)
    weights = (cells.observed - cells.expected)[inside]
    peak = int(np.argmax(weights))
    rate = _place_rate(days, inside, confidence)
    assert rate is not None  # tested cells have exposure, and violations are expected in them
    return Spot(
        number=0,
        label=label,
        n_cells=len(rows),
        row=float(rows @ weights / weights.sum()),
        column=float(columns @ weights / weights.sum()),
        peak_row=int(rows[peak]),
        peak_column=int(columns[peak]),
        q=float(cells.q[inside].min()),
        rate=rate,
    )


def _place_rate(days: _CellDays, inside: Bools, confidence: float) -> PlaceRate | None:
    used = days.recorded[:, inside].any(axis=1)
    n_d = days.counts[:, inside].sum(axis=1)[used]
    m_d = days.expected[:, inside].sum(axis=1)[used]
    n, expected, n_days = float(n_d.sum()), float(m_d.sum()), int(used.sum())
    if not expected > 0:
        return None
    ratio = n / expected
    lo = hi = None
    if n_days > 1 and n > 0:
        rest = n_d - ratio * m_d
        log_var = max(n_days / (n_days - 1) * float(rest @ rest) / n**2, 1 / n)
        half = t_quantile(n_days - 1, confidence=confidence) * math.sqrt(log_var)
        lo, hi = ratio * math.exp(-half), ratio * math.exp(half)
    return PlaceRate(n, expected, float(days.exposure[:, inside].sum()), n_days, ratio, lo, hi)


def _divide(top: Floats, bottom: Floats) -> Floats:
    quotient: Floats = np.divide(top, bottom, out=np.zeros(np.shape(top)), where=np.asarray(bottom) > 0)
    return quotient
