"""Superseded fact files, which newer ones replace: removed only while nobody reads facts, so no query loses a file.

A reader holds a shared flock(2) on the folder `facts`. Removal needs the lock exclusively; while somebody reads, the
files stay until the next build. The kernel releases the lock when a process dies.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path

from vsd_analytics.store.durable import is_temporary, make_dirs, remove
from vsd_analytics.store.file_locks import folder_lock, has_locks
from vsd_analytics.store.layout import list_parts
from vsd_analytics.store.published import published_files, sweep_generations
from vsd_analytics.warehouse.sealed import SealedRange
from vsd_analytics.warehouse.week_files import DAYS
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS


@contextlib.contextmanager
def reading(root: Path) -> Iterator[None]:
    """Hold the lock against removal of fact files below `root`. A read-only disk needs none: nobody can remove any."""
    with contextlib.suppress(OSError):
        make_dirs(root)
    with folder_lock(root, is_shared=True) if root.is_dir() else contextlib.nullcontext():
        yield


def find(
    roots: Mapping[str, Path],
    *,
    site_id: str,
    fresh: Mapping[str, Mapping[int, Path]],
    sealed: SealedRange,
    first_day: int | None,
    last_day: int | None,
) -> tuple[Path, ...]:
    """Return the fact files of a range of UTC days, and of the whole weeks in it, that are not the fresh ones.

    Args:
        roots: Folder of each fact.
        site_id: The site.
        fresh: Fresh file by fact and UTC day, which is that of a week or of the day alone.
        sealed: What is sealed of the range; the purge removes the files of whole sealed days.
        first_day: First UTC day number; None = open.
        last_day: Last one, inclusive; None = open.
    """
    first, last = (None if first_day is None else first_day * 24), (None if last_day is None else last_day * 24 + 23)
    paths = [
        part.path
        for name, root in roots.items()
        for part in list_parts(root, name, site_id, first_hour=first, last_hour=last)
        if part.hour // 24 not in sealed.whole_days and part.path != fresh.get(name, {}).get(part.hour // 24)
    ]
    last_monday = None if last is None else last - DAYS * 24 + 1
    for name, root in roots.items():
        weeks = list_parts(root / WEEKS, name, site_id, first_hour=first, last_hour=last_monday)
        paths += [week.path for week in weeks if week.path not in fresh.get(name, {}).values()]
    return tuple(paths)


def temporaries(root: Path) -> list[Path]:
    """Return the temporary files below `facts`. Under the lock of `clear` nobody writes: their writers are dead."""
    return [path for path in root.rglob(".*.tmp") if is_temporary(path)]


def clear(root: Path, paths: Sequence[Path], *, has_published: bool = False) -> bool:
    """Remove superseded files unless somebody may read facts; return whether they were removed.

    Args:
        root: The folder `facts`.
        paths: The files. What `published/current` names stays until a build of everything publishes others.
        has_published: Remove the generations of `published/` before the current one too.
    """
    if not paths and not has_published:
        return True
    if not has_locks():
        return False
    try:
        with folder_lock(root, is_waiting=False):
            published = published_files(root.parent) if paths else frozenset()
            going = [path for path in paths if path.relative_to(root.parent) not in published]
            for path in going:
                remove(path)
            _remove_empty(root, going)
            if has_published:
                sweep_generations(root.parent)
    except BlockingIOError:
        return False
    return True


def _remove_empty(root: Path, paths: Iterable[Path]) -> None:
    """Remove the folders below `root` that the removal of files left empty. Nobody writes into them under the lock."""
    for deepest in sorted({path.parent for path in paths}):
        with contextlib.suppress(OSError):  # the first that is not empty ends the climb
            for folder in takewhile(root.__ne__, (deepest, *deepest.parents)):
                folder.rmdir()
