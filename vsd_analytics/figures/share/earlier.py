"""What left before: `shared.jsonl` in the project's folder, with the counts of each floor and line by week shared.

A week can change after it was shared: late data, an erasure, a better calibration, another distance. Who has both
versions has their difference. So each version is stored, one JSON object a line, and `weeks` masks the differences from
all of them like the counts themselves. The file holds exact counts: it stays with the operator.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, TypeAlias

from vsd_analytics.errors import InputError, Where
from vsd_analytics.site.model import Site
from vsd_analytics.store.durable import exclusive, publish

FILE: Final = "shared.jsonl"
LOCK: Final = Path("status") / "shared.lock"
REST: Final = ""
"""The rest of the floor among areas by id."""
Parts: TypeAlias = "Mapping[str, Mapping[str, int]]"
"""Counts by part and camera."""


@dataclass(frozen=True, slots=True)
class SharedWeek:
    """What was counted in a floor's week that was shared, and what of it was hidden.

    Attributes:
        floor_id, monday: Which.
        through: Last day that is counted: the Sunday, or a day of a week that went on.
        person_ms: Person-milliseconds in the hours that enter rates.
        n_tracks: Track ids.
        places: Violations by area (`REST`: the rest of the floor) and camera.
        hours: Violations by UTC start of the hour, in milliseconds, and camera.
        hidden_places, hidden_hours: What was not shown of them.
        untimed_places, untimed_hours: Areas and hours whose person-time was not shown.
        people: Whom it counts (`people` of vsd.toml).
    """

    floor_id: str
    monday: date
    through: date
    person_ms: int
    n_tracks: int
    places: Parts
    hours: Parts
    hidden_places: frozenset[str]
    hidden_hours: frozenset[str]
    untimed_places: frozenset[str] = frozenset()
    untimed_hours: frozenset[str] = frozenset()
    people: str = "all"


@dataclass(frozen=True, slots=True)
class SharedLine:
    """What was counted at a counting line, or at all doors of a floor, in a week that was shared.

    Attributes:
        floor_id, line_id, monday: Which; the line is empty for the doors of the floor.
        n: Crossings by the name of a sum that was shown: of the week, of its days, of its hours of the day.
        people: Whom it counts (`people` of vsd.toml).
    """

    floor_id: str
    line_id: str
    monday: date
    n: Mapping[str, int]
    people: str = "all"


def read(site: Site) -> Sequence[SharedWeek]:
    """Return every version of every floor's week that was shared, in order.

    Raises:
        InputError: E110, a line is none.
    """
    return tuple(week for week in _all(site) if isinstance(week, SharedWeek))


def read_lines(site: Site) -> Sequence[SharedLine]:
    """Return every version of every week of a counting line that was shared, in order.

    Raises:
        InputError: E110, a line of the file is none.
    """
    return tuple(week for week in _all(site) if isinstance(week, SharedLine))


def _all(site: Site) -> Sequence[SharedWeek | SharedLine]:
    path = site.root / FILE
    try:
        stat = path.stat()
    except FileNotFoundError:
        return ()
    return _read(path, stat.st_mtime_ns, stat.st_size)


def versions(site: Site, floor_id: str, monday: date) -> Sequence[SharedWeek]:
    """Return every version of a floor's week that was shared, in order."""
    return [week for week in read(site) if (week.floor_id, week.monday) == (floor_id, monday)]


def changed_days(site: Site, n: Mapping[date, float], *, floor_id: str | None) -> frozenset[date]:
    """Return the days whose counts left before in a week, and were others then.

    Args:
        site: The project.
        n: Violations by day as they are counted now.
        floor_id: Floor; None = the whole site.
    """
    changed = set()
    for week in read(site):
        if floor_id not in (None, week.floor_id):
            continue
        then: dict[date, int] = {}
        for start, counts in week.hours.items():
            day = datetime.fromtimestamp(int(start) / 1000, site.zone).date()
            then[day] = then.get(day, 0) + sum(counts.values())
        changed |= {day for day, now in n.items() if week.monday <= day <= week.through and then.get(day, 0) != now}
    return frozenset(changed)


def remember(site: Site, weeks: Iterable[SharedWeek | SharedLine]) -> None:
    """Store versions of weeks that leave, durably; what is stored already is not again.

    Raises:
        DiskError: E304 to E306, the disk refused; then nothing may be shared.
    """
    weeks = list(weeks)
    known = _all(site)
    if all(week in known for week in weeks):
        return
    path = (site.root / FILE).resolve()
    with exclusive(site.root / LOCK):
        known = _all(site)
        lines = [json.dumps(_as_dict(week), ensure_ascii=False) for week in (*known, *weeks)]
        publish(path, "".join(f"{line}\n" for line in dict.fromkeys(lines)).encode(), is_private=True)


@lru_cache(maxsize=4)
def _read(path: Path, mtime_ns: int, size: int) -> tuple[SharedWeek | SharedLine, ...]:
    return tuple(_week(line, number) for number, line in enumerate(path.read_bytes().splitlines(), 1) if line.strip())


def _as_dict(week: SharedWeek | SharedLine) -> dict[str, Any]:
    if isinstance(week, SharedLine):
        names = {"week": f"{week.monday:%G-W%V}", "floor": week.floor_id, "line": week.line_id}
        return {**names, "crossings": week.n, "people": week.people}
    return {
        "week": f"{week.monday:%G-W%V}",
        "through": week.through.isoformat(),
        "floor": week.floor_id,
        "person_ms": week.person_ms,
        "tracks": week.n_tracks,
        "places": week.places,
        "hours": week.hours,
        "hidden_places": sorted(week.hidden_places),
        "hidden_hours": sorted(week.hidden_hours),
        "untimed_places": sorted(week.untimed_places),
        "untimed_hours": sorted(week.untimed_hours),
        "people": week.people,
    }


def _week(line: bytes, number: int) -> SharedWeek | SharedLine:
    try:
        value = json.loads(line)
        monday = date.fromisoformat(f"{value['week']}-1")
        if "crossings" in value:
            n = {str(name): int(n) for name, n in value["crossings"].items()}
            return SharedLine(value["floor"], value["line"], monday, n, str(value["people"]))
        return SharedWeek(
            value["floor"],
            monday,
            date.fromisoformat(value["through"]),
            int(value["person_ms"]),
            int(value["tracks"]),
            _parts(value["places"]),
            _parts(value["hours"]),
            frozenset(map(str, value["hidden_places"])),
            frozenset(map(str, value["hidden_hours"])),
            frozenset(map(str, value.get("untimed_places", ()))),
            frozenset(map(str, value.get("untimed_hours", ()))),
            str(value.get("people", "all")),
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(
            f"line {number} of {FILE} is no week that was shared",
            code="E110",
            where=Where(FILE, number, line.decode(errors="replace")[:200]),
            why="what left before decides what may leave now",
            fix="put the file back as it was; a deleted line allows its week to be shared again",
        ) from None


def _parts(value: Mapping[str, Mapping[str, int]]) -> Parts:
    return {str(key): {str(camera): int(n) for camera, n in counts.items()} for key, counts in value.items()}
