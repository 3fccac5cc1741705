"""Dwell times from cut tracks against their truth: bias and coverage of intervals, beside the naive figure.

    python tests/stats/prove_dwell.py --sites 500

Naive: the median and 90 % quantile of all pieces of tracks, as if each were a visit. Table in docs/statistics.md.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from visit_worlds import WORLDS, see

from vsd_analytics.stats.dwell import dwell

LIMIT_S = 120.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=500)
    asked = parser.parse_args()
    print(
        "| world | days | median: bias, covered, naive | 90 %: bias, covered, naive | longer than 2 min: covered | Little: disagrees |"
    )
    print("|---|---|---|---|---|---|")
    for world in WORLDS:
        median, p90, share, mean = world.truth(LIMIT_S)
        for n_days in (7, 28):
            values, held, naive, disagrees, unknown, no_share = [], [], [], 0, 0, 0
            for seed in range(asked.sites):
                seen = see(world, n_days=n_days, seed=seed)
                found = dwell(seen.dwell_s, seen.is_cut, seen.day, person_s=seen.person_s, long_s=LIMIT_S)
                quantiles = (found.median, found.p90)
                values.append([q.value_s if q.value_s is not None else np.nan for q in quantiles])
                held.append(
                    [
                        (q.lo_s or 0) <= t and (q.hi_s is None or t <= q.hi_s)
                        for q, t in zip(quantiles, (median, p90), strict=True)
                    ]
                    + [found.long_share.lo is None or found.long_share.lo <= share <= (found.long_share.hi or 0)]
                )
                no_share += found.long_share.value is None
                naive.append(np.quantile(seen.pieces_s, [0.5, 0.9]))
                disagrees += found.little.agrees is False
                unknown += found.little.agrees is None
            bias = np.nanmedian(values, axis=0) / (median, p90) - 1
            off = np.median(naive, axis=0) / (median, p90) - 1
            ok = np.mean(held, axis=0)
            lost = np.isnan(values).mean(axis=0)
            print(
                f"| {world.name} | {n_days} | {bias[0]:+.0%}, {ok[0]:.1%}, {off[0]:+.0%} | "
                f"{bias[1]:+.0%}, {ok[1]:.1%}, {off[1]:+.0%}{f' (unknown in {lost[1]:.0%})' if lost[1] else ''} | {ok[2]:.1%}{f' (unknown in {no_share / asked.sites:.0%})' if no_share else ''} | "
                f"{disagrees / asked.sites:.1%}{f' (unknown {unknown / asked.sites:.0%})' if unknown else ''} |"
            )


if __name__ == "__main__":
    main()
