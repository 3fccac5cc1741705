"""Processes of this machine: is one running, how much memory has this one taken, and work only one may do."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from vsd_analytics.errors import LiveError
from vsd_analytics.store import file_locks


@contextlib.contextmanager
def only_one(lock: Path, *, refusal: Callable[[], LiveError]) -> Iterator[None]:
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


def peak_mb() -> float:
    """Return the peak resident memory of this process, in megabytes (10^6 bytes)."""
    import resource  # missing on Windows

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak * (1 if sys.platform == "darwin" else 1024) / 1e6, 1)
