"""A shop with one camera in a folder, and `vsd` run in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.engine.people import People

Vsd = Callable[..., tuple[int, str, str]]


def write_shop(folder: Path) -> None:
    """Write vsd.toml of a camera of 1920 x 1080 pixels."""
    (folder / "vsd.toml").write_text(site_text(more="picture_px = [1920, 1080]\n"))


def shop(folder: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    """Write such a shop; return `vsd(words...)`: exit code, stdout, stderr."""
    write_shop(folder)
    return in_shop(folder, capsys)


def in_shop(folder: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    """Return `vsd(words...)` in a shop that is there."""

    def vsd(*words: str) -> tuple[int, str, str]:
        code = run(cli, ["-C", str(folder), "--now", "2026-11-20T12:00", *words])
        return code, *capsys.readouterr()

    return vsd


def write_boxes(path: Path, people: People, *, with_tracks: bool = True) -> Path:
    """Write boxes as the engine's CSV table."""
    names = ["frame", *(["track_id"] if with_tracks else []), "left", "top", "right", "bottom"]
    rows = [",".join(names)]
    for frame, track, box in zip(people.frame.tolist(), people.track, people.box.round(2).tolist(), strict=True):
        rows.append(",".join(str(v) for v in (frame, *([track] if with_tracks else []), *box)))
    path.write_text("\n".join(rows) + "\n")
    return path
