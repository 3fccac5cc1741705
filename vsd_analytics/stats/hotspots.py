"""Where is it riskier than elsewhere, beyond chance: an exposure-adjusted, day-clustered, moderated test of cells.

Of the violations n and person-hours x of each day d and floor cell, both smoothed by the same Gaussian (n~, x~):

    u_d = n~_d - R_d x~_d,   R_d = sum n_d / sum x_d   (the site's own rate that day, which takes out the day)
    U = sum_d u_d,  M = sum_d R_d x~_d,  s^2 = D/(D-1) (sum_d u_d^2 - U^2/D)   (how much days differ)
    V = a M + b M^2   (two-term variance function, fitted over cells: what a cell of this size usually varies)
    t = U / sqrt((d0 V + (D-1) s^2) / (d0 + D-1))   on d0 + D-1 degrees of freedom, one-sided.

Cells pass at a false discovery rate (Benjamini & Hochberg 1995) and a least ratio; neighbours (8) that pass are one
hotspot. Counts alone would find where people are; this finds where a person-hour is riskier. Moderation after Smyth
(Statistical Applications in Genetics and Molecular Biology 3, 2004). False alarms and power: docs/statistics.md.
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

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

PRIOR_DF: Final = 10.0
"""Weight of the variance function, in days (d0)."""
TRUNCATE: Final = 3.0
"""The Gaussian is cut off at this many standard deviations."""


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
class Spot:
    """One hotspot.

    Attributes:
        number: Its rank by excess, from 1.
        label: Its number in `Cells.label`.
        n_cells: Cells it has.
        row, column: Its place: the mean of its cells' indices weighted by their excess.
        peak_row, peak_column: Its cell with the greatest t.
        n: Violations in its cells, as counted.
        expected: What they would be at the site's rate of each day.
        exposure_h: Person-hours in its cells.
        ratio: n / expected.
        lo, hi: Day-clustered interval of the ratio; None where days do not allow one.
        excess_per_week: (n - expected) per seven recorded days: what could be saved.
        q: The least q of its cells.
    """

    number: int
    label: int
    n_cells: int
    row: float
    column: float
    peak_row: int
    peak_column: int
    n: float
    expected: float
    exposure_h: float
    ratio: float
    lo: float | None
    hi: float | None
    excess_per_week: float
    q: float


@dataclass(frozen=True, slots=True, eq=False)
class Hotspots:
    """The cells, and the hotspots by excess, greatest first."""

    cells: Cells
    spots: tuple[Spot, ...]
    n_days: int


def hotspots(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    *,
    sigma_cells: float,
    is_recorded: npt.ArrayLike | None = None,
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
        q_max: False discovery rate at which cells pass.
        min_ratio: Least ratio of observed to expected.
        min_exposure_h: Least person-hours, smoothed, for a cell to be tested.
        min_days: Least recorded days for a cell to be tested; also at least 2.
        confidence: Level of the spots' intervals.

    Returns:
        Cells and hotspots; none of either when there are fewer days with exposure than `min_days`.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or not finite.
    """
    counts, exposure = np.asarray(n, dtype=np.float64), np.asarray(x_h, dtype=np.float64)
    if counts.ndim != 3 or counts.shape != exposure.shape:
        raise ValueError("violations and person-hours must have one shape: days, rows, columns")
    if not (np.isfinite(counts).all() and np.isfinite(exposure).all()) or min(counts.min(), exposure.min()) < 0:
        raise ValueError("violations and person-hours must be finite and not negative")
    recorded = np.ones(counts.shape, dtype=bool) if is_recorded is None else np.asarray(is_recorded, dtype=bool)
    if recorded.shape != counts.shape:
        raise ValueError("is_recorded must have the shape of the counts")
    recorded = recorded & (exposure.sum(axis=(1, 2)) > 0)[:, None, None]
    counts, exposure = np.where(recorded, counts, 0.0), np.where(recorded, exposure, 0.0)
    day_rate = _divide(counts.sum(axis=(1, 2)), exposure.sum(axis=(1, 2)))
    smooth_n, smooth_x = (_smooth(v, sigma_cells) for v in (counts, exposure))
    mu = day_rate[:, None, None] * smooth_x
    u = np.where(recorded, smooth_n - mu, 0.0)
    mu = np.where(recorded, mu, 0.0)
    days = recorded.sum(axis=0)
    total, expected = u.sum(axis=0), mu.sum(axis=0)
    is_tested = (
        (days >= max(2, min_days))
        & (np.where(recorded, smooth_x, 0.0).sum(axis=0) >= min_exposure_h)
        & (exposure.sum(axis=0) > 0)
        & (expected > 0)
    )
    t = _moderated_t(u, total, expected, days=days, is_tested=is_tested)
    p = np.where(is_tested, 1 - stdtr(np.maximum(PRIOR_DF + days - 1, 1), np.nan_to_num(t)), np.nan)
    q = _benjamini_hochberg(p, is_tested)
    ratio = np.where(is_tested, 1 + _divide(total, expected), np.nan)
    is_hot = is_tested & (np.nan_to_num(q, nan=1.0) <= q_max) & (np.nan_to_num(ratio) >= min_ratio)
    label = ndimage.label(is_hot, structure=np.ones((3, 3)))[0].astype(np.int64)
    cells = Cells(
        np.where(is_tested, total + expected, np.nan),
        np.where(is_tested, expected, np.nan),
        ratio,
        np.where(is_tested, t, np.nan),
        q,
        is_tested,
        is_hot,
        label,
    )
    raw_mu = day_rate[:, None, None] * exposure
    spots = [
        _spot(k, label == k, cells, total, counts, raw_mu, exposure, recorded, confidence)
        for k in range(1, int(label.max(initial=0)) + 1)
    ]
    spots.sort(key=lambda s: (-s.excess_per_week, s.label))
    ranked = tuple(_numbered(s, i) for i, s in enumerate(spots, 1))
    return Hotspots(cells, ranked, int(recorded.any(axis=(1, 2)).sum()))


def _smooth(values: Floats, sigma: float) -> Floats:
    smoothed: Floats = ndimage.gaussian_filter(values, sigma=(0, sigma, sigma), mode="constant", truncate=TRUNCATE)
    return smoothed


def _moderated_t(u: Floats, total: Floats, expected: Floats, *, days: Ints, is_tested: Bools) -> Floats:
    n_days = np.maximum(days, 2)
    spread = n_days / (n_days - 1) * np.maximum((u**2).sum(axis=0) - total**2 / n_days, 0.0)
    linear, square = _variance_function(spread[is_tested], expected[is_tested])
    usual = linear * expected + square * expected**2
    pooled = (PRIOR_DF * usual + (n_days - 1) * spread) / (PRIOR_DF + n_days - 1)
    return np.asarray(_divide(total, np.sqrt(pooled)), dtype=np.float64)


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


def _benjamini_hochberg(p: Floats, is_tested: Bools) -> Floats:
    q = np.full(p.shape, np.nan)
    tested = p[is_tested]
    if len(tested):
        order = np.argsort(tested, kind="stable")
        stepped = tested[order] * len(tested) / np.arange(1, len(tested) + 1)
        adjusted = np.empty(len(tested))
        adjusted[order] = np.minimum(1.0, np.minimum.accumulate(stepped[::-1])[::-1])
        q[is_tested] = adjusted
    return q


def _spot(
    label: int,
    inside: Bools,
    cells: Cells,
    total: Floats,
    counts: Floats,
    mu: Floats,
    exposure: Floats,
    recorded: Bools,
    confidence: float,
) -> Spot:
    rows, columns = np.nonzero(inside)
    weights = np.maximum(total[inside], 1e-12)
    peak = int(np.argmax(cells.t[inside]))
    used = recorded[:, inside].any(axis=1)
    by_day, expected_by_day = counts[:, inside].sum(axis=1)[used], mu[:, inside].sum(axis=1)[used]
    n, expected, n_days = float(by_day.sum()), float(expected_by_day.sum()), int(used.sum())
    ratio = n / expected
    lo = hi = None
    if n_days > 1 and n > 0:
        rest = by_day - ratio * expected_by_day
        log_se = math.sqrt(n_days / (n_days - 1) * float(rest @ rest)) / n
        half = t_quantile(n_days - 1, confidence=confidence) * log_se
        lo, hi = ratio * math.exp(-half), ratio * math.exp(half)
    return Spot(
        number=0,
        label=label,
        n_cells=len(rows),
        row=float(rows @ weights / weights.sum()),
        column=float(columns @ weights / weights.sum()),
        peak_row=int(rows[peak]),
        peak_column=int(columns[peak]),
        n=n,
        expected=expected,
        exposure_h=float(exposure[:, inside].sum()),
        ratio=ratio,
        lo=lo,
        hi=hi,
        excess_per_week=(n - expected) * 7 / n_days,
        q=float(np.nanmin(cells.q[inside])),
    )


def _numbered(spot: Spot, number: int) -> Spot:
    return replace(spot, number=number)


def _divide(top: Floats, bottom: Floats) -> Floats:
    quotient: Floats = np.divide(top, bottom, out=np.zeros(np.shape(top)), where=np.asarray(bottom) > 0)
    return quotient
