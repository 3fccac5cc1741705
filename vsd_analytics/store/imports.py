"""The list of imports: which file came when, and what of it is stored.

`store/imports.jsonl` has a line for each time a file was imported, and one when an import was taken back. What an
import holds is not in the list: the parts say it (`store.owners`), so that the list can never contradict the store. A
line that a crash cut off loses the name of a file, and no record.
"""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import pyarrow.parquet as pq

from vsd_analytics.errors import disk_error
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.owners import brought_by

if TYPE_CHECKING:
    from vsd_analytics.store.store import Store

FILE = "imports.jsonl"
LARGEST_SHARE = 0.5
"""Share of the stored days or records that a purge may remove without `--force`. More is usually a typing error."""


class ImportLine(msgspec.Struct, frozen=True, omit_defaults=True, kw_only=True):
    """One line of the list.

    Attributes:
        id: The import: a hash of the file's content and of how it was read. The same file again is the same import.
        at: When (UTC).
        run: Number of the command; imports of one command have the same, later commands a higher one.
        source: Name of the file as given.
        format: Adapter that read it.
        is_taken_back: The line says that the import was taken back.
        content: A hash of the file's bytes; "" in lines of earlier versions.
        reading: A hash of how it was read: columns, units, clock.
        node: Node that read it; "" = this project.
        landmarks: A few of its first records (`ingest.intake.second_delivery`); "" in lines of earlier versions.
    """

    id: str
    at: datetime
    run: int = 0
    source: str = ""
    format: str = ""
    is_taken_back: bool = False
    content: str = ""
    reading: str = ""
    node: str = ""
    landmarks: str = ""


@dataclass
class Holding:
    """What is stored of one import.

    Attributes:
        n_records: Records by table that belong to it: it brought them first.
        n_again: Records that it brought and that belong to another import or a broker.
        hours: UTC hour numbers of the records that belong to it.
        cameras: Their cameras.
    """

    n_records: Counter[TableName] = field(default_factory=Counter)
    n_again: int = 0
    hours: set[int] = field(default_factory=set)
    cameras: set[str] = field(default_factory=set)


def next_run(store: Path) -> int:
    """Return the number of a new command: the length of the list, which only grows."""
    with contextlib.suppress(OSError):
        return (store / FILE).stat().st_size
    return 0


def note_import(store: Path, line: ImportLine) -> None:
    """Append a line to the list. It is not synced: a lost line loses the name of a file, and no record.

    Raises:
        DiskError: E304 to E306, the disk refused.
    """
    path = store / FILE
    try:
        durable.make_dirs(store)
        with path.open("ab") as file:
            os.fchmod(file.fileno(), 0o600)
            cut_off = b"" if not file.tell() or _ends_whole(path) else b"\n"
            file.write(cut_off + msgspec.json.encode(line) + b"\n")
    except OSError as error:
        raise disk_error(error, path=path) or error from None


def imports_of(store: Path) -> dict[str, ImportLine]:
    """Return the imports by id in the order in which they came, each with the line of its first time.

    The line of an import that was taken back, and did not come again, says so.
    """
    imports: dict[str, ImportLine] = {}
    decoder = msgspec.json.Decoder(ImportLine)
    try:
        lines = (store / FILE).read_bytes().splitlines()
    except FileNotFoundError:
        return imports
    for text in lines:
        try:
            line = decoder.decode(text)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            continue
        known = imports.get(line.id)
        if line.is_taken_back:
            if known is not None:
                imports[line.id] = msgspec.structs.replace(known, is_taken_back=True)
        elif known is None or known.is_taken_back:
            imports.pop(line.id, None)
            imports[line.id] = line
    return imports


def holdings(store: Store) -> dict[str, Holding]:
    """Return what is stored of each import by id, from the metadata of the parts."""
    held: dict[str, Holding] = {}
    for table in TABLES:
        for part in store.parts(table):
            for import_id, owned in brought_by(part.path).items():
                holding = held.setdefault(import_id, Holding())
                holding.n_records[table] += owned.n_rows
                holding.hours.add(part.hour)
                holding.cameras.update(owned.cameras)
        for part in store.repeats(table):
            for import_id, owned in brought_by(part.path).items():
                held.setdefault(import_id, Holding()).n_again += owned.n_rows
    return held


def purge_command(store: Store, import_id: str) -> str:
    """Return the command that takes an import back, with `--force` where it brought more than half of the records."""
    held = holdings(store).get(import_id, Holding())
    n_stored = sum(pq.read_metadata(part.path).num_rows for table in TABLES for part in store.parts(table))
    is_most = sum(held.n_records.values()) > LARGEST_SHARE * n_stored
    return f"vsd purge --import {import_id}{' --force' if is_most else ''}"


def order_of(listed: Mapping[str, ImportLine]) -> dict[str, int]:
    """Return the number of each import's command; a broker ("") comes first."""
    return {"": -1, **{i: line.run for i, line in listed.items()}}


def note_taken_back(store: Path, import_id: str, *, at: str) -> None:
    """Note that an import was taken back; a second line does no harm."""
    note_import(store, ImportLine(id=import_id, at=datetime.fromisoformat(at).astimezone(UTC), is_taken_back=True))


def _ends_whole(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
