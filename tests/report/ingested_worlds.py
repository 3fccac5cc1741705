"""Small worlds that reach a report the way real data do: engine messages, ingest, store, facts, marts.

A world is made of pairs that stand 1.5 m apart in two frames, so its violations are known without counting. Frames
come every twenty seconds in opening hours; one more person stands alone, so that nobody's absence is not nobody seen.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any
from unittest import mock
from zoneinfo import ZoneInfo

import msgspec

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake import pipeline
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site

MONDAY = date(2026, 11, 9)
BEFORE = MONDAY - timedelta(days=7)
DAY = timedelta(days=1)
STEP_MS = 20_000
CLOSE_S = 40
"""Each of the two people of a violation is too close for two frames."""
SLOT_MS = 40_000
Place = tuple[float, float]
Counts = Callable[[int, int], Mapping[Place, int]]
Say = Callable[[str, float, float], dict[str, Any]]

QUEUE, DOOR, AISLE, ALONE = (3.0, 3.0), (9.0, 3.0), (3.0, 9.0), (15.0, 9.0)
AREAS = {
    "queue": ("Queue", (1, 1, 5, 5)),
    "door": ("Door", (7, 1, 11, 5)),
}


def toml(
    *,
    cameras: Sequence[str] = ("cam-1",),
    areas: Mapping[str, tuple[str, tuple[float, ...]]] = AREAS,
    zone: str = "Europe/Rome",
    opening: str = '{ mon-sun = "09:00-12:00" }',
    site: str = "",
    floor: str = "",
    camera: str = "",
    more: str = "",
) -> str:
    """Return a `vsd.toml`; `site`, `floor`, `camera` are lines for those tables, `more` comes at the end."""
    blocks = [
        f'[site]\nid = "shop"\nname = "Shop"\ntimezone = "{zone}"\nopening = {opening}\n{site}',
        f'[[floor]]\nid = "ground"\nname = "Ground floor"\n{floor}',
    ]
    blocks += [f'[[camera]]\nid = "{c}"\nname = "Camera {c[-1]}"\nfloor = "ground"\n{camera}' for c in cameras]
    for area_id, (name, (x0, y0, x1, y1)) in areas.items():
        ring = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
        blocks.append(f'[[area]]\nid = "{area_id}"\nname = "{name}"\nfloor = "ground"\npolygon = {ring}')
    return "\n\n".join([*blocks, more]) + "\n"


def person(track: str, x_m: float, y_m: float) -> dict[str, Any]:
    """Say a person as most engines do."""
    return {"id": track, "x_m": round(x_m, 3), "y_m": round(y_m, 3)}


def steady(counts: Mapping[Place, int]) -> Counts:
    """Return the same counts for every hour."""
    return lambda day, hour: counts


def messages(
    counts: Counts,
    *,
    monday: date = MONDAY,
    zone: str = "Europe/Rome",
    hours: tuple[int, int] = (9, 12),
    camera: str = "cam-1",
    days: Iterable[int] = range(7),
    lost: Sequence[tuple[datetime, datetime]] = (),
    engine: str = "acme 1.0",
    say: Say = person,
    is_alone: bool = True,
) -> Iterator[dict[str, Any]]:
    """Yield one camera's frames of a week.

    Args:
        counts: Violations by place, for day 0 to 6 and local hour; at most 90 in a place and hour.
        monday: First local day.
        zone: The site's zone.
        hours: First local hour with frames, and the one in which they end.
        camera: Camera id.
        days: Days with frames.
        lost: Times in which no frame arrives.
        engine: What the engine calls itself.
        say: How it says a person.
        is_alone: One more person stands alone all the time.
    """
    here = ZoneInfo(zone)
    for d in days:
        day = monday + timedelta(days=d)
        start = round(datetime(day.year, day.month, day.day, hours[0], tzinfo=here).timestamp() * 1000)
        end = start + (hours[1] - hours[0]) * 3_600_000
        for ms in range(start, end, STEP_MS):
            at = datetime.fromtimestamp(ms / 1000, tz=UTC)
            if lost and any(a <= at < b for a, b in lost):
                continue
            slot, into = divmod((ms - start) % 3_600_000, SLOT_MS)
            people = [say("alone", *ALONE)] if is_alone else []
            if into <= STEP_MS:
                local = at.astimezone(here).hour
                for k, ((x, y), n) in enumerate(counts(d, local).items()):
                    if slot < n:
                        people += [say(f"{ms // 3_600_000}-{k}-{slot}-{s}", x + s * 1.5, y) for s in (0, 1)]
            yield {
                "v": 1,
                "camera": camera,
                "ts": at.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
                "engine": engine,
                "quality": "metric",
                "persons": people,
            }


def world(folder: Path, config: str, *streams: Iterable[Mapping[str, Any]], log: Sequence[Any] = ()) -> Site:
    """Write a project, read its streams into the store, and return the site.

    Nobody reads the card of a stream here, so none is made: its doubts take as long as reading the stream.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vsd.toml").write_text(config, encoding="utf-8")
    if log:
        (folder / "log.jsonl").write_text("".join(json.dumps(e) + "\n" for e in log), encoding="utf-8")
    site = load_site(folder)
    add(site, *streams)
    return site


def add(site: Site, *streams: Iterable[Mapping[str, Any]], name: str = "engine") -> None:
    """Read streams into the store of a project."""
    paths = []
    for k, stream in enumerate(streams):
        paths.append(site.root / f"{name}-{k}.jsonl")
        paths[-1].write_bytes(msgspec.json.Encoder().encode_lines(stream))
    options = IngestOptions(format="frames", is_sure=True)
    with mock.patch.object(pipeline._Ingest, "understand", return_value=None):
        result = pipeline.ingest(site, paths, options, now=datetime(2027, 1, 1, tzinfo=UTC))
    assert [s.error for s in result.sources] == [None] * len(paths)
    assert result.n_rejected == 0


def report(site: Site, monday: date = MONDAY, **options: Any) -> WeekReport:
    """Return the report of a week."""
    return week_report(site, monday, **options)


def rome(day: int, hour: int, minute: int = 0, *, monday: date = MONDAY) -> datetime:
    """Return an instant of the week in Rome, day 0 being Monday."""
    at = monday + timedelta(days=day)
    return datetime(at.year, at.month, at.day, hour, minute, tzinfo=ZoneInfo("Europe/Rome"))
