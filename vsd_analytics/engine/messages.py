"""What the engine found, as VSD frame messages: one JSON object per frame, also for frames without people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import People
from vsd_analytics.engine.seen import Seen

_DIGITS_M, _DIGITS_PX = 3, 2
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def instants_ms(people: People, *, start: datetime, hz: float) -> NDArray[np.int64]:
    """Return the UTC milliseconds of all frames: the file's own, else frame 0 at `start` and `hz` frames a second."""
    if people.ts_ms is not None:
        return people.ts_ms
    first_ms = (start - _EPOCH) // timedelta(milliseconds=1)
    return np.asarray(first_ms + np.round(people.frames * (1000 / hz)), dtype=np.int64)


def frame_messages(
    seen: Seen, *, camera: str, ts_ms: NDArray[np.int64], seq: Mapping[int, int] | None = None
) -> Iterator[bytes]:
    """Yield one message per frame, as a line without its end.

    `seq` is the frame number where the file has one, or as given: a reader takes a gap in it for lost messages. Persons
    have the detector's track ids. Where pairs are sent and there is no track id, the id is `frame-index`: it names the
    person within its frame and never joins two frames. Methods without metres send pairs in every frame; with metres,
    pairs are sent where all persons of the file have ids, and derived by the reader otherwise. With several planes,
    pairs are always sent and pixels never: a reader would map them by the camera's one homography, and would take
    places one above the other as near. Persons without a place are a number, `unplaced`: a store has nothing to put
    them at.

    Args:
        seen: What was found.
        camera: Camera id.
        ts_ms: UTC milliseconds of each of `seen.people.frames`.
        seq: Running number of each frame; None = its frame number, unless frames have times of their own.
    """
    people = seen.people
    has_ids = all(track is not None for track in people.track)
    sends_pairs = seen.xy is None or seen.has_planes or has_ids
    of_person = np.searchsorted(people.frame, people.frames)
    of_pair = np.searchsorted(people.frame[seen.a], people.frames)
    person_end = np.r_[of_person[1:], len(people)]
    pair_end = np.r_[of_pair[1:], len(seen.a)]
    ids = [
        track if track is not None else f"{frame}-{row}" if sends_pairs else None
        for row, (frame, track) in enumerate(zip(people.frame.tolist(), people.track, strict=True))
    ]
    has_place = np.asarray(np.isfinite(seen.uv).all(axis=1), dtype=np.bool_) & (not seen.has_planes)
    if seen.xy is not None:
        has_place |= np.isfinite(seen.xy).all(axis=1)
    in_pairs = {*seen.a.tolist(), *seen.b.tolist()}
    is_numbered = people.ts_ms is None and (not len(people.frames) or people.frames[0] >= 0)
    for i, number in enumerate(people.frames.tolist()):
        message: dict[str, Any] = {"v": 1, "camera": camera, "ts": _iso(int(ts_ms[i]))}
        if seq is not None or is_numbered:
            message["seq"] = number if seq is None else seq[number]
        message |= {"engine": seen.engine, "quality": seen.quality}
        rows = range(of_person[i], person_end[i])
        persons = [(row, _person(seen, row, ids[row])) for row in rows if has_place[row] or row in in_pairs]
        message["persons"] = [person for _, person in persons]
        if len(persons) < len(rows):
            message["unplaced"] = len(rows) - len(persons)
        if sends_pairs:
            message["pairs"] = [_pair(seen, row, ids) for row in range(of_pair[i], pair_end[i])]
        yield msgspec.json.encode(message)


def _person(seen: Seen, row: int, name: str | None) -> dict[str, Any]:
    person: dict[str, Any] = {} if name is None else {"id": name}
    if seen.xy is not None and np.isfinite(seen.xy[row]).all():
        person |= {"x_m": round(float(seen.xy[row, 0]), _DIGITS_M), "y_m": round(float(seen.xy[row, 1]), _DIGITS_M)}
    if np.isfinite(seen.uv[row]).all() and not seen.has_planes:
        person |= {"u_px": round(float(seen.uv[row, 0]), _DIGITS_PX), "v_px": round(float(seen.uv[row, 1]), _DIGITS_PX)}
    return person


def _pair(seen: Seen, row: int, ids: list[str | None]) -> dict[str, Any]:
    pair: dict[str, Any] = {"a": ids[seen.a[row]], "b": ids[seen.b[row]]}
    pair["distance_m"] = round(float(seen.distance_m[row]), _DIGITS_M)
    if seen.sd_m is not None and np.isfinite(seen.sd_m[row]):
        pair["sd_m"] = round(float(seen.sd_m[row]), _DIGITS_M)
    return pair


def _iso(ms: int) -> str:
    return (_EPOCH + timedelta(milliseconds=ms)).isoformat(timespec="milliseconds").replace("+00:00", "Z")
