"""Prove links over blind floor where people come in waves: python tests/stats/prove_links.py --sites 200.

People leave an area into a blind hall: 40 % walk 8 m to a shop, 20 % 12 m to a cafe, the others leave the building.
Beside them others begin in view at the shop who were never in that area. Both come one by one (a Poisson stream), or in
waves: Poisson clusters of six people on average within 20 s, as out of a lift. Waves of the two are independent, or of
one cause: at the same time, or at the shop some seconds later than at the area, as where a lecture ends and two doors
open. `no walk`: nobody goes to the shop, and any link there is false.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.track_links import LinkedShare, TrackEnds, link_counts, linked_share

Array = npt.NDArray[np.float64]
DAY_S: Final = 4 * 3600.0
N_DAYS: Final = 7
PER_HOUR: Final = 60.0
WAVE_PEOPLE, WAVE_S = 6.0, 20.0
AREA, SHOP, CAFE = range(3)
AWAY_M: Final = {SHOP: 8.0, CAFE: 12.0}
LEAVES_S: Final = 10.0
"""Standard deviation of how long people of a wave take to the edge of the hall, beside the wave's own 20 s."""


@dataclass(frozen=True)
class LinkWorld:
    """How people come.

    Attributes:
        walk_share: Share of those who leave the area and walk to the shop.
        others_per_h: People who begin at the shop and were not in the area.
        is_wave: Those of the area come in waves.
        others: Those who begin at the shop come one by one, in waves of their own, or in those of the area.
        later_s: How much later waves of the area reach the shop, when they are of one cause.
        wave_people: People in a wave on average, at the area and at the shop.
    """

    walk_share: float = 0.4
    others_per_h: float = 30.0
    is_wave: bool = True
    others: str = "waves"
    later_s: float = 0.0
    wave_people: float = WAVE_PEOPLE


WORLDS: Final = {
    "one by one": LinkWorld(is_wave=False, others="one by one"),
    "the area in waves": LinkWorld(others="one by one"),
    "the shop in waves": LinkWorld(is_wave=False),
    "both in waves of their own": LinkWorld(),
    "both in waves of twenty": LinkWorld(wave_people=20.0),
    "both in couples": LinkWorld(wave_people=1.0),
    "both in waves of three": LinkWorld(wave_people=3.0),
    "one cause, couples, shop 6 s later": LinkWorld(others="same", later_s=6.0, wave_people=1.0),
    "one cause, at the same time": LinkWorld(others="same"),
    "one cause, shop 6 s later": LinkWorld(others="same", later_s=6.0),
    "one cause, shop 30 s later": LinkWorld(others="same", later_s=30.0),
}


def one_by_one(rng: np.random.Generator, per_h: float) -> Array:
    """Return the instants of a Poisson stream of one day."""
    return rng.uniform(0, DAY_S, rng.poisson(per_h * DAY_S / 3600))


def in_waves(rng: np.random.Generator, per_h: float, centres: Array) -> Array:
    """Return instants of people around the middles of waves, as many as the rate says on average."""
    mean = per_h * DAY_S / 3600 / max(len(centres), 1)
    return np.repeat(centres, rng.poisson(mean, len(centres))) + 0.0


def link_world(world: LinkWorld, rng: np.random.Generator) -> LinkedShare:
    """Return the share of those who leave the area that is linked to the shop, of one week."""
    ended, began, areas, days_end, days_start = [], [], [], [], []
    left = np.zeros(N_DAYS)
    for d in range(N_DAYS):
        centres = one_by_one(rng, PER_HOUR / world.wave_people)
        leaving = in_waves(rng, PER_HOUR, centres) if world.is_wave else one_by_one(rng, PER_HOUR)
        if world.is_wave:
            leaving = leaving + rng.uniform(0, WAVE_S, len(leaving)) + rng.normal(0, LEAVES_S, len(leaving))
        own = one_by_one(rng, world.others_per_h / world.wave_people)
        if world.others == "one by one":
            others = one_by_one(rng, world.others_per_h)
        else:
            others = in_waves(rng, world.others_per_h, centres + world.later_s if world.others == "same" else own)
            others = others + rng.uniform(0, WAVE_S, len(others)) + rng.normal(0, LEAVES_S, len(others))
        to = rng.choice([SHOP, CAFE, -1], len(leaving), p=[world.walk_share, 0.2, 0.8 - world.walk_share])
        away_m = np.select([to == SHOP, to == CAFE], [AWAY_M[SHOP], AWAY_M[CAFE]], 1.0)
        takes_s = away_m / np.clip(rng.normal(1.34, 0.26, len(leaving)), 0.6, 2.2)
        ended.append(leaving)
        days_end.append(np.full(len(leaving), d))
        came = np.flatnonzero(to >= 0)
        began.append(np.concatenate((leaving[came] + takes_s[came], others)))
        areas.append(np.concatenate((to[came], np.full(len(others), SHOP))))
        days_start.append(np.full(len(began[-1]), d))
        left[d] = len(leaving)
    end_day, start_day, area = (np.concatenate(v).astype(np.int64) for v in (days_end, days_start, areas))
    zeros = np.zeros(len(end_day))
    ends = TrackEnds(
        np.concatenate(ended) + end_day * 86400, zeros, zeros, zeros.astype(np.int64), zeros.astype(np.int64), end_day
    )
    is_shop = area == SHOP
    starts = TrackEnds(
        np.concatenate(began) + start_day * 86400,
        np.where(is_shop, AWAY_M[SHOP], 0.0),
        np.where(is_shop, 0.0, AWAY_M[CAFE]),
        area,
        np.ones(len(area), dtype=np.int64),
        start_day,
    )
    counts = link_counts(ends, starts, n_areas=3, n_days=N_DAYS)
    return linked_share(counts, AREA, SHOP, left)


def row(world: LinkWorld, n_sites: int, *, make: Callable[..., LinkedShare] = link_world) -> str:
    """Return the cells of a world: bias, coverage and unknown with people who walk, and what is said without any."""
    walked = [make(world, np.random.default_rng([s, 1])) for s in range(n_sites)]
    known = [f for f in walked if f.value is not None and f.lo is not None and f.hi is not None]
    chance = np.mean([f.n_chance / f.n for f in walked])
    none = [make(replace(world, walk_share=0.0), np.random.default_rng([s, 2])) for s in range(n_sites)]
    said = np.mean([(f.lo or 0.0) > 0 for f in none])
    value = np.mean([f.value or 0.0 for f in none])
    if not known:
        return f"unknown | - | {chance:.0%} | {said:.1%} | {value:.3f}"
    bias = np.mean([(f.value or 0.0) / world.walk_share - 1 for f in known])
    held = np.mean([(f.lo or 0.0) <= world.walk_share <= (f.hi or 0.0) for f in known])
    unknown = f" (unknown in {1 - len(known) / n_sites:.0%})" if len(known) < n_sites else ""
    return f"{bias:+.0%} | {held:.1%}{unknown} | {chance:.0%} | {said:.1%} | {value:.3f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=200)
    asked = parser.parse_args()
    print("| world | share 40 %: bias | covered | given a start by chance | nobody walks: a link is said | its share |")
    print("|---|---|---|---|---|---|")
    for others in (30.0, 60.0):
        for name, world in WORLDS.items():
            found = row(replace(world, others_per_h=others), asked.sites)
            print(f"| {name}, {others:.0f} others an hour | {found} |", flush=True)


if __name__ == "__main__":
    main()
