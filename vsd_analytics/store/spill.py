"""A private folder for what DuckDB cannot hold in memory, removed when its process ends or by the next one.

It holds rows about people, so nobody else may read it: it has a random name and mode 0700. Its process holds an
flock(2) on it. The kernel releases that lock however the process dies, and the next process removes a folder without
a lock. A process id would not show this: two containers that share a temporary folder can have the same ids.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
from itertools import count
from pathlib import Path

from vsd_analytics.store import file_locks

PREFIX = "vsd-spill-"
_made: dict[int, Path] = {}
_numbers = count()


def new_folder() -> Path:
    """Return an unused path in this process's private folder; DuckDB makes a folder there to spill."""
    folder = _made.get(os.getpid())  # a fork makes its own
    if folder is None or not folder.is_dir():
        folder = _made[os.getpid()] = _make()
    return folder / str(next(_numbers))


def leave() -> None:
    """Remove this process's folder: at its end, which Python does not see when it is left by `os._exit`."""
    if (folder := _made.pop(os.getpid(), None)) is not None:
        shutil.rmtree(folder, ignore_errors=True)


def _make() -> Path:
    """Return a new private folder that is locked until this process dies."""
    import tempfile

    sweep(Path(tempfile.gettempdir()))
    atexit.register(leave)
    while (folder := _locked(Path(tempfile.mkdtemp(prefix=PREFIX)))) is None:
        pass
    return folder


def _locked(folder: Path) -> Path | None:
    """Lock a new folder; return None when the sweep of another process was faster."""
    if not file_locks.has_locks():  # then nobody sweeps either
        return folder
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return None
    try:
        file_locks.take(lock, is_waiting=False)
    except BlockingIOError:
        os.close(lock)
        return None
    except OSError:  # a file system without locks: no sweep can lock the folder either, so it stays
        return folder
    if folder.exists():
        return folder
    os.close(lock)
    return None


def sweep(parent: Path) -> None:
    """Remove the folders of this user in `parent` whose processes are dead."""
    if not file_locks.has_locks():
        return
    for folder in parent.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):  # another user's, no folder, a link, locked, or removed meanwhile
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                if os.fstat(lock).st_uid == os.geteuid():
                    file_locks.take(lock, is_waiting=False)
                    shutil.rmtree(folder)
            finally:
                os.close(lock)
