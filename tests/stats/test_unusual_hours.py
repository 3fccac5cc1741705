"""Unusual hours: a planted one is found, a quiet week stays quiet, missing is never unusual."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date

import numpy as np
import prove_forecast as prove
import pytest
from scipy import stats

from vsd_analytics.stats import negative_binomial, unusual
from vsd_analytics.stats.unusual import Unusual, unusual_hours
from vsd_analytics.wording.reasons import reason_text

SLOTS = 168
ONES = np.ones(SLOTS)
MONDAY = date(2026, 11, 9)


def slots(rows: Iterable[Unusual]) -> list[int]:
    """Return the slots of hours, 0 Monday 00 to 167 Sunday 23."""
    return [24 * row.weekday + row.hour for row in rows]


@pytest.fixture
def before() -> np.ndarray:
    rng = np.random.default_rng(11)
    return rng.poisson(100 * rng.gamma(50, 1 / 50, (8, SLOTS))).astype(float)


def found_in(now: np.ndarray, before: np.ndarray, **options: object) -> list[int]:
    told = unusual_hours(now, ONES, monday=MONDAY, before_n=before, before_x_h=np.ones_like(before), **options)  # type: ignore[arg-type]
    return slots(told.rows)


def test_a_tripled_and_an_emptied_hour_are_found_least_likely_first(before: np.ndarray) -> None:
    now = np.median(before, axis=0)
    now[40], now[90] = 300, 20
    told = unusual_hours(now, ONES, monday=MONDAY, before_n=before, before_x_h=np.ones_like(before))
    assert set(slots(told.rows)) == {40, 90}
    assert [row.q for row in told.rows] == sorted(row.q for row in told.rows)
    high = told.rows[slots(told.rows).index(40)]
    assert (high.violations, high.usual, high.n_weeks) == (300, np.median(before[:, 40]), 8)
    assert high.lo < high.usual < high.hi < 300
    assert told.n_tested == SLOTS


def test_missing_hours_are_never_unusual(before: np.ndarray) -> None:
    now, x_h = np.median(before, axis=0), ONES.copy()
    now[40:60], x_h[40:60] = 0, 0
    told = unusual_hours(now, x_h, monday=MONDAY, before_n=before, before_x_h=np.ones_like(before))
    assert (told.rows, told.n_tested, told.state) == ((), SLOTS - 20, "ok")


def test_an_hour_half_recorded_is_judged_by_what_half_of_it_usually_has(before: np.ndarray) -> None:
    now, x_h = np.median(before, axis=0), ONES.copy()
    now[40], x_h[40] = 50, 0.5
    now[41], x_h[41] = 180, 0.6
    told = unusual_hours(now, x_h, monday=MONDAY, before_n=before, before_x_h=np.ones_like(before))
    assert slots(told.rows) == [41]
    assert told.rows[0].usual == pytest.approx(0.6 * np.median(before[:, 41]))


def test_a_change_of_less_than_half_or_less_than_five_is_not_reported() -> None:
    before = np.full((8, SLOTS), 1000.0)
    now = before[0].copy()
    now[3], now[4] = 1450, 1550
    assert found_in(now, before) == [4]
    few = np.full((8, SLOTS), 0.0)
    rare = few[0].copy()
    rare[3], rare[4] = 4, 9
    assert found_in(rare, few) == [4]


def test_at_most_five_are_shown_and_all_are_counted(before: np.ndarray) -> None:
    now = np.median(before, axis=0)
    now[:9] = 900
    told = unusual_hours(now, ONES, monday=MONDAY, before_n=before, before_x_h=np.ones_like(before))
    assert (len(told.rows), told.n_unusual) == (5, 9)


def test_fewer_than_four_weeks_before_are_refused(before: np.ndarray) -> None:
    told = unusual_hours(before[0], ONES, monday=MONDAY, before_n=before[:3], before_x_h=np.ones((3, SLOTS)))
    assert (told.state, told.rows) == ("not_enough_data", ())
    assert reason_text(told.reason) == "a usual value needs 4 earlier recorded weeks, has 3"


def test_q_is_benjamini_and_hochbergs(before: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    tails: list[np.ndarray] = []

    def both_tails(*args: np.ndarray, **asked: np.ndarray) -> np.ndarray:
        tails.append(negative_binomial.both_tails(*args, **asked))
        return tails[-1]

    monkeypatch.setattr(unusual, "both_tails", both_tails)
    now = np.random.default_rng(12).poisson(100, SLOTS).astype(float)
    now[:20] *= 3
    options = {"max_shown": SLOTS, "q_max": 1.0, "min_change": 0.0, "min_difference": 0.0}
    told = unusual_hours(now, ONES, monday=MONDAY, before_n=before, before_x_h=np.ones_like(before), **options)
    by_slot = sorted(told.rows, key=lambda row: (row.day, row.hour))
    assert len(by_slot) == SLOTS
    assert [row.q for row in by_slot] == pytest.approx(stats.false_discovery_control(tails[0]))


@pytest.mark.simulation
def test_a_year_has_few_false_flags_and_a_tripled_hour_is_mostly_found() -> None:
    found = [row for seed in (1, 2) for row in prove.run_unusual(seed, world=prove.World("calm", is_calm=True))]
    mean = {key: float(np.mean([row[key] for row in found if key in row])) for key in ("flags", "flags z", "power")}
    assert mean["flags"] < 0.5
    assert mean["flags z"] > 1.5
    assert mean["power"] > 0.3
