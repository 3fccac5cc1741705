"""Prove the comparison of sites: python tests/stats/prove_sites.py --worlds 1000.

Each world goes through `compare_sites`, as the JSON files of its sites would: 40 sites of different sizes, opening
hours, crowding, days and weeks (`site_worlds`), of which four differ or none. Beside it stands the naive reading: the
four sites with the highest (or lowest) share of time too close.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from stats.site_worlds import LAST, SiteWorld, raw_rates, site_floors

from vsd_analytics.site_index.site_comparison import compare_sites


@dataclass(frozen=True)
class Found:
    """What one world showed.

    Attributes:
        is_false: Some site that does not differ was named.
        power: Share of the sites that differ which were named.
        is_dead_named: The site without its camera in most weeks was named.
        covered: Share of ranges that hold the truth, of all sites and of the named that differ.
        naive: Share of the sites a league table points at that truly differ.
        is_naive_dead: The site without its camera is named when nobody looks at the cameras.
        usual_sd: Estimated.
    """

    is_false: bool
    power: float
    is_dead_named: bool
    covered: tuple[float, float]
    naive: float
    is_naive_dead: bool
    usual_sd: float


def one(world: SiteWorld, seed: int) -> Found:
    """Return what one world shows."""
    floors, ratios = site_floors(world, _rng(world, seed))
    compared = compare_sites(floors, LAST)
    assert compared is not None
    number = {f"site-{k:02d}": k for k in range(world.n_sites)}
    named = np.zeros(world.n_sites, dtype=bool)
    does_differ = np.arange(world.n_sites) < len(world.effects)
    covered, covered_named = [], []
    for floor in compared.floors:
        k = number[floor.key.site_id]
        named[k] = floor.differs
        if floor.said is not None:
            holds = np.log(floor.said.lo) <= ratios[k] <= np.log(floor.said.hi)
            covered.append(holds)
            if floor.differs and does_differ[k]:
                covered_named.append(holds)
    rates = raw_rates(floors)
    n = max(len(world.effects), 4)
    pointed = np.argsort(rates)[[*range(n // 2), *range(-n // 2, 0)]]
    unseen = False
    if world == PLANTED:
        without = compare_sites(site_floors(world, _rng(world, seed), says_gaps=False)[0], LAST)
        assert without is not None
        unseen = any(f.differs and number[f.key.site_id] == world.n_sites - 1 for f in without.floors)
    return Found(
        is_false=bool(named[~does_differ].any()),
        power=float(named[does_differ].mean()) if world.effects else np.nan,
        is_dead_named=bool(named[-1]) and world.has_gaps,
        covered=(
            float(np.mean(covered)) if covered else np.nan,
            float(np.mean(covered_named)) if covered_named else np.nan,
        ),
        naive=float(does_differ[pointed].mean()),
        is_naive_dead=unseen,
        usual_sd=compared.usual_sd or np.nan,
    )


def _rng(world: SiteWorld, seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, world.n_sites, round(world.own_sd * 1000)])


PLANTED = SiteWorld()
TWICE = (2.0, 2.0, 0.5, 0.5)
WORLDS: dict[str, SiteWorld] = {
    "four differ, others alike": replace(PLANTED, own_sd=0.0),
    "four differ, own sd .05": PLANTED,
    "four differ, own sd .10": replace(PLANTED, own_sd=0.10),
    "four differ, calm sites": replace(PLANTED, day_sd=(0.1, 0.2), week_sd=(0.0, 0.1)),
    "four differ, museums": replace(PLANTED, day_sd=(0.4, 0.4), week_sd=(0.22, 0.22)),
    "four differ by two": replace(PLANTED, effects=TWICE),
    "four differ by two, own sd .10": replace(PLANTED, effects=TWICE, own_sd=0.10),
    "four differ by two, museums": replace(PLANTED, effects=TWICE, day_sd=(0.4, 0.4), week_sd=(0.22, 0.22)),
    "none differs, only crowding": replace(PLANTED, effects=(), own_sd=0.0, has_gaps=False),
    "none differs, own sd .05": replace(PLANTED, effects=(), has_gaps=False),
    "none differs, own sd .10": replace(PLANTED, effects=(), own_sd=0.10, has_gaps=False),
    "none differs, one week each": replace(PLANTED, effects=(), has_gaps=False, n_weeks=(1, 1)),
    "none differs, six sites": replace(PLANTED, effects=(), has_gaps=False, n_sites=6),
    "one of six differs": replace(PLANTED, effects=(1.5,), has_gaps=False, n_sites=6),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=1000)
    parser.add_argument("--only", default="", help="Rows whose name holds this.")
    asked = parser.parse_args()
    n = asked.worlds
    print(
        "| world | worlds with a false name | those that differ named | ranges that hold the truth: all / named "
        "| site without its camera named | the same where nobody looks at cameras "
        "| league table's extremes that differ |"
    )
    print("|---|---|---|---|---|---|---|")
    with ProcessPoolExecutor(2) as pool:
        for name, world in ((k, w) for k, w in WORLDS.items() if asked.only in k):
            found = list(pool.map(partial(one, world), range(n), chunksize=8))
            false, power, dead, naive, blind = (
                np.mean([getattr(f, of) for f in found])
                for of in ("is_false", "power", "is_dead_named", "naive", "is_naive_dead")
            )
            held, held_named = (np.mean([v for f in found if not np.isnan(v := f.covered[k])] or [0]) for k in (0, 1))
            gaps = f"{dead:.1%}" if world.has_gaps else "–"
            gaps += f" | {blind:.0%}" if world == PLANTED else " | –"
            has = bool(world.effects)
            print(
                f"| {name} | {false:.1%} | {f'{power:.0%}' if has else '–'} "
                f"| {held:.0%} / {f'{held_named:.0%}' if has else '–'} | {gaps} | {f'{naive:.0%}' if has else '–'} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
