"""Whom a fixture touches and how they get around it: properties on walkers with a known way."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from tests.whatif.walkers import walkers
from vsd_analytics.whatif.detours import CLEARANCE_M, detours
from vsd_analytics.whatif.floor_records import floor_records

BOX = ((4.0, -0.5), (5.0, -0.5), (5.0, 0.5), (4.0, 0.5))


def test_only_who_is_in_the_way_moves_and_nobody_ends_in_the_fixture() -> None:
    rng = np.random.default_rng(3)
    ways = [((0.0, y), (10.0, y + rng.normal(0, 0.2)), 7.0 * k) for k, y in enumerate(rng.uniform(-3, 3, 60))]
    records = walkers(*ways)
    found = detours(records, BOX, solid=None)
    shape = shapely.Polygon(BOX)
    paths = {k: shapely.LineString(np.column_stack([records.x_m, records.y_m])[records.track == k]) for k in range(60)}
    in_the_way = {k for k, path in paths.items() if path.distance(shape) < CLEARANCE_M}
    assert set(found.touched.tolist()) == in_the_way
    assert 5 < len(in_the_way) < 55
    assert set(records.track[found.rows].tolist()) <= in_the_way
    assert not shapely.contains_xy(shape.buffer(CLEARANCE_M - 1e-6), found.x_m, found.y_m).any()
    assert (found.n_standing, found.n_no_way) == (0, 0)


@pytest.mark.parametrize("step_s", [0.4, 1.0, 2.0])
def test_a_path_that_only_crosses_between_two_records_is_touched(step_s: float) -> None:
    records = walkers(((0.0, 0.1), (10.0, 0.1), 0.0), step_s=step_s)
    assert detours(records, ((4.9, -0.1), (5.0, -0.1), (5.0, 0.3), (4.9, 0.3)), solid=None).touched.tolist() == [0]


def test_people_pass_on_their_own_side_in_both_directions() -> None:
    records = walkers(((0, 0.3), (10, 0.3), 0), ((10, 0.3), (0, 0.3), 50), ((0, -0.3), (10, -0.3), 100))
    found = detours(records, BOX, solid=None)
    beside = np.abs(found.x_m - 4.5) < 0.6
    sides = {k: np.sign(found.y_m[beside & (records.track == k)]).tolist() for k in range(3)}
    assert all(set(s) == {1.0} for s in (sides[0], sides[1]))
    assert set(sides[2]) == {-1.0}


def test_companions_stay_on_one_side_and_others_do_not_care() -> None:
    ways = [((0, 0.4), (10, 0.4), 0), ((0, -0.1), (10, -0.1), 0), ((0, 0.2), (10, 0.2), 0)]
    together = walkers(*ways, company=(5, 5, 5))
    alone = walkers(*ways)
    for records, expected in ((together, {1.0}), (alone, {1.0, -1.0})):
        found = detours(records, BOX, solid=None)
        assert set(np.sign(found.y_m[np.abs(found.x_m - 4.5) < 0.6]).tolist()) == expected


def test_who_has_a_wall_on_the_own_side_takes_the_other_and_between_two_walls_there_is_no_way() -> None:
    records = walkers(((0, 0.3), (10, 0.3), 0))
    upper, lower = shapely.box(-1, 0.6, 11, 2), shapely.box(-1, -2, 11, -0.6)
    found = detours(records, BOX, solid=upper)
    assert (found.y_m[np.abs(found.x_m - 4.5) < 0.6] < 0).all()
    assert found.n_no_way == 0
    closed = detours(records, BOX, solid=shapely.union_all([upper, lower]))
    assert (closed.n_no_way, closed.rows.size) == (1, 0)


def test_who_stands_there_steps_to_its_edge() -> None:
    t_s = np.arange(20.0)
    records = floor_records(track=0 * t_s, camera=0 * t_s, t_s=t_s, x_m=0 * t_s + 4.4, y_m=0 * t_s + 0.2)
    found = detours(records, BOX, solid=None)
    assert (found.touched.tolist(), found.n_standing) == ([0], 1)
    edge = shapely.Polygon(BOX).buffer(CLEARANCE_M).exterior
    assert shapely.distance(edge, shapely.points(found.x_m, found.y_m)).max() < 1e-6


def test_a_gap_in_a_track_is_no_step_through_the_fixture() -> None:
    t_s = np.array([0.0, 1, 2, 60, 61, 62])
    x_m = np.array([1.0, 2, 3, 6, 7, 8])
    records = floor_records(track=0 * t_s, camera=0 * t_s, t_s=t_s, x_m=x_m, y_m=0 * t_s)
    assert detours(records, BOX, solid=None).touched.size == 0
