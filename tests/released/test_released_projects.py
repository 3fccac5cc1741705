"""The store and `vsd.toml` that every version wrote are opened, and give the figures that it printed."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest
from make_released_project import HERE, printed

from vsd_analytics.version import VERSION

PROJECTS = sorted(HERE.glob("*.zip"))


def test_a_released_version_has_its_project() -> None:
    is_released = ".dev" not in VERSION
    assert not is_released or VERSION in [p.stem for p in PROJECTS], "python tests/released/make_released_project.py"
    assert all(path.stat().st_size < 200_000 for path in PROJECTS)


@pytest.mark.parametrize("path", PROJECTS, ids=lambda p: p.stem)
def test_what_a_version_stored_gives_the_figures_it_printed(path: Path, tmp_path: Path) -> None:
    """A definition that changes is listed under "Numbers that change"; only then may a figure be left out here."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    then, now = json.loads((tmp_path / "printed.json").read_text(encoding="utf-8")), printed(tmp_path)
    assert then["figures"].keys() <= now["figures"].keys(), "a figure may be added, none goes"
    for metric, figure in then["figures"].items():
        assert now["figures"][metric] == {
            key: pytest.approx(value, rel=1e-6) if isinstance(value, float) else value for key, value in figure.items()
        }, metric
    assert then["hours"] == now["hours"]
    assert then["log"] == now["log"]
    for name, rows in then.get("rows", {}).items():  # a column may be added
        assert [{key: value for key, value in row.items() if key in rows[0]} for row in now["rows"][name]] == rows
    assert sum(count or 0 for _, count, _ in then["hours"]) > 0
