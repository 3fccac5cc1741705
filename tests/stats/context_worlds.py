"""Sites whose days depend on what happens around them: made-up years of weather, visitors, sales and violations.

Not the demo's simulator: nobody walks here. Of day d,

    temperature   9 + 9 cos(2 pi (d - 200)/365) + w_d degC, w an AR(1) series, sd 3.5, correlation .7
    visitors      Poisson around 800 profile_d season_d exp(v_d), v an AR(1) series, sd .25, correlation .5
    violations    negative binomial around 60 profile_d season'_d exp(s_d + effect), s an AR(1) series of their own

and sales are tickets of visitors, a quarter of them, more on some days than on others. Seasons of visitors and of
violations are drawn apart, so that both drift without one doing anything to the other. Public holidays, eight a year,
are closed days.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from day_worlds import WEEKDAYS_SHOP

Floats = npt.NDArray[np.float64]

N_WEEKS: Final = 52
OPEN_H: Final = 10.0
BOUGHT: Final = 0.25
"""Share of visitors who buy a ticket, on average."""


@dataclass(frozen=True, slots=True)
class ContextWorld:
    """How violations depend on what happens around.

    Attributes:
        name: For the table.
        per_degree: Change of log violations for a degree.
        elasticity: Change of log violations for one of log visitors.
        day_sd: Spread of days by what nobody sees.
        correlation: Of a day's own part with that of the day before.
        season_sd: Spread of the season's height of violations.
        week_sd: Spread of weeks beyond their days.
        violations_day: On an average day.
        layout: Ratio of violations from the last week on: what a change of the room does.
    """

    name: str
    per_degree: float = 0.0
    elasticity: float = 0.0
    day_sd: float = 0.2
    correlation: float = 0.5
    season_sd: float = 0.25
    week_sd: float = 0.0
    violations_day: float = 60.0
    layout: float = 1.0


@dataclass(frozen=True, slots=True)
class Drawn:
    """Years of sites; arrays have the shape (n_sites, 52, 7), Monday first."""

    violations: Floats
    x_h: Floats
    temperature: Floats
    visitors: Floats
    tickets: Floats


def _series(rng: np.random.Generator, n_sites: int, *, sd: float, correlation: float) -> Floats:
    """Return an AR(1) series over the days of a year."""
    made = np.empty((n_sites, 7 * N_WEEKS))
    made[:, 0] = rng.normal(size=n_sites)
    for d in range(1, made.shape[1]):
        made[:, d] = correlation * made[:, d - 1] + (1 - correlation**2) ** 0.5 * rng.normal(size=n_sites)
    return sd * made


def draw(world: ContextWorld, n_sites: int, seed: int, *, layout_from: int = N_WEEKS - 1) -> Drawn:
    """Return made-up years.

    Args:
        world: The rules.
        n_sites: Sites.
        seed: Of the generator.
        layout_from: First week with `layout`.
    """
    rng = np.random.default_rng(seed)
    day = np.arange(7 * N_WEEKS)
    profile = np.tile(np.array(WEEKDAYS_SHOP) * 7, N_WEEKS)

    def season(sd: float) -> Floats:
        height, at = rng.normal(0, sd, (n_sites, 1)), rng.uniform(0, 365, (n_sites, 1))
        return np.exp(height * np.cos(2 * np.pi * (day - at) / 365))

    temperature = 9 + 9 * np.cos(2 * np.pi * (day - 200) / 365) + _series(rng, n_sites, sd=3.5, correlation=0.7)
    is_closed = np.zeros((n_sites, len(day)), dtype=np.bool_)
    for k in range(n_sites):
        is_closed[k, rng.choice(len(day), 8, replace=False)] = True
    expected = 800 * profile * season(0.2) * np.exp(_series(rng, n_sites, sd=0.25, correlation=0.5))
    visitors = np.maximum(rng.poisson(expected), 1).astype(np.float64)
    mean = world.violations_day * profile * season(world.season_sd)
    mean *= np.exp(_series(rng, n_sites, sd=world.day_sd, correlation=world.correlation))
    mean *= np.repeat(np.exp(rng.normal(0, world.week_sd, (n_sites, N_WEEKS))), 7, axis=1)
    mean *= np.exp(world.per_degree * (temperature - 9)) * (visitors / 800) ** world.elasticity
    mean *= np.where(day // 7 >= layout_from, world.layout, 1.0)
    violations = rng.negative_binomial(20, 20 / (20 + mean)).astype(np.float64)
    share = BOUGHT * np.exp(_series(rng, n_sites, sd=0.1, correlation=0.5) - 0.005)
    tickets = rng.binomial(visitors.astype(np.int64), np.minimum(share, 1.0)).astype(np.float64)

    def weeks(values: Floats) -> Floats:
        return np.where(is_closed, 0.0, values).reshape(n_sites, N_WEEKS, 7)

    x_h = weeks(np.full((n_sites, len(day)), OPEN_H))
    unknown = np.where(is_closed, np.nan, visitors).reshape(n_sites, N_WEEKS, 7)
    return Drawn(weeks(violations), x_h, temperature.reshape(x_h.shape), unknown, weeks(tickets))
