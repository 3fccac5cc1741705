"""Is the store what was written? Bytes against the hash in the name, columns against the schema, no stranger between.

Nothing is changed and nothing is locked here. Files are read piece by piece; one that goes away meanwhile (a fold
empties the spool) is no finding.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.layout import Part, segment_paths
from vsd_analytics.store.store import Store

_PART = re.compile(r"site=([^/]+)/date=(\d{4}-\d{2}-\d{2})/(?:[01]\d|2[0-3])-[0-9a-f]{16}\.parquet")
_OTHERS = re.compile(r"\.lock|\.purge\.lock|\.ballast|purge/[0-9a-f]{16}\.json|live/(.+)/[0-9a-f]{16}\.parquet")
_HASH = "its bytes are not those whose hash stands in its name: the disk or a program changed them"
_RESTORE = "restore it from a backup; without one move it away and ingest the files of its hour again"
_AGAIN = "move it away and ingest its source again: what is stored already is recognised"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is not as it should be.

    Attributes:
        code: Its explanation: `vsd explain CODE`.
        path: The file.
        what: What it is.
        why: How that shows.
        mend: What to do.
        is_note: Nothing is damaged and nobody needs to do anything.
    """

    code: str
    path: Path
    what: str
    why: str
    mend: str
    is_note: bool = False


@dataclass(frozen=True, slots=True)
class Check:
    """One kind of check.

    Attributes:
        name: Its name, such as "parts".
        n: How many things were looked at.
        things: What they are, in the plural.
        promise: What holds for all that have no finding.
        findings: What was found.
    """

    name: str
    n: int
    things: str
    promise: str
    findings: tuple[Finding, ...] = ()

    @property
    def damages(self) -> tuple[Finding, ...]:
        """Return the findings that need somebody."""
        return tuple(f for f in self.findings if not f.is_note)


@dataclass(frozen=True, slots=True)
class StoredPart:
    """A part that is sound: its bytes are those of its name, and it can be read.

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
    """Return the checks of the parts' bytes and of their columns, and the parts that passed both.

    Args:
        parts: Parts with their tables.
        on_bytes: Called with the number of bytes done, for a progress bar.
    """
    n, n_whole, sound = 0, 0, []
    damaged: list[Finding] = []
    misfit: list[Finding] = []
    for table, part in parts:
        finding = _unlike_name(part.path, part.digest, "a file with stored records is damaged", _RESTORE)
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
            misfit.append(Finding("E302", part.path, f"a file does not fit the table {table}", why, _RESTORE))
    return (
        Check("parts", n, "files", "their bytes are those of the hash in their name", tuple(damaged)),
        Check("columns", n_whole, "files", "they can be read and have the columns of their table", tuple(misfit)),
        sound,
    )


def newest_parts(store: Store, *, n_bytes: int) -> list[tuple[TableName, Part]]:
    """Return the newest parts of a store, of at most about so many bytes together, for a quick look."""
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


def check_spool(store: Store) -> Check:
    """Return the check of the files that are acknowledged and not yet folded."""
    n, findings = 0, []
    for table in TABLES:
        for path in segment_paths(store.root, table):
            finding = _unlike_name(path, path.stem, "a file with records acknowledged earlier is damaged", _AGAIN)
            if finding is None and not path.exists():
                continue
            n += 1
            if finding is None and (why := _fits(path, table)[1]) is not None:
                finding = Finding("E302", path, f"a file of the spool does not fit the table {table}", why, _AGAIN)
            findings += [finding] if finding else []
    return Check("spool", n, "files", "not yet folded: bytes and columns are right", tuple(findings))


def check_names(store: Store) -> Check:
    """Return the check that every file below the store belongs there."""

    def is_known(name: str) -> bool:
        other = _OTHERS.fullmatch(name)
        table, _, rest = name.partition("/")
        return (table in TABLES and is_part(rest, store.site_id)) or (other is not None and other[1] in (None, *TABLES))

    n, findings = strangers(store.root, is_known)
    told = [_of_other_site(f, store) for f in findings]
    return Check("names", n, "files", "no stranger among the files of the store", tuple(told))


def is_part(name: str, site_id: str) -> bool:
    """Tell whether a path below a table or fact is that of a file of a site's UTC hour."""
    match = _PART.fullmatch(name)
    if match is None or match[1] != site_id:
        return False
    try:
        date.fromisoformat(match[2])
    except ValueError:
        return False
    return True


def strangers(root: Path, is_known: Callable[[str], bool]) -> tuple[int, list[Finding]]:
    """Return how many files stand below a folder, and a finding for each that does not belong there.

    Args:
        root: The folder.
        is_known: Tells of a path below it, with forward slashes, whether a file may stand there. Temporary files of
            living processes may stand anywhere; those of dead ones are noted.
    """
    n, findings = 0, []
    for path in sorted(_files(root)):
        n += 1
        pid = durable.writer_of(path)
        if pid is not None:
            if not durable.is_alive(pid):
                findings.append(_litter(path))
        elif not is_known(path.relative_to(root).as_posix()) or path.is_dir():
            findings.append(_stranger(path))
    return n, findings


def _files(root: Path) -> Iterator[Path]:
    """Yield all files below a folder, and folders that bear the name of a file."""
    for folder, folders, names in os.walk(root):
        yield from (Path(folder, name) for name in names)
        yield from (Path(folder, name) for name in folders if name.endswith(".parquet"))


def _litter(path: Path) -> Finding:
    return Finding(
        "E307",
        path,
        "half-written file of a program that was stopped",
        "its name carries the number of a process that is gone; nobody reads such files",
        "nothing: the next fold or build removes it",
        is_note=True,
    )


def _stranger(path: Path) -> Finding:
    return Finding(
        "E307",
        path,
        "a file that does not belong there",
        "it has not the name of a file that this program writes in this place; it is not read here, and whoever reads "
        "the folder with another program would read it too",
        "look at it and move it away",
    )


def _of_other_site(finding: Finding, store: Store) -> Finding:
    """Return the finding of a stranger, told as such when it is a part of another site."""
    table, _, rest = finding.path.relative_to(store.root).as_posix().partition("/")
    site_id = rest.partition("/")[0].removeprefix("site=")
    if table not in TABLES or site_id == store.site_id or not is_part(rest, site_id):
        return finding
    return Finding(
        "E307",
        finding.path,
        f"records of another site: {site_id!r}",
        f"vsd.toml describes the site {store.site_id!r}, so these records are in no figure",
        "give the site its old id in vsd.toml again, or move the folder away",
    )


def _unlike_name(path: Path, digest: str, what: str, mend: str) -> Finding | None:
    """Return a finding when the bytes of a file are not those of its name, or cannot be read at all."""
    try:
        if durable.file_digest(path) == digest:
            return None
        return Finding("E302", path, what, _HASH, mend)
    except FileNotFoundError:
        return None
    except OSError as error:
        return Finding("E302", path, what, f"it cannot be read: {error.strerror or error}", mend)


def _fits(path: Path, table: TableName) -> tuple[int, str | None]:
    """Return the number of rows of a file, and why it does not fit its table, if so."""
    try:
        with pq.ParquetFile(path) as file:
            return file.metadata.num_rows, _misfit(file.schema_arrow, table)
    except FileNotFoundError:
        return 0, None
    except (pa.ArrowException, OSError, ValueError) as error:
        return 0, f"it is no readable Parquet file: {' '.join(str(error).split())[:200]}"


def _misfit(found: pa.Schema, table: TableName) -> str | None:
    """Return why columns are not those of a table, if so; one added later, which may be null, may be missing."""
    for column in SCHEMAS[table]:
        if column.name not in found.names:
            if column.nullable:
                continue
            return f"it lacks the column {column.name}"
        other = found.field(column.name)
        if other.type != column.type or (other.nullable and not column.nullable):
            return f"its column {column.name} is {_type(other)}, not {_type(column)}"
    foreign: Sequence[str] = [name for name in found.names if name not in SCHEMAS[table].names]
    return f"it has a column {foreign[0]!r}, which the table has not" if foreign else None


def _type(column: pa.Field) -> str:
    return f"{column.type}{'' if column.nullable else ' not null'}"


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
