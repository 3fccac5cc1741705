"""Fixtures every test may use."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# the same examples in every run, and none fails for being slow: machines are noisy
settings.register_profile("steady", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("steady")

REPOSITORY = Path(__file__).resolve().parent.parent


def _realdata_root() -> Path:
    return Path(os.environ.get("VSD_REALDATA", REPOSITORY.parent / "shared" / "data"))


@pytest.fixture(scope="session")
def realdata() -> Callable[[str], Path]:
    """Return a function from a name below the folder of real recordings to its path; skips where it is absent."""

    def find(name: str) -> Path:
        path = _realdata_root() / name
        if not path.exists():
            pytest.skip(f"real recording {name!r} is not here (set VSD_REALDATA)")
        return path

    return find


@pytest.fixture(scope="session")
def demo_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a demo project with one detailed week, 2026-W46, in its store. Tests leave it as it is."""
    from vsd_analytics.config import load_site
    from vsd_analytics.simulate import write_demo_project
    from vsd_analytics.simulate.demo import ingest_demo

    root = tmp_path_factory.mktemp("demo") / "vsd-demo"
    write_demo_project(root, seed=4, weeks=1)
    ingest_demo(load_site(root), sorted((root / "engine").iterdir()), seed=4)
    return root
