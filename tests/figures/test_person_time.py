"""How many people are in view and how much of their time is too close, against a plain recount of planted frames."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from warehouse.small_projects import DAY, HOUR, T0, Person, beats, make_site, open_days, put

from vsd_analytics.figures.close_time import (
    burden,
    change_burden,
    change_close_time_share,
    close_time,
    close_time_share,
)
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.figures.person_time import PersonTime, person_time
from vsd_analytics.site.model import Area, Site
from vsd_analytics.stats.estimates import ChangeEstimate

FIRST = date(2026, 11, 9)
COUPLE = ("a", "b")


def scene(start: int) -> list[Person]:
    """Return a couple that walks 1 m apart past somebody who stands, and two strangers far off."""
    rows = []
    for s in range(60):
        ts = start + s * 1000
        rows += [Person(ts, track, 500 * s, 1000 * k) for k, track in enumerate(COUPLE)]
        rows += [Person(ts, "c", 10_000, 2_500), Person(ts, "d", 40_000, 0), Person(ts, "e", 40_000, 1_500)]
    return rows


def recount(rows: list[Person]) -> tuple[int, int]:
    """Return person-seconds with anybody, and with anybody but one's companion, closer than 2 m."""
    frames = defaultdict(list)
    for row in rows:
        frames[row.ts].append(row)
    everybody = others = 0
    for seen in frames.values():
        for one in seen:
            near = {o.track for o in seen if o is not one and np.hypot(one.x - o.x, one.y - o.y) < 2000}
            everybody += bool(near)
            others += bool(near - (set(COUPLE) if one.track in COUPLE else set()))
    return everybody, others


def told(site: Site, n_days: int = 1) -> PersonTime:
    last = FIRST + timedelta(days=n_days - 1)
    with open_days(site, FIRST.isoformat(), last.isoformat()) as warehouse:
        return person_time(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, last))


def test_time_too_close_in_both_readings_equals_a_recount(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    rows = scene(T0)
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    everybody, others = recount(rows)
    assert 0 < others < everybody < len(rows)
    found = told(site)
    assert found.exposure_h == pytest.approx(len(rows) / 3600)
    assert found.close.value == pytest.approx(everybody / len(rows))
    assert found.close_between.value == pytest.approx(others / len(rows))
    assert found.close.lo is found.people.lo is None  # one day


def test_the_fullest_quarter_hour_is_found(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [*scene(T0), *scene(T0 + HOUR // 2), *scene(T0 + HOUR // 2 + 120_000), *beats(T0, T0 + HOUR)])
    peak = told(site).peak
    assert peak is not None
    assert peak.start.minute == 30
    assert peak.people == pytest.approx(2 * 300 / 900)


def test_days_make_the_intervals(tmp_path: Path) -> None:
    """Seven days of other lengths: wider than nothing, around the value, and a share stays below 1."""
    site = make_site(tmp_path, min_exposure_h=0.0)
    rows = []
    for d in range(7):
        for k in range(2 + d % 3):
            rows += scene(T0 + d * DAY + k * 100_000)
        rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR)
    put(site, rows)
    found = told(site, 7)
    for level in (found.people, found.close, found.close_between):
        assert level.value is not None
        assert level.lo is not None
        assert level.hi is not None
        assert level.lo <= level.value <= level.hi <= 1
    assert found.people.hi - found.people.lo > 0.1 * found.people.value
    assert found.close.hi - found.close.lo < 0.01  # every scene has the same share


def test_areas_and_the_rest_add_up_to_the_floors_time_too_close(tmp_path: Path) -> None:
    site = replace(make_site(tmp_path), areas=(Area("near", "Near", "ground", ((8, -5), (20, -5), (20, 5), (8, 5))),))
    rows = scene(T0)
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    inside = [row for row in rows if 8000 <= row.x < 20_000]
    with open_days(site, FIRST.isoformat()) as warehouse:
        period = Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, FIRST)
        floor, near, rest = (close_time(period, where) for where in (site.floors[0], site.areas[0], None))
        share = close_time_share(period, near)
        minutes = burden(period, floor)
    np.testing.assert_allclose(near.n + rest.n, floor.n)
    assert near.exposure_h.sum() * 3600 == pytest.approx(len(inside))
    together = [row for row in inside if row.track != "c"]  # the couple is never alone; c is, but for their passing
    passing = {r.ts for r in together if abs(r.x - 10_000) ** 2 + (r.y - 2500) ** 2 < 2000**2}
    assert share.value == pytest.approx((len(together) + len(passing)) / len(inside))
    assert minutes.value == pytest.approx(recount(rows)[0] / 60)


def halved_scenes(root: Path, **settings: float) -> tuple[ChangeEstimate, ChangeEstimate]:
    """Return the changes of M6 and of the burden in a second week with half of the scenes of the first."""
    site = make_site(root, min_exposure_h=0.0, **settings)
    rows = []
    for d in range(14):
        for k in range((2 + d % 7 % 3) * (2 if d < 7 else 1)):
            rows += scene(T0 + d * DAY + k * 100_000)
        rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR)
    put(site, rows)
    last = FIRST + timedelta(days=13)
    with open_days(site, FIRST.isoformat(), last.isoformat()) as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        pair = TwoPeriods(Period(data, FIRST, FIRST + timedelta(days=6)), Period(data, FIRST + timedelta(days=7), last))
        place = close_time(pair.now, site.floors[0])
        return change_close_time_share(pair, place), change_burden(pair, place)


@pytest.mark.parametrize(("within", "verdict"), [(0.01, "cannot_tell"), (0.5, "about_same")])
def test_the_setting_of_about_the_same_holds_for_time_too_close(tmp_path: Path, within: float, verdict: str) -> None:
    share, _ = halved_scenes(tmp_path, about_same_share=within)
    assert share.verdict == verdict


def test_less_dwelling_lowers_the_burden_and_leaves_the_share(tmp_path: Path) -> None:
    """Half of the scenes: the same share of the time is too close, and half of the person-minutes an hour."""
    share, minutes = halved_scenes(tmp_path)
    assert share.value == pytest.approx(1.0)
    assert minutes.value == pytest.approx(0.5)
    assert minutes.verdict == "clear_fall"
    assert minutes.rate_b == pytest.approx(np.mean([2 + d % 3 for d in range(7)]) * recount(scene(T0))[0] / 60)
    assert (share.n_a, minutes.n_b) == (None, None)  # person-seconds are no number of violations
