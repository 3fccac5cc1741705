"""Hours with far more or fewer violations than the same hour of the weeks before (M24)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.false_discovery import benjamini_hochberg
from vsd_analytics.stats.forecast import MAX_WEEKS, MIN_WEEKS
from vsd_analytics.stats.hour_of_week import as_weeks, spread, usual
from vsd_analytics.stats.negative_binomial import both_tails, quantile

MAX_SHOWN: Final = 5
"""Rows on a page; all are counted."""


@dataclass(frozen=True, slots=True)
class Unusual:
    """An hour unlike the same hour of the weeks before.

    Attributes:
        day: Local date.
        weekday: 0 Monday to 6 Sunday.
        hour: Local hour, 0 to 23.
        violations: Counted.
        recorded_h: Recorded open hours, of all cameras together.
        usual: Expected in so many hours: the median of the same hour of the weeks before.
        lo, hi: Usual range: four of five such hours lie in it.
        ratio: violations / usual; None where there are usually none.
        q: Chance value: the Benjamini-Hochberg value of its two-sided tail probability over the hours of the week.
        n_weeks: Weeks the usual comes from.
    """

    day: date
    weekday: int
    hour: int
    violations: int
    recorded_h: float
    usual: float
    lo: float
    hi: float
    ratio: float | None
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

    rows: tuple[Unusual, ...]
    n_unusual: int
    n_tested: int
    n_recorded_weeks: int
    state: State
    reason: Reason | None


def unusual_hours(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    *,
    monday: date,
    before_n: npt.ArrayLike,
    before_x_h: npt.ArrayLike,
    q_max: float = DEFAULTS.unusual_false_share,
    min_change: float = DEFAULTS.unusual_min_change,
    min_difference: float = DEFAULTS.unusual_min_violations,
    share: float = DEFAULTS.forecast_share,
    max_shown: int = MAX_SHOWN,
) -> UnusualSlots:
    """Return the hours of a week whose count is hard to believe beside the same hour of the weeks before.

    Usual = median of the last `MAX_WEEKS` recorded weeks; p two-sided from a negative binomial with that mean and
    var = (mean + dispersion mean^2) (1 + pi / (2 k)), dispersion pooled over hours, the last factor because the median
    of k weeks is itself uncertain; q by Benjamini and Hochberg over the hours of the week. Unusual: q <= `q_max`, at
    least `min_change` of the usual and `min_difference` violations away from it. An hour without data is never unusual.

    Args:
        n: Violations, shape (168,).
        x_h: Recorded open hours, same shape; 0 or NaN = not recorded.
        monday: First day of the week.
        before_n: Violations of the weeks before, shape (n_weeks, 168), oldest first.
        before_x_h: Recorded open hours of the weeks before, same shape.
        q_max: Expected share of false ones among the unusual hours of weeks that have true ones, and chance that a week
            without true ones has any.
        min_change: Difference needed, as a share of the usual.
        min_difference: Difference needed, in violations.
        share: Share of hours the range beside the usual count is to hold.
        max_shown: Rows returned.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    week, before = as_weeks(np.atleast_2d(n), np.atleast_2d(x_h)), as_weeks(before_n, before_x_h)
    late = before.latest(MAX_WEEKS)
    k = (late.x_h > 0).sum(axis=0)
    counted, hours = week.n[0], week.x_h[0]
    tested = (k >= MIN_WEEKS) & (hours > 0)
    reason = None
    if before.n_recorded < MIN_WEEKS:
        reason = Reason("unusual.weeks", least=MIN_WEEKS, has=before.n_recorded)
    elif not tested.any():
        reason = Reason("unusual.hours", least=MIN_WEEKS)
    if reason is not None:
        return UnusualSlots((), 0, 0, before.n_recorded, "not_enough_data", reason)
    expected = np.where(tested, usual(late, is_count=True) * hours, np.nan)
    more = 1 + np.pi / 2 / np.maximum(k, 1)
    varies = spread(late, is_count=True, min_weeks=MIN_WEEKS)
    # nothing was ever seen in the weeks before: half a violation in all of them is as much as that can rule out
    least = 0.5 * hours / np.maximum(late.x_h.sum(axis=0), 1e-9)
    mean = np.maximum(expected, np.where(tested, least, np.nan))
    dispersion = varies.dispersion * more + (more - 1) / mean
    p, q = np.full(counted.shape, np.nan), np.full(counted.shape, np.nan)
    p[tested] = both_tails(counted[tested], mean=mean[tested], dispersion=dispersion[tested])
    q[tested] = benjamini_hochberg(p[tested])
    away = np.abs(counted - expected)
    is_unusual = tested & (q <= q_max) & (away >= min_change * expected) & (away >= min_difference)
    slots = np.flatnonzero(is_unusual)
    order = slots[np.lexsort((slots, p[slots]))][:max_shown]
    lo, hi = (quantile(t, mean=mean, dispersion=dispersion) for t in ((1 - share) / 2, (1 + share) / 2))
    rows = tuple(
        Unusual(
            day=monday + timedelta(days=s // 24),
            weekday=s // 24,
            hour=s % 24,
            violations=round(counted[s]),
            recorded_h=float(hours[s]),
            usual=float(expected[s]),
            lo=float(lo[s]),
            hi=float(hi[s]),
            ratio=float(counted[s] / expected[s]) if expected[s] > 0 else None,
            q=float(q[s]),
            n_weeks=int(k[s]),
        )
        for s in order.tolist()
    )
    return UnusualSlots(rows, len(slots), int(tested.sum()), before.n_recorded, "ok", None)
