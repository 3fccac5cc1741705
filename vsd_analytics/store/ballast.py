"""Ballast: disk space reserved in `store/.ballast` and released when a full disk would stop a fold."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

from vsd_analytics.store.durable import fsync_dir, remove, temporary

NAME = ".ballast"
ROOM = 10
"""The ballast is reserved only while the disk has this many times its size free."""


def is_held(store: Path) -> bool:
    """Return whether the store has its ballast."""
    return (store / NAME).exists()


def hold(store: Path, *, n_bytes: int) -> None:
    """Reserve the ballast when it is missing, the disk has plenty of space and the store is larger than the ballast.

    A disk that refuses is no error: ballast is a convenience. The caller holds the store's lock.

    Args:
        store: The store folder.
        n_bytes: Size of the ballast in bytes; 0 removes it.
    """
    with contextlib.suppress(OSError):
        if n_bytes == 0:
            remove(store / NAME)
        elif not is_held(store) and shutil.disk_usage(store).free >= ROOM * n_bytes and _outweighs(store, n_bytes):
            _take(store, n_bytes)


def give_up(store: Path) -> bool:
    """Remove the ballast, so that its space can be used; return whether there was any."""
    if not is_held(store):
        return False
    with contextlib.suppress(OSError):
        remove(store / NAME)
        fsync_dir(store)  # journalling file systems free the space only with this
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
    with temporary(store / NAME) as (name, f):
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(f.fileno(), 0, n_bytes)
        else:
            for _ in range(0, n_bytes, 1 << 20):
                f.write(b"\0" * (1 << 20))
            f.flush()
        name.rename(store / NAME)
