"""Frames with people, one by one, as raw tables: for adapters of engines that send a message or element a frame."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pyarrow as pa

from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Rejected
from vsd_analytics.ingest.reading.cell_values import NO_ID
from vsd_analytics.ingest.reading.instants import ambiguous_note, local_to_utc
from vsd_analytics.ingest.reading.raw import BadRowError, floored, raw_table, rejected, too_many_people
from vsd_analytics.ingest.reading.reasons import TOO_MANY
from vsd_analytics.schema import TableName

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MS = timedelta(milliseconds=1)
_UTC = re.compile(r"\s+(?:UTC|GMT)$")
KINDS_MAX = 10_000
"""Objects whose class is remembered."""


@dataclass(frozen=True, slots=True)
class SeenPerson:
    """One person in a frame.

    Attributes:
        track: Track id; None = the engine has none.
        floor_m: x and y in floor metres.
        picture_px: Foot point in the picture, right and down.
        is_staff: The engine's class or tag is one of `staff_classes` (`IngestOptions.is_staff`).
    """

    track: str | None = None
    floor_m: tuple[float, float] | None = None
    picture_px: tuple[float, float] | None = None
    is_staff: bool | None = None


class FrameRows:
    """Turns frame after frame into raw tables.

    Args:
        options: What the user says: clocks, `persons_max`, the camera of frames that name none.
        engine: Engine name and version.
    """

    def __init__(self, options: IngestOptions, *, engine: str) -> None:
        self._options = options
        self._engine = options.engine or engine
        self._kinds: dict[str, str] = {}
        self._view: str | None = None
        self._clear()

    def _clear(self) -> None:
        # camera, ms, zone, persons, line, whether it is a frame or only a person with a time
        self._frames: list[tuple[str | None, int, str | None, int, int, bool]] = []
        self._seen: list[SeenPerson] = []
        self._numbers: list[int] = []  # of each person within the frame
        self._of_frame: list[int] = []
        self._wrong: dict[str, list[str]] = {}
        self._rejected: list[Rejected] = []
        self.dropped: Counter[str] = Counter()
        self.n_rows = 0

    def reject(self, line: int, reason: str, detail: str, record: str | bytes) -> None:
        """Put one record into quarantine."""
        self.n_rows += 1 + len(record) // 256  # bad records stay in memory whole
        self._rejected.append(rejected(line, reason=reason, detail=detail, record=record))

    def person(self, read: Callable[[], SeenPerson]) -> SeenPerson | None:
        """Return one person of the next frame; None where that person cannot be used, which `attempt` names."""
        try:
            return read()
        except BadRowError as bad:
            reason, detail = bad.args
            self._wrong.setdefault(reason, []).append(detail)
            return None

    def attempt(self, add: Callable[[], None]) -> list[tuple[str, str]]:
        """Call what adds one frame; return reason and detail of what cannot be used: persons of it, or all of it."""
        try:
            add()
        except BadRowError as bad:
            self._wrong_persons()  # the whole frame is named once
            reason, detail = bad.args
            return [(reason, detail)]
        return self._wrong_persons()

    def _wrong_persons(self) -> list[tuple[str, str]]:
        """Return reason and detail of the persons that could not be used since the last call, once for each reason."""
        details = [
            (r, d[0] if len(d) == 1 else f"{d[0]}; {len(d)} persons of the frame") for r, d in self._wrong.items()
        ]
        self._wrong = {}
        return details

    def add(
        self,
        camera: str | None,
        at: datetime,
        seen: Sequence[SeenPerson | None],
        *,
        line: int,
        is_frame: bool = True,
    ) -> None:
        """Add one frame, also one without people; or single persons, where nobody says who else was there.

        Persons are numbered as the engine lists them, also past one who cannot be used (None): when the frame comes
        again with that person, the others are recognised.

        Raises:
            BadRowError: It has more people than `persons_max`, or people and none who can be used; nothing of it is
                added, because it would count as a frame without people.
        """
        usable = [(number, person) for number, person in enumerate(seen) if person is not None]
        if seen and not usable and (wrong := self._wrong_persons()):
            raise BadRowError(*wrong[0])
        if len(seen) > self._options.persons_max:
            raise BadRowError(TOO_MANY, too_many_people(len(seen), self._options))
        camera = self._options.camera if camera is None else camera
        zone = None
        if at.tzinfo is None:
            zone = self._options.clocks.get(camera or "", self._options.frame_zone)
            at = at.replace(tzinfo=UTC)
        ts_ms = (at - _EPOCH) // _MS
        self._frames.append((camera, ts_ms, zone, len(seen), line, is_frame))
        self._of_frame += [len(self._frames) - 1] * len(usable)
        self._numbers += [number for number, _ in usable]
        self._seen += [person for _, person in usable]
        self.n_rows += 1 + len(seen)

    def kind_of(self, track: str | None, kind: str) -> str:
        """Return the class of an object: that of this frame, else ("") the one that its track had before; "" = none."""
        if track is None or (not kind and track not in self._kinds):
            return kind
        if kind and track not in self._kinds and len(self._kinds) >= KINDS_MAX:
            del self._kinds[next(iter(self._kinds))]  # the oldest
        if kind:
            self._kinds[track] = kind
        return self._kinds[track]

    def check_view(self, name: str | None) -> None:
        """Take only the view (channel, lens) of the first frame where all frames of a file go to one camera.

        Raises:
            BadRowError: The frame is of another view.
        """
        if name is None or self._options.camera is None:
            return
        self._view = self._view or name
        if name != self._view:
            detail = f"the frame is of {name[:80]}, the first one of {self._view[:80]}, and all go to one camera"
            raise BadRowError("other-view", f"{detail}; write a file for each")

    def batch(self, done_bytes: int, *, first_line: str | None = None) -> RawBatch:
        """Return the records added since the last call."""
        columns = map(list, zip(*self._frames, strict=True)) if self._frames else ([],) * 6
        cameras, times, zones, counts, lines, are_frames = columns
        ts_ms = floored(np.array(times, dtype=np.int64), self._options)
        notes = []
        for zone in sorted({z for z in zones if z is not None}):
            at = np.array([z == zone for z in zones])
            ts_ms[at], is_ambiguous = local_to_utc(ts_ms[at], zone)
            notes += [ambiguous_note(zone)] if is_ambiguous.any() else []
        n_persons = np.array(counts, dtype=np.int64)
        shared: dict[str, Any] = {
            "camera": pa.array(cameras, pa.string()),
            "ts_ms": pa.array(ts_ms),
            "zone": pa.array(zones, pa.string()),
            "line": pa.array(lines, pa.int64()),
        }
        tables: dict[TableName, pa.Table] = {}
        if any(are_frames):
            frames = raw_table("frames", **shared, n_persons=n_persons)
            tables["frames"] = frames if all(are_frames) else frames.filter(pa.array(are_frames))
        if self._seen:
            of_row = pa.array(self._of_frame, pa.int64())
            tables["observations"] = raw_table(
                "observations",
                **{name: values.take(of_row) for name, values in shared.items()},
                person=np.array(self._numbers, dtype=np.int64),
                track=[s.track for s in self._seen],
                x_m=[None if s.floor_m is None else s.floor_m[0] for s in self._seen],
                y_m=[None if s.floor_m is None else s.floor_m[1] for s in self._seen],
                u_px=[None if s.picture_px is None else s.picture_px[0] for s in self._seen],
                v_px=[None if s.picture_px is None else s.picture_px[1] for s in self._seen],
                quality="metric",
                is_staff=[s.is_staff for s in self._seen],
            )
        engines = [self._engine]
        batch = RawBatch(tables, self._rejected, +self.dropped, notes, done_bytes, engines, first_line=first_line)
        self._clear()
        return batch


def instant_of(text: object) -> datetime:
    """Return a time that an engine writes in ISO 8601, with or without offset, or with UTC behind it.

    Raises:
        BadRowError: It is none.
    """
    try:
        return datetime.fromisoformat(_UTC.sub("+00:00", text.strip()) if isinstance(text, str) else "")
    except ValueError:
        raise BadRowError("not-a-time", f"{str(text)[:40]!r} is not an ISO 8601 time") from None


def finite(value: object) -> float:
    """Return a number of a message, which some engines write as text.

    Raises:
        BadRowError: It is none, or not finite.
    """
    try:
        number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise BadRowError("not-a-number", f"{str(value)[:40]!r} is not a finite number")
    return number


def id_of(value: object) -> str | None:
    """Return a track id as text; None for a missing one.

    Raises:
        BadRowError: It is neither a text nor a number.
    """
    if value is None or (isinstance(value, str | int) and str(value).strip().lower() in NO_ID):
        return None
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise BadRowError("bad-message", f"an id is {str(value)[:40]!r}")
    return f"{value:.0f}" if isinstance(value, float) and value.is_integer() else str(value)


def size_of(
    options: IngestOptions, camera: str | None, *, message_px: tuple[int, int] | None = None
) -> tuple[int, int]:
    """Return width and height of a camera's picture in pixels.

    The user's `--size` comes first, then the size in vsd.toml, for which the calibration was made, then the message's.

    Args:
        options: What the user says, completed from vsd.toml.
        camera: The camera as the engine calls it; None = the user's.
        message_px: What the message itself says.

    Raises:
        BadRowError: Nobody says it.
    """
    name = options.camera if camera is None else camera
    size_px = options.size_px or options.pictures.get(name or "") or message_px
    if size_px is None:
        raise BadRowError("no-size", "positions are shares of the picture, and nobody says how large it is")
    return size_px
