"""The search for links: one frame's sightings go back to the walks they are of, and chance is repeatable."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.engine.floor_sightings import FloorSightings
from vsd_analytics.engine.link_search import LinkSearch
from vsd_analytics.engine.links import NO_LINK, links_after, reversed_links, track_numbers
from vsd_analytics.engine.people import Array
from vsd_analytics.engine.tracker import follow

Rows = np.ndarray[tuple[int], np.dtype[np.intp]]


def sightings(xy: Array, frame: Rows) -> FloorSightings:
    """Return sightings at one frame a second, away from any border."""
    covariance = np.tile(np.eye(2) * 0.04, (len(xy), 1, 1))
    return FloorSightings.of(xy, covariance, frame, np.arange(frame.max() + 1.0), np.full((len(xy), 4), np.inf))


def people_who_meet() -> tuple[Array, Rows, Rows]:
    """Return places and frames of two people who walk towards each other, and the links of both."""
    t = np.arange(7.0)
    right, left = np.column_stack([1.2 * t - 3.6, 0 * t]), np.column_stack([3.6 - 1.2 * t, 0 * t + 0.3])
    before = np.arange(14) - 2
    before[:2] = NO_LINK
    return np.stack([right, left], axis=1).reshape(-1, 2), np.repeat(np.arange(7), 2), before


def found(seen: FloorSightings, before: Rows, *, exchanges: bool) -> Rows:
    return LinkSearch(seen, before, seen.futures(before), exchanges=exchanges).found()


def test_two_people_who_changed_places_for_one_frame_change_back() -> None:
    xy, frame, true = people_who_meet()
    xy[[6, 7], 0] = (-0.3, 0.3)  # one a little late, the other, too: neither half of the exchange brings anything
    seen = sightings(xy, frame)
    mixed = true.copy()
    mixed[[6, 7, 8, 9]] = (5, 4, 7, 6)
    assert found(seen, mixed, exchanges=True).tolist() == true.tolist()
    assert found(seen, mixed, exchanges=False).tolist() != true.tolist()


def test_sighting_that_nobody_had_goes_to_the_walk_that_missed_it() -> None:
    xy, frame, true = people_who_meet()
    missed = true.copy()
    missed[6], missed[8] = NO_LINK, 4
    assert found(sightings(xy, frame), missed, exchanges=True).tolist() == true.tolist()


def test_sighting_off_the_walk_is_left_alone_and_the_walk_goes_on_without_it() -> None:
    xy, frame, before = people_who_meet()
    xy[6] = (0.0, 3.0)
    after = found(sightings(xy, frame), before, exchanges=True)
    assert after[6] == NO_LINK
    assert after[8] == 4
    assert 6 not in after


def test_noise_leads_away_from_the_links_and_the_same_noise_to_the_same_ones() -> None:
    xy, frame, true = people_who_meet()
    seen = sightings(xy, frame)

    def by_chance(seed: int) -> list[int]:
        search = LinkSearch(seen, true, seen.futures(true), exchanges=True, noise=20.0, rng=np.random.default_rng(seed))
        return search.found().tolist()

    assert by_chance(1) == by_chance(1)
    assert by_chance(1) != true.tolist()
    assert by_chance(1) != by_chance(2)


def test_links_by_chance_are_links() -> None:
    rng = np.random.default_rng(7)
    frame = np.sort(rng.integers(0, 12, 80))
    seen = sightings(rng.normal(0, 1.5, (80, 2)), frame)
    before = np.full(80, NO_LINK)
    for _ in range(20):
        before = LinkSearch(seen, before, seen.futures(before), exchanges=True, noise=6.0, rng=rng).found()
        linked = np.flatnonzero(before != NO_LINK)
        assert len(np.unique(before[linked])) == len(linked)
        assert np.all(frame[before[linked]] < frame[linked])
        assert np.all(frame[linked] - frame[before[linked]] <= 2)


def test_links_reversed_twice_are_the_same() -> None:
    before = np.array([NO_LINK, NO_LINK, 0, 1, 3])
    assert reversed_links(reversed_links(before)).tolist() == before.tolist()
    assert links_after(before).tolist() == [2, 3, NO_LINK, 4, NO_LINK]
    assert track_numbers(before).tolist() == [1, 2, 1, 2, 2]


@pytest.mark.parametrize("n_people", [0, 1])
def test_recordings_with_nobody_or_one_person(n_people: int) -> None:
    xy = np.zeros((n_people, 2))
    number = follow(xy, np.tile(np.eye(2), (n_people, 1, 1)), np.zeros(n_people, dtype=np.intp), np.arange(3.0))
    assert number.tolist() == list(range(1, n_people + 1))
