"""Clusters of people in violation: `frame_clusters`, `clustered`, `clusters`, `cluster_times`, `gathering_clusters`."""

from __future__ import annotations

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import beside, greatest, order_by, starts_of, summed, take
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables, bucket_of, gap_ms, is_close
from vsd_analytics.warehouse.graphs import least_connected
from vsd_analytics.warehouse.held import NULL, Columns, Held, Ints

_DIRECTIONS = (
    (1000, 0), (981, 195), (924, 383), (831, 556), (707, 707), (556, 831), (383, 924), (195, 981),
    (0, 1000), (-195, 981), (-383, 924), (-556, 831), (-707, 707), (-831, 556), (-924, 383), (-981, 195),
)  # fmt: skip


def frame_clusters(held: Held, site: SiteTables) -> Columns:
    """Return `staging/frame_clusters`; rows are those of `in_violation`, `_first` is the row of the cluster's first."""
    pairs = held["pairs"]
    close = np.flatnonzero(is_close(pairs, site))
    a, b = pairs["_a"][close], pairs["_b"][close]
    n = int(max(a.max(), b.max())) + 1 if len(close) else 0
    pair_of = np.full(n, -1, dtype=np.int64)
    pair_of[b], pair_of[a] = close, close
    is_first = np.zeros(n, dtype=np.bool_)
    is_first[a] = True
    people = np.flatnonzero(pair_of >= 0)
    row_of = np.zeros(n, dtype=np.int64)
    row_of[people] = np.arange(len(people))
    first, pair = least_connected(row_of[a], row_of[b], len(people)), pair_of[people]
    member = np.where(is_first[people], pairs["member_a"][pair], pairs["member_b"][pair])
    return {
        **{c: pairs[c][pair] for c in ("camera_id", "ts_ms")},
        "node": member,
        "component": member[first],
        "_first": first,
    }


def clustered(held: Held, site: SiteTables) -> Columns:
    """Return `staging/clustered`, in the order of `in_violation`."""
    del site
    columns = {
        c: held["in_violation"][c] for c in ("camera_id", "ts_ms", "member", "track_id", "x_mm", "y_mm", "weight_ms")
    }
    return {**columns, "cluster": held["frame_clusters"]["component"]}


def clusters(held: Held, site: SiteTables) -> Columns:
    """Return `staging/clusters`, in order of camera, instant and cluster; `_row` is its first row of `clustered`."""
    people, first = held["clustered"], held["frame_clusters"]["_first"]
    n = len(first)
    n_people = np.bincount(first, minlength=n)
    rows = np.flatnonzero(n_people)
    numbers, placed = np.zeros(n, dtype=np.int64), people["x_mm"] != NULL
    numbers[rows] = np.arange(len(rows))
    cluster = numbers[first]
    n_located = np.bincount(cluster[placed], minlength=len(rows))
    # sums of whole millimetres stay far below 2**53: floats hold them exactly
    x, y = (
        np.bincount(cluster[placed], people[c][placed], minlength=len(rows)).astype(np.int64) for c in ("x_mm", "y_mm")
    )
    camera, ts = people["camera_id"][rows], people["ts_ms"][rows]
    x, y = (np.where(n_located > 0, numbers, NULL) for numbers in (x, y))
    is_owned = site.floors.is_owned(camera, ts, x, y, np.maximum(n_located, 1))
    return {
        "camera_id": camera,
        "ts_ms": ts,
        "cluster": people["cluster"][rows],
        "n_people": n_people[rows],
        "n_located": n_located,
        "sum_x_mm": x,
        "sum_y_mm": y,
        "weight_ms": people["weight_ms"][rows],
        "is_owned": is_owned,
        "_row": rows,
    }


def cluster_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/cluster_times`."""
    rows = held["clusters"]
    bucket = bucket_of(rows["ts_ms"], site)
    keys = {
        "hour": bucket // 4,
        "camera_id": rows["camera_id"],
        "bucket_quarter": bucket,
        "n_people": rows["n_people"],
    }
    return summed(keys, {"cluster_ms": np.where(rows["is_owned"], rows["weight_ms"], 0)})


def gathering_clusters(held: Held, site: SiteTables) -> Columns:
    """Return `staging/gathering_clusters`, in order of `cluster_no`; `_row` is the first row of `clustered` of each."""
    every, people = held["clusters"], held["clustered"]
    big = np.flatnonzero(every["n_people"] >= site.params["gathering_people"])
    gatherings = take(every, big)
    interval = site.days.interval_ms(gatherings["camera_id"], gatherings["ts_ms"])
    number = np.full(len(held["frame_clusters"]["_first"]), -1, dtype=np.int64)
    number[gatherings["_row"]] = np.arange(len(big))
    of_person = number[held["frame_clusters"]["_first"]]
    rows = np.flatnonzero(of_person >= 0)
    rows = rows[order_by(of_person[rows])]
    return {
        "cluster_no": np.arange(1, len(big) + 1),
        "hour": gatherings["ts_ms"] // 3_600_000,
        **{
            c: gatherings[c]
            for c in ("camera_id", "ts_ms", "cluster", "n_people", "n_located", "sum_x_mm", "sum_y_mm", "weight_ms")
        },
        "interval_ms": interval,
        "gap_ms": gap_ms(interval, site.params["gathering_link_ms"], site),
        "square_mm2": _square_mm2(
            take(people, rows), of_person[rows], gatherings["n_people"], crowd_people=int(site.params["crowd_people"])
        ),
        "_row": gatherings["_row"],
    }


def _square_mm2(people: Columns, cluster: Ints, n_people: Ints, *, crowd_people: int) -> Ints:
    """Return the square of the greatest distance in each cluster, NULL with fewer than two known places.

    Of clusters of more than `crowd_people` it is that of the greatest width in sixteen directions.

    Args:
        people: Columns of `clustered` of people in order of clusters.
        cluster: The cluster of each.
        n_people: Number of people by cluster.
        crowd_people: Of larger clusters the width is taken.
    """
    placed = people["x_mm"] != NULL
    cluster, x, y = cluster[placed], people["x_mm"][placed], people["y_mm"][placed]
    square_mm2 = np.full(len(n_people), NULL, dtype=np.int64)
    few = np.flatnonzero(n_people[cluster] <= crowd_people)
    few_cluster, few_x, few_y = cluster[few], x[few], y[few]
    for a, b in beside(few_cluster, np.zeros_like(few_cluster), 0):
        square = (few_x[a] - few_x[b]) ** 2 + (few_y[a] - few_y[b]) ** 2
        starts = starts_of(few_cluster[a])
        at = few_cluster[a[starts]]
        square_mm2[at] = np.maximum(square_mm2[at], greatest(square, starts))
    many = np.flatnonzero(n_people[cluster] > crowd_people)
    starts = starts_of(cluster[many])
    at = cluster[many[starts]]
    width_um = np.zeros(len(starts), dtype=np.int64)
    for ux, uy in _DIRECTIONS:
        along = ux * x[many] + uy * y[many]
        width_um = np.maximum(width_um, greatest(along, starts) + greatest(-along, starts))
    n = np.diff(starts, append=len(many))
    square_mm2[at] = np.where(n > 1, np.floor(np.power(width_um / 1000, 2)).astype(np.int64), NULL)
    return square_mm2
