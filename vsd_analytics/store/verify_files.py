"""Checks of the store's files: bytes against the hash in the name, columns against the schema, no foreign files.

The checks change nothing and lock nothing. Files are read piece by piece. A file that goes away meanwhile is no fault:
a fold empties the spool.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.layout import Part, segment_paths
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.part_files import HASH_DIFFERS
from vsd_analytics.store.repeats import AGAIN
from vsd_analytics.store.segments import schema_of
from vsd_analytics.store.store import Store

_PART = re.compile(r"site=([^/]+)/date=(\d{4}-\d{2}-\d{2})/(?:[01]\d|2[0-3])-[0-9a-f]{16}(?:[0-9a-f]{96})?\.parquet")
_OTHERS = re.compile(
    r"\.lock|\.purge\.lock|\.ballast|purge/[0-9a-f]{16}\.json|(?:imports\.jsonl|(?:floors|erasures|fetched)\.json)"
    r"|live/(.+)/[0-9a-f]{16}\.(?:arrow|parquet)"
)
_RESTORE = "restore it from a backup; without one move it away and ingest the files of its hour again"
_AGAIN = "move it away and ingest its source again: records that are stored already are recognised"


@dataclass(frozen=True, slots=True)
class StoreFault:
    """One fault of a file.

    Attributes:
        code: Its explanation: `vsd explain CODE`.
        path: The file.
        what: What is wrong.
        why: How the check found it.
        fix: What to do.
        is_note: Nothing is damaged and nobody needs to act.
    """

    code: str
    path: Path
    what: str
    why: str
    fix: str
    is_note: bool = False


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one kind of check.

    Attributes:
        name: Its name, such as "parts".
        n: Number of things checked.
        things: Their name in the plural, such as "files".
        promise: What is true of all things without a fault.
        findings: The faults.
    """

    name: str
    n: int
    things: str
    promise: str
    findings: tuple[StoreFault, ...] = ()

    @property
    def damages(self) -> tuple[StoreFault, ...]:
        """Return the faults that somebody must act on."""
        return tuple(f for f in self.findings if not f.is_note)


@dataclass(frozen=True, slots=True)
class StoredPart:
    """A part without fault: its bytes match its name, and it can be read.

    Attributes:
        table: Its table.
        part: Hour and path.
        n_rows: Its rows.
    """

    table: TableName
    part: Part
    n_rows: int


def check_parts(
    parts: Iterable[tuple[TableName, Part]], *, on_bytes: Callable[[int], None] | None = None
) -> tuple[Check, Check, list[StoredPart]]:
    """Check the bytes of parts and their columns; return both results and the parts that passed.

    Args:
        parts: Parts with their tables.
        on_bytes: Called with the number of bytes done, for a progress bar.
    """
    n, n_whole, sound = 0, 0, []
    damaged: list[StoreFault] = []
    misfit: list[StoreFault] = []
    for table, part in parts:
        finding = _hash_fault(part.path, part.digest, "a file with stored records is damaged", _RESTORE)
        if finding is None and not part.path.exists():
            continue
        n += 1
        if on_bytes is not None:
            on_bytes(_size(part.path))
        if finding is not None:
            damaged.append(finding)
            continue
        n_whole += 1
        n_rows, why = _fits(part.path, table)
        if why is None:
            sound.append(StoredPart(table, part, n_rows))
        else:
            misfit.append(StoreFault("E302", part.path, f"a file does not fit the table {table}", why, _RESTORE))
    return (
        Check("parts", n, "files", "their bytes are those of the hash in their name", tuple(damaged)),
        Check("columns", n_whole, "files", "they can be read and have the columns of their table", tuple(misfit)),
        sound,
    )


def newest_parts(store: Store, *, n_bytes: int) -> list[tuple[TableName, Part]]:
    """Return the newest parts of a store, together about `n_bytes`, for a quick check."""
    chosen: list[tuple[TableName, Part]] = []
    total = 0
    for table, part in sorted(all_parts(store), key=lambda each: each[1].hour, reverse=True):
        total += _size(part.path)
        if chosen and total > n_bytes:
            break
        chosen.append((table, part))
    return chosen


def all_parts(
    store: Store, *, first_hour: int | None = None, last_hour: int | None = None
) -> list[tuple[TableName, Part]]:
    """Return the parts of all tables whose hour lies in [first_hour, last_hour] (None = open), with their tables."""
    return [(t, p) for t in TABLES for p in store.parts(t, first_hour=first_hour, last_hour=last_hour)]


def check_repeats(store: Store) -> Check:
    """Check the records that imports brought again (`store.repeats`): bytes and columns."""
    parts = [(t, p) for t in TABLES for p in store.repeats(t)]
    whole, fitting, _ = check_parts(parts)
    findings = (*whole.findings, *fitting.findings)
    return Check("repeats", whole.n, "files", "brought by a second import: bytes and columns are right", findings)


def check_spool(store: Store) -> Check:
    """Check the files of the spool: acknowledged and not yet folded."""
    n, findings = 0, []
    for table in TABLES:
        for path in segment_paths(store.root, table):
            finding = _hash_fault(path, path.stem, "a file with acknowledged records is damaged", _AGAIN)
            if finding is None and not path.exists():
                continue
            n += 1
            if finding is None and (why := _segment_misfit(path, table)) is not None:
                finding = StoreFault("E302", path, f"a file of the spool does not fit the table {table}", why, _AGAIN)
            findings += [finding] if finding else []
    return Check("spool", n, "files", "not yet folded: bytes and columns are right", tuple(findings))


def check_names(store: Store) -> Check:
    """Check that every file below the store belongs there."""

    def is_known(name: str) -> bool:
        other = _OTHERS.fullmatch(name)
        table, _, rest = name.removeprefix(f"{AGAIN}/").partition("/")
        return (table in TABLES and is_part(rest, store.site_id)) or (other is not None and other[1] in (None, *TABLES))

    n, findings = foreign_files(store.root, is_known)
    return Check("names", n, "files", "every file belongs here", tuple(_of_other_site(f, store) for f in findings))


def is_part(name: str, site_id: str) -> bool:
    """Return whether a path below a table or fact is that of a file of a site's UTC hour."""
    match = _PART.fullmatch(name)
    if match is None or match[1] != site_id:
        return False
    try:
        date.fromisoformat(match[2])
    except ValueError:
        return False
    return True


def foreign_files(root: Path, is_known: Callable[[str], bool]) -> tuple[int, list[StoreFault]]:
    """Return the number of files below a folder, and a fault for each that does not belong there.

    Temporary files of running processes may be anywhere; those of dead processes are noted.

    Args:
        root: The folder.
        is_known: Returns whether a file may be at a path, which is relative to `root` with forward slashes.
    """
    n, findings = 0, []
    for path in sorted(_files(root)):
        n += 1
        if durable.is_temporary(path):
            if durable.is_abandoned(path):
                findings.append(_abandoned(path))
        elif not is_known(path.relative_to(root).as_posix()) or path.is_dir():
            findings.append(_foreign(path))
    return n, findings


def _files(root: Path) -> Iterator[Path]:
    """Yield all files below a folder, and folders that are named like a Parquet file."""
    for folder, folders, names in os.walk(root):
        yield from (Path(folder, name) for name in names)
        yield from (Path(folder, name) for name in folders if name.endswith(".parquet"))


def _abandoned(path: Path) -> StoreFault:
    return StoreFault(
        "E307",
        path,
        "half-written file of a program that was stopped",
        "its process is gone; nobody reads such files",
        "nothing: the next command that writes there removes it",
        is_note=True,
    )


def _foreign(path: Path) -> StoreFault:
    return StoreFault(
        "E307",
        path,
        "a file that does not belong there",
        "this program writes no file of that name in that folder; it does not read the file, but other programs that "
        "read the folder would",
        "look at it and move it away",
    )


def _of_other_site(finding: StoreFault, store: Store) -> StoreFault:
    """Return the fault of a foreign file, with a clearer text when it is a part of another site."""
    table, _, rest = finding.path.relative_to(store.root).as_posix().partition("/")
    site_id = rest.partition("/")[0].removeprefix("site=")
    if table not in TABLES or site_id == store.site_id or not is_part(rest, site_id):
        return finding
    return StoreFault(
        "E307",
        finding.path,
        f"records of another site: {site_id!r}",
        f"vsd.toml describes the site {store.site_id!r}, so these records are in no figure",
        "give the site its old id in vsd.toml again, or move the folder away",
    )


def _hash_fault(path: Path, digest: str, what: str, fix: str) -> StoreFault | None:
    """Return a fault when the bytes of a file do not match the hash in its name, or cannot be read."""
    try:
        if durable.file_digest(path) == digest:
            return None
        return StoreFault("E302", path, what, HASH_DIFFERS, fix)
    except FileNotFoundError:
        return None
    except OSError as error:
        return StoreFault("E302", path, what, f"it cannot be read: {error.strerror or error}", fix)


def _fits(path: Path, table: TableName) -> tuple[int, str | None]:
    """Return the number of rows of a part, and why it does not fit its table, if so."""
    try:
        with pq.ParquetFile(path) as file:
            return file.metadata.num_rows, _misfit(file.schema_arrow, table)
    except FileNotFoundError:
        return 0, None
    except (pa.ArrowException, OSError, ValueError) as error:
        return 0, f"it cannot be read as Parquet: {' '.join(str(error).split())[:200]}"


def _segment_misfit(path: Path, table: TableName) -> str | None:
    """Return why a file of the spool does not fit its table, if so."""
    try:
        return _misfit(schema_of(path), table, OWNER)
    except FileNotFoundError:
        return None
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        return f"it cannot be read: {' '.join(str(error).split())[:200]}"


def _misfit(schema: pa.Schema, table: TableName, *allowed: str) -> str | None:
    """Return why columns are not those of a table, or None; a nullable column, which may be newer, may be missing."""
    for column in SCHEMAS[table]:
        if column.name not in schema.names:
            if column.nullable:
                continue
            return f"it lacks the column {column.name}"
        other = schema.field(column.name)
        if other.type != column.type or (other.nullable and not column.nullable):
            return f"its column {column.name} is {_type(other)}, not {_type(column)}"
    foreign = [name for name in schema.names if name not in (*SCHEMAS[table].names, *allowed)]
    return f"it has a column {foreign[0]!r}, which the table does not have" if foreign else None


def _type(column: pa.Field) -> str:
    return f"{column.type}{'' if column.nullable else ' not null'}"


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
