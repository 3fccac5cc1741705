"""How often this site's own history would raise a false alarm: its weeks shuffled, so that nothing changes on average.

An A/A test. Weeks of the past are put in random order and each is compared with the one before it as in a report,
with the weeks before those as its history. Whatever differed from week to week still does; what changed for good, a
trend or a logged change, is shuffled away, as are the order of seasons and the likeness of neighbouring weeks. So is
each whole week moved along in time ("shifted"), its days staying in place. A clear verdict is then a false one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.changes import compare_violation_rates
from vsd_analytics.stats.quantiles import z_quantile

MIN_WEEKS: Final = 10  # eight steps before the first of two weeks that are compared
SEED: Final = 20261109


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """How often weeks that differ by chance only got a clear verdict.

    Attributes:
        value: Clear verdicts over verdicts.
        lo, hi: Its interval: Wilson's, with the weeks of the history in place of the shuffles, which repeat them.
        n_weeks: Weeks of history used.
        n_verdicts: Comparisons made.
    """

    value: float
    lo: float
    hi: float
    n_weeks: int
    n_verdicts: int


def false_alarm_rate(
    history_n: npt.ArrayLike,
    history_x_h: npt.ArrayLike,
    *,
    shuffles: int = 50,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> FalseAlarms | None:
    """Return how often shuffled weeks of a site would have been called a clear fall or rise.

    Args:
        history_n: Violations of past weeks, shape (n_weeks, n_cameras, n_days), the same weekdays in each; for
            violations per person-hour one row in place of the cameras.
        history_x_h: Recorded open hours (or person-hours), same shape; 0 or NaN = not recorded.
        shuffles: Random orders; the first is the weeks as they came, shifted by half their number.
        confidence: As for `compare_violation_rates`.
        min_days: As for `compare_violation_rates`.

    Returns:
        The share of clear verdicts; None with fewer than 10 weeks in which anything was recorded, or without a verdict.

    Raises:
        ValueError: As for `compare_violation_rates`.
    """
    n, x_h = np.asarray(history_n, dtype=np.float64), np.asarray(history_x_h, dtype=np.float64)
    used = (np.nan_to_num(x_h) > 0).any(axis=(1, 2)) if len(n) else np.zeros(0, dtype=bool)
    n, x_h = n[used], x_h[used]
    n_weeks = len(n)
    if n_weeks < MIN_WEEKS:
        return None
    rng = np.random.default_rng(SEED)
    orders = [np.roll(np.arange(n_weeks), n_weeks // 2), *(rng.permutation(n_weeks) for _ in range(shuffles - 1))]
    n_clear = n_verdicts = 0
    for order in orders:
        *past, a, b = order.tolist()
        change = compare_violation_rates(
            n[a], x_h[a], n[b], x_h[b],
            history_n=n[past], history_x_h=x_h[past], confidence=confidence, min_days=min_days,
        )  # fmt: skip
        n_verdicts += change.verdict != "too_little_data"
        n_clear += change.verdict in {"clear_fall", "clear_rise"}
    if not n_verdicts:
        return None
    lo, hi = wilson(n_clear / n_verdicts, n=n_weeks, confidence=confidence)
    return FalseAlarms(n_clear / n_verdicts, lo, hi, n_weeks, n_verdicts)


def together(figures: Sequence[FalseAlarms], *, confidence: float = DEFAULTS.confidence) -> FalseAlarms:
    """Return the share of clear verdicts of several figures of the same weeks; their errors come together.

    Args:
        figures: One or more.
        confidence: Of the interval, which has the weeks of the figure with the fewest.
    """
    n_weeks, n_verdicts = min(f.n_weeks for f in figures), sum(f.n_verdicts for f in figures)
    share = sum(f.value * f.n_verdicts for f in figures) / n_verdicts
    lo, hi = wilson(share, n=n_weeks, confidence=confidence)
    return FalseAlarms(share, lo, hi, n_weeks, n_verdicts)


def wilson(share: float, *, n: int, confidence: float) -> tuple[float, float]:
    """Return Wilson's interval of a share of `n` cases (Journal of the American Statistical Association 22, 1927)."""
    z2 = z_quantile(confidence=confidence) ** 2
    middle = (share + z2 / 2 / n) / (1 + z2 / n)
    half = math.sqrt(z2 * (share * (1 - share) / n + z2 / 4 / n**2)) / (1 + z2 / n)
    return max(0.0, middle - half), min(1.0, middle + half)
