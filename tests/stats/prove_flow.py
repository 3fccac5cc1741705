"""Shares of flow from cut tracks against their truth: bias and coverage of intervals, beside the naive figure.

    python tests/stats/prove_flow.py --sites 300

Naive: of those followed to an area, the share who were followed to this one. The table is in docs/methods.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from flow_worlds import AREAS, N_ROUTES, WORLDS, FlowWorld, see_flow

from vsd_analytics.stats.next_area import inflow_checks, next_areas

FAR = (0, 3)
"""Door to till: the longest way, of which most are lost."""
HEAD = (
    "world",
    "days",
    "lost",
    "door to till: bias, covered",
    "naive",
    "all shares: covered",
    "naive",
    "width",
    "inflow disagrees: till, others",
)

ROUTES_HEAD = ("world", "days", "lost", "long routes: bias, all routes covered", "naive")
ROUTES_WORLDS = (
    FlowWorld("tracks are whole"),
    FlowWorld("a third of the routes is cut", cut_per_s=0.006),
    FlowWorld("half of the routes is cut", cut_per_s=0.012),
    FlowWorld("four in five are cut", cut_per_s=0.03),
)


def row(world: FlowWorld, *, n_days: int, n_sites: int) -> tuple[str, ...]:
    """Return one line of the table."""
    truth = world.truth()
    n = len(AREAS)
    value, lo, hi, naive = (np.full((n_sites, n, n), np.nan) for _ in range(4))
    lost, agrees = [], []
    for seed in range(n_sites):
        seen = see_flow(world, n_days=n_days, seed=seed)
        for a, people in enumerate(seen.leaving):
            found = next_areas(people, n_kinds=n)
            counts = np.array([s.n for s in found.shares])
            naive[seed, a] = counts / max(counts.sum(), 1)
            for b, s in enumerate(found.shares):
                if s.lo is not None and s.hi is not None:
                    value[seed, a, b], lo[seed, a, b], hi[seed, a, b] = s.value, s.lo, s.hi
        lost.append(np.mean(np.concatenate([p.kind for p in seen.leaving]) < 0))
        agrees.append([c.agrees for c in inflow_checks(seen.leaving, seen.arrived)])
    is_known = np.isfinite(lo)
    is_way = np.broadcast_to(truth > 0, lo.shape)
    held = (lo <= truth) & (truth <= hi)
    far = (slice(None), *FAR)
    # the naive share with the interval of a share with days as clusters would be as wide; its own misses are its bias
    wide = np.where(is_known, hi - lo, np.nan)
    naive_held = np.abs(naive - truth) <= wide / 2
    off = [c is False for found in agrees for c in (found[3],)], [c is False for found in agrees for c in found[:3]]
    unknown = 1 - is_known[is_way].mean()
    bias = np.nanmean(value[far]) / truth[FAR] - 1 if is_known[far].any() else np.nan
    return (
        world.name,
        str(n_days),
        f"{np.mean(lost):.0%}",
        f"{bias:+.0%}, {held[far][is_known[far]].mean():.1%}" if is_known[far].any() else "unknown",
        f"{np.mean(naive[far]) / truth[FAR] - 1:+.0%}",
        f"{held[is_way & is_known].mean():.1%}" + (f" (unknown in {unknown:.0%})" if unknown else ""),
        f"{naive_held[is_way & is_known].mean():.0%}",
        f"{np.nanmedian(wide[is_way]):.2f}",
        f"{np.mean(off[0]):.1%}, {np.mean(off[1]):.1%}",
    )


def routes_row(world: FlowWorld, *, n_days: int, n_sites: int) -> tuple[str, ...]:
    """Return one line of the table of routes: the longest ones, of more than two areas, are lost most often."""
    truth = see_flow(world, n_days=4000, seed=10**6).true_routes
    value, naive, held, lost, unknown = [], [], [], [], 0
    for seed in range(n_sites):
        seen = see_flow(world, n_days=n_days, seed=seed).routes
        found = next_areas(seen, n_kinds=N_ROUTES)
        lost.append(float(np.mean(seen.kind < 0)))
        naive.append(found.shares[-1].n / max(1, sum(s.n for s in found.shares)))
        if found.shares[-1].lo is None:
            unknown += 1
            continue
        value.append(found.shares[-1].value)
        held += [s.lo <= t <= s.hi for s, t in zip(found.shares, truth, strict=True)]  # type: ignore[operator]
    known = f"{np.mean(value) / truth[-1] - 1:+.0%}, {np.mean(held):.1%}" if value else "unknown"
    more = f" (unknown in {unknown / n_sites:.0%})" if 0 < unknown < n_sites else ""
    return world.name, str(n_days), f"{np.mean(lost):.0%}", known + more, f"{np.mean(naive) / truth[-1] - 1:+.0%}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=300)
    n_sites = parser.parse_args().sites
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    for world in WORLDS:
        for n_days in (7, 28):
            print(f"| {' | '.join(row(world, n_days=n_days, n_sites=n_sites))} |", flush=True)
    print(f"\n| {' | '.join(ROUTES_HEAD)} |\n|{'---|' * len(ROUTES_HEAD)}")
    for world in ROUTES_WORLDS:
        for n_days in (7, 28):
            print(f"| {' | '.join(routes_row(world, n_days=n_days, n_sites=n_sites))} |", flush=True)


if __name__ == "__main__":
    main()
