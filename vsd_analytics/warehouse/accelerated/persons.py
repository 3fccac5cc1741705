"""`in_violation`, and the facts that add up people near others, such as `distance_times` and `company_times`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.warehouse.accelerated.columns import (
    counted,
    grouped_by,
    one_alike,
    order_by,
    picked,
    run_of,
    starts_of,
    summed,
    take,
)
from vsd_analytics.warehouse.accelerated.company import is_standing
from vsd_analytics.warehouse.accelerated.site_tables import BucketRuns, SiteTables, bucket_of, is_close, numbered
from vsd_analytics.warehouse.held import NULL, Bools, Columns, Held, Ints

_LAST = 2**62
_QUARTER_MS = 900_000
_OF_PEOPLE = ("camera_id", "ts_ms", "x_mm", "y_mm", "weight_ms", "is_owned", "_frame")


@dataclass(frozen=True, slots=True)
class _PersonsInPairs:
    """The persons in some pairs, each with a side of one pair; what other pairs say of them is looked at only there.

    Attributes:
        pairs: The relation.
        number: Their numbers, in order.
        n_others: Number of pairs of each.
        row: A row of `pairs` of each.
        is_b: Whether the person is the second one there.
        again: The person, as an index of these columns, of each further side.
        again_row, again_is_b: That side.
    """

    pairs: Columns
    number: Ints
    n_others: Ints
    row: Ints
    is_b: Bools
    again: Ints
    again_row: Ints
    again_is_b: Bools

    @classmethod
    def of(cls, pairs: Columns, rows: Ints) -> _PersonsInPairs:
        """Return the persons in some rows of `pairs`."""
        n = len(rows)
        person = np.concatenate([picked(pairs["_a"], rows), picked(pairs["_b"], rows)])
        n_others = np.bincount(person)
        number = np.flatnonzero(n_others)
        side_of = np.zeros(len(n_others), dtype=np.int64)
        side_of[person] = np.arange(2 * n)
        again = np.zeros(0, dtype=np.int64)
        if len(number) < 2 * n:
            again = np.flatnonzero(picked(side_of, person) != np.arange(2 * n))
        side, again_person = side_of[number], person[again]
        side_of[number] = np.arange(len(number))
        return cls(
            pairs,
            number,
            n_others[number],
            picked(rows, np.where(side >= n, side - n, side)),
            side >= n,
            side_of[again_person],
            picked(rows, np.where(again >= n, again - n, again)),
            again >= n,
        )

    def one(self, a: str, b: str) -> NDArray[Any]:
        """Return a column of the first or second person of a pair, of which all pairs of a person say the same."""
        return _of_side(self.pairs, a, b, self.row, self.is_b)

    def least(self, a: str, b: str, *, unknown: int) -> Ints:
        """Return the least known value of all pairs of each person, `unknown` without any."""
        least = self.one(a, b).astype(np.int64)
        others = _of_side(self.pairs, a, b, self.again_row, self.again_is_b).astype(np.int64)
        for values in (least, others):
            values[values == unknown] = _LAST
        np.minimum.at(least, self.again, others)
        least[least == _LAST] = unknown
        return least

    def greatest(self, a: str, b: str) -> Ints:
        """Return the greatest value of all pairs of each person; unknown ones are less than all others."""
        greatest = self.one(a, b).astype(np.int64)
        others = _of_side(self.pairs, a, b, self.again_row, self.again_is_b)
        np.maximum.at(greatest, self.again, others.astype(np.int64, copy=False))
        return greatest

    def n_unknown(self, a: str, b: str) -> Ints:
        """Return in how many pairs of each person a column has an unknown id."""
        n_unknown = (self.one(a, b) < 0).astype(np.int64)
        is_unknown = _of_side(self.pairs, a, b, self.again_row, self.again_is_b) < 0
        np.add.at(n_unknown, self.again[is_unknown], 1)
        return n_unknown


def _of_side(pairs: Columns, a: str, b: str, row: Ints, is_b: Bools) -> NDArray[Any]:
    return picked(pairs[a], row) if a == b else np.where(is_b, picked(pairs[b], row), picked(pairs[a], row))


def in_violation(held: Held, site: SiteTables) -> Columns:
    """Return `staging/in_violation`, in order of camera, instant and member; `_person` numbers the persons of pairs."""
    pairs = held["pairs"]
    if site.only_counts:  # all pairs are closer, and persons are rows of their records
        is_in_one = np.zeros(len(held["located"]["_frame"]), dtype=np.bool_)
        is_in_one[pairs["_a"]] = is_in_one[pairs["_b"]] = True
        return take(held["located"], np.flatnonzero(is_in_one), "x_mm", "y_mm", "is_owned", "_frame")
    persons = _PersonsInPairs.of(pairs, np.flatnonzero(is_close(pairs, site)))
    n_unknown = persons.n_unknown("track_b", "track_a")
    return {
        **_people(held, persons, site),
        "member": persons.one("member_a", "member_b"),
        "track_id": persons.one("track_a", "track_b"),
        "n_others": persons.n_others,
        "n_named": persons.n_others - n_unknown,
        "first_other_id": persons.least("track_b", "track_a", unknown=-1),
        "last_other_id": persons.greatest("track_b", "track_a"),
        "_person": persons.number,
    }


def _people(held: Held, persons: _PersonsInPairs, site: SiteTables) -> Columns:
    """Return camera, instant, place and weight of persons, and whether their camera counts them."""
    pairs = held["pairs"]
    if pairs["is_derived"].all():  # then their numbers are those of their records
        return take(held["located"], persons.number, *_OF_PEOPLE)
    columns = {name: persons.one(name, name) for name in ("camera_id", "ts_ms", "weight_ms", "_frame")}
    x, y = (persons.least(f"{c}_a_mm", f"{c}_b_mm", unknown=NULL) for c in "xy")
    # people without a place are in pairs without one, which their own camera counts
    is_owned = site.floors.is_owned(columns["camera_id"], columns["ts_ms"], x, y)
    return {**columns, "x_mm": x, "y_mm": y, "is_owned": is_owned}


def distance_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/distance_times`, counted in a table that has a place for every distance of a camera and bucket."""
    pairs = held["pairs"]
    of_pairs = _PersonsInPairs.of(pairs, np.arange(len(pairs["_a"])))
    persons = _people(held, of_pairs, site)
    runs = [BucketRuns.of(records["_frame"], held["instants"], site) for records in (pairs, persons)]
    groups, cameras, buckets = numbered(runs)
    distances = pairs["distance_mm"], of_pairs.least("distance_mm", "distance_mm", unknown=NULL)
    width = max((int(records.max()) + 1 for records in distances if len(records)), default=1)
    of_pair, of_person = (
        records.each(group) * width + distance for records, group, distance in zip(runs, groups, distances, strict=True)
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
    columns = summed(by, {v: rows[v] for v in values})
    return {**columns, "bucket_quarter": columns["bucket_quarter"] + 4 * columns["hour"]}


def violation_time(held: Held, site: SiteTables) -> Columns:
    """Return `facts/violation_time`."""
    pairs, persons, frames = held["pairs"], held["in_violation"], held["instants"]
    close = is_close(pairs, site)
    n_frames = len(frames["ts_ms"])
    frame = np.flatnonzero(np.bincount(pairs["_frame"][close], minlength=n_frames))
    n_pairs = np.bincount(pairs["_frame"][close & pairs["is_owned"]], minlength=n_frames)
    n_persons = np.bincount(persons["_frame"][persons["is_owned"]], minlength=n_frames)
    quarter = frames["ts_ms"][frame] // _QUARTER_MS
    return summed(
        {"hour": quarter // 4, "camera_id": frames["camera_id"][frame], "quarter": quarter},
        {"violation_records": n_pairs[frame], "violation_ms": n_persons[frame] * frames["weight_ms"][frame]},
    )


def company_times(held: Held, site: SiteTables) -> Columns:
    """Return `facts/company_times`."""
    persons = held["in_violation"]
    named = ("camera_id", "ts_ms", "track_id", "weight_ms", "n_others", "n_named", "first_other_id", "_person")
    persons = take(persons, persons["is_owned"], *named)
    n = len(persons["ts_ms"])
    n_others = np.where(persons["n_named"] == persons["n_others"], persons["n_others"], 0)
    others = _others(held["pairs"], persons["_person"], np.flatnonzero(n_others > 1), site)
    company = np.where(n_others == 1, persons["first_other_id"].astype(np.int64) + 1, 0)
    _number_companies(company, *others, first=site.n_tracks + 1)
    track = np.where(persons["track_id"] < 0, site.n_tracks, persons["track_id"])
    bucket = bucket_of(persons["ts_ms"], site)
    stands = _stand_in_company(held, site, persons["_person"]) == persons["n_others"]
    same = one_alike(track, site.n_tracks + 1, bucket, persons["camera_id"], track, company, stands)
    # sums of milliseconds of a day stay far below 2**53: floats hold them exactly
    violation_ms = np.bincount(same, persons["weight_ms"], minlength=n)
    first = np.flatnonzero(same == np.arange(n))
    return _in_text_order(
        {
            "hour": bucket[first] // 4,
            "camera_id": persons["camera_id"][first],
            "bucket_quarter": bucket[first],
            "track_id": persons["track_id"][first],
            "company": _texts(held, n_others[first], persons["first_other_id"][first], first, *others),
            "is_standing": stands[first],
            "violation_ms": violation_ms[first].astype(np.int64),
        },
        site,
    )


def _stand_in_company(held: Held, site: SiteTables, person: Ints) -> Ints:
    """Return how many of those closer than `distance_m` stand in one company with each person."""
    pairs = held["pairs"]
    a, b = pairs["track_a"], pairs["track_b"]
    close = np.flatnonzero(is_close(pairs, site) & (a != b))
    stand = is_standing(held, site, *(picked(pairs[c], close) for c in ("camera_id", "ts_ms", "track_a", "track_b")))
    close = close[stand]
    sides = np.concatenate([picked(pairs["_a"], close), picked(pairs["_b"], close)])
    n_of: Ints = np.bincount(sides, minlength=int(person[-1]) + 1 if len(person) else 0)
    return n_of[person]


def _others(pairs: Columns, person: Ints, wanted: Ints, site: SiteTables) -> tuple[Ints, Ints]:
    """Return row and other of some rows of persons, one for each pair they are in, in order of both.

    Args:
        pairs: The relation.
        person: Number of each person.
        wanted: The rows.
        site: The tables of the site.
    """
    row_of = np.full(int(person[-1]) + 1 if len(person) else 0, -1, dtype=np.int64)
    row_of[person[wanted]] = wanted
    close = np.flatnonzero(is_close(pairs, site))
    rows, others = [row_of[:0]], [row_of[:0]]
    for one, two in (("_a", "track_b"), ("_b", "track_a")) if len(wanted) else ():
        number = picked(pairs[one], close)
        row = np.where(number < len(row_of), picked(row_of, number), -1)  # -1 also after the last person counted here
        is_wanted = np.flatnonzero(row >= 0)
        rows.append(row[is_wanted])
        others.append(pairs[two][close[is_wanted]])
    row, other = np.concatenate(rows), np.concatenate(others)
    order = order_by(row, other)
    return picked(row, order), picked(other, order)


def _number_companies(company: Ints, row: Ints, other: Ints, *, first: int) -> None:
    """Number the companies of several others in place, from `first` on, given rows with their others in order."""
    starts = starts_of(row)
    n_others = np.diff(starts, append=len(row))
    at = np.arange(len(starts))
    step = 0
    while len(at := at[n_others[at] > step]):  # each further other splits the companies so far
        rows = row[starts[at]]
        order, runs = grouped_by(company[rows], other[starts[at] + step])
        company[rows[order]] = first + run_of(runs, len(order))
        first += len(runs)
        step += 1


def _texts(held: Held, n_others: Ints, only: NDArray[Any], rows: Ints, row: Ints, other: Ints) -> NDArray[np.object_]:
    """Return the names of the others of some rows, joined; None without any.

    Args:
        held: The relations.
        n_others: Number of others.
        only: The other of rows with one.
        rows: The rows.
        row: Rows with several others, once for each of them, in order.
        other: These others.
    """
    ends = np.cumsum(n_others)
    others = np.zeros(int(n_others.sum()), dtype=np.int64)
    others[ends[n_others == 1] - 1] = only[n_others == 1]
    several = np.flatnonzero(n_others > 1)
    n = n_others[several]
    step = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
    others[np.repeat(ends[several] - n, n) + step] = other[np.repeat(np.searchsorted(row, rows[several]), n) + step]
    names = held.names_of("track_name").take(pa.array(others))
    lists = pa.ListArray.from_arrays(np.concatenate([[0], ends]).astype(np.int32), names)
    texts = pc.if_else(pa.array(n_others > 0), pc.binary_join(lists, chr(1)), None)
    joined: NDArray[np.object_] = texts.to_numpy(zero_copy_only=False)
    return joined


def _in_text_order(rows: Columns, site: SiteTables) -> Columns:
    """Return the rows in order of bucket, camera, track and text, unknown ones last."""
    n = len(rows["hour"])
    rows = take(rows, order_by(rows["is_standing"].astype(np.int64)))  # equal texts stay in this order
    texts = pa.array(rows["company"], pa.string())
    rank = np.empty(n, dtype=np.int64)
    rank[pc.sort_indices(texts).to_numpy()] = np.arange(n)  # by bytes, as DuckDB
    track = np.where(rows["track_id"] < 0, site.n_tracks, rows["track_id"])
    return take(rows, order_by(rows["hour"], rows["camera_id"], rows["bucket_quarter"], track, rank))
