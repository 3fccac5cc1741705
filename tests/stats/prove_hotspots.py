"""Prove the hotspot test on simulated floors: python tests/stats/prove_hotspots.py --floors 300.

Each floor has 24 x 18 cells of 1 m with an uneven crowd; violations follow exposure, a shock of the day (log sd as
stated), a shock of the cell and day (log sd .3), and Poisson chance. In the rows that say so, the rate within 1.6 m of a
planted place is 2.5 times as high. Beside our test stands the usual one, Getis-Ord Gi* on counts.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import ndimage
from scipy.special import ndtr

from vsd_analytics.stats.hotspots import hotspots

ROWS, COLUMNS = 18, 24
RADIUS_M = 1.6
CELL_DAY_SD = 0.3


@dataclass(frozen=True)
class World:
    """One row of the table."""

    n_days: int
    episodes_per_day: float
    day_sd: float
    ratio: float = 1.0


WORLDS = [
    World(days, episodes, sd, ratio)
    for days in (28, 14)
    for episodes in (1200.0, 300.0)
    for sd in (0.10, 0.25)
    for ratio in (1.0, 2.5)
]


def draw(world: World, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Return violations and person-hours, shape (n_days, ROWS, COLUMNS), and the planted place (row, column)."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    crowd = np.full((ROWS, COLUMNS), 0.15)
    for _ in range(5):
        row, column = rng.uniform(0, ROWS), rng.uniform(0, COLUMNS)
        crowd += rng.uniform(0.4, 1.5) * np.exp(-((y - row) ** 2 + (x - column) ** 2) / (2 * rng.uniform(2, 5) ** 2))
    place = int(rng.integers(4, ROWS - 4)), int(rng.integers(4, COLUMNS - 4))
    near = (y - place[0]) ** 2 + (x - place[1]) ** 2 <= RADIUS_M**2
    busy = np.array([0.9, 0.85, 0.9, 1.0, 1.2, 1.4, 0.75])[np.arange(world.n_days) % 7]
    exposure_h = 400 * crowd / crowd.sum() * busy[:, None, None] * rng.gamma(25, 1 / 25, (world.n_days, ROWS, COLUMNS))
    shock = np.exp(rng.normal(0, world.day_sd, (world.n_days, 1, 1)))
    shock = shock * np.exp(rng.normal(0, CELL_DAY_SD, exposure_h.shape))
    rate = world.episodes_per_day / 400 * shock * np.where(near, world.ratio, 1.0)
    return rng.poisson(rate * exposure_h).astype(float), exposure_h, place


def getis_ord(counts: np.ndarray) -> np.ndarray:
    """Return Gi* of a surface with binary weights of the 8 neighbours and the cell itself, and which cells pass BH."""
    window = np.ones((3, 3))
    total = ndimage.convolve(counts, window, mode="constant")
    n_near = ndimage.convolve(np.ones_like(counts), window, mode="constant")
    n, mean, sd = counts.size, counts.mean(), counts.std()
    z = (total - mean * n_near) / (sd * np.sqrt((n * n_near - n_near**2) / (n - 1)))
    p = np.sort((1 - ndtr(z)).ravel())
    passing = np.flatnonzero(p <= 0.05 * np.arange(1, n + 1) / n)
    return 1 - ndtr(z) <= (p[passing[-1]] if len(passing) else -1.0)


def outcome(world: World, seed: int) -> tuple[bool, float, float, int, bool]:
    """Return any false cell, share of planted cells found, distance of the nearest spot, and the same of Gi*."""
    key = [seed, world.n_days, int(world.episodes_per_day), int(100 * world.day_sd)]
    n, x_h, place = draw(world, np.random.default_rng(key))
    found = hotspots(n, x_h, sigma_cells=1.0)
    y, x = np.mgrid[:ROWS, :COLUMNS]
    away = np.hypot(y - place[0], x - place[1])
    planted = (away <= RADIUS_M) if world.ratio > 1 else np.zeros((ROWS, COLUMNS), dtype=bool)
    # smoothing reaches three cells: what lies beyond it has nothing of the planted place
    is_false = bool((found.cells.is_hot & (away > RADIUS_M + 3 if world.ratio > 1 else True)).any())
    share = float(found.cells.is_hot[planted].mean()) if planted.any() else np.nan
    nearest = min((np.hypot(s.row - place[0], s.column - place[1]) for s in found.spots), default=np.inf)
    usual = getis_ord(n.sum(axis=0))
    far = usual & ((away > RADIUS_M + 3) if world.ratio > 1 else True)
    return is_false, share, float(nearest), int(far.sum()), bool(far.any())


def row(world: World, n_floors: int) -> str:
    """Return the table's row of one world."""
    found = [outcome(world, seed) for seed in range(n_floors)]
    false, share, nearest, n_usual, any_usual = (np.array(v) for v in zip(*found, strict=True))
    told = "no hotspot | " if world.ratio == 1 else f"{world.ratio:g} | "
    told += f"{world.n_days} | {world.episodes_per_day:g} | {world.day_sd:g} | {false.mean():.1%} | "
    if world.ratio == 1:
        told += "- | - | "
    else:
        told += f"{share.mean():.0%} | {np.mean(nearest <= 1):.0%} | "
    return f"| {told}{any_usual.mean():.0%} | {n_usual.mean():.0f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--floors", type=int, default=300)
    arguments = parser.parse_args()
    columns = ["planted ratio", "days", "violations a day", "day sd", "any false cell", "planted cells found"]
    columns += ["located within 1 m", "Gi* on counts: any false cell", "false cells"]
    print(f"| {' | '.join(columns)} |")
    print("|" + "---|" * len(columns))
    with ProcessPoolExecutor(2) as pool:
        for line in pool.map(partial(row, n_floors=arguments.floors), WORLDS):
            print(line, flush=True)


if __name__ == "__main__":
    main()
