"""Solve for every count held back from all that is published of many weeks; the table is in docs/privacy.md.

Worlds of few violations, each with `--weeks` weeks in a row. A reader has every number of every week's JSON file, CSV
tables and planner (`hidden_counts`).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from privacy import hidden_counts as hidden


def main() -> None:
    """Print the table, and end with 1 where a count could be worked out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10, help="worlds")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--weeks", type=int, default=11, help="weeks of each world")
    asked = parser.parse_args()
    found: Counter[str] = Counter()
    hid: Counter[str] = Counter()
    n_numbers = n_broken = 0
    for seed in range(asked.first, asked.first + asked.seeds):
        with tempfile.TemporaryDirectory() as folder:
            world = hidden.build(Path(folder) / "site", seed, n_weeks=asked.weeks)
            known = hidden.published(world, range(asked.weeks))
        wrong = hidden.broken(known, world)
        told = hidden.worked_out(known, world)
        hid.update(map(hidden.kind, hidden.small_counts(world)))
        found.update(map(hidden.kind, told))
        n_numbers, n_broken = n_numbers + len(known.rows), n_broken + len(wrong)
        print(f"seed {seed}: {len(known.rows):,} numbers, worked out: {told}", *wrong, sep="\n  ", flush=True)
    print(f"\n{asked.seeds} worlds of {asked.weeks} weeks, {n_numbers:,} numbers, {n_broken} that do not fit\n")
    print("| count of 1 to 4 | held back | worked out |\n|---|--:|--:|")
    for kind, n in sorted(hid.items()):
        print(f"| {kind} | {n:,} | {found[kind]:,} |")
    sys.exit(1 if found or n_broken else 0)


if __name__ == "__main__":
    main()
