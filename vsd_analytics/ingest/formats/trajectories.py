"""Trajectories of PeTrack and JuPedSim: text with `#` lines above, then a line `id frame x y z` per position.

The header says the frame rate (`# framerate: 25.00`) and perhaps the unit of the columns (`x/m`, `x[in cm]`); without a
unit they are metres. The files have frame numbers and no clock: `--start` says when frame 0 was taken.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Iterator
from functools import partial

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source, bytes_read
from vsd_analytics.ingest.reading.frame_rows import finite
from vsd_analytics.ingest.reading.instants import frame_ms
from vsd_analytics.ingest.reading.raw import BadRowError, bounded_lines, raw_table, rejected

_FPS = re.compile(rb"^#.*?frame\s*rate\D{0,20}?(\d+(?:\.\d+)?)", re.IGNORECASE | re.MULTILINE)
_UNIT = re.compile(
    rb"^#.*?\bx\s*(?:/|\[\s*(?:in\s*)?|\(\s*(?:in\s*)?|\s+in\s+)\s*(mm|cm|dm|m)\b", re.IGNORECASE | re.MULTILINE
)
_NUMBER = re.compile(rb"[+-]?[\d.eE+-]+")
_LOOKED_AT = 20
_BOUNDS = (1 / 3600, 1000.0)
_HEADER_BYTES = 65_536


class Trajectories:
    """Adapter of PeTrack and JuPedSim trajectories."""

    name = "trajectories"
    coordinates = "floor metres, or the unit that the header says"

    def detects(self, source: Source) -> bool:
        """Return whether the file begins with `#` lines that say a frame rate, and then mostly numbers."""
        head = source.head(_HEADER_BYTES)
        if not head.startswith((b"#", b"\xef\xbb\xbf#")) or _FPS.search(head) is None:
            return False
        rows = [line.split() for line in head.split(b"\n") if line.strip() and not line.startswith(b"#")][:_LOOKED_AT]
        n_fitting = sum(4 <= len(cells) <= 9 and all(map(_NUMBER.fullmatch, cells[:4])) for cells in rows)
        return n_fitting > len(rows) / 2

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the positions, then a frame for every number from the first to the last.

        Raises:
            InputError: E207, the frame rate or the start is not known.
        """
        head = source.head(_HEADER_BYTES)
        clock, factor = _clock(source, options, head), _factor(options, head)
        n_persons, rows = array("i"), _Rows()
        least = None
        with source.open() as stream:
            for number, line in bounded_lines(stream, max_bytes=options.line_max_bytes):
                if line is not None and (not line.strip() or line.lstrip().startswith(b"#")):
                    continue
                try:
                    frame = rows.take(line, number, factor, most=int(source.settings.sequence_frames_max))
                except BadRowError as bad:
                    rows.rejected.append(rejected(number, reason=bad.args[0], detail=bad.args[1], record=line or b""))
                else:
                    n_persons.frombytes(bytes(n_persons.itemsize * max(0, frame + 1 - len(n_persons))))
                    n_persons[frame] += 1
                    least = frame if least is None else min(least, frame)
                if len(rows.frame) + 10 * len(rows.rejected) >= BATCH_ROWS:
                    yield rows.batch(options, clock, bytes_read(stream))
                    rows = _Rows()
        yield rows.batch(options, clock, source.size_bytes)
        for first in range(least or 0, len(n_persons), BATCH_ROWS):
            numbers = range(first, min(first + BATCH_ROWS, len(n_persons)))
            table = raw_table(
                "frames",
                camera=options.camera,
                ts_ms=[clock(f) for f in numbers],
                n_persons=[n_persons[f] for f in numbers],
                line=0,
            )
            yield RawBatch({"frames": table}, done_bytes=source.size_bytes)


class _Rows:
    """Rows that were read and not yielded yet."""

    def __init__(self) -> None:
        self.frame: list[int] = []
        self.track: list[str] = []
        self.x_m: list[float] = []
        self.y_m: list[float] = []
        self.line: list[int] = []
        self.rejected: list[Rejected] = []

    def take(self, line: bytes | None, number: int, factor: float, *, most: int) -> int:
        """Add one line and return its frame."""
        if line is None:
            raise BadRowError("line-too-long", "the line is longer than any record of this format")
        cells = line.decode("utf-8", "replace").split()
        if len(cells) < 4:
            raise BadRowError("too-few-columns", f"a line is id frame x y z; found {len(cells)} columns")
        track, frame, x, y = (finite(cell) for cell in cells[:4])
        if not frame.is_integer() or not 0 <= frame <= most:
            raise BadRowError("bad-frame", f"frames are whole numbers from 0 to {most:,}; this one is {frame:g}")
        self.frame.append(int(frame))
        self.track.append(f"{track:.0f}")
        self.x_m.append(x * factor)
        self.y_m.append(y * factor)
        self.line.append(number)
        return int(frame)

    def batch(self, options: IngestOptions, clock: Callable[[int], int | None], done_bytes: int) -> RawBatch:
        """Return the rows."""
        table = raw_table(
            "observations",
            camera=options.camera,
            ts_ms=[clock(f) for f in self.frame],
            person=0,
            track=self.track,
            x_m=self.x_m,
            y_m=self.y_m,
            quality="metric",
            line=self.line,
        )
        engines = [options.engine] if options.engine else []
        return RawBatch({"observations": table}, self.rejected, done_bytes=done_bytes, engines=engines)


def _clock(source: Source, options: IngestOptions, head: bytes) -> Callable[[int], int | None]:
    """Return the function from frame number to UTC milliseconds."""
    stated = _FPS.search(head)
    fps = options.fps or (None if stated is None else float(stated[1]))
    if fps is None or not _BOUNDS[0] <= fps <= _BOUNDS[1] or options.start is None:
        lacking = "when its first frame was taken" if options.start is None else "how many frames a second it has"
        raise InputError(
            f"{source.file_name} does not say {lacking}",
            code="E207",
            where=Where(source.name),
            why="trajectories have frame numbers and no times; their header may give the frame rate",
            fix="give it, for example --start 2026-01-05T09:00:00+01:00, and --hz 25 if the header has none",
        )
    first = 0.0 if options.first_frame is None else options.first_frame
    return partial(frame_ms, first=first, fps=fps, start_ms=options.start)


def _factor(options: IngestOptions, head: bytes) -> float:
    """Return the metres of one unit of the positions."""
    stated = _UNIT.search(head)
    unit = options.unit or ("m" if stated is None else stated[1].decode().lower())
    return METRES[unit]
