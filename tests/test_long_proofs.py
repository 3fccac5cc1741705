"""What `make test` leaves out is listed with tests that exist and run there."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
LONG: dict[str, str] = tomllib.loads((TESTS / "long_proofs.toml").read_text(encoding="utf-8"))


def exists(node: str) -> bool:
    """Return whether a test, or a file of tests, exists."""
    file, _, name = node.partition("::")
    path = TESTS / file
    if not name or not path.is_file():
        return path.is_file()
    named = {n.name for n in ast.walk(ast.parse(path.read_bytes())) if isinstance(n, ast.FunctionDef)}
    return name.split("[", maxsplit=1)[0] in named


@pytest.mark.parametrize(("long", "guard"), LONG.items())
def test_what_is_left_out_is_a_test_and_another_guards_its_behaviour(long: str, guard: str) -> None:
    assert exists(long)
    if guard == "its other parameters":
        assert "[" in long
    else:
        assert exists(guard)
        assert guard not in LONG
