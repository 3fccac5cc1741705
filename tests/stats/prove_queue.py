"""Queues against their truth: bias and coverage of waits, share who leave, people waiting, capacity; beside naive ones.

    python tests/stats/prove_queue.py --sites 300

Naive: quantiles of whole tracks that were served, the share of whole tracks that left, and people counted in all hours,
also those in which a camera was dead. Where it is always dead in the same hours, figures are of the other hours and
have no interval ("unknown"). The tables are in docs/methods/queues.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))

from queue_worlds import CAPACITY, HOUR_S, WORLDS, Seen, World, of_people, see, truth

from vsd_analytics.stats.dwell import dwell
from vsd_analytics.stats.rates import violation_rate
from vsd_analytics.stats.waiting import CUT, LEFT, SERVED, waiting

Span = tuple[float | None, float | None, float | None]
NUMBERS = np.arange(60.0)
WAITS = ("median", "p90", "left")
PEOPLE = ("people", "from 60 %", "full", "over", "surplus")
OF_PEOPLE: dict[str, NDArray[np.float64]] = {
    "people": NUMBERS,
    "from 60 %": (NUMBERS >= 0.6 * CAPACITY).astype(float),
    "full": (NUMBERS >= CAPACITY).astype(float),
    "over": (NUMBERS > CAPACITY).astype(float),
    "surplus": np.maximum(NUMBERS - CAPACITY, 0.0),
}


def of_waits(seen: Seen) -> tuple[dict[str, Span], dict[str, float], bool | None]:
    """Return estimates, naive values, and whether Little's law agrees."""
    found = waiting(seen.wait_s, seen.outcome, seen.day, weight=seen.stands_for)
    spans: dict[str, Span] = {
        "median": (found.median.value, found.median.lo, found.median.hi),
        "p90": (found.p90.value, found.p90.lo, found.p90.hi),
        "left": (found.left_share.value, found.left_share.lo, found.left_share.hi),
    }
    whole, served = seen.wait_s[seen.outcome == SERVED], int((seen.outcome == SERVED).sum())
    left = int((seen.outcome == LEFT).sum())
    naive = {"median": np.quantile(whole, 0.5), "p90": np.quantile(whole, 0.9), "left": left / max(left + served, 1)}
    person_s = seen.time_s @ NUMBERS
    little = dwell(seen.wait_s, seen.outcome == CUT, seen.day, person_s=person_s, long_s=120.0).little
    return _if_known(spans, seen), {k: float(v) for k, v in naive.items()}, little.agrees


def of_numbers(seen: Seen) -> tuple[dict[str, Span], dict[str, float], bool | None]:
    """Return estimates as `vsd_analytics.figures.people_present` makes them of days, and naive values."""
    spans: dict[str, Span] = {}
    for name, amount in OF_PEOPLE.items():
        found = violation_rate([seen.time_s @ amount], [seen.time_s.sum(axis=1) / HOUR_S])
        unknown = found.value is None or found.lo is None or found.hi is None or found.value == 0
        spans[name] = (None, None, None) if unknown else tuple(v / HOUR_S for v in (found.value, found.lo, found.hi))  # type: ignore[operator, assignment]
    return _if_known(spans, seen), of_people(seen.naive_time_s), None


def _if_known(spans: dict[str, Span], seen: Seen) -> dict[str, Span]:
    """Return nothing where hours of the day were never recorded: figures are then said to be of the other hours."""
    return spans if seen.recorded.covers_all else dict.fromkeys(spans, (None, None, None))


def row(
    world: World,
    names: tuple[str, ...],
    made: Callable[[Seen], tuple[dict[str, Span], dict[str, float], bool | None]],
    *,
    n_days: int,
    n_sites: int,
) -> tuple[str, ...]:
    """Return one line of a table."""
    true = truth(world)
    spans, naive, agrees = zip(*(made(see(world, n_days=n_days, seed=seed)) for seed in range(n_sites)), strict=True)
    cells = []
    for name in names:
        values = [s[name] for s in spans]
        known = [v for v in values if v[0] is not None]
        if not known:
            cells.append("unknown")
            continue
        held = np.mean([(lo or 0.0) <= true[name] <= (np.inf if hi is None else hi) for _, lo, hi in known])
        bias = np.mean([v for v, _, _ in known]) / true[name] - 1
        unknown = 1 - len(known) / n_sites
        more = f" (unknown in {unknown:.0%})" if unknown else ""
        off = np.mean([n[name] for n in naive]) / true[name] - 1
        cells.append(f"{bias:+.0%}, {held:.1%}{more}; {off:+.0%}")
    if None not in agrees or any(a is not None for a in agrees):
        unsure = agrees.count(None) / n_sites
        cells.append(f"{agrees.count(False) / n_sites:.1%}" + (f" (unknown in {unsure:.0%})" if unsure else ""))
    return world.name, str(n_days), *cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=300)
    n_sites = parser.parse_args().sites
    for title, names, made in (
        ((*WAITS, "Little disagrees"), WAITS, of_waits),
        (PEOPLE, PEOPLE, of_numbers),
    ):
        head = ("world", "days", *title)
        print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
        for world in WORLDS if made is of_waits else (WORLDS[0], WORLDS[4], *WORLDS[7:]):
            for n_days in (7, 28):
                print(f"| {' | '.join(row(world, names, made, n_days=n_days, n_sites=n_sites))} |", flush=True)
        print()


if __name__ == "__main__":
    main()
