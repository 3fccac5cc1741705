"""Small counts are never given, sums are not lost, and what is large enough stays as it is."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.merged import merge_small_counts

BELOW = 5
LISTS = st.lists(st.tuples(st.integers(0, 12), st.booleans(), st.booleans()), min_size=1, max_size=60)


def arranged(rows: list[tuple[int, bool, bool]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    counts = np.array([r[0] for r in rows])
    place = np.cumsum([r[2] for r in rows])
    day = np.cumsum([r[1] or r[2] for r in rows])
    return counts, day, place


@given(LISTS)
def test_no_count_given_is_small_and_none_is_lost(rows: list[tuple[int, bool, bool]]) -> None:
    counts, day, place = arranged(rows)
    found = merge_small_counts(np.stack([counts, 10 * counts]), groups=(day, place), mask=Mask(BELOW))
    lead = found.values[0]
    assert not ((lead > 0) & (lead < BELOW)).any()
    assert lead.sum() + found.n_dropped[0] == counts.sum()
    assert found.n_dropped[0] == (counts.sum() if counts.sum() < BELOW else 0)
    np.testing.assert_array_equal(found.values[1], 10 * lead)


@given(LISTS)
def test_what_is_large_enough_is_never_less(rows: list[tuple[int, bool, bool]]) -> None:
    counts, day, place = arranged(rows)
    lead = merge_small_counts(counts[None], groups=(day, place), mask=Mask(BELOW)).values[0]
    large = counts >= BELOW
    assert (lead[large] >= counts[large]).all()


@given(LISTS)
def test_sums_are_exact_where_no_day_or_place_is_small(rows: list[tuple[int, bool, bool]]) -> None:
    counts, day, place = arranged(rows)
    lead = merge_small_counts(counts[None], groups=(day, place), mask=Mask(BELOW)).values[0]
    for group in (day, place):
        true, told = np.bincount(group, weights=counts), np.bincount(group, weights=lead)
        if not ((true > 0) & (true < BELOW)).any():
            np.testing.assert_array_equal(told, true)
        # a sum given at its middle one, what waited at the end of a day, and of a place: each is under BELOW
        assert (np.abs(np.cumsum(told) - np.cumsum(true)) < 3 * BELOW).all()


def test_ones_are_given_at_the_middle_one_of_five() -> None:
    day = np.zeros(12, dtype=np.int64)
    lead = merge_small_counts(np.ones((1, 12), dtype=np.int64), groups=(day,), mask=Mask(BELOW)).values[0]
    assert lead.tolist() == [0, 0, 5, 0, 0, 0, 0, 7, 0, 0, 0, 0]


def test_a_day_with_too_few_waits_for_the_next() -> None:
    lead = merge_small_counts(
        np.array([[1, 2, 4, 9]]), groups=(np.array([0, 0, 1, 1]), np.zeros(4)), mask=Mask(BELOW)
    ).values[0]
    assert lead.sum() == 16
    assert lead[:2].sum() in (0, 7)


def test_nothing_is_small_where_nothing_is_masked() -> None:
    counts = np.array([[1, 2, 0, 4]])
    for below in (0, 1):
        np.testing.assert_array_equal(
            merge_small_counts(counts, groups=(np.zeros(4),), mask=Mask(below)).values, counts
        )
