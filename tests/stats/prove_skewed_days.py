"""Draws weeks at places where a few days have much more than the others, and prints how often levels hold the truth.

Run `python tests/stats/prove_skewed_days.py --weeks 2000`; the table is in docs/methods/ranges.md. The generators share
nothing with the demo's or with `prove_intervals.py`: day effects are log-normal. What makes days skewed, by world:

* coach parties: on a share of the days, drawn by coin, a gamma amount (shape 4) is added, a quarter of all violations;
* heavy days: a day's effect is log-normal with sd .8, so no day is usual;
* matches: one fixed day in every second week has three times its violations, at a place open five days;
* calm: no such days, to see what the rule costs where it is not needed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from vsd_analytics.stats.rates import violation_rate

WEEKDAYS = np.array([0.8, 0.85, 0.95, 1.0, 1.3, 1.35, 0.75])
OPEN_H = 10.0
COACH_PART = 0.25


@dataclass(frozen=True)
class World:
    """A place whose true level is known.

    Attributes:
        kind: calm, coaches, heavy or matches.
        violations: Mean violations a day.
        day_sd: Log sd of all days.
        coach_days: Share of days with a coach party.
    """

    kind: str
    violations: float
    day_sd: float
    coach_days: float = 0.0

    @property
    def n_weekdays(self) -> int:
        """Return the open days of a week."""
        return 5 if self.kind == "matches" else 7

    @property
    def name(self) -> str:
        """Return what the table calls the world."""
        return f"coaches on {self.coach_days:.0%} of days" if self.kind == "coaches" else self.kind

    def draw(self, rng: np.random.Generator, weeks: int) -> np.ndarray:
        """Return violations, shape (weeks, n_weekdays), of mean `violations` over all days."""
        profile = WEEKDAYS[: self.n_weekdays] / WEEKDAYS[: self.n_weekdays].mean()
        sd = 0.8 if self.kind == "heavy" else self.day_sd
        usual = profile * rng.lognormal(-(sd**2) / 2, sd, (weeks, self.n_weekdays))
        if self.kind == "coaches":
            parties = rng.random(usual.shape) < self.coach_days
            usual = (1 - COACH_PART) * usual + parties * COACH_PART / self.coach_days * rng.gamma(4, 0.25, usual.shape)
        if self.kind == "matches":
            usual[rng.integers(2) :: 2, 2] *= 3
            usual /= 1 + profile[2] / self.n_weekdays  # every second week has twice that day's violations more
        return rng.poisson(self.violations * usual).astype(float)


def score(world: World, *, history: int, weeks: int, seed: int) -> tuple[float, float, float]:
    """Return the shares of weeks whose interval holds the truth, lies below it, and the median half width in logs."""
    rng = np.random.default_rng(seed)
    truth, weekday = world.violations / OPEN_H, np.arange(world.n_weekdays)
    below, above, widths, n_judged = 0, 0, [], 0
    for _ in range(weeks):
        counts = world.draw(rng, history + 1)
        hours = np.full(counts.shape, OPEN_H)
        past = (
            {
                "weekday": weekday,
                "history_n": counts[:-1].ravel(),
                "history_x_h": hours[:-1].ravel(),
                "history_weekday": np.tile(weekday, history),
            }
            if history
            else {}
        )
        rate = violation_rate(counts[-1], hours[-1], **past)
        if rate.lo is None or rate.hi is None:
            continue
        n_judged += 1
        below += rate.hi < truth
        above += rate.lo > truth
        widths.append(np.log(rate.hi / rate.lo) / 2)
    return 1 - (below + above) / n_judged, below / n_judged, float(np.median(widths))


def worlds() -> Iterator[World]:
    """Yield the worlds of the table."""
    for violations in (400.0, 40.0, 8.0):
        for day_sd in (0.1, 0.25, 0.4):
            yield World("calm", violations, day_sd)
            for coach_days in (0.1, 0.2, 0.3):
                yield World("coaches", violations, day_sd, coach_days)
        yield World("heavy", violations, 0.8)
        yield World("matches", violations, 0.15)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weeks", type=int, default=2000, help="weeks by world and history")
    parser.add_argument("--seed", type=int, default=20261128)
    arguments = parser.parse_args()
    histories = (0, 4, 5)
    print("| days | violations a day | day sd | first weeks | four weeks of history | five weeks of history |")
    print("|---" * 6 + "|")
    with ProcessPoolExecutor(2) as pool:
        runs = [
            pool.map(partial(score, history=h, weeks=arguments.weeks, seed=arguments.seed), worlds()) for h in histories
        ]
        for world, *scores in zip(worlds(), *runs, strict=True):
            cells = (f"{100 * held:.1f} % (too low {100 * low:.1f}; ±{100 * half:.0f} %)" for held, low, half in scores)
            print(f"| {world.name} | {world.violations:g} | {world.day_sd:g} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
