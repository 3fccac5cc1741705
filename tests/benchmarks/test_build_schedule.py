"""The simulated schedule of a distributed build is that of known schedules, and within the bounds of all."""

from __future__ import annotations

from math import inf

import pytest
from build_schedule import Engine, Machines, Phase, largest_first, simulate
from hypothesis import given
from hypothesis import strategies as st

ONE_BY_ONE, FREE = Engine(ahead=2), Machines()
UNITS = st.lists(st.floats(0.01, 100), min_size=1, max_size=60)


def makespan_s(units_s: list[float], n_workers: int, engine: Engine = ONE_BY_ONE, machines: Machines = FREE) -> float:
    return simulate([Phase(0.0, units_s)], n_workers=n_workers, engine=engine, machines=machines).makespan_s


@given(UNITS, st.integers(1, 20))
def test_a_build_takes_at_least_its_longest_unit_and_its_share_and_at_most_twice_that(
    units_s: list[float], n: int
) -> None:
    least = max(*units_s, sum(units_s) / n)
    assert least * (1 - 1e-9) <= makespan_s(units_s, n) <= (2 - 1 / n) * least * (1 + 1e-9)


@given(UNITS, st.integers(1, 20), st.integers(1, 3), st.floats(0, 1))
def test_the_driver_and_series_only_add_to_a_build(
    units_s: list[float], n: int, n_series: int, publish_s: float
) -> None:
    how = Engine(4, n_series, start_s=0.5, driver_start_s=0.25)
    done = simulate([Phase(1.0, units_s, publish_s)], n_workers=n, engine=how, after_s=2.0)
    least = max(sum(units_s) / n, *units_s, publish_s * len(units_s))
    serial = done.driver_s + done.units_s + 0.5 * n
    assert 3.25 + least <= done.makespan_s * (1 + 1e-9)
    assert done.makespan_s <= serial * (1 + 1e-9)
    assert done.most_waiting <= 4 * n


@given(UNITS, st.integers(1, 20), st.integers(1, 8), st.floats(0, 4))
def test_shared_cores_do_no_more_than_they_can(units_s: list[float], n: int, cores: int, others: float) -> None:
    shared = makespan_s(units_s, n, machines=Machines(cores=cores, others=others))
    assert shared >= sum(units_s) / cores * (1 - 1e-9)
    assert shared >= makespan_s(units_s, n) * (1 - 1e-9)


def test_graham_s_worst_case_of_the_longest_first() -> None:
    units_s = [5.0, 5, 4, 4, 3, 3, 3]  # three workers: the best schedule takes 9
    assert makespan_s(units_s, 3) == 11
    assert simulate([largest_first(Phase(0.0, units_s[::-1]))], n_workers=3, engine=ONE_BY_ONE).makespan_s == 11


def test_a_long_unit_at_the_end_makes_a_build_wait_for_it() -> None:
    assert makespan_s([1.0] * 4 + [4.0], 2) == 6
    assert simulate([largest_first(Phase(0.0, [1.0] * 4 + [4.0]))], n_workers=2, engine=ONE_BY_ONE).makespan_s == 4


def test_series_make_workers_wait_for_the_longest_unit_of_each() -> None:
    units_s = [1.0, 3.0, 3.0, 1.0]
    assert makespan_s(units_s, 2, Engine(ahead=1, n_series=1)) == 6
    assert makespan_s(units_s, 2, Engine(ahead=1)) == 4
    assert makespan_s(units_s, 2, Engine(ahead=2, n_series=2)) == 4  # the second series begins beside the first


def test_a_driver_that_publishes_slowly_bounds_the_build() -> None:
    done = simulate([Phase(0.0, [1.0] * 100, 0.5)], n_workers=64, engine=ONE_BY_ONE)
    assert done.makespan_s == pytest.approx(1 + 50)
    assert done.driver_share == pytest.approx(50 / 51)


@pytest.mark.parametrize(("n_workers", "expected"), [(1, 8.0), (2, 4.4), (4, 4.4)])
def test_four_workers_on_two_cores_take_as_long_as_two(n_workers: int, expected: float) -> None:
    machines = Machines(cores=2, slowdown=1.1)
    assert makespan_s([1.0] * 8, n_workers, machines=machines) == pytest.approx(expected)


def test_workers_start_once_and_phases_follow_one_another() -> None:
    phases = [Phase(1.0, [1.0, 1.0]), Phase(0.5, [2.0, 2.0])]
    done = simulate(phases, n_workers=2, engine=Engine(2, start_s=0.25), machines=Machines(cores=inf), after_s=1.0)
    assert done.makespan_s == pytest.approx(1 + 1.25 + 0.5 + 2 + 1)
    assert done.driver_s == pytest.approx(2.5)
    assert done.efficiency == pytest.approx(6 / (2 * 5.75))
