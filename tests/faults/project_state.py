"""The state of a project as rows and files, so that a fault can be compared with a run that nothing disturbed."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import duckdb

CAMERAS, TRACKS = ("cam-1", "cam-2"), tuple("12345")
HIDDEN = {".lock", ".purge.lock", ".ballast"}
"""Locks and ballast, which stay."""
PAGES = ("reports", "operator")
LOG = "log.jsonl"
N_TOLD = 3
SEVERAL = b"several"
"""Represents the bytes of a unit of facts that has several files; they are litter."""

Row = tuple[Any, ...]


@dataclass(frozen=True)
class State:
    """All that a project holds.

    Attributes:
        rows: Rows in parts, by table, with the engine's track ids.
        parts: Their names.
        facts: Bytes of the files of facts and of stored marts, by relation and day or week.
        keys: Day keys.
        quarantined: Quarantined texts by source.
        sealed: Bytes of each sealed file, the audit lines of purges, and the list of erasures.
        log: Lines of the change log, in order.
        counts: Bytes of each file of a door counter.
        pages: Bytes of what was written for people.
        litter: Files that no reader and no later run needs.
    """

    rows: dict[str, Counter[Row]]
    parts: list[str]
    facts: dict[str, bytes]
    keys: dict[str, str]
    quarantined: Counter[tuple[str, str]]
    sealed: dict[str, bytes]
    log: list[str]
    counts: dict[str, bytes]
    pages: dict[str, bytes]
    litter: list[str]


@dataclass(frozen=True)
class Truth:
    """All there may be: rows by table, lines of the change log, bytes of counts and of facts that can be read."""

    rows: dict[str, set[Row]]
    log: frozenset[str] = frozenset()
    readable: frozenset[bytes] = frozenset()
    counts: frozenset[bytes] = frozenset()

    @classmethod
    def of(cls, *states: State) -> Truth:
        """Return what some states hold together."""
        rows = {t: {row for s in states for row in s.rows[t]} for t in states[0].rows}
        log = frozenset(line for s in states for line in s.log)
        readable = frozenset(data for s in states for data in s.facts.values())
        return cls(rows, log, readable, frozenset(data for s in states for data in s.counts.values()))


def state(root: Path) -> State:
    """Return what a project holds."""
    from vsd_analytics.schema import TABLES

    facts: dict[str, list[Path]] = {}
    for path in _facts(root):
        facts.setdefault(f"{path.relative_to(root / 'facts').parent}/{path.name[:2]}", []).append(path)
    litter = [p for p in root.rglob(".*") if p.name not in HIDDEN]
    litter += (root / "store" / "live").rglob("[0-9a-f]*.*")
    litter += (root / "store" / "purge").glob("*.json")
    litter += [p for paths in facts.values() if len(paths) > 1 for p in paths]
    return State(
        {t: Counter(_glob(root, t)) for t in TABLES},
        sorted(str(p.relative_to(root)) for t in TABLES for p in (root / "store" / t).rglob("*.parquet")),
        {unit: paths[0].read_bytes() if len(paths) == 1 else SEVERAL for unit, paths in facts.items()},
        _day_keys(root),
        Counter(_quarantined(root)),
        {
            str(p.relative_to(root)): p.read_bytes()
            for p in _files(root / "sealed", root / "purge.jsonl", root / "store" / "erasures.json")
        },
        _log(root),
        counts_in(root),
        {p.name: p.read_bytes() for p in _files(*(root / name for name in PAGES))},
        sorted(str(p.relative_to(root)) for p in litter),
    )


def glance(root: Path, truth: Truth, acked: Sequence[Any], *, are_facts_read: bool = True) -> list[str]:
    """Return what is wrong with a project as a fault left it, read as anybody would and before anything repairs it.

    Args:
        root: The project.
        truth: All there may be.
        acked: What must be there.
        are_facts_read: Read all facts as well, which fails on a torn one.
    """
    import pyarrow.parquet as pq

    from vsd_analytics.schema import TABLES
    from vsd_analytics.store.segments import read_segment
    from vsd_analytics.store.store import Store

    is_under_way = any((root / "store" / "purge").glob("*.json"))  # its next step names the part by its bytes
    damaged = () if is_under_way else Store(root / "store", site_id="shop").damaged()
    wrong = [f"{p} is damaged" for p in damaged]
    held: dict[str, set[Row]] = {}
    for table in TABLES:
        rows = Counter(_glob(root, table))
        wrong += [f"{table} shows a record twice"] * (max(rows.values(), default=0) > 1)
        wrong += [f"{table} shows a foreign record"] * (not rows.keys() <= truth.rows[table])
        spool = (root / "store" / "live" / table).glob("[0-9a-f]*.*")
        spooled = [row for p in spool for row in as_rows(read_segment(p))]
        held[table] = {*rows, *engine_tracks(root, table, spooled)}
    for path in _facts(root) if are_facts_read else ():
        if path.read_bytes() not in truth.readable:
            pq.ParquetFile(path).read()
    log = Counter(_log(root))
    wrong += [f"the change log holds a torn or foreign line: {line[:60]}" for line in log.keys() - truth.log]
    wrong += ["the change log holds an entry twice"] * (max(log.values(), default=0) > 1)
    counts = counts_in(root)
    wrong += [f"{name} holds torn or foreign counts" for name, data in counts.items() if data not in truth.counts]
    newest = {name: value for kind, name, value in acked if kind == "counts"}  # a file is replaced as a whole
    wrong += [
        f"acknowledged counts of {name} are not as acknowledged" for name in newest if counts.get(name) != newest[name]
    ]
    pages = _files(*(root / name for name in PAGES))
    wrong += [f"{p.name} is cut off" for p in pages if not p.read_bytes().endswith((b"</html>\n", b"}\n"))]
    for kind, name, value in acked:
        if kind == "rows":
            is_there = set(engine_tracks(root, name, value)) <= held[name]
        elif kind == "key":
            is_there = _day_keys(root).get(name) == value
        elif kind == "entry":
            is_there = any(json.loads(line)["text"] == value for line in log if line in truth.log)
        elif kind == "counts":
            is_there = True  # looked at above
        else:
            is_there = {(name, text) for text in value} <= set(_quarantined(root))
        wrong += [f"acknowledged {kind} of {name} are lost"] * (not is_there)
    return wrong


def differences(found: State, whole: State, *, is_named_alike: bool) -> list[str]:
    """Return how a project that was run again differs from one whose job was never stopped.

    Args:
        found: It.
        whole: The other.
        is_named_alike: Both made the same keys, hence the same names and bytes.
    """
    wrong = [f"litter: {len(found.litter)} files, {', '.join(found.litter[:N_TOLD])}"] * bool(found.litter)
    wrong += [f"rows of {t} differ" for t in whole.rows if found.rows[t] != whole.rows[t]]
    if is_named_alike:
        wrong += ["names of parts differ"] * (found.parts != whole.parts)
        expected = {k: SEVERAL if found.facts.get(k) == SEVERAL else v for k, v in whole.facts.items()}
        wrong += [f"facts differ: {_unlike(found.facts, expected)}"] * (found.facts != expected)
    wrong += ["days with a key differ"] * (found.keys.keys() != whole.keys.keys())
    wrong += [f"what purges keep differs: {_unlike(found.sealed, whole.sealed)}"] * (found.sealed != whole.sealed)
    wrong += ["quarantine differs"] * (found.quarantined != whole.quarantined)
    wrong += [f"the change log differs: {len(found.log)} lines, not {len(whole.log)}"] * (found.log != whole.log)
    wrong += [f"counts differ: {_unlike(found.counts, whole.counts)}"] * (found.counts != whole.counts)
    wrong += [f"pages differ: {_unlike(found.pages, whole.pages)}"] * (found.pages != whole.pages)
    return wrong


def as_rows(table: Any) -> list[Row]:
    """Return the rows of an Arrow table, without the import that brings them, which the spool alone notes.

    A later column that a file lacks is null.
    """
    from vsd_analytics.schema import LATER
    from vsd_analytics.store.owners import OWNER

    rows = table.to_pylist()
    return [tuple(v for n, v in row.items() if n != OWNER and not (n in LATER and v is None)) for row in rows]


def engine_tracks(root: Path, table: str, rows: Sequence[Row]) -> list[Row]:
    """Return rows with pseudonyms replaced by what the keys on the disk say they stand for."""
    from vsd_analytics.store.secrets import namer

    keys = [bytes.fromhex(k) for k in _day_keys(root).values()]
    told = {namer(k, camera_id=c)(t): t for k in keys for c in CAMERAS for t in TRACKS}
    if table != "pairs":
        return [tuple(told.get(v, v) if isinstance(v, str) else v for v in row) for row in rows]
    return [(*row[:2], frozenset(told.get(v, v) for v in row[4:6]), *row[10:]) for row in rows]  # a, b: by pseudonym


def _glob(root: Path, table: str) -> list[Row]:
    """Return a table's rows by the glob in the documentation."""
    from vsd_analytics.schema import SCHEMAS

    pattern = root / "store" / table / "**" / "*.parquet"
    if not any((root / "store" / table).rglob("*.parquet")):
        return []
    files = "read_parquet($glob, hive_partitioning = true, union_by_name = true)"
    there = _reader().sql(f"from {files} limit 0", params={"glob": str(pattern)}).columns
    names = ", ".join(name for name in SCHEMAS[table].names if name in there)  # type: ignore[index]
    query = f"select {names} from {files}"
    return engine_tracks(root, table, as_rows(_reader().sql(query, params={"glob": str(pattern)}).to_arrow_table()))


@cache
def _reader() -> duckdb.DuckDBPyConnection:
    """Return a connection that reads files and holds nothing of them: opening one takes longer than most tables."""
    from vsd_analytics.store.duck import connect

    return connect()


def _day_keys(root: Path) -> dict[str, str]:
    return {p.name: p.read_bytes().hex() for p in (root / "secrets").glob("*.key")}


def _files(*roots: Path) -> list[Path]:
    return [p for root in roots for p in (root, *root.rglob("*")) if p.is_file() and not p.name.startswith(".")]


def _facts(root: Path) -> list[Path]:
    return sorted(p for p in (root / "facts").rglob("*.parquet") if not p.name.startswith("."))


def _log(root: Path) -> list[str]:
    path = root / LOG
    return path.read_text(errors="replace").splitlines() if path.exists() else []


def counts_in(root: Path) -> dict[str, bytes]:
    """Return the bytes of each file of a door counter, by name."""
    return {p.name: p.read_bytes() for p in _files(root / "counts")}


def _quarantined(root: Path) -> list[tuple[str, str]]:
    lines = [line for p in (root / "quarantine").glob("*.jsonl") for line in p.read_text().splitlines()]
    return [(Path(r["source"]).name, r["text"]) for r in map(json.loads, lines)]


def _unlike(found: dict[str, Any], whole: dict[str, Any]) -> str:
    names: Iterable[str] = sorted(k for k in {*found, *whole} if found.get(k) != whole.get(k))
    return ", ".join([*names][:N_TOLD])
