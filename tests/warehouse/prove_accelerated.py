"""Random scenes on which facts computed as arrays are compared with their queries; the test does so with a few.

    PYTHONPATH=tests python tests/warehouse/prove_accelerated.py 100 [SEED]

Prints the scenes that differ, and how many rows of each fact were compared. Exits with 1 where any differ.
"""

from __future__ import annotations

import random
import sys
from collections import Counter

from warehouse.test_accelerated_against_sql import Scene, both


def scene(rng: random.Random) -> Scene:
    """Return a random scene in which somebody sends something."""

    def chance(share: float) -> bool:
        return rng.random() < share

    has_beats = chance(0.7)
    return Scene(
        rng.randrange(2**32),
        n_people=rng.choice([1, 2, 6, 14, 30, 60]),
        step_ms=rng.choice([500, 1000, 2000, 7000, 20_000]),
        pace=rng.choice([0.0, 0.3, 1.0]),
        has_rate=chance(0.5),
        share_with_ids=rng.choice([0.0, 0.8, 1.0]),
        share_lost=rng.choice([0.0, 0.2, 0.7]),
        has_beats=has_beats,
        sends_pixels=chance(0.4),
        sends_persons=not has_beats or chance(0.8),
        sends_pairs=chance(0.4),
        falling_numbers=chance(0.3),
        opens_at_half_past=chance(0.3),
    )


def main(n_scenes: int, seed: int = 1) -> int:
    """Compare, print, and return the exit code."""
    rng, rows, n_differing = random.Random(seed), Counter[str](), 0
    for _ in range(n_scenes):
        what = scene(rng)
        expected, found = both(what)
        for name, table in expected.items():
            rows[name] += table.num_rows
            if not (found[name].schema.types == table.schema.types and found[name].to_pylist() == table.to_pylist()):
                n_differing += 1
                print(name, "differs:", what)
    print(f"{n_scenes} scenes, {n_differing} facts differ; rows compared: {dict(rows)}")
    return 1 if n_differing else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
