"""Clusters, links over time and gatherings of whole arrays at once: what SQL facts, made by the hour, are held to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

MIN_LAST_S: Final = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """Clusters of some frames, in order of their frames.

    Attributes:
        frame: Frame of each, shape (n_clusters,).
        size: Number of people, same shape.
        of: Cluster of each person who is in one, shape (n_people,); once per person and frame.
        seen_at: Where that person first stands in the arrays a, then b, one after the other, same shape.
    """

    frame: Ints
    size: Ints
    of: Ints
    seen_at: Ints


@dataclass(frozen=True, slots=True)
class Lasting:
    """One gathering.

    Attributes:
        started_ms, ended_ms: First and last cluster, milliseconds since 1970.
        duration_s: Last - first + one frame interval.
        n_people: Most people in it at one instant.
        person_s: Person-seconds in its clusters.
        x_m, y_m: Mean place over its person-time, floor metres; None without positions.
        diameter_m: Mean over its time of the largest distance between two people of one cluster; None likewise.
    """

    started_ms: int
    ended_ms: int
    duration_s: float
    n_people: int
    person_s: float
    x_m: float | None
    y_m: float | None
    diameter_m: float | None


def clusters(frame: npt.ArrayLike, a: npt.ArrayLike, b: npt.ArrayLike) -> Clusters:
    """Return the connected components of the close pairs of each frame.

    Args:
        frame: Frame of each pair, whole numbers from 0 in rising order, shape (n_pairs,).
        a: One of the two people of each, whole numbers that tell people of one frame apart, same shape.
        b: The other, likewise.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    of_frame, first, second = (np.asarray(v, dtype=np.int64) for v in (frame, a, b))
    if not len(of_frame):
        none = np.zeros(0, dtype=np.int64)
        return Clusters(none, none, none, none)
    person = np.concatenate((first, second))
    person = person - person.min()
    key = np.concatenate((of_frame, of_frame)) * (int(person.max()) + 1) + person
    _, seen_at, node = np.unique(key, return_index=True, return_inverse=True)
    n_nodes, n_pairs = len(seen_at), len(of_frame)
    graph = coo_matrix((np.ones(n_pairs, dtype=np.int8), (node[:n_pairs], node[n_pairs:])), shape=(n_nodes, n_nodes))
    of = connected_components(graph, directed=False)[1].astype(np.int64)
    found, at, size = np.unique(of, return_index=True, return_counts=True)
    frames = of_frame[seen_at[at] % n_pairs]
    order = np.argsort(frames, kind="stable")
    renumbered = np.empty(len(found), dtype=np.int64)
    renumbered[order] = np.arange(len(found))
    return Clusters(frames[order], size[order].astype(np.int64), renumbered[of], seen_at.astype(np.int64))


def pairs_within(group: npt.ArrayLike) -> tuple[Ints, Ints]:
    """Return the positions (i, j), i < j, of every two elements of one group.

    Args:
        group: Group of each element, in rising order, shape (n,).
    """
    of = np.asarray(group, dtype=np.int64)
    left = np.arange(len(of))
    found: list[tuple[Ints, Ints]] = []
    step = 1
    while True:
        left = left[left + step < len(of)]
        left = left[of[left] == of[left + step]]  # whose group ends before i + step has none at i + step + 1 either
        if not len(left):
            break
        found.append((left, left + step))
        step += 1
    if not found:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])


def link(of: npt.ArrayLike, track: npt.ArrayLike, *, ts_ms: npt.ArrayLike, gap_ms: npt.ArrayLike) -> Ints:
    """Return which clusters are one over time: labels from 0, shape (n_clusters,).

    Two clusters are joined when two track ids are in both, at most `gap_ms` apart; joined ones are one. A cluster of
    k tracks costs k (k - 1) / 2 steps.

    Args:
        of: Cluster of each member that has a track id, shape (n_members,).
        track: Its track id as a whole number from 0, same shape; twice in one cluster is once.
        ts_ms: Instant of each cluster, shape (n_clusters,).
        gap_ms: Longest time back to the cluster it may be joined with, same shape.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    at, gap = np.asarray(ts_ms, dtype=np.int64), np.asarray(gap_ms, dtype=np.int64)
    if not len(at):
        return np.zeros(0, dtype=np.int64)
    members = np.unique(np.stack((np.asarray(of, dtype=np.int64), np.asarray(track, dtype=np.int64)), axis=1), axis=0)
    i, j = pairs_within(members[:, 0])
    cluster, low, high = members[i, 0], members[i, 1], members[j, 1]
    order = np.lexsort((cluster, at[cluster], high, low))
    cluster, low, high = cluster[order], low[order], high[order]
    before, after = cluster[:-1], cluster[1:]
    same = (low[:-1] == low[1:]) & (high[:-1] == high[1:]) & (at[after] - at[before] <= gap[after])
    ones = np.ones(int(same.sum()), dtype=np.int8)
    graph = coo_matrix((ones, (before[same], after[same])), shape=(len(at), len(at)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def diameters(of: npt.ArrayLike, x: npt.ArrayLike, y: npt.ArrayLike, *, n_clusters: int) -> Floats:
    """Return the largest distance between two people of each cluster, shape (n_clusters,); NaN without positions.

    Args:
        of: Cluster of each person, in rising order, shape (n_people,).
        x: Their places, same shape; NaN when unknown.
        y: Likewise.
        n_clusters: Number of clusters.
    """
    group, at_x, at_y = np.asarray(of, dtype=np.int64), np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    i, j = pairs_within(group)
    far = np.hypot(at_x[i] - at_x[j], at_y[i] - at_y[j])
    widest = np.full(n_clusters, -np.inf)
    known = ~np.isnan(far)
    np.maximum.at(widest, group[i[known]], far[known])
    return np.where(np.isfinite(widest), widest, np.nan)


def lasting(
    label: npt.ArrayLike,
    *,
    ts_ms: npt.ArrayLike,
    interval_ms: npt.ArrayLike,
    size: npt.ArrayLike,
    weight_s: npt.ArrayLike,
    x_m: npt.ArrayLike,
    y_m: npt.ArrayLike,
    diameter_m: npt.ArrayLike,
    min_last_s: float = MIN_LAST_S,
) -> tuple[Lasting, ...]:
    """Return the gatherings that last, in order of their start.

    Args:
        label: Gathering of each cluster (`link`), shape (n_clusters,).
        ts_ms: Instant of each cluster, same shape, as all that follow.
        interval_ms: Frame interval then.
        size: People in it.
        weight_s: Time its frame stands for.
        x_m: Its centroid; NaN when unknown.
        y_m: Likewise.
        diameter_m: Its diameter; NaN when unknown.
        min_last_s: Shorter ones are left out.
    """
    of = np.asarray(label, dtype=np.int64)
    at, interval = np.asarray(ts_ms, dtype=np.int64), np.asarray(interval_ms, dtype=np.int64)
    n, weight = np.asarray(size, dtype=np.int64), np.asarray(weight_s, dtype=np.float64)
    x, y, wide = (np.asarray(v, dtype=np.float64) for v in (x_m, y_m, diameter_m))
    order = np.lexsort((at, of))
    made = []
    for rows in np.split(order, np.flatnonzero(np.diff(of[order])) + 1) if len(order) else []:
        start, end = int(at[rows[0]]), int(at[rows[-1]])
        duration_s = (end - start + int(interval[rows].max())) / 1000
        if duration_s < min_last_s:
            continue
        _, frame = np.unique(at[rows], return_inverse=True)
        person_s = n[rows] * weight[rows]
        made.append(
            Lasting(
                started_ms=start,
                ended_ms=end,
                duration_s=duration_s,
                n_people=int(np.bincount(frame, weights=n[rows]).max()),
                person_s=float(person_s.sum()),
                x_m=_mean(x[rows], person_s),
                y_m=_mean(y[rows], person_s),
                diameter_m=_mean(wide[rows], weight[rows]),
            )
        )
    return tuple(sorted(made, key=lambda g: (g.started_ms, g.ended_ms, -g.person_s)))


def _mean(values: Floats, weights: Floats) -> float | None:
    known = ~np.isnan(values) & (weights > 0)
    return float(np.average(values[known], weights=weights[known])) if known.any() else None
