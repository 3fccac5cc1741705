"""Sites whose truth is known: daily counts and exposures drawn from stated variation of days and weeks, in plain numpy.

The worlds of the proofs and tests of intervals, verdicts and before/after studies. They are not the demo's simulator:
nobody walks here. The expected violations of place j on day d of week w are

    e_jwd = violations_week share_j profile_d effect_jwd,
    n_jwd ~ Poisson or over-dispersed around e_jwd exp(loading_j (s_wd + u_w) + o_jwd + v_jw),

with s an AR(1) series over open days (`day_sd`, `correlation`; it runs through from week to week), u_w a week's effect
(`week_sd`), o and v a place's own effects of days and weeks (`area_day_sd`, `area_week_sd`). All are normal on the log
scale, and each factor has mean 1. Person-hours move with the same sum to the power `people_power`, and with a series of
their own of sd `people_own` times `day_sd`: a crowded day is also a riskier one.

Two variations are measured: OFFICE (day sd .10, no week effect), in a workplace, and MUSEUM (day sd .40 after weekdays,
week sd .22 beyond days, lag-1 correlation .14), in 69 days of contacts in a science museum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

WEEKDAYS_OFFICE: Final = (0.224, 0.217, 0.197, 0.226, 0.137)
"""Shares of the violations of a week from Monday to Friday, measured in the workplace; closed at weekends."""
WEEKDAYS_SHOP: Final = (0.108, 0.111, 0.119, 0.128, 0.155, 0.203, 0.176)
"""Shares of a week of seven open days, the weekend busiest: assumed."""
CAMERAS: Final = (0.4, 0.3, 0.2, 0.1)
"""Shares of four cameras in the violations of a floor."""
AREAS: Final = (0.30, 0.20, 0.14, 0.11, 0.09, 0.07, 0.05, 0.04)
"""Shares of eight areas, from a large one to one with 4 %."""


@dataclass(frozen=True, slots=True)
class Variation:
    """How days and weeks of a site differ when nothing changes; each sd is of a log-normal factor of mean 1.

    Attributes:
        day_sd: Of days, weekdays taken out.
        week_sd: Of weeks, beyond what their days make.
        correlation: Of a day's effect with that of the open day before.
        area_day_sd: Of each place's own days.
        area_week_sd: Of each place's own weeks.
    """

    day_sd: float
    week_sd: float = 0.0
    correlation: float = 0.0
    area_day_sd: float = 0.0
    area_week_sd: float = 0.0


OFFICE: Final = Variation(day_sd=0.10)
MUSEUM: Final = Variation(day_sd=0.40, week_sd=0.22, correlation=0.14)


@dataclass(frozen=True, slots=True)
class Drawn:
    """Counts and exposures of many sites.

    Attributes:
        n: Violations, shape (n_sites, n_weeks, n_places, n_days).
        x_h: Open hours, shape (n_places, n_days): all recorded.
        person_h: Person-hours, shape of `n`.
        expected: Mean violations of the place on that weekday under the stated effect, shape of `n`.
        expected_person_h: Mean person-hours, shape (n_places, n_days).
    """

    n: Floats
    x_h: Floats
    person_h: Floats
    expected: Floats
    expected_person_h: Floats

    @property
    def floor_n(self) -> Floats:
        """Return violations of all places together, shape (n_sites, n_weeks, n_days)."""
        return np.asarray(self.n.sum(axis=2))

    @property
    def floor_person_h(self) -> Floats:
        """Return person-hours of all places together, shape (n_sites, n_weeks, n_days)."""
        return np.asarray(self.person_h.sum(axis=2))


@dataclass(frozen=True, slots=True)
class World:
    """A kind of site.

    Attributes:
        variation: How its days and weeks differ.
        weekdays: Share of each open day in the violations of a week; its length is the open days a week.
        open_h: Open hours of each of them.
        violations_week: Mean violations of all places in a week.
        shares: Share of each place (camera or area) in them.
        loadings: How strongly each place feels what moves all; None = 1 each.
        dispersion: Variance over mean of a day's count, given its effects; 1 = Poisson.
        people_power: Power of the common factor in person-hours.
        people_own: Sd of the day series people have of their own, as a share of `day_sd`.
        violations_per_person_h: Mean violations per person-hour.
    """

    variation: Variation
    weekdays: tuple[float, ...] = WEEKDAYS_SHOP
    open_h: float = 10.0
    violations_week: float = 3000.0
    shares: tuple[float, ...] = (1.0,)
    loadings: tuple[float, ...] | None = None
    dispersion: float = 1.0
    people_power: float = 0.6
    people_own: float = 0.3
    violations_per_person_h: float = 2.0

    @property
    def n_days(self) -> int:
        """Return the open days a week."""
        return len(self.weekdays)

    def with_areas(self, shares: tuple[float, ...] = AREAS) -> World:
        """Return the same site with these places."""
        return replace(self, shares=shares)

    def draw(self, rng: np.random.Generator, *, sites: int, weeks: int, effect: npt.ArrayLike = 1.0) -> Drawn:
        """Draw weeks of independent sites.

        Args:
            rng: Source of chance.
            sites: How many sites.
            weeks: How many successive weeks of each.
            effect: True factor on violations, broadcast to (sites, weeks, places, days): `step`, `trend`, or any.
        """
        v, size = self.variation, (sites, weeks, len(self.shares), self.n_days)
        common = day_effects(rng, sites=sites, days=weeks * self.n_days, sd=v.day_sd, correlation=v.correlation)
        common = common.reshape(sites, weeks, 1, self.n_days) + v.week_sd * rng.standard_normal((sites, weeks, 1, 1))
        common_variance = v.day_sd**2 + v.week_sd**2
        loading = np.ones(len(self.shares)) if self.loadings is None else np.asarray(self.loadings, dtype=np.float64)
        own = np.zeros(size)
        if v.area_day_sd:
            own += v.area_day_sd * rng.standard_normal(size)
        if v.area_week_sd:
            own += v.area_week_sd * rng.standard_normal((*size[:3], 1))
        log_factor = loading[:, None] * common + own
        log_factor -= (loading[:, None] ** 2 * common_variance + v.area_day_sd**2 + v.area_week_sd**2) / 2

        profile = np.asarray(self.weekdays) / np.sum(self.weekdays)
        usual = self.violations_week * np.outer(self.shares, profile)
        expected = np.broadcast_to(usual * np.asarray(effect, dtype=np.float64), size)
        n = counts(rng, expected * np.exp(log_factor), dispersion=self.dispersion)

        # people: a flatter week than violations have, all places alike
        flat = profile**self.people_power
        usual_people = self.violations_week / self.violations_per_person_h * np.outer(self.shares, flat / flat.sum())
        own_sd = self.people_own * v.day_sd
        log_people = self.people_power * loading[:, None] * common + own_sd * rng.standard_normal(size)
        log_people -= (self.people_power**2 * loading[:, None] ** 2 * common_variance + own_sd**2) / 2
        return Drawn(
            n=n,
            x_h=np.full(size[2:], self.open_h),
            person_h=usual_people * np.exp(log_people),
            expected=np.array(expected),
            expected_person_h=usual_people,
        )


def day_effects(rng: np.random.Generator, *, sites: int, days: int, sd: float, correlation: float) -> Floats:
    """Return stationary AR(1) series of normal effects, shape (sites, days), each of sd `sd`.

    Args:
        rng: Source of chance.
        sites: Independent series.
        days: Successive open days.
        sd: Of each effect.
        correlation: Of each with the one before, below 1.
    """
    noise = rng.standard_normal((sites, days))
    effects = np.empty_like(noise)
    effects[:, 0] = noise[:, 0]
    for day in range(1, days):
        effects[:, day] = correlation * effects[:, day - 1] + np.sqrt(1 - correlation**2) * noise[:, day]
    return sd * effects


def counts(rng: np.random.Generator, mean: Floats, *, dispersion: float = 1.0) -> Floats:
    """Return counts of these means: Poisson, or gamma-Poisson with variance `dispersion` times the mean."""
    if dispersion > 1:
        mean = rng.gamma(np.maximum(mean, 1e-12) / (dispersion - 1), dispersion - 1)
    return rng.poisson(mean).astype(np.float64)


def step(weeks: int, *, at: int, ratio: float) -> Floats:
    """Return the effect of a change for good: 1 before week `at`, `ratio` from it on; shape (weeks, 1, 1)."""
    return np.where(np.arange(weeks) < at, 1.0, ratio)[:, None, None]


def trend(weeks: int, *, per_week: float) -> Floats:
    """Return the effect of a steady trend, (1 + per_week) to the power of the week; shape (weeks, 1, 1)."""
    return ((1 + per_week) ** np.arange(weeks, dtype=np.float64))[:, None, None]


FLOORS: Final[dict[str, World]] = {
    "independent days": World(Variation(day_sd=0.10)),
    "days correlated .4": World(Variation(day_sd=0.10, correlation=0.4)),
    "week sd .05": World(Variation(day_sd=0.10, week_sd=0.05)),
    "days correlated .3, week sd .10": World(Variation(day_sd=0.10, week_sd=0.10, correlation=0.3)),
    "office": World(OFFICE, weekdays=WEEKDAYS_OFFICE),
    "museum": World(MUSEUM),
}
"""Floors in which nothing changes: the judged week over week."""
LEVELS: Final[dict[str, World]] = {
    f"days correlated {c:g}, day sd .40": World(Variation(day_sd=0.40, correlation=c)) for c in (0.0, 0.15, 0.3, 0.6)
}
"""Floors whose level is judged."""
