"""Executes a notebook of `notebooks/` on a project, in a clean kernel."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = {path.stem: path for path in sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))}
SECONDS = 300
INLINE = {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}


def execute(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, then: str = "", **environ: str
) -> nbformat.NotebookNode:
    """Execute a notebook and return it with its outputs; a failing assertion of it fails the test.

    Args:
        name: Its name.
        tmp_path: Where it runs.
        monkeypatch: Sets the environment.
        then: Python that runs last in the same kernel, with more assertions.
        **environ: Environment variables that the notebook reads.
    """
    for key, value in {**INLINE, "IPYTHONDIR": str(tmp_path / "ipython"), **environ}.items():
        monkeypatch.setenv(key, value)
    notebook = nbformat.read(NOTEBOOKS[name], as_version=4)
    if then:
        notebook.cells.append(nbformat.v4.new_code_cell(then))  # type: ignore[no-untyped-call]
    client = NotebookClient(
        notebook, timeout=SECONDS, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.execute()  # type: ignore[no-untyped-call]
    n_asserts = sum(cell.source.count("assert ") for cell in notebook.cells if cell.cell_type == "code")
    assert n_asserts >= 4, "a notebook asserts on values"
    assert not any(o.get("name") == "stderr" for c in notebook.cells for o in c.get("outputs", ())), "no warnings"
    return notebook


def figures(notebook: nbformat.NotebookNode) -> int:
    """Return how many figures its outputs have."""
    return sum("image/png" in output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", ()))
