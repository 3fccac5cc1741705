"""What a site sets reaches the statistics: each setting moves its figure, and its default leaves it alone."""

from __future__ import annotations

from datetime import date
from typing import Any

import numpy as np
import pytest

from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.before_after import PeriodDays, before_after
from vsd_analytics.stats.durations import close_contacts, durations
from vsd_analytics.stats.forecast import forecast_week
from vsd_analytics.stats.unusual import unusual_hours

SECONDS, DAY = np.tile([10.0, 25.0, 40.0, 80.0], 20), np.repeat(np.arange(10), 8)


@pytest.mark.parametrize(("sustained_s", "share"), [(30.0, 0.5), (25.0, 0.75), (60.0, 0.25)])
def test_violations_are_sustained_from_the_length_that_is_set(sustained_s: float, share: float) -> None:
    found = durations(SECONDS, DAY, None, seed=1, sustained_s=sustained_s)
    assert found.long_share.value == pytest.approx(share)
    if sustained_s == DEFAULTS.sustained_s:
        assert found.long_share == durations(SECONDS, DAY, None, seed=1).long_share


def test_a_close_contact_takes_the_time_that_is_set() -> None:
    pairs = [0, 0, 1], [0.0, 3600.0, 0.0], [400.0, 300.0, 500.0], [True, True, True]
    assert [close_contacts(*pairs, contact_s=s).n for s in (500.0, 700.0, DEFAULTS.contact_s)] == [2, 1, 0]
    assert close_contacts(*pairs).n == 0


def weeks(n_weeks: int) -> tuple[Any, Any]:
    rng = np.random.default_rng(3)
    return rng.poisson(20.0, size=(n_weeks, 168)).astype(float), np.ones((n_weeks, 168))


def test_a_forecast_that_is_to_hold_more_hours_has_a_wider_range() -> None:
    n, x_h = weeks(8)
    usual, wide = (forecast_week(n, x_h, is_count=True, share=s) for s in (DEFAULTS.forecast_share, 0.95))
    assert (np.nan_to_num(wide.hi - wide.lo) > np.nan_to_num(usual.hi - usual.lo)).all()
    assert np.array_equal(usual.hi, forecast_week(n, x_h, is_count=True).hi, equal_nan=True)


@pytest.mark.parametrize(
    "stricter", [{"q_max": 1e-9}, {"min_change": 4.0}, {"min_difference": 100.0}], ids=lambda s: next(iter(s))
)
def test_an_hour_is_unusual_by_what_is_set(stricter: dict[str, float]) -> None:
    before_n, before_x_h = weeks(8)
    n, x_h = weeks(1)
    n[0, 30] = 50.0
    given = {"monday": date(2026, 11, 9), "before_n": before_n, "before_x_h": before_x_h}
    assert [(row.weekday, row.hour) for row in unusual_hours(n[0], x_h[0], **given).rows] == [(1, 6)]
    assert unusual_hours(n[0], x_h[0], **given, **stricter).rows == ()  # type: ignore[arg-type]


def period(n: float, days: int) -> PeriodDays:
    ones = np.ones(days)
    return PeriodDays(
        n=ones * n,
        x_h=ones * 50,
        comparison_n=np.ones((3, days)) * n,
        comparison_x_h=np.ones((3, days)) * 50,
        weekday=np.arange(days) % 7,
        week=np.arange(days) // 7,
    )


@pytest.mark.parametrize(
    ("given", "state"), [({}, "ok"), ({"min_days": 15}, "not_enough_data"), ({"min_events": 300}, "not_enough_data")]
)
def test_before_and_after_need_the_days_and_violations_that_are_set(given: dict[str, int], state: str) -> None:
    assert before_after(period(20.0, 14), period(18.0, 14), **given).state == state  # type: ignore[arg-type]
