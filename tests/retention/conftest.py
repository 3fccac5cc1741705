"""One project of three days, stored and built, from which these tests take copies."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from aged_projects import DAYS, make_project, three_days, vsd


@pytest.fixture(scope="session")
def stored_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_project(tmp_path_factory.mktemp("kept") / "p")
    vsd(root, "ingest", str(three_days(root)))
    vsd(root, "build")
    return root


@pytest.fixture
def project(stored_once: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stored_once, tmp_path / "p"))


@pytest.fixture(scope="session")
def purged_once(stored_once: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the project whose first two days are sealed."""
    root = Path(shutil.copytree(stored_once, tmp_path_factory.mktemp("purged") / "p"))
    vsd(root, "purge", "--older-than", DAYS[2], "--force", "--reason", "retention")
    return root


@pytest.fixture
def purged(purged_once: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(purged_once, tmp_path / "q"))
