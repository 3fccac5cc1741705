"""The watched folder: which files wait in it, where they are moved, and the lock that lets one process take them."""

from __future__ import annotations

import contextlib
import heapq
import os
import stat
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from vsd_analytics.errors import InputError, LiveError, UsageError, Where
from vsd_analytics.ingest.intake.pipeline import SourceResult
from vsd_analytics.ingest.intake.watched_folders import DONE, FAILED, INBOX, LOCK
from vsd_analytics.ingest.reading.adapter import Source
from vsd_analytics.live.single_instance import single_instance
from vsd_analytics.owners import is_there
from vsd_analytics.site.model import Site
from vsd_analytics.store.durable import publish

UNFINISHED = (".part", ".tmp")
LOOKED_AT = 10_000
"""The oldest files; their size and time are remembered between two listings."""
NAME_MAX_BYTES = 255

_OWN_FOLDERS = ("store", "facts", "quarantine", "secrets", "status")


@dataclass(frozen=True, slots=True, order=True)
class Waiting:
    """A file in the folder, ordered by age.

    Attributes:
        mtime_ns: When it was last written.
        name: Its name.
        size_bytes: Its size.
        inode: Its number, which distinguishes two files with one name.
    """

    mtime_ns: int
    name: str
    size_bytes: int
    inode: int


def waiting(folder: Path, *, known: Collection[Waiting] = (), limit: int = LOOKED_AT) -> tuple[list[Waiting], int]:
    """Return the oldest files that wait in a folder, and the number of all that wait.

    Args:
        folder: The folder.
        known: Files to leave out.
        limit: Most files to return, so that memory is bounded.
    """
    n_open = 0

    def files() -> Iterator[Waiting]:
        nonlocal n_open
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.startswith(".") or entry.name.lower().endswith(UNFINISHED):
                    continue
                try:
                    about = entry.stat(follow_symlinks=False)
                except FileNotFoundError:
                    continue
                file = _waiting(entry.name, about)
                if stat.S_ISREG(about.st_mode) and file not in known:
                    n_open += 1
                    yield file

    return heapq.nsmallest(limit, files()), n_open


def as_it_is(folder: Path, name: str) -> Waiting:
    """Return the current state of a file of the folder; FileNotFoundError when it is gone."""
    return _waiting(name, (folder / name).stat(follow_symlinks=False))


def to_done(folder: Path, file: Waiting) -> None:
    """Move a file to `done/`; nothing there is ever replaced."""
    (folder / file.name).rename(_free(folder / DONE, file))


def to_failed(folder: Path, file: Waiting, result: SourceResult) -> None:
    """Move a file to `failed/`, with a text beside it that says why."""
    target = _free(folder / FAILED, file)
    publish(_beside(target), _why(result).encode())
    (folder / file.name).rename(target)


def refuse_folder(site: Site, folder: Path) -> None:
    """Refuse to watch a path that is no folder (InputError E201) or a folder of the project (UsageError E101)."""
    if not is_there(folder) or not folder.is_dir():
        raise InputError(
            f"there is no folder {Source(folder).name}", code="E201", fix="make it, or check the path and the spelling"
        )
    here, root = folder.resolve(), site.root.resolve()
    if here == root or any(here.is_relative_to(root / name) for name in _OWN_FOLDERS):
        raise UsageError(
            f"{Source(folder).name} cannot be watched: it is a folder of the project itself",
            why="the watcher moves every file in a watched folder away",
            fix=f"--watch {Source(site.root).name}/{INBOX}",
        )


@contextlib.contextmanager
def single_watcher(folder: Path) -> Iterator[None]:
    """Hold the lock of a watched folder; LiveError E707 when another process does."""
    refusal = partial(
        LiveError,
        "another process watches this folder",
        code="E707",
        where=Where(Source(folder).name),
        fix="stop it first; vsd doctor shows whether it runs",
    )
    with single_instance(folder / LOCK, refusal=refusal):
        yield


def _waiting(name: str, about: os.stat_result) -> Waiting:
    return Waiting(about.st_mtime_ns, name, about.st_size, about.st_ino)


def _free(folder: Path, file: Waiting) -> Path:
    """Return an unused path in `folder`: the file's name, with its time before it when the name is taken."""
    target, n = folder / file.name, 0
    while os.path.lexists(target) or os.path.lexists(_beside(target)):
        front = f"{file.mtime_ns}-{f'{n}-' if n else ''}".encode()
        target = folder / os.fsdecode(front + os.fsencode(file.name)[-(NAME_MAX_BYTES - len(front)) :])
        n += 1
    return target


def _beside(target: Path) -> Path:
    """Return the path of the text that says why `target` failed, short enough for a file system."""
    end = b".why.txt"
    return target.parent / os.fsdecode(os.fsencode(target.name)[: NAME_MAX_BYTES - 40 - len(end)] + end)


def _why(result: SourceResult) -> str:
    error = result.error
    assert error is not None
    n = sum(result.n_records.values())
    lines = [
        f"{error.code}: {error.what}",
        f"file: {result.source}" + (f", line {error.where.line}" if error.where and error.where.line else ""),
        *([f"why: {error.why}"] if error.why else []),
        *([f"fix: {error.fix}"] if error.fix else []),
        f"stored: {n:,} records that came before the error; they are recognised when the file comes again",
        f"more: vsd explain {error.code}",
    ]
    return "".join("".join(c if c.isprintable() else "\ufffd" for c in line) + "\n" for line in lines)
