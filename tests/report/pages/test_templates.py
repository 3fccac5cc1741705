"""Templates are compiled once; changed ones again; where nothing can be written, pages are made all the same."""

from __future__ import annotations

import errno
import sys
from pathlib import Path

import pytest
from jinja2 import Environment, FileSystemLoader

from vsd_analytics.report.pages.templates import CompiledTemplates


def rendered(folder: Path) -> str:
    made = Environment(autoescape=True, loader=FileSystemLoader(folder), bytecode_cache=CompiledTemplates(folder))
    return made.get_template("a.j2").render(who="you")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "a.j2").write_text("for {{ who }}")
    return tmp_path


def test_a_template_is_compiled_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert rendered(folder) == "for you"
    assert len(list((folder / "__pycache__").iterdir())) == 1
    monkeypatch.setattr(Environment, "compile", lambda *_: pytest.fail("compiled again"))
    assert rendered(folder) == "for you"


def test_a_changed_template_is_compiled_again(folder: Path) -> None:
    rendered(folder)
    (folder / "a.j2").write_text("by {{ who }}")
    assert rendered(folder) == "by you"


def test_where_the_folder_refuses_files_a_template_is_compiled_each_time(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> None:
        raise OSError(errno.EROFS, "read-only file system")

    monkeypatch.setattr("jinja2.bccache.tempfile.NamedTemporaryFile", refuse)
    assert rendered(folder) == "for you"
    assert rendered(folder) == "for you"
    assert not list((folder / "__pycache__").iterdir())


def test_a_process_that_writes_no_bytecode_writes_none_of_templates(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert rendered(folder) == "for you"
    assert not (folder / "__pycache__").exists()
