"""Basins part at their valleys, and only there."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from vsd_analytics.stats.watershed import watershed

EIGHT = np.ones((3, 3))


def drawn(*rows: str) -> np.ndarray:
    """Return heights from digits; blanks are outside."""
    return np.array([[float(c) if c.strip() else 0.0 for c in row] for row in rows])


def labels(height: np.ndarray, share: float = 0.5) -> list[str]:
    found = watershed(height, height > 0, saddle_share=share)
    return ["".join(str(k) if k else " " for k in row) for row in found.tolist()]


def test_a_deep_valley_parts_two_peaks_and_a_shallow_one_does_not() -> None:
    assert labels(drawn("98768")) == ["11111"]
    assert labels(drawn("98428")) == ["11122"]
    # half the lower peak is still two, more is one
    assert labels(drawn("9838")) == ["1112"]
    assert labels(drawn("9848")) == ["1112"]
    assert labels(drawn("9858")) == ["1111"]


def test_what_does_not_touch_is_apart_and_corners_touch() -> None:
    assert labels(drawn("99 44")) == ["11 22"]
    assert labels(drawn("9  ", " 8 ", "  7")) == ["1  ", " 1 ", "  1"]


def test_small_bumps_beside_a_peak_are_part_of_it() -> None:
    assert labels(drawn("3293", "2222", "3232")) == ["1111", "1111", "1111"]


def test_a_third_peak_joins_the_basin_it_has_no_valley_to() -> None:
    assert labels(drawn("928789")) == ["112222"]


def test_a_low_peak_joins_the_basin_of_the_cell_that_links_it_not_another_that_the_cell_touches() -> None:
    # the 2 is in the basin of the right 9, and the valley to the left 9 is deep: the 3 does not go to the left
    assert labels(drawn("  3", "  2", "939")) == ["  1", "  1", "221"]
    # without the right 9, the 2 is in the basin of the left one
    assert labels(drawn("  3", "  2", "93 ")) == ["  1", "  1", "11 "]


heights = arrays(np.float64, (5, 6), elements=st.integers(0, 9).map(float))


@settings(max_examples=50)
@given(heights, st.sampled_from([0.0, 0.3, 0.5, 0.9, 1.0]))
def test_every_cell_is_in_one_connected_basin(height: np.ndarray, share: float) -> None:
    found = watershed(height, height > 0, saddle_share=share)
    np.testing.assert_array_equal(found > 0, height > 0)
    assert sorted(set(found[found > 0].tolist())) == list(range(1, found.max() + 1))
    for k in range(1, found.max() + 1):
        assert ndimage.label(found == k, structure=EIGHT)[1] == 1


@settings(max_examples=40)
@given(heights)
def test_without_valleys_basins_are_connected_components(height: np.ndarray) -> None:
    found = watershed(height, height > 0, saddle_share=0.0)
    np.testing.assert_array_equal(found, ndimage.label(height > 0, structure=EIGHT)[0])


@settings(max_examples=40)
@given(heights, st.sampled_from([0.3, 0.5, 0.9]), st.floats(0.01, 100))
def test_unit_of_height_changes_nothing_and_more_share_parts_no_less(
    height: np.ndarray, share: float, scale: float
) -> None:
    found = watershed(height, height > 0, saddle_share=share)
    np.testing.assert_array_equal(found, watershed(height * 2.0 ** round(scale), height > 0, saddle_share=share))
    assert watershed(height, height > 0, saddle_share=share / 2).max() <= found.max()
