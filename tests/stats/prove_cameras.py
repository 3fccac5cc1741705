"""Dwell, flow, waiting and capacity of records under two cameras, from the store to the figures, against the truth.

    python tests/stats/prove_cameras.py --sites 20

Naive: whole pieces of tracks as visits, shares of those whose next area was seen, people counted in all open time.
Each cell: bias, intervals that hold the truth; naive bias. The table is in docs/methods/several-cameras.md.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterable
from datetime import date, timedelta
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1]))

from camera_worlds import CAPACITY, WORLDS, Walker, World, fill, is_in, site, walker
from warehouse.small_projects import open_days

from vsd_analytics.answer import Value
from vsd_analytics.figures.capacities import capacity
from vsd_analytics.figures.flow import Flow, flow
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.queues import queues
from vsd_analytics.figures.visits import visits

Span = tuple[float | None, float | None, float | None]
FIRST = date(2026, 11, 9)
N_DAYS = 7
WAYS = (("door", "bread"), ("bread", "door"), ("bread", "till"))
NAMES = (
    "bread median", "bread 90 %", "hall median", "door to bread", "bread to door", "bread to till", "the same by links",
    "people at the till", "its wait", "till full",
)  # fmt: skip


@cache
def truth() -> dict[str, float]:
    """Return what very many people do; people at the till by Little's law, and by hours of simulated days."""
    rng = np.random.default_rng(10**6)
    people = [walker(0, rng) for _ in range(40_000)]
    found = {
        "bread median": float(np.median([p.stays["bread"] for p in people if "bread" in p.stays])),
        "bread 90 %": float(np.quantile([p.stays["bread"] for p in people if "bread" in p.stays], 0.9)),
        "hall median": float(np.median([p.stays["hall"] for p in people if "hall" in p.stays])),
        **{f"{a} to {b}": share_of(people, a, b) for a, b in WAYS},
        "its wait": float(np.median([p.stays["wait"] for p in people if "wait" in p.stays])),
    }
    counts = []
    for seed in range(200):  # days without a store: who is at the till at each second
        with tempfile.TemporaryDirectory() as folder:
            everybody = fill(site(Path(folder), WORLDS[0]), WORLDS[0], n_days=1, seed=10**6 + seed, is_stored=False)
        counts.append(at_till(everybody))
    n = np.concatenate(counts)
    return {**found, "people at the till": float(n.mean()), "till full": float((n >= CAPACITY).mean())}


def share_of(people: Iterable[Walker], a: str, b: str) -> float:
    pairs = [pair for p in people for pair in zip(p.way, p.way[1:], strict=False) if pair[0] == a]
    return sum(pair[1] == b for pair in pairs) / len(pairs)


def at_till(everybody: Iterable[Walker]) -> np.ndarray:
    n = np.zeros(7200)
    for p in everybody:
        at = p.start_s + np.flatnonzero(is_in("till", p.x, p.y))
        n[at[at < len(n)]] += 1
    return n


def measured(world: World, seed: int) -> tuple[dict[str, Span], dict[str, float], float]:
    """Return estimates and naive values of one site, and the recorded share of the queue."""
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        made = site(Path(folder), world)
        fill(made, world, n_days=N_DAYS, seed=seed)
        last = FIRST + timedelta(days=N_DAYS - 1)
        with open_days(made, FIRST.isoformat(), last.isoformat()) as warehouse:
            period = Period(FloorHours(warehouse, floor=made.floors[0]), FIRST, last)
            moves, stays, (queue, _), use = flow(period), visits(period), queues(period), capacity(period)
            pieces = warehouse.rows("select area_id, (ended_ms - started_ms) / 1000 as s from visits where is_counted")
            levels = warehouse.rows("select n_people, sum(recorded_open_s)::double as s from count_hours group by all")
    assert moves is not None
    spans: dict[str, Span] = {}
    for name, q in (
        ("bread median", stays.value("dwell_median_s", area_id="bread")),
        ("bread 90 %", stays.value("dwell_p90_s", area_id="bread")),
        ("hall median", stays.value("dwell_median_s", area_id="hall")),
        ("its wait", queue.value("wait_median_s", area_id="till")),
    ):
        spans[name] = _span(q)
    naive = {
        name: float(np.quantile([p["s"] for p in pieces if p["area_id"] == area], q))
        for name, area, q in (
            ("bread median", "bread", 0.5), ("bread 90 %", "bread", 0.9), ("hall median", "hall", 0.5),
            ("its wait", "till", 0.5),
        )
    }  # fmt: skip
    for a, b in WAYS:
        spans[f"{a} to {b}"], naive[f"{a} to {b}"] = _share(moves, a, b)
    people, full = queue.value("people_waiting", area_id="till"), use.value("full_share", area_id="till")
    spans["people at the till"] = (people.value, people.lo, people.hi)
    spans["till full"] = (full.value, full.lo, full.hi)
    open_s = N_DAYS * 7200.0
    naive["people at the till"] = sum(r["n_people"] * r["s"] for r in levels) / open_s
    naive["till full"] = sum(r["s"] for r in levels if r["n_people"] >= CAPACITY) / open_s
    linked = next((x.share for x in moves.links.links if (x.origin.area_id, x.to.area_id) == ("bread", "till")), None)
    spans["the same by links"] = (None, None, None) if linked is None else (linked.value, linked.lo, linked.hi)
    naive["the same by links"] = naive["bread to till"]
    return spans, naive, queue.value("recorded_share", area_id="till").value or 0.0


def _span(q: Value) -> Span:
    return q.value, q.lo, q.hi if q.hi is not None or q.lo is None else np.inf


def _share(found: Flow, a: str, b: str) -> tuple[Span, float]:
    (of,) = [f for f in found.areas if f.area.area_id == a]
    to = next((t for t in of.to if [x.area_id for x in t.areas] == [b]), None)
    n = sum(t.share.n for t in of.to)
    if to is None:
        return (None, None, None), 0.0
    return (to.share.value, to.share.lo, to.share.hi), to.share.n / max(n, 1)


def row(world: World, *, n_sites: int) -> tuple[str, ...]:
    """Return one line of the table."""
    true = truth() | {"the same by links": truth()["bread to till"]}
    found = [measured(world, seed) for seed in range(n_sites)]
    cells = []
    for name in NAMES:
        known = [s[name] for s, _, _ in found if s[name][0] is not None and s[name][1] is not None]
        off = np.mean([n[name] for _, n, _ in found]) / true[name] - 1
        if not known:
            cells.append(f"unknown; {off:+.0%}")
            continue
        held = np.mean([lo <= true[name] <= hi for _, lo, hi in known])  # type: ignore[operator]
        bias = np.mean([v for v, _, _ in known]) / true[name] - 1  # type: ignore[arg-type]
        some = 1 - len(known) / n_sites
        cells.append(f"{bias:+.0%}, {held:.0%}{f' (unknown in {some:.0%})' if some else ''}; {off:+.0%}")
    return world.name, *cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=20)
    parser.add_argument("--worlds", default=None, help="Numbers of worlds, such as 0,3; default all.")
    arguments = parser.parse_args()
    chosen = range(len(WORLDS)) if arguments.worlds is None else map(int, arguments.worlds.split(","))
    print(f"| world | {' | '.join(NAMES)} |\n|{'---|' * (1 + len(NAMES))}")
    for k in chosen:
        print(f"| {' | '.join(row(WORLDS[k], n_sites=arguments.sites))} |", flush=True)


if __name__ == "__main__":
    main()
