"""Stays that a moved fixture takes along: people who stand at known places, some of them beside each other."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from tests.whatif.walkers import stander
from vsd_analytics.site.layout import FixtureEdit
from vsd_analytics.whatif.floor_records import FloorRecords, floor_records
from vsd_analytics.whatif.place_times import PlaceTime
from vsd_analytics.whatif.stays import moved_stays

OLD, NEW = (tuple(shapely.box(x, 0, x + 1, 1).exterior.coords[:-1]) for x in (0, 20))
AREAS = {
    "old": shapely.box(-3, -3, 4, 4),
    "beside": shapely.box(22.5, -3, 28, 4),  # the new place is outside, but nearer than 2 m
    "far": shapely.box(40, -3, 44, 4),
    "floor": shapely.Polygon(),
}
RECORDED = {key: PlaceTime({"": 1000.0}, 5000.0, 1.0) for key in AREAS}


def standing(*people: tuple[float, float, float]) -> FloorRecords:
    """Return people who stand at (x, y) for a minute from an instant on."""
    stands = [stander(x, y, 60, start_s=start_s) for x, y, start_s in people]
    t_s, x_m, y_m = (np.concatenate(values) for values in zip(*stands, strict=True))
    track = np.repeat(np.arange(len(people)), 60)
    return floor_records(track=track, camera=0 * track, t_s=t_s, x_m=x_m, y_m=y_m)


def edit(share: float | None) -> FixtureEdit:
    return FixtureEdit("display", "Display", OLD, NEW, share)


AT_OLD = standing((2.0, 0.5, 0), (3.2, 0.5, 0), (2.0, 0.5, 600))
"""One stays at the fixture beside somebody who stands too far from it to stay there; another one stays alone."""
AT_NEW = standing((22.8, 0.5, 0), (22.2, 0.5, 1200), (22.0, 0.5, 1800))
"""Somebody stands near the new place at the same time; others show that people stand there."""


def test_the_old_place_loses_the_stays_and_those_close_to_nobody_else() -> None:
    found = moved_stays(AT_OLD, AT_NEW, edit(0.0), AREAS, RECORDED, within_m=2.0)
    assert set(found) == {"old", "floor"}
    assert (found["old"].n_leave, found["old"].n_come) == (2, 0)
    change = found["old"].change
    assert change is not None
    assert change.value == pytest.approx(-118 / 1000, abs=0.003)  # two people for a minute; its first second is no stay
    assert change.lo < change.value < change.hi


def test_the_new_place_gets_those_who_follow_and_an_area_beside_it_is_named() -> None:
    everybody, half = (moved_stays(AT_OLD, AT_NEW, edit(share), AREAS, RECORDED, within_m=2.0) for share in (1.0, 0.5))
    assert set(everybody) == {"old", "beside", "floor"}
    assert (everybody["beside"].n_leave, everybody["beside"].n_come) == (0, 2)
    assert half["beside"].n_come == 1
    more = everybody["beside"].change
    assert more is not None
    assert more.value == pytest.approx(59 / 1000, abs=0.003)  # the one who stands in it; the follower stands outside
    floor, old = everybody["floor"].change, everybody["old"].change
    assert floor is not None
    assert old is not None
    assert floor.value == pytest.approx(old.value + 2 * more.value, abs=0.003)


def test_nobody_stands_where_nobody_walks() -> None:
    """The old fixture was used from its left side; the new one has no floor there."""
    at_old = standing((-1.0, 0.5, 0))
    found = moved_stays(at_old, AT_NEW, edit(1.0), AREAS, RECORDED, within_m=2.0)
    more = found["beside"].change
    assert more is not None
    assert more.value == pytest.approx(59 / 1000, abs=0.003)


@pytest.mark.parametrize("share", [None, 0.0])
def test_without_a_share_or_followers_no_place_gets_more(share: float | None) -> None:
    found = moved_stays(AT_OLD, AT_NEW, edit(share), AREAS, RECORDED, within_m=2.0)
    assert all(moved.n_come == 0 and moved.change is not None and moved.change.value <= 0 for moved in found.values())
    assert bool(found) == (share is not None)


def test_a_place_with_little_time_too_close_says_nothing() -> None:
    little = RECORDED | {"old": PlaceTime({"": 10.0}, 100.0, 1.0)}
    found = moved_stays(AT_OLD, AT_NEW, edit(0.5), AREAS, little, within_m=2.0)
    assert found["old"].change is None
    assert found["old"].n_leave == 2
