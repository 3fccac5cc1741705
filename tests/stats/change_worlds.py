"""Sites with areas, days and weeks drawn from stated variation, in which an area may change: for the proofs of changes.

An area's rate is its own (log sd .3), times a weekday profile of its own (log sd .15), times shocks all areas share
(days with lag-1 correlation, weeks), each area with a loading of its own on them, times shocks of its own days and
weeks. Violations are Poisson given the rate; each lasts a gamma-distributed time with coefficient of variation 1, so
person-time in violation has noise of its own. People move with half the shared shock.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vsd_analytics.stats.period_days import PeriodDays

OPEN_H = 10.0
DURATION_H, DURATION_CV2 = 40 / 3600, 1.0
BUSY = np.array([0.9, 0.85, 0.9, 1.0, 1.2, 1.4, 0.75])


@dataclass(frozen=True)
class World:
    """How a site varies.

    Attributes:
        name: For tables.
        day_sd, week_sd, lag: Of the shocks that areas share, and the lag-1 correlation of days.
        loading_sd: Log sd of the areas' loadings on them: 0 = all alike.
        own_day_sd, own_week_sd: Of shocks of each area's own.
        n_areas: The changed one is the first.
        per_week: Violations of an average area in a week.
        weeks_before, weeks_after: Weeks drawn around the change.
        trend: Relative change per week of the changed area alone, all along.
        effect: Factor on the changed area's rate from the change on.
        season: Factor on all areas' rates from the change on.
        spill: Share of the changed area's lost violation time that goes to other areas, and to how many.
    """

    name: str
    day_sd: float = 0.25
    week_sd: float = 0.0
    lag: float = 0.0
    loading_sd: float = 0.2
    own_day_sd: float = 0.1
    own_week_sd: float = 0.0
    n_areas: int = 12
    per_week: float = 300.0
    weeks_before: int = 12
    weeks_after: int = 4
    trend: float = 0.0
    effect: float = 1.0
    season: float = 1.0
    spill: tuple[float, int] = (0.0, 0)

    def but(self, **changes: object) -> World:
        """Return the world with something else in it."""
        return replace(self, **changes)


OFFICE = World("office", day_sd=0.10, own_day_sd=0.05, own_week_sd=0.03)
SHOP = World("shop", day_sd=0.25, week_sd=0.10, own_day_sd=0.15, own_week_sd=0.06)
MUSEUM = World("museum", day_sd=0.40, week_sd=0.22, lag=0.14, own_day_sd=0.25, own_week_sd=0.08)


@dataclass(frozen=True)
class Drawn:
    """Many sites: violations, person-time in violation and person-hours, each (n_sites, n_areas, n_days).

    `expected` is what violations would be without any shock: what is planted, and all that is true of a change. `given`
    is what they would be on average over days, given the shocks of each week: what is true of a week's level.
    """

    world: World
    n: np.ndarray
    violation_h: np.ndarray
    exposure_h: np.ndarray
    expected: np.ndarray
    given: np.ndarray
    net: np.ndarray
    """True ratio of the floor's expected violation time, after over before, shape (n_sites,)."""

    @property
    def cut(self) -> int:
        """Return the first day after the change."""
        return 7 * self.world.weeks_before

    def period(self, site: int, first_week: int, last_week: int, *, per: str = "open") -> PeriodDays:
        """Return weeks of a site, from `first_week` to before `last_week`, counted from the first drawn."""
        days = np.arange(7 * first_week, 7 * last_week)
        v, n = self.violation_h[site][:, days], self.n[site][:, days]
        x = np.full(v.shape, OPEN_H) if per == "open" else self.exposure_h[site][:, days]
        return PeriodDays(v[0], x[0], v[1:], x[1:], days % 7, days // 7, n[0], n[1:])


def draw(world: World, n_sites: int, seed: int) -> Drawn:
    """Return sites drawn independently."""
    rng = np.random.default_rng([seed, *world.name.encode()])
    n_weeks = world.weeks_before + world.weeks_after
    days, cut = np.arange(7 * n_weeks), 7 * world.weeks_before
    shape = (n_sites, world.n_areas, len(days))
    innovations = rng.normal(0, world.day_sd, (n_sites, len(days)))
    shared = innovations.copy()
    for day in range(1, len(days)):
        shared[:, day] = world.lag * shared[:, day - 1] + np.sqrt(1 - world.lag**2) * innovations[:, day]
    shared_week = np.repeat(rng.normal(0, world.week_sd, (n_sites, n_weeks)), 7, axis=1)
    shared += shared_week
    loading = np.exp(rng.normal(0, world.loading_sd, shape[:2]))
    own = rng.normal(0, world.own_day_sd, shape)
    own_week = np.repeat(rng.normal(0, world.own_week_sd, (*shape[:2], n_weeks)), 7, axis=2)
    own += own_week
    base = np.exp(rng.normal(0, 0.3, shape[:2]))[..., None]
    profile = np.exp(rng.normal(0, 0.15, (*shape[:2], 7)))[..., days % 7] * BUSY[days % 7]
    expected = world.per_week / 7 * base * profile
    expected[:, 0] *= (1 + world.trend) ** ((days - cut) / 7)
    before = expected[..., :cut].sum(axis=(1, 2)) / cut if cut else np.full(n_sites, np.nan)
    lost = expected[:, 0, cut:] * (1 - world.effect)
    expected[:, 0, cut:] *= world.effect
    share, n_into = world.spill
    if n_into:
        expected[:, 1 : 1 + n_into, cut:] += (share * lost / n_into)[:, None]
    expected[..., cut:] *= world.season
    after = expected[..., cut:].mean(axis=2).sum(axis=1)
    of_days = (loading[..., None] ** 2 * world.day_sd**2 + world.own_day_sd**2) / 2
    given = expected * np.exp(loading[..., None] * shared_week[:, None] + own_week + of_days)
    n = rng.poisson(expected * np.exp(loading[..., None] * shared[:, None] + own)).astype(float)
    seen = n > 0
    violation_h = np.zeros(shape)
    violation_h[seen] = rng.gamma(n[seen] / DURATION_CV2, DURATION_CV2 * DURATION_H)
    exposure_h = 40 / 7 * BUSY[days % 7] * np.exp(0.5 * shared[:, None] + rng.normal(0, 0.1, shape))
    return Drawn(world, n, violation_h, exposure_h, expected, given, after / before)
