"""`vsd export --duckdb`: the numbers of the reports in one file that any DuckDB reads, small counts hidden."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import duckdb
import pytest
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import DiskError, UsageError
from vsd_analytics.report.pages.duckdb_file import OPERATOR_TABLES, export_duckdb, exported_tables
from vsd_analytics.report.pages.json_and_csv import figures_json, to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.store import durable

MONDAY = date(2026, 11, 9)
OLDEST_FORM = 64
"""Version of the file's form that DuckDB 1.0 writes."""


def rows(path: Path, query: str) -> list[dict[str, Any]]:
    with duckdb.connect(str(path), read_only=True) as con:
        found = con.execute(query)
        names = [column[0] for column in found.description or ()]
        return [dict(zip(names, row, strict=True)) for row in found.fetchall()]


@pytest.fixture(scope="module")
def masked_project(demo_project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the demo with a limit so high that many hours, and an area, are under it."""
    root = tmp_path_factory.mktemp("masked") / "vsd-demo"
    shutil.copytree(demo_project, root)
    text = (root / "vsd.toml").read_text()
    (root / "vsd.toml").write_text(text.replace("[report]", "[report]\nmask_below = 200"))
    return root


@pytest.fixture(scope="module")
def export(masked_project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "week.duckdb"
    export_duckdb(load_site(masked_project), MONDAY, MONDAY, out=out)
    return out


@pytest.fixture(scope="module")
def report(masked_project: Path) -> dict[str, Any]:
    found = week_report(load_site(masked_project), MONDAY)
    return {**json.loads(to_json(found)), "figures": figures_json(found)}


def test_every_table_and_column_has_a_comment_and_the_columns_of_its_header(export: Path) -> None:
    tables = rows(export, "select table_name, comment from duckdb_tables()")
    shared = [relation for relation in exported_tables() if relation.name not in OPERATOR_TABLES]
    assert {t["table_name"] for t in tables} == {relation.name for relation in shared}
    assert [t for t in tables if not t["comment"]] == []
    for relation in shared:
        of_table = f"from duckdb_columns() where table_name = '{relation.name}' order by column_index"
        columns = rows(export, f"select column_name, comment {of_table}")
        assert [c["column_name"] for c in columns] == list(relation.columns)
        assert [c for c in columns if not c["comment"]] == []


def test_the_file_has_the_form_of_duckdb_1_0_that_every_later_one_reads(export: Path) -> None:
    with duckdb.connect(str(export), read_only=True) as con:
        [(tags,)] = con.execute("select tags from duckdb_databases() where not internal").fetchall()
    assert tags["storage_version"].startswith("v1.0.0")
    header = export.read_bytes()[:20]
    assert header[8:12] == b"DUCK"
    assert int.from_bytes(header[12:20], "little") == OLDEST_FORM


def test_an_old_duckdb_reads_the_file(export: Path) -> None:
    """Where VSD_OLD_DUCKDB names Pythons that have one, separated as in PATH."""
    pythons = [p for p in os.environ.get("VSD_OLD_DUCKDB", "").split(os.pathsep) if p]
    if not pythons:
        pytest.skip("VSD_OLD_DUCKDB names no Python with an older DuckDB")
    code = (
        "import duckdb, sys; con = duckdb.connect(sys.argv[1], read_only=True); "
        "print(con.execute('select count(*) from hours').fetchall()[0][0])"
    )
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    for python in pythons:
        done = subprocess.run(
            [python, "-c", code, str(export)], capture_output=True, text=True, check=False, env=environment
        )
        assert (done.stderr, int(done.stdout)) == ("", len(rows(export, "from hours")))


def test_hours_are_those_of_the_report_with_small_counts_hidden(export: Path, report: dict[str, Any]) -> None:
    found = rows(export, "from hours")
    cells = sorted(report["when"]["cells"], key=lambda c: str(c["start"]))
    assert [(h["start_local"].isoformat(), h["violations"]) for h in found] == [
        (c["start"][:19], c["violations"]) for c in cells
    ]
    hidden = [h for h in found if h["state"] in ("masked", "held_back")]
    assert len(hidden) > 10
    assert {h["violations"] for h in hidden} == {None}
    shown = [h["violations"] for h in found if h["violations"] is not None]
    assert not [n for n in shown if 0 < n < 200]
    utc = datetime.fromisoformat(cells[0]["start"]).timestamp()
    assert (found[0]["start_utc"] - datetime(1970, 1, 1)).total_seconds() == utc


def test_headline_and_figures_are_those_of_the_json_file(export: Path, report: dict[str, Any]) -> None:
    [week] = rows(export, "from weeks")
    violation_rate = report["level"]["violation_rate"]
    assert (week["violations_per_open_h"], week["violations_per_open_h_lo"], week["violations_per_open_h_hi"]) == (
        violation_rate["value"],
        violation_rate["lo"],
        violation_rate["hi"],
    )
    figures = {f["metric"]: f for f in rows(export, "from figures")}
    assert figures.keys() == report["figures"].keys()
    for metric, figure in report["figures"].items():
        assert [figures[metric][k] for k in ("value", "lo", "hi", "state", "unit")] == [
            figure[k] for k in ("value", "lo", "hi", "state", "unit")
        ]


def test_lists_of_figures_keep_every_entry(export: Path, report: dict[str, Any]) -> None:
    found = {(r["metric"], r["row_no"], r["name"]): r for r in rows(export, "from figure_rows")}
    n = 0
    for metric, figure in report["figures"].items():
        for number, row in enumerate(figure["rows"] or (), start=1):
            for name, value in row.items():
                entry = found[metric, number, name]
                n += 1
                if isinstance(value, int | float) and not isinstance(value, bool):
                    assert entry["number"] == value
                elif isinstance(value, str):
                    assert entry["text"] == value
                elif value is None:
                    assert (entry["number"], entry["text"]) == (None, None)
    assert len(found) == n > 100


def test_a_hidden_area_has_no_numbers(export: Path, report: dict[str, Any]) -> None:
    areas = {a["area_id"]: a for a in rows(export, "from areas")}
    hidden = {a["area_id"] or "rest" for a in report["areas"] if a["is_masked"] or a["is_held_back"]}
    assert hidden
    for area_id, row in areas.items():
        numbers = [row[k] for k in ("violations", "violations_per_open_h", "violations_per_open_h_lo", "floor_share")]
        assert (numbers == [None] * 4) == (area_id in hidden)
        assert (row["state"] in ("masked", "held_back")) == (area_id in hidden)
        assert row["reason"] or area_id not in hidden, "a number that is missing says why"
        assert row["reason"] or row["violations_per_person_h"] is not None


def test_nothing_by_camera_or_area_and_hour_leaves_from_which_hidden_counts_could_be_solved(export: Path) -> None:
    tables = {t["table_name"] for t in rows(export, "select table_name from duckdb_tables()")}
    assert tables.isdisjoint(OPERATOR_TABLES)


def test_the_operator_s_file_has_every_count_and_unknown_is_not_zero(demo_project: Path, tmp_path: Path) -> None:
    out = tmp_path / "exact.duckdb"
    assert run(cli, ["-C", str(demo_project), "export", "--duckdb", str(out), "--exact"]) == 0
    [week] = rows(out, "select violations from weeks")
    for table in sorted(OPERATOR_TABLES):
        [found] = rows(out, f"select sum(violations) as n from {table}")
        assert found["n"] >= week["violations"], "hours that enter no rate have violations too"
    silent = rows(out, "from camera_hours where state = 'no_data'")
    assert {(r["person_records"], r["violations"]) for r in silent} == {(None, None)}


@pytest.mark.parametrize("words", [["--duckdb", "{}/week.duckdb", "--exact"], ["--out", "{}/week.csv"]])
def test_what_hides_nothing_and_records_do_not_go_where_readers_get_their_pages(
    demo_project: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    for folder in ("reports", "reports/of-november"):
        options = [word.format(demo_project / folder) for word in words]
        assert run(cli, ["-C", str(demo_project), "export", *options]) == 2
        assert "pages for the operator do not go to reports/" in capsys.readouterr().err
        assert not (demo_project / folder / Path(options[1]).name).exists()


def test_a_week_that_is_not_over_is_left_out_and_alone_refused(demo_project: Path, tmp_path: Path) -> None:
    friday = datetime(2026, 11, 13, 12, tzinfo=UTC)
    with pytest.raises(UsageError) as refused:
        export_duckdb(load_site(demo_project), MONDAY, MONDAY, out=tmp_path / "week.duckdb", clock=friday)
    assert refused.value.code == "E105"
    assert not (tmp_path / "week.duckdb").exists()


def test_the_calendar_has_every_hour_of_the_week_and_its_opening_time(export: Path) -> None:
    calendar = rows(export, "from calendar")
    assert len(calendar) == 168
    assert {row["week"] for row in calendar} == {"2026-W46"}
    assert sum(row["open_min"] for row in calendar) == (6 * 13 + 8) * 60


def test_the_same_input_gives_the_same_rows(masked_project: Path, export: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.duckdb"
    export_duckdb(load_site(masked_project), MONDAY, MONDAY, out=again)
    for relation in exported_tables():
        if relation.name not in OPERATOR_TABLES:
            assert rows(again, f"from {relation.name}") == rows(export, f"from {relation.name}")


def test_a_failed_export_leaves_the_file_that_is_there(
    masked_project: Path, export: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "week.duckdb"
    shutil.copy(export, out)
    before = out.read_bytes()

    def full(path: Path, data: bytes, **options: object) -> None:
        (path.parent / f".{path.name}.x.tmp").write_bytes(data[: len(data) // 2])
        raise DiskError("the disk is full", code="E304")

    monkeypatch.setattr(durable, "publish", full)
    with pytest.raises(DiskError):
        export_duckdb(load_site(masked_project), MONDAY, MONDAY, out=out)
    assert out.read_bytes() == before


def test_only_the_owner_may_read_the_file(export: Path) -> None:
    assert export.stat().st_mode & 0o777 == 0o600


def test_the_command_takes_whole_weeks_and_refuses_options_of_records(
    demo_project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "week.duckdb"
    command: Callable[..., object] = lambda *a: run(cli, ["-C", str(demo_project), "export", *a])  # noqa: E731
    assert command("--duckdb", str(out), "--range", "2026-11-11..2026-11-12", "--json") == 0
    assert json.loads(capsys.readouterr().out)["rows"]["weeks"] == 1
    assert rows(out, "select monday from weeks") == [{"monday": MONDAY}]
    for more in (["--camera", "cam-1"], ["--out", "x.csv"], ["--table", "pairs"]):
        assert command("--duckdb", str(out), *more) == 2
        assert "--duckdb takes no" in capsys.readouterr().err
    assert command() == 2
    assert "which file" in capsys.readouterr().err


KILLED = """
import contextlib, os, signal, sys
from types import SimpleNamespace
from datetime import date
from pathlib import Path
from vsd_analytics.config.project import load_site
from vsd_analytics.report.pages import duckdb_file
def kill(*_):
    os.kill(os.getpid(), signal.SIGKILL)
def fill(path, _):
    path.write_bytes(b"figures")
    if sys.argv[3] == "filled":
        kill()
    if sys.argv[3] == "written":
        Path.replace = kill
    return {}
duckdb_file._fill, duckdb_file._shared = fill, lambda *_: None
duckdb_file.open_warehouse = lambda *_: contextlib.nullcontext(SimpleNamespace(table=lambda *_: None))
duckdb_file.named_floors = lambda *_: ()  # no figures: they take long
site = load_site(Path(sys.argv[1]))
duckdb_file.export_duckdb(site, date(2026, 11, 9), date(2026, 11, 9), out=Path(sys.argv[2]))
"""


def test_the_next_export_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1"))
    scratch, out = tmp_path / "scratch", tmp_path / "out" / "week.duckdb"
    scratch.mkdir()
    left = []
    for moment in ("filled", "written", "never"):
        words = [sys.executable, "-c", KILLED, str(tmp_path), str(out), moment]
        done = subprocess.run(words, env={**os.environ, "TMPDIR": str(scratch)}, check=False)
        assert done.returncode == (0 if moment == "never" else -9)
        left.append((len(list(out.parent.glob("*"))), any(scratch.iterdir())))
    assert left[0] == (0, True)
    assert left[1] == (1, True)
    assert [p.name for p in out.parent.iterdir()] == ["week.duckdb"]
    assert list(scratch.iterdir()) == []
