"""Prove that ranges hold the truth when the crowd moves into a comparison area: python tests/stats/prove_spill.py.

The worlds are those of `change_worlds`. An area changes, and a share of the time too close that it loses moves into one
of the areas it is compared with (or, in the last column, all of it into two of them). For each number of comparison
areas: how often the range beside all of them together holds what was planted, and how often the range that is given
does, which leaves each area out in turn. Running verdict after four weeks; before and after with four weeks a side.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from change_worlds import MUSEUM, OFFICE, SHOP, Drawn, World, draw

from vsd_analytics.stats.before_after import BeforeAfter, before_after
from vsd_analytics.stats.running_verdict import RunningVerdict, running_verdict

SPILLS = ((0.0, 0), (0.25, 1), (0.5, 1), (1.0, 1), (1.0, 2))
"""Share of the lost time too close that moves, and into how many comparison areas."""
N_AREAS = (1, 2, 3, 4, 8)
WEEKS = 4


def running(drawn: Drawn) -> list[RunningVerdict]:
    """Return the running verdicts of drawn sites, as `vsd_analytics.figures.change_verdicts` makes them."""
    cut = drawn.world.weeks_before
    weeks = drawn.violation_h.reshape(*drawn.violation_h.shape[:2], -1, 7).sum(axis=3)
    found = []
    for own, others in zip(np.log(weeks[:, 0]), weeks[:, 1:], strict=True):
        sums = [others.sum(axis=0), *(others.sum(axis=0) - other for other in others)]
        ys = [own - (np.log(v) if v.any() else 0.0) for v in sums]
        (y, *without) = ((y[:cut], y[cut:]) for y in ys)
        found.append(running_verdict(*y, without=without))
    return found


def once(drawn: Drawn) -> list[BeforeAfter]:
    """Return before and after of drawn sites, with all weeks before as history."""
    cut = drawn.world.weeks_before
    return [
        before_after(
            drawn.period(k, cut - WEEKS, cut), drawn.period(k, cut, cut + WEEKS), history=drawn.period(k, 0, cut)
        )
        for k in range(len(drawn.n))
    ]


def row(world: World, n: int) -> str:
    """Return the table's row of a world: coverage beside all areas, and of the range given."""
    cells, widths = [], []
    for share, n_into in SPILLS:
        if n_into >= world.n_areas:
            cells.append("–")
            continue
        drawn = draw(world.but(spill=(share, n_into)), n, 11)
        found, others = running(drawn), once(drawn)
        theta = world.effect
        held = np.mean([(f.all_lo or 0) <= theta <= (f.all_hi or np.inf) for f in found])
        given = np.mean([(f.lo or 0) <= theta <= (f.hi or np.inf) for f in found])
        compared = np.mean([(f.lo or 0) <= theta <= (f.hi or np.inf) for f in others])
        cells.append(f"{held:.0%} → {given:.0%}; {compared:.0%}")
        if not n_into:
            each = [np.log(f.hi / f.lo) / np.log(f.all_hi / f.all_lo) for f in found if f.lo and f.hi and f.all_lo]
            widths.append(f"{np.median(each):.2f}")
    return f"| {world.name} | {world.effect - 1:+.0%} | {world.n_areas - 1} | {' | '.join([*cells, *widths])} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=400)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    shares = [f"{share:.0%} into {n}" if n else "stays away" for share, n in SPILLS]
    columns = ["site", "truth", "comparison areas", *shares, "width"]
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    worlds = [w.but(n_areas=k + 1, effect=e) for e in (0.2, 0.7) for w in (OFFICE, SHOP, MUSEUM) for k in N_AREAS]
    with ProcessPoolExecutor(options.jobs) as pool:
        for line in pool.map(partial(row, n=options.sites), worlds):
            print(line, flush=True)


if __name__ == "__main__":
    main()
