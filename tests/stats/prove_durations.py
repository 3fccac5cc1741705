"""How often the interval of a duration holds the truth, on simulated weeks: prints the table of docs/methods.

Run `python tests/stats/prove_durations.py --weeks 1000`. Violations a day are Poisson with a gamma factor of sd .25 a
day; durations are 3 s + lognormal(ln 5 s, 1), and a day moves their logarithm by a normal number of the stated sd.
Beside it: percentiles of the same block bootstrap.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.durations import durations

DRAWS = 199
WORLDS = [(7, 60, 0.0), (7, 60, 0.1), (7, 60, 0.25), (7, 400, 0.1), (7, 400, 0.25), (28, 60, 0.1), (28, 60, 0.25)]


def draw(rng: np.random.Generator, sizes: np.ndarray, sd: float) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    """Return durations of days with so many violations, and their days."""
    day = np.repeat(np.arange(len(sizes)), sizes)
    return 3 + np.exp(rng.normal(np.log(5), 1, len(day)) + rng.normal(0, sd, len(sizes))[day]), day


def percentiles(seconds: np.ndarray, day: np.ndarray, *, seed: int) -> np.ndarray:  # type: ignore[type-arg]
    """Return the 2.5 and 97.5 % percentiles of median and 90 % quantile over draws of days, shape (2, 2)."""
    rng = np.random.default_rng(seed)
    by_day = [seconds[day == d] for d in np.unique(day)]
    drawn = (np.concatenate([by_day[k] for k in rng.integers(0, len(by_day), len(by_day))]) for _ in range(DRAWS))
    found = np.array([np.quantile(values, (0.5, 0.9), method="inverted_cdf") for values in drawn])
    return np.asarray(np.quantile(found, (0.025, 0.975), axis=0))


def row(n_days: int, per_day: int, sd: float, n_weeks: int, seed: int) -> str:
    """Return a row of the table."""
    rng = np.random.default_rng([seed, n_days, per_day, round(100 * sd)])
    every = 3 + np.exp(rng.normal(np.log(5), np.hypot(1, sd), 4_000_000))
    truth, long_share = np.quantile(every, (0.5, 0.9)), (every >= DEFAULTS.sustained_s).mean()
    held = np.zeros(5)
    for k in range(n_weeks):
        sizes = rng.poisson(per_day * rng.gamma(16, 1 / 16, n_days))
        seconds, day = draw(rng, sizes, sd)
        found = durations(seconds, day, None, seed=k, n_boot=DRAWS)
        lo, hi = percentiles(seconds, day, seed=k)
        for i, (q, t) in enumerate(zip((found.median, found.p90), truth, strict=True)):
            held[i] += (q.lo or 0) <= t <= (q.hi or 0)
        share = found.long_share
        held[2] += share.lo is not None and share.hi is not None and share.lo <= long_share <= share.hi
        held[3:] += (lo <= truth) & (truth <= hi)
    cells = " | ".join(f"{h:.1%}" for h in held / n_weeks)
    return f"| {n_days} | {per_day} | {sd:.2f} | {cells} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--weeks", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    titles = ("days", "violations a day", "day sd", "median", "90 % quantile", "share of 30 s", "median, percentiles")
    print(f"| {' | '.join(titles)} | 90 %, percentiles |")
    print("|---|---|---|---|---|---|---|---|")
    with ProcessPoolExecutor(2) as pool:
        jobs = [pool.submit(row, *world, asked.weeks, asked.seed) for world in WORLDS]
        for job in jobs:
            print(job.result())


if __name__ == "__main__":
    main()
