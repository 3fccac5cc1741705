from __future__ import annotations

from dataclasses import replace
from datetime import date
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.simulate.demo_project import opening
from vsd_analytics.simulate.people import MARGIN_S, SimulatedDay, people_inside, simulate_day
from vsd_analytics.simulate.shop import AREA_RECTS, CHECKOUT, SHOP_AFTER, SHOP_BEFORE
from vsd_analytics.simulate.truth import close_pairs, hours_of, violations
from vsd_analytics.simulate.walking import Routes, Walker, serve


def a_day(day: date, *, moved: bool, interval_s: float, seed: int = 1) -> SimulatedDay:
    opens, closes = opening(day)
    return simulate_day(opens, closes=closes, seed=seed, interval_s=interval_s, display_moved=moved)


@pytest.fixture(params=["before", "after"])
def day(request: pytest.FixtureRequest) -> SimulatedDay:
    found: SimulatedDay = request.getfixturevalue(request.param)
    return found


def test_everybody_stays_on_the_free_floor(day: SimulatedDay) -> None:
    assert len(day.x_m) > 100_000
    assert day.shop.is_free(day.x_m, day.y_m).all()


def test_nobody_who_leads_walks_through_a_fixture() -> None:
    day = a_day(date(2026, 11, 11), moved=False, interval_s=0.5)
    leads = day.person == _leader(day)
    same = leads[1:] & (np.diff(day.person) == 0)
    middle_x, middle_y = ((v[1:] + v[:-1])[same] / 2 for v in (day.x_m, day.y_m))
    assert day.shop.is_free(middle_x, middle_y).all()
    step_m = np.hypot(np.diff(day.x_m), np.diff(day.y_m))[same]
    assert step_m.max() < 1.5  # in half a second, stepping aside included
    walking = step_m[step_m > 0.25]
    assert 1.0 < np.median(walking) / 0.5 < 1.4


def _leader(day: SimulatedDay) -> np.ndarray:
    first_row = np.unique(day.party, return_index=True)[1]
    return day.person[first_row][np.searchsorted(day.party[first_row], day.party)]


def test_groups_walk_together(day: SimulatedDay) -> None:
    others = day.person != _leader(day)
    assert 0.1 < others.mean() < 0.35
    key = day.party * day.n_frames + day.frame
    lead_key, lead_row = np.unique(key[~others], return_index=True)
    lead = np.flatnonzero(~others)[lead_row[np.searchsorted(lead_key, key[others])]]
    apart_m = np.hypot(day.x_m[others] - day.x_m[lead], day.y_m[others] - day.y_m[lead])
    assert 0.6 < np.median(apart_m) < 1.1
    assert np.quantile(apart_m, 0.99) < 2.0


def test_strangers_do_not_walk_together(before: SimulatedDay) -> None:
    first, second = close_pairs(before)
    strangers = before.party[first] != before.party[second]
    a, b = (
        np.minimum(before.person[first], before.person[second]),
        np.maximum(before.person[first], before.person[second]),
    )
    together_s = np.unique(np.stack([a, b])[:, strangers], axis=1, return_counts=True)[1] * before.interval_ms / 1000
    assert np.median(together_s) < 30


def test_busy_hours_are_busy_and_the_shop_is_empty_before_opening_and_at_the_end(before: SimulatedDay) -> None:
    inside = people_inside(before)
    margin = MARGIN_S * 1000 // before.interval_ms
    assert not inside[:margin].any()
    assert not inside[-30:].any()
    assert 6 < inside[margin:-margin].mean() < 13
    assert inside.max() <= 40
    hours = hours_of(before)
    assert len(hours) == 13
    assert sum(h.entered for h in hours) == len(before.entered_ms)
    assert hours[9].entered > 1.4 * hours[0].entered


def test_same_seed_and_date_give_the_same_people_at_any_frame_interval() -> None:
    fine, coarse = (a_day(date(2026, 11, 10), moved=False, interval_s=s) for s in (2.0, 4.0))
    assert np.array_equal(fine.entered_ms, coarse.entered_ms)
    even = fine.frame % 2 == 0
    assert np.array_equal(fine.frame[even] // 2, coarse.frame)
    assert np.quantile(np.hypot(fine.x_m[even] - coarse.x_m, fine.y_m[even] - coarse.y_m), 0.999) < 0.01


def test_another_seed_gives_another_day() -> None:
    first, second = (a_day(date(2026, 11, 10), moved=False, interval_s=4.0, seed=s) for s in (1, 2))
    assert len(first.entered_ms) != len(second.entered_ms)


def test_checkout_queue_is_the_busiest_spot_in_true_positions(after: SimulatedDay) -> None:
    found = violations(after)
    counts, _, _ = np.histogram2d(found.x_m, found.y_m, bins=(24, 16), range=((0, 24), (0, 16)))
    i, j = np.unravel_index(counts.argmax(), counts.shape)
    x0, y0, x1, y1 = AREA_RECTS["checkout-queue"]
    assert x0 <= i + 0.5 <= x1
    assert y0 <= j + 0.5 <= y1
    outside = counts.copy()
    outside[3:15, 3:6] = 0
    assert counts.max() > 2 * outside.max()


def test_waiting_line_is_first_come_first_served_and_moves_up() -> None:
    draw, routes = Random(3), Routes(SHOP_AFTER)
    walkers = [Walker(routes, draw, zone="front", start_s=600.0 + 5 * k, place=(10.0, 6.5), size=1) for k in range(6)]
    serve(walkers, CHECKOUT, draw=draw, service_s=60.0, open_stations=[1])
    assert all(np.all(np.diff(w.t_s) > 0) for w in walkers)
    # the moment each is last seen in the line's row, before turning to the tills
    left = [max(t for t, y in zip(w.t_s, w.y_m, strict=True) if abs(y - CHECKOUT.head[1]) < 0.2) for w in walkers]
    assert left == sorted(left)
    standing = [np.interp(640.0, w.t_s, w.x_m) for w in walkers[2:5]]
    assert np.diff(standing) == pytest.approx([0.95, 0.95], abs=0.25)


@pytest.mark.parametrize("shop", [SHOP_BEFORE, SHOP_AFTER])
def test_every_zone_is_free_and_reachable(shop) -> None:  # type: ignore[no-untyped-def]
    routes = Routes(shop)
    for name, (x0, y0, x1, y1) in shop.zones.items():
        xs, ys = np.meshgrid(np.linspace(x0, x1, 60), np.linspace(y0, y1, 60))
        assert shop.is_free(xs, ys).all(), name
        way = routes.between("hall", name)
        assert way[-1].zone == name if name != "hall" else way == ()


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_close_pairs_equal_all_pairs_compared(data: st.DataObject) -> None:
    n = data.draw(st.integers(0, 40))
    frame = np.array(data.draw(st.lists(st.integers(0, 3), min_size=n, max_size=n)), dtype=np.int64)
    place = st.floats(0, 6).map(lambda v: round(v, 1))
    x, y = (np.array(data.draw(st.lists(place, min_size=n, max_size=n)), dtype=np.float64) for _ in range(2))
    opens, closes = opening(date(2026, 11, 7))
    day = SimulatedDay(
        opens.date(),
        opens,
        closes,
        0,
        2000,
        4,
        SHOP_AFTER,
        np.arange(n),
        np.arange(n),
        frame,
        x,
        y,
        np.zeros(n, np.int64),
    )
    expected = {
        (i, j)
        for i in range(n)
        for j in range(i + 1, n)
        if frame[i] == frame[j] and np.hypot(x[i] - x[j], y[i] - y[j]) < 2.0
    }
    first, second = close_pairs(day)
    assert {(min(a, b), max(a, b)) for a, b in zip(first.tolist(), second.tolist(), strict=True)} == expected
    assert len(first) == len(expected)


def test_violations_break_after_the_gap_and_need_three_seconds(before: SimulatedDay) -> None:
    # one pair, a frame every 2 s: frames 0-2 stand for 6 s, then a silence of 6 s, then frame 5 alone for 2 s
    def world(frames: list[int]) -> SimulatedDay:
        f = np.array([*frames, *frames], dtype=np.int64)
        person = np.repeat([0, 1], len(frames))
        x = np.where(person == 0, 3.0, 4.5)
        return replace(before, person=person, party=person, frame=f, x_m=x, y_m=np.full(len(f), 5.0), interval_ms=2000)

    found = violations(world([0, 1, 2, 5]))
    assert found.frame.tolist() == [0]
    assert found.duration_s.tolist() == [6.0]
    assert (found.x_m[0], found.y_m[0]) == (3.75, 5.0)
    assert violations(world([0, 1, 2, 4, 5])).duration_s.tolist() == [12.0]
    assert violations(world([0, 1])).duration_s.tolist() == [4.0]
    assert len(violations(world([0])).frame) == 0
