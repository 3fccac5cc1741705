"""Gatherings by hour of the week, and the chance of one next week."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from planted_floors import site_of
from planted_marts import plant

from vsd_analytics.figures.forecast import HISTORY_WEEKS, forecast
from vsd_analytics.figures.gatherings import gathering_hours
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse

MONDAY = date(2026, 11, 9)
HOURS = (9, 10, 11)
DAY_MS = 86_400_000


@contextmanager
def weeks(site: Site, n_weeks: int, *, down: tuple[tuple[int, int], ...] = ()) -> Iterator[Warehouse]:
    """Open weeks with two gatherings every Tuesday at 10, one every other Friday at 9, and one when it is closed.

    Args:
        site: The site.
        n_weeks: Weeks, the one from `MONDAY` last.
        down: Week and weekday of days without a record; 0 is the last week.
    """
    first = MONDAY - timedelta(weeks=n_weeks - 1)
    slots: list[tuple[Any, ...]] = []
    hours: list[tuple[Any, ...]] = []
    found: list[tuple[Any, ...]] = []
    for back in range(n_weeks):
        for weekday in range(7):
            day = MONDAY - timedelta(weeks=back) + timedelta(days=weekday)
            is_up = (back, weekday) not in down
            for hour in HOURS:
                start = (day - date(1970, 1, 1)).days * DAY_MS + hour * 3_600_000
                slots.append(("cam", day, hour, 1.0, 1.0 * is_up, 5.0 if is_up else None, 3 if is_up else None))
                hours.append(("cam", start, hour))
                n = {(1, 10): 2, (4, 9): back % 2}.get((weekday, hour), 0)
                if is_up:
                    found += [("cam", "ground", start, day, True, True)] * n + [
                        ("cam", "ground", start, day, False, True)
                    ]
                    found.append(("cam", "ground", start, day, True, False))
    made = {
        "camera_slots": (
            ("camera_id", "local_date", "local_hour", "open_h", "recorded_h", "person_h", "n_violations"),
            slots,
        ),
        "camera_hours": (("camera_id", "hour_start_ms", "local_hour"), hours),
        "gatherings": (("camera_id", "floor_id", "hour_start_ms", "local_date", "is_open", "is_owned"), found),
    }
    with Warehouse(site, first, MONDAY + timedelta(days=6)) as warehouse:
        for name, (columns, rows) in made.items():
            plant(warehouse, name, pa.table(dict(zip(columns, map(list, zip(*rows, strict=True)), strict=True))))
        yield warehouse


def test_gatherings_are_counted_in_the_hour_they_began_in(tmp_path: Path) -> None:
    """Those of another camera's floor, and those outside opening hours, are not."""
    with weeks(site_of(tmp_path), 5, down=((2, 1),)) as warehouse:
        n, x_h = gathering_hours(warehouse, MONDAY, floor_id="ground")
    assert n.shape == x_h.shape == (HISTORY_WEEKS + 1, 168)
    assert n[-5:, 34].tolist() == [2, 2, 0, 2, 2]
    assert x_h[-5:, 34].tolist() == [1, 1, 0, 1, 1]  # a day without a record is no day without a gathering
    assert n[-5:, 4 * 24 + 9].tolist() == [0, 1, 0, 1, 0]
    assert n.sum() == 2 * 4 + 2
    assert x_h[: HISTORY_WEEKS - 4].sum() == 0


def test_the_chance_of_a_gathering_is_high_where_there_always_was_one(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with weeks(site, 8) as warehouse:
        counted = gathering_hours(warehouse, MONDAY, floor_id="ground")
        made = forecast(warehouse, MONDAY, floor_id="ground", gatherings=counted).gatherings
    chance = {(r.weekday, r.hour): r.value for r in made.rows if r.value is not None}
    assert made.state == "ok"
    assert chance[1, 10] > 0.75
    assert chance[1, 10] > chance[4, 9] > chance[0, 9]
    assert chance[0, 9] == pytest.approx(chance[6, 11])
    assert chance[0, 9] < 0.1
