"""Numbers come back from the text that carries them, quantiles from their polynomial."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planner.planted_shop import of_base_85
from scipy.stats import t

from vsd_analytics.planner.encode import LARGEST, packed, planes, sparse, varints
from vsd_analytics.planner.script import few_events, quantiles


def decoded(data: bytes) -> list[int]:
    found, value, shift = [], 0, 0
    for byte in data:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            found.append(value)
            value = shift = 0
    return found


@given(st.lists(st.integers(0, LARGEST)))
def test_numbers_come_back(numbers: list[int]) -> None:
    assert decoded(varints(np.array(numbers, dtype=np.int64))) == numbers


@pytest.mark.parametrize("number", [-1, LARGEST + 1])
def test_what_a_browser_cannot_hold_is_refused(number: int) -> None:
    with pytest.raises(ValueError, match="2\\^53"):
        varints([number])
    with pytest.raises(ValueError, match="2\\^53"):
        planes([number])


def test_rows_are_gaps_and_columns() -> None:
    parts = sparse(np.array([3, 4, 900]), np.array([7, 8, 9]))
    assert decoded(b"".join(parts)) == [3, 3, 1, 896, 7, 8, 9]


def test_equal_numbers_give_equal_text() -> None:
    text = packed([varints([1, 2, 300])])
    assert text == packed([varints([1, 2, 300])])
    assert not set(text) & set("<>&\"'")
    assert decoded(gzip.decompress(of_base_85(text))) == [1, 2, 300]


@given(st.lists(st.integers(0, LARGEST)))
def test_planes_hold_the_low_bytes_first(numbers: list[int]) -> None:
    found = planes(np.array(numbers, dtype=np.int64))
    n, k = len(numbers), found[0]
    assert len(found) == 1 + n * k
    rows = [found[1 + p * n : 1 + (p + 1) * n] for p in range(k)]
    assert [sum(row[i] << 8 * p for p, row in enumerate(rows)) for i in range(n)] == numbers
    assert k == max(((v.bit_length() + 7) // 8 for v in numbers), default=0)


def test_times_pack_smaller_in_planes() -> None:
    times = np.random.default_rng(3).gamma(2.0, 1500, 20_000).astype(np.int64)
    assert len(packed([planes(times)])) < 0.95 * len(packed([varints(times)]))


@pytest.mark.parametrize("confidence", [0.5, 0.8, 0.95, 0.975, 0.999])
def test_student_quantiles_are_right_for_any_degrees_of_freedom(confidence: float) -> None:
    q = quantiles(confidence)
    nodes, weights, values = (np.array(q[k]) for k in ("u", "w", "lnT"))
    for df in [*range(1, 61), 1.37, 2.5, 3.999, 5.01, 17.3]:
        gaps = 1 / df - nodes
        if np.abs(gaps).min() < 1e-13:
            continue
        parts = weights / gaps
        found = np.exp((parts * values).sum() / parts.sum())
        assert found == pytest.approx(t.ppf((1 + confidence) / 2, df), rel=1e-8)


def test_poisson_limits_are_garwood_s() -> None:
    limits = few_events(0.95)
    assert limits[0] == pytest.approx((0.0, 3.6889), abs=1e-4)
    assert limits[4] == pytest.approx((1.0899, 10.2416), abs=1e-4)
