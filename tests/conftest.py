"""Fixtures every test may use."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

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
