"""A small project whose records are purged: two cameras, three UTC days, people close to each other, a gap."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from click.testing import CliRunner

from vsd_analytics.cli import cli
from vsd_analytics.retention.purge import Terms
from vsd_analytics.store.durable import digest
from vsd_analytics.store.seals import Seals
from vsd_analytics.warehouse.fact_days import hour_bytes

NOW = datetime(2026, 12, 20, 12, tzinfo=UTC)
TERMS = Terms(now=NOW, is_forced=True)
DAYS = ("2026-11-09", "2026-11-10", "2026-11-11")
HOURS = (0, 1, 9, 10, 23)

TOML = """\
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground"
capacity = 9
[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"
hz = 0.1
[[camera]]
id = "cam-2"
name = "Stairs"
floor = "ground"
hz = 0.1
[privacy]
pseudonyms = false
"""


def make_project(root: Path, *, toml: str = TOML) -> Path:
    root.mkdir(parents=True, exist_ok=True)
    (root / "vsd.toml").write_text(toml, encoding="utf-8")
    return root


def messages(*, camera: str, day: str, hours: tuple[int, ...] = HOURS, shift_m: float = 0.0) -> list[dict[str, Any]]:
    """Return frame messages of a quarter of each hour: one person alone, or two who stand close for 40 s."""
    found = []
    for hour in hours:
        for k in range(90):
            ts = f"{day}T{hour:02d}:{k // 6:02d}:{10 * (k % 6):02d}Z"
            persons = [{"id": f"a{hour}", "x_m": 1.0 + shift_m, "y_m": 0.02 + k % 5 / 2}]
            if k % 15 < 5:
                persons.append({"id": f"b{hour}-{k // 15}", "x_m": 2.0 + shift_m, "y_m": 0.02 + k % 5 / 2})
            found.append({"v": 1, "camera": camera, "ts": ts, "seq": k, "engine": "acme 2.1", "persons": persons})
    return found


def write(path: Path, found: list[dict[str, Any]]) -> Path:
    path.write_text("".join(json.dumps(m) + "\n" for m in found), encoding="utf-8")
    return path


def three_days(folder: Path) -> Path:
    """Write three days of two cameras, each of which sees a part of the floor of its own."""
    seen = {"cam-1": 0.0, "cam-2": 15.0}
    every = [m for day in DAYS for camera, x_m in seen.items() for m in messages(camera=camera, day=day, shift_m=x_m)]
    return write(folder / "three-days.jsonl", every)


def vsd(root: Path, *arguments: str, code: int | None = 0) -> str:
    """Run a command in a project and return what it printed on standard output."""
    found = CliRunner().invoke(cli, ["-C", str(root), "--now", NOW.isoformat(), *arguments], standalone_mode=False)
    if found.exception is not None:
        raise found.exception
    result = found.return_value if isinstance(found.return_value, int) else found.exit_code
    assert code is None or result == code, found.output
    return found.stdout


def seals_of(root: Path) -> Seals:
    return Seals(root / "sealed", site_id="shop")


def as_an_older_version_sealed(root: Path) -> None:
    """Seal each hour of a project alone, with a seal that does not know of hours sealed together."""
    seals = seals_of(root)
    for number in seals.days():
        seal = seals.read(number)
        assert seal is not None
        hours = dict(seal.hours)
        for hour, unit in seal.hours.items():
            if unit.is_in_day:
                files = {r: hour_bytes(seals.fact_path(r, hour, unit), hour) for r in unit.facts}
                facts = {r: seals.put(r, hour, data) for r, data in files.items()}
                hours[hour] = replace(unit, facts=facts, is_in_day=False)
        seals.write(replace(seal, hours=hours))
        text = seals.path(number).read_text(encoding="utf-8")
        body = json.dumps(json.loads(text)["seal"], separators=(",", ":")).replace('"is_in_day":false,', "")
        envelope = f'{{"digest":"{digest(body.encode())}","seal":{body}}}\n'
        seals.path(number).write_text(envelope, encoding="utf-8")
    seals.sweep(seals.days())
    shutil.rmtree(root / "facts" / "days", ignore_errors=True)
    shutil.rmtree(root / "facts" / "weeks", ignore_errors=True)


def day(text: str) -> date:
    return date.fromisoformat(text)


def audit(root: Path) -> list[dict[str, Any]]:
    path = root / "purge.jsonl"
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def litter(root: Path) -> list[str]:
    """Return what no purge may leave: temporary files, intents, sealed facts that no seal names."""
    seals = seals_of(root)
    named = {p for d in seals.days() for h, u in _units(seals, d) for p in _files(seals, h, u)}
    found = set((root / "sealed").rglob("*.parquet")) - named
    found |= set(root.rglob("*.tmp")) | set((root / "store" / "purge").glob("*"))
    return sorted(str(p) for p in found)


def _units(seals: Seals, day_number: int) -> list[tuple[int, Any]]:
    seal = seals.read(day_number)
    assert seal is not None
    return [*seal.hours.items(), *([(day_number * 24, seal.camera_days)] if seal.camera_days else [])]


def _files(seals: Seals, hour: int, unit: Any) -> list[Path]:
    return [seals.fact_path(r, hour, unit) for r in unit.facts]
