"""Object logs of smart-social-distancing: one CSV row a frame, with people as a Python list of boxes in one cell.

The log counts the pairs that were too close and lists the persons in them, but has neither pairs nor distances. Both
are rebuilt from the boxes (`vsd_analytics.ingest.formats.body_distance`). The counts of the log then show whether
method, resolution and threshold are right. The engine writes a row also when nobody is in view, so every row is a
heartbeat.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np
import pyarrow as pa

from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.ingest.formats.body_distance import METHODS, EngineSetting, LogAgreement, Pairs
from vsd_analytics.ingest.formats.object_log import ObjectLogRow, parsed, timed
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source, bytes_read
from vsd_analytics.ingest.reading.archive import Member, archive_kind, members
from vsd_analytics.ingest.reading.raw import raw_table
from vsd_analytics.schema import TableName
from vsd_analytics.settings import DEFAULTS

HEADER = b"Version,Timestamp,DetectedObjects,ViolatingObjects,"

_LOGS = re.compile(r"(?:^|/)objects_log/[^/]+\.csv(?:\.gz)?$")
_LOGS_HERE = re.compile(r"^[^/]+\.csv(?:\.gz)?$")


@dataclass(slots=True)
class _ObjectLogRows:
    """Rows that were read and not yielded yet, with their times."""

    rows: list[ObjectLogRow] = field(default_factory=list)
    ts: list[int] = field(default_factory=list)
    rejected: list[Rejected] = field(default_factory=list)
    n_records: int = 0

    def add(self, row: ObjectLogRow, ts_ms: int) -> None:
        n = len(row.frame.boxes)
        self.rows.append(row)
        self.ts.append(ts_ms)
        self.n_records += 1 + max(n, n * (n - 1) // 2)

    @property
    def is_full(self) -> bool:
        return self.n_records + 10 * len(self.rejected) >= BATCH_ROWS

    def batch(self, camera: str | None, agreement: LogAgreement, done_bytes: int) -> RawBatch:
        """Return raw tables: a frame a row, foot points, and the pairs within the default of `pair_max_m`."""
        frames = [r.frame for r in self.rows]
        pairs = Pairs.of(frames)
        metres = pairs.distances_m(agreement.setting)
        agreement.add(frames, pairs, distances_m=metres)
        is_near = metres < DEFAULTS.pair_max_m
        ts, lines = np.array(self.ts, dtype=np.int64), np.array([r.line for r in self.rows], dtype=np.int64)
        sizes = [len(f.boxes) for f in frames]
        n_pairs = np.bincount(pairs.frame[is_near], minlength=len(frames))
        boxes = np.concatenate([np.empty((0, 4)), *(f.boxes for f in frames)])
        width, height = agreement.setting.resolution_px
        tracks = [t for r in self.rows for t in r.tracks]
        of_person, of_pair = np.repeat(np.arange(len(frames)), sizes), pairs.frame[is_near]
        first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)[of_pair]
        a, b = pairs.a[is_near], pairs.b[is_near]
        tables: dict[TableName, pa.Table] = {
            "frames": raw_table("frames", camera=camera, ts_ms=ts, n_persons=sizes, n_pairs=n_pairs, line=lines),
            "observations": raw_table(
                "observations",
                camera=camera,
                ts_ms=ts[of_person],
                person=[i for n in sizes for i in range(n)],
                track=tracks,
                u_px=(boxes[:, 0] + boxes[:, 2]) / 2 * width,
                v_px=boxes[:, 3] * height,
                quality="relative",
                line=lines[of_person],
            ),
            "pairs": raw_table(
                "pairs",
                camera=camera,
                ts_ms=ts[of_pair],
                person_a=a,
                person_b=b,
                track_a=[tracks[i] for i in first + a],
                track_b=[tracks[i] for i in first + b],
                distance_m=metres[is_near],
                quality="body",
                line=lines[of_pair],
            ),
        }
        return RawBatch(tables, self.rejected, done_bytes=done_bytes, engines=("smart-social-distancing",))


class SmartSocialDistancing:
    """Adapter of smart-social-distancing object logs."""

    name = "smart-social-distancing"
    coordinates = (
        "image pixels at the logged resolution, foot point = bottom centre of the box; distances by body height"
    )
    uses = frozenset({"zone", "method", "resolution_px", "threshold_m"})

    def detects(self, source: Source) -> bool:
        """Return whether this is a file with the header line, or a folder with an objects_log of such files."""
        if not source.path.is_dir():
            return source.head(256).removeprefix(b"\xef\xbb\xbf").startswith(HEADER)
        patterns = ("objects_log/*.csv", "*/objects_log/*.csv", *(("*.csv",) if _is_log_folder(source) else ()))
        logs = (next(source.path.glob(pattern), None) for pattern in patterns)
        return any(log is not None and self.detects(Source(log, settings=source.settings)) for log in logs)

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream a log, or every log of a camera's or an engine's log folder.

        Times are local to `options.frame_zone`. The log has whole seconds; of n rows in one second, the k-th (from 0)
        gets k 1000/n ms added. The camera is `options.camera`, else the folder that holds `objects_log`. The last batch
        has a note on how many rows agree with the pairs rebuilt by `options.method`, `resolution_px` and `threshold_m`.

        Raises:
            InputError: E203 when a needed column is missing, E204 when a folder has no logs, E205 when a file is
                damaged.
            UsageError: E101 for a method, resolution, threshold or zone that cannot be.
        """
        agreement, zone, damage = LogAgreement(_setting(options)), _zone(options.frame_zone), None
        with _logs(source) as logs:
            is_empty = True
            try:
                for log in logs:
                    is_empty = False
                    try:
                        yield from _read(source, log, options=options, zone=zone, agreement=agreement)
                    except InputError as error:  # the logs after a damaged one are read all the same
                        damage = damage or error
            except InputError as error:
                is_empty, damage = False, damage or error
        if is_empty:
            raise InputError(f"{source.file_name} holds no objects_log/*.csv", code="E204", where=Where(source.name))
        note = agreement.note()
        yield RawBatch(notes=(note,) if note else (), done_bytes=source.size_bytes)
        if damage is not None:
            raise damage


def _read(
    source: Source, log: Member, *, options: IngestOptions, zone: ZoneInfo, agreement: LogAgreement
) -> Iterator[RawBatch]:
    prefix = "" if archive_kind(source) is None else f"{log.name}: "
    camera, rows, done = options.camera or _camera(source, log), _ObjectLogRows(), 0
    with log.open() as stream:
        try:
            for item in timed(parsed(stream, source_name=source.name, prefix=prefix, options=options), zone):
                if isinstance(item, Rejected):
                    rows.rejected.append(item)
                else:
                    rows.add(*item)
                if rows.is_full:
                    done = min(bytes_read(stream), source.size_bytes)
                    yield rows.batch(camera, agreement, done)
                    rows = _ObjectLogRows()
        except InputError:
            yield rows.batch(camera, agreement, done)  # what came before the damage
            raise
    yield rows.batch(camera, agreement, done)


def _setting(options: IngestOptions) -> EngineSetting:
    width, height = options.resolution_px
    if options.method not in METHODS:
        near = difflib.get_close_matches(options.method, METHODS, 1) or METHODS
        raise UsageError(f"there is no distance method {options.method!r}", fix=f"use --method {' or '.join(near)}")
    if width <= 0 or height <= 0 or not (math.isfinite(options.threshold_m) and options.threshold_m > 0):
        raise UsageError("resolution and threshold must be above zero", fix="--resolution 640x480 --threshold 1.5")
    return EngineSetting(options.method, (width, height), options.threshold_m)


def _zone(name: str) -> ZoneInfo:
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise UsageError(f"there is no time zone {name[:80]!r}", fix="use an IANA name such as Europe/Zurich") from None


def _is_log_folder(source: Source) -> bool:
    return source.path.absolute().name == "objects_log"


@contextmanager
def _logs(source: Source) -> Iterator[Any]:
    if archive_kind(source) is None:
        yield [Member(source.file_name, source.open)]
    else:
        with members(source, wanted=_LOGS_HERE if _is_log_folder(source) else _LOGS) as files:
            yield files


def _camera(source: Source, log: Member) -> str | None:
    """Return the folder that holds `objects_log`, or None where there is no such folder."""
    whole = PurePosixPath(Path(os.path.abspath(source.path)).as_posix())
    path = whole if archive_kind(source) is None else whole / log.name
    return path.parent.parent.name or None if path.parent.name == "objects_log" else None


ADAPTER = SmartSocialDistancing()
