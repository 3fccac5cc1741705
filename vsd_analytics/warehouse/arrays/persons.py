"""`in_violation`, and the facts that add up people near others, such as `distance_times` and `company_times`."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.warehouse.arrays.columns import (
    NULL,
    Columns,
    Ints,
    counted,
    grouped_by,
    order_by,
    picked,
    run_of,
    starts_of,
    summed,
    sums,
    take,
)
from vsd_analytics.warehouse.arrays.held import Held
from vsd_analytics.warehouse.arrays.site_tables import BucketRuns, SiteTables, bucket_of, numbered

_LAST = 2**62
_QUARTER_MS = 900_000


def in_violation(held: Held, site: SiteTables) -> Columns:
    """Return `staging/in_violation`, in order of camera, instant and member; `_person` numbers the persons of pairs."""
    pairs = held["pairs"]
    close = np.flatnonzero(pairs["distance_mm"] < site.params["distance_mm"])
    person, own, other = (
        np.concatenate([picked(pairs[c], close) for c in sides])
        for sides in (("_a", "_b"), ("track_a", "track_b"), ("track_b", "track_a"))
    )
    n_others = np.bincount(person)
    n, rows = len(n_others), np.flatnonzero(n_others)
    last = np.full(n, -1, dtype=np.int64)
    np.maximum.at(last, person, other.astype(np.int64))
    return {
        **_people(held, close, rows, site),
        "track_id": _least_id(own, person, n)[rows],
        "n_others": n_others[rows],
        "n_named": np.bincount(person[other >= 0], minlength=n)[rows],
        "first_other_id": _least_id(other, person, n)[rows],
        "last_other_id": last[rows],
        "_person": rows,
    }


def _people(held: Held, rows: Ints, numbers: Ints, site: SiteTables) -> Columns:
    """Return camera, instant, member, place and weight of persons of some pairs, and whether their camera counts them.

    Args:
        held: The relations.
        rows: The rows of `pairs`.
        numbers: The persons in these, by number, in order.
        site: The tables of the site.
    """
    pairs = held["pairs"]
    columns = ("camera_id", "ts_ms", "member", "x_mm", "y_mm", "weight_ms", "is_owned")
    if pairs["is_derived"].all():  # then their numbers are those of their records
        return take(held["located"], numbers, *columns)
    n = int(numbers[-1]) + 1 if len(numbers) else 0
    person = np.concatenate([pairs["_a"][rows], pairs["_b"][rows]])
    of = np.zeros(n, dtype=np.int64)
    of[person] = np.arange(len(person))
    found = {}
    for name in ("camera_id", "ts_ms", "weight_ms", "member"):
        a, b = ("member_a", "member_b") if name == "member" else (name, name)
        found[name] = np.concatenate([pairs[a][rows], pairs[b][rows]])[of[numbers]]
    for c in ("x", "y"):
        values = np.concatenate([pairs[f"{c}_a_mm"][rows], pairs[f"{c}_b_mm"][rows]])
        least = _least(np.where(values == NULL, _LAST, values), person, n)[numbers]
        found[f"{c}_mm"] = np.where(least == _LAST, NULL, least)
    has_owned = np.zeros(n, dtype=np.bool_)
    has_owned[person[np.tile(pairs["is_owned"][rows], 2)]] = True
    x, y = found["x_mm"], found["y_mm"]
    is_owned = site.floors.is_owned(found["camera_id"], found["ts_ms"], x, y)
    return {**found, "is_owned": np.where(x == NULL, has_owned[numbers], is_owned)}


def _least(values: Ints, person: Ints, n: int) -> Ints:
    """Return the least value of each person, `_LAST` without any."""
    found = np.full(n, _LAST, dtype=np.int64)
    np.minimum.at(found, person, values)
    return found


def _least_id(ids: Ints, person: Ints, n: int) -> Ints:
    """Return the least known id of each person, -1 without any."""
    found = _least(np.where(ids < 0, _LAST, ids.astype(np.int64)), person, n)
    return np.where(found == _LAST, -1, found)


def distance_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/distance_times`, counted in a table that has a place for every distance of a camera and bucket."""
    pairs = held["pairs"]
    every = np.arange(len(pairs["_a"]))
    person = np.concatenate([pairs["_a"], pairs["_b"]])
    n = int(person.max()) + 1 if len(person) else 0
    nearest = _least(np.tile(pairs["distance_mm"], 2), person, n)
    numbers = np.flatnonzero(nearest < _LAST)
    persons = _people(held, every, numbers, site)
    runs = [BucketRuns.of(of["camera_id"], of["ts_ms"], site) for of in (pairs, persons)]
    groups, cameras, buckets = numbered(runs)
    distances = pairs["distance_mm"], nearest[numbers]
    width = max((int(of.max()) + 1 for of in distances if len(of)), default=1)
    of_pair, of_person = (
        of.each(group) * width + distance for of, group, distance in zip(runs, groups, distances, strict=True)
    )
    owned = np.flatnonzero(pairs["is_owned"])
    sent = owned[~pairs["is_derived"][owned]]
    weights = np.where(persons["is_owned"], persons["weight_ms"], 0)
    keys, (_, n_pairs, n_sent, _, nearest_ms) = counted(
        len(cameras) * width,
        (of_pair, None),
        (of_pair[owned], None),
        (of_pair[sent], None),
        (of_person, None),
        (of_person, weights),
    )
    group = keys // width
    return {
        "hour": buckets[group] // 4,
        "camera_id": cameras[group],
        "bucket_quarter": buckets[group],
        "distance_mm": keys - group * width,
        "n_pairs": n_pairs,
        "n_sent": n_sent,
        "nearest_ms": nearest_ms,
    }


def neighbour_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/neighbour_times`."""
    persons = held["in_violation"]
    rows = take(persons, persons["is_owned"])
    return _in_buckets({**rows, "violation_ms": rows["weight_ms"]}, site, ("n_others",), ("violation_ms",))


def _in_buckets(rows: Columns, site: SiteTables, keys: tuple[str, ...], values: tuple[str, ...]) -> Columns:
    bucket = bucket_of(rows["ts_ms"], site)
    hour = bucket // 4
    # the quarter within the hour, because small numbers are sorted at once
    by = {
        "hour": hour,
        "camera_id": rows["camera_id"],
        "bucket_quarter": bucket - 4 * hour,
        **{k: rows[k] for k in keys},
    }
    found = summed(by, {v: rows[v] for v in values})
    return {**found, "bucket_quarter": found["bucket_quarter"] + 4 * found["hour"]}


def violation_time(held: Held, site: SiteTables) -> Columns:
    """Return `facts/violation_time`."""
    pairs, persons = held["pairs"], held["in_violation"]
    close = np.flatnonzero(pairs["distance_mm"] < site.params["distance_mm"])
    n, n_persons = len(close), len(persons["ts_ms"])
    camera = np.concatenate([pairs["camera_id"][close], persons["camera_id"]])
    quarter = np.concatenate([pairs["ts_ms"][close], persons["ts_ms"]]) // _QUARTER_MS
    violation_ms = np.where(persons["is_owned"], persons["weight_ms"], 0)
    return summed(
        {"hour": quarter // 4, "camera_id": camera, "quarter": quarter},
        {
            "violation_records": np.concatenate([pairs["is_owned"][close], np.zeros(n_persons, dtype=np.bool_)]),
            "violation_ms": np.concatenate([np.zeros(n, dtype=np.int64), violation_ms]),
        },
    )


def company_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/company_times`."""
    pairs, persons = held["pairs"], held["in_violation"]
    named = ("camera_id", "ts_ms", "track_id", "weight_ms", "n_others", "n_named", "_person")
    persons = take(persons, persons["is_owned"], *named)
    is_known = persons["n_named"] == persons["n_others"]
    n = int(persons["_person"].max()) + 1 if len(persons["_person"]) else 0
    row_of = np.full(n, -1, dtype=np.int64)
    row_of[persons["_person"][is_known]] = np.flatnonzero(is_known)
    close = np.flatnonzero(pairs["distance_mm"] < site.params["distance_mm"])
    person, other = (
        np.concatenate([picked(pairs[c], close) for c in sides]) for sides in (("_a", "_b"), ("track_b", "track_a"))
    )
    wanted = np.flatnonzero(person < n)
    row = picked(row_of, picked(person, wanted))
    is_known = row >= 0
    row, other = row[is_known], picked(other, wanted[is_known])
    order = order_by(row, other)
    row, other = picked(row, order), picked(other, order)
    company = _companies(row, other, len(persons["ts_ms"]))
    track = np.where(persons["track_id"] < 0, site.n_tracks, persons["track_id"])
    bucket = bucket_of(persons["ts_ms"], site)
    keys = (bucket, persons["camera_id"], track, company)
    order, starts = grouped_by(*keys)
    first = order[starts]
    return _in_text_order(
        {
            "hour": bucket[first] // 4,
            "camera_id": persons["camera_id"][first],
            "bucket_quarter": bucket[first],
            "track_id": persons["track_id"][first],
            "company": _texts(held, first, row, other),
            "violation_ms": sums(persons["weight_ms"][order], starts),
        },
        site,
    )


def _companies(row: Ints, other: Ints, n: int) -> Ints:
    """Return a number of the company of each of `n` rows, given their others in order; 0 without any."""
    starts = starts_of(row)
    n_others = np.diff(starts, append=len(row))
    found, used = np.zeros(n, dtype=np.int64), 0
    at = np.arange(len(starts))
    step = 0
    while len(at := at[n_others[at] > step]):  # each further other splits the companies so far
        rows = row[starts[at]]
        before, added = found[rows], other[starts[at] + step]
        order, runs = grouped_by(before, added)
        found[rows[order]] = used + 1 + run_of(runs, len(order))
        used += len(runs)
        step += 1
    return found


def _texts(held: Held, rows: Ints, row: Ints, other: Ints) -> NDArray[np.object_]:
    """Return the names of the others of some rows, joined; None without any."""
    first, after = np.searchsorted(row, rows), np.searchsorted(row, rows, side="right")
    n_others = after - first
    ends = np.cumsum(n_others)
    found = np.arange(n_others.sum()) + np.repeat(first - ends + n_others, n_others)
    names = held.names_of("track_name").take(pa.array(other[found]))
    lists = pa.ListArray.from_arrays(np.concatenate([[0], ends]).astype(np.int32), names)
    texts = pc.if_else(pa.array(n_others > 0), pc.binary_join(lists, chr(1)), None)
    joined: NDArray[np.object_] = texts.to_numpy(zero_copy_only=False)
    return joined


def _in_text_order(rows: Columns, site: SiteTables) -> Columns:
    """Return the rows in order of bucket, camera, track and text, unknown ones last."""
    n = len(rows["hour"])
    texts = pa.array(rows["company"], pa.string())
    rank = np.empty(n, dtype=np.int64)
    rank[pc.sort_indices(texts).to_numpy()] = np.arange(n)  # by bytes, as DuckDB
    track = np.where(rows["track_id"] < 0, site.n_tracks, rows["track_id"])
    return take(rows, order_by(rows["hour"], rows["camera_id"], rows["bucket_quarter"], track, rank))
