"""A plan: it rests on the site's own weeks, and the power it promises is the power that comes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from vsd_analytics.stats.experiment import Variation, choices, variation_of, weeks_needed
from vsd_analytics.stats.logged_change import AreaWeeks, verdict_of_weeks
from vsd_analytics.stats.period_days import PeriodDays
from vsd_analytics.stats.running_verdict import running_verdict


def history(rng: np.random.Generator, *, weeks: int, day_sd: float, week_sd: float) -> PeriodDays:
    days = np.arange(7 * weeks)
    own = rng.normal(0, day_sd, len(days)) + np.repeat(rng.normal(0, week_sd, weeks), 7)
    x_h = np.full((4, len(days)), 10.0)
    n = np.full((4, len(days)), 1000.0) * np.exp(rng.normal(0, 0.3, len(days)))
    n[0] *= np.exp(own) * np.tile([1, 1, 1, 1, 1.5, 2, 0.5], weeks)
    return PeriodDays(n[0], x_h[0], n[1:], x_h[1:], days % 7, days // 7)


def test_variation_is_split_into_days_and_weeks() -> None:
    rng = np.random.default_rng(1)
    found = [variation_of(history(rng, weeks=12, day_sd=0.2, week_sd=0.15), None) for _ in range(150)]
    days, weeks, all_of_it = (
        math.sqrt(np.mean([getattr(v, name) ** 2 for v in found if v is not None]))
        for name in ("sd_days", "sd_weeks", "sd")
    )
    # days of unequal weight: a weekend counts more than its share
    weight = np.array([1, 1, 1, 1, 1.5, 2, 0.5]) / 8
    assert days == pytest.approx(0.2 * math.sqrt((weight**2).sum()), rel=0.12)
    assert weeks == pytest.approx(0.15, rel=0.12)
    assert all_of_it**2 == pytest.approx(days**2 + weeks**2, rel=1e-6)


def test_fewer_than_four_weeks_tell_no_variation() -> None:
    assert variation_of(history(np.random.default_rng(2), weeks=3, day_sd=0.1, week_sd=0.1), None) is None


def variation(m: int, sd: float, rng: np.random.Generator) -> tuple[Variation, np.ndarray]:
    y = rng.normal(0, sd, m)
    return Variation(tuple(y.tolist()), float(y.std(ddof=1)), 0.0, float(y.std(ddof=1))), y


@pytest.mark.simulation
@pytest.mark.parametrize(("m", "sd", "theta"), [(8, 0.12, 0.7), (12, 0.17, 0.7), (6, 0.1, 0.85)])
def test_the_power_promised_is_the_power_that_comes(m: int, sd: float, theta: float) -> None:
    """Each site plans from its own weeks, then lives through what comes: of all sites the promised share sees it."""
    rng = np.random.default_rng(3)
    promised, came = [], []
    for _ in range(400):
        known, y = variation(m, sd, rng)
        plan = weeks_needed(known, theta, weeks_max=10)
        after = rng.normal(math.log(theta), sd, plan.weeks_after or 10)
        since = running_verdict(y, after)
        promised.append(plan.power)
        came.append(since.clear_since is not None and since.value is not None and since.value < 1)
    assert np.mean(came) == pytest.approx(np.mean(promised), abs=0.05)


@pytest.mark.simulation
@pytest.mark.parametrize(("n_areas", "theta"), [(1, 0.7), (2, 0.5), (3, 0.5), (4, 0.7), (7, 0.7)])
def test_the_power_promised_is_that_of_the_whole_verdict(n_areas: int, theta: float) -> None:
    """A verdict needs the area to stand out from its comparison areas, too: beside few of them hardly anything does."""
    rng = np.random.default_rng(9)
    promised, came = [], []
    for _ in range(60):
        logs = rng.normal(0, 0.1, (n_areas + 1, 20)) + rng.normal(0, 0.2, 20)
        logs[0, 10:] += math.log(theta)
        n, open_h = 500 * np.exp(logs), np.full(logs.shape, 70.0)
        days = np.arange(70)
        daily, hours = np.repeat(n[:, :10] / 7, 7, axis=1), np.full((n_areas + 1, 70), 10.0)
        known = variation_of(PeriodDays(daily[0], hours[0], daily[1:], hours[1:], days % 7, days // 7), None)
        assert known is not None
        plan = weeks_needed(known, theta, weeks_max=10)
        before, since = (AreaWeeks(n[:, w], open_h[:, w], n[:, w]) for w in (slice(0, 10), slice(10, 20)))
        read = (verdict_of_weeks(before, since.at(np.arange(10) <= k)) for k in range(plan.weeks_after or 10))
        promised.append(plan.power)
        came.append(any(verdict.verdict == "clear_fall" for verdict in read))
    assert np.mean(came) == pytest.approx(np.mean(promised), abs=0.13)


def test_beside_one_area_no_fall_of_less_than_71_percent_is_ever_clear() -> None:
    known, _ = variation(12, 0.02, np.random.default_rng(10))
    alone = replace(known, areas_sd=(0.1,))
    assert weeks_needed(alone, 0.35).power < 0.01
    assert weeks_needed(alone, 0.2).weeks_after is not None
    assert weeks_needed(known, 0.7).weeks_after is not None


def test_smaller_effects_and_noisier_sites_need_longer() -> None:
    quiet, _ = variation(12, 0.08, np.random.default_rng(4))
    noisy = Variation(tuple(3 * v for v in quiet.log_ratios), 3 * quiet.sd, 0.0, 3 * quiet.sd)
    large, small, hard = weeks_needed(quiet, 0.5), weeks_needed(quiet, 0.85), weeks_needed(noisy, 0.85)
    assert large.weeks_after is not None
    assert small.weeks_after is not None
    assert large.weeks_after < small.weeks_after
    assert hard.weeks_after is None
    assert hard.power < 0.8


def test_the_same_weeks_give_the_same_plan_and_the_estimate_is_predicted_around_the_effect() -> None:
    known, _ = variation(8, 0.1, np.random.default_rng(5))
    plan = weeks_needed(known, 0.7)
    assert plan == weeks_needed(known, 0.7)
    assert plan.theta_lo < 0.7 < plan.theta_hi


def test_waiting_before_the_change_can_save_weeks_after_it() -> None:
    known, _ = variation(5, 0.12, np.random.default_rng(6))
    found = choices(known, 0.6)
    assert [c.weeks_before for c in found] == [5, 7, 9, 11, 12]
    assert [c.weeks_to_wait for c in found] == [0, 2, 4, 6, 7]
    assert found[0].weeks_after is not None
    assert found[-1].weeks_after is not None
    assert found[-1].weeks_after <= found[0].weeks_after


def test_no_effect_cannot_be_planned_for() -> None:
    known, _ = variation(5, 0.12, np.random.default_rng(7))
    with pytest.raises(ValueError, match="effect"):
        weeks_needed(known, 1.0)
