"""Did it work: the effect is relative to what was left alone, and says what it does not know."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.stats.before_after import before_after
from vsd_analytics.stats.period_days import PeriodDays
from vsd_analytics.wording.reasons import reason_text


def period(
    rng: np.random.Generator,
    *,
    weeks: int = 2,
    rate: float = 1.0,
    n_areas: int = 6,
    season: float = 1.0,
    first: int = 0,
) -> PeriodDays:
    n_days = 7 * weeks
    days = np.arange(n_days)
    exposure_h = rng.uniform(20, 60, n_days)
    comparison_x_h = rng.uniform(20, 60, (n_areas, n_days))
    shock = season * np.exp(rng.normal(0, 0.2, n_days))
    return PeriodDays(
        rng.poisson(rate * shock * exposure_h).astype(float),
        exposure_h,
        rng.poisson(shock * comparison_x_h).astype(float),
        comparison_x_h,
        days % 7,
        days // 7 + first,
    )


def test_what_moves_the_whole_site_is_no_effect() -> None:
    rng = np.random.default_rng(1)
    found = before_after(period(rng, weeks=4), period(rng, weeks=4, season=1.6, first=4))
    assert found.alone is not None
    assert found.alone > 1.4
    assert found.verdict == "cannot_tell"
    assert found.value == pytest.approx(1.0, abs=0.12)


def test_a_planted_fall_is_found_with_the_size_it_has() -> None:
    rng = np.random.default_rng(12)
    found = before_after(period(rng, weeks=4), period(rng, weeks=4, rate=0.6, season=1.3, first=4))
    assert found.verdict == "clear_fall"
    assert found.lo is not None
    assert found.hi is not None
    assert found.lo < 0.6 < found.hi


def test_theta_is_the_plain_ratio_of_ratios() -> None:
    rng = np.random.default_rng(3)
    b, a = period(rng), period(rng, rate=0.8, first=2)
    found = before_after(b, a)
    hand = (a.n.sum() / a.x_h.sum()) / (b.n.sum() / b.x_h.sum())
    hand /= (a.comparison_n.sum() / a.comparison_x_h.sum()) / (b.comparison_n.sum() / b.comparison_x_h.sum())
    assert found.value == pytest.approx(hand)
    assert found.is_paired
    assert found.df == 13


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda p: replace(p, x_h=np.where(np.arange(14) < 8, 0.0, p.x_h)), "7 recorded days before"),
        (lambda p: replace(p, n=p.n * 0), "30 violations in the area before"),
        (lambda p: replace(p, comparison_n=p.comparison_n * 0), "comparison areas before"),
        (lambda p: replace(p, comparison_x_h=p.comparison_x_h * 0), "no comparison area"),
    ],
)
def test_too_little_data_is_refused_with_its_reason(change, word: str) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(4)
    b, a = period(rng), period(rng, first=2)
    found = before_after(change(b), a)
    assert found.value is None
    assert found.verdict == "too_little_data"
    assert found.state == "not_enough_data"
    assert found.reason is not None
    assert word in reason_text(found.reason)


def test_a_day_without_exposure_is_left_out_and_not_zero() -> None:
    rng = np.random.default_rng(5)
    b, a = period(rng, weeks=3), period(rng, weeks=3, first=3)
    down = np.arange(21) == 10
    blind = replace(b, x_h=np.where(down, 0.0, b.x_h))
    dropped = PeriodDays(*(v[..., ~down] for v in (b.n, b.x_h, b.comparison_n, b.comparison_x_h, b.weekday, b.week)))
    assert before_after(blind, a) == before_after(dropped, a)
    assert before_after(blind, a).days_before == 20


def test_unequal_periods_are_not_paired_and_a_weekday_profile_is_no_noise() -> None:
    rng = np.random.default_rng(6)
    b, a = period(rng, weeks=8), period(rng, weeks=2, first=8)
    profile = np.array([1, 1, 1, 1, 1.5, 3, 0.5])
    wavy = [replace(p, n=np.round(p.n * profile[p.weekday])) for p in (b, a)]
    plain, found = before_after(b, a), before_after(*wavy)
    assert not found.is_paired
    assert found.log_se is not None
    assert plain.log_se is not None
    assert found.log_se < 2 * plain.log_se


def test_a_trend_before_the_change_is_reported() -> None:
    rng = np.random.default_rng(7)
    b, a = period(rng, weeks=8), period(rng, weeks=2, first=8)
    rising = replace(b, n=np.round(b.n * 1.15**b.week))
    flat, steep = before_after(b, a).trend, before_after(rising, a).trend
    assert flat is not None
    assert flat.is_flat
    assert steep is not None
    assert not steep.is_flat
    assert steep.lo < 0.15 < steep.hi


def test_every_comparison_area_is_a_placebo_and_their_spread_an_interval() -> None:
    rng = np.random.default_rng(8)
    found = before_after(period(rng, weeks=4), period(rng, weeks=4, first=4))
    assert len(found.placebo) == 6
    assert found.placebo_lo is not None
    assert found.placebo_hi is not None
    assert found.placebo_lo < 1 < found.placebo_hi
    few = before_after(period(rng, n_areas=3), period(rng, n_areas=3, first=2))
    assert few.placebo_lo is None


def test_the_worst_of_many_is_pulled_towards_the_others() -> None:
    effects = []
    for seed in range(60):
        rng = np.random.default_rng([9, seed])
        b, a = period(rng, weeks=1, n_areas=12), period(rng, weeks=1, n_areas=12, first=1)
        n, x_h = np.vstack([b.n, b.comparison_n]), np.vstack([b.x_h, b.comparison_x_h])
        n2, x2 = np.vstack([a.n, a.comparison_n]), np.vstack([a.x_h, a.comparison_x_h])
        worst = int(np.argmax(n.sum(axis=1) / x_h.sum(axis=1)))
        rest = np.arange(13) != worst
        found = before_after(
            replace(b, n=n[worst], x_h=x_h[worst], comparison_n=n[rest], comparison_x_h=x_h[rest]),
            replace(a, n=n2[worst], x_h=x2[worst], comparison_n=n2[rest], comparison_x_h=x2[rest]),
        )
        assert found.shrunken is not None
        assert found.value is not None
        effects.append((math.log(found.value), math.log(found.shrunken.value)))
    plain, pulled = np.mean(effects, axis=0)
    assert plain < -0.05
    assert abs(pulled) < abs(plain) / 2


@given(scale=st.floats(0.1, 50), seed=st.integers(0, 1000))
def test_units_of_exposure_do_not_matter(scale: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    b, a = period(rng), period(rng, first=2)
    scaled = [replace(p, x_h=p.x_h * scale) for p in (b, a)]
    plain, other = before_after(b, a), before_after(*scaled)
    assert plain.value is not None
    assert other.value == pytest.approx(plain.value)
    assert other.lo == pytest.approx(plain.lo)


def test_what_cannot_be_a_count_is_refused() -> None:
    rng = np.random.default_rng(10)
    b, a = period(rng), period(rng, first=2)
    with pytest.raises(ValueError, match="not negative"):
        before_after(replace(b, n=-b.n - 1), a)
    with pytest.raises(ValueError, match="same comparison areas"):
        before_after(b, period(rng, n_areas=2))


def test_the_trend_may_cover_more_weeks_than_are_compared() -> None:
    rng = np.random.default_rng(11)
    history = period(rng, weeks=8)
    last = np.arange(56) >= 42
    b = PeriodDays(*(v[..., last] for v in (history.n, history.x_h, history.comparison_n, history.comparison_x_h)),
               history.weekday[last], history.week[last])  # fmt: skip
    a = period(rng, first=8)
    assert before_after(b, a).trend is None, "two weeks have no trend"
    found = before_after(b, a, history=history)
    assert found.trend is not None
    assert found.trend.n_weeks == 8
    assert found.line_lo is not None, "eight weeks have a line that can be continued"
    without = replace(found, trend=None, line_lo=None, line_hi=None, lo=None, hi=None)
    assert without == replace(before_after(b, a), lo=None, hi=None)


def test_too_few_person_hours_are_refused_with_the_rule() -> None:
    rng = np.random.default_rng(12)
    b, a = period(rng), period(rng, first=2)
    found = before_after(b, a, min_exposure_h=5000)
    assert (found.value, found.state) == (None, "not_enough_data")
    assert found.reason is not None
    assert reason_text(found.reason).startswith("needs at least 5000 person-hours in the area before, has ")


def test_no_violation_after_is_a_clear_fall_with_a_finite_upper_limit() -> None:
    rng = np.random.default_rng(21)
    found = before_after(period(rng, weeks=4), period(rng, weeks=4, rate=0.0, first=4))
    assert (found.value, found.lo, found.verdict, found.reason) == (0.0, 0.0, "clear_fall", None)
    assert found.hi is not None
    assert 0 < found.hi < 0.1
    assert found.n_after == 0
    few = before_after(period(rng, weeks=4), period(rng, weeks=4, rate=0.01, first=4))
    assert few.verdict == "clear_fall"
    assert few.n_after < 30
    assert few.hi is not None
    assert few.value is not None
    assert few.value < few.hi < 0.2


def test_violations_are_needed_before_and_in_the_areas_compared_with() -> None:
    rng = np.random.default_rng(22)
    codes = [
        before_after(period(rng, weeks=4, rate=0.0), period(rng, weeks=4, first=4)),
        before_after(period(rng, weeks=4), period(rng, weeks=4, season=0.0, first=4)),
    ]
    assert [f.reason and f.reason.code for f in codes] == [
        "logged_change.events_before",
        "logged_change.comparison_events_after",
    ]
