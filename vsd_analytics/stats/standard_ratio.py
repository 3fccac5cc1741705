r"""Time too close of several sites beside what a common site would have with the same crowding: observed over expected.

Site j spent x_jk person-hours in class k of crowding, and o_j person-hours too close. The rate of a common site in a
class, r_k, and the ratios solve the multiplicative model o_jk ~ theta_j r_k x_jk together:

    theta_j = o_j / e_j,   e_j = sum_k r_k x_jk,   r_k = sum_j o_jk / sum_j theta_j x_jk.

This is indirect standardisation with internal rates (Breslow & Day, Statistical Methods in Cancer Research II, 1987,
ch. 4): with all theta_j = 1 in r_k it would be the usual one, whose ratios lie nearer to 1 where few sites are as
crowded as the one that differs. Opening hours need no step of their own: rates are shares of person-time, and an hour
counts by how crowded it was, not by when it was.

The variance of ln theta_j has days and weeks as clusters. With i_d = (o_jd - theta_j e_jd) / o_j,

    v_day = D/(D-1) sum_d i_d^2,   v_week = W/(W-1) sum_w (sum_{d in w} i_d)^2 on W - 1 degrees of freedom.

Few weeks tell little, so v_week is pooled with a prior of 3 degrees of freedom, phi v_0, where v_0 = v_day +
max(2.6 v_day, .08^2 / W) is what `weekly_steps` takes a site without history for, and phi is how far off that is over
all sites, sum_j (W_j - 1) v_week / v_0 and 6 x 1 over sum_j (W_j - 1) + 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.weekly_steps import PRIOR_EXTRA, PRIOR_WEEK_SD

Floats = npt.NDArray[np.float64]

PRIOR_DF: Final = 3.0
"""Degrees of freedom of the prior of a site's variance: fewer cost power; with 6 more pages than promised err."""
COMMON_DF: Final = 6.0
"""Degrees of freedom of the prior of all sites together, before their weeks count."""
ROUNDS: Final = 200
CLOSE_ENOUGH: Final = 1e-9
MIN_OTHERS: Final = 2
MIN_OTHERS_H: Final = 5.0
"""A class of crowding is known when so many other sites have so many person-hours in it."""


@dataclass(frozen=True, slots=True, eq=False)
class SiteTime:
    """Person-time of one site.

    Attributes:
        close_h: Person-hours too close on each day, shape (n_days,).
        person_h: Person-hours in each class of crowding, shape (n_days, n_classes).
        week: Week of each day, any integers, shape (n_days,).
        classes: First and last class of each group of classes, shape (n_groups, 2); together they hold all person-time.
        class_close_h: Person-hours too close in each group, all days, shape (n_groups,).
    """

    close_h: Floats
    person_h: Floats
    week: npt.NDArray[np.int64]
    classes: npt.NDArray[np.int64]
    class_close_h: Floats


@dataclass(frozen=True, slots=True)
class StandardRatio:
    """Observed over expected time too close of one site.

    Attributes:
        ratio: theta_j; 1 = as a common site with the same crowding.
        expected_h: e_j times the ratio's common level: person-hours too close of a common site.
        variance: Of ln theta_j, from days and weeks.
        df: Its degrees of freedom.
    """

    ratio: float
    expected_h: float
    variance: float
    df: float


def known_shares(sites: Sequence[SiteTime]) -> Floats:
    """Return the share of each site's person-time in classes of crowding that others know too, shape (n_sites,)."""
    x = np.array([s.person_h.sum(axis=0) for s in sites])
    others = (x >= MIN_OTHERS_H).sum(axis=0) - (x >= MIN_OTHERS_H)
    total: Floats = x.sum(axis=1)
    return np.asarray((x * (others >= MIN_OTHERS)).sum(axis=1) / np.maximum(total, 1e-12))


def class_rates(sites: Sequence[SiteTime]) -> tuple[Floats, Floats]:
    """Return r_k, shape (n_classes,), and theta_j, shape (n_sites,), whose geometric mean is 1.

    Time too close of a group of classes is shared out among them as the rates have it (an EM step).

    Args:
        sites: At least one, each with time too close.
    """
    x = np.array([s.person_h.sum(axis=0) for s in sites])
    observed = np.array([s.close_h.sum() for s in sites])
    theta, rates = np.ones(len(sites)), np.full(x.shape[1], observed.sum() / x.sum())
    narrow, wide = _by_class(sites, x.shape)
    for _ in range(ROUNDS):
        shared = narrow.copy()
        for (site, first, last), close_h in wide.items():
            part = rates[first : last + 1] * x[site, first : last + 1]
            shared[site, first : last + 1] += close_h * part / max(float(part.sum()), 1e-300)
        weight = theta @ x
        rates = np.divide(shared.sum(axis=0), weight, out=np.zeros_like(weight), where=weight > 0)
        before, theta = theta, observed / (x @ rates)
        theta = theta / np.exp(np.log(theta).mean())
        if np.abs(theta / before - 1).max() < CLOSE_ENOUGH:
            break
    return rates * float(observed.sum() / (theta * (x @ rates)).sum()), theta


def standard_ratios(sites: Sequence[SiteTime], *, beside: Sequence[SiteTime] = ()) -> tuple[StandardRatio, ...]:
    """Return the ratio of each site with its variance (formulas: this module).

    Args:
        sites: At least one, each with time too close on two days or more.
        beside: Others, whose ratios come after; what is common is not made from them.
    """
    rates, _ = class_rates(sites)
    every = [*sites, *beside]
    own = [_variances(s, rates) for s in every]
    v_week, v_prior, df = (np.array(values) for values in zip(*own, strict=True))
    n = len(sites)
    common = (float((df * v_week / v_prior)[:n].sum()) + COMMON_DF) / (float(df[:n].sum()) + COMMON_DF)
    variance = (df * v_week + PRIOR_DF * common * v_prior) / (df + PRIOR_DF)
    expected = np.array([float((s.person_h @ rates).sum()) for s in every])
    observed = np.array([float(s.close_h.sum()) for s in every])
    return tuple(
        StandardRatio(ratio=float(o / e), expected_h=float(e), variance=float(v), df=float(d))
        for o, e, v, d in zip(observed, expected, variance, df + PRIOR_DF, strict=True)
    )


def _by_class(sites: Sequence[SiteTime], shape: tuple[int, ...]) -> tuple[Floats, dict[tuple[int, int, int], float]]:
    """Return time too close by site and class, and that of several classes together by site, first and last class."""
    narrow = np.zeros(shape)
    wide: dict[tuple[int, int, int], float] = {}
    for k, site in enumerate(sites):
        for (first, last), close_h in zip(site.classes.tolist(), site.class_close_h.tolist(), strict=True):
            if first == last:
                narrow[k, first] += close_h
            else:
                wide[k, first, last] = wide.get((k, first, last), 0.0) + close_h
    return narrow, wide


def _variances(site: SiteTime, rates: Floats) -> tuple[float, float, float]:
    """Return v_week, the prior v_0 and the degrees of freedom of v_week."""
    expected = site.person_h @ rates
    observed = float(site.close_h.sum())
    influence = (site.close_h - observed / expected.sum() * expected) / observed
    n_days = len(influence)
    v_day = n_days / (n_days - 1) * float(influence @ influence)
    _, week = np.unique(site.week, return_inverse=True)
    by_week = np.bincount(week, weights=influence)
    n_weeks = len(by_week)
    v_week = n_weeks / (n_weeks - 1) * float(by_week @ by_week) if n_weeks > 1 else 0.0
    return v_week, v_day + max(PRIOR_EXTRA * v_day, PRIOR_WEEK_SD**2 / n_weeks), float(n_weeks - 1)
