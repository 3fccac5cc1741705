"""Hostile names and files, each tried against a small project; every try says in a few words what came of it.

`python tests/hostile/hostile_tries.py` prints the tables of docs/security.md; `test_hostile_names.py` holds them equal.
"""

from __future__ import annotations

import bz2
import contextlib
import gzip
import io
import json
import os
import re
import socket
import struct
import sys
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.cli import cli
from vsd_analytics.cli.shared import run

CONFIG = """\
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
opening = { mon-sun = "00:00-24:00" }
[[floor]]
id = "ground"
name = "Ground"
[[camera]]
id = "cam-1"
name = "Entrance"
[[camera]]
id = "cam-2"
name = "Exit"
"""
NOW = "2026-11-20T00:00:00Z"
TS = "2026-11-09T09:00:00Z"
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
STORED = re.compile(
    r"(store/(\.[\w.]+|live/.*|(frames|observations|pairs)/site=shop/date=\d{4}-\d\d-\d\d/\d\d-[0-9a-f]{16}\.parquet)"
    r"|facts/.*|secrets/.*|quarantine/[\w./-]+|vsd\.toml|log\.jsonl|reports/[\w.-]+)"
)

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


@dataclass
class Lab:
    """A project in a folder of its own, and the command line on it."""

    root: Path
    calls: int = 0
    kept: set[Path] = field(default_factory=set)

    @property
    def project(self) -> Path:
        """Return the project folder."""
        return self.root / "project"

    def vsd(self, *arguments: str | Path) -> tuple[int, str, str]:
        """Run a command; nothing it says may steer a terminal, and no error may be an internal one."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run(cli, ["-C", str(self.project), "--now", NOW, *map(str, arguments)])
        said = out.getvalue() + err.getvalue()
        assert code in (0, 1, 2), (code, said[-300:])
        assert "E900" not in said, said[-500:]
        assert "Traceback" not in said, said[-500:]
        assert not CONTROL.search(said), repr(CONTROL.search(said))
        said.encode()
        return code, out.getvalue(), err.getvalue()

    def file(self, name: str, data: bytes) -> Path:
        """Write an input."""
        self.calls += 1
        path = self.root / "in" / str(self.calls) / name
        path.parent.mkdir(parents=True)
        path.write_bytes(data)
        return path

    def ingest(self, path: Path, *options: str) -> str:
        """Ingest a path and return "stored", "quarantined: reasons" or the code of the refusal."""
        _, out, _ = self.vsd("ingest", path, "--json", *options)
        if len(out) < 20_000:  # what is said in words is tried as well, but not of everything that is long
            self.vsd("check", path, *options)
        told = json.loads(out)
        if "sources" not in told:
            return f"refused {told['code']}"
        (source,) = told["sources"]
        if source["error"]:
            return f"refused {source['error']['code']}"
        if source["quarantined"]:
            return "quarantined: " + ", ".join(sorted(source["quarantined"]))
        return "stored" if source["records"] else "nothing found"

    def check_places(self) -> None:
        """Everything is an input or stands where the project puts it; stored names are known or hashes."""
        for path in self.root.rglob("*"):
            if path.is_dir():
                continue
            name = path.relative_to(self.root).as_posix()
            assert name.startswith("in/") or STORED.fullmatch(name.removeprefix("project/")), name
        for part in (self.project / "store").rglob("*.parquet"):
            table = pq.read_table(part, partitioning=None)
            assert set(table["camera_id"].to_pylist()) <= {"cam-1", "cam-2"}
            for column in {"track_id", "track_a", "track_b"} & set(table.column_names):
                assert all(t is None or re.fullmatch("[0-9a-f]{16}", t) for t in table[column].to_pylist())


def new_lab(root: Path) -> Lab:
    """Return a project without data."""
    lab = Lab(root)
    lab.project.mkdir(parents=True)
    (lab.project / "vsd.toml").write_text(CONFIG)
    return lab


def _message(**changes: Any) -> bytes:
    message = {"v": 1, "camera": "cam-1", "ts": TS, "persons": [{"id": "1", "x_m": 1, "y_m": 2}], **changes}
    return json.dumps(message).encode() + b"\n"


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


def _zip(files: Mapping[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return out.getvalue()


_START = ("--start", "2026-11-09T09:00:00Z", "--fps", "25")


def _as_mot(lab: Lab, text: str) -> str:
    try:
        data = _zip({f"{text[:60_000]}/gt/gt.txt": b"1,1,10,10,20,40,1,1,1,0\n"})
    except UnicodeEncodeError:
        return "–"
    return lab.ingest(lab.file("a.zip", data), *_START)


def _as_wildtrack(lab: Lab, text: str) -> str:
    try:
        data = _zip({f"{text[:60_000]}/annotations_positions/00000000.json": b'[{"personID":1,"positionID":7}]'})
    except UnicodeEncodeError:
        return "–"
    return lab.ingest(lab.file("a.zip", data), *_START, "--camera", "cam-1")


def _as_file(lab: Lab, text: str) -> str:
    try:
        path = lab.file(text + ".jsonl", _message())
    except (OSError, ValueError):
        return "–"
    return lab.ingest(path)


def _as_payload(lab: Lab, text: str) -> str:
    from datetime import datetime

    from vsd_analytics.config import load_site
    from vsd_analytics.ingest.adapter import IngestOptions
    from vsd_analytics.ingest.frames import MessageRows
    from vsd_analytics.ingest.normalise import Normaliser
    from vsd_analytics.store.secrets import DayKeys

    site = load_site(lab.project)
    rows = MessageRows(IngestOptions())
    rows.add(1, _message(camera=text, persons=[{"id": text, "x_m": 1, "y_m": 2}]))
    keys = DayKeys(lab.project / "secrets")
    clean = Normaliser(site, now=datetime.fromisoformat(NOW), keys=keys).normalise(rows.batch(0))
    return "quarantined: " + ", ".join(sorted({r.reason for r in clean.rejected})) if clean.rejected else "stored"


HEAD = b"ts,camera_id,track_id,x_m,y_m\n"
PLACES: Mapping[str, Callable[[Lab, str], str]] = {
    "camera of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", _message(camera=s))),
    "person id of a frame message": lambda lab, s: lab.ingest(
        lab.file("a.jsonl", _message(persons=[{"id": s, "x_m": 1, "y_m": 2}]))
    ),
    "engine of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", _message(engine=s))),
    "quality of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", _message(quality=s))),
    "unknown field of a frame message": lambda lab, s: lab.ingest(lab.file("a.jsonl", _message(**{s: s}))),
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
    "--camera": lambda lab, s: lab.ingest(lab.file("a.jsonl", _message()), f"--camera={s}"),
    "--map": lambda lab, s: lab.ingest(lab.file("a.csv", HEAD + _cells(TS, "cam-1", "1", "1", "2")), f"--map=ts={s}"),
    "--columns": lambda lab, s: lab.ingest(lab.file("a.csv", _cells(TS, "cam-1", "1", "1", "2")), f"--columns={s}"),
    "--engine": lambda lab, s: lab.ingest(lab.file("a.jsonl", _message()), f"--engine={s}"),
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
        code, out, _ = lab.vsd("check", lab.file("a.jsonl", _message()), "--json")
    finally:
        config.write_text(before)
    told = json.loads(out)
    return "shown as it is" if code == 0 else f"refused {told.get('problems', [told])[0]['code']}"


def _fifo(lab: Lab, *parts: str) -> Path:
    path = lab.file("beside.txt", b"x").parent.joinpath(*parts)
    path.parent.mkdir(parents=True, exist_ok=True)
    os.mkfifo(path)
    return path


def _link(lab: Lab, target: str, name: str = "a.csv") -> Path:
    path = lab.file("beside.txt", b"x").parent / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to(target)
    return path


def _socket(lab: Lab) -> Path:
    path = lab.file("beside.txt", b"x").parent / "s"
    with contextlib.chdir(path.parent), socket.socket(socket.AF_UNIX) as s:  # the path of a socket must be short
        s.bind("s")
    return path


def _folder_with(lab: Lab, make: Callable[..., Path], *, like: str) -> str:
    return lab.ingest(make(lab, *like.split("/")).parents[like.count("/")], "--format", _FORMATS[like], *_START,
                      "--camera", "cam-1")  # fmt: skip


_FORMATS = {
    "objects_log/a.csv": "smart-social-distancing",
    "gt/gt.txt": "motchallenge",
    "annotations_positions/00000000.json": "wildtrack",
}
PATHS: Mapping[str, Callable[[Lab], str]] = {
    "a named pipe": lambda lab: lab.ingest(_fifo(lab, "a.csv")),
    "/dev/zero": lambda lab: lab.ingest(Path("/dev/zero")),
    "/dev/stdin": lambda lab: lab.ingest(Path("/dev/stdin")),
    "a socket": lambda lab: lab.ingest(_socket(lab)),
    "a link to /dev/zero": lambda lab: lab.ingest(_link(lab, "/dev/zero")),
    "a link to itself": lambda lab: lab.ingest(_link(lab, "a.csv")),
    "a link to nothing": lambda lab: lab.ingest(_link(lab, "nothing.csv")),
    "a link to a recording": lambda lab: lab.ingest(_link(lab, str(lab.file("b.jsonl", _message())), "a.jsonl")),
    **{
        f"a pipe for {like} in a folder": lambda lab, like=like: _folder_with(lab, _fifo, like=like)  # type: ignore[misc]
        for like in _FORMATS
    },
    "a path of 10 kB": lambda lab: lab.ingest(Path("x" * 10_000)),
    "a name that is no UTF-8": lambda lab: lab.ingest(lab.file(os.fsdecode(b"\xff.jsonl"), _message())),
}


def _tar(*entries: tuple[str, bytes, str]) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        for name, data, link in entries:
            info = tarfile.TarInfo(name)
            info.size = len(data)
            if link:
                info.type, info.linkname = tarfile.SYMTYPE, link
            archive.addfile(info, io.BytesIO(data))
    return out.getvalue()


_PERSON = b'[{"personID":1,"positionID":7}]'
_FILE = "annotations_positions/00000000.json"


def _bomb(name: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, b"[" + b" " * (80 << 20) + b"]")
    return out.getvalue()


def _lying(name: str) -> bytes:
    """Return a zip whose member says that it is small and is not."""
    data = bytearray(_bomb(name))
    for mark, at in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
        start = data.find(mark) + at
        data[start : start + 4] = struct.pack("<I", 1000)
    return bytes(data)


def _encrypted(name: str) -> bytes:
    data = bytearray(_zip({name: _PERSON}))
    for mark, at in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        data[data.find(mark) + at] |= 1
    return bytes(data)


def _archive(name: str, make: Callable[[], bytes], *more: str) -> Callable[[Lab], str]:
    return lambda lab: lab.ingest(lab.file(name, make()), *_START, "--camera", "cam-1", *more)


def _bz2() -> bytes:
    return bz2.compress(HEAD + b" " * (80 << 20))


def _zst() -> bytes:
    data: bytes = pa.Codec("zstd").compress(_message() + b" " * (200 << 20), asbytes=True)
    return data


ARCHIVES: Mapping[str, Callable[[Lab], str]] = {
    "zip, a member of 80 MiB of blanks": _archive("a.zip", lambda: _bomb(_FILE), "--format", "wildtrack"),
    "zip, a member that says it is small": _archive("a.zip", lambda: _lying(_FILE), "--format", "wildtrack"),
    "zip, encrypted": _archive("a.zip", lambda: _encrypted(_FILE), "--format", "wildtrack"),
    "zip, member ../../": _archive("a.zip", lambda: _zip({f"../../{_FILE}": _PERSON})),
    "zip, member /": _archive("a.zip", lambda: _zip({f"/{_FILE}": _PERSON})),
    "zip, 5,000 members": _archive(
        "a.zip", lambda: _zip({f"annotations_positions/{k}.json": b"[]" for k in range(5000)})
    ),
    "tar, member ../../": _archive("a.tar", lambda: _tar((_FILE, _PERSON, ""), (f"../../{_FILE}", _PERSON, ""))),
    "tar, a link to /etc/passwd": _archive(
        "a.tar", lambda: _tar((_FILE, _PERSON, ""), (_FILE.replace("0.", "1."), b"", "/etc/passwd"))
    ),
    "tar.gz, 80 MiB of zeros": _archive("a.tar.gz", lambda: gzip.compress(_tar((_FILE, b"\0" * (80 << 20), "")))),
    "csv.bz2, 80 MiB of blanks": _archive("a.csv.bz2", _bz2),
    "jsonl.zst, 200 MiB of blanks": _archive("a.jsonl.zst", _zst),
}


def _png(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 99)) + chunk(b"IEND", b"")


def _plan(name: str, data: bytes) -> Callable[[Lab], str]:
    def tried(lab: Lab) -> str:
        from vsd_analytics.errors import VsdError
        from vsd_analytics.pictures import picture_size
        from vsd_analytics.report.pictures import has_paper, plan_image

        path = lab.file(name, data)
        if picture_size(path) is None:
            return "refused E126"
        try:
            has_paper(path)
            plan_image(path)
        except VsdError as error:
            return f"refused {error.code}"
        return "drawn"

    return tried


def _svg(inner: str = "", *, head: str = "", more: str = "") -> bytes:
    return f'{head}<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"{more}>{inner}</svg>'.encode()


_LAUGHS = "<!DOCTYPE svg [<!ENTITY a 'aaaaaaaaaaaaaaaaaaaa'>{}]>".format(
    "".join(f"<!ENTITY {b} '{f'&{a};' * 20}'>" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
)
PICTURES: Mapping[str, Callable[[Lab], str]] = {
    "SVG, a plain drawing": _plan(
        "a.svg", _svg("<rect fill='url(#p)'/><a href='https://example.org'><use href='#r'/></a>")
    ),
    "SVG, script": _plan("a.svg", _svg("<script>alert(1)</script>")),
    "SVG, event handler": _plan("a.svg", _svg(more=" onload='alert(1)'")),
    "SVG, foreignObject": _plan(
        "a.svg", _svg("<foreignObject><p xmlns='http://www.w3.org/1999/xhtml'/></foreignObject>")
    ),
    "SVG, picture from elsewhere": _plan("a.svg", _svg("<image href='https://example.org/a.png'/>")),
    "SVG, style from elsewhere": _plan("a.svg", _svg("<style>@import 'https://example.org/a.css'</style>")),
    "SVG, fill from elsewhere": _plan("a.svg", _svg("<rect style='fill: url( https://example.org/a#b )'/>")),
    "SVG, javascript: link": _plan("a.svg", _svg("<a href=' javascript:alert(1)'><rect/></a>")),
    "SVG, style sheet": _plan("a.svg", _svg(head="<?xml-stylesheet href='https://example.org/a.css'?>")),
    "SVG, entity of another file": _plan(
        "a.svg", _svg("<text>&x;</text>", head="<!DOCTYPE svg [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>")
    ),
    "SVG, entities that grow": _plan("a.svg", _svg("<text>&i;</text>", head=_LAUGHS)),
    "SVG, size without end": _plan("a.svg", b'<svg viewBox="0 0 inf 1e999"/>'),
    "SVG, unknown encoding": _plan("a.svg", b'<?xml version="1.0" encoding="x-no"?><svg viewBox="0 0 9 9"/>'),
    "PNG, 13,000 x 13,000 pixels": _plan("a.png", _png(13_000, 13_000)),
    "PNG, 2,147,483,647 x 2,147,483,647 pixels": _plan("a.png", _png(2**31 - 1, 2**31 - 1)),
    "PNG, cut off": _plan("a.png", _png(3000, 3000)),
}


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


def outcomes(lab: Lab, place: str) -> dict[str, str]:
    """Return what came of every string in a place."""
    return {name: PLACES[place](lab, text) for name, text in STRINGS.items()}


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


def try_line(name: str, outcome: str) -> str:
    """Return the line of a single try."""
    return f"| {cell(name)} | {cell(outcome)} |"


def main() -> None:
    """Print the tables."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        lab = new_lab(Path(folder))
        print("| place | outcome |\n|---|---|")
        for place in PLACES:
            print(place_line(place, outcomes(lab, place)))
        for title, tries in TABLES.items():
            print(f"\n### {title}\n\n| try | outcome |\n|---|---|")
            for name, tried in tries.items():
                print(try_line(name, tried(lab)))


if __name__ == "__main__":
    sys.exit(main())
