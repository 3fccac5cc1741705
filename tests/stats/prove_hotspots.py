"""Prove the hotspot test on simulated floors: python tests/stats/prove_hotspots.py --floors 1000 --shops 10.

Each floor has 24 x 18 cells of 1 m with an uneven crowd of 400 person-hours a day; violations follow exposure, a shock
of the day (log sd as stated), a shock of the cell and day (log sd .3), and Poisson chance. In the rows that say so, the
rate within 1.6 m of a planted place is 2.5 times as high; the shocks of the day come in patches of floor some 6 m wide
rather than cell by cell; or a camera that sees a third of the floor is down for four days. Beside our test stands the
usual one, Getis-Ord Gi* on counts. The shops are those of the people simulator, as if seen without error.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from zoneinfo import ZoneInfo

import numpy as np
from scipy import ndimage
from scipy.special import ndtr

from vsd_analytics.stats.hotspots import Hotspots, benjamini_hochberg, hotspots

ROWS, COLUMNS = 18, 24
RADIUS_M = 1.6
CELL_DAY_SD = 0.3
REACH_M = 3.0  # smoothing reaches so far: what lies beyond has nothing of the planted place


@dataclass(frozen=True)
class World:
    """One row of the table."""

    n_days: int
    episodes_per_day: float
    day_sd: float
    ratio: float = 1.0
    is_down: bool = False
    is_patchy: bool = False


SIZES = [(28, 1200.0), (28, 300.0), (14, 1200.0), (7, 1200.0)]
WORLDS = [
    *(World(days, n, sd, ratio) for ratio in (1.0, 2.5) for days, n in SIZES for sd in (0.05, 0.10, 0.25)),
    *(World(28, 1200.0, sd, ratio, is_patchy=True) for ratio in (1.0, 2.5) for sd in (0.05, 0.10, 0.25)),
    *(World(28, 1200.0, sd, ratio, is_down=True) for ratio in (1.0, 2.5) for sd in (0.05, 0.10, 0.25)),
]


def draw(world: World, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Return violations and person-hours, shape (n_days, ROWS, COLUMNS), and the planted place (row, column)."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    crowd = np.full((ROWS, COLUMNS), 0.15)
    for _ in range(5):
        row, column = rng.uniform(0, ROWS), rng.uniform(0, COLUMNS)
        crowd += rng.uniform(0.4, 1.5) * np.exp(-((y - row) ** 2 + (x - column) ** 2) / (2 * rng.uniform(2, 5) ** 2))
    place = int(rng.integers(4, ROWS - 4)), int(rng.integers(4, COLUMNS - 4))
    busy = np.array([0.9, 0.85, 0.9, 1.0, 1.2, 1.4, 0.75])[np.arange(world.n_days) % 7]
    exposure_h = 400 * crowd / crowd.sum() * busy[:, None, None] * rng.gamma(25, 1 / 25, (world.n_days, ROWS, COLUMNS))
    shock = np.exp(rng.normal(0, world.day_sd, (world.n_days, 1, 1)))
    own = rng.normal(0, 1, exposure_h.shape)
    if world.is_patchy:
        own = ndimage.gaussian_filter(own, sigma=(0, 2, 2), mode="wrap")
    shock = shock * np.exp(CELL_DAY_SD * own / own.std())
    rate = world.episodes_per_day / 400 * shock * risk(world, place)
    return rng.poisson(rate * exposure_h).astype(float), exposure_h, place


def risk(world: World, place: tuple[int, int]) -> np.ndarray:
    """Return the true rate of each cell over that of a cell away from the planted place."""
    return np.where(away(place) <= RADIUS_M, world.ratio, 1.0)


def away(place: tuple[int, int]) -> np.ndarray:
    """Return the distance of each cell from a place, in cells (metres)."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    return np.hypot(y - place[0], x - place[1])


def recorded_cells(world: World) -> np.ndarray:
    """Return which cells were recorded on which days: all, or one third of the floor not on days 9 to 12."""
    recorded = np.ones((world.n_days, ROWS, COLUMNS), dtype=bool)
    if world.is_down:
        recorded[8:12, :, : COLUMNS // 3] = False
    return recorded


def getis_ord(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Gi* of a surface with binary weights of the 8 neighbours and the cell itself, and which cells pass BH."""
    window = np.ones((3, 3))
    total = ndimage.convolve(counts, window, mode="constant")
    n_near = ndimage.convolve(np.ones_like(counts), window, mode="constant")
    n, mean, sd = counts.size, counts.mean(), counts.std()
    z = (total - mean * n_near) / (sd * np.sqrt((n * n_near - n_near**2) / (n - 1)))
    return z, benjamini_hochberg(ndtr(-z).ravel()).reshape(z.shape) <= 0.05


def outcome(seed: int, world: World) -> tuple[bool, float, float, float, int]:
    """Return any false cell, share of planted cells found, distance of the nearest spot, interval holds, Gi* false."""
    key = [seed, world.n_days, int(world.episodes_per_day), int(100 * world.day_sd), int(10 * world.ratio)]
    n, x_h, place = draw(world, np.random.default_rng(key))
    recorded = recorded_cells(world)
    n, x_h = np.where(recorded, n, 0.0), np.where(recorded, x_h, 0.0)
    found = hotspots(n, x_h, sigma_cells=1.0, is_recorded=recorded, min_days=min(14, world.n_days))
    # what smoothing carries beyond the planted cells is not false; without a planted place every cell is
    is_null = away(place) > RADIUS_M + REACH_M if world.ratio > 1 else np.ones((ROWS, COLUMNS), dtype=bool)
    planted = (away(place) <= RADIUS_M) & (world.ratio > 1)
    share = float(found.cells.is_hot[planted].mean()) if planted.any() else np.nan
    nearest = min((float(np.hypot(s.row - place[0], s.column - place[1])) for s in found.spots), default=np.inf)
    usual = getis_ord(n.sum(axis=0))[1]
    return (
        bool((found.cells.is_hot & is_null).any()),
        share,
        nearest,
        _is_held(found, x_h, risk(world, place)),
        int((usual & is_null).sum()),
    )


def _is_held(found: Hotspots, x_h: np.ndarray, true_risk: np.ndarray) -> float:
    """Tell whether the first spot's interval holds the true ratio of its cells; NaN without a spot."""
    if not found.spots:
        return np.nan
    spot = found.spots[0]
    inside = found.cells.label == spot.label
    site = (x_h * true_risk).sum(axis=(1, 2)) / x_h.sum(axis=(1, 2))
    truth = (x_h * true_risk)[:, inside].sum() / (site[:, None] * x_h[:, inside]).sum()
    return float((spot.rate.lo or 0.0) <= truth <= (spot.rate.hi or np.inf))


def row(world: World, pool: ProcessPoolExecutor, n_floors: int) -> str:
    """Return the table's row of one world."""
    found = list(pool.map(partial(outcome, world=world), range(n_floors), chunksize=50))
    false, share, nearest, held, usual = (np.array(v) for v in zip(*found, strict=True))
    told = ["none" if world.ratio == 1 else f"{world.ratio:g}", f"{world.n_days}", f"{world.episodes_per_day:,.0f}"]
    more = "a third of the floor down 4 days" if world.is_down else "days differ by patch" if world.is_patchy else ""
    told += [f"{world.day_sd:.2f}", more, f"{false.mean():.1%}"]
    if world.ratio == 1:
        told += ["-", "-", "-"]
    else:
        told += [f"{share.mean():.0%}", f"{np.mean(nearest <= 1):.0%}", f"{np.nanmean(held):.0%}"]
    return f"| {' | '.join([*told, f'{np.mean(usual > 0):.0%}', f'{usual.mean():.0f}'])} |"


def two_places(seed: int, gap_m: int) -> tuple[bool, bool]:
    """Return if two planted places side by side are reported as two within 1 m, and whether neighbours alone do."""
    rng = np.random.default_rng([seed, gap_m])
    world = World(28, 1200.0, 0.25, 2.5)
    n, x_h, place = draw(world, rng)
    other = place[0], place[1] + (gap_m if place[1] < COLUMNS / 2 else -gap_m)
    is_other = (away(other) <= RADIUS_M) & (away(place) > RADIUS_M)
    n = n + rng.poisson((world.ratio - 1) * world.episodes_per_day / 400 * x_h * is_other)
    found = hotspots(n, x_h, sigma_cells=1.0)
    near = [min((np.hypot(s.row - p[0], s.column - p[1]) for s in found.spots), default=np.inf) for p in (place, other)]
    return len(found.spots) == 2 and max(near) <= 1, ndimage.label(found.cells.is_hot, structure=np.ones((3, 3)))[
        1
    ] == 2


def shop(seed: int) -> str:
    """Return the row of one made-up shop: four weeks of people who walk, look, wait and queue."""
    from vsd_analytics.simulate import simulate_day, violations
    from vsd_analytics.simulate.shop import AREA_RECTS, DEPTH_M, WIDTH_M

    edges = [np.arange(side + 1) for side in (int(DEPTH_M), int(WIDTH_M))]
    counted, exposure = [], []
    for k in range(28):
        midnight = datetime(2026, 10, 19, tzinfo=ZoneInfo("Europe/Rome")) + timedelta(days=k)
        hours = (10, 18) if midnight.weekday() == 6 else (8, 21)
        opens, closes = (midnight.replace(hour=h) for h in hours)
        day = simulate_day(opens, closes=closes, seed=seed, interval_s=3.0, display_moved=True)
        episodes = violations(day)
        counted.append(np.histogram2d(episodes.y_m, episodes.x_m, bins=edges)[0])
        exposure.append(np.histogram2d(day.y_m, day.x_m, bins=edges)[0] * day.interval_ms / 3.6e6)
    n, x_h = np.array(counted), np.array(exposure)
    found = hotspots(n, x_h, sigma_cells=1.0)
    x0, y0, x1, y1 = AREA_RECTS["checkout-queue"]
    first = found.spots[0]
    is_there = x0 <= first.column + 0.5 <= x1 and y0 <= first.row + 0.5 <= y1
    _, usual = getis_ord(n.sum(axis=0))
    safe = found.cells.is_tested & (found.cells.ratio <= 1)
    told = [f"{seed}", f"{n.sum() / 28:,.0f}", f"{len(found.spots)}", "yes" if is_there else "no"]
    told += [f"{first.rate.ratio:.2f} ({first.rate.lo:.2f} to {first.rate.hi:.2f})", f"{int((usual & safe).sum())}"]
    return f"| {' | '.join(told)} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--floors", type=int, default=1000)
    parser.add_argument("--shops", type=int, default=0)
    arguments = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        if arguments.floors:
            columns = ["planted ratio", "days", "violations a day", "day sd", "", "any false hotspot"]
            columns += ["planted cells found", "located within 1 m", "interval holds the ratio"]
            columns += ["Gi* on counts: any false cell", "Gi* on counts: false cells"]
            print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
            for world in WORLDS:
                print(row(world, pool, arguments.floors), flush=True)
            print(
                "\n| metres between two places | seen as two, each within 1 m | hot cells fall in two |\n|---|---|---|"
            )
            for gap_m in (4, 5, 6):
                told = list(pool.map(partial(two_places, gap_m=gap_m), range(arguments.floors), chunksize=50))
                print(f"| {gap_m} | {' | '.join(f'{share:.0%}' for share in np.mean(told, axis=0))} |", flush=True)
        if arguments.shops:
            columns = ["seed", "violations a day", "hotspots", "first is the checkout queue", "its ratio"]
            columns += ["Gi* on counts: cells no riskier than the site"]
            print(f"\n| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
            for line in pool.map(shop, range(1, arguments.shops + 1)):
                print(line, flush=True)


if __name__ == "__main__":
    main()
