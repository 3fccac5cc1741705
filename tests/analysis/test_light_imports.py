"""What every report imports is light: a room that asks questions reaches for no library that takes longer than it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "vsd_analytics"
HEAVY = ("pandas", "scipy.signal", "scipy.stats", "matplotlib")
"""Each takes a tenth to half a second to import; `numpy` and `scipy.special` have what the rooms need of them."""

TABLES = ("masked_tables.py", "operator_counts.py")
"""They give tables to people who work with pandas, and import it when they make one."""


def imported(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.update(f"{node.module}.{a.name}" for a in node.names)
    return found


@pytest.mark.parametrize("room", ["stats", "figures"])
def test_no_question_imports_a_heavy_library_early_or_late(room: str) -> None:
    files = sorted(path for path in (PACKAGE / room).rglob("*.py") if path.name not in TABLES)
    reached = {
        f"{path.name} imports {name}"
        for path in files
        for name in imported(path)
        if any(f"{name}.".startswith(f"{heavy}.") for heavy in HEAVY)
    }
    assert len(files) > 10
    assert not reached
