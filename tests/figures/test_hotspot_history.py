"""Who is who from week to week: rules of identity on hotspots drawn by hand."""

from __future__ import annotations

from datetime import date, timedelta

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from vsd_analytics.figures.hotspot_history import Found, History, follow
from vsd_analytics.stats.hotspots import Cells, Explained, Hotspots, PlaceRate, Spot

FIRST = date(2026, 9, 6)


def window(week: int, *rows: str) -> Found:
    """Return a window whose hotspots are the connected # of a drawing (top row is y = 0); of ~ a change is watched."""
    hot = np.array([[c == "#" for c in row] for row in rows])
    label, n = ndimage.label(hot, structure=np.ones((3, 3)))
    blank = np.full(hot.shape, np.nan)
    cells = Cells(blank, blank, blank, blank, blank, hot, hot, label.astype(np.int64))
    rate = PlaceRate(20, 10, 50, 28, 2.0, 1.5, 2.5)
    spots = []
    for k in range(1, n + 1):
        r, c = np.nonzero(label == k)
        spots.append(Spot(k, k, len(r), float(r.mean()), float(c.mean()), 0.01, rate))
    none = np.zeros((28, *hot.shape))
    explained = Explained(none, none, none, none.astype(bool))
    watched = np.array([[c == "~" for c in row] for row in rows])
    return Found(FIRST + timedelta(days=7 * week), Hotspots(cells, tuple(spots), 28, explained), watched)


def of(*windows: Found) -> History:
    return follow(windows, floor_id="ground", cell_m=1.0, first_cell=(-3, 10))


def test_an_id_names_the_floor_and_the_square_metre_it_was_first_seen_in() -> None:
    history = of(window(0, "......", ".##...", ".##..."))
    (one,) = history.now.values()
    assert (one.spot_id, one.state, one.is_since_first) == ("ground-x-1-y12", None, True)


def test_a_hotspot_keeps_its_id_while_it_moves_little_by_little() -> None:
    steps = [window(k, "." * k + "##" + "." * (8 - k)) for k in range(6)]
    history = of(*steps)
    (one,) = history.now.values()
    assert (one.spot_id, one.state, one.since) == ("ground-x-2-y10", "persisting", FIRST)


def test_two_metres_away_is_the_same_place_and_farther_is_new() -> None:
    near = of(window(0, "#......"), window(1, "..#...."))
    far = of(window(0, "#......"), window(1, "...#..."))
    assert [(i.spot_id, i.state) for i in near.now.values()] == [("ground-x-3-y10", "persisting")]
    assert [(i.spot_id, i.state) for i in far.now.values()] == [("ground-x0-y10", "new")]
    assert [one.spot_id for one in far.resolved] == ["ground-x-3-y10"]
    assert near.resolved == ()


def test_a_hotspot_that_comes_back_has_its_old_id_and_is_new() -> None:
    history = of(window(0, "##..."), window(1, "....."), window(2, "##..."))
    (one,) = history.now.values()
    assert (one.spot_id, one.state, one.since) == ("ground-x-2-y10", "new", FIRST + timedelta(days=14))
    assert history.resolved == ()


def test_resolved_is_reported_once() -> None:
    gone = [window(0, "##..."), window(1, ".....")]
    assert [one.spot_id for one in of(*gone).resolved] == ["ground-x-2-y10"]
    assert of(*gone, window(2, ".....")).resolved == ()


def test_where_two_grow_into_one_none_is_gone() -> None:
    history = of(window(0, "##...###"), window(1, "########"))
    (one,) = history.now.values()
    assert one.spot_id == "ground-x3-y10"
    assert history.resolved == ()


def test_a_hotspot_that_falls_in_two_is_no_news() -> None:
    history = of(window(0, "########"), window(1, "##...###"))
    assert {i.spot_id: (i.state, i.since) for i in history.now.values()} == {
        "ground-x1-y10": ("persisting", FIRST),
        "ground-x-2-y10": ("persisting", FIRST),
    }


def test_two_places_with_one_name_are_distinguished() -> None:
    # the second is where the first one was first seen, after that has wandered off
    steps = ["##........", ".##.......", "..##......", "...##.....", "....##....", ".....##...", "##...##..."]
    history = of(*(window(k, row) for k, row in enumerate(steps)))
    assert sorted(i.spot_id for i in history.now.values()) == ["ground-x-2-y10", "ground-x-2-y10-2"]


def test_a_hotspot_that_was_changed_is_watched_and_not_resolved() -> None:
    history = of(window(0, "##..."), window(1, "~~~.."), window(2, "~~~.."))
    assert (history.now, history.resolved) == ({}, ())
    assert [(one.spot_id, one.window) for one in history.watching] == [("ground-x-2-y10", 0)]


def test_a_watched_hotspot_that_is_gone_is_resolved_once() -> None:
    weeks = [window(0, "##..."), window(1, "~~~.."), window(2, ".....")]
    assert [(one.spot_id, one.window) for one in of(*weeks).resolved] == [("ground-x-2-y10", 0)]
    assert of(*weeks, window(3, ".....")).resolved == ()


def test_a_watched_hotspot_that_is_still_there_persists_under_its_name() -> None:
    (one,) = of(window(0, "##..."), window(1, "~~~.."), window(2, "##...")).now.values()
    assert (one.spot_id, one.state, one.since) == ("ground-x-2-y10", "persisting", FIRST)


def test_no_window_has_no_history() -> None:
    assert of() == History({}, ())


drawing = st.lists(st.text("#.", min_size=6, max_size=6), min_size=4, max_size=4)


@settings(max_examples=60, deadline=None)
@given(st.lists(drawing, min_size=1, max_size=5))
def test_every_hotspot_has_one_id_and_ids_are_never_shared(drawings: list[list[str]]) -> None:
    windows = [window(k, *rows) for k, rows in enumerate(drawings)]
    history = of(*windows)
    ids = [i.spot_id for i in history.now.values()]
    assert len(ids) == len(set(ids)) == len(windows[-1].result.spots)
    assert not {one.spot_id for one in history.resolved} & set(ids)
    assert history == of(*windows)


@settings(max_examples=30, deadline=None)
@given(drawing)
def test_the_same_picture_every_week_changes_nothing(rows: list[str]) -> None:
    first, third = of(window(0, *rows)), of(*(window(k, *rows) for k in range(3)))
    assert sorted(i.spot_id for i in first.now.values()) == sorted(i.spot_id for i in third.now.values())
    assert {i.state for i in third.now.values()} <= {"persisting"}
    assert third.resolved == ()
