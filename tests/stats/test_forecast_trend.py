"""Weeks side by side: the same figures as a report of each week, gaps where too little was recorded."""

from __future__ import annotations

from datetime import date, timedelta

import numpy as np
import pytest

from vsd_analytics.stats.rates import encounter_rate, violation_rate
from vsd_analytics.stats.trend import weekly_trend, why_no_trend
from vsd_analytics.wording.reasons import reason_text

MONDAYS = [date(2026, 9, 7) + timedelta(weeks=i) for i in range(10)]
OPEN = np.tile([13.0] * 6 + [8.0], 10)


@pytest.fixture
def world() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(21)
    x_h = np.tile(OPEN, (2, 1))
    return rng.poisson(5 * x_h).astype(float), x_h, x_h * rng.gamma(30, 0.1, x_h.shape)


def test_each_week_is_what_its_own_report_says(world: tuple[np.ndarray, ...]) -> None:
    n, x_h, exposure_h = world
    made = weekly_trend(n, x_h, exposure_h, OPEN, coverage=np.ones(10), mondays=MONDAYS[-4:])
    assert (why_no_trend(made), [w.monday for w in made]) == (None, MONDAYS[-4:])
    now, past = slice(63, 70), slice(28, 63)
    weekday = np.arange(7)
    history = {"weekday": weekday, "history_weekday": np.tile(weekday, 5)}
    per_open_h = violation_rate(n[:, now], x_h[:, now], history_n=n[:, past], history_x_h=x_h[:, past], **history)
    sums = [a.sum(axis=0) for a in (n, exposure_h)]
    per_person_h = encounter_rate(
        sums[0][now], sums[1][now], history_n=sums[0][past], history_exposure_h=sums[1][past], **history
    )
    assert made[-1].violation_rate == per_open_h
    assert made[-1].encounter_rate == per_person_h


def test_a_week_recorded_too_little_is_a_gap_and_says_so(world: tuple[np.ndarray, ...]) -> None:
    n, x_h, exposure_h = (a.copy() for a in world)
    coverage = np.ones(10)
    coverage[[6, 7, 8]] = 0.4, 0.0, np.nan
    x_h[:, 49:56] = 0
    made = weekly_trend(n, x_h, exposure_h, OPEN, coverage=coverage, mondays=MONDAYS[-5:])
    assert [w.state for w in made] == ["ok", *["not_enough_data"] * 3, "ok"]
    assert [w.violation_rate is None for w in made] == [False, True, True, True, False]
    assert [reason_text(w.reason) for w in made[1:4]] == [
        "40% of the open hours were recorded, a rate needs 60%",
        "nothing or too little was recorded",
        "closed all week",
    ]
    assert reason_text(why_no_trend(made)) == "a trend needs 3 recorded weeks, has 2"


def test_without_positions_there_is_no_risk_but_how_often(world: tuple[np.ndarray, ...]) -> None:
    n, x_h, _ = world
    made = weekly_trend(n, x_h, None, OPEN, coverage=np.ones(10), mondays=MONDAYS[-3:])
    assert all(w.encounter_rate is None and w.violation_rate is not None for w in made)


def test_a_camera_that_broke_is_left_out_of_all_weeks_so_that_it_is_no_fall(world: tuple[np.ndarray, ...]) -> None:
    n, x_h, exposure_h = (a.copy() for a in world)
    for values in (n, x_h, exposure_h):
        values[0, -7:] = 0
    made = weekly_trend(n, x_h, exposure_h, OPEN, coverage=np.ones(10), mondays=MONDAYS[-4:])
    alone = weekly_trend(n[1:], x_h[1:], exposure_h[1:], OPEN, coverage=np.ones(10), mondays=MONDAYS[-4:])
    assert [w.violation_rate for w in made] == [w.violation_rate for w in alone]
    assert [w.missing for w in made] == [()] * 4


def test_a_week_without_one_of_the_cameras_of_the_last_week_names_it(world: tuple[np.ndarray, ...]) -> None:
    n, x_h, exposure_h = (a.copy() for a in world)
    for values in (n, x_h, exposure_h):
        values[1, 49:55] = 0
    made = weekly_trend(n, x_h, exposure_h, OPEN, coverage=np.ones(10), mondays=MONDAYS[-4:])
    assert [w.missing for w in made] == [(), (1,), (), ()]


def test_the_share_of_time_too_close_is_that_of_its_own_week(world: tuple[np.ndarray, ...]) -> None:
    n, x_h, exposure_h = world
    close_h = exposure_h * np.random.default_rng(3).uniform(0.2, 0.6, exposure_h.shape)
    made = weekly_trend(n, x_h, exposure_h, OPEN, close_h=close_h, coverage=np.ones(10), mondays=MONDAYS[-4:])
    for week, last in zip(made, (49, 56, 63, 70), strict=True):
        now = slice(last - 7, last)
        assert week.close is not None
        assert week.close.value == pytest.approx(close_h[:, now].sum() / exposure_h[:, now].sum())
        assert week.close.n_events is None
        assert week.close.lo is not None
        assert week.close.lo < week.close.value
    assert (
        made[0].encounter_rate
        == weekly_trend(n, x_h, exposure_h, OPEN, coverage=np.ones(10), mondays=MONDAYS[-4:])[0].encounter_rate
    )


def test_days_must_make_weeks(world: tuple[np.ndarray, ...]) -> None:
    n, x_h, _ = world
    with pytest.raises(ValueError, match="whole weeks"):
        weekly_trend(n[:, :-1], x_h[:, :-1], None, OPEN[:-1], coverage=np.ones(10), mondays=MONDAYS[-3:])
