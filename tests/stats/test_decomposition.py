"""Crowding, layout, behaviour: each is what its name says, against people who are placed one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.stats.decomposition import additive_parts, closeness, compare_mixing, concentration, mixing, nearby
from vsd_analytics.wording.reasons import reason_text

CELL_M, DISTANCE_M = 0.25, 2.0
FLOOR_M = (12.0, 8.0)


def crowd(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return n places, shape (n, 2): half of them round a counter, the others anywhere."""
    anywhere = rng.uniform((0, 0), FLOOR_M, (n, 2))
    counter = np.clip(rng.normal((3, 3), 0.8, (n, 2)), 0, np.array(FLOOR_M) - 1e-9)
    return np.where(rng.random(n)[:, None] < 0.5, counter, anywhere)


def map_of(places: np.ndarray) -> np.ndarray:
    cells = np.floor(places / CELL_M).astype(int)
    made = np.zeros((round(FLOOR_M[1] / CELL_M), round(FLOOR_M[0] / CELL_M)))
    np.add.at(made, (cells[:, 1], cells[:, 0]), 1.0)
    return made


def days(
    rng: np.random.Generator, n_people: float, *, n_days: int = 7, frames: int = 700, pairs: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return close and co-present pair-hours by day and the map, of people placed independently in every frame.

    Args:
        rng: Numbers.
        n_people: Mean number of people of a frame.
        n_days: Days.
        frames: Frames of a day, one a second.
        pairs: Share of people who bring a companion, at one metre.
    """
    close, together, exposure = np.zeros(n_days), np.zeros(n_days), 0.0
    for day in range(n_days):
        for _ in range(frames):
            places = crowd(rng, rng.poisson(n_people))
            if pairs:
                beside = places[rng.random(len(places)) < pairs] + (1.0, 0.0)
                places = np.concatenate([places, np.minimum(beside, np.array(FLOOR_M) - 1e-9)])
            apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
            n = len(places)
            close[day] += (np.count_nonzero(apart < DISTANCE_M) - n) / 2
            together[day] += n * (n - 1) / 2
            exposure = exposure + map_of(places)
    return close[None] / 3600, together[None] / 3600, np.asarray(exposure) / 3600


@given(
    cell_m=st.sampled_from([0.25, 0.5, 1.0]),
    distance_m=st.floats(0.3, 3.0),
    i=st.integers(-8, 8),
    j=st.integers(-8, 8),
    seed=st.integers(0, 99),
)
@settings(max_examples=40, deadline=None)
def test_closeness_is_the_share_of_points_that_are_close(
    cell_m: float, distance_m: float, i: int, j: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, 40_000, 2))
    apart = np.hypot(*((b + np.array([j, i]) - a) * cell_m).T)
    found = closeness(cell_m=cell_m, distance_m=distance_m)
    k = len(found) // 2
    told = found[k + i, k + j] if max(abs(i), abs(j)) <= k else 0.0
    assert told == pytest.approx(np.mean(apart < distance_m), abs=0.012)


def test_closeness_is_even_and_its_sum_the_disc() -> None:
    found = closeness(cell_m=CELL_M, distance_m=DISTANCE_M)
    assert found == pytest.approx(found.T)
    assert found == pytest.approx(found[::-1, ::-1])
    assert found.sum() * CELL_M**2 == pytest.approx(math.pi * DISTANCE_M**2, rel=1e-4)
    assert found.max() == 1.0
    assert found[0].max() == 0.0


@pytest.mark.parametrize("shape", [(1, 1), (3, 40), (31, 17)])
def test_what_is_nearby_equals_the_plain_sum_and_ends_at_the_edge(shape: tuple[int, int]) -> None:
    maps = np.random.default_rng(5).random((2, *shape))
    kernel = np.random.default_rng(6).random((5, 7))
    expected = np.zeros(maps.shape)
    for i in range(-2, 3):
        for j in range(-3, 4):
            for row in range(max(0, i), min(shape[0], shape[0] + i)):
                for column in range(max(0, j), min(shape[1], shape[1] + j)):
                    expected[:, row, column] += kernel[2 + i, 3 + j] * maps[:, row - i, column - j]
    assert nearby(maps, kernel) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_nothing_nearby_is_never_below_nothing() -> None:
    one = np.zeros((1, 50, 50))
    one[0, 0, 0] = 1e6
    assert (nearby(one, closeness(cell_m=0.5, distance_m=2.0)) >= 0).all()


def test_layout_equals_placing_pairs_one_by_one() -> None:
    rng = np.random.default_rng(1)
    made = map_of(crowd(rng, 400_000))
    one, other = crowd(rng, 400_000), crowd(rng, 400_000)
    direct = np.mean(np.hypot(*(one - other).T) < DISTANCE_M)
    assert concentration(made, cell_m=CELL_M, distance_m=DISTANCE_M) == pytest.approx(direct, rel=0.01)


def test_layout_equals_the_plain_double_sum() -> None:
    rng = np.random.default_rng(2)
    made = rng.random((5, 9)) * (rng.random((5, 9)) < 0.6)
    near = closeness(cell_m=0.5, distance_m=1.3)
    k = len(near) // 2
    p = made / made.sum()
    cells = [(r, c) for r in range(5) for c in range(9)]
    hand = sum(
        p[a] * p[b] * near[k + b[0] - a[0], k + b[1] - a[1]]
        for a in cells
        for b in cells
        if max(abs(b[0] - a[0]), abs(b[1] - a[1])) <= k
    )
    assert concentration(made, cell_m=0.5, distance_m=1.3) == pytest.approx(hand)


def test_independent_people_behave_as_by_chance() -> None:
    close, together, made = days(np.random.default_rng(3), 6)
    found = mixing(close, together, [made], cell_m=CELL_M, distance_m=DISTANCE_M, min_person_h=1)
    assert found.state == "ok"
    assert found.behaviour == pytest.approx(1.0, abs=0.04)
    assert found.layout is not None
    assert found.layout_uniform is not None
    assert found.layout > 1.3 * found.layout_uniform, "half the people stand round the counter"
    assert found.close_h == pytest.approx(found.copresent_h * found.layout * (found.behaviour or 0))


def test_doubling_people_moves_crowding_alone() -> None:
    few, many = (days(np.random.default_rng(4 + k), n) for k, n in enumerate((4, 8)))
    found = compare_mixing(
        (few[0], many[0]), (few[1], many[1]), ([few[2]], [many[2]]),
        cell_m=CELL_M, distance_m=DISTANCE_M, min_person_h=1,
    )  # fmt: skip
    assert found.state == "ok"
    assert found.crowding == pytest.approx(4.0, rel=0.05)
    assert found.layout == pytest.approx(1.0, abs=0.02)
    assert found.behaviour is not None
    assert found.behaviour.value == pytest.approx(1.0, abs=0.05)
    assert found.behaviour.verdict == "cannot_tell", "one week without history says little of how weeks differ"
    assert found.crowding_share == pytest.approx(1.0, abs=0.03)
    shares = (found.crowding_share, found.layout_share, found.behaviour_share)
    assert sum(s or 0.0 for s in shares) == pytest.approx(1.0)


def test_companions_are_behaviour() -> None:
    alone, paired = (days(np.random.default_rng(6 + k), 3, pairs=share) for k, share in enumerate((0.0, 0.9)))
    found = compare_mixing(
        (alone[0], paired[0]), (alone[1], paired[1]), ([alone[2]], [paired[2]]),
        cell_m=CELL_M, distance_m=DISTANCE_M, min_person_h=1,
    )  # fmt: skip
    assert found.behaviour is not None
    assert found.behaviour.verdict == "clear_rise"
    assert found.layout == pytest.approx(1.0, abs=0.05)
    logs = [math.log(v or 0) for v in (found.crowding, found.layout, found.behaviour.value)]
    assert sum(logs) == pytest.approx(math.log(found.close or 0))


def test_cameras_are_rooms_of_their_own() -> None:
    a, b = (days(np.random.default_rng(8 + k), n) for k, n in enumerate((4, 7)))
    options = {"cell_m": CELL_M, "distance_m": DISTANCE_M, "min_person_h": 1}
    both = mixing(np.vstack([a[0], b[0]]), np.vstack([a[1], b[1]]), [a[2], b[2]], **options)
    alone = [mixing(x[0], x[1], [x[2]], **options) for x in (a, b)]
    expected = sum(m.copresent_h * (m.layout or 0) for m in alone)
    assert both.behaviour == pytest.approx(sum(m.close_h for m in alone) / expected)
    assert both.layout == pytest.approx(expected / both.copresent_h)


@pytest.mark.parametrize(
    ("close", "together", "person_h", "word"),
    [
        (1.0, 5.0, 3.0, "person-hours, has 3.0"),
        (0.0, 0.0, 50.0, "no two people were ever present"),
        (0.0, 5.0, 50.0, "no two people were ever close"),
    ],
)
def test_what_cannot_be_known_says_why(close: float, together: float, person_h: float, word: str) -> None:
    found = mixing(
        np.full((1, 7), close), np.full((1, 7), together), [np.full((4, 4), person_h / 16)],
        cell_m=CELL_M, distance_m=DISTANCE_M,
    )  # fmt: skip
    assert found.state == "not_enough_data"
    assert found.reason is not None
    assert word in reason_text(found.reason)
    assert found.lo is None


def test_few_days_give_behaviour_without_an_interval() -> None:
    found = mixing(np.ones((1, 4)), np.full((1, 4), 5.0), [np.full((4, 4), 9.0)], cell_m=1.0, distance_m=DISTANCE_M)
    assert found.behaviour is not None
    assert (found.lo, found.state) == (None, "not_enough_data")


def test_what_cannot_be_pair_time_is_refused() -> None:
    with pytest.raises(ValueError, match="not negative"):
        mixing([[-1.0]], [[1.0]], [[[1.0]]], cell_m=1, distance_m=1)
    with pytest.raises(ValueError, match="one shape"):
        mixing([[1.0]], [[1.0, 2.0]], [[[1.0]]], cell_m=1, distance_m=1)
    with pytest.raises(ValueError, match="some positive"):
        concentration([[0.0]], cell_m=1, distance_m=1)


@given(st.lists(st.floats(0.05, 20), min_size=1, max_size=5))
def test_parts_of_a_change_add_up_to_it_exactly(factors: list[float]) -> None:
    parts = additive_parts(factors)
    assert math.fsum(parts) == pytest.approx(math.prod(factors) - 1, rel=1e-9, abs=1e-12)
    assert all((part >= 0) == (factor >= 1) or part == 0 for part, factor in zip(parts, factors, strict=True))


def test_parts_are_the_integral_of_each_factors_growth_along_a_steady_path() -> None:
    """Oracle: let all factors grow at constant rates from 1; factor k adds the integral of V d ln f_k."""
    factors = (0.5, 1.2, 0.9)
    at = np.linspace(0, 1, 200_001)
    whole = np.prod(factors) ** at
    expected = [np.trapezoid(whole * math.log(f), at) for f in factors]
    assert additive_parts(factors) == pytest.approx(expected, abs=1e-9)


def test_parts_that_move_against_each_other_have_no_shares_that_exceed_the_whole() -> None:
    """Twice the people who keep apart: crowding adds 300 points, behaviour takes most of them away again."""
    exposure = [np.ones((20, 20))]
    days = np.ones((1, 7))
    found = compare_mixing((days, days * 1.2), (days * 20, days * 80), (exposure, exposure), cell_m=0.5, distance_m=2.0)
    assert found.close == pytest.approx(1.2)
    assert found.crowding_part == pytest.approx(0.2 / math.log(1.2) * math.log(4))
    assert found.behaviour_part == pytest.approx(0.2 - found.crowding_part)
    assert found.layout_part == pytest.approx(0)
    assert (found.crowding_share, found.layout_share, found.behaviour_share) == (None, None, None)


def test_a_factor_of_nothing_has_no_part() -> None:
    with pytest.raises(ValueError, match="above 0"):
        additive_parts([0.0, 2.0])
