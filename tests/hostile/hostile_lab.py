"""A small project in a folder of its own, the command line on it, and inputs for it."""

import contextlib
import io
import json
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

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
    r"(store/(\.[\w.]+|imports\.jsonl|floors\.json|live/.*|(again/)?(frames|observations|pairs)/site=shop/date=\d{4}-\d\d-\d\d/\d\d-[0-9a-f]{16}\.parquet)"
    r"|facts/.*|secrets/.*|quarantine/[\w./-]+|vsd\.toml|(?:log|questions|shared)\.jsonl|status/(?:(?:log|questions|shared)\.lock|shapes\.json)|reports/[\w.-]+)"
)

HEAD = b"ts,camera_id,track_id,x_m,y_m\n"
START = ("--start", "2026-11-09T09:00:00Z", "--fps", "25")


@dataclass
class Lab:
    """A project in a folder of its own, and the command line on it."""

    root: Path
    calls: int = 0
    read: set[tuple[Path, int]] = field(default_factory=set)

    @property
    def project(self) -> Path:
        """Return the project folder."""
        return self.root / "project"

    def vsd(self, *arguments: str | Path) -> tuple[int, str, str]:
        """Run a command; nothing it says may steer a terminal, and no error may be an internal one."""
        streams = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)]
        with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
            code = run(cli, ["-C", str(self.project), "--now", NOW, *map(str, arguments)])
        out, err = (s.buffer.getvalue().decode() for s in streams)  # type: ignore[attr-defined]
        said = out + err
        assert code in (0, 1, 2), (code, said[-300:])
        assert "E900" not in said, said[-500:]
        assert "Traceback" not in said, said[-500:]
        assert not CONTROL.search(said), repr(CONTROL.search(said))
        return code, out, err

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
        """Everything is an input or is where the project puts it; stored names are known or hashes."""
        for path in self.root.rglob("*"):
            if path.is_dir():
                continue
            name = path.relative_to(self.root).as_posix()
            assert name.startswith("in/") or STORED.fullmatch(name.removeprefix("project/")), name
        for part in (self.project / "store").rglob("*.parquet"):
            known = (part, part.stat().st_mtime_ns)
            if known in self.read:
                continue
            self.read.add(known)
            table = pq.read_table(part, partitioning=None)
            assert all(re.fullmatch(r"cam-\d+", c) for c in table["camera_id"].to_pylist())
            for column in {"track_id", "track_a", "track_b"} & set(table.column_names):
                assert all(t is None or re.fullmatch("[0-9a-f]{16}", t) for t in table[column].to_pylist())


def new_lab(root: Path) -> Lab:
    """Return a project without data."""
    lab = Lab(root)
    lab.project.mkdir(parents=True)
    (lab.project / "vsd.toml").write_text(CONFIG)
    return lab


def message(**changes: Any) -> bytes:
    message = {"v": 1, "camera": "cam-1", "ts": TS, "persons": [{"id": "1", "x_m": 1, "y_m": 2}], **changes}
    return json.dumps(message).encode() + b"\n"


def zipped(files: Mapping[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return out.getvalue()
