"""Locks on files and folders, which the kernel releases when their process dies: flock(2).

Windows has none. There a project can be read: nobody writes into it, so a reader needs no lock. Facts are files that
can be made again; a reader writes them under a temporary name, and removes none. All other writers are refused (E130),
since without locks two of them could write at once.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from vsd_analytics.errors import DiskError, Where


def has_locks() -> bool:
    """Return whether this platform has flock(2)."""
    try:
        import fcntl  # noqa: F401  (missing on Windows)
    except ImportError:
        return False
    return True


def require_locks(path: Path) -> None:
    """Raise DiskError E130 on a platform without locks: nothing is written there.

    Args:
        path: What was to be written, for the error.
    """
    if not has_locks():
        raise DiskError(
            "nothing can be written on this platform",
            code="E130",
            where=Where(str(path)),
            why="writing needs file locks and durable renames, as Linux and macOS have them; reading works",
            fix="write on Linux, macOS or in WSL, and read the project or a copy of it here with vsd_analytics.open",
        )


def take(fd: int, *, is_shared: bool = False, is_waiting: bool = True) -> None:
    """Lock an open file or folder until it is closed, or its process dies.

    Args:
        fd: Its descriptor.
        is_shared: Others may hold it too, if they share it as well.
        is_waiting: Wait until it is free.

    Raises:
        BlockingIOError: Somebody holds it, and `is_waiting` is False.
        OSError: The file system has no locks.
    """
    import fcntl

    fcntl.flock(fd, (fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX) | (0 if is_waiting else fcntl.LOCK_NB))


@contextlib.contextmanager
def folder_lock(folder: Path, *, is_shared: bool = False, is_waiting: bool = True) -> Iterator[None]:
    """Hold the lock of a folder that exists. A shared one is not needed where nobody can write.

    Raises:
        BlockingIOError: Somebody holds it, and `is_waiting` is False.
        DiskError: E130, the platform has no locks and this one is not shared.
    """
    if is_shared and not has_locks():
        yield
        return
    require_locks(folder)
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        take(fd, is_shared=is_shared, is_waiting=is_waiting)
        yield
    finally:
        os.close(fd)
