"""One verdict on one change that may be read every week: an e-process over weekly log ratios.

m reference weeks before the change have the log ratios (changed area beside comparison areas) y ~ N(mu, sigma^2), the n
weeks since the change y ~ N(mu + delta sigma, sigma^2); mu and sigma are not known, and the week is the unit, so that
areas with weeks of their own do no harm. With t the two-sample statistic on v = m + n - 2 degrees of freedom and
k = m n / (m + n), the e-value against delta = 0 is the Bayes factor of delta ~ N(0, g) under the right Haar prior of mu
and sigma (Gonen et al., The American Statistician 59, 2005),

    e_n = (1 + k g)^(-1/2) [ (1 + t^2/v) / (1 + t^2 / (v (1 + k g))) ]^((v+1)/2).

The e_n of n = 1, 2, ... form a test martingale (Perez-Ortiz, Lardy, de Heide & Grunwald, Annals of Statistics, 2024):
without an effect the chance that any of them ever reaches 20 is at most 1/20, however often they are read. The running
interval holds the effects that e < 20 does not reject; it holds the truth in all weeks at once with 95 %.

That holds if the area would have gone on like the comparison areas. Areas do not: a fall of the whole site reaches each
of them in another measure. So the range also reaches as far as the comparison areas' own shifts spread
(`vsd_analytics.stats.placebos`), and as far as it does with any one of them left out. A verdict is clear where the
whole range lies on one side of "no change": there is one range, and the verdict is read off it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State, Verdict
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.stats.period_days import Floats

MIN_REFERENCE_WEEKS: Final = 4
MAX_REFERENCE_WEEKS: Final = 12
"""Older weeks tell of another site."""
LAST_WEEKS: Final = 2
LAST_PART: Final = 0.5
"""An effect lasts if this part of its logarithm is left in the last weeks read."""
LEAST: Final = 1e-9
MOST_LOG_E: Final = math.log(1e9)
"""Evidence is counted up to here: beyond it no verdict changes, and a number of 300 digits says no more."""
EFFECT_VARIANCE: Final = 4.0
"""g: effects of about two standard deviations of a week are looked for."""


@dataclass(frozen=True, slots=True)
class RunningVerdict:
    """What is known of a change so far.

    Attributes:
        value: Ratio of the weeks since the change over the reference weeks, beside the comparison areas; None without.
            Without the area of `rests_on` where that claims less.
        lo, hi: Range of the effect: the running interval and the spread of the comparison areas' own shifts, as far as
            they reach with any one comparison area left out; None where nothing is excluded on that side yet.
        e_value: Evidence against "no change" now; a clear verdict needs 20 (at 95 %), and a range beside no change.
        e_by_week: The same after each week read.
        clear_since: The first week read, from 1, after which the e-value reached 20 and the shift lay outside
            those of the comparison areas; None = it never did.
        n_reference: Reference weeks.
        n_weeks: Weeks read since the change.
        verdict, state, reason: As for every change; the verdict is that of `lo` and `hi`.
        all_value, all_lo, all_hi: The same ratio and its running interval beside all comparison areas.
        spread_lo, spread_hi: That ratio as far as the comparison areas' own shifts spread; None without any.
        without: theta without each comparison area, in their order; None where too few weeks are known without it.
        rests_on: Which comparison area the size of the effect rests on: without it theta lies outside the running
            interval. None = on no single one.
        unclear_without: Without which one the running interval would not exclude "no change", where it does beside
            all; None = it would without any.
        last_value: The ratio of the last two weeks read over the reference weeks, beside all comparison areas.
        is_counted: By counts (`vsd_analytics.stats.few_events`), as logs of weeks cannot be taken: ratio, range and
            evidence are those of violations.
    """

    value: float | None
    lo: float | None
    hi: float | None
    e_value: float | None
    e_by_week: tuple[float, ...]
    clear_since: int | None
    n_reference: int
    n_weeks: int
    verdict: Verdict
    state: State
    reason: Reason | None
    all_value: float | None = None
    all_lo: float | None = None
    all_hi: float | None = None
    spread_lo: float | None = None
    spread_hi: float | None = None
    without: tuple[float | None, ...] = ()
    rests_on: int | None = None
    unclear_without: int | None = None
    last_value: float | None = None
    is_counted: bool = False

    @property
    def is_lasting(self) -> bool:
        """Whether the last two weeks hold half of the effect, in logs: a holiday of one area ends."""
        if self.all_value is None or self.last_value is None:
            return False
        effect = _log(self.all_value)
        return _log(self.last_value) * math.copysign(1.0, effect) >= LAST_PART * abs(effect)


def running_verdict(
    reference: npt.ArrayLike,
    weeks: npt.ArrayLike,
    *,
    without: Sequence[tuple[npt.ArrayLike, npt.ArrayLike]] = (),
    spread: npt.ArrayLike | None = None,
    confidence: float = 0.95,
    min_reference_weeks: int = MIN_REFERENCE_WEEKS,
) -> RunningVerdict:
    """Return the verdict on a change after the weeks read so far.

    Args:
        reference: Log ratios of the weeks before the change, oldest first, shape (m,); NaN = a week without one. The
            last twelve count.
        weeks: Log ratios of the weeks since, shape (n,), likewise.
        without: Both again, with each comparison area left out in turn.
        spread: How far a shift must lie from "no change" to stand out from those of the comparison areas, after each
            of `weeks`, shape (n,), on the log scale; None = nothing to stand out from.
        confidence: 1 - 1/e at which the verdict is clear.
        min_reference_weeks: Reference weeks needed.
    """
    y, after = (np.asarray(v, dtype=np.float64).ravel() for v in (reference, weeks))
    half_spread = np.zeros(len(after)) if spread is None else np.asarray(spread, dtype=np.float64)
    is_read = np.isfinite(after)
    y, after, half_spread = y[np.isfinite(y)][-MAX_REFERENCE_WEEKS:], after[is_read], half_spread[is_read]
    m, n = len(y), len(after)
    reason = too_few_weeks(m, n, min_reference_weeks=min_reference_weeks)
    if reason is not None:
        return no_verdict(reason, m, n)
    squares = float(((y - y.mean()) ** 2).sum())
    e = np.exp(np.minimum(log_e_values(m, float(y.mean()), squares, after), MOST_LOG_E))
    log_theta = float(after.mean() - y.mean())
    half = running_half_width(m, squares, after, confidence=confidence)
    lo, hi = (None, None) if half is None else (math.exp(log_theta - half), math.exp(log_theta + half))
    by_week = np.abs(np.cumsum(after) / np.arange(1, n + 1) - y.mean())
    reached = np.flatnonzero((e >= 1 / (1 - confidence)) & (by_week > half_spread))
    verdict = RunningVerdict(
        value=math.exp(log_theta), lo=lo, hi=hi, e_value=float(e[-1]), e_by_week=tuple(e.tolist()),
        clear_since=int(reached[0]) + 1 if len(reached) else None, n_reference=m, n_weeks=n,
        verdict=verdict_of(0.0 if lo is None else lo, hi), state="ok", reason=None,
        all_value=math.exp(log_theta), all_lo=lo, all_hi=hi,
        last_value=math.exp(float(after[-LAST_WEEKS:].mean() - y.mean())),
    )  # fmt: skip
    parts = [running_verdict(*y, confidence=confidence, min_reference_weeks=min_reference_weeks) for y in without]
    return as_far_as(verdict, parts, None if spread is None else float(half_spread[-1]))


def too_few_weeks(m: int, n: int, *, min_reference_weeks: int = MIN_REFERENCE_WEEKS) -> Reason | None:
    """Return why m reference weeks and n weeks since a change give no verdict, or None."""
    if m < min_reference_weeks:
        return Reason("logged_change.reference_weeks", least=min_reference_weeks, has=m)
    return None if n else Reason("logged_change.week_after", days=0)


def no_verdict(reason: Reason, n_reference: int = 0, n_weeks: int = 0) -> RunningVerdict:
    """Return a verdict that cannot be given, with why."""
    nothing = (None, None, None, None, (), None)
    return RunningVerdict(*nothing, n_reference, n_weeks, "too_little_data", "not_enough_data", reason)


def as_far_as(
    verdict: RunningVerdict, parts: Sequence[RunningVerdict], half_spread: float | None, *, least: float = 0.0
) -> RunningVerdict:
    """Return a verdict whose range reaches as far as those that leave one comparison area out, and as the spread.

    Args:
        verdict: The verdict beside all comparison areas.
        parts: Those with each left out.
        half_spread: How far a shift must lie from "no change" to stand out; None without comparison areas.
        least: The ratio taken for a fall to none, which has no log: that of half a violation.
    """
    each = [verdict, *(p for p in parts if p.value is not None)]
    lo = None if any(p.lo is None for p in each) else min(p.lo for p in each if p.lo is not None)
    hi = None if any(p.hi is None for p in each) else max(p.hi for p in each if p.hi is not None)
    beside = verdict.value or 0.0
    spread_lo = spread_hi = None
    if half_spread is not None:
        spread_lo, spread_hi = beside * math.exp(-half_spread), max(beside, least) * math.exp(half_spread)
        lo = None if lo is None else min(lo, spread_lo)
        hi = None if hi is None else max(hi, spread_hi)
    logs = {k: _log(p.value) for k, p in enumerate(parts) if p.value is not None}
    log_theta = _log(beside)
    is_clear = verdict.verdict in ("clear_fall", "clear_rise")
    low, high = (-math.inf if verdict.lo is None else _log(verdict.lo)), math.log(verdict.hi or math.inf)
    rests_on = _farthest(logs, [k for k, log in logs.items() if not low <= log <= high], log_theta)
    theta = verdict.value
    if rests_on is not None and len(parts) > 1 and 0 < logs[rests_on] * log_theta < log_theta**2:
        theta = math.exp(logs[rests_on])
    unclear = [k for k in logs if is_clear and parts[k].verdict != verdict.verdict]
    return replace(
        verdict, value=theta, lo=lo, hi=hi, verdict=verdict_of(0.0 if lo is None else lo, hi),
        spread_lo=spread_lo, spread_hi=spread_hi, without=tuple(p.value for p in parts), rests_on=rests_on,
        unclear_without=_farthest(logs, unclear, log_theta),
    )  # fmt: skip


def _log(theta: float | None) -> float:
    """Return ln of a ratio; of none at all that of the smallest that is looked for."""
    return math.log(max(theta or 0.0, LEAST))


def _farthest(logs: Mapping[int, float], among: Sequence[int], log_theta: float) -> int | None:
    """Return the area, of some, whose absence moves the effect most."""
    return max(among, key=lambda k: abs(logs[k] - log_theta), default=None)


def log_e_values(n_reference: int, mean: npt.ArrayLike, squares: npt.ArrayLike, weeks: npt.ArrayLike) -> Floats:
    """Return ln e_n after each week (formula: this module), for many changes at once.

    Args:
        n_reference: Reference weeks m.
        mean: Mean of their log ratios, shape (...).
        squares: Sum of their squared deviations from it, same shape.
        weeks: Log ratios since the change, shape (..., n).

    Returns:
        Shape (..., n).
    """
    shift, k, v, pooled = _shifts(n_reference, mean, squares, weeks)
    r = 1 + k * EFFECT_VARIANCE
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.where(shift == 0, 0.0, k * shift**2 / pooled)  # t^2 / v, as `pooled` is v times the variance
        ratio = np.where(np.isinf(x), np.log(r), np.log1p(x) - np.log1p(x / r))
    return np.asarray((v + 1) / 2 * ratio - np.log(r) / 2, dtype=np.float64)


def running_half_width(
    n_reference: int, squares: float, weeks: npt.ArrayLike, *, confidence: float = 0.95
) -> float | None:
    """Return the half width of the running interval on the log scale after all weeks; None where it has no end.

    With c = (K sqrt(r))^(2/(v+1)), r = 1 + k g, K = 1/(1 - confidence): t^2 = v (c - 1) / (1 - c/r) where c < r.
    """
    _, k, v, pooled = (np.asarray(a)[..., -1] for a in _shifts(n_reference, 0.0, squares, weeks))
    r = float(1 + k * EFFECT_VARIANCE)
    c = (math.sqrt(r) / (1 - confidence)) ** (2 / (float(v) + 1))
    return math.sqrt((c - 1) / (1 - c / r) * float(pooled) / float(k)) if c < r else None


def _shifts(
    n_reference: int, mean: npt.ArrayLike, squares: npt.ArrayLike, weeks: npt.ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return after each week: shift of means, k, v, and the sum of squares within both groups."""
    y = np.asarray(weeks, dtype=np.float64)
    n = np.arange(1, y.shape[-1] + 1, dtype=np.float64)
    means = np.cumsum(y, axis=-1) / n
    first = y[..., :1]  # sums of squares about it, which is near, not about 0
    within = np.cumsum((y - first) ** 2, axis=-1) - n * (means - first) ** 2
    shift = means - np.asarray(mean, dtype=np.float64)[..., None]
    pooled = np.asarray(squares, dtype=np.float64)[..., None] + np.maximum(within, 0.0)
    return shift, n_reference * n / (n_reference + n), n_reference + n - 2, pooled
