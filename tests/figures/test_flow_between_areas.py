"""Flow and routes through store, facts and marts: against planted walkers, lost tracks and two cameras."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from figures.walkers_between_areas import site_with_areas, walk
from warehouse.small_projects import DAY, HOUR, T0, Person, beats, open_days, put

from vsd_analytics.figures.flow import Flow, flow
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.site.model import Camera, Site

FIRST = date(2026, 11, 9)


def flow_of(site: Site, n_days: int = 1) -> Flow:
    last = FIRST + timedelta(days=n_days - 1)
    with open_days(site, FIRST.isoformat(), last.isoformat()) as warehouse:
        found = flow(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, last))
    assert found is not None
    return found


def shares(found: Flow, area: str) -> dict[tuple[str, ...], float | None]:
    (of,) = [a for a in found.areas if a.area.area_id == area]
    return {tuple(a.area_id for a in to.areas): to.share.value for to in of.to}


def test_flow_and_routes_equal_the_planted_ones(tmp_path: Path) -> None:
    site = site_with_areas(tmp_path)
    ways = [("door", "bread", "till", "door")] * 24 + [("door", "wine", "till", "door")] * 12 + [("door", "wine")] * 4
    rows = [row for k, way in enumerate(ways) for row in walk(way, T0 + k * 60_000, f"t{k}")]
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    found = flow_of(site)
    assert shares(found, "door") == {("bread",): pytest.approx(0.6), ("wine",): pytest.approx(0.4)}
    assert shares(found, "till") == {("door",): 1.0}
    (door, *_, till) = found.areas
    assert (door.leave_per_open_h.value, till.leave_per_open_h.value) == (pytest.approx(40), pytest.approx(36))
    assert door.to[0].followed_per_open_h.value == pytest.approx(24)
    assert (door.following.not_followed.n, door.inflow.value) == (0, pytest.approx(1.0))
    assert [tuple(a.area_id for a in r.areas) for r in found.routes.routes] == [
        ("door", "bread", "till", "door"),
        ("door", "wine", "till", "door"),
    ]
    assert found.routes.following.not_followed.n == 4  # who ends in the wine area did not leave


def test_who_is_lost_on_the_way_went_nowhere(tmp_path: Path) -> None:
    site = site_with_areas(tmp_path)
    ways = [("door", "bread")] * 30 + [("door", "till")] * 30
    rows = [
        row for k, way in enumerate(ways)
        for row in walk(way, T0 + k * 50_000, f"t{k}", lost_after_s=5 if k % 3 == 0 else None)
    ]  # fmt: skip
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    (door, *rest) = flow_of(site).areas
    assert (door.following.n, door.following.not_followed.n) == (60, 20)
    assert [to.share.n for to in door.to] == [20, 20]
    assert [(round(a.inflow.expected), a.inflow.n_arrived) for a in rest] == [(30, 30), (0, 0), (30, 30)]


def test_a_short_step_into_the_next_area_is_no_place_of_the_way(tmp_path: Path) -> None:
    """Who is back within visit_gap_s never left: bread, one second of wine, bread again, till."""
    site = site_with_areas(tmp_path)
    rows = []
    for k in range(40):
        way = [(5, 1)] * 3 + [(9, 1)] + [(5, 1)] * 3 + [(9, 3), (13, 1)]
        rows += [Person(T0 + k * 60_000 + s * 1000, f"t{k}", x * 1000, y * 1000) for s, (x, y) in enumerate(way)]
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    found = flow_of(site)
    assert shares(found, "bread") == {("till",): 1.0}
    assert shares(found, "wine") == {}


def test_few_people_are_one_sum(tmp_path: Path) -> None:
    site = site_with_areas(tmp_path)
    ways = [("door", "bread", "door")] * 34 + [("door", "wine", "door")] * 3 + [("door", "till", "door")] * 3
    rows = [row for k, way in enumerate(ways) for row in walk(way, T0 + k * 60_000, f"t{k}")]
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    found = flow_of(site)
    assert shares(found, "door") == {("bread",): pytest.approx(0.85), ("wine", "till"): pytest.approx(0.15)}
    assert [len(r.areas) for r in found.routes.routes] == [3, 0]


def test_somebody_two_cameras_see_leaves_once(tmp_path: Path) -> None:
    view = ((-5.0, -5.0), (20.0, -5.0), (20.0, 10.0), (-5.0, 10.0))
    cameras = [Camera(c, c, "ground", hz=1.0, view=view) for c in ("cam", "cam-2")]
    site = replace(site_with_areas(tmp_path), cameras=tuple(cameras))
    rows = [row for k in range(40) for row in walk(("door", "bread"), T0 + k * 60_000, f"t{k}")]
    both = [*rows, *(replace(r, camera="cam-2", track=f"{r.track}b") for r in rows)]
    put(site, [*both, *beats(T0, T0 + HOUR), *beats(T0, T0 + HOUR, camera="cam-2")])
    (door, bread, *_) = flow_of(site).areas
    assert (door.following.n, bread.inflow.n_arrived) == (40, 40)


def test_a_week_of_lost_tracks_holds_the_planted_share_and_a_dead_camera_is_unknown(tmp_path: Path) -> None:
    site = site_with_areas(tmp_path)
    rng = np.random.default_rng(2)
    rows: list[Person] = []
    n_followed = {"bread": 0, "till": 0}
    for d in range(7):
        for k in range(60):
            to = "bread" if rng.random() < 0.5 else "till"
            lost = 4 + int(rng.exponential(8))
            n_followed[to] += lost > {"bread": 9, "till": 17}[to]
            rows += walk(("door", to), T0 + d * DAY + k * 50_000, f"{d}-{k}", lost_after_s=lost)
        rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR)
    put(site, rows)
    (door, *rest) = flow_of(site, 7).areas
    by_area = {to.areas[0].area_id: to.share for to in door.to}
    naive = n_followed["till"] / sum(n_followed.values())
    till = by_area["till"]
    assert till.lo is not None
    assert till.hi is not None
    assert naive < till.lo <= 0.5 <= till.hi
    assert all(a.inflow.agrees is not False for a in rest)
    with open_days(site, "2026-11-09", "2026-11-16") as warehouse:
        monday = FIRST + timedelta(days=7)
        dead = flow(Period(FloorHours(warehouse, floor=site.floors[0]), monday, monday))
    assert dead is not None
    assert dead.silent_cameras == ("cam",)
    assert [(a.leave_per_open_h.value, a.to) for a in dead.areas] == [(None, ())] * 4


def test_areas_that_do_not_ask_have_no_flow(tmp_path: Path) -> None:
    site = site_with_areas(tmp_path)
    site = replace(site, areas=tuple(replace(a, has_visits=False) for a in site.areas))
    put(site, [*walk(("door", "bread"), T0, "a"), *beats(T0, T0 + HOUR)])
    with open_days(site) as warehouse:
        assert flow(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, FIRST)) is None
