"""Records of a part of a floor: those that an edit needs, and the same paths as in all of them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.whatif.walkers import walkers
from vsd_analytics.whatif.detours import detours
from vsd_analytics.whatif.floor_records import ALONE, FloorRecords, companies

BOX = ((4.0, -0.5), (5.0, -0.5), (5.0, 0.5), (4.0, 0.5))


def crowd(seed: int, step_s: float) -> FloorRecords:
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-12, 18, (80, 4))
    return walkers(*(((a, b), (c, d), 7.0 * k) for k, (a, b, c, d) in enumerate(ends)), step_s=step_s)


@pytest.mark.parametrize("step_s", [0.5, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_ways_around_are_the_same_from_the_records_near_it(seed: int, step_s: float) -> None:
    """People walk up to 3.6 m between two records: the way may cross a place in which none of their records lies."""
    every = crowd(seed, step_s)
    rows = every.passing((1.2, -3.3, 7.8, 3.3))
    assert rows.size < every.track.size
    near = every.part(rows)
    all_of_them, found = detours(every, BOX, solid=None), detours(near, BOX, solid=None)
    assert found.touched.tolist() == all_of_them.touched.tolist()
    assert rows[found.rows].tolist() == all_of_them.rows.tolist()
    assert np.array_equal(found.x_m, all_of_them.x_m[rows])
    assert np.array_equal(found.y_m, all_of_them.y_m[rows])
    assert found.rows.size > 0


def test_records_that_no_longer_follow_each_other_do_not_join() -> None:
    every = walkers(((0.0, 0.0), (9.0, 0.0), 0.0), step_s=1.0)
    assert every.part(np.array([0, 1, 3])).joins_next.tolist() == [True, False]


def test_frames_of_a_camera_are_those_of_its_instants() -> None:
    every = crowd(1, 1.0)
    [(t_s, frames)] = every.frames_of_cameras
    assert t_s.tolist() == np.unique(every.t_s).tolist()
    of_instant = dict(zip(every.t_s.tolist(), every.frame.tolist(), strict=True))
    assert frames.tolist() == [of_instant[t] for t in t_s.tolist()]


def test_companions_of_companions_are_one_company() -> None:
    track = np.repeat([2, 4, 5, 7, 9], 2)
    found = companies(track, np.array([2, 7, 5, -1]), np.array([4, 2, 8, 9]))
    assert found.reshape(-1, 2)[:, 0].tolist()[:2] == found[6:8].tolist()
    assert (found == ALONE).tolist() == np.isin(track, [5, 9]).tolist()
    assert companies(track, track[:0], track[:0]).tolist() == [ALONE] * 10
