"""WILDTRACK annotations: one JSON file per annotated video frame, floor positions as numbers of grid cells.

Seven cameras were fused into one set of positions before they were written, so they enter as one virtual camera and
nobody is counted twice. Cell n of the 480 x 1440 grid stands at x = -3 + 0.025 (n mod 480), y = -9 + 0.025 (n div 480)
metres. The image boxes of the single views are not read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source
from vsd_analytics.ingest.archive import archive_kind, members
from vsd_analytics.ingest.instants import frame_ms
from vsd_analytics.ingest.raw import raw_table, rejected

VIDEO_FPS = 10.0
"""Video frames a second: every fifth is annotated, two a second."""
GRID = (480, 1440)
GRID_ORIGIN_M = (-3.0, -9.0)
GRID_STEP_M = 0.025
MAX_FILE_BYTES = 16 * 1024**2

_FILES = re.compile(r"(?:^|annotations_positions/)(\d{1,9})\.json$")
_TAR_ENTRY = re.compile(rb"(?:^|/)annotations_positions/(?:\d{1,9}\.json)?\0")


@dataclass(slots=True)
class _Rows:
    """Records read and not yet handed over."""

    frames: list[tuple[int | None, int, int]] = field(default_factory=list)
    persons: list[tuple[int | None, int, str, float, float, int]] = field(default_factory=list)
    rejected: list[Rejected] = field(default_factory=list)

    def batch(self, camera: str) -> RawBatch:
        ts, counts, lines = _transposed(self.frames, 3)
        frames = raw_table("frames", camera=camera, ts_ms=ts, n_persons=counts, line=lines)
        ts, person, track, x_m, y_m, lines = _transposed(self.persons, 6)
        observations = raw_table(
            "observations",
            camera=camera,
            ts_ms=ts,
            person=person,
            track=track,
            x_m=x_m,
            y_m=y_m,
            quality="metric",
            line=lines,
        )
        return RawBatch({"frames": frames, "observations": observations}, self.rejected)


class Wildtrack:
    """Adapter of WILDTRACK annotation folders and archives."""

    name = "wildtrack"
    coordinates = "floor metres from the grid of 2.5 cm cells; one virtual camera for all views"

    def detects(self, source: Source) -> bool:
        """Tell whether this is a folder of numbered JSON files with positionID, or a tar of annotations_positions/."""
        if source.path.is_dir():
            files = (
                *islice(source.path.glob("annotations_positions/[0-9]*.json"), 1),
                *islice(source.path.glob("[0-9]*.json"), 1),
            )
            return any(
                _FILES.search(f"/annotations_positions/{f.name}") and _is_annotation(Source(f).head(4096))
                for f in files
            )
        kind = archive_kind(source)
        if kind == "tar":
            head = source.head(8192)
            return any(_TAR_ENTRY.search(head[at : at + 101]) for at in range(0, len(head), 512))
        if kind == "zip":
            try:
                with members(source, wanted=re.compile(r"(?:^|/)annotations_positions/\d{1,9}\.json$")) as found:
                    return any(True for _ in found)
            except InputError:
                return False
        return False

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the annotated frames; see `Adapter.read`.

        Video frame n stands at `start + (n - first_frame) / fps`, with `options.fps` in *video* frames a second
        (default 10). Every readable file is a heartbeat, also one without people; an unreadable file is quarantined
        and makes no frame. The line of a record is the number of its file in reading order.

        Raises:
            InputError: E207 without `options.start` or with an impossible frame rate, E204 without annotations, E205
                and E206 as `vsd_analytics.ingest.archive` says.
        """
        fps = VIDEO_FPS if options.fps is None else options.fps
        if options.start is None or not (math.isfinite(fps) and 0.001 <= fps <= 1000):
            raise InputError(
                f"{source.path.name} does not say when its first frame was taken"
                if options.start is None
                else f"{fps:g} is no frame rate",
                code="E207",
                where=Where(source.name),
                why="WILDTRACK files are named by the number of the video frame and carry no times",
                mend="give the start, for example --start 2026-01-05T09:00:00+01:00 (and --fps if it is not 10)",
            )
        camera, rows, n_files, damage = options.camera or "wildtrack", _Rows(), 0, None
        with members(source, wanted=_FILES) as found:
            try:
                for n_files, member in enumerate(found, 1):
                    number = _FILES.search(member.name)
                    frame = int(number[1]) if number else 0
                    try:
                        with member.open() as stream:
                            text = stream.read(MAX_FILE_BYTES + 1)
                    except InputError as error:  # the files after a damaged one are read all the same
                        damage = damage or error
                        continue
                    ts_ms = frame_ms(frame, first=options.first_frame or 0.0, fps=fps, start_ms=options.start)
                    _take(text, file=member.name, line=n_files, ts_ms=ts_ms, rows=rows)
                    if len(rows.persons) + len(rows.frames) + 10 * len(rows.rejected) >= BATCH_ROWS:
                        yield rows.batch(camera)
                        rows = _Rows()
            except InputError as error:
                damage = damage or error
            yield rows.batch(camera)
        if damage is not None:
            raise damage
        if not n_files:
            raise InputError(
                f"{source.path.name} holds no annotations_positions/<frame>.json",
                code="E204",
                where=Where(source.name),
                mend="name the folder annotations_positions, or the archive it came in",
            )


def _take(text: bytes, *, file: str, line: int, ts_ms: int | None, rows: _Rows) -> None:
    """Add one file to the rows; a person that cannot be used still counts as seen in its frame."""
    import msgspec

    name = file.rpartition("/")[2]
    if len(text) > MAX_FILE_BYTES:
        detail = f"{name} is longer than {MAX_FILE_BYTES:,} bytes"
        rows.rejected.append(rejected(line, reason="file-too-long", detail=detail, record=text))
        return
    try:
        people: Any = msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        rows.rejected.append(rejected(line, reason="bad-json", detail=f"{name} is no JSON: {error}", record=text))
        return
    if not isinstance(people, list):
        detail = f"{name} is no list of people"
        rows.rejected.append(rejected(line, reason="bad-file", detail=detail, record=text))
        return
    rows.frames.append((ts_ms, len(people), line))
    for index, entry in enumerate(people):
        person, cell = (entry.get("personID"), entry.get("positionID")) if isinstance(entry, dict) else (None, None)
        if type(person) is int and abs(person) < 1 << 63 and type(cell) is int and 0 <= cell < GRID[0] * GRID[1]:
            y, x = divmod(cell, GRID[0])
            x_m, y_m = GRID_ORIGIN_M[0] + GRID_STEP_M * x, GRID_ORIGIN_M[1] + GRID_STEP_M * y
            rows.persons.append((ts_ms, index, str(person), x_m, y_m, line))
        else:
            detail = f"person {index + 1} of {name} has no personID or no positionID of the {GRID[0]} x {GRID[1]} grid"
            rows.rejected.append(rejected(line, reason="bad-position", detail=detail, record=repr(entry)[:500]))


def _is_annotation(head: bytes) -> bool:
    return head.lstrip().startswith(b"[") and (b'"positionID"' in head or head.strip() == b"[]")


def _transposed(rows: list[Any], width: int) -> list[list[Any]]:
    return [list(column) for column in zip(*rows, strict=True)] if rows else [[] for _ in range(width)]


ADAPTER = Wildtrack()
