"""Tails and quantiles of the negative binomial, against scipy.stats."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from vsd_analytics.stats.negative_binomial import at_least, at_most, both_tails, quantile

MEANS = st.floats(1e-6, 1e4)
DISPERSIONS = st.floats(1e-6, 5)


@given(mean=MEANS, dispersion=DISPERSIONS, k=st.integers(0, 20_000))
def test_tails_equal_scipy(mean: float, dispersion: float, k: int) -> None:
    law = stats.nbinom(1 / dispersion, 1 / (1 + dispersion * mean))
    assert at_most(k, mean=mean, dispersion=dispersion) == pytest.approx(law.cdf(k), rel=1e-6, abs=1e-12)
    assert at_least(k, mean=mean, dispersion=dispersion) == pytest.approx(law.sf(k - 1), rel=1e-6, abs=1e-12)


@given(mean=st.floats(1e-3, 1e4), dispersion=DISPERSIONS, share=st.floats(0.01, 0.99))
def test_quantile_is_the_first_count_that_reaches_the_share(mean: float, dispersion: float, share: float) -> None:
    k = float(quantile(share, mean=mean, dispersion=dispersion))
    assert k == np.floor(k) >= 0
    assert at_most(k, mean=mean, dispersion=dispersion) >= share
    assert at_most(k - 1, mean=mean, dispersion=dispersion) < share


def test_no_dispersion_is_poisson() -> None:
    k = np.arange(40)
    assert at_most(k, mean=9.5, dispersion=0.0) == pytest.approx(stats.poisson(9.5).cdf(k))
    assert at_least(k, mean=9.5, dispersion=1e-12) == pytest.approx(stats.poisson(9.5).sf(k - 1))
    assert quantile(0.9, mean=9.5, dispersion=0.0) == stats.poisson(9.5).ppf(0.9)


def test_two_sided_tail_is_never_above_one_and_unknown_stays_unknown() -> None:
    p = both_tails([9.0, 0.0, 60.0, 3.0], mean=[9.5, 9.5, 9.5, np.nan], dispersion=0.1)
    assert p[0] == 1.0
    assert p[1] == pytest.approx(2 * float(at_most(0, mean=9.5, dispersion=0.1)))
    assert p[2] == pytest.approx(2 * float(at_least(60, mean=9.5, dispersion=0.1)))
    assert np.isnan(p[3])
    assert np.isnan(quantile(0.5, mean=np.nan, dispersion=0.1))
