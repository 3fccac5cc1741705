"""Week files of facts: the files of a small fact and a whole week, joined into one that takes their place.

```
facts/weeks/<fact>/site=<site>/date=<Monday>/00-<seven fingerprints>.parquet
```

The name has the fingerprints of the files that it replaces, Monday first, and zeros for a day without records. So a
name says whether the rows of a day are fresh, also to whoever knows the inputs of some of the days only. The file notes
the inputs of its days as their own files did, and each of these can be written from it again.

Opening a small file costs more than its rows do, and a report reads ten weeks of most facts.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.store.durable import publish, sweep_temporaries
from vsd_analytics.store.layout import Part, list_parts, unit_folder
from vsd_analytics.store.own_digest import is_undamaged
from vsd_analytics.store.seals import DAY_FACT
from vsd_analytics.warehouse.factfiles import (
    FactWriter,
    by_hour,
    by_kind,
    damaged_facts,
    is_whole,
    noted_inputs,
)
from vsd_analytics.warehouse.input_fingerprint import InputHashes
from vsd_analytics.warehouse.lookback import Spans, span_metadata, spans_of
from vsd_analytics.warehouse.week_files import DAYS, FOLDER

RUNNING_DAYS = 7
"""Days at the end of the records whose files are not joined: late records may still change them."""
BYTES_MAX = 300_000
"""Of the files of a week together. Of larger ones the rows cost more than opening them."""
NO_RECORDS = "0" * 16
"""Takes the place of the fingerprint of a day without records."""
_MONDAY = 4
"""UTC day number of the first Monday of 1970."""
_EPOCH = date(1970, 1, 1)
_DAY_MS = 86_400_000


@dataclass(frozen=True, slots=True)
class _FileContent:
    """What the file of a day or week has.

    Attributes:
        rows: Its rows.
        inputs: Input hashes by UTC hour number; of `camera_days` by UTC day number.
        spans: What a file of `camera_days` notes about stored parts.
    """

    rows: pa.Table
    inputs: Mapping[int, InputHashes]
    spans: Spans


@dataclass(frozen=True, slots=True)
class FactWeeks:
    """The week files of one fact.

    Attributes:
        root: Folder of the settings that the files belong to.
        name: The fact.
        site_id: The site.
    """

    root: Path
    name: str
    site_id: str

    def files(self, first_day: int | None = None, last_day: int | None = None) -> list[Part]:
        """Return the files of weeks that touch a range of UTC days; also stale ones, and those of an older version."""
        first = None if first_day is None else monday_of(first_day) * 24
        last = None if last_day is None else last_day * 24 + 23
        return list_parts(self.root / FOLDER, self.name, self.site_id, first_hour=first, last_hour=last)

    def joined_paths(self, paths: Mapping[int, Path], *, is_trusting: bool = False) -> dict[int, Path]:
        """Return the file that has the rows of each day: a week's where it has those of all these days of the week.

        Args:
            paths: The file of each day alone, by UTC day number, whether it exists or not.
            is_trusting: Do not open week files whose names are right.
        """
        files = dict(paths)
        for week in self._near(paths):
            prints = fingerprints(week.path)
            own = [day for day in prints if day in paths]
            is_fresh = own and all(prints[day] == _fingerprint(paths[day], day) for day in own)
            if is_fresh and (is_trusting or is_whole(week.path)):
                files |= dict.fromkeys(own, week.path)
        return files

    def split_weeks(self, paths: Mapping[int, Path]) -> None:
        """Write the fresh days of weeks of which other days are stale as files of their own; see `write_days`.

        Args:
            paths: The file of each day alone, by UTC day number, whether it exists or not.
        """
        for week in self._near(paths):
            prints = fingerprints(week.path)
            own = [day for day in prints if day in paths]
            fresh = [day for day in own if prints[day] == _fingerprint(paths[day], day)]
            if len(fresh) < len(own):
                self.write_days(week.path, fresh)

    def write_days(self, week: Path, days: Collection[int]) -> None:
        """Write some days of a week as files of their own, without what damage or the disk refuses."""
        prints = fingerprints(week)
        paths = {day: self._day_path(day, prints[day]) for day in days if prints.get(day, NO_RECORDS) != NO_RECORDS}
        missing = {day: path for day, path in paths.items() if not is_whole(path)}
        with contextlib.suppress(OSError):
            if missing and (content := _read(week, self.name)) is not None:
                for day, path in missing.items():
                    publish(path, _bytes([content], self.name, [day]), is_synced=False)

    def join(
        self, paths: Mapping[int, Path], *, first_day: int | None, last_day: int | None, without: Collection[int]
    ) -> dict[int, Path]:
        """Join the files of whole weeks that are over, and return the file that has the rows of each day.

        A week is not joined where its files are large, where one is damaged (whoever reads it says so), and where the
        disk refuses.

        Args:
            paths: The file that has the rows of each day, by UTC day number; see `joined_paths`.
            first_day: First UTC day of which all files are known; None = open.
            last_day: Last one, inclusive; None = open.
            without: UTC days whose weeks are not joined.
        """
        files = dict(paths)
        last = max(paths, default=0) - RUNNING_DAYS
        for monday in sorted({monday_of(day) for day in paths}):
            week = range(monday, monday + DAYS)
            is_known = (first_day is None or first_day <= monday) and (last_day is None or week[-1] <= last_day)
            if not is_known or week[-1] > last or not set(week).isdisjoint(without):
                continue
            own = {day: paths[day] for day in week if day in paths}
            members = list(dict.fromkeys(own.values()))
            if len(members) > 1 or days_besides(members[0], own):
                joined = self._joined(monday, own, members)
                files |= {} if joined is None else dict.fromkeys(own, joined)
        return files

    def _joined(self, monday: int, paths: Mapping[int, Path], members: Sequence[Path]) -> Path | None:
        """Return the file of a week after writing it from the files of its days; None where it cannot be."""
        week = range(monday, monday + DAYS)
        prints = (_fingerprint(paths[day], day) if day in paths else NO_RECORDS for day in week)
        folder = unit_folder(self.root / FOLDER, self.name, self.site_id, monday * 24)
        path = folder / f"00-{''.join(prints)}.parquet"
        try:
            if sum(member.stat().st_size for member in members) > BYTES_MAX:
                return None
            contents = [content for member in members if (content := _read(member, self.name)) is not None]
            if len(contents) < len(members) or len({content.rows.schema for content in contents}) > 1:
                return None
            publish(path, _bytes(contents, self.name, list(paths)), is_synced=False)
            sweep_temporaries(folder)
        except OSError:
            return None
        return path

    def _near(self, paths: Mapping[int, Path]) -> list[Part]:
        return self.files(min(paths), max(paths)) if paths else []

    def _day_path(self, day: int, fingerprint: str) -> Path:
        return unit_folder(self.root, self.name, self.site_id, day * 24) / f"00-{fingerprint}.parquet"


def monday_of(day: int) -> int:
    """Return the UTC day number of the Monday of a week, given that of one of its days."""
    return day - (day - _MONDAY) % DAYS


def first_day_of(path: Path) -> int:
    """Return the first UTC day number of the file of a day or week."""
    return (date.fromisoformat(path.parent.name.removeprefix("date=")) - _EPOCH).days


def fingerprints(path: Path) -> dict[int, str]:
    """Return the fingerprints of the days in the file of a week by UTC day number; none for any other file."""
    digits = path.stem.partition("-")[2]
    prints = [digits[k : k + 16] for k in range(0, len(digits), 16)]
    return dict(enumerate(prints, first_day_of(path))) if len(prints) == DAYS else {}


def days_besides(path: Path, days: Collection[int]) -> list[int]:
    """Return the UTC days of whose records the file of a week has rows too, besides some days."""
    return [day for day, fingerprint in fingerprints(path).items() if fingerprint != NO_RECORDS and day not in days]


def inputs_in(path: Path, name: str, noted: Mapping[str, Any]) -> dict[int, InputHashes]:
    """Return the input hashes by UTC hour number, of `camera_days` by UTC day number, that a file of a fact notes."""
    first = first_day_of(path) * _numbers(name)
    return {first: noted} if name == DAY_FACT and not fingerprints(path) else dict(by_hour(noted, first))


def day_bytes_of(path: Path, name: str, day: int) -> bytes:
    """Return the bytes of the file of a fact and day, given this file or that of its week.

    Raises:
        StoreError: E302, the file is damaged or gone.
    """
    if fingerprints(path):
        content = _read(path, name) if path.exists() else None
        data = b"" if content is None else _bytes([content], name, [day])
    else:
        data = path.read_bytes() if path.exists() else b""
    if not is_undamaged(data):
        raise damaged_facts(path, "its bytes do not match the digest in it")
    return data


def _fingerprint(path: Path, day: int) -> str:
    """Return the fingerprint of a day, given its file or that of its week."""
    return fingerprints(path).get(day) or path.stem.partition("-")[2]


def _read(path: Path, name: str) -> _FileContent | None:
    """Return what the file of a day or week has; None where it is damaged."""
    data = path.read_bytes()
    if not is_undamaged(data):
        return None
    with pq.ParquetFile(pa.BufferReader(data), pre_buffer=False) as file:
        rows, spans = file.read(use_threads=False).replace_schema_metadata(), spans_of(file.metadata.metadata)
    return _FileContent(rows, inputs_in(path, name, noted_inputs(data)), spans)


def _bytes(contents: Sequence[_FileContent], name: str, days: Sequence[int]) -> bytes:
    """Return the bytes of the file of a day, or of several days of a week."""
    n, inputs = _numbers(name), {k: own for content in contents for k, own in content.inputs.items()}
    own = {k: hashes for k, hashes in inputs.items() if k // n in days}
    spans = {
        digest: span for content in contents for digest, span in content.spans.items() if span[0] // _DAY_MS in days
    }
    if len(days) > 1:
        noted: Mapping[str, Any] = by_kind(own, monday_of(days[0]) * n)
    else:
        noted = own[days[0]] if name == DAY_FACT else by_kind(own, days[0] * n)
    writer = FactWriter(noted, span_metadata(spans))
    column = "utc_day" if name == DAY_FACT else "hour"
    for day in days:
        for content in contents:
            first, after = np.searchsorted(content.rows[column].to_numpy(), [day * n, day * n + n])
            writer.add(content.rows.slice(int(first), int(after - first)))
    return writer.finish()


def _numbers(name: str) -> int:
    """Return how many numbers a day has in the column by which a fact is stored: hours, or the day itself."""
    return 1 if name == DAY_FACT else 24
