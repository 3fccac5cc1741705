"""Data flows one way, nothing imports in a circle, and no room grows beyond what one reader can hold."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "vsd_analytics"

# a later room never reaches around an earlier one: what each room must not import
FORBIDDEN = {
    "store": {"analysis", "ingest", "warehouse", "stats", "report", "live", "simulate", "cli"},
    "ingest": {"analysis", "warehouse", "stats", "report", "live", "simulate", "cli"},
    "warehouse": {"analysis", "ingest", "stats", "report", "live", "simulate", "cli"},
    "stats": {"store", "ingest", "warehouse", "analysis", "report", "live", "simulate", "cli", "config"},
    "analysis": {"store", "ingest", "report", "live", "simulate", "cli"},
    "report": {"store", "ingest", "live", "simulate", "cli", "planner"},
    "index": {"ingest", "warehouse", "stats", "analysis", "live", "simulate", "cli"},
    "planner": {"store", "ingest", "live", "simulate", "cli"},
    "live": {"stats", "report", "simulate", "cli"},
    "simulate": {"warehouse", "stats", "report", "cli"},
    "delivery": {"store", "ingest", "warehouse", "stats", "analysis", "live", "simulate", "cli"},
}
LONGEST = 450


def modules() -> Iterator[tuple[str, Path]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


KNOWN = dict(modules())


def imports(path: Path, *, is_top_only: bool) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = tree.body if is_top_only else list(ast.walk(tree))
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{a.name}" for a in node.names}
            found |= {m for m in inner if m in KNOWN} or {node.module}
    return {m for m in found if m.startswith("vsd_analytics")}


@pytest.mark.parametrize("room", FORBIDDEN)
def test_data_flow_one_way(room: str) -> None:
    reached = {
        f"{name} imports {target}"
        for name, path in modules()
        if name.split(".")[1:2] == [room]
        for target in imports(path, is_top_only=False)
        if target.split(".")[1:2] and target.split(".")[1] in FORBIDDEN[room]
    }
    assert not reached


def test_no_module_imports_itself_in_a_circle() -> None:
    graph = {name: imports(path, is_top_only=True) & KNOWN.keys() - {name} for name, path in KNOWN.items()}
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, " -> ".join((*trail, name))
        if name not in done:
            for target in sorted(graph[name]):
                visit(target, (*trail, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_no_file_is_longer_than_a_reader_can_hold() -> None:
    long = {name: n for name, path in modules() if (n := len(path.read_text(encoding="utf-8").splitlines())) > LONGEST}
    assert not long
