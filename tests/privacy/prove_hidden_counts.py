"""Solve for every count held back from all that leaves of many weeks, in sequence; tables: docs/methods.

Worlds of few violations, each with `--weeks` weeks in a row. Pages of each third week are asked for while it goes on,
and of all weeks when they are over. Then minutes are erased twice, a day arrives late, and the legal distance changes,
and what may differ is made again. A reader has every number of every version (`sequences`).
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from privacy import hidden_counts as hidden
from privacy import person_times, sequences


def main() -> None:
    """Print the table, and end with 1 where a count could be worked out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=11, help="worlds")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--weeks", type=int, default=10, help="weeks of each world")
    asked = parser.parse_args()
    revealed: Counter[str] = Counter()
    held: Counter[str] = Counter()
    n_numbers = n_broken = n_running = n_refused = 0
    for seed in range(asked.first, asked.first + asked.seeds):
        with tempfile.TemporaryDirectory() as folder:
            versions = history(Path(folder), seed, n_weeks=asked.weeks)
        wrong, found = sequences.broken(versions), sequences.worked_out(versions) | sequences.times_worked_out(versions)
        few = [name for world in versions.worlds for name in person_times.few_people(world)]
        held.update(kind(name) for name in (*sequences.protected(versions), *(f"version, {name}" for name in few)))
        revealed.update(map(kind, found))
        n_rows = len(versions.rows) + len({id(row) for times in versions.times for row in times.rows})
        n_numbers, n_broken = n_numbers + n_rows, n_broken + len(wrong)
        n_running, n_refused = n_running + versions.n_running, n_refused + versions.n_refused
        print(f"seed {seed}: {n_rows:,} numbers, worked out: {found}", *wrong, sep="\n  ", flush=True)
    print(f"\n{asked.seeds} worlds of {asked.weeks} weeks, {n_numbers:,} numbers, {n_broken} that do not fit")
    print(f"{n_running:,} pages of weeks that went on, {n_refused:,} refused\n")
    print("| small count, or time | held back | worked out |\n|---|--:|--:|")
    for of_kind, n in sorted(held.items()):
        print(f"| {of_kind} | {n:,} | {revealed[of_kind]:,} |")
    sys.exit(1 if revealed or n_broken else 0)


def history(folder: Path, seed: int, *, n_weeks: int) -> sequences.Versions:
    """Return what a reader has of a world that goes on and changes."""
    rng = random.Random(seed)
    versions = sequences.lived(folder, seed, n_weeks=n_weeks, has_live_page=True)
    for slots in (rng.choice((1, 3)), rng.choice((7, 12))):
        at = rng.randrange(n_weeks), rng.randrange(2), rng.randrange(hidden.N_DAYS)
        if at not in versions.worlds[-1].lost:
            sequences.erased(versions, *at, hidden.HOURS[0] + 1, slots=slots)
    for at in sorted(versions.worlds[-1].lost)[:1]:
        sequences.late(versions, *at, lambda _: rng.choice((0, 2, 6, 20)))
    sequences.nearer(versions)
    return versions


def kind(name: str) -> str:
    """Return what sort of count a name is of."""
    if "person-time" in name:
        where = (
            "an hour" if "hour" in name else "a week" if name.endswith("True") else "an area, or the rest, in a week"
        )
        return f"time of fewer than five people, {where}"
    version, _, of = name.partition(", ")
    return f"{'change' if version.startswith('change') else 'count'}, {hidden.kind(of)}"


if __name__ == "__main__":
    main()
