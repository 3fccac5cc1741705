"""What is killed: each job of the store, the project it starts from, and what must hold before and after a restart."""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

from crash_points import Ack

CONFIG = """
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground floor"
[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"
[[camera]]
id = "cam-2"
name = "Exit"
floor = "ground"
"""
START = datetime(2026, 11, 9, 9, 50, tzinfo=UTC)
DAYS = (date(2026, 11, 9), date(2026, 11, 10))
CAMERAS, TRACKS = ("cam-1", "cam-2"), tuple("12345")
BAD = '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"x_m":"near"}]}'
NOW = "2026-11-20T00:00:00Z"
HIDDEN = {".lock", ".purge.lock", ".ballast"}
"""Locks and ballast, which stay."""

Row = tuple[Any, ...]


def _nothing_more(root: Path) -> None:
    pass


@dataclass(frozen=True)
class Job:
    """A job, the project it starts from, and what ends it when it is only a part of a run."""

    name: str
    prepare: Callable[[Path], None]
    act: Callable[[Path, Ack], Any]
    finish: Callable[[Path], None] = _nothing_more
    is_named_alike: bool = True


def messages(first: datetime, n_frames: int, *, with_pairs: bool = False) -> list[str]:
    """Return frame messages of both cameras, one a minute; three people walk past each other."""
    lines = []
    for i in range(n_frames):
        for k, camera in enumerate(CAMERAS):
            ts = (first + timedelta(minutes=i)).isoformat()
            i_m = (first - START) // timedelta(minutes=1) + i
            persons = [{"id": t, "x_m": 0.5 * j + 0.01 * i_m, "y_m": 1.0 + k} for j, t in enumerate(TRACKS[k : k + 3])]
            message = {"v": 1, "camera": camera, "ts": ts, "persons": persons}
            if with_pairs and camera == "cam-2":
                message["pairs"] = [{"a": TRACKS[1], "b": TRACKS[2], "distance_m": 0.5}]
            lines.append(json.dumps(message))
    return lines


def write_project(root: Path) -> None:
    root.mkdir(parents=True)
    (root / "vsd.toml").write_text(CONFIG)
    given = root.parent / "given"
    given.mkdir(exist_ok=True)
    (given / "first.jsonl").write_text("\n".join(messages(START, 20)))
    late = messages(START + timedelta(minutes=10), 12) + messages(START + timedelta(days=1), 2, with_pairs=True)
    (given / "second.jsonl").write_text("\n".join([*late, BAD]))


def vsd(root: Path, *arguments: str, ack: Ack = lambda value: None) -> str:
    """Run a command; its exit code must be 0, or 1 with a warning, else OSError with the message people see.

    Raises:
        RuntimeError: The message was not meant for people.
    """
    from vsd_analytics.cli import cli
    from vsd_analytics.cli.shared import run
    from vsd_analytics.store import Store

    append = Store.append

    def append_and_tell(self: Store, table: Any, rows: Any, **options: Any) -> int:
        n_rows = append(self, table, rows, **options)
        ack(("rows", table, as_rows(rows)))
        return n_rows

    out, err = io.StringIO(), io.StringIO()
    Store.append = append_and_tell  # type: ignore[method-assign]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run(cli, ["-C", str(root), "--now", NOW, *arguments])
    finally:
        Store.append = append  # type: ignore[method-assign]
    if code > 1:
        text = err.getvalue()
        raise (OSError if code == 2 and re.search(r"error\[E(?!900)", text) else RuntimeError)(text)
    return out.getvalue()


def as_rows(table: Any) -> list[Row]:
    return [tuple(row.values()) for row in table.to_pylist()]


def _given(root: Path, name: str) -> Path:
    return root.parent / "given" / name


def tables(root: Path, file: Path) -> Iterator[tuple[Any, Any]]:
    """Return the rows that `vsd ingest` makes of a file."""
    from vsd_analytics.config import load_site
    from vsd_analytics.ingest.adapter import IngestOptions, Source
    from vsd_analytics.ingest.frames import Frames
    from vsd_analytics.ingest.normalise import Normaliser
    from vsd_analytics.ingest.pipeline import with_site

    site = load_site(root, environ={})
    normaliser = Normaliser(site, now=datetime.fromisoformat(NOW), keys=None)
    options = with_site(site, IngestOptions())
    for batch in Frames().read(Source(file), options):
        yield from ((t, rows) for t, rows in normaliser.normalise(batch).tables.items() if rows.num_rows)


def _store(root: Path) -> Any:
    from vsd_analytics.store import Store

    return Store(root / "store", site_id="shop")


def append(root: Path, ack: Ack, *, file: Path) -> None:
    """Append the rows of a file, as they are without pseudonyms."""
    store = _store(root)
    for table, rows in tables(root, file):
        store.append(table, rows)
        ack(("rows", table, as_rows(rows)))


def _append(root: Path, ack: Ack) -> None:
    append(root, ack, file=_given(root, "second.jsonl"))


def _fold(root: Path, ack: Ack = lambda value: None) -> None:
    _store(root).fold()


def _half_folded(root: Path) -> None:
    write_project(root)
    append(root, lambda value: None, file=_given(root, "first.jsonl"))
    _fold(root)
    _append(root, lambda value: None)


def _with_stale_facts(root: Path) -> None:
    write_project(root)
    vsd(root, "ingest", str(_given(root, "first.jsonl")))
    vsd(root, "build")
    vsd(root, "ingest", str(_given(root, "second.jsonl")))


def _with_first(root: Path) -> None:
    write_project(root)
    vsd(root, "ingest", str(_given(root, "first.jsonl")))


def make_keys(root: Path, ack: Ack) -> None:
    from vsd_analytics.store.secrets import DayKeys

    for day in DAYS:
        ack(("key", f"{day.isoformat()}.key", DayKeys(root / "secrets").key(day).hex()))


def fill_quarantine(root: Path, ack: Ack) -> None:
    from vsd_analytics.ingest.adapter import Rejected
    from vsd_analytics.ingest.quarantine import Quarantine

    for source in ("a.jsonl", "b.jsonl"):
        quarantine = Quarantine(root / "quarantine", source=source)
        quarantine.add([Rejected("bad-json", line, "", f"text {line}") for line in range(3)])
        quarantine.flush()
        ack(("lines", source, [f"text {line}" for line in range(3)]))


def _build(root: Path, ack: Ack) -> str:
    return vsd(root, "build", ack=ack)


def _with_facts(root: Path) -> None:
    _with_stale_facts(root)
    vsd(root, "build")


def _purge_by_age(root: Path, ack: Ack) -> str:
    return vsd(root, "purge", "--older-than", "2026-11-10", "--force", ack=ack)


def _purge_by_camera(root: Path, ack: Ack) -> str:
    return vsd(root, "purge", "--camera", "cam-1", "--range", "2026-11-09T11:05..2026-11-10", ack=ack)


def _ingest(root: Path, ack: Ack) -> str:
    return vsd(root, "ingest", str(_given(root, "second.jsonl")), ack=ack)


JOBS = {
    job.name: job
    for job in (
        Job("append", write_project, _append, finish=_fold),
        Job("fold", _half_folded, _fold),
        Job("build", _with_stale_facts, _build),
        Job("day keys", write_project, make_keys),
        Job("quarantine", write_project, fill_quarantine),
        Job("purge by age", _with_stale_facts, _purge_by_age),
        Job("purge by camera", _with_facts, _purge_by_camera),
        Job("vsd ingest", _with_first, _ingest, is_named_alike=False),  # a new day's key is random
    )
}


@dataclass(frozen=True)
class State:
    """All that a project holds.

    Attributes:
        rows: Rows in parts, by table, with the engine's track ids.
        parts: Their names.
        facts: Rows of facts, by fact and hour.
        keys: Day keys.
        quarantined: Quarantined texts by source.
        sealed: Hash of each sealed file, and the audit lines of purges.
        litter: Files that no reader and no later run needs.
    """

    rows: dict[str, Counter[Row]]
    parts: list[str]
    facts: dict[str, Any]
    keys: dict[str, str]
    quarantined: Counter[tuple[str, str]]
    sealed: dict[str, str]
    litter: list[str]


def state(root: Path) -> State:
    import pyarrow.parquet as pq

    from vsd_analytics.schema import TABLES

    facts: dict[str, list[Path]] = {}
    for path in sorted((root / "facts").rglob("??-*.parquet")):
        facts.setdefault(f"{path.relative_to(root / 'facts').parent}/{path.name[:2]}", []).append(path)
    litter = [p for p in root.rglob(".*") if p.name not in HIDDEN]
    litter += (root / "store" / "live").rglob("*.parquet")
    litter += [p for paths in facts.values() if len(paths) > 1 for p in paths]
    return State(
        {t: Counter(_glob(root, t)) for t in TABLES},
        sorted(str(p.relative_to(root)) for t in TABLES for p in (root / "store" / t).rglob("*.parquet")),
        {hour: pq.ParquetFile(paths[0]).read().to_pylist() for hour, paths in facts.items()},
        _day_keys(root),
        Counter(_quarantined(root)),
        {str(p.relative_to(root)): p.read_bytes().hex() for p in _kept_by_purges(root)},
        sorted(str(p.relative_to(root)) for p in litter),
    )


def glance(root: Path, truth: dict[str, set[Row]], acked: Sequence[Any], *, are_facts_read: bool = True) -> list[str]:
    """Return what is wrong with a project as a kill left it, read as anybody would and before anything mends it.

    Args:
        root: The project.
        truth: All rows there may be, by table.
        acked: What must be there.
        are_facts_read: Read all facts as well, which fails on a torn one.
    """
    import pyarrow.parquet as pq

    from vsd_analytics.schema import TABLES

    is_under_way = any((root / "store" / "purge").glob("*.json"))  # its next step names the part by its bytes
    wrong = [] if is_under_way else [f"{p} is damaged" for p in _store(root).damaged()]
    held: dict[str, set[Row]] = {}
    for table in TABLES:
        rows = Counter(_glob(root, table))
        wrong += [f"{table} shows a record twice"] * (max(rows.values(), default=0) > 1)
        wrong += [f"{table} shows a foreign record"] * (not rows.keys() <= truth[table])
        spool = (root / "store" / "live" / table).glob("*.parquet")
        spooled = [row for p in spool for row in as_rows(pq.ParquetFile(p).read())]
        held[table] = {*rows, *engine_tracks(root, table, spooled)}
    for path in (root / "facts").rglob("*.parquet") if are_facts_read else ():
        pq.ParquetFile(path).read()
    for kind, name, value in acked:
        if kind == "rows":
            is_there = set(engine_tracks(root, name, value)) <= held[name]
        elif kind == "key":
            is_there = _day_keys(root).get(name) == value
        else:
            is_there = {(name, text) for text in value} <= set(_quarantined(root))
        wrong += [f"acknowledged {kind} of {name} are lost"] * (not is_there)
    return wrong


def differences(job: Job, found: State, whole: State) -> list[str]:
    """Return how a project that was run again differs from one whose job was never stopped."""
    wrong = [f"litter: {path}" for path in found.litter]
    wrong += [f"rows of {t} differ" for t in whole.rows if found.rows[t] != whole.rows[t]]
    wrong += ["names of parts differ"] * (job.is_named_alike and found.parts != whole.parts)
    wrong += ["facts differ"] * (job.is_named_alike and found.facts != whole.facts)
    wrong += ["days with a key differ"] * (found.keys.keys() != whole.keys.keys())
    wrong += ["what purges keep differs"] * (found.sealed != whole.sealed)
    wrong += ["quarantine differs"] * (found.quarantined != whole.quarantined)
    return wrong


def _glob(root: Path, table: str) -> list[Row]:
    """Return a table's rows by the glob in the documentation."""
    from vsd_analytics.duck import connect
    from vsd_analytics.schema import SCHEMAS

    pattern = root / "store" / table / "**" / "*.parquet"
    if not any((root / "store" / table).rglob("*.parquet")):
        return []
    with connect() as con:
        names = ", ".join(SCHEMAS[table].names)  # type: ignore[index]
        query = f"select {names} from read_parquet($glob, hive_partitioning = true, union_by_name = true)"
        return engine_tracks(root, table, as_rows(con.sql(query, params={"glob": str(pattern)}).to_arrow_table()))


def engine_tracks(root: Path, table: str, rows: Sequence[Row]) -> list[Row]:
    """Return rows with pseudonyms replaced by what the keys on the disk say they stand for."""
    from vsd_analytics.store.secrets import pseudonym

    keys = [bytes.fromhex(k) for k in _day_keys(root).values()]
    told = {pseudonym(k, camera_id=c, engine_track=t): t for k in keys for c in CAMERAS for t in TRACKS}
    if table != "pairs":
        return [tuple(told.get(v, v) if isinstance(v, str) else v for v in row) for row in rows]
    return [(*row[:2], frozenset(told.get(v, v) for v in row[4:6]), *row[10:]) for row in rows]  # a, b: by pseudonym


def _day_keys(root: Path) -> dict[str, str]:
    return {p.name: p.read_bytes().hex() for p in (root / "secrets").glob("*.key")}


def _kept_by_purges(root: Path) -> list[Path]:
    return [p for p in ((root / "sealed").rglob("*"), root.glob("purge.jsonl")) for p in p if p.is_file()]


def _quarantined(root: Path) -> list[tuple[str, str]]:
    lines = [line for p in (root / "quarantine").glob("*.jsonl") for line in p.read_text().splitlines()]
    return [(Path(r["source"]).name, r["text"]) for r in map(json.loads, lines)]
