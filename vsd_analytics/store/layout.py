"""Paths of the files of a store, and how to read their names.

```
store/.lock
store/live/<table>/<digest>.parquet                                   acknowledged, not yet folded (the spool)
store/<table>/site=<site>/date=<YYYY-MM-DD>/<HH>-<digest>.parquet     UTC; sorted; no key twice in the whole store
```
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, date, datetime
from functools import lru_cache
from pathlib import Path

from vsd_analytics.schema import TableName

HOUR_MS = 3_600_000
_PART = re.compile(r"^(?P<hour>[01]\d|2[0-3])-(?P<digest>[0-9a-f]{16})\.parquet$")
_SEGMENT = re.compile(r"^[0-9a-f]{16}\.parquet$")
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
    return root / table / f"site={site_id}" / f"date={date_of_hour(day * 24).isoformat()}"


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
    return sorted(_parts(root / table / f"site={site_id}", first_hour, last_hour))


def list_days(root: Path, table: str, site_id: str) -> list[int]:
    """Return the UTC day numbers (days since 1970) that have files of a table, in order; see `list_parts`."""
    return sorted(midnight // 24 for day, midnight in _days(root / table / f"site={site_id}") if any(day.iterdir()))


def _days(folder: Path) -> Iterator[tuple[Path, int]]:
    """Yield the folders of days with the number of their first UTC hour."""
    for day in folder.iterdir() if folder.is_dir() else ():
        match = _DATE.match(day.name)
        try:
            if match is not None:
                yield day, int(datetime.fromisoformat(match[1]).replace(tzinfo=UTC).timestamp()) // 3600
        except ValueError:
            continue


def _parts(folder: Path, first_hour: int | None, last_hour: int | None) -> Iterator[Part]:
    for day, midnight in _days(folder):
        if (first_hour is not None and midnight + 23 < first_hour) or (last_hour is not None and midnight > last_hour):
            continue
        for path in day.iterdir():
            part = _PART.match(path.name)
            if part is None:
                continue
            hour = midnight + int(part["hour"])
            if (first_hour is None or hour >= first_hour) and (last_hour is None or hour <= last_hour):
                yield Part(hour, part["digest"], path)
