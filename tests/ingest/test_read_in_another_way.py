"""A file whose records are stored already, and that comes again with another clock or column."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from walks import Step, walks

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

Vsd = Callable[..., tuple[int, str]]

TOML = """\
[site]
id = "shop"
name = "Shop"
timezone = "UTC"
[[floor]]
id = "f"
name = "Floor"
[[camera]]
id = "door"
name = "Door"
floor = "f"
"""
"""A site of one camera."""


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    (tmp_path / "vsd.toml").write_text(TOML)
    rows = [
        f"2026-03-02 10:{i // 60:02d}:{i % 60:02d},{p},{1 + 0.1 * (i % 30) + p:.2f},{2.5 + p:.2f}"
        for i in range(1200)
        for p in (1, 2)
    ]
    (tmp_path / "day.csv").write_text("time,track_id,x_m,y_m\n" + "\n".join(rows) + "\n")
    return tmp_path


@pytest.fixture
def vsd(shop: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    def call(*words: str) -> tuple[int, str]:
        code = run(cli, ["-C", str(shop), *words])
        return code, "".join(capsys.readouterr())

    return call


@pytest.fixture
def imported(shop: Path, vsd: Vsd) -> Vsd:
    return lambda *words: vsd("ingest", str(shop / "day.csv"), "--map", "ts=time", *words)


def n_persons(shop: Path) -> int:
    return sum(pq.read_metadata(path).num_rows for path in (shop / "store" / "observations").rglob("*.parquet"))


def test_same_file_by_another_clock_is_refused_and_not_stored_twice(shop: Path, vsd: Vsd, imported: Vsd) -> None:
    assert imported()[0] == 0
    code, says = imported("--zone", "Europe/Berlin")
    assert code == 2
    assert "E211" in says
    assert "W230" in says
    assert n_persons(shop) == 2400
    assert "W230" in vsd("check", str(shop / "day.csv"), "--map", "ts=time", "--zone", "Europe/Berlin")[1]


def test_after_a_purge_of_the_first_import_it_is_stored(shop: Path, vsd: Vsd, imported: Vsd) -> None:
    imported()
    remedy = re.findall(r"`vsd (purge --import .+?)`", imported("--zone", "Europe/Berlin")[1])[0]
    code, says = vsd(*remedy.split())
    assert code == 0, says
    code, says = imported("--zone", "Europe/Berlin")
    assert (code, "W230" in says) == (0, False), says
    assert n_persons(shop) == 2400


def test_user_who_is_sure_stores_it_again(shop: Path, vsd: Vsd, imported: Vsd) -> None:
    imported()
    imported("--zone", "Europe/Berlin", "--yes")
    assert n_persons(shop) == 4800


def test_same_file_is_recognised_where_vsd_toml_has_the_columns(shop: Path, vsd: Vsd, imported: Vsd) -> None:
    imported()
    (shop / "vsd.toml").write_text(TOML + '[ingest.map]\nts = "time"\n')
    code, says = vsd("ingest", str(shop / "day.csv"))
    assert (code, "W230" in says) == (0, False), says
    assert n_persons(shop) == 2400


def test_other_rows_of_a_file_raise_no_doubt(shop: Path, vsd: Vsd, imported: Vsd) -> None:
    imported("--where", "track_id=1")
    code, says = imported("--where", "track_id=2")
    assert (code, "W230" in says) == (0, False), says
    assert n_persons(shop) == 2400


def exported(shop: Path, name: str, row: Callable[[Step], str], *, seed: int = 15, n_skipped: int = 0) -> str:
    """Write an export of two minutes of a recording, and return its path."""
    lines = [row(step) for step in walks(n_people=3, seconds=120, seed=seed)[3 * n_skipped :]]
    (shop / name).write_text("ts,track_id,x_m,y_m\n" + "\n".join(lines) + "\n")
    return str(shop / name)


def plain(s: Step) -> str:
    return f"{s.at.isoformat()},{s.track},{s.x_m},{s.y_m}"


def an_hour_later(s: Step) -> str:
    return plain(replace(s, at=s.at + timedelta(hours=1)))


@pytest.mark.parametrize(
    ("row", "n_skipped"),
    [
        (an_hour_later, 0),
        (an_hour_later, 60),
        (lambda s: f"{s.at.isoformat()},p{s.track},{s.x_m},{s.y_m}", 0),
        (lambda s: f"{s.at.isoformat()},,{s.x_m},{s.y_m}", 0),
        (lambda s: f"{(s.at + timedelta(days=1)).isoformat()},{s.track},{s.x_m:.2f},{s.y_m:.2f}", 0),
    ],
    ids=["another clock", "a part by another clock", "other ids", "no ids", "two decimals by another clock"],
)
def test_another_export_of_a_stored_recording_is_refused(
    row: Callable[[Step], str], n_skipped: int, shop: Path, vsd: Vsd
) -> None:
    assert vsd("ingest", exported(shop, "a.csv", plain))[0] == 0
    code, says = vsd("ingest", exported(shop, "b.csv", row, n_skipped=n_skipped))
    assert (code, n_persons(shop)) == (2, 360), says
    assert "W230]: the same recording is stored already" in says
    remedy = re.findall(r"`vsd (purge --import .+?)`", says)[0]
    assert vsd(*remedy.split())[0] == 0
    assert "W230" not in vsd("ingest", str(shop / "b.csv"))[1]
    assert n_persons(shop) == 360 - 3 * n_skipped


@pytest.mark.parametrize(
    ("row", "seed"),
    [
        (plain, 15),
        (lambda s: plain(s) + " ", 15),
        (an_hour_later, 16),
    ],
    ids=["the same file", "the same records", "another hour"],
)
def test_other_recordings_and_the_same_records_again_are_not(
    row: Callable[[Step], str], seed: int, shop: Path, vsd: Vsd
) -> None:
    vsd("ingest", exported(shop, "a.csv", plain))
    code, says = vsd("ingest", exported(shop, "b.csv", row, seed=seed))
    assert (code, "W230" in says) == (0, False), says
    assert n_persons(shop) == (360 if seed == 15 else 720)


def test_people_who_do_the_same_again_and_again_are_no_recording_that_came_before(shop: Path, vsd: Vsd) -> None:
    def to_and_fro(day: int) -> Callable[[Step], str]:
        return lambda s: plain(replace(s, at=s.at + timedelta(days=day), x_m=s.at.second % 20 / 4, y_m=float(s.track)))

    vsd("ingest", exported(shop, "a.csv", to_and_fro(0)))
    assert "W230" not in vsd("ingest", exported(shop, "b.csv", to_and_fro(1)))[1]
    assert n_persons(shop) == 720


ELSEWHERE = "have the time and id of stored ones"


def moved(shop: Path, *, by_m: float, name: str = "corrected.csv", n_lines: int | None = None) -> Path:
    """Write the day again, with the same times and ids and other places."""
    lines = (shop / "day.csv").read_text().splitlines()[:n_lines]
    cells = [line.split(",") for line in lines[1:]]
    rows = [f"{ts},{track},{float(x) + by_m:.3f},{y}" for ts, track, x, y in cells]
    (shop / name).write_text("\n".join([lines[0], *rows]) + "\n")
    return shop / name


def x_mm(shop: Path) -> set[int]:
    parts = (shop / "store" / "observations").rglob("*.parquet")
    return {x for part in parts for x in pq.ParquetFile(part).read(["x_mm"])["x_mm"].to_pylist()}


def test_a_corrected_export_whose_records_are_known_is_warned_of(shop: Path, imported: Vsd, vsd: Vsd) -> None:
    assert imported()[0] == 0
    first = x_mm(shop)
    code, said = vsd("ingest", str(moved(shop, by_m=0.4)), "--map", "ts=time")
    assert (code, x_mm(shop)) == (1, first)
    assert f"2,400 of 2,400 records that were compared {ELSEWHERE}, 0.4 m away" in said
    remedy = re.findall(r"after `vsd (.+?)`", said)[0]
    assert vsd(*remedy.split())[0] == 0
    assert vsd("ingest", str(shop / "corrected.csv"), "--map", "ts=time")[0] == 0
    assert x_mm(shop) == {x + 400 for x in first}


def test_records_under_times_and_ids_of_others_are_never_dropped_in_silence(
    shop: Path, imported: Vsd, vsd: Vsd
) -> None:
    """The records of another camera, or of a second tracker, have times and ids of stored ones and are elsewhere."""
    imported()
    path = moved(shop, by_m=30)
    code, said = vsd("ingest", str(path), "--map", "ts=time")
    assert (code, n_persons(shop)) == (2, 2400)
    assert f"2,400 of 2,400 records that were compared {ELSEWHERE}, 30 m away" in said
    text = (shop / "vsd.toml").read_text()
    (shop / "vsd.toml").write_text(f'{text}[[camera]]\nid = "other"\nname = "Other"\nfloor = "f"\n')
    code, said = vsd("ingest", str(path), "--map", "ts=time", "--camera", "other")
    assert (code, n_persons(shop)) == (0, 4800), said


@pytest.mark.parametrize(("by_m", "n_lines"), [(0.004, None), (0.5, 8)])
def test_rounded_places_and_few_records_raise_no_warning(
    by_m: float, n_lines: int | None, shop: Path, imported: Vsd, vsd: Vsd
) -> None:
    imported()
    said = vsd("ingest", str(moved(shop, by_m=by_m, n_lines=n_lines)), "--map", "ts=time")[1]
    assert "0 new records stored" in said
    assert ELSEWHERE not in said


def test_other_people_at_the_same_times_raise_no_warning(shop: Path, imported: Vsd, vsd: Vsd) -> None:
    imported()
    path = moved(shop, by_m=0.5)
    path.write_text(path.read_text().replace(",1,", ",8,").replace(",2,", ",9,"))
    assert ELSEWHERE not in vsd("ingest", str(path), "--map", "ts=time")[1]


@pytest.mark.parametrize("n_bytes", [0, 100, -10])
def test_a_damaged_part_is_named_where_the_places_of_its_records_come_again(
    n_bytes: int, shop: Path, imported: Vsd, vsd: Vsd
) -> None:
    imported()
    part = next((shop / "store" / "observations").rglob("*.parquet"))
    part.write_bytes(part.read_bytes()[:n_bytes])
    code, said = vsd("ingest", str(moved(shop, by_m=0.5)), "--map", "ts=time")
    assert (code, "E302" in said, part.name in said) == (2, True, True), said
    assert ELSEWHERE not in said
