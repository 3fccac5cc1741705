"""Writing that survives a power cut: temporary name, fsync, rename, fsync of the folder.

A temporary file has a random name, and its writer holds a lock on it until it is renamed. So a temporary file without
a lock belongs to a dead process. A process id in the name would not show this: two containers can have the same ids.
"""

from __future__ import annotations

import contextlib
import glob
import hashlib
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from vsd_analytics.errors import disk_error
from vsd_analytics.store import file_locks

_TEMPORARY = re.compile(r"^\..+\.([0-9a-f]{16}|\d{1,10})\.tmp$")  # digits alone: version 0.1 wrote its process id


def digest(data: bytes | memoryview) -> str:
    """Return the 16 hexadecimal digits of the BLAKE2b hash that a part has in its name."""
    return hashlib.blake2b(data, digest_size=8).hexdigest()


def file_digest(path: Path) -> str:
    """Return `digest` of a file's bytes, read piece by piece."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=8)).hexdigest()


def fsync_dir(folder: Path) -> None:
    """Make the entries of `folder` durable."""
    file_locks.require_locks(folder)
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    except OSError as error:
        raise disk_error(error, path=folder) or error from None
    finally:
        os.close(fd)


def make_dirs(folder: Path, *, is_synced: bool = True) -> None:
    """Make `folder` and its parents privately (mode 0700), and durably unless `is_synced` is False."""
    if not folder.is_dir():
        make_dirs(folder.parent, is_synced=is_synced)
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        if not is_synced:
            return
        try:
            fsync_dir(folder.parent)
        except OSError:
            with contextlib.suppress(OSError):
                folder.rmdir()  # so that the next try makes it again and syncs it
            raise


def publish(path: Path, data: bytes | memoryview, *, is_synced: bool = True, is_private: bool = False) -> None:
    """Put all of `data` at `path`, durably, or nothing; readers see the file wholly or not at all.

    A failed sync is never tried again on the same file: the system may have dropped what it could not write.

    Args:
        path: Path of the file; its folder is made.
        data: Its bytes.
        is_synced: Wait for the disk; False for what can be made again, in a folder of nothing else.
        is_private: Only the owner may read it (mode 0600).

    Raises:
        DiskError: E304 to E306, the disk is full, read-only or broken; E130, it must be synced and the platform has no
            locks (any other refusal is a plain OSError). Then nothing new is at `path`, and this process leaves no
            temporary file.
    """
    if is_synced:
        file_locks.require_locks(path)
    is_new = False
    try:
        make_dirs(path.parent, is_synced=is_synced)
        with temporary(path, mode=0o600 if is_private else 0o666) as (name, f):
            f.write(data)
            f.flush()
            if is_synced:
                os.fsync(f.fileno())
            elif not file_locks.has_locks():
                f.close()  # Windows renames no open file
            was_there = path.exists()
            name.replace(path)
        if is_synced:
            is_new = not was_there
            fsync_dir(path.parent)
    except BaseException as error:
        if is_new:  # renamed but not durable: the caller hears of a failure, so no reader may find the file
            with contextlib.suppress(OSError):
                path.unlink()
        if isinstance(error, OSError):
            raise disk_error(error, path=path) or error from None
        raise


@contextlib.contextmanager
def temporary(path: Path, *, mode: int = 0o666) -> Iterator[tuple[Path, BinaryIO]]:
    """Yield a new file beside `path` to write and then rename; it is removed at the end unless it was renamed.

    Args:
        path: Path the file will be renamed to; its folder exists.
        mode: Permissions, less the umask.

    Raises:
        OSError: The file cannot be made.
    """
    name, f = _locked_file(path, mode)
    try:
        with f:
            yield name, f
    finally:
        with contextlib.suppress(OSError):
            name.unlink()


def _locked_file(path: Path, mode: int) -> tuple[Path, BinaryIO]:
    while True:
        name = path.with_name(f".{path.name}.{os.urandom(8).hex()}.tmp")
        f = os.fdopen(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb")
        if not file_locks.has_locks():
            return name, f
        with contextlib.suppress(OSError):  # a file system without locks: nobody sweeps there either
            file_locks.take(f.fileno())
        if name.exists():
            return name, f
        f.close()  # another process swept it between opening and locking: try a new name


def remove(path: Path) -> None:
    """Unlink `path`; it may be gone already."""
    with contextlib.suppress(FileNotFoundError):
        path.unlink()


@contextlib.contextmanager
def exclusive(lock: Path) -> Iterator[None]:
    """Hold an flock(2) on `lock`; the kernel releases it when the process dies.

    Raises:
        DiskError: E130, the platform has no locks; E304 to E306, the disk refused.
    """
    file_locks.require_locks(lock)
    try:
        make_dirs(lock.parent)
        f = lock.open("a")
    except OSError as error:
        raise disk_error(error, path=lock) or error from None
    with f:
        file_locks.take(f.fileno())
        yield


def sweep_temporaries(folder: Path, *, file_name: str | None = None) -> int:
    """Remove temporary files that dead processes left; return how many.

    Args:
        folder: Where to look.
        file_name: Only temporary files of this file name, directly in `folder`; None = all below `folder`.
    """
    n_swept = 0
    for path in folder.rglob(".*.tmp") if file_name is None else folder.glob(f".{glob.escape(file_name)}.*.tmp"):
        with _held_if_abandoned(path) as is_dead:
            if is_dead:
                remove(path)
                n_swept += 1
    return n_swept


def is_temporary(path: Path) -> bool:
    """Return whether a path has the name of a temporary file of this program."""
    return _TEMPORARY.match(path.name) is not None


def is_abandoned(path: Path) -> bool:
    """Return whether a path is a temporary file whose writer is dead."""
    with _held_if_abandoned(path) as is_dead:
        return is_dead


@contextlib.contextmanager
def _held_if_abandoned(path: Path) -> Iterator[bool]:
    """Yield whether a temporary file is abandoned, and hold its lock meanwhile.

    A writer that has made its file and not locked it yet waits for this lock; then it sees that its file is gone.
    Without locks nobody can tell whether a writer is dead, and no file is abandoned.
    """
    if not file_locks.has_locks():
        yield False
        return
    try:
        fd = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK) if is_temporary(path) else None
    except OSError:  # renamed meanwhile, a link, or the file of another user
        fd = None
    if fd is None:
        yield False
        return
    try:
        try:
            file_locks.take(fd, is_shared=True, is_waiting=False)
            is_free = True
        except OSError:
            is_free = False
        yield is_free and stat.S_ISREG(os.fstat(fd).st_mode)
    finally:
        os.close(fd)


_OURS = re.compile(r"\.(?:\d{4}-W\d{2}[a-z0-9_-]*\.[a-z]+|index\.html)\.(?:[0-9a-f]{16}|\d+)\.tmp")


def sweep_pages(folder: Path) -> None:
    """Remove temporary files of pages, JSON files and figures that dead processes left directly in a folder.

    Temporary files of other programs stay, because a report may be written anywhere (`--out`).
    """
    for path in folder.glob(".*.tmp"):
        if _OURS.fullmatch(path.name) and is_abandoned(path):
            remove(path)
