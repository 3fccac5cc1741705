"""What a node holds until the site's store has it: records that are acknowledged, and the list of what was imported.

```
outbox/live/<table>/<digest>.parquet     acknowledged: what `Store.append` writes here
outbox/ready/<table>/<digest>.parquet    many of those as one: never changed, removed when the site has it
outbox/imports.jsonl                     imports that are not ready yet
outbox/ready/imports/<digest>.jsonl      lines of the list of imports
```

Where a store folds, a node makes ready. A segment that is ready is published before those it was made of are removed. A
crash in between hands records on twice, and the fold of the site counts them once.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa

from vsd_analytics.errors import DiskError
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.imports import FILE as IMPORTS_FILE
from vsd_analytics.store.layout import segment_paths
from vsd_analytics.store.owners import OWNER, owned_by
from vsd_analytics.store.part_files import damaged_segment, engines_in, with_every_column
from vsd_analytics.store.segments import about, read_segment, sent_bytes

FOLDER = "outbox"
READY = "ready"
IMPORTS = "imports"
READY_ROWS = 500_000
"""Rows of one segment that is ready: few enough to be read at once."""


def make_ready(root: Path) -> int:
    """Make of the segments that were acknowledged a few that can be handed on; return their number of rows.

    The caller holds the lock of the outbox. On a full disk the segments are made ready one by one, by renaming.

    Raises:
        StoreError: E302, a segment is damaged; the others are ready then.
        DiskError: E304 to E306, the disk refused; everything is still there.
    """
    durable.sweep_temporaries(root)
    n_rows, damaged = 0, list[Path]()
    for table in TABLES:
        good = list[Path]()
        for path in segment_paths(root, table):
            (good if durable.file_digest(path) == path.stem else damaged).append(path)
        for paths in _together(good):
            n_rows += _as_one(root, table, paths)
    _imports_ready(root)
    if damaged:
        raise damaged_segment(damaged[0])
    return n_rows


def ready(root: Path) -> list[Path]:
    """Return the files that can be handed on: records before the frames that count them, then imports; by name."""
    paths = []
    for kind in (*reversed(TABLES), IMPORTS):
        with contextlib.suppress(FileNotFoundError):
            paths += sorted(p for p in (root / READY / kind).iterdir() if not p.name.startswith("."))
    return paths


def n_waiting(root: Path) -> int:
    """Return the number of files that the site does not have: ready or not."""
    return len(ready(root)) + sum(len(segment_paths(root, table)) for table in TABLES)


def _together(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield segments in lots of at most about `READY_ROWS` rows."""
    lot, n_rows = list[Path](), 0
    for path in paths:
        n_rows_of = about(path).n_rows
        if lot and n_rows + n_rows_of > READY_ROWS:
            yield lot
            lot, n_rows = [], 0
        lot.append(path)
        n_rows += n_rows_of
    if lot:
        yield lot


def _as_one(root: Path, table: TableName, paths: Sequence[Path]) -> int:
    """Make one ready segment of several; return its rows."""
    folder = root / READY / table
    durable.make_dirs(folder)
    pieces = [_with_owner(table, path) for path in paths]
    rows = pa.concat_tables(piece.replace_schema_metadata() for piece in pieces)
    engines = sorted({e for piece in pieces for e in engines_in(piece.schema.metadata)})
    data = sent_bytes(table, rows, engines)
    try:
        durable.publish(folder / f"{durable.digest(data)}.parquet", data)
    except DiskError as error:
        if error.code != "E304":
            raise
        for path in paths:
            path.rename(folder / path.name)
        durable.fsync_dir(folder)
        return int(rows.num_rows)
    for path in paths:
        durable.remove(path)
    durable.fsync_dir(paths[0].parent)
    return int(rows.num_rows)


def _with_owner(table: TableName, path: Path) -> pa.Table:
    rows = with_every_column(table, read_segment(path))
    owned = rows if OWNER in rows.column_names else owned_by("", rows)
    return owned.select([*SCHEMAS[table].names, OWNER])


def _imports_ready(root: Path) -> None:
    taken = root / "imports.taken.jsonl"  # by a rename: an import that is noted meanwhile begins a new list
    if not taken.exists():
        try:
            (root / IMPORTS_FILE).rename(taken)
        except FileNotFoundError:
            return
    lines = taken.read_bytes()
    durable.publish(root / READY / IMPORTS / f"{durable.digest(lines)}.jsonl", lines)
    durable.remove(taken)
