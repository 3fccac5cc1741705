"""The page of performance: one command makes every number on it."""

from __future__ import annotations

import re
from pathlib import Path

from tests.benchmarks.every_number import COMMANDS, QUICK

DOCS = Path(__file__).parents[2] / "docs"
SCRIPTS = Path(__file__).parents[1] / "benchmarks"


def test_make_performance_runs_every_command_that_the_page_names() -> None:
    page = (DOCS / "performance.md").read_text(encoding="utf-8")
    named = re.findall(r"^    python tests/benchmarks/(bench_\w+\.py.*)$", page, re.MULTILINE)
    assert len(named) >= 4
    missing = [one for one in named if one.replace(" --keep DIR", "").strip() not in COMMANDS]
    assert missing == []
    short = set(re.findall(r"`(bench_\w+\.py)[^`]*`", page))
    assert short <= {command.split()[0] for command in COMMANDS}


def test_every_command_is_a_script_that_is_there() -> None:
    assert all((SCRIPTS / command.split()[0]).is_file() for command in (*COMMANDS, *QUICK))


def test_the_page_stays_short() -> None:
    assert len((DOCS / "performance.md").read_text(encoding="utf-8").split()) <= 2000
