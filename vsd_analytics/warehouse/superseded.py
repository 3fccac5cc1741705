"""Superseded fact files, which newer ones replace: removed only while nobody reads facts, so no query loses a file.

A reader holds a shared flock(2) on the folder `facts`. Removal needs the lock exclusively; while somebody reads, the
files stay until the next build. The kernel releases the lock when a process dies.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from vsd_analytics.store.durable import is_temporary, make_dirs, remove
from vsd_analytics.store.layout import Part, list_parts
from vsd_analytics.warehouse.sealed import SealedRange
from vsd_analytics.warehouse.sqlfiles import relations


@contextlib.contextmanager
def reading(root: Path) -> Iterator[None]:
    """Hold the lock against removal of fact files below `root`. A read-only disk needs none: nobody can remove any."""
    with contextlib.suppress(OSError):
        make_dirs(root)
    if not root.is_dir():
        yield
        return
    fd = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(fd, fcntl.LOCK_SH)
        yield
    finally:
        os.close(fd)


def find(
    root: Path,
    *,
    site_id: str,
    hours: Mapping[int, str],
    days: Mapping[int, str],
    sealed: SealedRange,
    first_hour: int | None,
    last_hour: int | None,
) -> tuple[Path, ...]:
    """Return the fact files of a range whose fingerprint is not the fresh one.

    Args:
        root: The folder `facts`.
        site_id: The site.
        hours: Fresh fingerprint by UTC hour.
        days: Fresh fingerprint of `camera_days` by UTC day.
        sealed: Sealed hours and days of the range; the purge removes their files.
        first_hour: First UTC hour number; None = open.
        last_hour: Last one, inclusive; None = open.
    """

    def is_hour_superseded(part: Part) -> bool:
        return not sealed.holds(part.hour) and hours.get(part.hour) != part.digest

    def is_day_superseded(part: Part) -> bool:
        day = part.hour // 24
        if day in days or day in sealed.days or day in sealed.whole_days:
            return day in days and days[day] != part.digest
        # A day without records has no fresh file. Remove one only if the range holds the whole day: the build of a part
        # of it does not know whether its other hours have records.
        is_inside = first_hour is None or day * 24 >= first_hour
        return is_inside and (last_hour is None or day * 24 + 23 <= last_hour)

    found: list[Path] = []
    for relation in relations("facts").values():
        is_day = relation.unit == "day"
        # The file of a day lies in its first hour, up to 23 hours before the range; 48 hours include the day before.
        first = first_hour - 48 if is_day and first_hour is not None else first_hour
        parts = list_parts(root, relation.name, site_id, first_hour=first, last_hour=last_hour)
        found += [part.path for part in parts if (is_day_superseded if is_day else is_hour_superseded)(part)]
    return tuple(found)


def temporaries(root: Path) -> list[Path]:
    """Return the temporary files below `facts`. Under the lock of `clear` nobody writes: their writers are dead."""
    return [path for path in root.rglob(".*.tmp") if is_temporary(path)]


def clear(root: Path, paths: Sequence[Path]) -> bool:
    """Remove superseded files unless somebody reads facts; return whether they were removed."""
    if not paths:
        return True
    fd = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for path in paths:
            remove(path)
    except BlockingIOError:
        return False
    finally:
        os.close(fd)
    return True
