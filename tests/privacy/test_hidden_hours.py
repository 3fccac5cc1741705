"""What is computed from hours of several weeks tells no hidden hour, and which hours may hide each other."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.answer import Reason
from vsd_analytics.figures.share.counts import Mask, rough
from vsd_analytics.figures.share.earlier import SharedWeek
from vsd_analytics.figures.share.hours import shared_slots
from vsd_analytics.figures.share.together import equal_parts
from vsd_analytics.figures.share.weeks import _is_too_little, _unseen_hours
from vsd_analytics.figures.slots import SLOTS, Slots

MONDAY, TUESDAY = date(2026, 11, 9), date(2026, 11, 10)
BELOW = 5
N_WEEKS = 6
HIDDEN = (9, 10, 33)
"""Slots that the report of the last week hides: two hours of Monday, one of Tuesday."""


def week_data(held: dict[int, Any], *, below: int = BELOW) -> Any:
    """Return what hides slots of weeks, by the number of weeks back."""
    nothing = hidden(())
    slots = np.arange(SLOTS)
    return SimpleNamespace(
        mask=Mask(below),
        hours=SimpleNamespace(weekday=slots // 24, hour=slots % 24),
        hidden_in=lambda monday: held.get((MONDAY - monday).days // 7, nothing),
    )


def hidden(hours: tuple[int, ...] = HIDDEN, why: Reason | None = None, *, untimed: tuple[int, ...] = ()) -> Any:
    held = SimpleNamespace(small=frozenset(hours), others=frozenset())
    return SimpleNamespace(hours=held, why_floor=why, untimed=frozenset(untimed), why_untimed=None)


def slots_of(n: np.ndarray, *, recorded_h: np.ndarray | None = None) -> Slots:
    shape = n.shape
    recorded = np.ones(shape) if recorded_h is None else recorded_h
    return Slots(
        MONDAY,
        tuple(f"cam-{c}" for c in range(shape[0])),
        np.ones(shape[1:]),
        np.ones(shape),
        recorded,
        np.ones(shape),
        np.ones(shape),
        n.astype(np.float64),
        0.5,
    )


def counts() -> np.ndarray:
    return np.random.default_rng(1).poisson(6, size=(2, N_WEEKS, SLOTS))


@given(st.integers(0, 60), st.integers(0, 60), st.integers(0, 1))
def test_hidden_hours_of_a_camera_with_the_same_sum_give_the_same_slots(first: int, second: int, camera: int) -> None:
    made = []
    for parts in ((first, second), (second, first), (0, first + second)):
        n = counts()
        n[camera, -1, HIDDEN[0]], n[camera, -1, HIDDEN[1]] = parts
        made.append(shared_slots(slots_of(n), week_data({0: hidden()})).n_violations)
    assert np.array_equal(made[0], made[1])
    assert np.array_equal(made[0], made[2])


def test_a_week_keeps_its_sums_and_its_other_hours() -> None:
    n = counts()
    shared = shared_slots(slots_of(n), week_data({0: hidden()}))
    others = np.delete(np.arange(SLOTS), HIDDEN)
    assert np.array_equal(shared.n_violations[:, :, others], n[:, :, others])
    assert np.array_equal(shared.n_violations.sum(axis=2), n.sum(axis=2))
    assert shared.hidden is not None
    assert np.flatnonzero(shared.hidden[-1]).tolist() == list(HIDDEN)
    assert not shared.counted_h[list(HIDDEN)].any(), "an hour that nobody may know is not judged"


def test_hidden_hours_whose_sum_no_report_tells_are_unknown_and_never_zero() -> None:
    recorded = np.ones((2, N_WEEKS, SLOTS))
    recorded[1, -1, 50] = 0.2  # in the timetable, and in no rate: the week's total is without it
    shared = shared_slots(slots_of(counts(), recorded_h=recorded), week_data({0: hidden()}))
    assert np.isnan(shared.n_violations[:, -1, list(HIDDEN)]).all()
    assert not (shared.violations.x_h[-1, list(HIDDEN)] > 0).any()


@pytest.mark.parametrize("missed", [0, 1])
def test_time_of_few_people_is_unknown_where_a_camera_missed_one_of_their_hours(missed: int) -> None:
    recorded = np.ones((2, N_WEEKS, SLOTS))
    recorded[1, -1, HIDDEN[missed]] = 0.0
    for recorded_h, is_given in ((None, True), (recorded, False)):
        shared = shared_slots(slots_of(counts(), recorded_h=recorded_h), week_data({0: hidden((), untimed=HIDDEN)}))
        assert (shared.people.x_h[-1, list(HIDDEN)] > 0).all() == is_given
        assert (np.delete(shared.people.x_h[-1], HIDDEN) > 0).all()


def test_a_week_whose_floor_is_hidden_is_not_recorded_and_is_no_engine_without_ids() -> None:
    every = {k: hidden((), Reason("hidden.few", least=BELOW)) for k in range(N_WEEKS)}
    shared = shared_slots(slots_of(counts()), week_data(every))
    assert not shared.violations.x_h.any()
    assert shared.why_no_violations is None
    assert (shared.people.x_h > 0).all(), "people are not hidden"


def test_the_operator_s_slots_are_exact() -> None:
    slots = slots_of(counts())
    assert shared_slots(slots, week_data({0: hidden()}, below=0)) is slots


@given(st.integers(0, 1000), st.integers(1, 50))
def test_equal_parts_sum_up_and_differ_by_one_at_most(total: int, n: int) -> None:
    parts = equal_parts(total, n)
    assert (parts.sum(), len(parts)) == (total, n)
    assert parts.max() - parts.min() <= 1


@given(st.lists(st.integers(0, 40), min_size=4, max_size=4), st.integers(0, 3), st.integers(0, 3))
def test_one_more_in_one_hour_and_one_less_in_another_leaves_the_rough_days_as_they_were(
    n: list[int], more: int, less: int
) -> None:
    """Rule 9: two hours hide each other only if the cards of their days would be the same either way."""
    day = {0: MONDAY, 1: MONDAY, 2: TUESDAY, 3: TUESDAY}
    is_unseen = _unseen_hours(dict(enumerate(n)), day, [], BELOW)

    def cards(counted: list[int]) -> list[int | None]:
        return [rough(sum(counted[i] for i in day if day[i] == of), below=BELOW) for of in (MONDAY, TUESDAY)]

    changed = [c + (i == more) - (i == less) for i, c in enumerate(n)]
    assert is_unseen(more, less) == (day[more] == day[less] or cards(changed) == cards(n))


def test_hours_on_both_sides_of_a_day_after_which_a_page_left_hide_nothing() -> None:
    n, day = {0: 3, 1: 8, 2: 12, 3: 9}, {0: MONDAY, 1: MONDAY, 2: TUESDAY, 3: TUESDAY}
    asked = [(0, 2), (0, 1), (2, 3)]
    assert [_unseen_hours(n, day, [MONDAY], BELOW)(*pair) for pair in asked] == [False, True, True]
    assert _unseen_hours(n, day, [], BELOW)(0, 2), "11 and 21 are 10 and 20, as are 12 and 20"


@pytest.mark.parametrize("weeks_back", [0, 3])
def test_a_forecast_tells_no_more_than_the_slots(weeks_back: int) -> None:
    """The only use of hours in M13, M14, M24 and M25 is through `as_known`: equal slots are equal figures."""
    data = week_data({weeks_back: hidden()})
    one, other = counts(), counts()
    at = N_WEEKS - 1 - weeks_back
    one[0, at, HIDDEN[0]], one[0, at, HIDDEN[1]] = 3, 9
    other[0, at, HIDDEN[0]], other[0, at, HIDDEN[1]] = 4, 8
    first, second = (shared_slots(slots_of(n), data) for n in (one, other))
    assert np.array_equal(first.violations.n, second.violations.n)
    assert np.array_equal(first.violations.x_h, second.violations.x_h)
    exact = [replace(slots_of(n)).violations.n for n in (one, other)]
    assert not np.array_equal(*exact), "else the test would see nothing"


@pytest.mark.parametrize(
    ("now", "is_too_little"),
    [((20, 30), False), ((44, 29), True), ((44, 30), False), ((21, 30), True), ((25, 25), False), ((24, 26), True)],
)
def test_a_week_in_which_one_camera_changed_by_few_does_not_leave_again(
    now: tuple[int, int], is_too_little: bool
) -> None:
    """A late day of one camera does not hide a violation that was erased at the other: rates tell both sums."""

    def week(n: tuple[int, int]) -> SharedWeek:
        hours = {"0": {"cam-1": n[0], "cam-2": n[1]}}
        nothing: frozenset[str] = frozenset()
        return SharedWeek("ground", MONDAY, MONDAY, 1000, 50, {}, hours, nothing, nothing)

    assert _is_too_little(week(now), week((20, 30)), BELOW) == is_too_little
