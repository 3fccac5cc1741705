"""`vsd report` and `vsd build` import no library they can do without, and write what a process with it writes."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from warehouse.small_projects import T0, Person, beats, make_site, put

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse import warehouse as module

LEFT_OUT = ("scipy.optimize", "tqdm", "duckdb")
ENDS = f"import os, sys\nos._exit = lambda code: print(*(name in sys.modules for name in {LEFT_OUT}))\n"
RUNS = "from vsd_analytics.cli import main\nmain()\n"
QUERY = "select count(*) as n from camera_hours where recorded_s >= $least"
TOML = """
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "main"
name = "Main"
[[camera]]
id = "cam"
name = "Cam"
floor = "main"
"""


def project(root: Path) -> Path:
    (root / "vsd.toml").write_text(TOML)
    walkers = [
        Person(T0 + s * 1000, track, s * 20 + k * 700, k * 300) for s in range(120) for k, track in enumerate("abc")
    ]
    put(load_site(root), [*walkers, *beats(T0, T0 + 120_000)])
    return root


def report(root: Path, out: Path) -> list[str]:
    return ["-C", str(root), "report", "--week", "2026-W46", "--format", "html,json,csv", "--out", str(out)]


def run_alone(*given: str) -> str:
    """Run a command in a process of its own; return which of the modules it has at its end."""
    arguments = ["vsd", *given]
    code = f"{ENDS}sys.argv = {arguments!r}\n{RUNS}"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return done.stdout.splitlines()[-1]


def test_a_report_imports_no_optimiser_and_is_the_same_without(tmp_path: Path) -> None:
    root = project(tmp_path)
    assert run(cli, report(root, tmp_path / "with")) == 0  # computes the facts
    assert run_alone(*report(root, tmp_path / "without")) == "False False True"
    files = sorted(p.name for p in (tmp_path / "without").iterdir())
    assert {Path(name).suffix for name in files} == {".html", ".json", ".csv"}
    for name in files:
        assert (tmp_path / "without" / name).read_bytes() == (tmp_path / "with" / name).read_bytes()


def test_facts_of_people_with_ids_are_the_same_without_duckdb(tmp_path: Path) -> None:
    (tmp_path / "with").mkdir()
    project(tmp_path / "with")
    shutil.copytree(tmp_path / "with", tmp_path / "without")
    assert run_alone("-C", str(tmp_path / "without"), "build") == "False True False"
    assert run(cli, ["-C", str(tmp_path / "with"), "build"]) == 0
    files = [sorted((tmp_path / name / "facts").rglob("*.parquet")) for name in ("with", "without")]
    assert len(files[0]) == 23
    assert [p.read_bytes() for p in files[0]] == [p.read_bytes() for p in files[1]]


def test_a_question_asked_again_is_answered_without_a_query_until_somebody_takes_the_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = make_site(tmp_path)
    put(site, [Person(T0 + s * 1000, "a", s * 20, 0) for s in range(60)])
    n_runs = 0
    run_query = module.Warehouse.run

    def counting(self: module.Warehouse, query: str, read: object) -> object:
        nonlocal n_runs
        n_runs += query == QUERY
        return run_query(self, query, read)  # type: ignore[arg-type]

    monkeypatch.setattr(module.Warehouse, "run", counting)
    with module.open_warehouse(site, "2026-11-09", "2026-11-09") as warehouse:
        first = warehouse.rows(QUERY, {"least": 0})
        assert first[0]["n"] > 0
        first[0]["n"] = -1  # what a caller does with its rows is its own business
        assert warehouse.rows(QUERY, {"least": 0})[0]["n"] > 0
        assert n_runs == 1
        assert warehouse.rows(QUERY, {"least": 10**9}) == [{"n": 0}]
        assert n_runs == 2
        warehouse.materialise("camera_hours")
        warehouse.con.execute("delete from camera_hours")
        assert warehouse.rows(QUERY, {"least": 0}) == [{"n": 0}]
    assert n_runs == 3
