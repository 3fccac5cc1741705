"""Hostile names and files, each tried against a small project; every try says in a few words what came of it.

`python tests/hostile/hostile_tries.py` prints the tables of docs/security.md, and with `--check` compares them whole.
`test_hostile_names.py` compares every string and every place, but a twelfth of their combinations only.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from hostile_files import ARCHIVES, PATHS, PICTURES
from hostile_lab import HEAD, NOW, START, TS, Lab, message, new_lab, zipped

DOCS = Path(__file__).resolve().parents[2] / "docs" / "security.md"

STRINGS: Mapping[str, str] = {
    "path upward": "../../x",
    "path from the root": "/etc/passwd",
    "two levels": "a/b",
    "device name": "CON",
    "NUL": "a\x00b",
    "SQL, closing a text": "'); drop table frames; --",
    "SQL, dollar quotes": "$$; select 1; $x$",
    "format strings": "%s%n{}{0.__class__}%(x)s",
    "HTML element": "<script>alert(1)</script>",
    "HTML attribute": "\" onmouseover=alert(1) x='",
    "HTML entities": "&lt;b&gt;&#x41;&amp;",
    "end of style and comment": "</style>--><!--*/",
    "templates": "${7*7}{{7*7}}{% raw %}",
    "formula": "=cmd|' /C calc'!A0",
    "terminal colours": "\x1b[31mred\x1b]0;x\x07\x9b31m",
    "writing turned round": "\u202egnp.exe",
    "line breaks": "line\nbreak\r\nSet-Cookie: x",
    "lone surrogate": "\ud800x",
    "joined emoji": "👩‍👩‍👧‍👦",
    "blank": " ",
    "option": "--help",
    "10 kB": "x" * 10_000,
    "10 MB": "x" * 10_000_000,
}


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def _cells(*cells: str) -> bytes:
    quoted = ('"' + c.replace('"', '""') + '"' for c in cells)
    return _bytes(",".join(quoted) + "\n")


def _parquet(text: str) -> bytes:
    ids = pa.Array.from_buffers(pa.large_string(), 1, pa.array([_bytes(text)], pa.large_binary()).buffers())
    table = pa.table({"ts": [TS], "camera_id": ["cam-1"], "track_id": ids, "x_m": [1.0], "y_m": [2.0]})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    return bytes(sink.getvalue())


def _log(track: str) -> bytes:
    people = [{"bbox": [0.1, 0.2, 0.3, 0.6], "tracking_id": track}]
    head = "Version,Timestamp,DetectedObjects,ViolatingObjects,EnvironmentScore,Detections,ViolationsIndexes\n"
    return head.encode() + _cells("1.0", "2026-11-09 09:00:00", "1", "0", "0.9", repr(people), "[]")


def _as_mot(lab: Lab, text: str) -> str:
    try:
        data = zipped({f"{text[:60_000]}/gt/gt.txt": b"1,1,10,10,20,40,1,1,1,0\n"})
    except UnicodeEncodeError:
        return "–"
    return lab.ingest(lab.file("a.zip", data), *START)


def _as_wildtrack(lab: Lab, text: str) -> str:
    try:
        data = zipped({f"{text[:60_000]}/annotations_positions/00000000.json": b'[{"personID":1,"positionID":7}]'})
    except UnicodeEncodeError:
        return "–"
    return lab.ingest(lab.file("a.zip", data), *START, "--camera", "cam-1")


def _as_file(lab: Lab, text: str) -> str:
    try:
        path = lab.file(text + ".jsonl", message())
    except (OSError, ValueError):
        return "–"
    return lab.ingest(path)


def _as_payload(lab: Lab, text: str) -> str:
    from datetime import datetime

    from vsd_analytics.config.project import load_site
    from vsd_analytics.ingest.formats.frames import MessageRows
    from vsd_analytics.ingest.intake.normalise import Normaliser
    from vsd_analytics.ingest.reading.adapter import IngestOptions
    from vsd_analytics.store.secrets import DayKeys

    site = load_site(lab.project)
    rows = MessageRows(IngestOptions())
    rows.add(1, message(camera=text, persons=[{"id": text, "x_m": 1, "y_m": 2}]))
    keys = DayKeys(lab.project / "secrets")
    clean = Normaliser(site, now=datetime.fromisoformat(NOW), keys=keys).normalise(rows.batch(0))
    return "quarantined: " + ", ".join(sorted({r.reason for r in clean.rejected})) if clean.rejected else "stored"


PLACES: Mapping[str, Callable[[Lab, str], str]] = {
    "camera of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", message(camera=s))),
    "person id of a frame message": lambda lab, s: lab.ingest(
        lab.file("a.jsonl", message(persons=[{"id": s, "x_m": 1, "y_m": 2}]))
    ),
    "engine of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", message(engine=s))),
    "quality of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", message(quality=s))),
    "unknown field of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", message(**{s: s}))),
    "camera and person of an MQTT payload": _as_payload,
    "camera_id of a CSV": lambda lab, s: lab.ingest(lab.file("a.csv", HEAD + _cells(TS, s, "1", "1", "2"))),
    "track_id of a CSV": lambda lab, s: lab.ingest(lab.file("a.csv", HEAD + _cells(TS, "cam-1", s, "1", "2"))),
    "column of a CSV": lambda lab, s: lab.ingest(
        lab.file("a.csv", _cells("ts", "camera_id", s, "x_m", "y_m") + _cells(TS, "cam-1", "1", "1", "2"))
    ),
    "track_id of a Parquet file": lambda lab, s: lab.ingest(lab.file("a.parquet", _parquet(s))),
    "tracking_id of an object log": lambda lab, s: lab.ingest(lab.file("a.csv", _log(s)), "--camera", "cam-1"),
    "sequence in a MOTChallenge zip": _as_mot,
    "folder in a WILDTRACK zip": _as_wildtrack,
    "name of a file": _as_file,
    "--camera": lambda lab, s: lab.ingest(lab.file("a.jsonl", message()), f"--camera={s}"),
    "--map": lambda lab, s: lab.ingest(lab.file("a.csv", HEAD + _cells(TS, "cam-1", "1", "1", "2")), f"--map=ts={s}"),
    "--columns": lambda lab, s: lab.ingest(lab.file("a.csv", _cells(TS, "cam-1", "1", "1", "2")), f"--columns={s}"),
    "--engine": lambda lab, s: lab.ingest(lab.file("a.jsonl", message()), f"--engine={s}"),
    "vsd log add": lambda lab, s: _said(lab.vsd("log", "add", f"--at={TS}", "--json", "--", s)),
    "name in vsd.toml": lambda lab, s: _as_name(lab, s, key="name"),
    "id in vsd.toml": lambda lab, s: _as_name(lab, s, key="id"),
}


def _said(answer: tuple[int, str, str]) -> str:
    told = json.loads(answer[1])
    return "stored" if answer[0] == 0 else f"refused {told['code']}"


def _as_name(lab: Lab, text: str, *, key: str) -> str:
    if "\ud800" in text:
        return "–"  # TOML is UTF-8
    config = lab.project / "vsd.toml"
    before = config.read_text()
    value = json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
    config.write_text(re.sub(rf'(?m)^{key} = "(Exit|cam-2)"', lambda _: f"{key} = {value}", before))
    try:
        code, out, _ = lab.vsd("check", lab.file("a.jsonl", message()), "--json")
    finally:
        config.write_text(before)
    told = json.loads(out)
    return "shown as it is" if code == 0 else f"refused {told.get('problems', [told])[0]['code']}"


def _query(query: str) -> Callable[[Lab], str]:
    def tried(lab: Lab) -> str:
        text = query.replace("ROOT", str(lab.project))
        code, out, _ = lab.vsd("sql", text, "--range", "2026-11-09", "--json")
        told = json.loads(out)
        return f"answered: {json.dumps(told['rows'])[:60]}" if code == 0 else f"refused {told['code']}"

    return tried


SQL: Mapping[str, Callable[[Lab], str]] = {
    query: _query(query)
    for query in (
        "select * from read_text('/etc/passwd')",
        "select * from read_csv('/etc/passwd')",
        "select * from '/etc/passwd'",
        "select * from glob('/etc/*')",
        "select * from read_text('ROOT/store/../vsd.toml')",
        "select * from glob('ROOT/secrets/*')",
        "select * from read_parquet('http://127.0.0.1:9/a.parquet')",
        "select * from query('select * from read_text(''/etc/passwd'')')",
        "select getenv('HOME')",
        "copy (select 1) to 'ROOT/x.csv'",
        "attach 'ROOT/x.db' as x",
        "export database 'ROOT/x'",
        "install httpfs",
        "load httpfs",
        "pragma database_list",
        "set enable_external_access = true",
        "reset lock_configuration",
        "call enable_logging()",
        "select * from enable_logging()",
        "select * from duckdb_secrets()",
        "select 1; drop view hours",
        "create table t as select 1",
        "with x as (insert into hours values (1) returning *) select * from x",
        "select '\ud800'",
        "select '%s' || '$1' || '{{7*7}}' as a",
    )
}

TABLES: Mapping[str, Mapping[str, Callable[[Lab], str]]] = {
    "What is named as input": PATHS,
    "Archives and compressed files": ARCHIVES,
    "Floor plans": PICTURES,
    "Queries of `vsd sql`": SQL,
}


def outcomes(lab: Lab, place: str, names: Collection[str] = STRINGS) -> dict[str, str]:
    """Return what came of strings in a place."""
    return {name: PLACES[place](lab, STRINGS[name]) for name in names}


def cell(text: str) -> str:
    """Return a text as a cell of a Markdown table."""
    return text.replace("|", "\\|").replace("\ud800", "\\ud800").replace("\n", " ")


def place_line(place: str, told: Mapping[str, str]) -> str:
    """Return the line of a place: the commonest outcome, then the others, each with the strings that had it."""
    by: dict[str, list[str]] = {}
    for name, outcome in told.items():
        by.setdefault(outcome, []).append(name)
    impossible = by.pop("–", [])
    common = max(by, key=lambda outcome: len(by[outcome]))
    parts = [common, *(f"{o}: {', '.join(n)}" for o, n in by.items() if o != common)]
    parts += [f"cannot be written: {', '.join(impossible)}"] if impossible else []
    return f"| {place} | {'; '.join(parts)} |"


def documented_outcomes(line: str) -> dict[str, str]:
    """Return what the line of a place says of each string; the reverse of `place_line`."""
    common, *others = line.removesuffix(" |").split(" | ", 1)[1].split("; ")
    found = dict.fromkeys(STRINGS, common)
    for part in others:
        outcome, names = next(read for at in range(len(part)) if (read := _outcome_and_names(part, at)))
        found.update(dict.fromkeys(names, "–" if outcome == "cannot be written" else outcome))
    return found


def _outcome_and_names(part: str, at: int) -> tuple[str, list[str]] | None:
    """Return a part of a line cut in two where what follows are names of strings, and nothing else."""
    outcome, rest = part[:at], part[at:]
    if not rest.startswith(": "):
        return None
    names = [name for name in STRINGS if re.search(rf"(^|, ){re.escape(name)}(, |$)", rest[2:])]
    return (outcome, names) if len(", ".join(names)) == len(rest) - 2 else None


def try_line(name: str, outcome: str) -> str:
    """Return the line of a single try."""
    return f"| {cell(name)} | {cell(outcome)} |"


def lines() -> Iterator[str]:
    """Try everything and yield the lines of the tables."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        lab = new_lab(Path(folder))
        yield from ("| place | outcome |", "|---|---|")
        for place in PLACES:
            yield place_line(place, outcomes(lab, place))
        for title, tries in TABLES.items():
            yield from ("", f"### {title}", "", "| try | outcome |", "|---|---|")
            for name, tried in tries.items():
                yield try_line(name, tried(lab))


def main() -> int:
    """Print the tables, or with `--check` the lines that docs/security.md does not have."""
    documented = DOCS.read_text(encoding="utf-8").split("\n") if "--check" in sys.argv else []
    missing = [line for line in lines() if line not in documented]
    print("\n".join(missing))
    return 1 if documented and missing else 0


if __name__ == "__main__":
    sys.exit(main())
