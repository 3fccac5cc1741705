"""Links between tracks that end and tracks that begin, by time and walking speed, less those that chance gives.

Where no camera looks, nobody can be followed. A track that begins where and when a walker would come out again may be
the same person's, or anybody's. The same count with time running backwards, tracks that begin *before* the other one
ends, can only be chance; what the first count has more is people. No pair is said to be one person.

Sources: counting pairs: Ripley, J. Appl. Probab. 13 (1976); walking speeds: Weidmann, Transporttechnik der Fussgänger
(1993).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.result import Reason
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.next_area import MIN_LEAVING
from vsd_analytics.stats.quantiles import t_quantile

SLOWEST_M_PER_S: Final = 0.6
FASTEST_M_PER_S: Final = 2.2
"""Walking speeds of nearly everybody, along the straight line (Weidmann: 1.34 on average, standard deviation 0.26)."""
SLACK_S: Final = 2.0
"""A record of either track may be missing, and clocks of two cameras may differ."""
FARTHEST_M: Final = 30.0
"""Nobody is sought farther away: too many others fit there."""
SAME_CAMERA_M: Final = 1.5
"""Shorter gaps within one camera's view are tracks that were cut, which shares of flow already count as lost."""

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class TrackEnds:
    """One end of some tracks, one element each.

    Attributes:
        at_s: When, seconds from any instant.
        x_m, y_m: Where.
        area: Area left last, or entered first; any integers.
        camera: Camera number.
        day: Day, 0 to n_days - 1.
    """

    at_s: Array
    x_m: Array
    y_m: Array
    area: Ints
    camera: Ints
    day: Ints


@dataclass(frozen=True, slots=True, eq=False)
class LinkCounts:
    """Pairs of an end and a start by day and areas.

    Attributes:
        forward: Pairs that a walker could be, shape (n_areas, n_areas, n_days): from, to, day.
        backward: The same with time running backwards, same shape.
    """

    forward: Array
    backward: Array


@dataclass(frozen=True, slots=True)
class LinkedShare:
    """Share of those who leave one area that is estimated to enter another one over floor where nobody is followed.

    Attributes:
        value: Links more than chance gives / people who leave; None when unknown.
        lo, hi: Limits of its interval; None without one.
        n_links: Pairs that fit.
        n_chance: Pairs that fit by chance.
        n: People who leave.
        reason: Why there is no value or no interval.
    """

    value: float | None
    lo: float | None
    hi: float | None
    n_links: int
    n_chance: int
    n: int
    reason: Reason | None


def link_counts(ends: TrackEnds, starts: TrackEnds, *, n_areas: int, n_days: int) -> LinkCounts:
    """Return how many pairs of an end and a later start a walker could be, and how many with time running backwards.

    A pair fits where distance / FASTEST_M_PER_S - SLACK_S / 2 <= time between, and 0 < time between <= distance /
    SLOWEST_M_PER_S + SLACK_S, at most `FARTHEST_M` apart.

    Args:
        ends: Where tracks end that left an area.
        starts: Where tracks begin that enter an area.
        n_areas: How many areas there are.
        n_days: How many days there are.
    """
    order = np.argsort(starts.at_s, kind="stable")
    begins = starts.at_s[order]
    reach_s = FARTHEST_M / SLOWEST_M_PER_S + SLACK_S
    first, last = (np.searchsorted(begins, ends.at_s + s) for s in (-reach_s, reach_s))
    n = last - first
    end = np.repeat(np.arange(len(n)), n)
    start = order[np.repeat(first - np.concatenate(([0], n.cumsum()[:-1])), n) + np.arange(n.sum())] if n.sum() else end
    between_s = starts.at_s[start] - ends.at_s[end]
    away_m = np.hypot(starts.x_m[start] - ends.x_m[end], starts.y_m[start] - ends.y_m[end])
    takes_s = np.abs(between_s)
    fits = (
        (takes_s > 0)
        & (away_m <= FARTHEST_M)
        & (takes_s >= away_m / FASTEST_M_PER_S - SLACK_S / 2)
        & (takes_s <= away_m / SLOWEST_M_PER_S + SLACK_S)
        & ((starts.camera[start] != ends.camera[end]) | (away_m >= SAME_CAMERA_M))
    )
    found = []
    for way in (between_s > 0, between_s < 0):
        chosen = fits & way
        counts = np.zeros((n_areas, n_areas, n_days))
        np.add.at(counts, (ends.area[end[chosen]], starts.area[start[chosen]], ends.day[end[chosen]]), 1.0)
        found.append(counts)
    return LinkCounts(*found)


def linked_share(
    forward: npt.ArrayLike,
    backward: npt.ArrayLike,
    left: npt.ArrayLike,
    *,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> LinkedShare:
    """Return the share of those who leave that is linked: (forward - backward) / left, sums over days.

    Limits: jackknife over days, t quantile of D - 1 degrees of freedom; never narrower than Poisson counts of pairs.

    Args:
        forward: Pairs that fit by day, shape (n_days,).
        backward: Pairs that fit with time running backwards, same shape.
        left: People who leave the area by day, same shape.
        confidence: Confidence level.
        min_days: Days with people who leave that an interval needs.
    """
    ahead, behind, of = (np.asarray(v, dtype=np.float64) for v in (forward, backward, left))
    n, used = int(of.sum()), np.flatnonzero(of)
    counts = int(ahead.sum()), int(behind.sum()), n
    if n < MIN_LEAVING:
        return LinkedShare(None, None, None, *counts, Reason("flow.few", least=MIN_LEAVING, has=n))
    value = float((ahead - behind).sum() / of.sum())
    n_days = len(used)
    if n_days < min_days:
        return LinkedShare(value, None, None, *counts, Reason("flow.days", least=min_days, has=n_days))
    total, whole = (ahead - behind).sum(), of.sum()
    without = np.array([(total - ahead[d] + behind[d]) / (whole - of[d]) for d in used])
    variance = (n_days - 1) / n_days * float(((without - without.mean()) ** 2).sum())
    least = (ahead.sum() + behind.sum()) / whole**2
    half = t_quantile(n_days - 1, confidence=confidence) * math.sqrt(max(variance, least))
    return LinkedShare(value, max(0.0, value - half), min(1.0, max(value, 0.0) + half), *counts, None)
