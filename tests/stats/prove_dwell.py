"""Dwell times from cut tracks against their truth: bias and coverage of intervals, beside the naive figure.

    python tests/stats/prove_dwell.py --sites 500

Naive: the quantiles of all pieces of tracks, as if each were a visit. The table is in docs/methods/visits-and-flow.md.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from visit_worlds import WORLDS, World, see

from vsd_analytics.stats.dwell import dwell

LIMIT_S = 120.0
HEAD = (
    "world",
    "days",
    "median: bias, covered",
    "naive",
    "90 %: bias, covered",
    "naive",
    "share over 2 min: covered",
    "Little disagrees",
)


def row(world: World, *, n_days: int, n_sites: int) -> tuple[str, ...]:
    """Return one line of the table."""
    *quantiles, share, _ = world.truth(LIMIT_S)
    values, held, naive, agrees = [], [], [], []
    for seed in range(n_sites):
        seen = see(world, n_days=n_days, seed=seed)
        found = dwell(seen.dwell_s, seen.is_cut, seen.day, person_s=seen.person_s, long_s=LIMIT_S)
        spans = [(q.value, q.lo, q.hi) for q in (found.median, found.p90)]
        long = found.long_share
        spans.append((long.value, long.lo, long.hi))
        values.append([np.nan if v is None else v for v, _, _ in spans])
        held.append(
            [
                np.nan if v is None else (lo or 0.0) <= true <= (np.inf if hi is None else hi)
                for (v, lo, hi), true in zip(spans, (*quantiles, share), strict=True)
            ]
        )
        naive.append(np.quantile(seen.pieces_s, [0.5, 0.9]))
        agrees.append(found.little.agrees)
    truth = np.array([*quantiles, share])
    known_of = [v[np.isfinite(v)] for v in np.array(values).T]
    bias = [np.median(v) / t - 1 if len(v) else np.nan for v, t in zip(known_of, truth, strict=True)]
    off = np.median(naive, axis=0) / truth[:2] - 1
    cells = []
    for k in range(3):
        known = np.array(held)[:, k]
        unknown = float(np.isnan(known).mean())
        covered = f"{np.nanmean(known):.1%}" if unknown < 1 else "unknown"
        more = f" (unknown in {unknown:.0%})" if 0 < unknown < 1 else ""
        cells.append((f"{bias[k]:+.0%}, " if k < 2 and unknown < 1 else "") + covered + more)
    unsure = agrees.count(None) / n_sites
    little = f"{agrees.count(False) / n_sites:.1%}" + (f" (unknown in {unsure:.0%})" if unsure else "")
    return world.name, str(n_days), cells[0], f"{off[0]:+.0%}", cells[1], f"{off[1]:+.0%}", cells[2], little


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=500)
    n_sites = parser.parse_args().sites
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    for world in WORLDS:
        for n_days in (7, 28):
            print(f"| {' | '.join(row(world, n_days=n_days, n_sites=n_sites))} |", flush=True)


if __name__ == "__main__":
    main()
