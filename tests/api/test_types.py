"""An editor and a type checker know the whole API, and nothing that is not in it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import vsd_analytics as vsd
from vsd_analytics.api.computed_tables import COMPUTED_TABLES
from vsd_analytics.warehouse.analyst_names import sql_tables

HERE = Path(__file__).parent


def check(path: Path) -> str:
    # as `make lint` does, strict and with its settings, so that its cache serves
    command = [sys.executable, "-m", "mypy", str(path)]
    return subprocess.run(command, capture_output=True, text=True, cwd=HERE.parents[1], check=False).stdout


def test_a_strict_type_checker_knows_every_name_that_the_api_uses(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import vsd_analytics as vsd\nvsd.nope()\nvsd.open(3)\nvsd.open('.').week('2026-W46').nothing\n")
    assert "Success" in check(HERE / "whole_api.py")
    said = check(wrong)
    assert 'Module has no attribute "nope"' in said
    assert "incompatible type" in said
    assert 'has no attribute "nothing"' in said


def test_completion_offers_the_public_names_and_each_is_there() -> None:
    assert dir(vsd) == sorted(vsd.__all__)
    assert {"open", "OpenProject", "Days", "Table", "Heatmap"} <= set(dir(vsd))
    assert [name for name in dir(vsd) if not hasattr(vsd, name)] == []


def test_completion_of_days_and_projects_offers_what_the_page_describes() -> None:
    def offered(kind: type) -> set[str]:
        return {name for name in dir(kind) if not name.startswith("_")}

    tables = {*sql_tables(), *COMPUTED_TABLES} | {"areas", "capacity", "coverage"}
    assert offered(vsd.Days) == tables | {"at", "context_figures", "heatmap", "sql", "tracks"}
    of_project = {"change", "changes", "compare", "days", "forecast", "ingest", "plan", "try_layout", "week"}
    assert offered(vsd.OpenProject) == of_project


def test_no_public_name_is_also_that_of_a_room() -> None:
    """Importing a room would replace a function of its name."""
    rooms = {p.name for p in (HERE.parents[1] / "vsd_analytics").iterdir() if p.is_dir()}
    assert rooms & set(vsd.__all__) == set()
