"""One listener per project: the lock that the kernel releases when its process dies."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from vsd_analytics.errors import LiveError, Where
from vsd_analytics.live.process import only_one
from vsd_analytics.live.status import read_status
from vsd_analytics.store.durable import make_dirs


@contextlib.contextmanager
def alone(root: Path) -> Iterator[None]:
    """Hold the lock of a project's listener; the kernel releases it when the process dies.

    Raises:
        LiveError: E706, another listener of this project holds it.
    """
    lock = root / "status" / "listen.lock"
    make_dirs(lock.parent)

    def refusal() -> LiveError:
        return LiveError(
            "a listener of this project is running already",
            code="E706",
            where=Where(str(lock)),
            why=f"its process id is {(read_status(root) or {}).get('pid', 'unknown')}",
            fix="stop it first (systemctl stop vsd-listen), or look at it: vsd doctor",
        )

    with only_one(lock, refusal=refusal):
        yield
