"""Executes notebooks of `notebooks/` on a project, each without the names of the others."""

from __future__ import annotations

import atexit
import contextlib
import os
from functools import cache
from pathlib import Path

import nbformat
import pytest
from jupyter_client.manager import AsyncKernelManager
from jupyter_core.utils import run_sync
from nbclient import NotebookClient

NOTEBOOKS = {path.stem: path for path in sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))}
SECONDS = 300
INLINE = {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}


@cache
def _kernel() -> AsyncKernelManager:
    """Return the kernel of this process: starting one, with its imports, costs more than most notebooks."""
    manager = AsyncKernelManager(kernel_name="python3")
    run_sync(manager.start_kernel)()
    atexit.register(lambda: run_sync(manager.shutdown_kernel)(now=True))
    return manager


def execute(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, then: str = "", **environ: str
) -> nbformat.NotebookNode:
    """Execute a notebook and return it with its outputs; a failing assertion of it fails the test.

    Args:
        name: Its name.
        tmp_path: Where it runs.
        monkeypatch: Sets the environment that the kernel starts with.
        then: Python that runs last in the same kernel, with more assertions.
        **environ: Environment variables that the notebook reads.
    """
    for key, value in {**INLINE, "IPYTHONDIR": str(tmp_path.parent / "ipython")}.items():
        monkeypatch.setenv(key, value)
    notebook = nbformat.read(NOTEBOOKS[name], as_version=4)
    n_asserts = sum(cell.source.count("assert ") for cell in notebook.cells if cell.cell_type == "code")
    assert n_asserts >= 4, "a notebook asserts on values"
    of_test = {**os.environ, **environ}  # nothing of the notebook before, which ran in the same kernel
    begin = f"import os\nos.chdir({str(tmp_path)!r})\nos.environ.clear()\nos.environ.update({of_test!r})\n%reset -f"
    notebook.cells.insert(0, nbformat.v4.new_code_cell(begin))  # type: ignore[no-untyped-call]
    if then:
        notebook.cells.append(nbformat.v4.new_code_cell(then))  # type: ignore[no-untyped-call]
    client = NotebookClient(notebook, km=_kernel(), timeout=SECONDS)
    try:
        client.execute()  # type: ignore[no-untyped-call]
    finally:
        with contextlib.suppress(Exception):
            client.kc.stop_channels()
    assert not any(o.get("name") == "stderr" for c in notebook.cells for o in c.get("outputs", ())), "no warnings"
    return notebook


def figures(notebook: nbformat.NotebookNode) -> int:
    """Return how many figures its outputs have."""
    return sum("image/png" in output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", ()))
