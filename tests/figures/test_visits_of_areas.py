"""Visits of an area through store, facts and marts: against planted visitors, cut tracks and two cameras."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from figures.answer_cells import Cells, only_row
from warehouse.small_projects import DAY, HOUR, T0, Person, beats, make_site, open_days, put

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.visits import visits
from vsd_analytics.site.model import Area, Camera, Site

FIRST = date(2026, 11, 9)
TILL = Area("till", "Till", "ground", ((0, 0), (4, 0), (4, 4), (0, 4)), has_visits=True)


def with_till(root: Path, **changes: object) -> Site:
    return replace(make_site(root), areas=(replace(TILL, **changes),))  # type: ignore[arg-type]


def visitor(start_ms: int, stay_s: int, track: str, *, cut_after_s: int | None = None) -> list[Person]:
    """Return somebody who comes from the left, stays in the area and goes on: 3 s outside on either side, at 1 Hz."""
    rows = []
    for s in range(-3, stay_s + 3):
        x = -1000 if s < 0 else 2000 if s < stay_s else 6000
        is_lost = cut_after_s is not None and s >= cut_after_s
        rows.append(Person(start_ms + s * 1000, f"{track}-2" if is_lost else track, x, 2000))
    return rows


def visits_of(site: Site, n_days: int = 1) -> Cells:
    last = FIRST + timedelta(days=n_days - 1)
    with open_days(site, FIRST.isoformat(), last.isoformat()) as warehouse:
        return only_row(visits(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, last)))


def test_visits_equal_the_planted_ones(tmp_path: Path) -> None:
    site = with_till(tmp_path)
    stays = list(range(5, 45))
    rows = [row for k, stay in enumerate(stays) for row in visitor(T0 + k * 60_000, stay, f"t{k}")]
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    found = visits_of(site)
    assert found.numbers("n_visits", "n_followed", "n_cut", "n_began_inside") == (40, 40, 0, 0)
    assert found.numbers("long_share", "n_long", "n_short") == (None, None, None), "nobody stayed that long"
    assert found["dwell_median_s"].value == np.sort(stays)[19]
    assert found["visits_per_open_h"].value == pytest.approx(40)
    assert found["little_ratio"].value == pytest.approx(1.0, abs=0.01)


def test_a_week_of_cut_tracks_holds_the_planted_median_and_the_naive_one_does_not(tmp_path: Path) -> None:
    site = with_till(tmp_path)
    rng = np.random.default_rng(1)
    rows, stays, pieces = [], [], []
    for d in range(7):
        for k in range(50):
            stay = int(np.ceil(np.exp(rng.normal(3.3, 0.7))))
            cut = int(np.ceil(rng.exponential(40)))
            rows += visitor(T0 + d * DAY + k * 70_000, stay, f"{d}-{k}", cut_after_s=cut if cut < stay else None)
            stays.append(stay)
            pieces += [cut, stay - cut] if cut < stay else [stay]
        rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR)
    put(site, rows)
    found = visits_of(site, n_days=7)
    median = found["dwell_median_s"]
    n_began_inside, n_cut = found.numbers("n_began_inside", "n_cut")
    assert n_cut is not None
    assert n_began_inside == n_cut > 0.3 * len(stays)
    assert median.lo is not None
    assert median.hi is not None
    assert median.lo <= np.median(stays) <= median.hi
    assert np.median(pieces) < median.lo
    assert found.row["means_agree"] is True


def test_a_visit_over_the_hour_is_one_visit(tmp_path: Path) -> None:
    site = with_till(tmp_path)
    put(site, [*visitor(T0 + HOUR - 20_000, 60, "a"), *beats(T0, T0 + 2 * HOUR)])
    assert visits_of(site).numbers("n_visits", "n_cut") == (1, 0)


def test_an_area_that_does_not_ask_has_no_visits(tmp_path: Path) -> None:
    site = with_till(tmp_path, has_visits=False)
    put(site, [*visitor(T0, 60, "a"), *beats(T0, T0 + HOUR)])
    with open_days(site) as warehouse:
        answer = visits(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, FIRST))
        assert (answer.rows, answer.nothing) == ((), Reason("visits.not_asked"))
        assert warehouse.rows("select * from area_stays") == []


def test_who_begins_and_ends_in_a_door_came_and_went(tmp_path: Path) -> None:
    rows = [Person(T0 + s * 1000, "a", 2000, 2000) for s in range(10)]
    for is_door, n in ((False, 0), (True, 1)):
        site = with_till(tmp_path / str(is_door), is_door=is_door)
        put(site, [*rows, *beats(T0, T0 + HOUR)])
        assert visits_of(site).numbers("n_visits", "n_began_inside") == (n, 1 - n)


def test_somebody_two_cameras_see_is_one_visit(tmp_path: Path) -> None:
    """The camera that owns the place of the entry counts it; the other one's track counts nothing."""
    view = ((-5.0, -5.0), (10.0, -5.0), (10.0, 10.0), (-5.0, 10.0))
    cameras = [Camera(c, c, "ground", hz=1.0, view=view) for c in ("cam", "cam-2")]
    site = replace(make_site(tmp_path, cameras=cameras), areas=(TILL,))
    rows = visitor(T0, 30, "a")
    both = [*rows, *(replace(r, camera="cam-2", track="b") for r in rows)]
    put(site, [*both, *beats(T0, T0 + HOUR), *beats(T0, T0 + HOUR, camera="cam-2")])
    assert visits_of(site)["n_visits"].value == 1


def test_a_dead_camera_is_named_and_its_visits_are_not_zero(tmp_path: Path) -> None:
    site = with_till(tmp_path)
    rows = [row for k in range(40) for row in visitor(T0 + k * 60_000, 20, f"t{k}")]
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        found = only_row(visits(Period(data, FIRST + timedelta(days=1), FIRST + timedelta(days=1))))
    assert found.numbers("visits_per_open_h", "dwell_median_s", "recorded_share") == (None, None, 0.0)
