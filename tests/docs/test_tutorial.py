"""The tutorial is typed as it is written, in an empty folder: commands, files, and what both print."""

from __future__ import annotations

import doctest
import os
import shlex
import tomllib
from pathlib import Path

import pytest
from markdown_pages import REPOSITORY, Block, blocks

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

TUTORIAL = REPOSITORY / "docs" / "tutorial.md"
LIKE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def type_console(block: Block, capsys: pytest.CaptureFixture[str]) -> None:
    """Run the commands of a block and compare what each prints."""
    lines = block.text.splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith("$ ")]
    for i, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        program, *arguments = shlex.split(lines[i][2:])
        if program == "cd":
            os.chdir(arguments[0])
            continue
        assert program == "vsd"
        code = run(cli, arguments)
        printed = "".join(capsys.readouterr())
        said = "".join(f"{line}\n" for line in lines[i + 1 : end])
        assert doctest.OutputChecker().check_output(said, printed, LIKE), f"{lines[i]}\n{printed}"
        assert code == 0, lines[i]


def test_every_block_of_the_tutorial_does_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    typed = []
    for block in blocks(TUTORIAL):
        kind, _, rest = block.mark.partition(": ")
        if block.language == "console":
            type_console(block, capsys)
        elif block.language == "python":
            exec(compile(block.text, "tutorial", "exec"), {})
            assert capsys.readouterr().out.strip() == rest
        elif kind == "append":
            Path(rest).write_text(Path(rest).read_text(encoding="utf-8") + "\n" + block.text, encoding="utf-8")
        else:
            assert block.chapter == "1. Install", "every other block is typed here"
        typed.append(block.chapter)
    assert len(dict.fromkeys(typed)) == 7, "each step has a block"


def test_the_installation_of_the_tutorial_is_that_of_the_project() -> None:
    """What `pip install` does with the built package is tested in `tests/packaging`."""
    [block] = [b for b in blocks(TUTORIAL) if b.chapter == "1. Install"]
    assert block.text.splitlines() == ["python3 -m venv .venv", ". .venv/bin/activate", "pip install ."]
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == ">=3.11"
    assert "You need Python 3.11 or newer" in TUTORIAL.read_text(encoding="utf-8")
    assert project["scripts"]["vsd"] == "vsd_analytics.cli:main"
