"""WILDTRACK annotations: one JSON file per annotated video frame, floor positions as numbers of grid cells.

The positions of seven cameras were fused into one set before they were written, so they are read as one virtual camera
and nobody is counted twice. Cell n of the 480 x 1440 grid is at x = -3 + 0.025 (n mod 480), y = -9 + 0.025 (n div 480)
metres. With `--per-camera` each view is a camera of its own, C1 to C7, with the foot points of its boxes in pixels, as
engines send them that know nothing of each other.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source
from vsd_analytics.ingest.reading.archive import archive_kind, members
from vsd_analytics.ingest.reading.instants import frame_ms
from vsd_analytics.ingest.reading.raw import raw_table, rejected, too_many_people
from vsd_analytics.ingest.reading.reasons import TOO_MANY

VIDEO_FPS = 10.0
"""Video frames a second: every fifth is annotated, two a second."""
GRID = (480, 1440)
GRID_ORIGIN_M = (-3.0, -9.0)
GRID_STEP_M = 0.025
VIEWS = tuple(f"C{number}" for number in range(1, 8))
"""Cameras of the single views, by viewNum."""
BOX_SIDES = ("xmin", "ymin", "xmax", "ymax")

_FILES = re.compile(r"(?:^|annotations_positions/)(\d{1,9})\.json$")
_TAR_ENTRY = re.compile(rb"(?:^|/)annotations_positions/(?:\d{1,9}\.json)?\0")


@dataclass(slots=True)
class _WildtrackRows:
    """Records that were read and not yielded yet; places are metres, or pixels of single views."""

    is_pixels: bool = False
    frames: list[tuple[str, int | None, int, int]] = field(default_factory=list)
    persons: list[tuple[str, int | None, int, str, float, float, int]] = field(default_factory=list)
    rejected: list[Rejected] = field(default_factory=list)

    def batch(self) -> RawBatch:
        camera, ts, counts, lines = _transposed(self.frames, 4)
        frames = raw_table("frames", camera=camera, ts_ms=ts, n_persons=counts, line=lines)
        camera, ts, person, track, x, y, lines = _transposed(self.persons, 7)
        observations = raw_table(
            "observations",
            camera=camera,
            ts_ms=ts,
            person=person,
            track=track,
            **({"u_px": x, "v_px": y} if self.is_pixels else {"x_m": x, "y_m": y}),
            quality="metric",
            line=lines,
        )
        return RawBatch({"frames": frames, "observations": observations}, self.rejected)


class Wildtrack:
    """Adapter of WILDTRACK annotation folders and archives."""

    name = "wildtrack"
    coordinates = (
        "floor metres from the grid of 2.5 cm cells, one virtual camera for all views; with --per-camera image pixels, "
        "foot point = bottom centre of the box, cameras C1 to C7"
    )

    def detects(self, source: Source) -> bool:
        """Return whether this is a folder of numbered JSON files with positionID, or a tar of annotations_positions."""
        if source.path.is_dir():
            files = (
                *islice(source.path.glob("annotations_positions/[0-9]*.json"), 1),
                *islice(source.path.glob("[0-9]*.json"), 1),
            )
            heads = {f.name: Source(f, settings=source.settings).head(4096) for f in files}
            return any(_FILES.search(f"/annotations_positions/{n}") and _is_annotation(h) for n, h in heads.items())
        kind = archive_kind(source)
        if kind == "tar":
            head = source.head(8192)
            return any(_TAR_ENTRY.search(head[at : at + 101]) for at in range(0, len(head), 512))
        if kind == "zip":
            try:
                with members(source, wanted=re.compile(r"(?:^|/)annotations_positions/\d{1,9}\.json$")) as members_here:
                    return any(True for _ in members_here)
            except InputError:
                return False
        return False

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the annotated frames; see `Adapter.read`.

        Video frame n was taken at `start + (n - first_frame) / fps`, with `options.fps` in *video* frames a second
        (default 10). Every readable file is a heartbeat, also one without people; an unreadable file is quarantined
        and makes no frame. The line of a record is the number of its file in reading order.

        With `options.per_camera` a record is the middle of the lower edge of a box in the pixels of its view; it may be
        outside the picture, whose edge cuts people off. Each file is a heartbeat of every view. Corners of -1 mean that
        the person is not seen in that view.

        Raises:
            InputError: E207 without `options.start` or with an impossible frame rate, E204 without annotations, E205
                and E206 as `vsd_analytics.ingest.reading.archive` says.
        """
        fps = VIDEO_FPS if options.fps is None else options.fps
        if options.start is None or not (math.isfinite(fps) and 0.001 <= fps <= 1000):
            raise InputError(
                f"{source.file_name} does not say when its first frame was taken"
                if options.start is None
                else f"{fps:g} is no frame rate",
                code="E207",
                where=Where(source.name),
                why="WILDTRACK files are named by the number of the video frame and carry no times",
                fix="give the start, for example --start 2026-01-05T09:00:00+01:00 (and --hz if it is not 10)",
            )
        camera, n_files, damage = options.camera or "wildtrack", 0, None
        rows = _WildtrackRows(options.per_camera)
        with members(source, wanted=_FILES) as files:
            try:
                for n_files, member in enumerate(files, 1):
                    number = _FILES.search(member.name)
                    frame = int(number[1]) if number else 0
                    try:
                        with member.open() as stream:
                            text = stream.read(options.line_max_bytes + 1)
                    except InputError as error:  # read the files after a damaged one all the same
                        damage = damage or error
                        continue
                    ts_ms = frame_ms(frame, first=options.first_frame or 0.0, fps=fps, start_ms=options.start)
                    people = _people(text, file=member.name, line=n_files, rows=rows, options=options)
                    if people is not None and options.per_camera:
                        _take_views(people, file=member.name, line=n_files, ts_ms=ts_ms, rows=rows)
                    elif people is not None:
                        _take_floor(people, file=member.name, line=n_files, ts_ms=ts_ms, rows=rows, camera=camera)
                    if len(rows.persons) + len(rows.frames) + 10 * len(rows.rejected) >= BATCH_ROWS:
                        yield rows.batch()
                        rows = _WildtrackRows(options.per_camera)
            except InputError as error:
                damage = damage or error
            yield rows.batch()
        if damage is not None:
            raise damage
        if not n_files:
            raise InputError(
                f"{source.file_name} holds no annotations_positions/<frame>.json",
                code="E204",
                where=Where(source.name),
                fix="name the folder annotations_positions, or the archive it came in",
            )


def _people(text: bytes, *, file: str, line: int, rows: _WildtrackRows, options: IngestOptions) -> list[Any] | None:
    """Return the entries of one file; None when it cannot be used and was rejected."""
    import msgspec

    name = file.rpartition("/")[2]
    if len(text) > options.line_max_bytes:
        detail = f"{name} is longer than {options.line_max_bytes:,} bytes (line_max_bytes)"
        rows.rejected.append(rejected(line, reason="file-too-long", detail=detail, record=text))
        return None
    try:
        people: Any = msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        rows.rejected.append(rejected(line, reason="bad-json", detail=f"{name} is no JSON: {error}", record=text))
        return None
    if not isinstance(people, list):
        detail = f"{name} is no list of people"
        rows.rejected.append(rejected(line, reason="bad-file", detail=detail, record=text))
        return None
    if len(people) > options.persons_max:
        detail = f"{name}: {too_many_people(len(people), options)}"
        rows.rejected.append(rejected(line, reason=TOO_MANY, detail=detail, record=text))
        return None
    return people


def _take_floor(
    people: list[Any], *, file: str, line: int, ts_ms: int | None, rows: _WildtrackRows, camera: str
) -> None:
    """Add one file's floor positions; a person that cannot be used still counts as seen in its frame."""
    rows.frames.append((camera, ts_ms, len(people), line))
    for index, entry in enumerate(people):
        person, cell = _person(entry), entry.get("positionID") if isinstance(entry, dict) else None
        if person is not None and type(cell) is int and 0 <= cell < GRID[0] * GRID[1]:
            y, x = divmod(cell, GRID[0])
            x_m, y_m = GRID_ORIGIN_M[0] + GRID_STEP_M * x, GRID_ORIGIN_M[1] + GRID_STEP_M * y
            rows.persons.append((camera, ts_ms, index, person, x_m, y_m, line))
        else:
            wanted = f"no personID or no positionID of the {GRID[0]} x {GRID[1]} grid"
            _reject(entry, wanted, reason="bad-position", file=file, line=line, index=index, rows=rows)


def _take_views(people: list[Any], *, file: str, line: int, ts_ms: int | None, rows: _WildtrackRows) -> None:
    """Add the foot points of one file's boxes, view by view; of a person with a bad one none is taken."""
    n_seen = [0] * len(VIEWS)
    for index, entry in enumerate(people):
        person, boxes = _person(entry), _boxes(entry)
        if person is None or boxes is None:
            wanted = f"no personID, or not one box for each of the {len(VIEWS)} views"
            _reject(entry, wanted, reason="bad-box", file=file, line=line, index=index, rows=rows)
            continue
        for view, (left, top, right, bottom) in boxes.items():
            if (left, top, right, bottom) != (-1, -1, -1, -1):
                u_px, v_px = (left + right) / 2, float(bottom)
                rows.persons.append((VIEWS[view], ts_ms, n_seen[view], person, u_px, v_px, line))
                n_seen[view] += 1
    rows.frames.extend((camera, ts_ms, n, line) for camera, n in zip(VIEWS, n_seen, strict=True))


def _person(entry: Any) -> str | None:
    person = entry.get("personID") if isinstance(entry, dict) else None
    return str(person) if type(person) is int and abs(person) < 1 << 63 else None


def _boxes(entry: Any) -> dict[int, tuple[int, int, int, int]] | None:
    """Return the corners of a person's box by view, or None when a view is missing, repeated or unreadable."""
    views = entry.get("views") if isinstance(entry, dict) else None
    if not isinstance(views, list) or not all(isinstance(view, dict) for view in views):
        return None
    if sorted(str(view.get("viewNum")) for view in views) != [str(number) for number in range(len(VIEWS))]:
        return None
    boxes = {int(view["viewNum"]): tuple(view.get(side) for side in BOX_SIDES) for view in views}
    if not all(type(corner) is int and abs(corner) < 1 << 31 for box in boxes.values() for corner in box):
        return None
    return boxes


def _reject(entry: Any, wanted: str, *, reason: str, file: str, line: int, index: int, rows: _WildtrackRows) -> None:
    detail = f"person {index + 1} of {file.rpartition('/')[2]} has {wanted}"
    rows.rejected.append(rejected(line, reason=reason, detail=detail, record=repr(entry)[:500]))


def _is_annotation(head: bytes) -> bool:
    return head.lstrip().startswith(b"[") and (b'"positionID"' in head or head.strip() == b"[]")


def _transposed(rows: list[Any], width: int) -> list[list[Any]]:
    return [list(column) for column in zip(*rows, strict=True)] if rows else [[] for _ in range(width)]


ADAPTER = Wildtrack()
