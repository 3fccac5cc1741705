"""Writing that survives a power cut: temporary name, fsync, rename, fsync of the folder."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

_TEMPORARY = re.compile(r"^\..+\.(?P<pid>\d+)\.tmp$")


def digest(data: bytes | memoryview) -> str:
    """Return the 16 hexadecimal digits of the BLAKE2b hash that stand in a part's name."""
    return hashlib.blake2b(data, digest_size=8).hexdigest()


def fsync_dir(folder: Path) -> None:
    """Make the entries of `folder` durable."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def make_dirs(folder: Path) -> None:
    """Make `folder` and its parents, durably and privately (mode 0700)."""
    if not folder.is_dir():
        make_dirs(folder.parent)
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        fsync_dir(folder.parent)


def publish(path: Path, data: bytes | memoryview) -> None:
    """Put all of `data` at `path`, durably, or nothing; readers see the file wholly or not at all.

    Args:
        path: Where the file shall stand; its folder is made.
        data: Its bytes.

    Raises:
        OSError: The disk refused; nothing stands at `path` then, and no temporary file is left by a live process.
    """
    make_dirs(path.parent)
    temporary = path.parent / f".{path.name}.{os.getpid()}.tmp"
    try:
        with temporary.open("wb") as f:
            f.write(data)
            f.flush()
            os.fsync(f.fileno())
        temporary.rename(path)
        fsync_dir(path.parent)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def remove(path: Path) -> None:
    """Unlink `path`; it may be gone already."""
    with contextlib.suppress(FileNotFoundError):
        path.unlink()


@contextlib.contextmanager
def exclusive(lock: Path) -> Iterator[None]:
    """Hold an flock(2) on `lock`; the kernel releases it when the process dies."""
    make_dirs(lock.parent)
    with lock.open("a") as f:
        fcntl.flock(f, fcntl.LOCK_EX)
        yield


def sweep_temporaries(folder: Path) -> int:
    """Remove temporary files that dead processes left below `folder`; return how many."""
    n_swept = 0
    for path in folder.rglob(".*.tmp"):
        match = _TEMPORARY.match(path.name)
        if match and not _is_alive(int(match["pid"])):
            remove(path)
            n_swept += 1
    return n_swept


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
