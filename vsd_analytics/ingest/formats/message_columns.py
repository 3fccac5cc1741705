"""Persons and pairs of frame messages as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

if TYPE_CHECKING:
    from vsd_analytics.ingest.formats.frames import FrameMessage, Id
    from vsd_analytics.ingest.reading.adapter import IngestOptions

Ints = NDArray[np.int64]
Columns = dict[str, pa.Array]


def person_columns(messages: Sequence[FrameMessage], options: IngestOptions) -> Columns:
    """Return the persons of some messages, one a row: `track x_m y_m u_px v_px is_staff`."""
    persons = [p for m in messages for p in m.persons or ()]
    tags = [options.is_staff(p.tag) for p in persons] if options.staff_classes else None
    return {
        "track": _texts([p.id for p in persons]),
        "x_m": pa.array([p.x_m for p in persons], pa.float64()),
        "y_m": pa.array([p.y_m for p in persons], pa.float64()),
        "u_px": pa.array([p.u_px for p in persons], pa.float64()),
        "v_px": pa.array([p.v_px for p in persons], pa.float64()),
        "is_staff": pa.nulls(len(persons), pa.bool_()) if tags is None else pa.array(tags, pa.bool_()),
    }


def pair_columns(messages: Sequence[FrameMessage]) -> Columns:
    """Return the pairs of some messages, one a row, with the numbers of their persons and the places that these have.

    A person has the number of its place among the persons of the message. Those that it does not list have numbers
    behind them, in the order of the pairs.
    """
    messages = [m for m in messages if m.pairs]
    pairs = [p for m in messages for p in m.pairs or ()]
    persons = [p for m in messages for p in m.persons or ()]
    n_pairs = np.array([len(m.pairs or ()) for m in messages], dtype=np.int64)
    n_persons = np.array([len(m.persons or ()) for m in messages], dtype=np.int64)
    of_pair = np.repeat(np.arange(len(messages)), n_pairs)
    first_of_pair, n_of_pair = (np.cumsum(n_persons) - n_persons)[of_pair], n_persons[of_pair]
    tracks = {"a": _texts([p.a for p in pairs]), "b": _texts([p.b for p in pairs])}
    numbers = _numbers(_texts([p.id for p in persons]), tracks, n_persons, n_pairs)
    x_m, y_m = pa.array([p.x_m for p in persons], pa.float64()), pa.array([p.y_m for p in persons], pa.float64())
    columns: Columns = {}
    for side, number in numbers.items():
        place = pa.array(first_of_pair + number, mask=number >= n_of_pair)
        columns |= {f"person_{side}": pa.array(number), f"track_{side}": tracks[side]}
        columns |= {f"x_{side}_m": x_m.take(place), f"y_{side}_m": y_m.take(place)}
    columns["distance_m"] = pa.array([p.distance_m for p in pairs], pa.float64())
    columns["distance_sd_m"] = pa.array([p.sd_m for p in pairs], pa.float64())
    return columns


def _numbers(listed: pa.Array, tracks: Mapping[str, pa.Array], n_persons: Ints, n_pairs: Ints) -> dict[str, Ints]:
    """Return the numbers of the persons of each pair in its message, by side.

    Args:
        listed: Ids of the persons that messages list, null without one.
        tracks: Ids of the first and the second person of each pair.
        n_persons: How many persons each message lists.
        n_pairs: How many pairs each message has.
    """
    coded = pa.concat_arrays([listed, *tracks.values()]).dictionary_encode()
    codes, n_codes = np.asarray(coded.indices.fill_null(-1), dtype=np.int64), len(coded.dictionary)
    of_person, of_pair = (np.repeat(np.arange(len(n)), n) for n in (n_persons, n_pairs))
    place = np.arange(len(of_person)) - np.repeat(np.cumsum(n_persons) - n_persons, n_persons)
    has_id = codes[: len(listed)] >= 0
    ids = (of_person * n_codes + codes[: len(listed)])[has_id]
    ends = of_pair * n_codes + codes[len(listed) :].reshape(2, -1)
    # Arrow numbers values in the order in which they come: the ids that a message lists, then those of its pairs
    people = pa.array(np.concatenate([ids, ends.T.ravel()])).dictionary_encode()
    person, keys = np.asarray(people.indices), np.asarray(people.dictionary)
    n_listed = int(person[: len(ids)].max(initial=-1)) + 1
    of_other = keys[n_listed:] // max(n_codes, 1)
    number = np.empty(len(keys), dtype=np.int64)
    number[person[: len(ids)][::-1]] = place[has_id][::-1]  # of several with one id the first
    n_others = np.bincount(of_other, minlength=len(n_persons))
    number[n_listed:] = np.arange(len(of_other)) + (n_persons - np.cumsum(n_others) + n_others)[of_other]
    return dict(zip(tracks, number[person[len(ids) :]].reshape(-1, 2).T, strict=True))


def _texts(ids: Sequence[Id | None]) -> pa.Array:
    """Return ids as texts; numbers among them are rare."""
    try:
        return pa.array(ids, pa.string())
    except pa.ArrowTypeError:
        return pa.array([None if i is None else str(i) for i in ids], pa.string())
