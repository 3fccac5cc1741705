"""Prove verdicts in worlds unlike those of the other proofs: python tests/stats/prove_unlike_worlds.py --sites 1000.

Weeks that resemble the week before, days with heavy tails, a season, holidays, days of four times the violations,
cameras that fail on busy days: none of them is in `day_worlds` or `change_worlds`, and the method assumes none of them.
A change is logged at the area that had just been worst, too, as people do. Nothing changes in any of these worlds.
"""

from __future__ import annotations

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from change_worlds import Drawn, World
from prove_changes import LOG_E, effects, log_e

from vsd_analytics.stats.changes import compare_violation_rates

Floats = npt.NDArray[np.float64]

CLEAR: Final = {"clear_fall", "clear_rise"}
WEEK: Final = 7
HISTORY: Final = 12
OPEN_H: Final = 10.0
SEASON_WEEKS: Final = 26
VIOLATION_H: Final = 40 / 3600


@dataclass(frozen=True)
class Unlike:
    """How sites of a kind vary; sd are of log rates.

    Attributes:
        name: For the table.
        day_sd, day_lag, tails: Of days; their lag-1 correlation; degrees of freedom of Student's t, None = normal.
        week_sd, week_lag: Of weeks, and their lag-1 correlation.
        own_day_sd, own_week_sd, own_week_lag: The same of each area's own, where there are areas.
        season: Amplitude of a sine of 26 weeks with a phase of its own at each site.
        spike: Factor on one day of 28.
        is_with_holidays: One day of 40 has a tenth of its violations.
        closed: Share of days without an open hour.
        fails: How likely a camera misses much of a day, most on busy ones.
        down: Share of sites whose camera is down for three days in a row in one of the two weeks compared.
        per_week: Violations of an average week, of the floor or of each area.
        n_areas: Areas of a logged change; the first is changed.
        is_worst: The change is logged at the area whose last two weeks were worst beside its own mean.
    """

    name: str
    day_sd: float = 0.2
    day_lag: float = 0.0
    tails: float | None = None
    week_sd: float = 0.08
    week_lag: float = 0.0
    own_day_sd: float = 0.15
    own_week_sd: float = 0.06
    own_week_lag: float = 0.0
    season: float = 0.0
    spike: float = 1.0
    is_with_holidays: bool = False
    closed: float = 0.0
    fails: float = 0.0
    down: float = 0.0
    per_week: float = 1500.0
    n_areas: int = 8
    is_worst: bool = False


BASE: Final = Unlike("days and weeks independent")
MUSEUM: Final = Unlike("museum's sd", day_sd=0.4, week_sd=0.22, own_day_sd=0.25, own_week_sd=0.08)
BOTH: Final = (
    BASE,
    MUSEUM,
    Unlike("days correlated .6", day_lag=0.6),
    Unlike("days with tails of t with 3 degrees of freedom", tails=3.0),
    Unlike("season of 20 %", season=0.2),
)
OF_WEEKS: Final = (
    Unlike("weeks correlated .7, sd .15", week_sd=0.15, week_lag=0.7),
    replace(MUSEUM, name="museum's sd, days correlated .5", day_lag=0.5),
    Unlike("one day of 28 four times as bad", spike=4.0),
    Unlike("one day of 40 a holiday", is_with_holidays=True),
    Unlike("one day of 10 closed", closed=0.1),
    Unlike("cameras miss busy days", fails=0.3),
    Unlike("camera down for three days at 70 % of sites", down=0.7),
    Unlike("10 violations a week", per_week=10.0),
    Unlike("50,000 violations a week", per_week=50_000.0),
)
OF_CHANGES: Final = (
    Unlike("at the area that was worst", is_worst=True),
    replace(MUSEUM, name="museum's sd, at the area that was worst", is_worst=True),
    Unlike("areas' own weeks correlated .5, sd .10, at the worst", own_week_lag=0.5, own_week_sd=0.10, is_worst=True),
    Unlike("areas' own weeks correlated .7, sd .06", own_week_lag=0.7),
    Unlike("areas' own weeks correlated .5, sd .15", own_week_lag=0.5, own_week_sd=0.15),
    Unlike("areas' own weeks correlated .7, sd .15", own_week_lag=0.7, own_week_sd=0.15),
    Unlike("two areas", n_areas=2),
    Unlike("20,000 violations a week in each area", per_week=20_000.0),
)


def series(rng: np.random.Generator, shape: tuple[int, ...], *, sd: float, lag: float, tails: float | None) -> Floats:
    """Return AR(1) series along the last axis with a standard deviation and lag-1 correlation."""
    shocks = rng.normal(size=shape) if tails is None else rng.standard_t(tails, shape) * math.sqrt((tails - 2) / tails)
    found = shocks.copy()
    for k in range(1, shape[-1]):
        found[..., k] = lag * found[..., k - 1] + math.sqrt(1 - lag**2) * shocks[..., k]
    return sd * found


def shared_log_rates(world: Unlike, rng: np.random.Generator, *, sites: int, weeks: int) -> tuple[Floats, Floats]:
    """Return the days' effects alone and all that moves a whole site, each (sites, days)."""
    days = series(rng, (sites, WEEK * weeks), sd=world.day_sd, lag=world.day_lag, tails=world.tails)
    of_weeks = series(rng, (sites, weeks), sd=world.week_sd, lag=world.week_lag, tails=None)
    phase = rng.uniform(0, 2 * math.pi, (sites, 1))
    season = np.sin(2 * math.pi * np.arange(WEEK * weeks) / (WEEK * SEASON_WEEKS) + phase)
    return days, days + np.repeat(of_weeks, WEEK, axis=1) + world.season * season


def false_weeks(world: Unlike, sites: int) -> str:
    """Return the row of a world: how often the second of two weeks is called clearly other than the first."""
    rng = np.random.default_rng([1, *world.name.encode()])
    weeks = HISTORY + 2
    days, common = shared_log_rates(world, rng, sites=sites, weeks=weeks)
    weekdays = np.tile(np.exp(rng.normal(0, 0.3, (sites, WEEK))), (1, weeks))
    rate = world.per_week / WEEK * weekdays * np.exp(common)
    rate *= np.where(rng.random(rate.shape) < 1 / 28, world.spike, 1)
    if world.is_with_holidays:
        rate *= np.where(rng.random(rate.shape) < 1 / 40, 0.1, 1)
    recorded_h = np.where(rng.random(rate.shape) < world.closed, 0.0, OPEN_H)
    busy = 1 / (1 + np.exp(-2 * (days / world.day_sd - 1.5)))
    some_h = OPEN_H * rng.uniform(0.1, 0.6, rate.shape)
    recorded_h = np.where(rng.random(rate.shape) < 4 * world.fails * busy, np.minimum(some_h, recorded_h), recorded_h)
    for site in np.flatnonzero(rng.random(sites) < world.down):
        first = int(rng.integers(WEEK * HISTORY, WEEK * weeks - 3))
        recorded_h[site, first : first + 3] = 0
    n = rng.poisson(rate * recorded_h / OPEN_H).astype(float).reshape(sites, weeks, WEEK)
    x_h = recorded_h.reshape(n.shape)
    found = [
        compare_violation_rates(
            *(a[-2], b[-2]), *(a[-1], b[-1]), history_n=a[:-2, None], history_x_h=b[:-2, None]
        )
        for a, b in zip(n, x_h, strict=True)
    ]  # fmt: skip
    judged = [change for change in found if change.verdict != "too_little_data"]
    holds = [change.lo is not None and change.lo <= 1 <= (change.hi or math.inf) for change in judged]
    clear = [change.verdict in CLEAR for change in found]
    return f"| {world.name} | {sites} | {np.mean(clear):.1%} | {np.mean(holds):.1%} | {len(judged) / sites:.0%} |"


def logged(world: Unlike, sites: int, *, effect: float, seed: int) -> Drawn:
    """Return sites with a logged change after twelve weeks, and eight weeks after it."""
    rng = np.random.default_rng([seed, *world.name.encode()])
    kind = World(world.name, n_areas=world.n_areas, weeks_after=8, effect=effect)
    weeks = kind.weeks_before + kind.weeks_after
    shape = (sites, world.n_areas, WEEK * weeks)
    _, common = shared_log_rates(world, rng, sites=sites, weeks=weeks)
    own = series(rng, shape, sd=world.own_day_sd, lag=world.day_lag, tails=world.tails)
    own_weeks = series(rng, (*shape[:2], weeks), sd=world.own_week_sd, lag=world.own_week_lag, tails=None)
    level = np.exp(rng.normal(0, 0.6, shape[:2]))[..., None]
    weekdays = np.tile(np.exp(rng.normal(0, 0.3, (*shape[:2], WEEK))), (1, 1, weeks))
    expected = world.per_week / WEEK * level * weekdays
    rate = expected * np.exp(common[:, None] + own + np.repeat(own_weeks, WEEK, axis=2))
    cut = WEEK * kind.weeks_before
    if world.is_worst:
        worst = (rate[..., cut - 2 * WEEK : cut].mean(axis=2) / rate[..., :cut].mean(axis=2)).argmax(axis=1)
        order = np.tile(np.arange(world.n_areas), (sites, 1))
        order[np.arange(sites), worst], order[:, 0] = 0, worst
        rate = np.take_along_axis(rate, order[..., None], axis=1)
        expected = np.take_along_axis(expected, order[..., None], axis=1)
    rate[:, 0, cut:] *= effect
    n = rng.poisson(rate).astype(float)
    violation_h = np.zeros(shape)
    violation_h[n > 0] = rng.gamma(n[n > 0], VIOLATION_H)
    person_h = rng.gamma(20, 2, shape)
    return Drawn(kind, n, violation_h, person_h, expected, rate, np.ones(sites))


def false_changes(world: Unlike, sites: int) -> str:
    """Return the row of a world: what is claimed of an entry that did nothing, and how often a fall of 40 % is seen."""
    nothing, fell = logged(world, sites, effect=1.0, seed=2), logged(world, sites, effect=0.6, seed=3)
    once, running = effects(nothing), log_e(nothing).max(axis=1) >= LOG_E
    seen = (log_e(fell).max(axis=1) >= LOG_E).mean()
    clear = np.mean([e.verdict in CLEAR for e in once])
    holds = np.mean([e.lo is not None and e.lo <= 1 <= (e.hi or math.inf) for e in once])
    power = np.mean([e.verdict == "clear_fall" for e in effects(fell)])
    return f"| {world.name} | {sites} | {clear:.1%} | {holds:.1%} | {running.mean():.1%} | {power:.0%} | {seen:.0%} |"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=1000)
    n = parser.parse_args().sites
    with ProcessPoolExecutor(2) as pool:
        print("| nothing changes | sites | clear | range holds it | could be judged |\n|---|---|---|---|---|")
        for row in pool.map(false_weeks, (*BOTH, *OF_WEEKS), [n] * 99):
            print(row, flush=True)
        print(
            "\n| logged, and nothing changes | sites | before and after clear | holds it | running verdict ever clear",
            end="",
        )
        print(" | -40 % seen once | by the running verdict |\n|---|---|---|---|---|---|---|")
        for row in pool.map(false_changes, (*BOTH, *OF_CHANGES), [n] * 99):
            print(row, flush=True)


if __name__ == "__main__":
    main()
