"""What every report imports is light: a room that asks questions reaches for no library that takes longer than it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from test_architecture import is_for_types

PACKAGE = Path(__file__).resolve().parents[1] / "vsd_analytics"
HEAVY = ("pandas", "scipy.signal", "scipy.stats", "matplotlib")
"""Each takes a tenth to half a second to import; `numpy` and `scipy.special` have what the rooms need of them."""
MAKES_FRAMES = {"masked_tables.py", "operator_counts.py"}
"""Files whose results are pandas frames; no report asks for them."""


def imported(path: Path) -> set[str]:
    found: set[str] = set()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types = {id(inner) for node in ast.walk(tree) if is_for_types(node) for inner in ast.walk(node)}
    for node in (n for n in ast.walk(tree) if id(n) not in for_types):
        if isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.update(f"{node.module}.{a.name}" for a in node.names)
    return found


@pytest.mark.parametrize("room", ["stats", "figures"])
def test_no_question_imports_a_heavy_library_early_or_late(room: str) -> None:
    files = sorted(p for p in (PACKAGE / room).rglob("*.py") if p.name not in MAKES_FRAMES)
    reached = {
        f"{path.name} imports {name}"
        for path in files
        for name in imported(path)
        if any(f"{name}.".startswith(f"{heavy}.") for heavy in HEAVY)
    }
    assert len(files) > 10
    assert not reached
