"""Week files of marts: the rows of the days of a week of one mart, as one file that later reports read.

```
facts/weeks/<mart>/site=<site>/date=<Monday>/00-<fingerprint>.parquet
```

The name holds the fingerprint of the inputs of each of its days, and the file notes them. So a file under the right
name is fresh, and of another one the rows of the days whose inputs did not change are used again.

Marts have no other files. A mart by `site_day` has the Sunday before the Monday too, which ends on it: a range of whole
weeks reads the site days that touch it.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.store.durable import is_temporary, publish, sweep_temporaries
from vsd_analytics.store.layout import unit_folder
from vsd_analytics.store.own_digest import is_undamaged
from vsd_analytics.warehouse.factfiles import FactWriter, by_hour, by_kind, noted_inputs
from vsd_analytics.warehouse.input_fingerprint import InputHashes, text_hash

FOLDER = "weeks"
DAYS = 7
_EPOCH = date(1970, 1, 1)


@dataclass(slots=True)
class WeekFile:
    """The file of one mart and week.

    Rows of a stored week are held as bytes of its file as soon as those of all days before them are there: as rows they
    would take twenty times the room.

    Attributes:
        name: The mart.
        path: Its path, whether it exists or not.
        monday: Its Monday.
        inputs: Input hashes of each of its days, in order: those of the week that are in the range.
        is_stored: It may be written; else its rows are computed each time.
        rows: Rows by day, of a week without a file: those that are not in bytes yet, or that the disk refused.
    """

    name: str
    path: Path
    monday: date
    inputs: Mapping[date, InputHashes]
    is_stored: bool = True
    rows: dict[date, pa.Table] = field(default_factory=dict)
    _writer: FactWriter | None = None
    _encoded: list[date] = field(default_factory=list)

    def older(self) -> dict[Path, list[date]]:
        """Return undamaged older files of the week, each with the days whose rows it has: those of the same inputs."""
        older: dict[Path, list[date]] = {}
        left = dict(self.inputs)
        for path in (p for p in others_of(self.path) if not is_temporary(p)):
            with contextlib.suppress(OSError):
                data = path.read_bytes()
                noted = _by_day(self.monday, noted_inputs(data)) if is_undamaged(data) else {}
                older[path] = [d for d, own in left.items() if noted.get(d) == own]
                left = {d: own for d, own in left.items() if d not in older[path]}
        return older

    def reuse(self, older: Mapping[Path, Sequence[date]], column: str) -> None:
        """Take the rows of days from older files.

        Args:
            older: The days; see `older`.
            column: Day of a row.
        """
        for path, days in older.items():
            if days:
                self.take(pq.ParquetFile(path).read().replace_schema_metadata(), days, column)

    def take(self, rows: pa.Table, days: Iterable[date], column: str) -> None:
        """Take the rows of some days.

        Args:
            rows: Rows of these days, and others.
            days: The days.
            column: Day of a row.
        """
        self.rows.update((day, rows.filter(pc.equal(rows[column], day))) for day in days)

    def encode(self) -> None:
        """Turn the rows of the first days, as far as they are there, into bytes of the file."""
        self._writer = self._writer or FactWriter(_noted(self.monday, self.inputs))
        for day in list(self.inputs)[len(self._encoded) :]:
            if day not in self.rows:
                return
            self._writer.add(self.rows.pop(day))
            self._encoded.append(day)

    def write(self, column: str) -> None:
        """Write the rows of all days; where the disk refuses, `rows` has them again.

        Args:
            column: Day of a row.
        """
        self.encode()
        assert self._writer is not None
        data, self._writer = self._writer.finish(), None  # which holds the bytes of the whole file
        try:
            publish(self.path, data, is_synced=False)
            sweep_temporaries(self.path.parent)
        except OSError:
            self.take(pq.ParquetFile(pa.BufferReader(data)).read().replace_schema_metadata(), self._encoded, column)


def week_file(
    root: Path, name: str, site_id: str, monday: date, inputs: Mapping[date, InputHashes], *, is_stored: bool = True
) -> WeekFile:
    """Return the week file of a mart and the days of a week, given the folder of the settings it belongs to."""
    folder = unit_folder(root / FOLDER, name, site_id, (monday - _EPOCH).days * 24)
    fingerprint = week_fingerprint(name, monday, _noted(monday, inputs))
    return WeekFile(name, folder / f"00-{fingerprint}.parquet", monday, inputs, is_stored)


def week_fingerprint(name: str, monday: date, noted: Mapping[str, Any]) -> str:
    """Return the fingerprint in the name of a week file, given what it notes about its inputs."""
    return text_hash([name, monday.isoformat(), sorted(noted.items())])


def others_of(path: Path) -> list[Path]:
    """Return the other files in the folder of a day's or week's file: older fingerprints, and temporary files."""
    with contextlib.suppress(FileNotFoundError):
        others = [path.parent / name for name in os.listdir(path.parent) if name != path.name]
        return sorted(p for p in others if p.suffix == ".parquet" or is_temporary(p))
    return []


def _noted(monday: date, inputs: Mapping[date, InputHashes]) -> dict[str, dict[str, list[int]]]:
    """Return the input hashes of days as the metadata of their file notes them: 0 is the Sunday before the Monday."""
    return by_kind({(day - monday).days + 1: own for day, own in inputs.items()}, 0)


def _by_day(monday: date, noted: Mapping[str, Any]) -> dict[date, dict[str, str]]:
    return {monday + timedelta(days=k - 1): own for k, own in by_hour(noted, 0).items()}
