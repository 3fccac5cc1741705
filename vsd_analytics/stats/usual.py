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
    """Return the prediction interval for one more week: exp(m +- t_{n-1} s sqrt(1 + 1/n)).

    m and s are mean and standard deviation of the logarithms of the weeks before. A week that differs from them as they
    do from each other lies inside with probability `confidence`. Source: prediction interval of a normal sample (Hahn
    and Meeker, Statistical Intervals, 1991, section 4.7).

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
    reach = t_quantile(len(values) - 1, confidence=confidence) * float(logs.std(ddof=1)) * (1 + 1 / len(values)) ** 0.5
    lo, hi = (float(np.exp(logs.mean() + sign * reach)) for sign in (-1, 1))
    return UsualRange(lo, hi if most is None else min(hi, most), len(values))
