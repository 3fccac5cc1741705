"""Sizes of clusters over time (M21): a cluster is a connected component of the close pairs of one frame.

Clusters and gatherings themselves are facts (`sql/facts/cluster_times.sql`, `gathering_parts.sql`).
`vsd_analytics.live.situations.gatherings` finds the same clusters one frame at a time; a test holds the two together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State

SIZES: Final = ((2, 2), (3, 3), (4, 4), (5, 7), (8, None))
"""Classes of cluster sizes, both ends inclusive."""
MIN_CLUSTER_S: Final = 1800.0
"""Shares of sizes need clusters for half an hour in all (catalogue, M21)."""


@dataclass(frozen=True, slots=True)
class SizeShare:
    """How much of the time people spent in clusters was spent in clusters of a size.

    Attributes:
        least, most: Sizes of the class, inclusive; `most` is None when open.
        person_s: Person-seconds in clusters of these sizes.
        share: Of all person-seconds in clusters, 0 to 1; None when there is not enough.
    """

    least: int
    most: int | None
    person_s: float
    share: float | None


@dataclass(frozen=True, slots=True)
class SizeDistribution:
    """Cluster sizes weighted by time (M21).

    Attributes:
        sizes: Every class of `SIZES`.
        person_s: Person-seconds in clusters: the denominator.
        cluster_s: Sum of the time clusters were there, seconds.
        state, reason: "ok", or why there are no shares.
    """

    sizes: tuple[SizeShare, ...]
    person_s: float
    cluster_s: float
    state: State
    reason: Reason | None


def size_distribution(
    size: npt.ArrayLike, weight_s: npt.ArrayLike, *, min_cluster_s: float = MIN_CLUSTER_S
) -> SizeDistribution:
    """Return which share of the person-time in clusters is in clusters of 2, 3, 4, 5 to 7, 8 and more (M21).

    share_k = sum over clusters of class k of size * weight / the same over all clusters: by person-time, so that it
    does not depend on how often the engine looks.

    Args:
        size: People in each cluster, at least 2, shape (n,).
        weight_s: How long it was there in seconds: the time of its frame, or a sum of such times, same shape.
        min_cluster_s: Shares need so much time in all.
    """
    n, weight = np.asarray(size, dtype=np.int64), np.asarray(weight_s, dtype=np.float64)
    person_s, cluster_s = float((n * weight).sum()), float(weight.sum())
    state: State = "ok"
    reason = None
    if cluster_s < min_cluster_s:
        state = "not_enough_data"
        reason = Reason("clusters.short", least=min_cluster_s / 60, has=cluster_s / 60)
    shares = []
    for least, most in SIZES:
        inside = (n >= least) & (n <= (most if most is not None else n))
        own_s = float((n[inside] * weight[inside]).sum())
        shares.append(SizeShare(least, most, own_s, own_s / person_s if reason is None else None))
    return SizeDistribution(tuple(shares), person_s, cluster_s, state, reason)
