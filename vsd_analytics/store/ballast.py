"""Ballast: room held in `store/.ballast`, thrown overboard when a full disk would stop a fold."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

from vsd_analytics.store.durable import fsync_dir, remove

NAME = ".ballast"
ROOM = 10
"""Ballast is taken when the disk has this many times as much free."""


def is_kept(store: Path) -> bool:
    """Tell whether the store has its ballast."""
    return (store / NAME).exists()


def keep(store: Path, *, n_bytes: int) -> None:
    """Take ballast when there is none, the disk has plenty of room and the store outweighs it; 0 bytes: have none.

    A disk that refuses is no error: ballast is a convenience. The caller holds the store's lock.

    Args:
        store: The store folder.
        n_bytes: How much.
    """
    with contextlib.suppress(OSError):
        if n_bytes == 0:
            remove(store / NAME)
        elif not is_kept(store) and shutil.disk_usage(store).free >= ROOM * n_bytes and _outweighs(store, n_bytes):
            _take(store, n_bytes)


def give_up(store: Path) -> bool:
    """Remove the ballast, so that its room can be used; tell whether there was any."""
    if not is_kept(store):
        return False
    with contextlib.suppress(OSError):
        remove(store / NAME)
        fsync_dir(store)  # journalling file systems free the room with this
        return True
    return False


def _outweighs(store: Path, n_bytes: int) -> bool:
    total = 0
    for path in store.rglob("*.parquet"):
        total += path.stat().st_size
        if total > n_bytes:
            return True
    return False


def _take(store: Path, n_bytes: int) -> None:
    temporary = store / f"{NAME}.{os.getpid()}.tmp"
    try:
        with temporary.open("wb") as f:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(f.fileno(), 0, n_bytes)
            else:
                for _ in range(0, n_bytes, 1 << 20):
                    f.write(b"\0" * (1 << 20))
        temporary.rename(store / NAME)
    except OSError:
        remove(temporary)
        raise
