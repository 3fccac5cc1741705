"""The worlds of the proofs have the variation they state."""

import numpy as np
import pytest
from day_worlds import AREAS, MUSEUM, Variation, World, counts, day_effects, step, trend


def test_day_effects_have_the_stated_sd_and_correlation() -> None:
    effects = day_effects(np.random.default_rng(1), sites=4000, days=30, sd=0.4, correlation=0.6)
    assert effects.std() == pytest.approx(0.4, abs=0.005)
    assert np.corrcoef(effects[:, :-1].ravel(), effects[:, 1:].ravel())[0, 1] == pytest.approx(0.6, abs=0.01)
    assert effects[:, 0].std() == pytest.approx(effects[:, -1].std(), rel=0.05), "stationary from the first day on"


def test_counts_and_people_have_the_means_they_state() -> None:
    world = World(MUSEUM, shares=AREAS)
    drawn = world.draw(np.random.default_rng(2), sites=3000, weeks=4, effect=step(4, at=2, ratio=0.7))
    assert drawn.n.shape == (3000, 4, 8, 7)
    assert drawn.n.mean(axis=(0, 3))[1].sum() * 7 == pytest.approx(3000, rel=0.02)
    assert drawn.n[:, 2:].sum() / drawn.n[:, :2].sum() == pytest.approx(0.7, rel=0.02)
    assert drawn.person_h.mean(axis=(0, 1)) == pytest.approx(drawn.expected_person_h, rel=0.03)


def test_weeks_vary_by_their_own_effect_beyond_days() -> None:
    rng = np.random.default_rng(3)
    day_only, with_weeks = (
        World(Variation(day_sd=0.4, week_sd=sd), violations_week=1e6).draw(rng, sites=4000, weeks=1) for sd in (0, 0.22)
    )
    variances = [np.log(d.n).mean(axis=(1, 2, 3)).var() for d in (day_only, with_weeks)]
    assert variances[0] == pytest.approx(0.16 / 7, rel=0.1)
    assert variances[1] - variances[0] == pytest.approx(0.22**2, rel=0.1)


def test_counts_may_be_more_dispersed_than_poisson() -> None:
    drawn = counts(np.random.default_rng(4), np.full(200_000, 20.0), dispersion=3.0)
    assert drawn.mean() == pytest.approx(20, rel=0.01)
    assert drawn.var() == pytest.approx(60, rel=0.03)


def test_a_trend_multiplies_week_by_week() -> None:
    assert trend(3, per_week=-0.02).ravel() == pytest.approx([1, 0.98, 0.9604])
