"""`in_violation` and the facts that add up people near others: `distance_times`, `neighbour_times`, `violation_time`, `company_times`."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.warehouse.arrays.columns import NULL, Columns, Ints, order_by, run_of, starts_of, summed, sums, take
from vsd_analytics.warehouse.arrays.held import Held
from vsd_analytics.warehouse.arrays.site_tables import SiteTables, bucket_of

_LAST = 2**62
_QUARTER_MS = 900_000


def in_violation(held: Held, site: SiteTables) -> Columns:
    """Return `staging/in_violation`, in order of camera, instant and member; `_person` numbers the persons of pairs."""
    pairs = held["pairs"]
    close = np.flatnonzero(pairs["distance_mm"] < site.params["distance_mm"])
    person = np.concatenate([pairs["_a"][close], pairs["_b"][close]])
    own, other = (np.concatenate([pairs[f"track_{s}"][close] for s in sides]) for sides in ("ab", "ba"))
    n = int(person.max()) + 1 if len(person) else 0
    n_others = np.bincount(person, minlength=n)
    rows = np.flatnonzero(n_others)
    found = _persons(pairs, close, n)
    return {
        **take(found, rows),
        "track_id": _least_id(own, person, n)[rows],
        "n_others": n_others[rows],
        "n_named": np.bincount(person[other >= 0], minlength=n)[rows],
        "first_other_id": _least_id(other, person, n)[rows],
        "last_other_id": -1 - _least(-1 - other, person, n)[rows],
        "is_owned": _is_owned(pairs, close, take(found, rows), rows, site),
        "_person": rows,
    }


def _persons(pairs: Columns, rows: Ints, n: int) -> Columns:
    """Return camera, instant, member, place and weight of each of `n` persons of some pairs; without pairs, anything."""
    person = np.concatenate([pairs["_a"][rows], pairs["_b"][rows]])
    found = {}
    for name, (a, b) in {
        **{c: (c, c) for c in ("camera_id", "ts_ms", "weight_ms")},
        **{"member": ("member_a", "member_b")},
    }.items():
        found[name] = np.zeros(n, dtype=pairs[a].dtype)
        found[name][person] = np.concatenate([pairs[a][rows], pairs[b][rows]])
    for name in ("x_mm", "y_mm"):
        c = name[0]
        values = np.concatenate([pairs[f"{c}_a_mm"][rows], pairs[f"{c}_b_mm"][rows]])
        least = _least(np.where(values == NULL, _LAST, values), person, n)
        found[name] = np.where(least == _LAST, NULL, least)
    return found


def _least(values: Ints, person: Ints, n: int) -> Ints:
    """Return the least value of each person, `_LAST` without any."""
    found = np.full(n, _LAST, dtype=np.int64)
    np.minimum.at(found, person, values)
    return found


def _least_id(ids: Ints, person: Ints, n: int) -> Ints:
    """Return the least known id of each person, -1 without any."""
    found = _least(np.where(ids < 0, _LAST, ids), person, n)
    return np.where(found == _LAST, -1, found)


def _is_owned(pairs: Columns, rows: Ints, persons: Columns, numbers: Ints, site: SiteTables) -> NDArray[np.bool_]:
    """Return whether the camera counts a person: by the own place, without one where it counts any pair of the person."""
    n = int(numbers.max()) + 1 if len(numbers) else 0
    owned = rows[pairs["is_owned"][rows]]
    has_owned = np.zeros(n, dtype=np.bool_)
    has_owned[pairs["_a"][owned]] = True
    has_owned[pairs["_b"][owned]] = True
    x, y = persons["x_mm"], persons["y_mm"]
    return np.where(x == NULL, has_owned[numbers], site.floors.is_owned(persons["camera_id"], persons["ts_ms"], x, y))


def distance_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/distance_times`."""
    pairs = held["pairs"]
    every = np.arange(len(pairs["_a"]))
    person = np.concatenate([pairs["_a"], pairs["_b"]])
    n = int(person.max()) + 1 if len(person) else 0
    nearest = _least(np.tile(pairs["distance_mm"], 2), person, n)
    numbers = np.flatnonzero(nearest < _LAST)
    persons = take(_persons(pairs, every, n), numbers)
    is_owned = _is_owned(pairs, every, persons, numbers, site)
    none, no_person = np.zeros(len(every), dtype=np.int64), np.zeros(len(numbers), dtype=np.int64)
    both = {
        "camera_id": (pairs["camera_id"], persons["camera_id"]),
        "ts_ms": (pairs["ts_ms"], persons["ts_ms"]),
        "distance_mm": (pairs["distance_mm"], nearest[numbers]),
        "n_pairs": (pairs["is_owned"], no_person),
        "n_sent": (pairs["is_owned"] & ~pairs["is_derived"], no_person),
        "nearest_ms": (none, np.where(is_owned, persons["weight_ms"], 0)),
    }
    rows = {name: np.concatenate(sides) for name, sides in both.items()}
    return _in_buckets(rows, site, ("distance_mm",), ("n_pairs", "n_sent", "nearest_ms"))


def neighbour_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/neighbour_times`."""
    persons = held["in_violation"]
    rows = take(persons, persons["is_owned"])
    return _in_buckets({**rows, "violation_ms": rows["weight_ms"]}, site, ("n_others",), ("violation_ms",))


def _in_buckets(rows: Columns, site: SiteTables, keys: tuple[str, ...], values: tuple[str, ...]) -> Columns:
    bucket = bucket_of(rows["ts_ms"], site)
    by = {"hour": bucket // 4, "camera_id": rows["camera_id"], "bucket_quarter": bucket, **{k: rows[k] for k in keys}}
    return summed(by, {v: rows[v] for v in values})


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
    persons = take(persons, persons["is_owned"])
    is_known = persons["n_named"] == persons["n_others"]
    n = int(persons["_person"].max()) + 1 if len(persons["_person"]) else 0
    row_of = np.full(n, -1, dtype=np.int64)
    row_of[persons["_person"][is_known]] = np.flatnonzero(is_known)
    close = np.flatnonzero(pairs["distance_mm"] < site.params["distance_mm"])
    person = np.concatenate([pairs["_a"][close], pairs["_b"][close]])
    other = np.concatenate([pairs["track_b"][close], pairs["track_a"][close]])
    is_wanted = person < n
    is_wanted[is_wanted] = row_of[person[is_wanted]] >= 0
    row, other = row_of[person[is_wanted]], other[is_wanted]
    order = order_by(row, other)
    row, other = row[order], other[order]
    company = _companies(row, other, len(is_known), site)
    track = np.where(persons["track_id"] < 0, site.n_tracks, persons["track_id"])
    bucket = bucket_of(persons["ts_ms"], site)
    keys = (bucket, persons["camera_id"], track, company)
    order = order_by(*keys)
    starts = starts_of(*(key[order] for key in keys))
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


def _companies(row: Ints, other: Ints, n: int, site: SiteTables) -> Ints:
    """Return a number of the company of each of `n` rows, given their others in order; equal companies, equal numbers."""
    starts = starts_of(row)
    n_others = np.diff(starts, append=len(row))
    found, used = np.zeros(n, dtype=np.int64), 0
    at = np.arange(len(starts))
    step = 0
    while len(at := at[n_others[at] > step]):  # each further other splits the companies so far
        rows = row[starts[at]]
        before, added = found[rows], other[starts[at] + step]
        order = order_by(before, added)
        runs = starts_of(before[order], added[order])
        found[rows[order]] = used + 1 + run_of(runs, len(order))
        used += len(runs)
        step += 1
    return found


def _texts(held: Held, rows: Ints, row: Ints, other: Ints) -> NDArray[np.object_]:
    """Return the names of the others of some rows, joined; None without any."""
    first, after = np.searchsorted(row, rows), np.searchsorted(row, rows, side="right")
    names = np.asarray(held.names_of("track_name").to_pylist(), dtype=object)
    joined = (chr(1).join(names[other[i:j]].tolist()) if j > i else None for i, j in zip(first, after, strict=True))
    return np.fromiter(joined, dtype=object, count=len(rows))


def _in_text_order(rows: Columns, site: SiteTables) -> Columns:
    """Return the rows in order of bucket, camera, track and text, unknown ones last."""
    n = len(rows["hour"])
    texts = pa.array(rows["company"], pa.string())
    rank = np.empty(n, dtype=np.int64)
    rank[pc.sort_indices(texts).to_numpy()] = np.arange(n)  # by bytes, as DuckDB
    track = np.where(rows["track_id"] < 0, site.n_tracks, rows["track_id"])
    return take(rows, order_by(rows["hour"], rows["camera_id"], rows["bucket_quarter"], track, rank))
