"""What else happened at a site: series such as sales or weather, one added file or removal a line in `context.jsonl`.

No line is ever changed. A removal hides all earlier lines of its series.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, Final, Literal
from zoneinfo import ZoneInfo

import msgspec
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.config.append_only import AppendOnlyFile
from vsd_analytics.config.context_file import ContextColumns, read_context_file
from vsd_analytics.config.interval_rows import AddedIntervals, new_rows, nothing_usable
from vsd_analytics.errors import CONTROL, UsageError, nearest
from vsd_analytics.site.model import Site

FILE: Final = "context.jsonl"
SITE: Final = "site"
UNIT_MAX_CHARS: Final = 20
Adds = Literal["sum", "mean"]
_NAME: Final = re.compile(r"[a-z][a-z0-9_]{0,39}")
_FIX: Final = "vsd context add sales.csv --name sales --unit EUR --sum --every 1h"


@dataclass(frozen=True, slots=True)
class ContextRecord:
    """One line of the file.

    Attributes:
        at: When it was added.
        name: The series.
        unit: Unit of the values.
        place: Id of an area or floor, or "site".
        adds: How values of several intervals become one: their sum, or their mean weighted by time.
        from_ms, to_ms: Ends of the intervals, UTC milliseconds, end exclusive.
        values: A value for each.
        is_removal: It takes the series back, and has nothing but its name.
    """

    at: datetime
    name: str
    unit: str = ""
    place: str = SITE
    adds: Adds = "sum"
    from_ms: tuple[int, ...] = ()
    to_ms: tuple[int, ...] = ()
    values: tuple[float, ...] = ()
    is_removal: bool = False

    def __post_init__(self) -> None:
        """Refuse a line whose lists differ in length."""
        if not len(self.from_ms) == len(self.to_ms) == len(self.values):
            raise ValueError("from_ms, to_ms and values differ in length")


@dataclass(frozen=True, slots=True)
class ContextSeries:
    """A series in force: its intervals by time, which do not overlap; attributes as of `ContextRecord`."""

    name: str
    unit: str
    place: str
    adds: Adds
    from_ms: NDArray[np.int64]
    to_ms: NDArray[np.int64]
    values: NDArray[np.float64]

    def days(self, zone: ZoneInfo) -> tuple[date, date]:
        """Return the first and last local day of its intervals."""
        ends = (int(self.from_ms[0]), int(self.to_ms[-1]) - 1)
        first, last = (datetime.fromtimestamp(ms / 1000, tz=UTC).astimezone(zone).date() for ms in ends)
        return first, last


def _written(record: ContextRecord) -> dict[str, Any]:
    written: dict[str, Any] = msgspec.to_builtins(record)
    return written


_RECORDS: Final = AppendOnlyFile(
    FILE, ContextRecord, written=_written, what="a series of context", fix="vsd context add adds the file again",
)  # fmt: skip


def context_series(site: Site) -> dict[str, ContextSeries]:
    """Return the series in force by name.

    Raises:
        InputError: E110, a line of the file is none.
    """
    heads: dict[str, ContextRecord] = {}
    values: dict[str, dict[tuple[int, int], float]] = {}
    for record in _RECORDS.read(site):
        if record.is_removal:
            heads.pop(record.name, None)
            values.pop(record.name, None)
            continue
        heads.setdefault(record.name, record)
        pairs = zip(record.from_ms, record.to_ms, strict=True)
        values.setdefault(record.name, {}).update(zip(pairs, record.values, strict=True))
    return {name: _series(heads[name], values[name]) for name in sorted(heads)}


def _series(head: ContextRecord, values: dict[tuple[int, int], float]) -> ContextSeries:
    ends = sorted(values)
    times = np.array(ends, np.int64).reshape(-1, 2)
    series_values = np.array([values[pair] for pair in ends], np.float64)
    return ContextSeries(head.name, head.unit, head.place, head.adds, times[:, 0], times[:, 1], series_values)


def add_context(
    site: Site,
    path: Path,
    columns: ContextColumns,
    *,
    name: str,
    at: datetime,
    unit: str | None = None,
    place: str | None = None,
    adds: Adds | None = None,
    is_replacing: bool = False,
) -> tuple[ContextSeries, AddedIntervals]:
    """Add the intervals of a CSV file to a series, durably.

    Args:
        site: The project.
        path: The file.
        columns: How it says its intervals.
        name: The series; a new one needs unit and adds.
        at: Now.
        unit: Unit of the values; None = that of the series.
        place: Id of an area or floor, or "site"; None = that of the series, or the site.
        adds: How values of several intervals become one; None = as the series does.
        is_replacing: An interval that the series has with another value gets the new one; else the line is refused.

    Returns:
        The series with the file, and what became of the file.

    Raises:
        UsageError: E101, a name, unit or place that cannot be, or another one than the series has.
        InputError: E110 a line of context.jsonl is wrong, E201 to E209 the file cannot be used, E202 no line of it can.
    """
    from vsd_analytics.store.durable import exclusive

    rows, refused = read_context_file(path, columns)
    with exclusive(site.root / "status" / "context-add.lock"):  # two files that overlap are not both taken
        known = context_series(site)
        head = _head(site, known.get(name), name=name, at=at, unit=unit, place=place, adds=adds)
        before = {} if name not in known else _values(known[name])
        new, n_known, n_replaced = new_rows(rows, before, refused, is_replacing=is_replacing, shown="{:g}".format)
        if not new and not n_known:
            raise nothing_usable(path, refused)
        if new:
            from_ms, to_ms, values = zip(*((r.from_ms, r.to_ms, r.value) for r in new), strict=True)
            _RECORDS.add(site, replace(head, at=_later(site, at), from_ms=from_ms, to_ms=to_ms, values=values))
        refused.sort(key=lambda row: row.line)
        return context_series(site)[name], AddedIntervals(len(new), n_known, n_replaced, tuple(refused))


def remove_context(site: Site, name: str, *, at: datetime) -> bool:
    """Take a series back, durably. Returns False where it is not there; its lines stay in the file.

    Raises:
        UsageError: E101, no series ever had this name.
        InputError: E110, a line of the file is none.
    """
    ever = {record.name for record in _RECORDS.read(site)}
    if name not in ever:
        close = nearest(name, sorted(ever))
        why = f"there are {', '.join(sorted(ever))}" if ever else "nothing was added yet"
        fix = f"vsd context remove {close}" if close else "vsd context list"
        raise UsageError(f"there is no series {name!r}", why=why, fix=fix)
    if name not in context_series(site):
        return False
    return _RECORDS.add(site, ContextRecord(_later(site, at), name, is_removal=True))


def _later(site: Site, at: datetime) -> datetime:
    """Return an instant after all lines of the file, so that no new line equals one that is there.

    What was taken back is added again by the same line as before; at the same instant it would pass for known.
    """
    last = max((record.at for record in _RECORDS.read(site)), default=None)
    return at if last is None or at > last else last + timedelta(milliseconds=1)


def _head(
    site: Site,
    known: ContextSeries | None,
    *,
    name: str,
    at: datetime,
    unit: str | None,
    place: str | None,
    adds: Adds | None,
) -> ContextRecord:
    """Return the record without intervals, or refuse what it says of the series."""
    if known is None:
        if not _NAME.fullmatch(name):
            why = "a name has small letters without accents, digits and _, 40 at most"
            raise UsageError(f"--name: {name[:60]!r} is no name of a series", why=why, fix="--name sales")
        if unit is None or adds is None:
            missing = "--unit" if unit is None else "--sum or --mean"
            raise UsageError(f"a new series needs {missing}", why="a number without it says nothing", fix=_FIX)
        return ContextRecord(at, name, _unit(unit), _place(site, place or SITE), adds)
    for option, asked, has in (("--unit", unit, known.unit), ("--place", place, known.place), ("", adds, known.adds)):
        if asked is not None and asked != has:
            raise UsageError(
                f"the series {name} has {option or 'how it adds:'} {has}, and not {asked}",
                why="values that mean different things are not one series",
                fix=f"leave {option or f'--{asked}'} out if the file has {has}; else --name {name}_2",
            )
    return ContextRecord(at, name, known.unit, known.place, known.adds)


def _unit(unit: str) -> str:
    if not unit.strip() or len(unit) > UNIT_MAX_CHARS or CONTROL.search(unit) or "\t" in unit:
        raise UsageError(f"--unit must be 1 to {UNIT_MAX_CHARS} printable characters", fix="--unit EUR, or --unit 1")
    return unit.strip()


def _place(site: Site, place: str) -> str:
    known = [SITE, *(floor.floor_id for floor in site.floors), *(area.area_id for area in site.areas)]
    if place in known:
        return place
    close = nearest(place, known)
    why = f"there are {', '.join(known)}"
    raise UsageError(f"--place: there is no area or floor {place!r}", why=why, fix=f"--place {close or SITE}")


def _values(series: ContextSeries) -> dict[tuple[int, int], float]:
    pairs = zip(series.from_ms.tolist(), series.to_ms.tolist(), strict=True)
    return dict(zip(pairs, series.values.tolist(), strict=True))


__all__ = ["Adds", "ContextSeries", "add_context", "context_series", "remove_context"]
