"""Paths of the files of a store, and how to read their names.

```
store/.lock
store/live/<table>/<digest>.arrow                                     acknowledged, not yet folded (the spool)
store/<table>/site=<site>/date=<YYYY-MM-DD>/<HH>-<digest>.parquet     UTC; sorted; no key twice in the whole store
```
"""

from __future__ import annotations

import os
import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, date, datetime
from functools import lru_cache
from pathlib import Path

from vsd_analytics.schema import TableName

HOUR_MS = 3_600_000
_EVER = 10**9
"""An hour number after all others."""
_PART = re.compile(r"^(?P<hour>[01]\d|2[0-3])-(?P<digest>[0-9a-f]{16}(?:[0-9a-f]{96})?)\.parquet$")
"""The name of a week file of facts has the fingerprints of its seven days."""
_SEGMENT = re.compile(r"^[0-9a-f]{16}\.(arrow|parquet)$")
_DATE = re.compile(r"^date=(\d{4}-\d{2}-\d{2})$")


@dataclass(frozen=True, slots=True, order=True)
class Part:
    """One immutable Parquet file of one UTC hour.

    Attributes:
        hour: Hours since 1970-01-01T00:00Z.
        digest: Hash of the file's bytes, from its name.
        path: Its path.
    """

    hour: int
    digest: str
    path: Path


def hour_of(ts_ms: int) -> int:
    """Return the UTC hour number (hours since 1970) an instant in milliseconds falls in."""
    return ts_ms // HOUR_MS


def date_of_hour(hour: int) -> date:
    """Return the UTC date of an hour number."""
    return datetime.fromtimestamp(hour * 3600, tz=UTC).date()


def unit_folder(root: Path, table: str, site_id: str, hour: int) -> Path:
    """Return the Hive folder of one hour: `<root>/<table>/site=<site>/date=<UTC date>`."""
    return _day_folder(root, table, site_id, hour // 24)


@lru_cache(maxsize=4096)
def _day_folder(root: Path, table: str, site_id: str, day: int) -> Path:
    # A build asks for the folder of every file several times, and joining paths took longer than opening the files.
    return _site_folder(root, table, site_id) / _date_folder(day)


@lru_cache(maxsize=4096)
def _date_folder(day: int) -> str:
    return f"date={date_of_hour(day * 24).isoformat()}"


@lru_cache(maxsize=256)
def _site_folder(root: Path, table: str, site_id: str) -> Path:
    return root / table / f"site={site_id}"


def segment_paths(store: Path, table: TableName) -> list[Path]:
    """Return the spool's files of one table, by name; foreign names are ignored."""
    folder = store / "live" / table
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if _SEGMENT.match(p.name))


def list_parts(
    root: Path, table: str, site_id: str, *, first_hour: int | None = None, last_hour: int | None = None
) -> list[Part]:
    """Return the parts of a table whose hour lies in [first_hour, last_hour], sorted by hour and digest.

    Args:
        root: The store (or the facts folder, whose files follow the same naming).
        table: Table or fact name.
        site_id: Site.
        first_hour: First UTC hour number; None = open.
        last_hour: Last UTC hour number (inclusive); None = open.
    """
    return sorted(_parts(root, table, site_id, first_hour, last_hour))


def list_days(root: Path, table: str, site_id: str) -> list[int]:
    """Return the UTC day numbers (days since 1970) that have files of a table, in order; see `list_parts`."""
    return [day for day in day_folders(root, table, site_id) if has_parts(root, table, site_id, day)]


def has_parts(root: Path, table: str, site_id: str, day: int) -> bool:
    """Return whether the folder of a UTC day number holds a file of a table."""
    return any(map(_PART.match, _names(_day_folder(root, table, site_id, day))))


def day_folders(root: Path, table: str, site_id: str) -> list[int]:
    """Return the UTC day numbers of the folders of a table, in order; a removal that was killed leaves empty ones."""
    names = _names(_site_folder(root, table, site_id))
    return sorted(day for name in names if (day := _day_of(name)) is not None)


@lru_cache(maxsize=4096)
def _day_of(name: str) -> int | None:
    """Return the UTC day number of a folder's name; None where it is no day's."""
    match = _DATE.match(name)
    try:
        return None if match is None else (date.fromisoformat(match[1]) - date(1970, 1, 1)).days
    except ValueError:
        return None


def _names(folder: Path) -> list[str]:
    """Return the names in a folder, none where it is not there: `iterdir` makes a path of each, which costs more."""
    try:
        return os.listdir(folder)
    except (FileNotFoundError, NotADirectoryError):
        return []


def _parts(root: Path, table: str, site_id: str, first_hour: int | None, last_hour: int | None) -> Iterator[Part]:
    ends = (-_EVER if first_hour is None else first_hour, _EVER if last_hour is None else last_hour)
    days = day_folders(root, table, site_id)
    for day in days[bisect_left(days, ends[0] // 24) : bisect_right(days, ends[1] // 24)]:
        folder = _day_folder(root, table, site_id, day)
        for name in _names(folder):
            part = _PART.match(name)
            if part is not None and ends[0] <= (hour := day * 24 + int(part["hour"])) <= ends[1]:
                yield Part(hour, part["digest"], folder / name)
