"""`vsd export`: stored records of a place and time in a file, to answer a request or to use elsewhere."""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import IO, Any, Final

import msgspec
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.intake.quarantine_scope import quarantined_in_scope
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable
from vsd_analytics.store.erasures import RecordScope
from vsd_analytics.store.layout import HOUR_MS, Part
from vsd_analytics.store.part_files import engines_of, read_part
from vsd_analytics.store.removal import reading
from vsd_analytics.store.spreadsheet import safe_cell
from vsd_analytics.store.store import Store

KINDS: Final = (".parquet", ".csv", ".jsonl")


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written.

    Attributes:
        records: Number of records by table.
        n_unframed: Instants with records but no frame record: as messages they have one when they are read again.
        n_left_out: Pairs of persons without track ids, which frame messages cannot express.
        n_quarantined: Quarantined records that are, or may be, of the camera and time.
        n_doubtful: Those of n_quarantined whose camera or time cannot be read.
        quarantine: The file of quarantined records, beside the other file; None = there are none.
    """

    records: Mapping[TableName, int] = field(default_factory=dict)
    n_unframed: int = 0
    n_left_out: int = 0
    n_quarantined: int = 0
    n_doubtful: int = 0
    quarantine: Path | None = None


def export(site: Site, which: RecordScope, *, out: Path, table: TableName | None = None) -> Exported:
    """Write stored records to a file, whole or not at all, readable by its owner only.

    Tables (`.parquet`, `.csv`) have the stored columns, and positions and distances in metres too. JSON Lines are VSD
    frame messages, which `vsd ingest` reads; with pseudonyms on, their ids are pseudonyms. In CSV, a text that a
    spreadsheet would run as a formula gets an apostrophe before it. Quarantined records (`ingest.quarantine_scope`
    decides which) go unchanged to a file of their own beside `out`, which replaces that of an earlier export.

    Args:
        site: The project.
        which: Camera (or all) and time.
        out: The file; its suffix is its format.
        table: Which table; None = all three, as frame messages.

    Raises:
        UsageError: E101, the suffix is unknown, or does not go with the table.
        StoreError: E302, a part is damaged.
        OSError: The file cannot be written.
    """
    if out.suffix not in KINDS:
        raise UsageError(f"--out {out.name}: unknown format", why=f"known: {', '.join(KINDS)}")
    if (out.suffix == ".jsonl") != (table is None):
        raise UsageError(
            "a table goes to .csv or .parquet, all tables together to .jsonl",
            fix="--table observations --out FILE.parquet, or --out FILE.jsonl",
        )
    store = Store(site.root / "store", site_id=site.site_id)
    if store.n_spooled():
        store.fold()
    with reading(store.root), store.reporting_damage(), _published(out) as path:
        if table is None:
            with path.open("wb") as file:
                done = _write_messages(store, which, file)
        else:
            done = _write_table(store, which, path, table, kind=out.suffix)
        in_quarantine = quarantined_in_scope(site, which)
        beside = out.with_suffix(".quarantine.jsonl")
        if not in_quarantine.lines:
            durable.remove(beside)
            return done
        durable.publish(beside, b"".join(line + b"\n" for line in in_quarantine.lines), is_private=True)
        n_lines, n_doubtful = len(in_quarantine.lines), in_quarantine.n_doubtful
        return replace(done, n_quarantined=n_lines, n_doubtful=n_doubtful, quarantine=beside)


def with_metres(rows: pa.Table) -> pa.Table:
    """Return stored rows with one more column in metres for each column in millimetres."""
    for name in [c for c in rows.column_names if c.endswith("_mm")]:
        metres = pc.divide(rows[name].cast(pa.float64()), 1000.0)
        rows = rows.append_column(f"{name.removesuffix('_mm')}_m", metres)
    return rows


def messages(tables: Mapping[TableName, pa.Table], *, engine: str | None = None) -> Iterator[dict[str, Any]]:
    """Yield the VSD frame messages of stored rows, by camera, instant and quality.

    Args:
        tables: Rows of the three tables, `with_metres`.
        engine: Engine name and version, if known.
    """
    persons, pairs = _grouped(tables["observations"], "person"), _grouped(tables["pairs"], "person_a")
    frames: dict[_Frame, dict[str, Any]] = {}
    for row in tables["frames"].to_pylist():
        frames[row["camera_id"], row["ts"]] = row
    for key in sorted({*frames, *persons, *pairs}):
        of_quality: dict[str, tuple[list[_Row], list[_Row]]] = {}
        for i, parts in enumerate((persons, pairs)):
            for row in parts.get(key, ()):
                of_quality.setdefault(row["quality"], ([], []))[i].append(row)
        for quality, (people, sent) in sorted(of_quality.items()) or [("metric", ([], []))]:
            yield _message(key, quality, frames.get(key), people, sent, engine)


_Row = dict[str, Any]
_Frame = tuple[str, datetime]


def _message(
    key: _Frame, quality: str, frame: _Row | None, people: list[_Row], sent: list[_Row], engine: str | None
) -> dict[str, Any]:
    message: dict[str, Any] = {"v": 1, "camera": key[0], "ts": key[1]}
    if frame is not None and frame["seq"] is not None:
        message["seq"] = frame["seq"]
    if engine is not None:
        message["engine"] = engine
    message["quality"] = quality
    if people or (frame is not None and frame["n_persons"] is not None):
        message["persons"] = [_person(row) for row in people]
    if sent or (frame is not None and frame["n_pairs"] is not None):
        message["pairs"] = [
            {n: row[c] for n, c in _PAIR.items() if row[c] is not None} for row in sent if _has_ids(row)
        ]
    return message


_PERSON = {"id": "track_id", "x_m": "x_m", "y_m": "y_m", "u_px": "u_px", "v_px": "v_px"}
_PAIR = {"a": "track_a", "b": "track_b", "distance_m": "distance_m", "sd_m": "distance_sd_m"}


def _person(row: _Row) -> dict[str, Any]:
    person = {n: row[c] for n, c in _PERSON.items() if row[c] is not None}
    return person | {"tag": "staff"} if row["is_staff"] else person


def _has_ids(pair: _Row) -> bool:
    return pair["track_a"] is not None and pair["track_b"] is not None


def _grouped(rows: pa.Table, order: str) -> dict[_Frame, list[_Row]]:
    groups: dict[_Frame, list[_Row]] = {}
    for row in rows.sort_by([("camera_id", "ascending"), ("ts", "ascending"), (order, "ascending")]).to_pylist():
        groups.setdefault((row["camera_id"], row["ts"]), []).append(row)
    return groups


def _write_table(store: Store, which: RecordScope, path: Path, table: TableName, *, kind: str) -> Exported:
    n_rows = 0
    with _writer(path, table, kind=kind) as write:
        for _, parts in _hours(store, which, (table,)):
            rows = _rows(parts[table], table, which)
            write(with_metres(rows))
            n_rows += rows.num_rows
    return Exported({table: n_rows})


def _write_messages(store: Store, which: RecordScope, file: IO[bytes]) -> Exported:
    encoder = msgspec.json.Encoder()
    records: Counter[TableName] = Counter()
    n_unframed = n_left_out = 0
    for _, parts in _hours(store, which, TABLES):
        tables = {t: with_metres(_rows(parts[t], t, which)) for t in TABLES}
        engines = sorted({e for table_parts in parts.values() for p in table_parts for e in engines_of(p.path)})
        records.update({t: rows.num_rows for t, rows in tables.items()})
        framed = set(zip(tables["frames"]["camera_id"].to_pylist(), tables["frames"]["ts"].to_pylist(), strict=True))
        seen: set[_Frame] = set()
        for message in messages(tables, engine=engines[0] if len(engines) == 1 else None):
            seen.add((message["camera"], message["ts"]))
            file.write(encoder.encode(message) + b"\n")
        n_unframed += len(seen - framed)
        n_left_out += sum(not _has_ids(row) for row in tables["pairs"].select(["track_a", "track_b"]).to_pylist())
    return Exported(dict(records), n_unframed, n_left_out)


def _hours(
    store: Store, which: RecordScope, tables: Iterable[TableName]
) -> Iterator[tuple[int, dict[TableName, list[Part]]]]:
    """Yield each UTC hour of the range with its parts by table."""
    hours: dict[int, dict[TableName, list[Part]]] = {}
    for table in tables:
        last_hour = (which.after_ms - 1) // HOUR_MS
        for part in store.parts(table, first_hour=which.first_ms // HOUR_MS, last_hour=last_hour):
            hours.setdefault(part.hour, {t: [] for t in tables})[table].append(part)
    yield from sorted(hours.items())


def _rows(parts: Iterable[Part], table: TableName, which: RecordScope) -> pa.Table:
    """Return the records of one hour's parts that `which` selects, in order of time and camera."""
    rows = [read_part(p.path, table) for p in parts]
    every = pa.concat_tables([SCHEMAS[table].empty_table(), *(r.filter(which.mask(r)) for r in rows)])
    return every.sort_by([("ts", "ascending"), ("camera_id", "ascending")])


@contextlib.contextmanager
def _writer(path: Path, table: TableName, *, kind: str) -> Iterator[Callable[[pa.Table], None]]:
    schema = with_metres(SCHEMAS[table].empty_table()).schema
    if kind == ".parquet":
        with pq.ParquetWriter(path, schema, compression="zstd") as parquet:
            yield parquet.write_table
    else:
        with pyarrow.csv.CSVWriter(path, schema) as csv:
            yield lambda rows: csv.write_table(_without_formulas(rows))


def _without_formulas(rows: pa.Table) -> pa.Table:
    """Return rows in which no text starts as a spreadsheet formula does."""
    for i, column in enumerate(rows.schema):
        if pa.types.is_string(column.type):
            texts = rows[i].combine_chunks().dictionary_encode()
            safe = pa.array([safe_cell(t) for t in texts.dictionary.to_pylist()], pa.string())
            rows = rows.set_column(i, column, safe.take(texts.indices))
    return rows


@contextlib.contextmanager
def _published(out: Path) -> Iterator[Path]:
    """Yield a temporary file beside `out` to write to; rename it to `out`, durably, unless an error is raised.

    Removes temporary files of exports that were killed.
    """
    for temporary in (path for kind in KINDS for path in out.parent.glob(f".*{kind}.*.tmp")):
        if durable.is_abandoned(temporary):
            durable.remove(temporary)
    with durable.temporary(out, mode=0o600) as (temporary, file):
        yield temporary
        os.fsync(file.fileno())
        temporary.rename(out)
    durable.fsync_dir(out.parent)
