"""Week files: the rows of seven small files of a relation, one for each day, as one file that later reports read.

A report reads ten weeks. Opening 70 small files of a relation costs more than their rows do.

```
facts/weeks/<relation>/site=<site>/date=<Monday>/00-<fingerprint>.parquet
```

The fingerprint covers the names of the seven files, which hold the fingerprints of all inputs. So a week file is fresh
as long as each of its days is, and has their rows in their order. The days' files stay: ranges that begin or end in
the middle of a week read those. That of `camera_days` also has what its seven files note about their parts.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.store.durable import is_temporary, publish, sweep_temporaries
from vsd_analytics.store.layout import unit_folder
from vsd_analytics.store.seals import DAY_FACT
from vsd_analytics.warehouse.fact_days import is_whole
from vsd_analytics.warehouse.factfiles import fact_bytes, is_undamaged
from vsd_analytics.warehouse.input_fingerprint import text_hash
from vsd_analytics.warehouse.reach import spans_of_week

FOLDER = "weeks"
DAYS = 7
MEMBERS = "files"
"""Key under which the metadata of a week file notes the names of the seven files."""
_MONDAY = 4
"""UTC day number of the first Monday of 1970."""
_RUNNING_DAYS = 7
"""Days at the end of a range that get no week file: late records may still change them."""
_BYTES_MAX = 1_000_000
"""Of larger files the rows cost more than opening them, and a second copy would need the disk."""


@dataclass(frozen=True, slots=True)
class WeekFile:
    """The file of one relation and week.

    Attributes:
        name: The relation.
        first_day: UTC day number of its Monday.
        path: Its path, whether it exists or not.
        members: The files of its seven days.
    """

    name: str
    first_day: int
    path: Path
    members: tuple[Path, ...]


def week_fingerprint(name: str, first_day: int, members: Sequence[str]) -> str:
    """Return the fingerprint in the name of a week file, given the names of its seven files."""
    return text_hash([name, first_day, list(members)])


def week_files(root: Path, name: str, site_id: str, paths: Mapping[int, Path]) -> list[WeekFile]:
    """Return the week files of the whole weeks of a range, from Monday to Sunday, without those at its end.

    Args:
        root: Folder of the settings that the files belong to.
        name: The relation.
        site_id: The site.
        paths: The file of each day of the range, by UTC day number.
    """
    if not paths:
        return []
    found = []
    mondays = [d for d in sorted(paths) if (d - _MONDAY) % DAYS == 0 and d + DAYS + _RUNNING_DAYS - 1 <= max(paths)]
    for monday in mondays:
        days = range(monday, monday + DAYS)
        if all(d in paths for d in days):
            members = tuple(paths[d] for d in days)
            fingerprint = week_fingerprint(name, monday, [p.name for p in members])
            folder = unit_folder(root / FOLDER, name, site_id, monday * 24)
            found.append(WeekFile(name, monday, folder / f"00-{fingerprint}.parquet", members))
    return found


def make_week(week: WeekFile) -> bool:
    """Write a week file from its seven files unless it is there; return whether it is.

    It is not written where a day's file is damaged (whoever reads the day says so), where the seven are large, and
    where the disk refuses. Nor where a day has an older file that is yet to be removed: once there is a week file,
    nobody looks into the folders of its days.
    """
    if is_whole(week.path):
        return True
    try:
        if sum(p.stat().st_size for p in week.members) > _BYTES_MAX or any(map(others_of, week.members)):
            return False
        data = [p.read_bytes() for p in week.members]
        if not all(map(is_undamaged, data)):
            return False
        files = [pq.ParquetFile(pa.BufferReader(d)) for d in data]
        days = [file.read().replace_schema_metadata(None) for file in files]
        if any(day.schema != days[0].schema for day in days):
            return False
        inputs = {MEMBERS: [p.name for p in week.members]}
        noted = spans_of_week(file.metadata.metadata for file in files) if week.name == DAY_FACT else {}
        publish(week.path, fact_bytes(pa.concat_tables(days), inputs=inputs, noted=noted), is_synced=False)
        sweep_temporaries(week.path.parent)
    except OSError:
        return False
    return True


def by_week(weeks: Iterable[WeekFile], days: Mapping[int, Path]) -> dict[int, Path]:
    """Return the files to read of a range by first UTC day: a week file where it exists, else the files of its days."""
    found = dict(days)
    for week in weeks:
        if is_whole(week.path):
            for day in range(week.first_day, week.first_day + DAYS):
                del found[day]
            found[week.first_day] = week.path
    return dict(sorted(found.items()))


def others_of(path: Path) -> list[Path]:
    """Return the other files in the folder of a day's or week's file: older fingerprints, and temporary files."""
    with contextlib.suppress(FileNotFoundError):
        others = [path.parent / name for name in os.listdir(path.parent) if name != path.name]
        return sorted(p for p in others if p.suffix == ".parquet" or is_temporary(p))
    return []
