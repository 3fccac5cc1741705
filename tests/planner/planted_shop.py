"""A planted floor for the planner's page: two cameras, an outage, four weeks of history, counts that differ by hour."""

from __future__ import annotations

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


def of_base_85(text: str) -> bytes:
    """Return the bytes of base 85 whose signs are in the order of their codes, without those of HTML and scripts."""
    signs = [chr(c) for c in range(33, 127) if chr(c) not in "\"&'<>\\`{}"]
    assert len(signs) == 85
    padded, data = text + signs[84] * (-len(text) % 5), b""
    for at in range(0, len(padded), 5):
        value = 0
        for sign in padded[at : at + 5]:
            value = value * 85 + signs.index(sign)
        data += value.to_bytes(4, "big")
    return data[: len(data) - -len(text) % 5]


class PackedStream:
    """Reads the numbers of a part of a page, `data` or `cells`, by a decoder of its own."""

    def __init__(self, page: str, name: str) -> None:
        found = re.search(rf'<script type="text/plain" id="{name}">([^<>&]*)</script>', page)
        assert found is not None
        self._bytes = iter(gzip.decompress(of_base_85(found[1])))

    def one(self) -> int:
        """Read a number of seven bits a byte."""
        value = shift = 0
        for byte in self._bytes:
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value
        raise AssertionError("the numbers ended too early")

    def many(self, n: int) -> list[int]:
        """Read n of them."""
        return [self.one() for _ in range(n)]

    def wide(self, n: int) -> list[int]:
        """Read n numbers in planes of bytes."""
        values = [0] * n
        for plane in range(next(self._bytes)):
            values = [v + (next(self._bytes) << 8 * plane) for v in values]
        return values


def unpacked(page: str, data: PlannerData) -> list[dict[str, Any]]:
    """Return the weeks of a page as lists: hours, counts by place, row and hour, rows or sums of cells."""
    hours, cells = (PackedStream(page, name) for name in ("data", "cells"))
    weeks = []
    n_rows, n_places = (1, 1) if data.is_shared else (len(data.cameras), len(data.places))
    for week in (data.week, data.before):
        if week is None:
            continue
        n = hours.one()
        told: dict[str, Any] = {name: hours.many(n) for name in ("day", "weekday", "hour", "fold")}
        told["recorded"] = hours.many(n_rows * n)
        told["n"] = hours.wide(n_places * n_rows * n)
        unit = hours.one()
        told["time"], told["close"] = ([unit * v for v in hours.wide(n_places * n_rows * n)] for _ in range(2))
        if data.is_shared:
            hours.many(2 * len(data.cameras))
        if week.cells is not None:
            (_unpack_sums if data.is_shared else _unpack_rows)(cells, told)
        weeks.append(told)
    return weeks


def _unpack_sums(cells: PackedStream, told: dict[str, Any]) -> None:
    """Read the parts of a week of a page for readers."""
    for name, kinds in (("violations", 1), ("fine", 1), ("time_cells", 2), ("violations_pair", 1), ("time_pair", 2)):
        cells.one()  # how many bytes follow, as before each part
        if name.startswith("time"):
            told["unit"] = cells.one()
        sums = cells.one()
        told[f"{name}_key"], told[name] = cells.many(sums), [cells.many(sums) for _ in range(kinds)]


def _unpack_rows(cells: PackedStream, told: dict[str, Any]) -> None:
    """Read the parts of a week of the operator's page."""
    for name, kinds in (("violations", 1), ("time_cells", 2)):
        cells.one()
        if name == "time_cells":
            told["unit"] = cells.one()
        sums = cells.one()
        told[f"{name}_key"], told[f"{name}_sums"] = cells.many(sums), [cells.many(sums) for _ in range(kinds)]
        cells.one()
        size = cells.many(sums)
        cells.many(sum(size))
        told[name] = [cells.wide(sum(size)) for _ in range(kinds)]
        if name == "violations":
            cells.one()
            rows = cells.one()
            told["fine_key"], told["fine"] = cells.many(rows), [cells.many(rows)]
    cells.one()
    n_x, n_y, _, _ = cells.many(4)
    cells.many(n_x * n_y)


def at(day: int, hour: int) -> datetime:
    """Return an instant of the planted week."""
    return worlds.rome(day, hour)
