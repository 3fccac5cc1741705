"""What measures a camera: whole bodies, links between frames, stretches of walks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from engine.simulated_people import SIZE, Scene, SimulatedCamera, boxes_only, simulate

from vsd_analytics.engine.people import N_JOINTS, People
from vsd_analytics.engine.sightings import (
    BOX,
    JOINTS,
    PARTS_OF_TRACK,
    n_at_once,
    n_persons,
    sightings,
    steps,
    thinned,
    tracklets,
)


@cache
def walk() -> Scene:
    """Return fifteen people who walk for twenty seconds, simulated when a test first asks."""
    return simulate(SimulatedCamera(height_m=5, tilt_deg=25, f_widths=0.8), seed=4, n_tracks=15, seconds=20, hz=5)


def boxes(rows: list[tuple[float, float, float, float]]) -> People:
    n = len(rows)
    frame = np.arange(n, dtype=np.int64)
    return People(frame, np.full(n, "a", dtype=object), np.array(rows), np.full((n, N_JOINTS, 2), np.nan), frame)


def test_boxes_that_the_edge_cuts_off_do_not_measure() -> None:
    cut = [(2, 300, 60, 500), (300, 1, 400, 300), (1850, 300, 1918, 500), (300, 700, 400, 1079)]
    seen = sightings(boxes([*cut, (300, 300, 400, 600)]), size_px=SIZE)
    assert (len(seen.low), seen.body) == (1, BOX)
    assert (seen.low[0].tolist(), seen.high[0].tolist()) == ([350, 600], [350, 300])


def test_joints_measure_where_there_are_any() -> None:
    seen = sightings(walk().people, size_px=SIZE)
    assert (seen.body, seen.has_lean) == (JOINTS, True)
    assert sightings(boxes_only(walk()), size_px=SIZE).body == BOX


def test_nine_rows_of_ten_are_linked_to_the_same_person_where_people_cross() -> None:
    people = boxes_only(walk())
    seen = sightings(people, size_px=SIZE)
    linked = tracklets(seen.low, seen.length_px, seen.frame)
    owners = [np.bincount(seen.who[linked == part]) for part in range(linked.max() + 1)]
    assert sum(count.max() for count in owners) / len(linked) > 0.9
    assert len(owners) < len(linked) / 10


def test_body_of_another_length_is_not_linked() -> None:
    uv, frame = np.array([[100.0, 500.0], [102.0, 500.0]]), np.array([0, 1])
    assert len(set(tracklets(uv, np.array([200.0, 205.0]), frame))) == 1
    assert len(set(tracklets(uv, np.array([200.0, 120.0]), frame))) == 2


def test_long_tracks_become_medians_of_their_parts_and_short_ones_stay_whole() -> None:
    seen = sightings(walk().people, size_px=SIZE)
    few = seen.rows(np.flatnonzero((seen.frame < 20) | (seen.who < 3)))
    size, some = np.bincount(few.who), thinned(few)
    left = np.bincount(some.who)
    np.testing.assert_array_equal(left, np.minimum(size, PARTS_OF_TRACK))
    for who in (
        np.flatnonzero(size >= 3 * PARTS_OF_TRACK)[0],
        np.flatnonzero((size > 0) & (size <= PARTS_OF_TRACK))[0],
    ):
        marks = few.low[few.who == who]
        parts = np.array_split(np.arange(len(marks)), left[who])
        lengths = {len(part) for part in parts}
        assert len(lengths) <= 2
        if lengths == {1}:
            np.testing.assert_array_equal(some.low[some.who == who], marks)
        else:
            one = few.rows(np.flatnonzero(few.who == who))
            thrown = replace(one, low=one.low + np.where(np.arange(len(marks)) % 5 == 2, 80.0, 0.0)[:, None])
            assert np.abs(thinned(thrown).low - thinned(one).low).max() < 40  # one wild box in five hardly counts


def test_stretches_are_of_one_person_of_equal_time_and_do_not_overlap() -> None:
    seen = sightings(walk().people, size_px=SIZE)
    walks = steps(seen, n_frames=5)
    assert len(walks.begin) > 50
    assert (seen.who[walks.begin] == seen.who[walks.end]).all()
    assert (seen.frame[walks.end] - seen.frame[walks.begin] == 5).all()
    for who in np.unique(walks.who):
        begin = np.sort(seen.frame[walks.begin[walks.who == who]])
        assert (np.diff(begin) >= 5).all()


def test_pieces_of_a_broken_track_are_one_person_and_people_at_once_are_many() -> None:
    """Three people of whom a tracker lost one every ten frames: 3 persons, and not 12."""
    rows, frames, ids = [], [], []
    for frame in range(100):
        for person, left in enumerate((300, 700, 1100)):
            rows.append((left + 2 * frame, 300, left + 60 + 2 * frame, 500))
            frames.append(frame)
            ids.append(f"{person}-{frame // 10 if person == 0 else 0}")
    track = np.array(ids, dtype=object)
    joints = np.full((300, N_JOINTS, 2), np.nan)
    seen = sightings(People(np.array(frames), track, np.array(rows, float), joints, np.arange(100)), size_px=SIZE)
    assert len(np.unique(seen.who)) == 12
    assert (n_persons(seen), n_at_once(seen)) == (3, 3)


def test_people_with_true_ids_are_as_many_as_their_ids() -> None:
    seen = sightings(boxes_only(walk()), size_px=SIZE)
    assert n_persons(seen) == len(np.unique(seen.who))
