"""How much each day moves a rate: the intervals of all rates are computed from it.

The rate of a place is r = sum_c n_c / x_c: violations n_c that camera c owns over its exposure x_c (analytics: M0; with
one "camera" it is the ratio estimator of M7). The relative influence of day d on it is

    i_d = 1/r  sum_c g_cd (n_cd - n_c q_cd) / x_c,

with q_cd the share of camera c's violations expected on day d: its share of exposure, x_cd / x_c, or, with a history,
its share of exposure times the weekday's usual rate. What is left is the day's own doing. Then

    var(ln r) = k sum_d i_d^2,   on df degrees of freedom.

When all cameras recorded all D days, k = D/(D-1) and df = D-1, the usual estimator of a ratio from clusters (Cochran,
Sampling Techniques, 3rd ed., ch. 6). A camera that missed days leans on the few it has, so k and df must know which:
`small_sample` takes both from the moments of the quadratic form, in the manner of Bell & McCaffrey (Survey
Methodology 28, 2002) for clustered regression.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

PANEL_AXES: Final = 2
"""Counts are cameras by days."""
NO_SPREAD: Final = 1e-12
"""A trace up to this is rounding: no camera recorded two days, so days do not differ."""


@dataclass(frozen=True, slots=True)
class DayCounts:
    """Counts and exposure of the cameras that recorded anything.

    Attributes:
        n: Violations, shape (n_cameras, n_days); 0 where nothing was recorded.
        x: Exposure in hours, the same shape; 0 where nothing was recorded.
        kept: Indices of these cameras in what the caller gave.
        left_out: Indices of the others.
    """

    n: Floats
    x: Floats
    kept: tuple[int, ...]
    left_out: tuple[int, ...]

    @property
    def n_days(self) -> int:
        """Return the number of days with exposure on any camera."""
        return int((self.x > 0).any(axis=0).sum())


@dataclass(frozen=True, slots=True)
class Influence:
    """A rate, how cameras share in it, and what each day did to it.

    Attributes:
        rate: sum_c n_c / x_c, violations per hour of exposure.
        by_day: Relative influence i_d of each day, shape (n_days,).
        shares: Share of each camera in the rate, shape (n_cameras,).
        totals: Violations of each camera, shape (n_cameras,).
    """

    rate: float
    by_day: Floats
    shares: Floats
    totals: Floats

    @property
    def noise(self) -> Floats:
        """Return p_c^2 / n_c, each camera's part in var(ln rate) if violations came independently; 0 where n_c = 0."""
        return np.divide(self.shares**2, self.totals, out=np.zeros_like(self.shares), where=self.totals > 0)


@dataclass(frozen=True, slots=True)
class Profile:
    """What earlier weeks expect of each day of a period.

    Attributes:
        expected: q_cd, share of camera c's violations expected on day d, shape (n_cameras, n_days), rows summing to 1.
        scale: g_cd, what takes the profile's own error out of a residual, same shape.
        is_known: Cameras with a profile, shape (n_cameras,); the others have their share of exposure and 1.
        gap: Usual rate of camera c over a whole week / on the weekdays it recorded, same shape; 1 where it missed none.
    """

    expected: Floats
    scale: Floats
    is_known: Bools
    gap: Floats


def as_counts(n: npt.ArrayLike, x_h: npt.ArrayLike, *, mask: npt.ArrayLike | None = None) -> DayCounts:
    """Check counts and exposure, blank what was not recorded, and drop cameras without exposure.

    Args:
        n: Violations (or person-hours), shape (n_cameras, n_days) or (n_days,) for one camera.
        x_h: Exposure in hours, same shape; 0 or NaN = not recorded.
        mask: Camera-days to use, same shape; None = all that were recorded.

    Returns:
        The cameras with exposure; both arrays are copies.

    Raises:
        ValueError: Shapes differ, or a number is negative, infinite, or missing on a recorded day.
    """
    n_used, x_used = _blanked(n, x_h, mask=mask)
    has_any: Bools = np.any(x_used > 0, axis=1)
    return DayCounts(n_used[has_any], x_used[has_any], _indices(has_any), _indices(~has_any))


def as_history(n: npt.ArrayLike, x_h: npt.ArrayLike, *, of: DayCounts) -> DayCounts:
    """Check the counts of earlier weeks like `as_counts` and keep the cameras of `of`, whether they recorded or not.

    Args:
        n: Violations, shape (n_cameras, n_history_days), all cameras the period was given with.
        x_h: Exposure in hours, same shape; 0 or NaN = not recorded.
        of: The period.

    Raises:
        ValueError: As for `as_counts`, or the number of cameras differs.
    """
    n_used, x_used = _blanked(n, x_h, mask=None)
    if len(n_used) != len(of.kept) + len(of.left_out):
        raise ValueError("the history must have the cameras of the period, in the same order")
    rows = list(of.kept)
    return DayCounts(n_used[rows], x_used[rows], of.kept, of.left_out)


def _blanked(n: npt.ArrayLike, x_h: npt.ArrayLike, *, mask: npt.ArrayLike | None) -> tuple[Floats, Floats]:
    counts = np.atleast_2d(np.asarray(n, dtype=np.float64))
    hours = np.atleast_2d(np.asarray(x_h, dtype=np.float64))
    if counts.shape != hours.shape or counts.ndim != PANEL_AXES:
        raise ValueError(f"counts {counts.shape} and exposure {hours.shape} must have one shape, cameras by days")
    if np.isinf(hours).any() or (hours < 0).any():
        raise ValueError("exposure must be finite and not negative")
    is_used: Bools = np.nan_to_num(hours, nan=0.0) > 0
    if not (np.isfinite(counts[is_used]) & (counts[is_used] >= 0)).all():
        raise ValueError("counts must be finite and not negative on every recorded day")
    if mask is not None:
        is_used = is_used & np.atleast_2d(np.asarray(mask, dtype=bool))
    return np.where(is_used, counts, 0.0), np.where(is_used, hours, 0.0)


def _indices(flags: npt.NDArray[Any]) -> tuple[int, ...]:
    return tuple(int(i) for i in np.flatnonzero(flags))


def influence(counts: DayCounts, *, expected: Floats | None = None, scale: Floats | None = None) -> Influence:
    """Return the rate and each day's relative influence on it (formula at the top of this module).

    Args:
        counts: Cameras with exposure; at least one violation in all.
        expected: q_cd, shape (n_cameras, n_days), rows summing to 1; None = the share of exposure.
        scale: g_cd, same shape; None = 1.
    """
    totals, hours = counts.n.sum(axis=1), counts.x.sum(axis=1)
    rates = totals / hours
    rate = float(rates.sum())
    share_of_day = counts.x / hours[:, None] if expected is None else expected
    residual = (counts.n - totals[:, None] * share_of_day) / hours[:, None] / rate
    if scale is not None:
        residual = residual * scale
    return Influence(rate, residual.sum(axis=0), rates / rate, totals)


def equal_weights(counts: DayCounts) -> Floats:
    """Return 1/D_c on each of the D_c days camera c recorded, shape (n_cameras, n_days)."""
    is_recorded = counts.x > 0
    return np.asarray(is_recorded / is_recorded.sum(axis=1, keepdims=True), dtype=np.float64)


def small_sample(weights: Floats, *, shares: Floats, noise: Floats) -> tuple[float, float]:
    """Return k and df of var(ln r) = k sum_d i_d^2 for cameras that recorded different days.

    If a day d moves all cameras by a common factor of variance s^2, ln r has variance s^2 |u|^2, u_d = sum_c p_c w_cd,
    where p_c is camera c's share in the rate and w_cd the weight of day d in it; the influences are i = B S with
    B = diag(u) - sum_c p_c w_c w_c', so E sum i_d^2 = s^2 tr B'B. Hence k = |u|^2 / tr B'B and, by Satterthwaite,
    df = (tr B'B)^2 / tr (B'B)^2. If instead violations come independently, ln r has variance sum_c p_c^2 / n_c and
    E sum i_d^2 = sum_c p_c^2/n_c (1 - |w_c|^2), which gives another k. The larger k is taken. When all cameras recorded
    all D days with equal weight, both k are D/(D-1) and df = D-1 exactly.

    Args:
        weights: w_cd, shape (n_cameras, n_days), rows summing to 1: see `equal_weights`.
        shares: p_c, shape (n_cameras,), summing to 1.
        noise: p_c^2 / n_c, same shape; for a change the sum of both periods'.

    Returns:
        k (at least 1) and df (above 0). k is infinite when every camera with violations has but one day.
    """
    lean = shares @ weights
    spread = np.diag(lean) - (weights * shares[:, None]).T @ weights
    gram = spread.T @ spread
    trace = float(np.trace(gram))
    seen = float((noise * (1 - (weights**2).sum(axis=1))).sum())
    if trace <= NO_SPREAD or seen <= 0:
        return np.inf, 1.0
    factor = max(float(lean @ lean) / trace, float(noise.sum()) / seen)
    return factor, round(trace**2 / float((gram * gram).sum()), 9)  # rounded: 6, not 6.000000000000002


def weekday_profile(
    counts: DayCounts,
    history: DayCounts,
    *,
    weekday: npt.NDArray[np.int64],
    history_weekday: npt.NDArray[np.int64],
    min_weeks: int,
) -> Profile:
    """Return what the cameras' own weekday profiles expect of each day of the period.

    h_cw = violations over exposure of camera c on weekday w of the history, X_cw that exposure, and q_cd = x_cd h_cw /
    sum_d x_cd h_cw. The profile is itself measured, so a residual is too wide by 1 + x_cd / X_cw: g_cd = (1 + x_cd /
    X_cw)^(-1/2) takes that out. The gap of a camera that missed weekdays is its usual rate over a whole week, each
    weekday weighted by its usual exposure, over its usual rate on what it recorded.

    Args:
        counts: The period; `history` has all its cameras too.
        history: The weeks before, same cameras in the same order, shape (n_cameras, n_history_days).
        weekday: Weekday of each day of the period.
        history_weekday: Weekday of each day of the history.
        min_weeks: A weekday's profile needs that many days in the history, all but one of them recorded.
    """
    share = counts.x / counts.x.sum(axis=1, keepdims=True)
    rate, known = np.zeros_like(counts.x), np.zeros_like(counts.x)
    has_profile: Bools = np.ones(len(counts.x), dtype=bool)
    has_missed: Bools = np.zeros(len(counts.x), dtype=bool)
    week_n, week_x = np.zeros(len(counts.x)), np.zeros(len(counts.x))
    for day in np.unique(np.concatenate([weekday, history_weekday])):
        now, then = weekday == day, history_weekday == day
        is_recorded = (counts.x[:, now] > 0).any(axis=1)
        n_recorded = (history.x[:, then] > 0).sum(axis=1)
        has_profile &= ~is_recorded | ((n_recorded >= min_weeks - 1) & bool(then.sum() >= min_weeks))
        has_missed |= ~is_recorded & (n_recorded > 0)
        n_then, x_then = history.n[:, then].sum(axis=1), history.x[:, then].sum(axis=1)
        rate[:, now], known[:, now] = _ratio(n_then, x_then)[:, None], x_then[:, None]
        week_n, week_x = week_n + _ratio(n_then, n_recorded), week_x + _ratio(x_then, n_recorded)
    expected = counts.x * rate
    total = expected.sum(axis=1)
    # violations on a weekday that never had any would have no place in the profile
    has_profile &= (total > 0) & ~((counts.n > 0) & (expected == 0)).any(axis=1)
    gap = np.where(has_profile & has_missed, _ratio(_ratio(week_n, week_x), _ratio(total, counts.x.sum(axis=1))), 1.0)
    with_profile = has_profile[:, None]
    return Profile(
        expected=np.where(with_profile, _ratio(expected, np.broadcast_to(total[:, None], expected.shape)), share),
        scale=np.where(with_profile, 1 / np.sqrt(1 + _ratio(counts.x, known)), 1.0),
        is_known=has_profile,
        gap=gap,
    )


def _ratio(top: Floats, bottom: npt.NDArray[Any]) -> Floats:
    quotient: Floats = np.divide(top, bottom, out=np.zeros(np.shape(top)), where=bottom > 0)
    return quotient
