"""The pure part of listening: when to store, when to fold, when to try again, which numbers are missing."""

from __future__ import annotations

from itertools import islice

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.live.batches import (
    APART_MIN,
    RANGES_MAX,
    RESTARTED,
    ClockAgreement,
    Numbering,
    delays_s,
    is_due,
    next_fold_s,
)


def due(n_held: int, *, age_s: float = 0.0, n_bytes: int = 0) -> bool:
    return is_due(n_held, n_bytes=n_bytes, age_s=age_s, window=1000, linger_s=1.0)


def test_nothing_held_is_never_due() -> None:
    assert not due(0, age_s=1e9, n_bytes=1 << 30)


def test_a_lonely_message_waits_for_others_but_not_for_ever() -> None:
    assert not due(1, age_s=0.9)
    assert due(1, age_s=1.0)


def test_half_a_window_is_stored_at_once_so_that_the_other_half_can_come_meanwhile() -> None:
    assert not due(499)
    assert due(500)


def test_large_messages_do_not_pile_up() -> None:
    assert due(2, n_bytes=16 << 20)


@given(st.integers(1, 2000), st.floats(0, 100))
def test_a_batch_never_waits_longer_than_it_lingers(window: int, age_s: float) -> None:
    assert is_due(1, n_bytes=1, age_s=age_s, window=window, linger_s=1.0) or age_s < 1.0


def test_folds_come_a_minute_after_the_hour() -> None:
    at = 1_763_640_000.0  # a full hour
    assert at % 3600 == 0
    assert next_fold_s(at, every_s=3600) == at + 60
    assert next_fold_s(at + 60, every_s=3600) == at + 3660
    assert next_fold_s(at + 59.9, every_s=3600) == at + 60


@given(st.floats(1e9, 2e9), st.floats(1, 86_400))
def test_the_next_fold_is_ahead_and_within_one_period(after_s: float, every_s: float) -> None:
    next_s = next_fold_s(after_s, every_s=every_s)
    assert after_s < next_s <= after_s + every_s * (1 + 1e-6)


@given(st.integers(0, 2**32))
def test_waiting_times_double_to_a_limit_and_never_lose_more_than_half_to_chance(seed: int) -> None:
    most = [0.5, 1, 2, 4, 8, 16, 30, 30, 30]
    found = list(islice(delays_s(seed=seed), len(most)))
    assert all(m / 2 <= f <= m for f, m in zip(found, most, strict=True))
    assert found == list(islice(delays_s(seed=seed), len(most)))


def test_different_listeners_do_not_knock_at_once() -> None:
    assert len({next(delays_s(seed=seed)) for seed in range(100)}) == 100


@given(
    st.integers(0, 10**6),
    st.lists(st.booleans(), min_size=2, max_size=300),
    st.randoms(use_true_random=False),
)
def test_missing_numbers_are_counted_whatever_the_order_and_however_often_they_come(
    first: int, arrives: list[bool], chance: object
) -> None:
    arrived = [first + i for i, comes in enumerate(arrives) if comes]
    if not arrived:
        return
    expected = arrived[-1] - arrived[0] + 1 - len(arrived)
    heard = arrived[:1] + arrived[1:] * 2  # the first stays first: what came before the start is nobody's gap
    tail = heard[1:]
    chance.shuffle(tail)  # type: ignore[attr-defined]
    numbering = Numbering()
    numbering.see_all([heard[0], None, *tail])
    assert numbering.n_missing == expected
    assert numbering.highest == arrived[-1]


def test_a_producer_that_starts_anew_is_no_gap() -> None:
    numbering = Numbering()
    numbering.see_all([RESTARTED * 5, RESTARTED * 5 + 1, 0, 1, 2, 4])
    assert (numbering.n_missing, numbering.highest) == (1, 4)


def test_a_hostile_numbering_takes_bounded_memory() -> None:
    numbering = Numbering()
    numbering.see_all(range(0, 20 * RANGES_MAX, 2))
    assert numbering.n_missing == 10 * RANGES_MAX - 1
    assert len(numbering._ranges) <= RANGES_MAX
    numbering.see(2**62)
    numbering.see_all(range(2**62 - 9000, 2**62, 2))
    assert len(numbering._ranges) <= RANGES_MAX


@pytest.mark.parametrize("every_s", [1, 5, 60, 300])
def test_short_periods_fold_in_time_too(every_s: float) -> None:
    at = next_fold_s(1000.0, every_s=every_s)
    assert 1000 < at <= 1000 + every_s


def test_clocks_disagree_after_so_many_messages_in_a_row_and_agree_again_after_one() -> None:
    agreement = ClockAgreement()
    agreement.see(n_within=0, n_outside=APART_MIN - 1)
    assert not agreement.is_lost
    agreement.see(n_within=1, n_outside=APART_MIN)
    assert not agreement.is_lost
    agreement.see(n_within=0, n_outside=APART_MIN)
    agreement.see(n_within=0, n_outside=0)
    assert agreement.is_lost
    agreement.see(n_within=1, n_outside=0)
    assert not agreement.is_lost
