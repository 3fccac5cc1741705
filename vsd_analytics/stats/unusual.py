"""Hours with far more or fewer violations than the same hour of the weeks before (M24)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.result import Reason, State
from vsd_analytics.stats.false_discovery import benjamini_hochberg
from vsd_analytics.stats.forecast import MAX_WEEKS, MIN_WEEKS, RANGE
from vsd_analytics.stats.hour_of_week import as_weeks, spread, usual
from vsd_analytics.stats.negative_binomial import both_tails, quantile

Q_MAX: Final = 0.05
MIN_CHANGE: Final = 0.5  # of the usual
MIN_DIFFERENCE: Final = 5.0  # violations
MAX_SHOWN: Final = 5


@dataclass(frozen=True, slots=True)
class UnusualSlot:
    """An hour unlike the same hour of the weeks before.

    Attributes:
        slot: 24 weekday + hour, 0 Monday 00 to 167 Sunday 23.
        n: Counted.
        x_h: Recorded open hours it was counted in.
        usual: Expected in so many hours.
        lo, hi: Usual range: four of five such hours lie in it.
        p: Two-sided tail probability.
        q: Its Benjamini-Hochberg value over the hours of the week.
        n_weeks: Weeks the usual comes from.
    """

    slot: int
    n: float
    x_h: float
    usual: float
    lo: float
    hi: float
    p: float
    q: float
    n_weeks: int


@dataclass(frozen=True, slots=True)
class UnusualSlots:
    """The unusual hours of a week.

    Attributes:
        rows: At most `max_shown`, least likely first.
        n_unusual: How many there are.
        n_tested: Hours that were recorded and have a usual count.
        n_recorded_weeks: Weeks before with a recorded hour.
        state: "ok" when at least one hour could be judged.
        reason: Why not.
    """

    rows: tuple[UnusualSlot, ...]
    n_unusual: int
    n_tested: int
    n_recorded_weeks: int
    state: State
    reason: Reason | None


def unusual_hours(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    *,
    before_n: npt.ArrayLike,
    before_x_h: npt.ArrayLike,
    min_weeks: int = MIN_WEEKS,
    max_weeks: int = MAX_WEEKS,
    q_max: float = Q_MAX,
    min_change: float = MIN_CHANGE,
    min_difference: float = MIN_DIFFERENCE,
    max_shown: int = MAX_SHOWN,
) -> UnusualSlots:
    """Return the hours of a week whose count is hard to believe beside the same hour of the weeks before.

    Usual = median of the last `max_weeks` recorded weeks; p two-sided from a negative binomial with that mean and
    var = (mean + dispersion mean^2) (1 + pi / (2 k)), dispersion pooled over hours, the last factor because the median
    of k weeks is itself uncertain; q by Benjamini and Hochberg over the hours of the week. Unusual: q <= `q_max`, at
    least `min_change` of the usual and `min_difference` violations away from it. An hour without data is never unusual.

    Args:
        n: Violations, shape (168,).
        x_h: Recorded open hours, same shape; 0 or NaN = not recorded.
        before_n: Violations of the weeks before, shape (n_weeks, 168), oldest first.
        before_x_h: Recorded open hours of the weeks before, same shape.
        min_weeks: Recorded weeks an hour's usual count needs.
        max_weeks: Recorded weeks of an hour that are used at most.
        q_max: Expected share of false ones among the unusual hours of weeks that have true ones, and chance that a week
            without true ones has any.
        min_change: Difference needed, as a share of the usual.
        min_difference: Difference needed, in violations.
        max_shown: Rows returned.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    week, before = as_weeks(np.atleast_2d(n), np.atleast_2d(x_h)), as_weeks(before_n, before_x_h)
    late = before.latest(max_weeks)
    k = (late.x_h > 0).sum(axis=0)
    counted, hours = week.n[0], week.x_h[0]
    tested = (k >= min_weeks) & (hours > 0)
    reason = None
    if before.n_recorded < min_weeks:
        reason = Reason("unusual.weeks", least=min_weeks, has=before.n_recorded)
    elif not tested.any():
        reason = Reason("unusual.hours", least=min_weeks)
    if reason is not None:
        return UnusualSlots((), 0, 0, before.n_recorded, "not_enough_data", reason)
    expected = np.where(tested, usual(late, is_count=True) * hours, np.nan)
    more = 1 + np.pi / 2 / np.maximum(k, 1)
    varies = spread(late, is_count=True, min_weeks=min_weeks)
    # nothing was ever seen in the weeks before: half a violation in all of them is as much as that can rule out
    least = 0.5 * hours / np.maximum(late.x_h.sum(axis=0), 1e-9)
    mean = np.maximum(expected, np.where(tested, least, np.nan))
    dispersion = varies.dispersion * more + (more - 1) / mean
    p, q = np.full(counted.shape, np.nan), np.full(counted.shape, np.nan)
    p[tested] = both_tails(counted[tested], mean=mean[tested], dispersion=dispersion[tested])
    q[tested] = benjamini_hochberg(p[tested])
    away = np.abs(counted - expected)
    is_unusual = tested & (q <= q_max) & (away >= min_change * expected) & (away >= min_difference)
    found = np.flatnonzero(is_unusual)
    order = found[np.lexsort((found, p[found]))][:max_shown]
    lo, hi = (quantile(t, mean=mean, dispersion=dispersion) for t in ((1 - RANGE) / 2, (1 + RANGE) / 2))
    rows = tuple(
        UnusualSlot(
            int(s), float(counted[s]), float(hours[s]), float(expected[s]), float(lo[s]), float(hi[s]), float(p[s]),
            float(q[s]), int(k[s]),
        )
        for s in order
    )  # fmt: skip
    return UnusualSlots(rows, len(found), int(tested.sum()), before.n_recorded, "ok", None)
