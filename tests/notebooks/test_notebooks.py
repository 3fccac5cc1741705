"""Notebooks and the Python of the pages run on a demo project; notebooks are stored without outputs."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from vsd_analytics import load_site, open_warehouse
from vsd_analytics.simulate import write_canteen_project, write_demo_project
from vsd_analytics.simulate.demo import ingest_demo

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))
SECONDS = 300
TWO_WEEKS = ["find-a-hotspot"]
"""Notebooks that need 14 recorded days."""
CANTEEN = ["did-the-redesign-work", "plan-an-experiment"]
"""Notebooks on ten weeks of the canteen."""


def test_each_question_has_its_notebook() -> None:
    assert [path.stem for path in NOTEBOOKS] == [
        "bring-your-own-engine",
        "did-the-redesign-work",
        "find-a-hotspot",
        "first-look",
        "plan-an-experiment",
    ]


@pytest.mark.parametrize("path", [p for p in NOTEBOOKS if p.stem not in TWO_WEEKS + CANTEEN], ids=lambda p: p.stem)
def test_notebook_runs_on_the_demo(
    path: Path, demo_project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs(path, demo_project, tmp_path, monkeypatch)


@pytest.mark.simulation
@pytest.mark.parametrize("name", TWO_WEEKS)
def test_notebook_runs_on_two_weeks(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tmp_path / "vsd-demo"
    write_demo_project(root, seed=4, weeks=2)
    ingest_demo(load_site(root), sorted((root / "engine").iterdir()), seed=4)
    [path] = [p for p in NOTEBOOKS if p.stem == name]
    runs(path, root, tmp_path, monkeypatch)


@pytest.mark.simulation
def test_notebooks_of_the_canteen_run_on_one_canteen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second finds the facts that the first computed. It is what their command makes, without its report."""
    root = tmp_path / "canteen"
    write_canteen_project(root, seed=4, weeks=10)
    ingest_demo(load_site(root), sorted((root / "engine").iterdir()), seed=4)
    monkeypatch.setenv("VSD_CANTEEN", str(root))
    for path in (p for p in NOTEBOOKS if p.stem in CANTEEN):
        assert '"demo", folder, "--place", "canteen", "--weeks", "10"' in path.read_text().replace('\\"', '"')
        runs(path, root, tmp_path, monkeypatch)


def runs(path: Path, demo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Execute a notebook in a clean kernel."""
    monkeypatch.setenv("VSD_DEMO", str(demo))
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook, timeout=SECONDS, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.execute()  # type: ignore[no-untyped-call]
    n_asserts = sum(cell.source.count("assert ") for cell in notebook.cells if cell.cell_type == "code")
    assert n_asserts >= 4, "a notebook asserts on values"
    assert not any(o.get("name") == "stderr" for c in notebook.cells for o in c.get("outputs", ())), "no warnings"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
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


@pytest.mark.parametrize("page", ["README.md", "docs/guide.md"])
def test_python_on_a_page_runs_on_the_demo(page: str, demo_project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (NOTEBOOKS[0].parents[1] / page).read_text(encoding="utf-8")
    shown = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
    monkeypatch.chdir(demo_project.parent)
    assert shown
    for block in shown:
        exec(compile(block, page, "exec"), {})


def test_relations_named_in_the_docs_can_be_queried(demo_project: Path) -> None:
    from vsd_analytics.warehouse.analyst_query import run_query

    text = (NOTEBOOKS[0].parents[1] / "docs" / "relations.md").read_text(encoding="utf-8")
    introduction, _, rest = text.partition("## Marts")
    names = {*re.findall(r"relation `(\w+)`", introduction)}
    names |= {
        *re.findall(r"`(\w+)`", introduction.partition("Settings reach SQL")[2].partition("a site day starts")[0])
    }
    names |= {*re.findall(r"^### (\w+)$", rest.partition("## Staging")[0], re.M)}
    assert {"params", "calendar", "owner_cells", "violations", "pairs"} <= names
    with open_warehouse(load_site(demo_project), date(2026, 11, 9), date(2026, 11, 15)) as warehouse:
        for name in sorted(names):
            assert len(run_query(warehouse, f"select * from {name} limit 1")) <= 1
