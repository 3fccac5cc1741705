"""MOTChallenge text: a line `frame,id,left,top,width,height,conf,x,y,z` per person and frame, 1-based, without a clock.

A source is a `gt.txt` or `det.txt`, a sequence folder (`gt/gt.txt`, `det/det.txt`, `seqinfo.ini`), or a folder or zip
of several sequences. Of a sequence with both files the ground truth is read. Ground truth of nine columns (MOT16 and
later: flag, class, visibility) also lists objects other than pedestrians; they are left out and counted. So are those
of VisDrone, which writes score, category, truncation and occlusion behind the box.
"""

from __future__ import annotations

import math
import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.formats.mot_sequences import SEQUENCE_FILES, Sequence, bare_name, sequences
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source, bytes_read
from vsd_analytics.ingest.reading.archive import archive_kind, members
from vsd_analytics.ingest.reading.instants import frame_ms
from vsd_analytics.ingest.reading.raw import BadRowError, bounded_lines, raw_table, rejected
from vsd_analytics.settings import Settings

PEDESTRIAN = 1
VISDRONE_PEOPLE = (1, 2)
"""Categories of VisDrone: pedestrian, and people who do not walk."""
_FLAGS = (b"0", b"1", b"2")
_LOOKED_AT_LINES = 1000

_NUMBER = rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FIRST_LINE = re.compile(rb"\d+(?:\.0*)?(?:\s*,\s*" + _NUMBER + rb"){5,9}\s*(?:\r?\n|$)")
_FPS = (1 / 3600, 1000.0)


@dataclass(slots=True)
class _MotRows:
    """Rows that were read and not yielded yet."""

    frame: list[int] = field(default_factory=list)
    person: list[int] = field(default_factory=list)
    track: list[str | None] = field(default_factory=list)
    across: list[float] = field(default_factory=list)
    along: list[float] = field(default_factory=list)
    line: list[int] = field(default_factory=list)
    rejected: list[Rejected] = field(default_factory=list)
    dropped: Counter[str] = field(default_factory=Counter)

    def batch(
        self, camera: str | None, clock: Callable[[int], int | None], *, is_floor: bool, done_bytes: int
    ) -> RawBatch:
        names = ("x_m", "y_m") if is_floor else ("u_px", "v_px")
        position = dict(zip(names, (self.across, self.along), strict=True))
        table = raw_table(
            "observations",
            camera=camera,
            ts_ms=[clock(f) for f in self.frame],
            person=self.person,
            track=self.track,
            quality="metric",
            line=self.line,
            **position,
        )
        return RawBatch({"observations": table}, self.rejected, dict(self.dropped), done_bytes=done_bytes)


class MotChallenge:
    """Adapter of MOTChallenge text files."""

    name = "motchallenge"
    coordinates = (
        "image pixels, foot point = bottom centre of the box; with --coordinates floor columns 8 and 9 in floor metres"
    )

    def detects(self, source: Source) -> bool:
        """Return whether this is a gt.txt or det.txt of numbers, or a folder or zip that has them in gt/ and det/."""
        path = source.path
        if path.is_dir():
            patterns = (f"{up}{kind}/{kind}.txt" for up in ("", "*/", "*/*/") for kind in ("gt", "det"))
            return any(any(path.glob(pattern)) for pattern in patterns)
        if bare_name(path) in ("gt.txt", "det.txt"):
            return _FIRST_LINE.match(source.head(4096).lstrip(b"\xef\xbb\xbf\r\n \t")) is not None
        if archive_kind(source) != "zip":
            return False
        try:
            with members(source, wanted=SEQUENCE_FILES) as files:
                return any(m.name.endswith(".txt") for m in files)
        except InputError:
            return False

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the sequences of a source, one after the other, as one camera each.

        Frame n was taken at `start + (n - first_frame) / fps`. Frame 1 is the first unless `options.first_frame` says
        otherwise, such as 0 for trackers that count from 0. Every frame from 1 (or 0) to the sequence's length, or its
        highest frame, is a heartbeat.

        Raises:
            InputError: E207 when the frame rate or the start is unknown, E208 when floor metres are asked for and the
                file has none, E205 and E206 as `vsd_analytics.ingest.reading.archive` says.
            UsageError: E101 when `options.camera` names none of several sequences.
        """
        lowest = 0 if options.first_frame is not None and options.first_frame < 1 else 1
        is_floor, size = options.coordinates == "floor", source.size_bytes
        with sequences(source, options) as sequences_here:
            usable = []
            notes = []
            for sequence in sequences_here:
                if not is_floor or _has_floor(sequence, source.settings):
                    usable.append(sequence)
                elif len(sequences_here) == 1:
                    raise _no_floor(source, sequence)
                else:
                    notes.append(f"W208: {sequence.title} has no floor metres in columns 8 and 9 and was left out")
            if not usable:
                raise _no_floor(source, sequences_here[0])
            clocks, damage = [_clock(source, s, options) for s in usable], None
            for number, (sequence, clock) in enumerate(zip(usable, clocks, strict=True), 1):
                prefix = f"{sequence.title}: " if len(sequences_here) > 1 else ""
                done = (size * (number - 1) // len(usable), size * number // len(usable))
                try:
                    yield from _read(
                        sequence, clock, source.settings, is_floor=is_floor, lowest=lowest, prefix=prefix, done=done
                    )
                except InputError as error:  # read the sequences after a damaged one all the same
                    damage = damage or error
            if notes:
                yield RawBatch(notes=notes, done_bytes=size)
            if damage is not None:
                raise damage


def _read(
    sequence: Sequence,
    clock: Callable[[int], int | None],
    settings: Settings,
    *,
    is_floor: bool,
    lowest: int,
    prefix: str,
    done: tuple[int, int],
) -> Iterator[RawBatch]:
    rows, n_persons, damage = _MotRows(), array("i"), None
    take = partial(_take, is_visdrone=not is_floor and _is_visdrone(sequence, settings))
    with sequence.open() as stream:
        try:
            for number, line in bounded_lines(stream, max_bytes=int(settings.line_max_bytes)):
                try:
                    frames = (lowest, int(settings.sequence_frames_max))
                    take(line, sequence=sequence, is_floor=is_floor, frames=frames, rows=rows, n_persons=n_persons)
                except BadRowError as bad:
                    reason, detail = bad.args
                    rows.rejected.append(rejected(number, reason=reason, detail=prefix + detail, record=line or b""))
                if len(rows.frame) > len(rows.line):
                    rows.line.append(number)
                if len(rows.line) + 10 * len(rows.rejected) >= BATCH_ROWS:
                    so_far = min(done[1], done[0] + bytes_read(stream))
                    yield rows.batch(sequence.camera, clock, is_floor=is_floor, done_bytes=so_far)
                    rows = _MotRows()
        except InputError as error:
            damage = error
    yield rows.batch(sequence.camera, clock, is_floor=is_floor, done_bytes=done[0])
    last = max(len(n_persons) - 1, sequence.n_frames + lowest - 1)
    for first in range(lowest, last + 1, BATCH_ROWS):
        seen = {f: n_persons[f] if f < len(n_persons) else 0 for f in range(first, min(first + BATCH_ROWS, last + 1))}
        if damage is not None:  # the frames after the damage are unknown, not empty
            seen = {f: n for f, n in seen.items() if n}
        ts = [clock(f) for f in seen]
        table = raw_table("frames", camera=sequence.camera, ts_ms=ts, n_persons=list(seen.values()), line=0)
        yield RawBatch({"frames": table}, done_bytes=done[1])
    if damage is not None:
        raise damage


def _take(
    line: bytes | None,
    *,
    sequence: Sequence,
    is_floor: bool,
    is_visdrone: bool,
    frames: tuple[int, int],
    rows: _MotRows,
    n_persons: array[int],
) -> None:
    """Add one line to the rows; a person that cannot be used still counts as seen in its frame."""
    if line is None:
        raise BadRowError("line-too-long", "the line is longer than any record of this format")
    if not line.strip():
        return
    cells = line.split(b",")
    frame = _number(cells[0])
    if not frame.is_integer() or not frames[0] <= frame <= frames[1]:
        wanted = f"frames are whole numbers from {frames[0]} to {frames[1]:,} (sequence_frames_max)"
        raise BadRowError("bad-frame", f"{wanted}; this one is {frame:g}")
    index = int(frame)
    n_persons.frombytes(bytes(n_persons.itemsize * max(0, index + 1 - len(n_persons))))
    n_persons[index] += 1
    if len(cells) < 6:
        raise BadRowError("too-few-columns", f"needs frame,id,left,top,width,height; found {len(cells)} columns")
    identity, left, top, width, height, *more = map(_number, cells[1:])
    if len(cells) == 9 and not sequence.is_detections and (more[0] == 0 or more[1] != PEDESTRIAN):
        n_persons[index] -= 1
        rows.dropped["ignored box (flag 0)" if more[0] == 0 else "not a pedestrian"] += 1
        return
    if is_visdrone and len(more) == 4 and more[1] not in VISDRONE_PEOPLE:
        n_persons[index] -= 1
        rows.dropped["not a pedestrian"] += 1
        return
    across, along = left + width / 2, top + height
    if is_floor:
        if not _is_floor(more):
            raise BadRowError("no-floor-position", "columns 8 and 9 hold no floor metres in this line")
        across, along = more[1], more[2]
    elif width <= 0 or height <= 0:
        raise BadRowError("bad-box", f"a box must have width and height; this one is {width:g} by {height:g} px")
    rows.frame.append(index)
    rows.person.append(n_persons[index] - 1)
    rows.track.append(None if identity == -1 else f"{identity:.0f}")
    rows.across.append(across)
    rows.along.append(along)


def _number(cell: bytes) -> float:
    try:
        value = math.nan if b"_" in cell else float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadRowError("not-a-number", f"{cell[:40].decode('utf-8', 'replace')!r} is not a finite number")
    return value


def _is_floor(more: list[float]) -> bool:
    """Return whether conf,x,y,z hold a floor position: given, and not -1, which means "not given"."""
    return len(more) >= 4 and not (more[1] == more[2] == -1)


def _is_visdrone(sequence: Sequence, settings: Settings) -> bool:
    """Return whether the last three of ten columns are a category, a truncation and an occlusion, and no place."""
    categories = set()
    with sequence.open() as stream:
        for number, line in bounded_lines(stream, max_bytes=int(settings.line_max_bytes)):
            cells = [cell.strip() for cell in (line or b"").split(b",")]
            if len(cells) == 10:
                if not (cells[7].isdigit() and int(cells[7]) < 12 and cells[8] in _FLAGS[:2] and cells[9] in _FLAGS):
                    return False
                categories.add(int(cells[7]))
            if number >= _LOOKED_AT_LINES:
                break
    return not categories.isdisjoint(VISDRONE_PEOPLE)


def _has_floor(sequence: Sequence, settings: Settings) -> bool:
    with sequence.open() as stream:
        for number, line in bounded_lines(stream, max_bytes=int(settings.line_max_bytes)):
            if line and line.strip():
                try:
                    return _is_floor([_number(cell) for cell in line.split(b",")[6:]])
                except BadRowError:
                    continue
            if number > _LOOKED_AT_LINES:
                break
    return True


def _clock(source: Source, sequence: Sequence, options: IngestOptions) -> Callable[[int], int | None]:
    """Return the function from frame number to UTC milliseconds."""
    fps, start = options.fps or sequence.fps, options.start
    if fps is None or not _FPS[0] <= fps <= _FPS[1] or start is None:
        lacking = "when its first frame was taken" if start is None else "how many frames a second it has"
        raise InputError(
            f"{sequence.title} does not say {lacking}",
            code="E207",
            where=Where(source.name),
            why="MOTChallenge files have frame numbers and no times; only seqinfo.ini may give the frame rate",
            fix="give both, for example --hz 25 --start 2026-01-05T09:00:00+01:00",
        )
    first = 1.0 if options.first_frame is None else options.first_frame
    return partial(frame_ms, first=first, fps=fps, start_ms=start)


def _no_floor(source: Source, sequence: Sequence) -> InputError:
    return InputError(
        f"{sequence.title} has no floor metres",
        code="E208",
        where=Where(source.name),
        why="--coordinates floor reads columns 8 and 9 as x and y in metres; they are absent or -1",
        fix="use --coordinates image, and calibrate the camera with vsd calibrate",
    )


ADAPTER = MotChallenge()
