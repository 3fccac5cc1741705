"""Sites whose areas share visitors, for the proof of what is claimed of logged changes: visitors, then pairs.

Unlike `change_worlds`, nothing here is log-normal. A site has visitors, gamma-distributed by day and by week; weeks may
resemble the week before, and a season may move them. Visitors spread over areas by weights that vary by day and week
(gamma). Violations grow faster than visitors (power 1.4) and last Weibull-distributed times, so time too close has
heavy days. The entry of the log is always made for area 0, after `WEEKS_BEFORE` weeks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

WEEKS_BEFORE = 12
WEEKDAYS = np.array([0.8, 0.85, 0.95, 1.0, 1.3, 1.35, 0.75])
CROWDING = 1.4
"""Violations grow with that power of the visitors of an area."""
DURATION_H = 35 / 3600
WEIBULL = 0.8
"""Shape of durations: squared coefficient of variation 1.59."""


@dataclass(frozen=True)
class Site:
    """How a kind of site varies, and what is planted from the entry on.

    Attributes:
        name: For tables.
        day_cv, week_cv: Of the visitors of the site by day and by week.
        week_correlation: Of a week's factor with that of the week before.
        own_day_cv, own_week_cv: Of each area's own days and weeks.
        n_areas: The first is the one of the entry.
        per_week: Violations of a middle area in a week.
        effect: Factor on area 0.
        moves: Share of what area 0 loses that goes to other areas, and to how many of them.
        whole: Factor on the whole site, and the log sd with which areas feel it.
        season: Amplitude of a yearly wave of all areas, and weeks that areas may be apart.
        holiday: Factor on area 0 alone, and for how many weeks.
        drift: Share of the time that is still counted after eight weeks, falling evenly, and in how many areas (the
            first ones).
        detector: Factor on what is counted, and on what share of the areas.
    """

    name: str
    day_cv: float = 0.10
    week_cv: float = 0.0
    week_correlation: float = 0.0
    own_day_cv: float = 0.06
    own_week_cv: float = 0.03
    n_areas: int = 8
    per_week: float = 300.0
    effect: float = 1.0
    moves: tuple[float, int] = (0.0, 0)
    whole: tuple[float, float] = (1.0, 0.0)
    season: tuple[float, float] = (0.0, 0.0)
    holiday: tuple[float, int] = (1.0, 0)
    drift: tuple[float, int] = (1.0, 0)
    detector: tuple[float, float] = (1.0, 0.0)

    def but(self, **changes: object) -> Site:
        """Return the site with something else in it."""
        return replace(self, **changes)


OFFICE = Site("office")
SHOP = Site("shop", day_cv=0.25, week_cv=0.10, own_day_cv=0.15, own_week_cv=0.06)
MUSEUM = Site("museum", day_cv=0.40, week_cv=0.20, week_correlation=0.2, own_day_cv=0.25, own_week_cv=0.08)


@dataclass(frozen=True)
class Weeks:
    """Weekly sums of many sites, each (n_sites, n_areas, n_weeks), of 70 open hours each.

    Attributes:
        violation_h: Person-time in violation.
        n: Violations.
    """

    violation_h: Floats
    n: Floats


def draw(site: Site, n_sites: int, *, weeks_after: int, seed: int) -> Weeks:
    """Return the weeks of sites drawn independently, `WEEKS_BEFORE` before the entry and some after."""
    rng = np.random.default_rng([seed, *f"{site.name}{weeks_after}".encode()])
    n_weeks = WEEKS_BEFORE + weeks_after
    shape = (n_sites, site.n_areas, n_weeks)
    since = np.arange(n_weeks) - WEEKS_BEFORE
    visitors = _gamma(rng, site.day_cv, (n_sites, 1, n_weeks, 7)) * WEEKDAYS
    visitors = visitors * _weeks_in_a_row(rng, site, n_sites, n_weeks)[:, None, :, None]
    own = _gamma(rng, site.own_day_cv, (*shape, 7)) * _gamma(rng, site.own_week_cv, shape)[..., None]
    base = site.per_week * np.exp(rng.uniform(-0.7, 0.7, (n_sites, site.n_areas)))
    mean = (visitors * own) ** CROWDING * (base / (WEEKDAYS**CROWDING).sum())[..., None, None]
    mean = mean * planted(rng, site, base, since)[..., None]
    n = rng.poisson(mean).astype(np.float64)
    # the sum of many Weibull times: a gamma of the same mean and variance
    cv2 = 1.59
    violation_h = np.zeros_like(n)
    violation_h[n > 0] = rng.gamma(n[n > 0] / cv2, cv2 * DURATION_H)
    return Weeks(violation_h.sum(axis=3), n.sum(axis=3))


def planted(rng: np.random.Generator, site: Site, base: Floats, since: npt.NDArray[np.int64]) -> Floats:
    """Return the factor on each area and week that is not chance, shape (n_sites, n_areas, n_weeks)."""
    n_sites, n_areas = base.shape
    is_after = since >= 0
    factor = np.ones((n_sites, n_areas, len(since)))
    whole, unequal = site.whole
    feels = np.exp(rng.normal(0, unequal, (n_sites, n_areas, 1)))
    factor *= np.where(is_after, whole**feels, 1.0)
    amplitude, apart = site.season
    phase = rng.uniform(0, 52, (n_sites, 1, 1)) + rng.uniform(-apart / 2, apart / 2, (n_sites, n_areas, 1))
    factor *= 1 + amplitude * np.sin(2 * np.pi * (since + phase) / 52)
    lost = base[:, :1] * (1 - site.effect)
    factor[:, 0] *= np.where(is_after, site.effect, 1.0)
    share, n_into = site.moves
    for k in range(1, 1 + n_into):
        factor[:, k] *= np.where(is_after, 1 + share * lost / n_into / base[:, [k]], 1.0)
    low, n_holiday = site.holiday
    factor[:, 0] *= np.where(is_after & (since < n_holiday), low, 1.0)
    left, n_drifting = site.drift
    factor[:, :n_drifting] *= 1 - (1 - left) * np.clip((since + 1) / 8, 0, 1)
    more, part = site.detector
    factor[:, : round(part * n_areas)] *= np.where(is_after, more, 1.0)
    return factor


def _weeks_in_a_row(rng: np.random.Generator, site: Site, n_sites: int, n_weeks: int) -> Floats:
    """Return factors of weeks: gamma of mean 1, whose ranks follow a series in which each resembles the one before."""
    z = rng.normal(size=(n_sites, n_weeks))
    for week in range(1, n_weeks):
        z[:, week] = site.week_correlation * z[:, week - 1] + np.sqrt(1 - site.week_correlation**2) * z[:, week]
    if not site.week_cv:
        return np.ones((n_sites, n_weeks))
    from scipy.special import gammaincinv, ndtr

    k = 1 / site.week_cv**2
    return np.asarray(gammaincinv(k, ndtr(z)) / k)


def _gamma(rng: np.random.Generator, cv: float, shape: tuple[int, ...]) -> Floats:
    return rng.gamma(1 / cv**2, cv**2, shape) if cv else np.ones(shape)
