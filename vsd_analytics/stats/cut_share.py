"""Did the share of track ids that a tracker cuts change (M29), and what that does to a change of counts.

r = sum_d c_d / sum_d e_d: of the ids that end in days d, those that go on under another one, above what chance gives.
Days are clusters: var(r) = D/(D-1) sum_d (c_d - r e_d)^2 / (sum_d e_d)^2 (Cochran, Sampling Techniques, ch. 6). Ids
cut for up to two seconds are joined and move counts by 2 % at most. Those lost for longer are not: where half are cut
and lost for up to 10 s, counts rise by 12 %, of which this share shows little. So a change of it says that the tracker
changed, and a change of counts is then known only to within `MOST_SHIFT` (docs/statistics.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.estimates import ChangeEstimate, verdict_of
from vsd_analytics.stats.period_days import Floats
from vsd_analytics.stats.quantiles import t_quantile

LEAST: Final = 0.03
"""A smaller change of the share is none: as much is left where people pass close to each other."""
STANDARD_ERRORS: Final = 3.0
MOST_SHIFT: Final = 0.12
"""Relative shift of counts that cut ids were measured to make, at most."""
MIN_DAYS: Final = 2


@dataclass(frozen=True, slots=True)
class CutShares:
    """Shares of ids that go on under another one, before and after."""

    before: float
    now: float


def changed_cut_share(before: tuple[Floats, Floats], now: tuple[Floats, Floats]) -> CutShares | None:
    """Return the shares of two periods where they differ by more than their noise; None where they do not.

    Args:
        before: Ids that go on less those by chance, and ids that end, by day, shape (n_days,) each.
        now: The same of the later period.
    """
    (r, v), (s, w) = _share(*before), _share(*now)
    is_changed = abs(s - r) > max(LEAST, STANDARD_ERRORS * math.sqrt(v + w))
    return CutShares(max(0.0, r), max(0.0, s)) if is_changed else None


def widened(
    change: ChangeEstimate, *, confidence: float, about_same_share: float = DEFAULTS.about_same_share
) -> ChangeEstimate:
    """Return a change of counts with a range wider by `MOST_SHIFT` on either side, and the verdict that allows."""
    if change.value is None or change.lo is None or change.hi is None:
        return change
    lo, hi = change.lo / (1 + MOST_SHIFT), change.hi * (1 + MOST_SHIFT)
    log_se = change.log_se
    if log_se is not None and change.df is not None:
        log_se += math.log1p(MOST_SHIFT) / t_quantile(change.df, confidence=confidence)
    return replace(
        change, lo=lo, hi=hi, log_se=log_se, verdict=verdict_of(lo, hi, about_same_share=about_same_share),
        is_conservative=True,
    )  # fmt: skip


def _share(goes_on: Floats, ends: Floats) -> tuple[float, float]:
    """Return the share and its variance; an infinite one with too few days."""
    n, total = int((ends > 0).sum()), float(ends.sum())
    if n < MIN_DAYS:
        return 0.0, math.inf
    share = float(goes_on.sum()) / total
    return share, n / (n - 1) * float(((goes_on - share * ends) ** 2).sum()) / total**2
