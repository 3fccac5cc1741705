"""Sealed facts: the computed facts of hours whose raw records were purged, stored for good and apart from `facts/`.

```
sealed/days/<fact>/site=<site>/date=<YYYY-MM-DD>/00-<digest>.parquet  a fact of the hours that were sealed together
sealed/<fact>/site=<site>/date=<YYYY-MM-DD>/<HH>-<digest>.parquet     a fact of an hour that was sealed alone
sealed/seals/site=<site>/<YYYY-MM-DD>.json                            what is sealed of a UTC day
```

A purge seals the hours of a day together, and alone the first hour of the day whose records stay. Older versions sealed
each hour alone. They look for the files of all hours outside the folder `days`, and so miss those of a day with E313.

All fact files are named by the hash of their bytes. Only the seal says which of them are valid; files it does not name
are swept. A seal is the one file here that is ever replaced, by a rename, so a reader sees the old seal or the new one.
Its fact files are written before it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

import msgspec

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.store import durable
from vsd_analytics.store.layout import list_parts, unit_folder

FOLDER = "sealed"
SEALED = "sealed-hour"
"""Reason of records in quarantine whose hour is sealed."""
DAY_FACT = "camera_days"
DAYS = "days"
"""Folder of the facts of hours that were sealed together."""
_EPOCH = date(1970, 1, 1).toordinal()
_SEAL = re.compile(r"^(\d{4}-\d{2}-\d{2})\.json$")


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitSeal:
    """The sealed facts of a UTC hour or day.

    Attributes:
        fingerprint: Input fingerprint of the facts, as it was in their names.
        causes: Hashes of their inputs other than records, by name: SQL, settings, cameras, calibrations.
        facts: Digest of each fact's file, by fact.
        is_in_day: The file has all hours of the day that were sealed together, with the hour as a column.
        records: Number of raw records that were removed, by table.
        engines: For each table, the engines noted in each of its parts, in order.
        last_ms: Instant of each camera's last record in the unit (UTC milliseconds).
        cameras: Cameras with records when it was sealed; the hashes of their calibrations are in `causes`.
        imports: Imports that brought the records (`store.owners`): they cannot be taken back any more.
        is_as_built: The facts are those built from the inputs of `fingerprint`: no purge by camera took rows from them.
            Seals of versions before 2.0 do not say so.
    """

    fingerprint: str
    causes: Mapping[str, str]
    facts: Mapping[str, str]
    is_in_day: bool = False
    records: Mapping[str, int] = field(default_factory=dict)
    engines: Mapping[str, tuple[tuple[str, ...], ...]] = field(default_factory=dict)
    last_ms: Mapping[str, int] = field(default_factory=dict)
    cameras: tuple[str, ...] = ()
    imports: tuple[str, ...] = ()
    is_as_built: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class DaySeal:
    """What is sealed of one UTC day.

    Attributes:
        day: UTC days since 1970.
        is_whole: The whole day is sealed and accepts no record; otherwise only `hours` are sealed.
        sealed_on: UTC date of the purge, ISO.
        hours: Sealed hours by UTC hour number.
        camera_days: The fact of the whole day; None while the day is not whole.
    """

    day: int
    is_whole: bool
    sealed_on: str
    hours: Mapping[int, UnitSeal]
    camera_days: UnitSeal | None = None

    def holds(self, hour: int) -> bool:
        """Return whether a UTC hour of this day is sealed, so that its records are refused."""
        return self.is_whole or hour in self.hours


@dataclass(frozen=True, slots=True)
class _Envelope:
    digest: str
    seal: msgspec.Raw


class Seals:
    """The sealed facts of one site.

    Args:
        root: `<project>/sealed`.
        site_id: The site's id.
    """

    def __init__(self, root: Path, *, site_id: str) -> None:
        self.root = root
        self.site_id = site_id
        self.folder = root / "seals" / f"site={site_id}"

    def days(self) -> list[int]:
        """Return the UTC day numbers with a seal, in order."""
        if not self.folder.is_dir():
            return []
        matches = (_SEAL.match(p.name) for p in self.folder.iterdir())
        numbers = (_day_number(m[1]) for m in matches if m)
        return sorted(n for n in numbers if n is not None)

    def read(self, day: int) -> DaySeal | None:
        """Return the seal of a UTC day, or None when it has none.

        Raises:
            StoreError: E313, the file is damaged.
        """
        path = self.path(day)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        seal = seal_in(data)
        if seal is None or seal.day != day:
            raise _damaged(path)
        return seal

    def between(self, first_hour: int | None, last_hour: int | None) -> dict[int, UnitSeal]:
        """Return the sealed hours in [first_hour, last_hour] by UTC hour number; None = open."""
        return {
            hour: unit
            for seal in self.seals(first_hour, last_hour)
            for hour, unit in sorted(seal.hours.items())
            if (first_hour is None or hour >= first_hour) and (last_hour is None or hour <= last_hour)
        }

    def seals(self, first_hour: int | None, last_hour: int | None) -> Iterator[DaySeal]:
        """Yield the seals of the UTC days that touch [first_hour, last_hour], in order; None = open."""
        for day in self.days():
            is_after = first_hour is None or day >= first_hour // 24
            if is_after and (last_hour is None or day <= last_hour // 24) and (seal := self.read(day)) is not None:
                yield seal

    def hours(self, *, first_day: int | None = None, last_day: int | None = None) -> tuple[int, int] | None:
        """Return the first and last UTC hour number with sealed facts in these UTC days (None = open), or None."""
        days = [d for d in self.days() if first_day is None or d >= first_day]
        days = [d for d in days if last_day is None or d <= last_day]
        first, last = ((s for d in order if (s := self.read(d)) and s.hours) for order in (days, reversed(days)))
        start, end = next(first, None), next(last, None)
        return None if start is None or end is None else (min(start.hours), max(end.hours))

    def put(self, relation: str, hour: int, data: bytes, *, is_in_day: bool = False) -> str:
        """Store the bytes of a fact file durably; return their digest, which goes into the seal.

        Args:
            relation: The fact.
            hour: UTC hour number; of hours that are sealed together any of them.
            data: The bytes.
            is_in_day: They are of hours that are sealed together.
        """
        name = durable.digest(data)
        path = self._path(relation, hour, name, is_in_day=is_in_day)
        if not path.exists():
            durable.publish(path, data)
        return name

    def write(self, seal: DaySeal) -> None:
        """Replace a day's seal durably, in one step; its fact files were put before."""
        body = msgspec.json.encode(msgspec.to_builtins(seal, str_keys=True), order="deterministic")
        # A seal is named by its day, so its hash is inside: a damaged seal could open a purged day to new records,
        # and the sealed figures of that day would be computed again without the records that are gone.
        data = msgspec.json.encode(_Envelope(durable.digest(body), msgspec.Raw(body)))
        durable.publish(self.path(seal.day), data + b"\n")

    def path(self, day: int) -> Path:
        """Return the path of the seal of a UTC day."""
        return self.folder / f"{date.fromordinal(day + _EPOCH).isoformat()}.json"

    def fact_path(self, relation: str, hour: int, unit: UnitSeal) -> Path:
        """Return the path of the file that has a fact of a sealed hour or day."""
        return self._path(relation, hour, unit.facts[relation], is_in_day=unit.is_in_day)

    def _path(self, relation: str, hour: int, digest: str, *, is_in_day: bool) -> Path:
        root, in_name = (self.root / DAYS, 0) if is_in_day else (self.root, hour % 24)
        return unit_folder(root, relation, self.site_id, hour) / f"{in_name:02d}-{digest}.parquet"

    def damaged(self) -> list[Path]:
        """Return the paths of seals and sealed fact files that are damaged or missing."""
        paths: list[Path] = []
        for day in self.days():
            try:
                seal = self.read(day)
            except StoreError:
                paths.append(self.path(day))
                continue
            paths += filter(_is_damaged, self._named(seal))
        return paths

    def refuse_damaged(self, paths: Iterable[Path]) -> None:
        """Raise StoreError E313 when a sealed fact file is damaged or missing; call it after one could not be read."""
        for path in filter(_is_damaged, paths):
            raise _damaged(path)

    def sweep(self, days: Collection[int]) -> int:
        """Remove fact files of these days that no seal names, and abandoned temporary files; return how many."""
        if not self.root.is_dir():
            return 0
        n_swept = durable.sweep_temporaries(self.root)
        roots = [root for root in (self.root, self.root / DAYS) if root.is_dir()]
        folders = [p for root in roots for p in sorted(root.iterdir()) if p.is_dir() and p.name not in ("seals", DAYS)]
        for day in days:
            named = self._named(self.read(day))
            for folder in folders:
                within = {"first_hour": day * 24, "last_hour": day * 24 + 23}
                for part in list_parts(folder.parent, folder.name, self.site_id, **within):
                    if part.path not in named:
                        durable.remove(part.path)
                        n_swept += 1
        return n_swept

    def _named(self, seal: DaySeal | None) -> dict[Path, None]:
        """Return the fact files that a seal names, each once, in order."""
        return dict.fromkeys(self.fact_path(r, hour, unit) for hour, unit in _units(seal) for r in unit.facts)


def seal_in(data: bytes) -> DaySeal | None:
    """Return the seal in the bytes of its file; None where they are damaged."""
    try:
        envelope = msgspec.json.decode(data, type=_Envelope)
        body = bytes(envelope.seal)
        return msgspec.json.decode(body, type=DaySeal) if durable.digest(body) == envelope.digest else None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


def _units(seal: DaySeal | None) -> Iterator[tuple[int, UnitSeal]]:
    if seal is not None:
        yield from seal.hours.items()
        if seal.camera_days is not None:
            yield seal.day * 24, seal.camera_days


def _is_damaged(path: Path) -> bool:
    """Return whether a sealed fact file is missing, or its bytes differ from the hash after the hour in its name."""
    return not path.is_file() or durable.file_digest(path) != path.stem.partition("-")[2]


def _day_number(text: str) -> int | None:
    try:
        return date.fromisoformat(text).toordinal() - _EPOCH
    except ValueError:
        return None


def _damaged(path: Path) -> StoreError:
    return StoreError(
        "the sealed facts of a day whose records were purged are damaged",
        code="E313",
        where=Where(str(path)),
        why="the file is missing, or its bytes changed after it was sealed: by the disk or by a program",
        fix="restore the folder sealed from a backup; the figures of that day are stored nowhere else",
    )
