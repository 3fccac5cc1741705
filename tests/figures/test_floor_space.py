"""Figures by square metre (M54): the floor where people can walk and cameras count, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

import vsd_analytics as vsd
from vsd_analytics.answer import Value
from vsd_analytics.figures import compare
from vsd_analytics.figures.floor_space import OF_M2, VIEW_UNKNOWN, per_floor, view_of, walkable_m2
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.stats.estimates import no_rate
from vsd_analytics.warehouse.warehouse import open_warehouse


@pytest.fixture(scope="module")
def week(demo_project: Path) -> vsd.Days:
    return vsd.open(demo_project).week("2026-W46")


@pytest.fixture(scope="module")
def sizes_m2(week: vsd.Days) -> tuple[dict[str | None, float], dict[str | None, float]]:
    """Return the sizes, and the same by throwing 400,000 points on the plan."""
    site = week.site
    with open_warehouse(site, *compare.days_needed(site, (week.first, week.last))) as warehouse:
        period = Period(FloorHours(warehouse, floor=site.floors[0]), week.first, week.last)
        sizes = dict(walkable_m2(period))
        views = [view for c in period.data.cameras if (view := view_of(period, c)) is not None]
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-1, 31, 400_000), rng.uniform(-1, 31, 400_000)

    def within(polygons: list[shapely.Polygon]) -> np.ndarray:
        return np.logical_or.reduce([shapely.contains_xy(p, x, y) for p in polygons])

    free = within(views) & ~within([shapely.Polygon(f.polygon) for f in site.fixtures])
    found: dict[str | None, float] = {}
    for area in site.areas:
        own = free & within([shapely.Polygon(area.polygon)])
        found[area.area_id] = own.sum() * 32**2 / len(x)
        free &= ~own
    return sizes, found | {None: free.sum() * 32**2 / len(x)}


def test_sizes_are_those_of_points_thrown_at_the_plan(
    sizes_m2: tuple[dict[str | None, float], dict[str | None, float]],
) -> None:
    sizes, thrown = sizes_m2
    assert sizes.keys() == thrown.keys()
    for area_id, size in sizes.items():
        assert size == pytest.approx(thrown[area_id], abs=1.0), area_id


def test_rates_by_floor_are_the_rates_over_the_floor(
    week: vsd.Days, sizes_m2: tuple[dict[str | None, float], dict[str | None, float]]
) -> None:
    rows = week.areas.df().set_index("name")
    assert rows["floor_m2"].sum() == pytest.approx(2 * sum(sizes_m2[0].values())), "areas and the rest are the floor"
    for end in ("", "_lo", "_hi"):
        by_floor = rows[f"violations_per_open_h{end}"] / rows["floor_m2"] * OF_M2
        assert rows[f"violations_per_open_h_100_m2{end}"].tolist() == pytest.approx(by_floor.tolist())
        assert rows[f"people_per_m2{end}"].tolist() == pytest.approx((rows[f"people{end}"] / rows["floor_m2"]).tolist())


def test_people_and_minutes_too_close_of_areas_add_up_to_the_floor(week: vsd.Days) -> None:
    rows = week.areas.df()
    whole, parts = rows[rows["kind"] == "floor"], rows[rows["kind"] != "floor"]
    for name in ("people", "close_min_per_open_h"):
        assert parts[name].sum() == pytest.approx(whole[name].iloc[0], rel=0.02), name


def test_no_size_is_no_number_and_no_number_stays_none() -> None:
    assert per_floor(no_rate(VIEW_UNKNOWN), 12.0).value is None
    assert per_floor(None, 12.0).value is None
    for size in (None, 0.0):
        unknown = per_floor(Value(3.0), size)
        assert (unknown.value, unknown.reason) == (None, VIEW_UNKNOWN)
    assert per_floor(Value(3.0), 12.0).value == 0.25
