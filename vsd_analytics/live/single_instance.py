"""Work that only one process may do, such as listening: a lock that the kernel releases when the process dies."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from vsd_analytics.errors import LiveError, Where
from vsd_analytics.live.status import read_status
from vsd_analytics.store import file_locks
from vsd_analytics.store.durable import make_dirs


@contextlib.contextmanager
def single_listener(root: Path) -> Iterator[None]:
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

    with single_instance(lock, refusal=refusal):
        yield


@contextlib.contextmanager
def single_instance(lock: Path, *, refusal: Callable[[], LiveError]) -> Iterator[None]:
    """Hold a lock file; the kernel releases it when the process dies.

    Args:
        lock: The file; its folder exists.
        refusal: Makes the error for when another process holds the lock.

    Raises:
        LiveError: Another process holds the lock.
        DiskError: E130, the platform has no locks.
    """
    file_locks.require_locks(lock)
    with lock.open("a") as file:
        try:
            file_locks.take(file.fileno(), is_waiting=False)
        except OSError:
            raise refusal() from None
        yield


def is_alive(pid: object) -> bool:
    """Return whether a process with this id is running."""
    if not isinstance(pid, int) or pid <= 0:
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
