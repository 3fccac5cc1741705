"""Fact files that newer ones took the place of: they go when nobody reads facts, so that no query loses a file.

Whoever reads facts holds an flock(2) on the folder `facts` together with the other readers; whoever removes leftovers
holds it alone, or leaves them to the next build. The kernel releases it when a process dies.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from vsd_analytics.store.durable import make_dirs, remove
from vsd_analytics.store.layout import Part, list_parts
from vsd_analytics.warehouse.sealed import SealedRange
from vsd_analytics.warehouse.sqlfiles import relations


@contextlib.contextmanager
def reading(root: Path) -> Iterator[None]:
    """Keep the fact files below `root` where they are; on a disk that can only be read nobody removes any."""
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
    """Return the fact files of a range that no reader needs.

    Args:
        root: The folder `facts`.
        site_id: The site.
        hours: Fingerprint of the files to keep, by UTC hour.
        days: Fingerprint of the files of `camera_days` to keep, by UTC day.
        sealed: What is sealed of the range; its files are left to the purge.
        first_hour: First UTC hour number; None = open.
        last_hour: Last one, inclusive; None = open.
    """

    def is_hour_left_over(part: Part) -> bool:
        return not sealed.holds(part.hour) and hours.get(part.hour) != part.digest

    def is_day_left_over(part: Part) -> bool:
        day = part.hour // 24
        if day in days or day in sealed.days or day in sealed.whole_days:
            return day in days and days[day] != part.digest
        is_inside = first_hour is None or day * 24 >= first_hour
        return is_inside and (last_hour is None or day * 24 + 23 <= last_hour)

    found: list[Path] = []
    for relation in relations("facts").values():
        is_day = relation.unit == "day"
        first = first_hour - 48 if is_day and first_hour is not None else first_hour  # a day's file stands at its start
        parts = list_parts(root, relation.name, site_id, first_hour=first, last_hour=last_hour)
        found += [part.path for part in parts if (is_day_left_over if is_day else is_hour_left_over)(part)]
    return tuple(found)


def clear(root: Path, paths: Sequence[Path]) -> bool:
    """Remove leftovers unless somebody reads facts; tell whether they are gone."""
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
