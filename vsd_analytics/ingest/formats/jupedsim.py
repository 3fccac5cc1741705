"""JuPedSim SQLite databases: a table `trajectory_data` of frame, id, pos_x and pos_y, and `metadata` with the rate.

Positions are floor metres. The database has frame numbers and no clock: `--start` says when frame 0 was. Every frame
from the first to the last is a heartbeat.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from urllib.parse import quote

import pyarrow as pa

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source, damaged_after
from vsd_analytics.ingest.reading.instants import frame_ms
from vsd_analytics.ingest.reading.limits import records_max, too_many_records
from vsd_analytics.ingest.reading.raw import raw_table, rejected

_MAGIC = b"SQLite format 3\0"
_TABLE = b"trajectory_data"
_ROWS = "select rowid, frame, id, pos_x, pos_y from trajectory_data order by rowid"
_COUNTS = "select frame, count(*) from trajectory_data where typeof(frame) = 'integer' group by frame order by frame"


class JuPedSim:
    """Adapter of the SQLite databases that JuPedSim writes."""

    name = "jupedsim"
    coordinates = "floor metres"
    uses = frozenset({"fps", "start", "first_frame"})

    def detects(self, source: Source) -> bool:
        """Return whether the file is a SQLite database whose schema has the table of trajectories."""
        head = source.head() if source.path.is_file() else b""
        return head.startswith(_MAGIC) and _TABLE in head

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the positions, then the frames.

        Raises:
            InputError: E205 the database is damaged, E207 the frame rate or the start is not known, E209 it has more
                rows than are allowed.
        """
        n_done = 0
        try:
            with closing(opened_database(source.path)) as database:
                clock = _clock(source, options, database)
                (n_rows,) = database.execute("select count(*) from trajectory_data").fetchone()
                if n_rows > records_max(source.size_bytes, source.settings):
                    raise too_many_records(source, n_rows)
                cursor = database.execute(_ROWS)
                while rows := cursor.fetchmany(BATCH_ROWS):
                    yield _batch(rows, options, clock, source.size_bytes * n_done // max(1, n_rows))
                    n_done += len(rows)
                yield from _frames(source, options, clock, database)
        except sqlite3.Error as error:
            raise damaged_after(source, n_done, why=f"SQLite says: {str(error)[:200]}") from None


def opened_database(path: Path) -> sqlite3.Connection:
    """Open a database for reading alone: no journal is made beside it, and nothing of it is run."""
    database = sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1", uri=True)
    database.execute("pragma trusted_schema = off")
    return database


def _clock(source: Source, options: IngestOptions, database: sqlite3.Connection) -> partial[int | None]:
    try:
        stated = database.execute("select value from metadata where key = 'fps'").fetchone()
        fps = options.fps or (None if stated is None else float(stated[0]))
    except (sqlite3.OperationalError, TypeError, ValueError):  # it has no such table, or no number in it
        fps = options.fps
    if fps is None or not math.isfinite(fps) or fps <= 0 or options.start is None:
        has_rate = fps is not None and math.isfinite(fps) and fps > 0
        lacking = "when its first frame was" if options.start is None else "how many frames a second it has"
        needed = [*(["--start 2026-01-05T09:00:00+01:00"] * (options.start is None)), *(["--fps 25"] * (not has_rate))]
        raise InputError(
            f"{source.file_name} does not say {lacking}",
            code="E207",
            where=Where(source.name),
            why="JuPedSim writes frame numbers, and the rate into the table metadata",
            fix=f"give it, for example {' '.join(needed)}",
        )
    return partial(frame_ms, first=options.first_frame or 0.0, fps=fps, start_ms=options.start)


def _batch(rows: list[tuple[object, ...]], options: IngestOptions, clock: partial[int | None], done: int) -> RawBatch:
    bad: list[Rejected] = []
    good: list[tuple[int, int, int, float, float]] = []
    for row in rows:
        line, frame, track, x, y = row
        if not (isinstance(frame, int) and isinstance(track, int)):
            bad.append(
                rejected(int(str(line)), reason="bad-frame", detail="frame and id are whole numbers", record=str(row))
            )
        elif not (isinstance(x, int | float) and isinstance(y, int | float)):
            bad.append(
                rejected(int(str(line)), reason="not-a-number", detail="pos_x, pos_y are numbers", record=str(row))
            )
        else:
            good.append((int(str(line)), frame, track, float(x), float(y)))
    lines, frames, tracks, xs, ys = map(list, zip(*good, strict=True)) if good else ([],) * 5
    table = raw_table(
        "observations",
        camera=options.camera,
        ts_ms=[clock(frame) for frame in frames],
        person=0,
        track=[str(track) for track in tracks],
        x_m=pa.array(xs, pa.float64()),
        y_m=pa.array(ys, pa.float64()),
        quality="metric",
        line=lines,
    )
    engines = [options.engine or "JuPedSim"]
    return RawBatch({"observations": table}, bad, done_bytes=done, engines=engines)


def _frames(
    source: Source, options: IngestOptions, clock: partial[int | None], database: sqlite3.Connection
) -> Iterator[RawBatch]:
    n_of_frame = dict(database.execute(_COUNTS).fetchall())
    if not n_of_frame:
        return
    first, last = min(n_of_frame), max(n_of_frame)
    last = min(last, first + int(source.settings.sequence_frames_max))
    for at in range(first, last + 1, BATCH_ROWS):
        numbers = range(at, min(at + BATCH_ROWS, last + 1))
        counts, ts = [n_of_frame.get(n, 0) for n in numbers], [clock(n) for n in numbers]
        table = raw_table("frames", camera=options.camera, ts_ms=ts, n_persons=counts, line=0)
        yield RawBatch({"frames": table}, done_bytes=source.size_bytes)
