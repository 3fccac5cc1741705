"""Where people spend more time too close than the crowd explains: a day-clustered, moderated test of floor cells.

Of each day d and floor cell: v, the person-time in violation; x, the person-time; m, the part of x that random mixing
of the same crowd and map would bring into violation (M19). All are smoothed by the same Gaussian (~). What crowding
explains on this floor is

    e_d = R_d (c x_d + k m_d),   c, k >= 0 fitted to the window's sums over cells,   R_d = sum v_d / sum (c x_d + k m_d)

k m: people come close as the crowd makes them. c x: everywhere some people walk in company, however empty it is. R_d
takes out the day. A place is hot where v is clearly above e:

    u_d = v~_d - e~_d,   U = sum_d u_d,   M = sum_d e~_d,   s^2 = D/(D-1) (sum_d u_d^2 - U^2/D)   (how much days differ)
    phi = 1 + 2 sum_k (1 - k/D) rho_k   (days of a week resemble each other; pooled over cells, lags up to a week)
    V = a M + b M^2   (two-term variance function, fitted to s^2 over cells: what a cell of this size usually varies)
    t = U / sqrt(phi (D-1)/(D-phi) (d0 V + nu s^2) / (d0 + nu)),   nu = (D-1)/phi,   one-sided, d0 + nu degrees of
    freedom

c, k and R_d are fitted once more without the cells found hot, which are no measure of the rest. Cells pass at a false
discovery rate (Benjamini & Hochberg 1995) and a least ratio. Neighbours (8) that pass are one
hotspot, unless their excess U falls to half of the lower of two peaks between them: then they are two. A hotspot of
which the last seven days show less than half of the excess has faded and is none. Where people are simply many there is
no hotspot: the map of burden (M17) shows that. Moderation after Smyth (Statistical Applications in Genetics and
Molecular Biology 3, 2004); the sum of lags after Newey & West (Econometrica 55, 1987), with equal weights. False alarms
and power: docs/statistics.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.special import stdtr

from vsd_analytics.stats.false_discovery import benjamini_hochberg
from vsd_analytics.stats.nonnegative import nonnegative_factors
from vsd_analytics.stats.quantiles import t_quantile
from vsd_analytics.stats.watershed import watershed

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

PRIOR_DF: Final = 10.0
"""Weight of the variance function, in days (d0)."""
CUBE_AXES: Final = 3
"""Person-time is days by rows by columns."""
LAGS: Final = 7
"""Days farther apart than a week are taken as independent."""
LEAST_DAYS: Final = 3
"""Fewer days have no autocorrelation."""
MAX_INFLATION: Final = 0.5
"""phi is at most this share of the number of days: above it, phi cannot be estimated."""
RECENT_DAYS: Final = 7
"""Days at the end of the window in which a hotspot must still show."""
FADED_SHARE: Final = 0.5
"""A hotspot with less than this share of its excess in the recent days has faded."""
TRUNCATE: Final = 3.0
"""The Gaussian is cut off at this many standard deviations."""
REFERENCE_SHARE: Final = 0.5
"""Cells that are not hot are the measure of the others when they hold at least this share of the floor's mixing."""
SADDLE_SHARE: Final = 0.5
"""Two peaks of excess are two hotspots when it falls to this share of the lower one between them."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """What the test says of each floor cell; all arrays have the shape (n_rows, n_columns), NaN where not tested.

    Attributes:
        observed: Smoothed person-hours in violation over all days.
        expected: Those that crowding explains, M.
        ratio: observed / expected.
        t: The moderated t.
        q: Least false discovery rate at which the cell passes.
        is_tested: Cells with enough days and exposure.
        is_hot: Cells that pass and have not faded.
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
    """How time in violation at a place compares with what its crowding explains, as measured (nothing is smoothed).

    Attributes:
        violation_h: Person-hours in violation in the place.
        expected_h: Those that its crowding explains.
        exposure_h: Person-hours in the place.
        n_days: Days on which any of it was recorded.
        value: violation_h / expected_h.
        lo, hi: Day-clustered interval of the ratio, widened as days next to each other are alike on this floor; None
            where the days do not allow one.
    """

    violation_h: float
    expected_h: float
    exposure_h: float
    n_days: int
    value: float
    lo: float | None
    hi: float | None

    @property
    def excess_h_per_day(self) -> float:
        """Return the person-hours in violation above the expected, per recorded day: what could be saved."""
        return (self.violation_h - self.expected_h) / self.n_days


@dataclass(frozen=True, slots=True)
class Spot:
    """One hotspot.

    Attributes:
        number: Its rank by excess per day, from 1.
        label: Its number in `Cells.label`.
        n_cells: Cells it has.
        row, column: Its place: the mean of its cells' indices weighted by their smoothed excess.
        q: The least q of its cells.
        rate: Its time in violation beside that expected.
    """

    number: int
    label: int
    n_cells: int
    row: float
    column: float
    q: float
    rate: PlaceRate


@dataclass(frozen=True, slots=True, eq=False)
class Hotspots:
    """The cells, and the hotspots by excess per day, greatest first.

    Attributes:
        cells: What the test says of each cell.
        spots: The hotspots.
        n_days: Days on which any cell was recorded.
        explained: What crowding explains, which other places of the same window are compared with too.
    """

    cells: Cells
    spots: tuple[Spot, ...]
    n_days: int
    explained: Explained


@dataclass(frozen=True, slots=True, eq=False)
class Explained:
    """Person-hours by day and cell, shape (n_days, n_rows, n_columns); what was not recorded is 0.

    Attributes:
        violation_h: Those in violation.
        exposure_h: All of them.
        expected_h: Those in violation that crowding explains, e.
        recorded: Whether the cell was recorded that day.
        inflation: phi, by how much the variance of sums of days exceeds that of independent days.
    """

    violation_h: Floats
    exposure_h: Floats
    expected_h: Floats
    recorded: Bools
    inflation: float = 1.0


def hotspots(
    violation_h: npt.ArrayLike,
    exposure_h: npt.ArrayLike,
    mixed_h: npt.ArrayLike,
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
    """Test every floor cell for more time in violation than crowding explains (formulas: this module).

    Args:
        violation_h: Person-hours in violation by day and cell, where each person stands, shape (n_days, n_rows,
            n_columns).
        exposure_h: Person-hours, same shape.
        mixed_h: Person-hours that random mixing would bring into violation, same shape.
        sigma_cells: Standard deviation of the smoothing, in cells.
        is_recorded: Whether the cell's camera recorded that day, same shape; None = every day, everywhere. What was
            not recorded is no zero: such days are left out for the cell.
        is_eligible: Cells that may be tested, shape (n_rows, n_columns); None = all. The others count for what the
            floor makes of its crowd, and for their neighbours.
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
    days = _checked(violation_h, exposure_h, mixed_h, is_recorded)
    mixed = np.where(days.recorded, np.asarray(mixed_h, dtype=np.float64), 0.0)
    eligible = np.ones(mixed.shape[1:], dtype=bool) if is_eligible is None else np.asarray(is_eligible, dtype=bool)
    eligible = eligible & (days.exposure_h.sum(axis=0) > 0)

    def tested(days: Explained) -> tuple[Explained, Cells]:
        return _tested(
            days,
            eligible,
            sigma_cells=sigma_cells,
            q_max=q_max,
            min_ratio=min_ratio,
            min_exposure_h=min_exposure_h,
            min_days=min_days,
        )

    days, cells = tested(_explained(days, mixed, np.ones_like(eligible), sigma_cells))
    if cells.is_hot.any():  # what is hot is no measure of the rest, unless it is most of the floor
        rest = ~ndimage.binary_dilation(cells.is_hot)
        is_most = mixed[:, rest].sum() >= REFERENCE_SHARE * mixed.sum()
        if is_most and days.violation_h[:, rest].any():  # without time in violation, the rest explains nothing
            days, cells = tested(_explained(days, mixed, rest, sigma_cells))
    spots = [_spot(k, cells, days, confidence) for k in range(1, int(cells.label.max(initial=0)) + 1)]
    spots.sort(key=lambda s: (-s.rate.excess_h_per_day, s.label))
    ranked = tuple(replace(s, number=i) for i, s in enumerate(spots, 1))
    return Hotspots(cells, ranked, int(days.recorded.any(axis=(1, 2)).sum()), days)


def place_rate(explained: Explained, inside: npt.ArrayLike, *, confidence: float = 0.95) -> PlaceRate | None:
    """Return how time in violation in some cells compares with what crowding explains, be they a hotspot or not.

    var(ln ratio) = phi (D-1)/(D-phi) D/(D-1) sum_d (v_d - ratio e_d)^2 / v^2 over the D recorded days; Student t, D-1.

    Args:
        explained: The days, of `Hotspots.explained`.
        inside: The cells, shape (n_rows, n_columns).
        confidence: Level of the interval.

    Returns:
        None where none of them was recorded, or nothing is expected in them.
    """
    cells = np.asarray(inside, dtype=bool)
    used = explained.recorded[:, cells].any(axis=1)
    v_d = explained.violation_h[:, cells].sum(axis=1)[used]
    e_d = explained.expected_h[:, cells].sum(axis=1)[used]
    violation_h, expected_h, n_days = float(v_d.sum()), float(e_d.sum()), int(used.sum())
    if not expected_h > 0:
        return None
    ratio = violation_h / expected_h
    lo = hi = None
    if n_days > 1 and violation_h > 0:
        rest = v_d - ratio * e_d
        log_var = n_days / (n_days - 1) * float(rest @ rest) / violation_h**2
        half = t_quantile(n_days - 1, confidence=confidence) * math.sqrt(
            log_var * float(_widening(explained.inflation, n_days))
        )
        lo, hi = ratio * math.exp(-half), ratio * math.exp(half)
    exposure_h = float(explained.exposure_h[:, cells].sum())
    return PlaceRate(violation_h, expected_h, exposure_h, n_days, ratio, lo, hi)


def _checked(
    violation_h: npt.ArrayLike, exposure_h: npt.ArrayLike, mixed_h: npt.ArrayLike, is_recorded: npt.ArrayLike | None
) -> Explained:
    """Return person-time by day and cell, before the explained part is fitted."""
    values = [np.asarray(v, dtype=np.float64) for v in (violation_h, exposure_h, mixed_h)]
    if values[0].ndim != CUBE_AXES or len({v.shape for v in values}) > 1:
        raise ValueError("time in violation, person-time and mixing must have one shape: days, rows, columns")
    if not all(np.isfinite(v).all() and (v >= 0).all() for v in values):
        raise ValueError("person-time must be finite and not negative")
    shape = values[0].shape
    recorded = np.ones(shape, dtype=bool) if is_recorded is None else np.asarray(is_recorded, dtype=bool)
    if recorded.shape != shape:
        raise ValueError("is_recorded must have the shape of the person-time")
    by_day = np.where(recorded, values[1], 0.0).sum(axis=(1, 2))
    recorded = recorded & (by_day > 0)[:, None, None]
    close, exposure = (np.where(recorded, v, 0.0) for v in values[:2])
    return Explained(close, exposure, np.zeros(shape), recorded)


def _explained(days: Explained, mixed: Floats, reference: Bools, sigma_cells: float) -> Explained:
    """Return e = R_d (c x + k m), fitted to reference cells by least squares weighted as Poisson counts."""
    parts = days.violation_h, days.exposure_h, mixed
    v, x, m = (smoothed(p.sum(axis=0, keepdims=True), sigma_cells)[0][reference] for p in parts)
    weight = np.sqrt(_divide(np.ones_like(m), m))
    company, mixing = nonnegative_factors(np.column_stack([x * weight, m * weight]), v * weight)
    expected = company * days.exposure_h + mixing * mixed
    day = _divide(days.violation_h[:, reference].sum(axis=1), expected[:, reference].sum(axis=1))
    return replace(days, expected_h=np.asarray(day[:, None, None] * expected, dtype=np.float64))


def _tested(
    days: Explained,
    eligible: Bools,
    *,
    sigma_cells: float,
    q_max: float,
    min_ratio: float,
    min_exposure_h: float,
    min_days: int,
) -> tuple[Explained, Cells]:
    """Return the test of each cell, and the days with phi."""
    recorded = days.recorded
    close, mu, near = (smoothed(v, sigma_cells) for v in (days.violation_h, days.expected_h, days.exposure_h))
    mu, near = (np.where(recorded, v, 0.0) for v in (mu, near))
    u = np.where(recorded, close - mu, 0.0)
    n_days = recorded.sum(axis=0)
    total, expected = u.sum(axis=0), mu.sum(axis=0)
    is_tested = eligible & (n_days >= max(2, min_days)) & (near.sum(axis=0) >= min_exposure_h) & (expected > 0)
    days = replace(days, inflation=_inflation(u[:, is_tested], recorded[:, is_tested], expected[is_tested]))
    t, freedom = _moderated_t(u, total, expected, n_days=n_days, is_tested=is_tested, phi=days.inflation)
    q = np.full(t.shape, np.nan)
    q[is_tested] = benjamini_hochberg(stdtr(freedom[is_tested], -t[is_tested]))
    ratio = 1 + _divide(total, expected)
    is_hot = is_tested & (np.nan_to_num(q, nan=1.0) <= q_max) & (ratio >= min_ratio)
    label = _without_faded(watershed(total, is_hot, saddle_share=SADDLE_SHARE), days)
    observed, expected, ratio, t = (
        np.where(is_tested, values, np.nan) for values in (total + expected, expected, ratio, t)
    )
    return days, Cells(observed, expected, ratio, t, q, is_tested, label > 0, label)


def smoothed(values: Floats, sigma_cells: float) -> Floats:
    """Return maps smoothed by a Gaussian along their last two axes, cut off at `TRUNCATE` standard deviations."""
    sigma = (*(0,) * (values.ndim - 2), sigma_cells, sigma_cells)
    return np.asarray(ndimage.gaussian_filter(values, sigma=sigma, mode="constant", truncate=TRUNCATE))


def _inflation(u: Floats, recorded: Bools, expected: Floats) -> float:
    """Return phi from the excess of cells, shape (n_days, n_cells), each cell weighted by its expectation.

    Means are taken out of what is correlated, which lowers every autocorrelation by about phi / D: solved for phi.
    """
    kept = recorded.any(axis=1)
    u, recorded = u[kept], recorded[kept]
    n_days = len(u)
    if n_days < LEAST_DAYS or not u.size:
        return 1.0
    n_own = recorded.sum(axis=0).astype(np.float64)
    apart = np.where(recorded, u - _divide(u.sum(axis=0), n_own), 0.0)
    apart *= np.sqrt(_divide(expected * n_own, (apart**2).sum(axis=0)))
    own = float((apart**2).sum()) / recorded.sum()
    if own <= 0:
        return 1.0
    lags = np.arange(1, min(LAGS, n_days // 2) + 1)
    autocorrelations = np.array(
        [(apart[k:] * apart[:-k]).sum() / max((recorded[k:] & recorded[:-k]).sum(), 1) / own for k in lags]
    )
    weight = 1 - lags / n_days
    together, lost = 2 * float(weight @ autocorrelations), 2 * float(weight.sum()) / n_days
    phi = (1 + together) / max(1 + together / n_days - lost, 0.1)
    return float(np.clip(phi, 1.0, MAX_INFLATION * n_days))


def _widening(phi: float, n_days: npt.ArrayLike) -> Floats:
    """Return by how much D s^2 / (D-1) of correlated days is below the variance of their sum: phi (D-1) / (D-phi)."""
    days = np.asarray(n_days, dtype=np.float64)
    return np.asarray(phi * (days - 1) / np.maximum(days - phi, 1.0), dtype=np.float64)


def _moderated_t(
    u: Floats, total: Floats, expected: Floats, *, n_days: Ints, is_tested: Bools, phi: float
) -> tuple[Floats, Floats]:
    """Return t and its degrees of freedom, by cell."""
    days = np.maximum(n_days, 2)
    spread = days / (days - 1) * np.maximum((u**2).sum(axis=0) - total**2 / days, 0.0)
    linear, square = _variance_function(spread[is_tested], expected[is_tested])
    usual = linear * expected + square * expected**2
    own = (days - 1) / phi
    pooled = (PRIOR_DF * usual + own * spread) / (PRIOR_DF + own)
    return _divide(total, np.sqrt(pooled * _widening(phi, days))), PRIOR_DF + own


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


def _without_faded(label: Ints, days: Explained) -> Ints:
    """Return labels, numbered from 1, of the hotspots that the last days still show."""
    kept = np.zeros_like(label)
    for k in range(1, int(label.max(initial=0)) + 1):
        inside = label == k
        if not _has_faded(days.violation_h[:, inside].sum(axis=1), days.expected_h[:, inside].sum(axis=1)):
            kept[inside] = kept.max() + 1
    return kept


def _has_faded(violation_h: Floats, expected_h: Floats) -> bool:
    recent = slice(-RECENT_DAYS, None)
    if not expected_h[recent].sum() > 0:
        return False
    excess, now = (
        v.sum() / e.sum() - 1 for v, e in ((violation_h, expected_h), (violation_h[recent], expected_h[recent]))
    )
    return bool(now < FADED_SHARE * excess)


def _spot(label: int, cells: Cells, days: Explained, confidence: float) -> Spot:
    inside = cells.label == label
    rows, columns = np.nonzero(inside)
    weights = (cells.observed - cells.expected)[inside]
    rate = place_rate(days, inside, confidence=confidence)
    assert rate is not None  # tested cells have exposure, and time in violation is expected in them
    return Spot(
        number=0,
        label=label,
        n_cells=len(rows),
        row=float(rows @ weights / weights.sum()),
        column=float(columns @ weights / weights.sum()),
        q=float(cells.q[inside].min()),
        rate=rate,
    )


def _divide(top: Floats, bottom: Floats) -> Floats:
    quotient: Floats = np.divide(top, bottom, out=np.zeros(np.shape(top)), where=np.asarray(bottom) > 0)
    return quotient
