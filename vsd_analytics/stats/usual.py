"""The usual range of a weekly figure: where a week like the weeks before would lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.quantiles import t_quantile

MIN_WEEKS: Final = 4
"""Fewer weeks do not show how much weeks differ."""
DECAY: Final = 0.5
"""Each week counts half of the one after it, as for the level of a forecast."""


Position = Literal["below", "within", "above"]
"""Where a value lies beside a range."""


@dataclass(frozen=True, slots=True)
class UsualRange:
    """Where a week like the weeks before lies.

    Attributes:
        lo, hi: Its ends.
        n_weeks: Weeks before that it was made from.
    """

    lo: float
    hi: float
    n_weeks: int

    def position(self, value: float) -> Position:
        """Return where a value lies."""
        return "below" if value < self.lo else "above" if value > self.hi else "within"


def usual_range(
    weeks: Sequence[float], *, confidence: float = DEFAULTS.confidence, most: float | None = None
) -> UsualRange | None:
    """Return the prediction interval for one more week by exponential smoothing: exp(m_n +- t_{n-1} s sqrt(1 + w_n)).

    m_j is the mean of the logarithms of the first j weeks, where a week counts half of the one after it, w_j the sum of
    its squared weights, and s^2 the mean over j = 1 .. n - 1 of (log y_{j+1} - m_j)^2 / (1 + w_j): how far each week
    lay from what those before it said. So the range follows a season, and holds its level where weeks differ by chance
    alone and where they resemble the week before. Source: simple exponential smoothing (Hyndman and Athanasopoulos,
    Forecasting: principles and practice, 2021, section 8.1), with errors of one step ahead.

    Args:
        weeks: The figure of the weeks before, gaps left out.
        confidence: Level of the range.
        most: Greatest value the figure can have: 1 for a share.

    Returns:
        None with fewer than four weeks, or where one of them is 0.
    """
    values = np.asarray(weeks, dtype=np.float64)
    if len(values) < MIN_WEEKS or not (values > 0).all():
        return None
    logs = np.log(values)
    means, spreads = np.empty(len(logs)), np.empty(len(logs))
    for j in range(1, len(logs) + 1):
        weights = DECAY ** np.arange(j)[::-1]
        weights /= weights.sum()
        means[j - 1], spreads[j - 1] = weights @ logs[:j], 1 + weights @ weights
    s2 = float(((logs[1:] - means[:-1]) ** 2 / spreads[:-1]).mean())
    reach = t_quantile(len(logs) - 1, confidence=confidence) * (s2 * spreads[-1]) ** 0.5
    lo, hi = (float(np.exp(means[-1] + sign * reach)) for sign in (-1, 1))
    return UsualRange(lo, hi if most is None else min(hi, most), len(values))
