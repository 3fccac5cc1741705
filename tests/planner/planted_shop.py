"""A planted floor for the planner's page: two cameras, an outage, four weeks of history, counts that differ by hour."""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from report import ingested_worlds as worlds

from vsd_analytics.planner.planner_data import PlannerData, planner_pages
from vsd_analytics.site.model import Site

MONDAY, BEFORE = worlds.MONDAY, worlds.BEFORE
N_WEEKS = 5
FIRST = MONDAY - timedelta(weeks=N_WEEKS - 1)
HOURS = (9, 11)
FAR = (22.0, 6.0)
"""Where the second camera counts, away from the first one's places."""
CORNER = (11.0, 9.6)
"""Two violations an hour lie here: too few to be given."""
SHELF = (5.0, 1.5, 5.4, 4.5)
"""Stands where heat of the queue would run, thinner than two cells."""
HOSTILE = '</script><img src=x onerror=alert(1)> & "Caf\u00e9" {{ 7*7 }}'
WHOLE: dict[str, float] = {"mask_below": 0, "min_exposure_h": 2.0}


def counts(week: int, camera: int) -> worlds.Counts:
    """Return counts by day and hour that are never alike; in the last week the door has far fewer."""

    def of(day: int, hour: int) -> Mapping[worlds.Place, int]:
        busy = 1.5 if day >= 5 else 1.0
        wave = (day * 7 + hour * 5 + week * 3) % 6
        if camera == 2:
            return {FAR: round(9 * busy) + wave % 4}
        door = 26 if week < N_WEEKS - 1 else 11
        return {
            worlds.QUEUE: round(30 * busy) + 2 * wave + (hour == 10) * 12,
            worlds.DOOR: round(door * busy) + wave,
            worlds.AISLE: round(14 * busy) + wave,
            CORNER: 2,
        }

    return of


def messages(week: int, camera: int, *, lost: Sequence[tuple[datetime, datetime]]) -> Iterator[dict[str, Any]]:
    """Yield a camera's week; somebody stands alone in the queue and at the door for a part of each day."""
    stream = worlds.messages(
        counts(week, camera),
        monday=FIRST + timedelta(weeks=week),
        hours=HOURS,
        camera=f"cam-{camera}",
        lost=lost,
        is_alone=camera == 1,
    )
    for frame in stream:
        at = datetime.fromisoformat(frame["ts"])
        if camera == 1 and at.minute < 10 + (at.day * 7) % 40:
            frame["persons"] += [worlds.person("waits", 1.2, 4.9), worlds.person("guards", 7.2, 4.9)]
        yield frame


def build(folder: Path, *, name: str = "Shop") -> Site:
    """Write, ingest and return the planted site."""
    x0, y0, x1, y1 = SHELF
    shelf = (
        f'[[fixture]]\nid = "shelf"\nname = "Shelf"\npolygon = [[{x0}, {y0}], [{x1}, {y0}], [{x1}, {y1}], [{x0}, {y1}]]'
    )
    config = worlds.toml(cameras=("cam-1", "cam-2"), opening='{ mon-sun = "09:00-11:00" }', more=shelf)
    config = config.replace('name = "Shop"', f"name = {_quoted(name)}").replace(
        'name = "Door"', f"name = {_quoted('Door ' + name)}"
    )
    down = [
        (a.astimezone(UTC), b.astimezone(UTC))
        for a, b in ((worlds.rome(2, 9), worlds.rome(2, 11)), (worlds.rome(4, 10, 20), worlds.rome(4, 11)))
    ]
    streams = [
        messages(
            week,
            camera,
            lost=[(a.astimezone(UTC), b.astimezone(UTC)) for a, b in down]
            if camera == 2 and week == N_WEEKS - 1
            else (),
        )
        for week in range(N_WEEKS)
        for camera in (1, 2)
    ]
    return worlds.world(folder, config, *streams)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def with_settings(site: Site, **values: Any) -> Site:
    """Return the site under other settings."""
    return replace(site, settings=site.settings.with_values(values))


def known(site: Site, **options: Any) -> PlannerData:
    """Return what the page of the planted week knows."""
    return planner_pages(site, MONDAY, **options)[0]


def numbers(page: str, name: str) -> Iterator[int]:
    """Yield the packed numbers of a part of a page, `data` or `cells`, by a decoder of its own."""
    found = re.search(rf'<script type="text/plain" id="{name}">([^<]*)</script>', page)
    assert found is not None
    value = shift = 0
    for byte in gzip.decompress(base64.b64decode(found[1])):
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            yield value
            value = shift = 0


def unpacked(page: str, data: PlannerData) -> list[dict[str, Any]]:
    """Return the weeks of a page as lists: hours, counts by place, camera and hour, rows of cells."""
    hours, cells = (numbers(page, name) for name in ("data", "cells"))
    stream = hours

    def many(n: int) -> list[int]:
        return [next(stream) for _ in range(n)]

    weeks = []
    n_cameras, n_places = len(data.cameras), len(data.places)
    for week in (data.week, data.before):
        if week is None:
            continue
        stream = hours
        n = next(stream)
        told: dict[str, Any] = {"day": many(n), "weekday": many(n), "hour": many(n), "fold": many(n)}
        told["recorded"] = many(n_cameras * n)
        told["n"] = many(n_places * n_cameras * n)
        unit = next(stream)
        told["time"], told["close"] = ([unit * v for v in many(n_places * n_cameras * n)] for _ in range(2))
        if week.cells is not None:
            stream = cells
            for name, kinds in (("violations", 1), ("time_cells", 2)):
                next(stream)  # how many bytes follow, as before each part
                if name == "time_cells":
                    told["unit"] = next(stream)
                sums = next(stream)
                told[f"{name}_key"], told[f"{name}_sums"] = many(sums), [many(sums) for _ in range(kinds)]
                next(stream)
                size = many(sums)
                many(sum(size))
                told[name] = [many(sum(size)) for _ in range(kinds)]
                if name == "violations":
                    next(stream)
                    rows = next(stream)
                    told["fine_key"], told["fine"] = many(rows), [many(rows)]
            next(stream)
            n_x, n_y, _, _ = many(4)
            many(n_x * n_y)
        weeks.append(told)
    return weeks


def at(day: int, hour: int) -> datetime:
    """Return an instant of the planted week."""
    return worlds.rome(day, hour)
