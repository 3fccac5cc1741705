"""What happened to the whole floor around a change, and where: the net effect, and the contribution of each area.

R is a rate of the floor, person-time in violation per open hour; R_B over m reference weeks before a change, R_A over n
weeks after. theta = R_A / R_B. It is read every week, and weeks resemble the week before, so its interval is a
confidence sequence: the effects that the mixture test of `vsd_analytics.stats.running_verdict` does not reject (Howard,
Ramdas, McAuliffe & Sekhon, Annals of Statistics 49, 2021), on log rates of weeks whose variance is multiplied by that
of a mean of correlated weeks,

    f = (1 + r) / (1 - r),   r = (T r_1 + 20 * 0.4) / (T + 20),   0 <= r <= 0.8,

r_1 the lag-1 correlation of the T = m + n deviations from their period's mean, plus its bias 2/T (Newey & West,
Econometrica 55, 1987, with the weights of a first-order series: twelve weeks tell no more). From eight weeks before on
it also reaches as far as the weeks beside the line of those before, continued, as a season is a line first.

Nothing is compared with: it says what became of the floor, not why. The contribution of area j is (R_jA - R_jB) / R_B;
contributions sum to theta - 1 exactly, so what only moved from one area to another, at any distance, cancels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State, Verdict
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.stats.period_days import Floats
from vsd_analytics.stats.quantiles import t_quantile
from vsd_analytics.stats.running_verdict import running_half_width

MIN_REFERENCE_WEEKS: Final = 3
MIN_WEEKS_CONTINUED: Final = 8
"""Weeks before the change from which on their line is continued behind it."""
USUAL_CORRELATION: Final = 0.4
USUAL_WEEKS: Final = 20.0
"""The lag-1 correlation of weeks that is assumed, and how many weeks that counts as."""
MOST_CORRELATION: Final = 0.8


@dataclass(frozen=True, slots=True)
class NetEffect:
    """The change of the whole floor, after a logged change over before.

    Attributes:
        value: Ratio of the floor's rates after / before; None when it cannot be given.
        lo, hi: Its range, which holds in all weeks at once; None where nothing is excluded on that side yet.
        correlation: Of a week with the one before, as it was allowed for.
        rate_before, rate_after: The floor's rates.
        contributions: Part of each place in theta - 1, in the order given; their sum is theta - 1.
        n_reference, n_weeks: Weeks before and after.
        verdict, state, reason: As for every change.
    """

    value: float | None
    lo: float | None
    hi: float | None
    correlation: float | None
    rate_before: float | None
    rate_after: float | None
    contributions: tuple[float, ...]
    n_reference: int
    n_weeks: int
    verdict: Verdict
    state: State
    reason: Reason | None

    def share_of(self, place: int) -> float | None:
        """Return the share a place holds of the floor's change; above 1 where the rest moved the other way.

        None where the floor did not change at all, or the place moved the other way than the floor.
        """
        if self.value is None or self.value == 1 or self.contributions[place] * (self.value - 1) <= 0:
            return None
        return self.contributions[place] / (self.value - 1)

    def moved_elsewhere(self, place: int) -> float | None:
        """Return how much of the fall of a place the others together took up: 0 nothing, 1 all of it.

        None where the place did not fall.
        """
        if self.value is None or self.contributions[place] >= 0:
            return None
        others = self.value - 1 - self.contributions[place]
        return max(0.0, others / -self.contributions[place])


def net_effect(
    n_before: npt.ArrayLike,
    x_before_h: npt.ArrayLike,
    n_after: npt.ArrayLike,
    x_after_h: npt.ArrayLike,
    *,
    confidence: float = 0.95,
) -> NetEffect:
    """Return the change of the whole floor and the contribution of each place to it.

    Args:
        n_before: Person-time in violation (or violations) of each place of the floor in the weeks before, shape
            (n_places, m); the places together are the floor.
        x_before_h: Recorded open hours of the floor in these weeks, shape (m,); 0 or NaN = not recorded.
        n_after: The same after, shape (n_places, n).
        x_after_h: The same after, shape (n,).
        confidence: Confidence level.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    (n_b, x_b), (n_a, x_a) = _weeks(n_before, x_before_h), _weeks(n_after, x_after_h)
    if len(n_b) != len(n_a):
        raise ValueError("both periods must have the same places")
    m, n = len(x_b), len(x_a)
    if m < MIN_REFERENCE_WEEKS:
        return _refused(Reason("logged_change.reference_weeks", least=MIN_REFERENCE_WEEKS, has=m), m, n)
    if n == 0:
        return _refused(Reason("logged_change.week_after", days=0), m, n)
    if not n_b.any():
        return _refused(Reason("logged_change.floor_without"), m, n)
    rates_b, rates_a = n_b.sum(axis=1) / x_b.sum(), n_a.sum(axis=1) / x_a.sum()
    before, after = float(rates_b.sum()), float(rates_a.sum())
    logs_b, logs_a = _log_rates((n_b, x_b), (n_a, x_a))
    lo, hi, correlation = _range(logs_b, logs_a, confidence=confidence)
    return NetEffect(
        value=after / before, lo=0.0 if after == 0 else lo, hi=hi, correlation=correlation, rate_before=before,
        rate_after=after, contributions=tuple(((rates_a - rates_b) / before).tolist()), n_reference=m, n_weeks=n,
        verdict=verdict_of(0.0 if lo is None else lo, hi), state="ok", reason=None,
    )  # fmt: skip


def _log_rates(*periods: tuple[Floats, Floats]) -> tuple[Floats, ...]:
    """Return the floor's log rate by week; a week without anything counts as half of the smallest one."""
    rates = [n.sum(axis=0) / x_h for n, x_h in periods]
    least = min(float(rate[rate > 0].min()) for rate in rates if rate.any()) / 2
    return tuple(np.asarray(np.log(np.maximum(rate, least)), dtype=np.float64) for rate in rates)


def _range(b: Floats, a: Floats, *, confidence: float) -> tuple[float | None, float | None, float]:
    """Return the range of theta from log rates of weeks, and the correlation allowed for (formulas: this module)."""
    m, n = len(b), len(a)
    dev_b, dev_a = b - b.mean(), a - a.mean()
    squares = float(dev_b @ dev_b + dev_a @ dev_a)
    correlation = float(dev_b[1:] @ dev_b[:-1] + dev_a[1:] @ dev_a[:-1]) / squares + 2 / (m + n) if squares else 0.0
    r = ((m + n) * correlation + USUAL_WEEKS * USUAL_CORRELATION) / (m + n + USUAL_WEEKS)
    r = min(max(r, 0.0), MOST_CORRELATION)
    more = (1 + r) / (1 - r)
    shift = float(a.mean() - b.mean())
    half = running_half_width(m, float(dev_b @ dev_b) * more, a.mean() + dev_a * math.sqrt(more), confidence=confidence)
    if half is None:
        return None, None, r
    lo, hi = shift - half, shift + half
    if m >= MIN_WEEKS_CONTINUED:
        at = np.arange(m) - (m - 1) / 2
        spread = float(at @ at)
        slope = float(at @ dev_b) / spread
        rest = dev_b - slope * at
        reach = (m + n) / 2
        se = math.sqrt(float(rest @ rest) / (m - 2) * more * (1 / n + 1 / m + reach**2 / spread))
        beside, margin = shift - slope * reach, t_quantile(m - 2, confidence=confidence) * se
        lo, hi = min(lo, beside - margin), max(hi, beside + margin)
    return math.exp(lo), math.exp(hi), r


def _weeks(n: npt.ArrayLike, x_h: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return the weeks that were recorded."""
    counts, hours = np.asarray(n, dtype=np.float64), np.nan_to_num(np.asarray(x_h, dtype=np.float64), nan=0.0)
    if counts.ndim != 2 or hours.shape != counts.shape[1:]:  # noqa: PLR2004  places by weeks
        raise ValueError("counts are places by weeks, with the floor's hours of each week")
    counts, hours = counts[:, hours != 0], hours[hours != 0]
    if not np.isfinite(counts).all() or not np.isfinite(hours).all() or (counts < 0).any() or (hours < 0).any():
        raise ValueError("counts and hours must be finite and not negative")
    return counts, hours


def _refused(reason: Reason, n_reference: int, n_weeks: int) -> NetEffect:
    nothing = (None,) * 6
    return NetEffect(*nothing, (), n_reference, n_weeks, "too_little_data", "not_enough_data", reason)
