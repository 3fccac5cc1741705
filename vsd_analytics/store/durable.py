"""Writing that survives a power cut: temporary name, fsync, rename, fsync of the folder."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

from vsd_analytics.errors import disk_error

_TEMPORARY = re.compile(r"^\..+\.(?P<pid>\d{1,10})\.tmp$")


def digest(data: bytes | memoryview) -> str:
    """Return the 16 hexadecimal digits of the BLAKE2b hash that stand in a part's name."""
    return hashlib.blake2b(data, digest_size=8).hexdigest()


def file_digest(path: Path) -> str:
    """Return `digest` of a file's bytes, read piece by piece."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=8)).hexdigest()


def fsync_dir(folder: Path) -> None:
    """Make the entries of `folder` durable."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    except OSError as error:
        raise disk_error(error, path=folder) or error from None
    finally:
        os.close(fd)


def make_dirs(folder: Path) -> None:
    """Make `folder` and its parents, durably and privately (mode 0700)."""
    if not folder.is_dir():
        make_dirs(folder.parent)
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        try:
            fsync_dir(folder.parent)
        except OSError:
            with contextlib.suppress(OSError):
                folder.rmdir()  # so that the next try makes and syncs it anew
            raise


def publish(path: Path, data: bytes | memoryview, *, is_synced: bool = True, is_private: bool = False) -> None:
    """Put all of `data` at `path`, durably, or nothing; readers see the file wholly or not at all.

    A failed sync is never tried again on the same file: the system may have dropped what it could not write.

    Args:
        path: Where the file shall stand; its folder is made.
        data: Its bytes.
        is_synced: Wait for the disk; False for what can be made again.
        is_private: Only the owner may read it (mode 0600).

    Raises:
        DiskError: E304 to E306, the disk is full, read-only or broken (any other refusal is a plain OSError). Nothing
            new stands at `path` then, and no temporary file is left by a live process.
    """
    temporary = path.parent / f".{path.name}.{os.getpid()}.tmp"
    withdrawn = temporary
    try:
        make_dirs(path.parent)
        with temporary.open("wb") as f:
            if is_private:
                os.fchmod(f.fileno(), 0o600)
            f.write(data)
            f.flush()
            if is_synced:
                os.fsync(f.fileno())
        is_new = not path.exists()
        temporary.rename(path)
        if is_synced:
            withdrawn = path if is_new else temporary
            fsync_dir(path.parent)
    except BaseException as error:
        with contextlib.suppress(OSError):
            withdrawn.unlink()
        if isinstance(error, OSError):
            raise disk_error(error, path=path) or error from None
        raise


def remove(path: Path) -> None:
    """Unlink `path`; it may be gone already."""
    with contextlib.suppress(FileNotFoundError):
        path.unlink()


@contextlib.contextmanager
def exclusive(lock: Path) -> Iterator[None]:
    """Hold an flock(2) on `lock`; the kernel releases it when the process dies."""
    try:
        make_dirs(lock.parent)
        f = lock.open("a")
    except OSError as error:
        raise disk_error(error, path=lock) or error from None
    with f:
        fcntl.flock(f, fcntl.LOCK_EX)
        yield


def sweep_temporaries(folder: Path) -> int:
    """Remove temporary files that dead processes left below `folder`; return how many."""
    n_swept = 0
    for path in folder.rglob(".*.tmp"):
        pid = writer_of(path)
        if pid is not None and not is_alive(pid):
            remove(path)
            n_swept += 1
    return n_swept


def writer_of(path: Path) -> int | None:
    """Return the id of the process a temporary file is of, or None for any other file."""
    match = _TEMPORARY.match(path.name)
    return int(match["pid"]) if match else None


def is_alive(pid: int) -> bool:
    """Tell whether a process exists."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True
