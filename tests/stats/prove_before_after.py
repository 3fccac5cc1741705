"""Prove effect, day and placebo interval of before/after: python tests/stats/prove_before_after.py --sites 2000.

Each site has twelve areas. An area's rate per person-hour is its own (log sd .3), times a shock of the site's day,
times a shock of its own day, times a profile of weekdays of its own; violations are Poisson on top. Nothing else
happens at the change but, in the rows that say so, a true effect in one area.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from vsd_analytics.stats.before_after import BeforeAfter, before_after
from vsd_analytics.stats.period_days import PeriodDays

N_AREAS = 12
AREA_SD, WEEKDAY_SD = 0.3, 0.15
EPISODES_PER_WEEK = 150.0
"""Violations an average area has in a week."""


@dataclass(frozen=True)
class World:
    """One row of the table."""

    weeks_before: int
    weeks_after: int
    site_day_sd: float
    area_day_sd: float
    effect: float = 1.0
    worst: bool = False


WORLDS = [
    World(b, a, site_sd, area_sd, effect)
    for b, a in ((1, 1), (4, 4), (8, 2))
    for site_sd, area_sd in ((0.1, 0.05), (0.25, 0.1), (0.25, 0.25))
    for effect in (1.0, 0.7)
] + [World(b, a, 0.25, 0.25, worst=True) for b, a in ((1, 1), (4, 4))]


def draw(world: World, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return violations and person-hours, shape (n_areas, n_days), of a site whose area 0 changes by `effect`."""
    n_days = 7 * (world.weeks_before + world.weeks_after)
    weekday = np.arange(n_days) % 7
    base = np.exp(rng.normal(0, AREA_SD, N_AREAS))
    profile = np.exp(rng.normal(0, WEEKDAY_SD, (N_AREAS, 7)))[:, weekday]
    shock = np.exp(rng.normal(0, world.site_day_sd, n_days) + rng.normal(0, world.area_day_sd, (N_AREAS, n_days)))
    busy = np.array([0.9, 0.85, 0.9, 1.0, 1.2, 1.4, 0.75])[weekday]
    exposure_h = 40 * busy * np.exp(rng.normal(0, 0.15, n_days)) * np.exp(rng.normal(0, 0.1, (N_AREAS, n_days)))
    rate = EPISODES_PER_WEEK / 280 * base[:, None] * profile * shock
    rate[0, 7 * world.weeks_before :] *= world.effect
    return rng.poisson(rate * exposure_h).astype(float), exposure_h


def estimate(world: World, seed: int) -> BeforeAfter:
    """Return the estimate of one drawn site; where `worst`, of the area with the highest rate before."""
    n, x_h = draw(world, np.random.default_rng([seed, hash_of(world)]))
    cut = 7 * world.weeks_before
    chosen = int(np.argmax(n[:, :cut].sum(axis=1) / x_h[:, :cut].sum(axis=1))) if world.worst else 0
    others = np.arange(N_AREAS) != chosen
    days = np.arange(n.shape[1])

    def period(where: slice) -> PeriodDays:
        return PeriodDays(
            n[chosen, where],
            x_h[chosen, where],
            n[others, where],
            x_h[others, where],
            days[where] % 7,
            days[where] // 7,
        )

    return before_after(period(slice(0, cut)), period(slice(cut, None)))


def hash_of(world: World) -> int:
    """Return a number of a world that is the same in every process."""
    return sum(int(1000 * v) * 7**i for i, v in enumerate((world.weeks_before, world.weeks_after, world.site_day_sd)))


def row(world: World, n_sites: int) -> str:
    """Return the table's row of one world."""
    found = [e for e in (estimate(world, s) for s in range(n_sites)) if e.value is not None]
    lo, hi = (np.array([getattr(e, k) for e in found]) for k in ("day_lo", "day_hi"))
    covered = np.mean((lo <= world.effect) & (world.effect <= hi))
    clear = np.mean(hi < 1)
    placebo = np.mean([e.placebo_lo <= world.effect <= e.placebo_hi for e in found if e.placebo_lo is not None])
    naive = np.exp(np.mean(np.log([e.value for e in found]))) - 1
    shrunken = np.exp(np.mean([np.log(e.shrunken.value) for e in found if e.shrunken is not None])) - 1
    alone = np.exp(np.mean([np.log(e.alone) for e in found])) - 1
    what = (
        "worst of 12, no change" if world.worst else ("no change" if world.effect == 1 else f"{world.effect - 1:+.0%}")
    )
    return (
        f"| {world.weeks_before}+{world.weeks_after} | {world.site_day_sd:g} / {world.area_day_sd:g} | {what} "
        f"| {len(found)} | {covered:.1%} | {clear:.1%} | {placebo:.1%} "
        f"| {alone:+.1%} | {naive:+.1%} | {shrunken:+.1%} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=2000)
    arguments = parser.parse_args()
    columns = ["weeks", "day sd site / area", "truth", "sites", "95 % interval covers", "says clear fall"]
    columns += ["placebo interval covers", "area alone", "estimate", "shrunken"]
    print(f"| {' | '.join(columns)} |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    with ProcessPoolExecutor(2) as pool:
        for line in pool.map(partial(row, n_sites=arguments.sites), WORLDS):
            print(line, flush=True)


if __name__ == "__main__":
    main()
