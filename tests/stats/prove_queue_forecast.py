"""The forecast of people waiting against weeks that then happened: coverage of its range, and how often it warns.

    python tests/stats/prove_queue_forecast.py --sites 60

Twelve weeks of a queue of queue_worlds.py, Saturdays a fifth busier, forecast the thirteenth. The limit is the number
of people that a tenth of the hours exceeds in the long run. Naive: the same hour of the week before. The table is in
docs/methods/forecasts.md.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from queue_worlds import HOUR_S, HOURLY, World, one_day

from vsd_analytics.stats.forecast import forecast_week, score_forecast
from vsd_analytics.stats.hour_of_week import SLOTS

N_WEEKS = 12
WEEKDAY = np.array([0.95, 0.9, 0.95, 1.0, 1.1, 1.2, 0.9])
OPENS = 9
HEAD = (
    "world", "hours in the 80 % range", "off by", "naive",
    "busy hours named likely", "expected", "possible", "not named",
    "of hours named likely were busy", "expected",
)  # fmt: skip


@dataclass(frozen=True)
class Weeks:
    """How weeks differ: standard deviation of ln of a week's level, growth a week, and share of hours not recorded."""

    name: str
    queue: World
    week_sd: float = 0.05
    growth: float = 0.0
    missing: float = 0.0


WORLDS = (
    Weeks("weeks alike", World("", day_sd=0.1)),
    Weeks("weeks differ", World("", day_sd=0.1), week_sd=0.15),
    Weeks("days differ much", World("", day_sd=0.3)),
    Weeks("3 % more every week", World("", day_sd=0.1), growth=0.03),
    Weeks("a third of the hours not recorded", World("", day_sd=0.1), missing=0.33),
    Weeks("short queue, few people", World("", per_hour=20, n_servers=1, service_s=130)),
)


def people(world: Weeks, n_weeks: int, rng: np.random.Generator) -> np.ndarray:
    """Return the mean number of people waiting by week and hour of the week, 0 where closed, shape (n_weeks, 168)."""
    found = np.zeros((n_weeks, 7, 24))
    for w in range(n_weeks):
        level = np.exp(rng.normal(0, world.week_sd) + world.growth * (w - n_weeks))
        for d in range(7):
            day = one_day(replace(world.queue, per_hour=world.queue.per_hour * level * WEEKDAY[d]), rng)
            found[w, d, OPENS : OPENS + len(HOURLY)] = day.people() @ np.arange(60.0) / HOUR_S
    return found.reshape(n_weeks, SLOTS)


def row(world: Weeks, *, n_sites: int) -> tuple[str, ...]:
    """Return one line of the table."""
    is_open = np.tile((np.arange(24) >= OPENS) & (np.arange(24) < OPENS + len(HOURLY)), 7)
    limit = float(np.quantile(people(world, 40, np.random.default_rng(10**6))[:, is_open], 0.9))
    hit, wape, naive = [], [], []
    named = np.zeros((4, 2))
    for seed in range(n_sites):
        rng = np.random.default_rng(seed)
        every = people(world, N_WEEKS + 1, rng)
        x_h = np.where(is_open & (rng.random((N_WEEKS, SLOTS)) >= world.missing), 1.0, 0.0)
        made = forecast_week(every[:-1] * x_h, x_h, is_count=False, open_h=is_open.astype(float))
        score = score_forecast(made, every[-1], is_open.astype(float))
        hit.append(score.hit_rate)
        wape.append(score.wape)
        naive.append(score.wape_naive)
        known = np.isfinite(made.mean)
        chance = np.select([made.lo > limit, made.mean > limit, made.hi > limit], [0, 1, 2], 3)
        for k in range(4):
            at = known & (chance == k)
            named[k] += (every[-1][at] > limit).sum(), at.sum()
    busy = named[:, 0] / named[:, 0].sum()
    right = [f"{b / max(n, 1):.0%} of {n / n_sites:.1f} a week" for b, n in named[:2]]
    return (world.name, f"{np.mean(hit):.1%}", f"{np.mean(wape):.0%}", f"{np.mean(naive):.0%}",
            *(f"{b:.0%}" for b in busy), *right)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=60)
    n_sites = parser.parse_args().sites
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    for world in WORLDS:
        print(f"| {' | '.join(row(world, n_sites=n_sites))} |", flush=True)


if __name__ == "__main__":
    main()
