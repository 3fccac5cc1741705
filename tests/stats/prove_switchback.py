"""Prove days in turn: python tests/stats/prove_switchback.py --worlds 2000.

Sites of eight areas (`day_worlds`), of which one has a change on days that a coin chose, in pairs of one weekday in two
weeks. Every place has days of its own besides, which resemble the day before; violations last a random time. The table
of docs/methods: how often nothing is called clear, how often a fall of 30 % is, how often the interval holds the
truth, and the power that 12 earlier weeks of each site promise.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from stats.day_worlds import MUSEUM, OFFICE, WEEKDAYS_OFFICE, Floats, Variation, World, day_effects

from vsd_analytics.stats.switchback import log_effects, switchback_power

CHANGED = 3
"""Of the areas: it has 11 % of the violations."""
PAST_WEEKS = 12


@dataclass(frozen=True)
class Kind:
    """A kind of site: how it differs, the own days of each place, and what its changed area feels alone."""

    world: World
    own_sd: float = 0.2
    correlation: float = 0.0
    season: float = 0.0
    weekday_sd: float = 0.0
    carry_over: float = 0.0


SHOP = World(Variation(day_sd=0.2, week_sd=0.1, correlation=0.2)).with_areas()
QUIET = replace(SHOP, violations_week=150.0)
NULL = {
    "days of an area independent": Kind(SHOP, own_sd=0.4),
    "correlated .4": Kind(SHOP, own_sd=0.4, correlation=0.4),
    "correlated .6": Kind(SHOP, own_sd=0.4, correlation=0.6),
    "a season that the area alone feels": Kind(SHOP, own_sd=0.2, correlation=0.4, season=0.7),
    "weekdays of the area's own": Kind(SHOP, own_sd=0.2, correlation=0.4, weekday_sd=0.5),
    "two violations a day": Kind(QUIET, own_sd=0.2, correlation=0.4),
}
SITES = {
    "office": Kind(World(OFFICE, weekdays=WEEKDAYS_OFFICE).with_areas(), own_sd=0.2, correlation=0.3),
    "shop": Kind(SHOP, own_sd=0.3, correlation=0.3),
    "museum": Kind(World(MUSEUM).with_areas(), own_sd=0.4, correlation=0.3),
    "shop, two violations a day": Kind(QUIET, own_sd=0.3, correlation=0.3),
    "shop, 30 % of the effect stays a day": Kind(SHOP, own_sd=0.3, correlation=0.3, carry_over=0.3),
}


def drawn(kind: Kind, rng: np.random.Generator, *, sites: int, weeks: int, theta: float) -> tuple[Floats, Floats]:
    """Return pairs of days with and without the change, and pairs of the twelve weeks before it.

    Returns:
        Violation time per open hour over that of the other areas, of shapes (sites, n_pairs, 2); the second of days in
        successive weeks.
    """
    world, n_days, all_weeks = kind.world, kind.world.n_days, PAST_WEEKS + weeks
    size = (sites, all_weeks, len(world.shares), n_days)
    own = np.stack(
        [
            day_effects(rng, sites=sites, days=all_weeks * n_days, sd=kind.own_sd, correlation=kind.correlation)
            for _ in world.shares
        ],
        axis=1,
    )
    effect = np.exp(own.reshape(sites, len(world.shares), all_weeks, n_days).transpose(0, 2, 1, 3))
    phase = rng.uniform(0, 2 * np.pi, sites)
    season = np.sin(phase[:, None] + 2 * np.pi * np.arange(all_weeks) / 13)
    effect[:, :, CHANGED] *= np.exp(kind.season * season)[..., None]
    effect[:, :, CHANGED] *= np.exp(kind.weekday_sd * rng.standard_normal((sites, 1, n_days)))
    is_with = np.zeros((sites, all_weeks, n_days), dtype=bool)
    first = rng.random((sites, weeks // 2, n_days)) < 0.5
    is_with[:, PAST_WEEKS::2], is_with[:, PAST_WEEKS + 1 :: 2] = first, ~first
    dose = is_with.astype(float)
    flat = dose.reshape(sites, -1)
    flat[:, 1:] = np.maximum(flat[:, 1:], kind.carry_over * flat[:, :-1])
    effect[:, :, CHANGED] *= theta ** flat.reshape(dose.shape)
    n = world.draw(rng, sites=sites, weeks=all_weeks, effect=effect).n
    assert n.shape == size
    time = rng.gamma(np.maximum(n, 1e-9))  # each violation lasts an exponential time
    time[n == 0] = 0.0
    others = np.delete(time, CHANGED, axis=2).sum(axis=2)
    is_beside = (others > 0).all(axis=(1, 2), keepdims=True)  # else the area by itself
    y = time[:, :, CHANGED] / np.where(is_beside, others, 1.0)
    test, with_it = y[:, PAST_WEEKS:], is_with[:, PAST_WEEKS:]
    a, b, a_first = test[:, ::2], test[:, 1::2], with_it[:, ::2]
    pairs = np.stack([np.where(a_first, a, b), np.where(a_first, b, a)], axis=-1)
    past = np.stack([y[:, : PAST_WEEKS - 1], y[:, 1:PAST_WEEKS]], axis=-1)
    return pairs.reshape(sites, -1, 2), past.reshape(sites, -1, 2)


def main() -> None:
    """Print the two tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=2000)
    parser.add_argument("--promised", type=int, default=100, help="worlds whose power is foretold")
    args = parser.parse_args()
    print("| nothing changed | clear, 4 weeks | 6 weeks | 8 weeks |\n| --- | --- | --- | --- |")
    for name, kind in NULL.items():
        cells = []
        for weeks in (4, 6, 8):
            rng = np.random.default_rng([1, weeks, list(NULL).index(name)])
            y, _ = drawn(kind, rng, sites=args.worlds, weeks=weeks, theta=1.0)
            _, lo, hi, p = log_effects(y, confidence=0.95)
            is_clear = (lo > 0) | (hi < 0)
            assert (is_clear == (p <= 0.05)).mean() > 0.999
            cells.append(f"{is_clear.mean():.1%}")
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
    print("| a fall of 30 % | clear, 4 weeks | 6 weeks | 8 weeks | promised | interval holds it | measured |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, kind in SITES.items():
        power, promised, covered, measured = [], [], [], []
        for weeks in (4, 6, 8):
            rng = np.random.default_rng([2, weeks, list(SITES).index(name)])
            y, past = drawn(kind, rng, sites=args.worlds, weeks=weeks, theta=0.7)
            value, lo, hi, _ = log_effects(y, confidence=0.95)
            power.append(f"{(hi < 0).mean():.0%}")
            covered.append(f"{((lo <= np.log(0.7)) & (hi >= np.log(0.7))).mean():.1%}")
            measured.append(f"{np.expm1(np.median(value)):+.0%}")
            few = range(min(args.promised, args.worlds))
            promised.append(f"{np.mean([switchback_power(past[k], 0.7, n_pairs=y.shape[1]).power for k in few]):.0%}")
        cells = [*power, ", ".join(promised), ", ".join(covered), ", ".join(measured)]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
