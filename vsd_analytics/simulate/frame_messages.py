"""VSD frame messages (version 1): the output of a made-up engine for one camera and day.

Arrow's string kernels join the text of a day, because a day of four cameras has about 90,000 messages.
"""

from __future__ import annotations

import gzip
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.simulate.cameras import NOISE_SD_M, PinholeCamera
from vsd_analytics.simulate.people import SimulatedDay
from vsd_analytics.simulate.positions import IntArray
from vsd_analytics.simulate.shop import FloatArray

ENGINE = "vsd-demo 1.0"
_CM_LOW, _CM_HIGH = -500, 4000


class DayText(NamedTuple):
    """One camera's messages of one day.

    Attributes:
        text: JSON Lines.
        n_messages: Lines.
        n_persons: Persons in all of them.
    """

    text: bytes
    n_messages: int
    n_persons: int


def day_text(
    day: SimulatedDay, camera: PinholeCamera, *, seed: int, first_seq: int = 0, lost: NDArray[np.bool_] | None = None
) -> DayText:
    r"""Return one camera's messages of one day, one JSON object a line.

    Everybody whose feet are in the picture is reported, with independent Gaussian noise of 5 cm on each coordinate.
    A track id lasts while a person stays in view; ids start at 1 every day.

    Args:
        day: True positions.
        camera: The camera.
        seed: Seed of the world; the noise also depends on camera and date.
        first_seq: `seq` of frame 0; lost frames use up their number.
        lost: Frames that never arrive (bool, one per frame); None = all arrive.

    Returns:
        UTF-8 lines ending in "\n", with their counts.
    """
    number = int(camera.camera_id.rpartition("-")[2])
    noise = np.random.default_rng([seed, day.day.toordinal(), number])
    rows = np.flatnonzero(camera.sees(day.x_m, day.y_m))
    x = day.x_m[rows] + noise.normal(0, NOISE_SD_M, len(rows))
    y = day.y_m[rows] + noise.normal(0, NOISE_SD_M, len(rows))
    frame = day.frame[rows]
    track = track_ids(day.person[rows], frame)
    if lost is None:
        lost = np.zeros(day.n_frames, dtype=np.bool_)
    order = np.argsort(frame, kind="stable")
    order = order[~lost[frame[order]]]
    arrived = np.flatnonzero(~lost)
    counts = np.bincount(frame[order], minlength=day.n_frames)[arrived]
    return messages_text(
        camera.camera_id,
        day.frame_ms[arrived],
        seq=first_seq + arrived,
        counts=counts,
        track=track[order],
        x_m=x[order],
        y_m=y[order],
    )


def messages_text(
    camera_id: str,
    frame_ms: IntArray,
    *,
    seq: IntArray,
    counts: IntArray,
    track: IntArray,
    x_m: FloatArray,
    y_m: FloatArray,
) -> DayText:
    r"""Return frame messages, one JSON object a line.

    Args:
        camera_id: The camera.
        frame_ms: UTC milliseconds of each frame.
        seq: Number of each frame.
        counts: Persons in each frame.
        track: Track id of each person, in the order of the frames.
        x_m: Their floor x, metres; written in whole centimetres.
        y_m: Their floor y.

    Returns:
        UTF-8 lines ending in "\n", with their counts.
    """
    at = np.datetime_as_string(frame_ms.astype("datetime64[ms]"), unit="ms")
    lines = pc.binary_join_element_wise(
        f'{{"v":1,"camera":"{camera_id}","ts":"',
        pa.array(at, pa.string()),
        'Z","seq":',
        pc.cast(pa.array(seq), pa.string()),
        f',"engine":"{ENGINE}","quality":"metric","persons":[',
        _persons(track, x_m, y_m, counts),
        "]}\n",
        "",
    )
    return DayText(_content(lines), n_messages=len(frame_ms), n_persons=len(track))


def track_ids(person: IntArray, frame: IntArray) -> IntArray:
    """Return track ids of rows ordered by person, then frame: a new one whenever a person comes into view.

    Args:
        person: Person of each row.
        frame: Frame of each row; successive frames of one person belong to one track.

    Returns:
        Ids from 1, numbered in the order in which tracks begin.
    """
    if not len(person):
        return np.zeros(0, dtype=np.int64)
    begins = np.ones(len(person), dtype=np.bool_)
    begins[1:] = (np.diff(person) != 0) | (np.diff(frame) != 1)
    run = np.cumsum(begins) - 1
    ids = np.empty(run[-1] + 1, dtype=np.int64)
    ids[np.argsort(frame[begins], kind="stable")] = np.arange(1, run[-1] + 2)
    tracks: IntArray = ids[run]
    return tracks


def _persons(track: IntArray, x: FloatArray, y: FloatArray, counts: IntArray) -> pa.Array:
    """Return the text between the brackets of `persons` for each frame."""
    numbers = _centimetres()
    people = pc.binary_join_element_wise(
        '{"id":"',
        pc.cast(pa.array(track), pa.string()),
        '","x_m":',
        numbers.take(pa.array(_index(x))),
        ',"y_m":',
        numbers.take(pa.array(_index(y))),
        "}",
        "",
    )
    offsets = np.concatenate(([0], np.cumsum(counts))).astype(np.int32)
    return pc.binary_join(pa.ListArray.from_arrays(pa.array(offsets), people), ",")


def _index(metres: FloatArray) -> IntArray:
    return np.clip(np.round(metres * 100).astype(np.int64), _CM_LOW, _CM_HIGH) - _CM_LOW


def _centimetres() -> pa.Array:
    """Return the texts of all numbers of centimetres that occur, as metres: "-0.07", "12.00"."""
    return pa.array([f"{cm / 100:.2f}" for cm in range(_CM_LOW, _CM_HIGH + 1)], pa.string())


def _content(texts: pa.Array) -> bytes:
    """Return the concatenation of an array's strings: its data buffer."""
    _, offsets, data = texts.buffers()
    if data is None or not len(texts):
        return b""
    ends = np.frombuffer(offsets, dtype=np.int32)
    return bytes(memoryview(data)[ends[texts.offset] : ends[texts.offset + len(texts)]])


def write_messages(path: Path, messages: Iterable[Mapping[str, Any]] | bytes) -> Path:
    """Write messages as JSON Lines; `.zst` and `.gz` files are compressed, the same bytes for the same messages.

    Args:
        path: File to write; its folder is made when it is missing.
        messages: Messages, or their finished text.

    Returns:
        The path.
    """
    if isinstance(messages, bytes):
        text = messages
    else:
        import msgspec

        encode = msgspec.json.Encoder().encode
        text = b"".join(encode(m) + b"\n" for m in messages)
    if path.suffix == ".zst":
        text = pa.Codec("zstd", compression_level=1).compress(text, asbytes=True)
    elif path.suffix == ".gz":
        text = gzip.compress(text, compresslevel=1, mtime=0)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text)
    return path
