"""Notebooks and the Python of the pages run on a demo project; notebooks are stored without outputs."""

from __future__ import annotations

import re
import shutil
from datetime import date
from pathlib import Path

import nbformat
import pytest
from notebooks.executed import NOTEBOOKS, execute, figures

from vsd_analytics import load_site, open_warehouse
from vsd_analytics.ingest.intake import pipeline
from vsd_analytics.simulate import demo_project as demo
from vsd_analytics.simulate.canteen_project import write_canteen_project
from vsd_analytics.simulate.demo import ingest_demo
from vsd_analytics.simulate.demo_project import write_demo_project

REPOSITORY = Path(__file__).resolve().parents[2]
ON_ONE_WEEK = {"bring-your-own-engine": 1, "first-look": 3, "how-is-this-space-used": 3, "try-a-layout": 1}
"""Notebooks that one week of the demo is enough for, with the number of their figures."""
CANTEEN = ["did-the-redesign-work", "plan-an-experiment"]
"""Notebooks on ten weeks of the canteen."""


def no_card(*given: object) -> None:
    """Make no card of a source: nobody reads it here."""


def test_each_question_has_its_notebook() -> None:
    assert sorted(NOTEBOOKS) == sorted([*ON_ONE_WEEK, "find-a-hotspot", *CANTEEN])


@pytest.mark.parametrize("name", ON_ONE_WEEK)
def test_notebook_runs_on_the_demo(
    name: str, demo_project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = execute(name, tmp_path, monkeypatch, VSD_PROJECT=str(demo_project))
    assert figures(done) == ON_ONE_WEEK[name]


@pytest.mark.simulation
def test_a_hotspot_is_found_in_two_weeks_of_the_demo(
    demo_project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The shared week, and before it a week of the camera that sees the planted spot: 14 recorded days."""
    root = Path(shutil.copytree(demo_project, tmp_path / "vsd-demo"))
    monkeypatch.setattr(pipeline._Ingest, "understand", no_card)
    monkeypatch.setattr(demo, "DETAILED_S", 4.0)  # as in the shared week
    write_demo_project(tmp_path / "before", seed=4, weeks=1, last_week="2026-W45")
    ingest_demo(load_site(root), sorted((tmp_path / "before" / "engine").glob("cam-2_*")), seed=4)
    done = execute("find-a-hotspot", tmp_path, monkeypatch, VSD_PROJECT=str(root))
    assert figures(done) == 3


@pytest.mark.simulation
def test_notebooks_of_the_canteen_run_on_one_canteen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second finds the facts that the first computed. It is what their command makes, without its report."""
    monkeypatch.setattr(pipeline._Ingest, "understand", no_card)
    root = tmp_path / "canteen"
    write_canteen_project(root, seed=4, weeks=10)
    ingest_demo(load_site(root), sorted((root / "engine").iterdir()), seed=4)
    for name in CANTEEN:
        text = NOTEBOOKS[name].read_text(encoding="utf-8").replace('\\"', '"')
        assert '"demo", folder, "--place", "canteen", "--weeks", "10"' in text
        execute(name, tmp_path, monkeypatch, VSD_CANTEEN=str(root))
    done = execute("find-a-hotspot", tmp_path, monkeypatch, VSD_PROJECT=str(root))  # of which nothing was planted here
    assert figures(done) >= 2


@pytest.mark.parametrize("path", NOTEBOOKS.values(), ids=NOTEBOOKS.keys())
def test_outputs_are_stripped(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert cell.outputs == [], cell.id
            assert cell.execution_count is None, cell.id
        assert cell.metadata == {}, cell.id
    assert set(notebook.metadata) <= {"kernelspec", "language_info"}
    assert set(notebook.metadata.language_info) == {"name"}, "no version of whoever ran it last"


@pytest.mark.parametrize("page", ["README.md"])
def test_python_on_a_page_runs_on_the_demo(page: str, demo_project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    shown = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
    monkeypatch.chdir(demo_project.parent)
    assert shown
    for block in shown:
        exec(compile(block, page, "exec"), {})


def test_relations_named_in_the_docs_can_be_queried(demo_project: Path) -> None:
    from vsd_analytics.api.computed_tables import COMPUTED_TABLES
    from vsd_analytics.warehouse.analyst_names import sql_tables
    from vsd_analytics.warehouse.analyst_query import run_query

    tables, _, _ = (REPOSITORY / "docs" / "relations.md").read_text(encoding="utf-8").partition("## Stored tables")
    introduction, _, rest = (REPOSITORY / "docs" / "internal.md").read_text(encoding="utf-8").partition("## Marts")
    names = {*re.findall(r"^### (\w+)$", tables, re.M)} - {*COMPUTED_TABLES}
    assert names | {*COMPUTED_TABLES} == {*sql_tables(), *COMPUTED_TABLES}
    names |= {
        *re.findall(r"`(\w+)`", introduction.partition("Settings reach SQL")[2].partition("a site day starts")[0])
    }
    internal = {*re.findall(r"^### internal\.(\w+)$", rest.partition("## Staging")[0], re.M), "located", "pairs"}
    assert {"params", "calendar", "owner_cells", "violations"} <= names
    assert {"exposure", "violations"} <= internal
    names |= {f"internal.{name}" for name in internal}
    with open_warehouse(load_site(demo_project), date(2026, 11, 15), date(2026, 11, 15)) as warehouse:
        for name in sorted(names):
            assert len(run_query(warehouse, f"select * from {name} limit 1")) <= 1
