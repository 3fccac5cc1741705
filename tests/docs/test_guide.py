"""Pages are run as they are: their files are written, their commands executed, what they print is compared."""

from __future__ import annotations

import doctest
import shlex
from pathlib import Path

import pytest
from markdown_pages import REPOSITORY, blocks

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site

DOCS = REPOSITORY / "docs"
RUN = ("formats.md", "guide.md", "refused.md")
KEYS = DOCS / "keys.md"
LIKE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def sessions(text: str) -> list[tuple[str, str]]:
    """Return the commands of a console block with what each is said to print."""
    found: list[tuple[str, str]] = []
    for line in text.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], ""))
        else:
            command, said = found[-1]
            found[-1] = command, f"{said}{line}\n"
    return found


@pytest.mark.parametrize("page", RUN)
def test_commands_print_what_a_page_says(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    n_run = 0
    for block in blocks(DOCS / page):
        kind, _, name = block.mark.partition(": ")
        if kind == "file":
            Path(name).write_text(block.text, encoding="utf-8")
        elif kind == "append":
            Path(name).write_text(Path(name).read_text(encoding="utf-8") + "\n" + block.text, encoding="utf-8")
        if block.language != "console":
            continue
        for command, said in sessions(block.text):
            program, *arguments = shlex.split(command)
            assert program == "vsd"
            code = run(cli, arguments)
            printed = "".join(capsys.readouterr())
            assert doctest.OutputChecker().check_output(said, printed, LIKE), f"$ {command}\n{printed}"
            assert code == (2 if "error[" in said else 1 if "quarantined" in said else 0), command
            n_run += 1
    assert n_run >= 3


def test_complete_vsd_toml_of_the_page_is_valid(tmp_path: Path) -> None:
    (block,) = [b for b in blocks(KEYS) if b.mark == "toml: complete"]
    (tmp_path / "vsd.toml").write_text(block.text, encoding="utf-8")
    _write_named_files(tmp_path)
    site = load_site(tmp_path)
    assert site.camera("cam-1").view is not None
    assert site.settings.retention_days == 30


def test_smallest_vsd_toml_of_the_page_is_valid(tmp_path: Path) -> None:
    (block,) = [b for b in blocks(KEYS) if b.mark == "toml: complete"]
    needed = []
    for line in block.text.splitlines():
        if line.startswith("[ingest.map]"):
            break
        if "#?" not in line:
            needed.append(line)
    (tmp_path / "vsd.toml").write_text("\n".join(needed), encoding="utf-8")
    site = load_site(tmp_path)
    assert [c.camera_id for c in site.cameras] == ["cam-1"]


def _write_named_files(folder: Path) -> None:
    import numpy as np
    from PIL import Image

    for name in ("plans", "pictures", "calibration", "secrets"):
        (folder / name).mkdir()
    (folder / "secrets" / "cam-1-password").write_text("a password\n")
    for name in ("plans/ground.png", "pictures/cam-1.png"):
        Image.new("RGB", (64, 48), "white").save(folder / name)
    np.savetxt(folder / "calibration" / "cam-1.txt", np.diag([0.01, 0.01, 1.0]))
