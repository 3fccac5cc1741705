"""What happened to the whole floor around a change, and where: the net effect, and the contribution of each area.

R is a rate of the floor, person-time in violation per open hour; R_B over m reference weeks before a change, R_A over n
weeks after. theta = R_A / R_B. A week's relative deviation is e_w = (N_w - R X_w) / (N/m) with the period's own R, and

    var(ln theta) = s^2 (1/m + 1/n),   s^2 = (sum_B e_w^2 + sum_A e_w^2) / (m + n - 2),   Student's t, m + n - 2:

weeks are the unit, so the interval knows how weeks differ. Nothing is compared with, so seasons are in it: it says what
became of the floor, not why. The contribution of area j is (R_jA - R_jB) / R_B; contributions sum to theta - 1 exactly,
so what only moved from one area to another, at any distance, cancels.
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

MIN_REFERENCE_WEEKS: Final = 3


@dataclass(frozen=True, slots=True)
class NetEffect:
    """The change of the whole floor, after a logged change over before.

    Attributes:
        value: Ratio of the floor's rates after / before; None when it cannot be given.
        lo, hi: Its interval, from how weeks differ.
        log_se, df: Standard error of ln theta and degrees of freedom.
        rate_before, rate_after: The floor's rates.
        contributions: Part of each place in theta - 1, in the order given; their sum is theta - 1.
        n_reference, n_weeks: Weeks before and after.
        verdict, state, reason: As for every change.
    """

    value: float | None
    lo: float | None
    hi: float | None
    log_se: float | None
    df: float | None
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
        return _refused(Reason("redesign.reference_weeks", least=MIN_REFERENCE_WEEKS, has=m), m, n)
    if n == 0:
        return _refused(Reason("redesign.week_after", days=0), m, n)
    if not (n_b.any() and n_a.any()):
        return _refused(Reason("redesign.floor_without"), m, n)
    rates_b, rates_a = n_b.sum(axis=1) / x_b.sum(), n_a.sum(axis=1) / x_a.sum()
    before, after = float(rates_b.sum()), float(rates_a.sum())
    df = m + n - 2
    squares = sum(float((_deviations(k.sum(axis=0), x) ** 2).sum()) for k, x in ((n_b, x_b), (n_a, x_a)))
    log_se = math.sqrt(squares / df * (1 / m + 1 / n))
    half, theta = t_quantile(df, confidence=confidence) * log_se, after / before
    lo, hi = theta * math.exp(-half), theta * math.exp(half)
    return NetEffect(
        value=theta, lo=lo, hi=hi, log_se=log_se, df=float(df), rate_before=before, rate_after=after,
        contributions=tuple(((rates_a - rates_b) / before).tolist()), n_reference=m, n_weeks=n,
        verdict=verdict_of(lo, hi), state="ok", reason=None,
    )  # fmt: skip


def _weeks(n: npt.ArrayLike, x_h: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return the weeks that were recorded."""
    counts, hours = np.asarray(n, dtype=np.float64), np.nan_to_num(np.asarray(x_h, dtype=np.float64), nan=0.0)
    if counts.ndim != 2 or hours.shape != counts.shape[1:]:  # noqa: PLR2004  places by weeks
        raise ValueError("counts are places by weeks, with the floor's hours of each week")
    counts, hours = counts[:, hours != 0], hours[hours != 0]
    if not np.isfinite(counts).all() or not np.isfinite(hours).all() or (counts < 0).any() or (hours < 0).any():
        raise ValueError("counts and hours must be finite and not negative")
    return counts, hours


def _deviations(n: Floats, x_h: Floats) -> Floats:
    """Return each week's deviation from the period's rate, relative to a mean week."""
    return np.asarray((n - n.sum() / x_h.sum() * x_h) / n.mean(), dtype=np.float64)


def _refused(reason: Reason, n_reference: int, n_weeks: int) -> NetEffect:
    nothing = (None,) * 7
    return NetEffect(*nothing, (), n_reference, n_weeks, "too_little_data", "not_enough_data", reason)
