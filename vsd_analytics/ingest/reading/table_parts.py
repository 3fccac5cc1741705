"""Folders and archives of tables: each file is a part; columns may be in folder names (`camera_id=cam-1/`)."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import unquote

import pyarrow as pa

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import Source
from vsd_analytics.ingest.reading.archive import archive_kind, members
from vsd_analytics.ingest.reading.table_file import Chunk, Header, TableFile

_SUFFIX = r"\.(?:csv|tsv|parquet|feather|arrow)"
_FRONT = r"^(?!.*__MACOSX/)(?:.*/)?[^/._~][^/]*"
PARTS = re.compile(rf"{_FRONT}{_SUFFIX}(?:\.(?:gz|bz2|zst))?$", re.IGNORECASE)
"""Names of tables; those that begin with a dot or underscore are notes of programs."""
_OTHER_DATA = re.compile(
    rf"{_FRONT}\.(?:csv|tsv|parquet|jsonl?|ndjson|xlsx?|ods|xml|txt|dat|db|sqlite3?|zip|7z|rar|tar|tgz|h5|npz?)(?:\.\w+)?$",
    re.IGNORECASE,
)
_NOTES = re.compile(r"(?:^|/)(?:read.?me|licen[sc]e|notes?|change.?log|leggimi|lies.?mich)[^/]*$", re.IGNORECASE)
PARTS_MAX = 10_000
_NULL = "__HIVE_DEFAULT_PARTITION__"
"""Folder of the rows whose column is missing."""
_FOLDER = re.compile(r"([A-Za-z_][\w ]*)=([^/]*)")


@dataclass(frozen=True, slots=True)
class TablePart:
    """One table of a folder or archive.

    Attributes:
        source: The file.
        name: Its path inside, with forward slashes.
        constants: Columns that its folders' names give.
    """

    source: Source
    name: str
    constants: Mapping[str, str] = field(default_factory=dict)


def has_parts(source: Source) -> bool:
    """Return whether a folder or archive holds tables; False for a damaged archive and for anything else."""
    if archive_kind(source) is None:
        return False
    try:
        with members(source, wanted=PARTS) as files:
            return any(True for _ in files)
    except InputError:
        return False


def unread_of(source: Source) -> list[str]:
    """Return the files of a folder or zip that hold data by their names, and are no part: such as `b.xlsx`."""
    kind = archive_kind(source)
    if kind not in ("folder", "zip"):
        return []
    with members(source, wanted=_OTHER_DATA) as files:
        return [m.name for m in files if not PARTS.search(m.name) and not _NOTES.search(m.name)]


@contextmanager
def parts_of(source: Source) -> Iterator[list[TablePart]]:
    """Yield the tables of a folder or archive in order of their names; those of an archive are unpacked meanwhile.

    Names inside an archive are only shown: its files are unpacked under numbers.

    Raises:
        InputError: E204 there is none, or too many; E205, E206 the archive is damaged or unpacks to too much.
    """
    if source.path.is_dir():
        names = sorted(p.relative_to(source.path).as_posix() for p in source.path.rglob("*") if p.is_file())
        wanted = [name for name in names if PARTS.search(name)]
        _check_number(source, len(wanted))
        yield [_part(Source(source.path / name, settings=source.settings), name) for name in wanted]
        return
    with tempfile.TemporaryDirectory(prefix="vsd-unpacked-") as folder:
        parts = []
        with members(source, wanted=PARTS) as files:
            for number, member in enumerate(files, start=1):
                _check_number(source, number)
                path = Path(folder) / f"{number:06d}"
                with member.open() as packed, path.open("wb") as unpacked:
                    shutil.copyfileobj(packed, unpacked, 1 << 20)
                shown = Source(path, settings=source.settings, shown=f"{source.name}/{member.name}")
                parts.append(_part(shown, member.name))
        _check_number(source, len(parts))
        yield sorted(parts, key=lambda part: part.name)


def _part(source: Source, name: str) -> TablePart:
    matches = (_FOLDER.fullmatch(folder) for folder in name.split("/")[:-1])
    values = {match[1]: unquote(match[2]) for match in matches if match is not None}
    return TablePart(source, name, {column: "" if value == _NULL else value for column, value in values.items()})


def _check_number(source: Source, n_parts: int) -> None:
    if 0 < n_parts <= PARTS_MAX:
        return
    raise InputError(
        f"{source.file_name} has {n_parts:,} tables" if n_parts else f"{source.file_name} has no table",
        code="E204",
        where=Where(source.name),
        why=f"a folder or archive of tables has 1 to {PARTS_MAX:,} files such as a.csv or a.parquet",
        fix="name the files themselves",
    )


class PartWithConstants:
    """A table with more columns, each with one value.

    Args:
        file: The table.
        constants: Values by column; a column of the file itself goes before one of the same name.
    """

    first_line: str | None = None  # a line alone would lack the columns

    def __init__(self, file: TableFile, constants: Mapping[str, str]) -> None:
        file_names = {name.lower() for name in file.header.names}
        self._file = file
        self._constants = {name: value for name, value in constants.items() if name.lower() not in file_names}
        self._n_own = len(file.header.names)
        self.header: Header = replace(file.header, names=[*file.header.names, *self._constants])
        self.has_decimal_comma = file.has_decimal_comma

    def chunks(self, wanted: Mapping[str, int]) -> Iterator[Chunk]:
        """Read columns; see `TableFile.chunks`."""
        values = list(self._constants.values())
        for chunk in self._file.chunks({ours: i for ours, i in wanted.items() if i < self._n_own}):
            more = {
                ours: pa.repeat(pa.scalar(values[i - self._n_own], pa.string()), len(chunk.lines))
                for ours, i in wanted.items()
                if i >= self._n_own
            }
            yield replace(chunk, columns={**chunk.columns, **more}, whole=None)

    def readable(self) -> AbstractContextManager[None]:
        """Return that of the file."""
        return self._file.readable()

    def has_text(self, column: int) -> bool:
        """Return whether a column holds texts."""
        return column >= self._n_own or self._file.has_text(column)

    def can_read(self, column: int) -> bool:
        """Return whether a column is of a type that can be read."""
        return column >= self._n_own or self._file.can_read(column)
