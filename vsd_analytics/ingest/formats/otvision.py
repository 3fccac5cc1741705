"""OTVision tracks (`.ottrk`): one JSON object, packed with bzip2, of `metadata` and a list `data.detections`.

A detection has `class`, `track-id`, `frame`, `occurrence`, and `x y w h` of its box: pixels, or shares of the picture
where the metadata say so (`normalized_bbox`). Files of version 1.0 have the centre of the box as x and y, later ones
the upper left corner. Times come from the name of the video, which has no offset: `occurrence` is that clock, in
seconds since 1970 or, up to version 1.1, as text. Of the classes, persons alone are read. Every frame of the video is a
heartbeat.
"""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any, Final

import numpy as np
import pyarrow as pa

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Source, damaged_after
from vsd_analytics.ingest.reading.column_hints import PERSON, letters
from vsd_analytics.ingest.reading.frame_rows import FrameRows, SeenPerson, finite, id_of, size_of
from vsd_analytics.ingest.reading.instants import local_to_utc
from vsd_analytics.ingest.reading.json_values import json_values
from vsd_analytics.ingest.reading.raw import BadRowError, floored, raw_table
from vsd_analytics.ingest.reading.reasons import NOT_A_PERSON

_BEGIN: Final = re.compile(rb',?\s*"data"\s*:\s*\{\s*"detections"\s*:\s*(?=\[)')
_METADATA_BYTES: Final = 1 << 20
_CENTRED: Final = (1, 0)
"""Latest version whose x and y are the centre of a box."""
_SILENT_MAX_S: Final = 3600.0
"""Longest time behind the last detection that a video of unknown length is believed to show nobody."""
_EPOCH: Final = datetime(1970, 1, 1)


class OTVision:
    """Adapter of OTVision's tracks."""

    name = "otvision"
    coordinates = "image pixels, foot point = bottom centre of the box"
    uses = frozenset({"zone", "period_s", "size_px"})

    def detects(self, source: Source) -> bool:
        """Return whether the file begins with OTVision's metadata, and a list of detections follows."""
        head = source.head(_METADATA_BYTES) if source.path.is_file() else b""
        return head.lstrip().startswith(b"{") and b'"otdet_version"' in head and _BEGIN.search(head) is not None

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the detections, then the frames.

        Raises:
            InputError: E202 the metadata or the detections are missing, E205 the file is damaged.
        """
        metadata, n_before = _metadata(source)
        video = _Video(metadata, frames_max=int(source.settings.sequence_frames_max))
        rows = FrameRows(options, engine="OTVision")

        def damaged(number: int, text: str, error: Exception) -> InputError:
            return damaged_after(source, number, why=f"it is not JSON: {str(error)[:200]}", what="detection", text=text)

        done = 0
        try:
            for number, value, text, done in json_values(
                source, value_max_bytes=options.line_max_bytes, damaged=damaged, array_at=n_before
            ):
                for reason, detail in rows.attempt(partial(_take, rows, video, value, number, options)):
                    rows.reject(number, reason, detail, text)
                if rows.n_rows >= BATCH_ROWS:
                    yield rows.batch(done)
        except InputError:
            yield rows.batch(done)  # what came before the damage
            raise
        yield rows.batch(source.size_bytes)
        yield from video.frames(source, options)


class _Video:
    """What the metadata say of the video, and how many people each of its frames shows."""

    def __init__(self, metadata: Mapping[str, Any], *, frames_max: int) -> None:
        video, detection = (_inner(metadata, key) for key in ("video", "detection"))
        self.is_centred = _version(metadata.get("otdet_version")) <= _CENTRED
        self.is_share = detection.get("normalized_bbox") is True
        self.size_px = (_whole(video.get("width")), _whole(video.get("height")))
        self._n_frames = _whole(video.get("number_of_frames"))
        self._length_s = _whole(video.get("expected_duration"))
        self._interval_ms = 1000 / max(1e-3, _rate(video))
        self._start_ms: int | None = None
        with contextlib.suppress(BadRowError):  # without people, it is then not known when the video was
            self._start_ms = _clock_ms(video.get("recorded_start_date"))
        self._frames_max = frames_max
        self._seen: dict[int, tuple[int, int]] = {}

    def count(self, frame: float, at_ms: int, *, n: int) -> None:
        """Note a frame, and add to its people.

        Raises:
            BadRowError: It is no number of a frame.
        """
        if not frame.is_integer() or not 0 <= frame <= self._frames_max:
            detail = (
                f"frames are whole numbers from 0 to {self._frames_max:,} (sequence_frames_max); this one is {frame:g}"
            )
            raise BadRowError("bad-frame", detail)
        self._seen[int(frame)] = at_ms, self._seen.get(int(frame), (0, 0))[1] + n

    def frames(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Yield the frames from the first to the last one of the video, also those without people."""
        last, notes = self._last_frame()
        clock = self._clock()
        # where numbers and times do not fit each other, only the frames with detections are known
        frames = sorted(self._seen) if clock is None else list(range(min([1, *self._seen]), last + 1))
        zone = options.clocks.get(options.camera or "", options.frame_zone)
        if notes:
            yield RawBatch(notes=notes, done_bytes=source.size_bytes)
        for first in range(0, len(frames), BATCH_ROWS):
            some = frames[first : first + BATCH_ROWS]
            local = [
                self._seen[f][0] if f in self._seen or clock is None else round(clock[0] + clock[1] * f) for f in some
            ]
            table = raw_table(
                "frames",
                camera=options.camera,
                ts_ms=floored(local_to_utc(np.array(local, dtype=np.int64), zone)[0], options),
                zone=pa.array([zone] * len(some), pa.string()),
                n_persons=[self._seen.get(f, (0, 0))[1] for f in some],
                line=0,
            )
            yield RawBatch({"frames": table}, done_bytes=source.size_bytes)

    def _last_frame(self) -> tuple[int, list[str]]:
        """Return the last frame that the video can have, with a warning where it says that it has more.

        A number alone would make hours recorded, with nobody there: it must fit the length of the video, or the last
        detection.
        """
        seen = max(self._seen, default=0)
        stated = min(self._n_frames, self._frames_max)
        in_length = 1.1 * self._length_s * 1000 / self._interval_ms + 2
        within = in_length if self._length_s else seen + _SILENT_MAX_S * 1000 / self._interval_ms
        if stated <= max(seen, within):
            return max(stated, seen), []
        why = f"it lasts {self._length_s:,} s" if self._length_s else "nothing is detected in the last hours of them"
        note = (
            f"W228: the video is said to have {self._n_frames:,} frames, and {why}; frames behind the last detection "
            "are not read, and count as not recorded; to have them, correct number_of_frames and expected_duration"
        )
        return seen, [note]

    def _clock(self) -> tuple[float, float] | None:
        """Return when frame 0 was and the interval, in milliseconds; None where the frames seen are not even."""
        if not self._seen:
            return None if self._start_ms is None else (self._start_ms - self._interval_ms, self._interval_ms)
        numbers = np.array(sorted(self._seen), dtype=float)
        times = np.array([self._seen[int(n)][0] for n in numbers], dtype=float)
        interval = (times[-1] - times[0]) / (numbers[-1] - numbers[0]) if len(numbers) > 1 else self._interval_ms
        start = times[0] - interval * numbers[0]
        is_even = interval > 0 and np.abs(start + interval * numbers - times).max() <= max(2.0, interval / 2)
        return (float(start), float(interval)) if is_even else None


def _take(rows: FrameRows, video: _Video, value: Any, number: int, options: IngestOptions) -> None:
    """Add one detection.

    Raises:
        BadRowError: It cannot be used.
    """
    if not isinstance(value, dict):
        raise BadRowError("bad-message", f"a detection is {str(value)[:40]!r}")
    at_ms = _clock_ms(value.get("occurrence"))
    is_person = letters(str(value.get("class"))) in PERSON
    video.count(finite(value.get("frame")), at_ms, n=int(is_person))
    if not is_person:
        rows.dropped[NOT_A_PERSON] += 1
        return
    rows.add(
        None,
        _EPOCH + timedelta(milliseconds=at_ms),
        [rows.person(partial(_person, video, value, options))],
        line=number,
        is_frame=False,
    )


def _person(video: _Video, value: Mapping[str, Any], options: IngestOptions) -> SeenPerson:
    x, y, width, height = (finite(value.get(key)) for key in ("x", "y", "w", "h"))
    if width <= 0 or height <= 0:
        raise BadRowError("bad-box", f"a box must have width and height; this one is {width:g} by {height:g}")
    u, v = (x, y + height / 2) if video.is_centred else (x + width / 2, y + height)
    if video.is_share:
        across, down = size_of(options, None, message_px=video.size_px if all(video.size_px) else None)
        u, v = u * across, v * down
    return SeenPerson(id_of(value.get("track-id")), picture_px=(u, v))


def _clock_ms(value: object) -> int:
    """Return the milliseconds since 1970 of a time on the clock that named the video.

    Raises:
        BadRowError: It is no time.
    """
    try:
        at = datetime.fromisoformat(value) if isinstance(value, str) and ":" in value else None
        if at is None:
            at = datetime.fromtimestamp(finite(value), UTC)
    except (ValueError, OverflowError, OSError):
        raise BadRowError("not-a-time", f"{str(value)[:40]!r} is no time") from None
    return round((at.replace(tzinfo=None) - _EPOCH) / timedelta(milliseconds=1))


def _metadata(source: Source) -> tuple[dict[str, Any], int]:
    """Return the metadata, and how many bytes lie before the list of detections."""
    head = source.head(_METADATA_BYTES)
    begin = _BEGIN.search(head)
    try:
        whole = json.loads(head[: begin.start()] + b"}") if begin is not None else None
    except (ValueError, RecursionError):
        whole = None
    if begin is None or not isinstance(whole, dict):
        raise InputError(
            f"{source.file_name} has no metadata and detections of OTVision",
            code="E202",
            where=Where(source.name),
            why="its first object holds metadata, and behind them data.detections",
            fix="let OTVision write it again (track.py); other JSON is read by --persons and --map, without --format",
        )
    return _inner(whole, "metadata"), begin.end()


def _inner(thing: Mapping[str, Any], key: str) -> dict[str, Any]:
    value = thing.get(key)
    return value if isinstance(value, dict) else {}


def _version(text: object) -> tuple[int, ...]:
    """Return a version as numbers; one that is missing counts as the latest."""
    numbers = re.findall(r"\d+", str(text))[:2]
    return tuple(int(n[:9]) for n in numbers) if numbers else (2**31,)


def _whole(value: object) -> int:
    return int(value) if isinstance(value, int | float) and 0 < value < 2**31 else 0


def _rate(video: Mapping[str, Any]) -> float:
    rates = (video.get(key) for key in ("actual_fps", "recorded_fps"))
    return next(
        (float(r) for r in rates if isinstance(r, int | float) and not isinstance(r, bool) and 0 < r < 1e6), 25.0
    )
