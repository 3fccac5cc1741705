"""Prove crowding x layout x behaviour: python tests/stats/prove_decomposition.py [--real FOLDER].

First table: the layout L of maps of several cell sizes beside placing pairs one by one, and the behaviour B of people
who are placed independently, twice as many, in pairs, or pushed apart. Second, with the folder of the ETH and UCY
walks: real scenes, all pairs and pairs of different groups; one frame stands for .4 s (2.5 annotations a second).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from vsd_analytics.stats.decomposition import Mixing, concentration, mixing

DISTANCE_M, CELL_M = 2.0, 0.25
FLOOR_M = np.array([16.0, 10.0])
Draw = Callable[[np.random.Generator, int], np.ndarray]


def counter(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return n places: half of them round a counter, the others anywhere."""
    places = np.where(rng.random(n)[:, None] < 0.5, rng.normal((4, 4), 1.0, (n, 2)), rng.random((n, 2)) * FLOOR_M)
    return np.clip(places, 0, FLOOR_M - 1e-9)


def queue(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return n places along a line, half a metre wide."""
    return np.clip(np.column_stack([rng.uniform(2, 14, n), rng.normal(5, 0.25, n)]), 0, FLOOR_M - 1e-9)


def anywhere(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return n places anywhere."""
    return rng.random((n, 2)) * FLOOR_M


def in_pairs(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return n places round the counter; every second person brings a companion at one metre."""
    places = counter(rng, n)
    beside = places[rng.random(n) < 0.5]
    angle = rng.uniform(0, 2 * np.pi, len(beside))
    beside = beside + np.column_stack([np.cos(angle), np.sin(angle)])
    return np.clip(np.concatenate([places, beside]), 0, FLOOR_M - 1e-9)


def apart(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return places round the counter of which most that come closer than 1.5 m to one before are given up."""
    kept: list[np.ndarray] = []
    for place in counter(rng, n):
        if all(np.hypot(*(place - other)) >= 1.5 or rng.random() < 0.3 for other in kept):
            kept.append(place)
    return np.array(kept).reshape(-1, 2)


def map_of(places: np.ndarray, cell_m: float) -> np.ndarray:
    """Return how many places lie in each cell."""
    cells = np.floor((places - places.min(axis=0)) / cell_m).astype(int)
    made = np.zeros(cells.max(axis=0)[::-1] + 1)
    np.add.at(made, (cells[:, 1], cells[:, 0]), 1.0)
    return made


def decomposed(frames: Iterator[tuple[int, np.ndarray, np.ndarray]], *, n_parts: int, frame_h: float) -> Mixing:
    """Return the decomposition of frames: part of time, places, and which pairs count (square, symmetric)."""
    close, together, every = np.zeros((1, n_parts)), np.zeros((1, n_parts)), []
    for part, places, counts in frames:
        near = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) < DISTANCE_M
        upper = np.triu(counts, 1)
        close[0, part] += np.count_nonzero(near & upper) * frame_h
        together[0, part] += np.count_nonzero(upper) * frame_h
        every.append(places)
    exposure = map_of(np.concatenate(every), CELL_M) * frame_h
    return mixing(close, together, [exposure], cell_m=CELL_M, distance_m=DISTANCE_M, min_person_h=0)


def simulated(draw: Draw, mean: float, rng: np.random.Generator) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield 7 days of 1,500 frames."""
    for day in range(7):
        for _ in range(1500):
            places = draw(rng, rng.poisson(mean))
            yield day, places, np.ones((len(places), len(places)), dtype=bool)


def real(scene: Path, *, is_between: bool) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield the frames of a scene in ten parts of time; pairs of one group do not count where `is_between`."""
    table = np.loadtxt(scene / "obsmat.txt.gz")
    groups = [set(map(int, line.split())) for line in (scene / "groups.txt").read_text().splitlines() if line.strip()]
    of = {person: k for k, members in enumerate(groups) for person in members}
    frames, starts = np.unique(table[:, 0], return_index=True)
    table = table[np.argsort(table[:, 0], kind="stable")]
    starts = np.searchsorted(table[:, 0], frames)
    for k, (first, last) in enumerate(zip(starts, [*starts[1:], len(table)], strict=True)):
        rows = table[first:last]
        group = np.array([of.get(int(p), -int(p) - 1) for p in rows[:, 1]])
        counts = np.ones((len(rows), len(rows)), dtype=bool)
        if is_between:
            counts = group[:, None] != group[None]
        yield k * 10 // len(frames), rows[:, (2, 4)], counts


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    print("| map | L, pairs placed one by one | L, cells of 0.25 m | 0.5 m | 1 m |\n|---|---|---|---|---|")
    for name, draw in (("anywhere", anywhere), ("round a counter", counter), ("a line half a metre wide", queue)):
        one, other = draw(rng, 1_000_000), draw(rng, 1_000_000)
        direct = np.mean(np.hypot(*(one - other).T) < DISTANCE_M)
        told = [concentration(map_of(one, c), cell_m=c, distance_m=DISTANCE_M) / direct - 1 for c in (0.25, 0.5, 1.0)]
        print(f"| {name} | {direct:.4f} | {' | '.join(f'{t:+.1%}' for t in told)} |")
    print("\n| people round a counter | P, pair-hours | L / L uniform | B (95 % interval) |\n|---|---|---|---|")
    worlds: tuple[tuple[str, Draw, float], ...] = (
        ("6 on average, each for himself", counter, 6),
        ("12 on average, each for himself", counter, 12),
        ("6, every second brings a companion", in_pairs, 6),
        ("10, who mostly keep 1.5 m apart", apart, 10),
    )
    for name, draw, mean in worlds:
        found = decomposed(simulated(draw, mean, rng), n_parts=7, frame_h=1 / 3600)
        print(f"| {name} | {found.copresent_h:.1f} | {_of_uniform(found)} | {_behaviour(found)} |")
    if arguments.real is not None:
        print("\n| scene | L / L uniform | B, all pairs | B, pairs of different groups |\n|---|---|---|---|")
        for scene in ("seq_eth", "seq_hotel", "zara01"):
            every, between = (
                decomposed(real(arguments.real / scene, is_between=b), n_parts=10, frame_h=0.4 / 3600)
                for b in (False, True)
            )
            print(f"| {scene} | {_of_uniform(every)} | {_behaviour(every)} | {_behaviour(between)} |")


def _of_uniform(found: Mixing) -> str:
    return f"{(found.layout or 0) / (found.layout_uniform or 1):.2f}"


def _behaviour(found: Mixing) -> str:
    return f"{found.behaviour:.2f} ({found.lo:.2f} to {found.hi:.2f})"


if __name__ == "__main__":
    main()
