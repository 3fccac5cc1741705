"""`[[source]]` of vsd.toml: files of a name are read as their profile says; `vsd check --save` writes one."""

from __future__ import annotations

import contextlib
import io
import json
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from watched_folders import watched

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.config.reading_rules import NewReadingRule, reading_rule_of
from vsd_analytics.errors import ConfigError
from vsd_analytics.site.model import ReadingRule

TOML = """\
# our shop   (a comment that must stay)
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground"
[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"
clock = "Europe/Rome"
[[camera]]
id = "cam-2"
name = "Tills"
engine_ids = ["tills"]
floor = "ground"
clock = "Europe/Rome"
[privacy]
pseudonyms = false
"""
TILLS = """
[[source]]
id = "tills"
files = "till-*.csv"
map = { ts = "tag+zeit", track_id = "nr", x_m = "ost", y_m = "nord" }
camera = "tills"
unit = "mm"
zone = "UTC"
time_format = "%d.%m.%Y %H:%M:%S"
where = "art = 'person' and conf >= 0.4"
"""
HEADER = "tag,zeit,nr,ost,nord,art,conf\n"


def project(root: Path, toml: str = TOML) -> Path:
    root.mkdir(exist_ok=True)
    (root / "vsd.toml").write_text(toml, encoding="utf-8")
    return root


def table(path: Path) -> Path:
    rows = [f"10.11.2025,09:00:{k:02d},{n},{1000 * n + 10 * k},2000,person,0.9" for k in range(20) for n in (1, 2)]
    rows += ["10.11.2025,09:00:05,9,9000,9000,car,0.9", "10.11.2025,09:00:06,8,9000,9000,person,0.1"]
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@dataclass
class Said:
    exit_code: int
    output: str


def vsd(root: Path, *arguments: str) -> Said:
    both = io.StringIO()
    with contextlib.redirect_stdout(both), contextlib.redirect_stderr(both):
        code = run(cli, ["-C", str(root), "--now", "2025-12-01T00:00Z", *arguments])
    return Said(code, both.getvalue())


def stored(root: Path) -> list[dict[str, Any]]:
    import pyarrow.parquet as pq

    parts = sorted((root / "store" / "observations").rglob("*.parquet"))
    return [row for p in parts for row in pq.ParquetFile(p).read().to_pylist()]


def test_file_of_a_profile_is_read_as_it_says_and_the_card_names_it(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + TILLS)
    found = vsd(root, "ingest", str(table(tmp_path / "till-07.csv")))
    assert found.exit_code == 0, found.output
    assert "[table] by profile tills  40 person records" in found.output
    assert "profile   tills ([[source]] in vsd.toml)" in found.output
    assert "times without an offset are UTC, as its profile says" in found.output
    first = stored(root)[0]
    assert (first["camera_id"], first["x_mm"], first["ts"].isoformat()) == ("cam-2", 1000, "2025-11-10T09:00:00+00:00")
    assert {row["track_id"] for row in stored(root)} == {"1", "2"}


def test_file_of_another_name_is_not_read_by_it(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + TILLS)
    found = vsd(root, "ingest", str(table(tmp_path / "door-07.csv")))
    assert found.exit_code == 2
    assert "profile" not in found.output


def test_options_of_the_command_win(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + TILLS)
    file = table(tmp_path / "till-07.csv")
    found = vsd(
        root,
        "ingest",
        str(file),
        "--camera",
        "cam-1",
        "--unit",
        "cm",
        "--zone",
        "Europe/Rome",
        "--map",
        "x_m=nord,y_m=ost",
    )
    assert found.exit_code == 0, found.output
    first = stored(root)[0]
    assert (first["camera_id"], first["x_mm"], first["y_mm"]) == ("cam-1", 20_000, 10_000)
    assert first["ts"].isoformat() == "2025-11-10T08:00:00+00:00"


def test_watched_folder_chooses_the_profile_by_name(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + TILLS + "[ingest]\nwatch_settle_s = 0.0\n")
    folder = tmp_path / "in"
    folder.mkdir()
    table(folder / "till-08.csv")
    status = watched(root, folder)
    assert (status.n_done, status.n_failed) == (1, 0)
    assert {row["camera_id"] for row in stored(root)} == {"cam-2"}
    assert len(stored(root)) == 40


def test_check_saves_what_was_said_and_leaves_the_file_as_it_is(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML.replace("\n", "\r\n"))
    before = (root / "vsd.toml").read_bytes()
    file = table(tmp_path / "till-2025-11-10.csv")
    options = [
        "--map",
        "ts=tag+zeit,track_id=nr,x_m=ost,y_m=nord",
        "--unit",
        "mm",
        "--camera",
        "cam-2",
        "--zone",
        "UTC",
    ]
    said = vsd(root, "check", str(file), *options, "--where", "art = 'person' and conf >= 0.4", "--save", "tills")
    assert "saved in vsd.toml" in said.output, said.output
    assert "it is for files named till-*.csv\n" in said.output
    after = (root / "vsd.toml").read_bytes()
    assert after.startswith(before)
    assert b"\n" not in after.replace(b"\r\n", b"")
    (source,) = tomllib.loads(after.decode())["source"]
    assert source == {
        "id": "tills",
        "files": "till-*.csv",
        "format": "table",
        "camera": "cam-2",
        "map": {"ts": "tag+zeit", "track_id": "nr", "x_m": "ost", "y_m": "nord"},
        "unit": "mm",
        "zone": "UTC",
        "where": "art = 'person' and conf >= 0.4",
    }
    assert vsd(root, "ingest", str(table(tmp_path / "till-2025-11-11.csv"))).exit_code == 0
    assert len(stored(root)) == 40


@pytest.mark.parametrize(
    ("name", "wider"),
    [("shop.csv", "shop*.csv"), ("shop.csv.gz", "shop*.csv.gz"), ("export", "export*"), ("shop-2.csv", None)],
)
def test_a_pattern_without_numbers_has_a_wider_one(name: str, wider: str | None) -> None:
    assert NewReadingRule("a", name).wider_pattern == wider


def test_saving_a_profile_says_which_files_it_is_for_and_how_to_widen_it(tmp_path: Path) -> None:
    root = project(tmp_path / "p")
    renames = "ts=tag+zeit,track_id=nr,x_m=ost,y_m=nord"
    options = ["--map", renames, "--unit", "mm", "--camera", "cam-2", "--zone", "UTC", "--where", "art = 'person'"]
    said = vsd(root, "check", str(table(tmp_path / "shop.csv")), *options, "--save", "shop")
    assert 'it is for files named shop.csv; for others of its kind, widen it there: files = "shop*.csv"' in said.output


@pytest.mark.parametrize(
    ("name", "says"), [("tills", "has a [[source]] of this id already"), ("My Tills", "--save my-tills")]
)
def test_name_that_is_taken_or_no_id_is_refused(tmp_path: Path, name: str, says: str) -> None:
    root = project(tmp_path / "p", TOML + TILLS)
    found = vsd(root, "check", str(table(tmp_path / "till-07.csv")), "--save", name)
    assert found.exit_code == 2
    assert says in found.output
    assert (root / "vsd.toml").read_text() == TOML + TILLS


def test_file_that_is_understood_wrongly_gets_no_profile(tmp_path: Path) -> None:
    root = project(tmp_path / "p")
    found = vsd(
        root, "check", str(table(tmp_path / "door.csv")), "--map", "ts=tag+zeit,x_m=ost,y_m=nord", "--save", "door"
    )
    assert "no profile was saved" in found.output
    assert (root / "vsd.toml").read_text() == TOML


def test_every_mistake_is_reported_at_once_with_its_line(tmp_path: Path) -> None:
    wrong = """
[[source]]
id = "One"
map = { tss = "time", x_m = 3 }
camera = "cam-3"
unit = "yards"
zone = "Europe/Roma"
time_format = "%H:%M"
where = "conf >= high"
size = [0, 720]
pattern = "x"
[[source]]
id = "two"
files = []
[[source]]
id = "two"
files = "a.csv"
"""
    root = project(tmp_path / "p", TOML + wrong)
    with pytest.raises(ConfigError) as error:
        load_site(root)
    lines = TOML.count("\n")
    found = {(p.where.line - lines, p.code) for p in error.value.problems if p.where is not None and p.where.line}
    assert found == {
        *((2, "E123"), (3, "E125"), (4, "E122"), (4, "E124"), (5, "E125"), (6, "E124"), (7, "E124"), (8, "E124")),
        *((9, "E124"), (10, "E124"), (11, "E122"), (14, "E124"), (16, "E125")),
    }
    assert "write 'high'" in vsd(root, "hours").output


@pytest.mark.parametrize(
    ("name", "pattern"),
    [
        ("till-2025-11-10.csv", "till-*.csv"),
        ("till_20251110T0900.csv.gz", "till_*.csv.gz"),
        ("export.csv", "export.csv"),
        ("cam1[a].csv", "cam*[[]a].csv"),
        ("Kasse 3.xlsx", "Kasse *.xlsx"),
    ],
)
def test_pattern_of_a_name_fits_it_and_its_neighbours(name: str, pattern: str) -> None:
    new = NewReadingRule("p", name)
    assert new.pattern == pattern
    assert reading_rule_of(f"/data/{name}", [ReadingRule(rule_id="p", files=(pattern,))]) is not None


def test_first_profile_that_fits_wins_and_a_slash_looks_at_the_folder() -> None:
    profiles = [
        ReadingRule(rule_id="door", files=("door/*.csv", "exit-*.csv")),
        ReadingRule(rule_id="any", files=("*.csv",)),
    ]
    found = [reading_rule_of(n, profiles) for n in ("in/door/a.csv", "in/x/exit-1.csv", "a.csv", "a.jsonl")]
    assert [None if p is None else p.rule_id for p in found] == ["door", "door", "any", None]


def test_json_names_the_profile(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + TILLS)
    found = json.loads(vsd(root, "check", str(table(tmp_path / "till-07.csv")), "--json").output)
    assert found["sources"][0]["card"]["profile"] == "tills"
