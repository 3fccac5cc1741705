"""Draws years with known truth and prints how good forecasts, unusual hours and hour profiles are.

Run `python tests/stats/prove_forecast.py --worlds 20`; the tables are in docs/methods/forecasts.md.

The world: a shop open 13 hours (8 on Sunday) with a midday and an evening peak, Saturday half as busy again, Sunday
quieter. Over the year people grow by a fifth; a season of a fifth up and down also moves the evening; weeks wander
(autoregressive, .8, sd .04); 12 weeks of school holidays empty and flatten working days; the week before Christmas
has a third more. A day has a gamma factor of the stated sd, each hour another. People in view are the sum of visits of
a quarter of an hour; violations are gamma-Poisson with mean proportional to people to the power 1.4. Nine closed days a
year, one hour in fifty missing, and outages of three days. All of it is assumed, none measured.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from typing import Any

import numpy as np

from vsd_analytics.stats.forecast import chances, forecast_week, score_forecast
from vsd_analytics.stats.hour_of_week import slot_rates
from vsd_analytics.stats.quantiles import poisson_limits
from vsd_analytics.stats.unusual import unusual_hours

WEEKS = 52
HISTORY_WEEKS = 12
SCHOOL_HOLIDAYS = (51, 0, 7, 14, 15, 27, 28, 29, 30, 31, 32, 43)
HOURS = np.arange(24)
OPEN = np.zeros((7, 24), dtype=bool)
OPEN[:6, 8:21] = True
OPEN[6, 10:18] = True


def _day(noon: float, evening: float, width_h: float = 2.0) -> np.ndarray:
    return 0.25 + noon * np.exp(-(((HOURS - 12.5) / width_h) ** 2)) + evening * np.exp(-(((HOURS - 17.5) / 2.2) ** 2))


_SHAPE = [_day(0.9, 1.0), _day(0.85, 1.0), _day(0.95, 1.05), _day(0.95, 1.1), _day(1.1, 1.5)]
_SHAPE += [_day(1.9, 1.4, 3.0), _day(1.3, 0.4, 3.0)]
PROFILE = np.array(_SHAPE) * np.array([1, 0.95, 1, 1.05, 1.2, 1.5, 0.9])[:, None]


@dataclass(frozen=True)
class World:
    """A site whose truth is known.

    Attributes:
        name: In words.
        people: Mean number in view where the profile is 1.
        violations: Mean number per hour there.
        day_sd, hour_sd: Standard deviation of the factors of a day and an hour.
        is_calm: No growth, season, wandering weeks or school holidays.
    """

    name: str
    people: float = 20.0
    violations: float = 40.0
    day_sd: float = 0.15
    hour_sd: float = 0.10
    is_calm: bool = False

    def draw(self, rng: np.random.Generator, weeks: int = WEEKS) -> tuple[np.ndarray, np.ndarray]:
        """Draw mean people in view and violations, each (weeks, 168), NaN where closed or not recorded."""
        people, violations = np.full((2, weeks, 7, 24), np.nan)
        start, level = int(rng.integers(52)), 0.0
        for w in range(weeks):
            level = 0.8 * level + 0.04 * rng.standard_normal()
            mean = self.people * PROFILE * (1.0 if self.is_calm else self._drift((start + w) % 52, w / 52, level))
            mean = mean * self._factors(rng)
            people[w] = rng.poisson(4 * mean) / 4
            violations[w] = rng.poisson(self.violations * (mean / self.people) ** 1.4 * rng.gamma(25, 1 / 25, (7, 24)))
            missing = ~OPEN | (rng.random((7, 1)) < 9 / 365) | (rng.random((7, 24)) < 0.02)
            if rng.random() < 0.04:
                day = int(rng.integers(5))
                missing[day : day + 3] = True
            people[w][missing] = violations[w][missing] = np.nan
        return people.reshape(weeks, 168), violations.reshape(weeks, 168)

    def _drift(self, week_of_year: int, years: float, level: float) -> np.ndarray:
        season = np.sin(2 * np.pi * (week_of_year - 12) / 52)
        factor = np.exp(level) * (1 + 0.2 * years) * (1 + 0.2 * season) * (1.35 if week_of_year == 50 else 1.0)
        drift = factor * np.tile(np.exp(0.25 * season * (HOURS - 14.5) / 6), (7, 1))
        if week_of_year in SCHOOL_HOLIDAYS:
            drift[:5] *= 0.8 * np.exp(-0.15 * (HOURS - 14.5) / 6)
        return drift

    def _factors(self, rng: np.random.Generator) -> np.ndarray:
        days, hours = (1 / sd**2 for sd in (self.day_sd, self.hour_sd))
        return rng.gamma(days, 1 / days, (7, 1)) * rng.gamma(hours, 1 / hours, (7, 24))


WORLDS = (
    World("shop"),
    World("shop, day sd .25", day_sd=0.25, hour_sd=0.20),
    World("shop without drift", is_calm=True),
    World("small shop", people=6.0, violations=6.0),
    World("quiet shop", people=2.0, violations=0.5),
)


def counted(rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return counts and recorded hours of rates with NaN where nothing was recorded."""
    return np.nan_to_num(rates), (~np.isnan(rates)).astype(float)


def nanmedian(values: np.ndarray) -> np.ndarray:
    """Return the median of each column, NaN where nothing is known."""
    known = ~np.isnan(values).all(axis=0)
    found = np.full(values.shape[1], np.nan)
    found[known] = np.nanmedian(values[:, known], axis=0)
    return found


def run_forecasts(seed: int, *, world: World, which: int) -> list[dict[str, float]]:
    """Return the scores of each origin of one year; `which` is 0 for people and 1 for violations."""
    year = world.draw(np.random.default_rng(seed))[which]
    found = []
    for origin in range(4, WEEKS):
        n, x_h = counted(year[max(0, origin - HISTORY_WEEKS) : origin])
        made = forecast_week(n, x_h, is_count=which == 1)
        now = counted(year[origin])
        score = score_forecast(made, *now)
        if score.state != "ok" or score.mase is None or score.mase_naive is None:
            continue
        median = nanmedian(np.where(x_h > 0, n, np.nan)[-8:])
        plain = score_forecast(replace(made, mean=np.where(np.isnan(made.mean), np.nan, median)), *now)
        happened = float(np.nansum(year[origin]))
        both = {"": score, "median ": plain}
        row = {"MASE naive": score.mase_naive, "hit": score.hit_rate or 0.0, "happened": happened}
        row |= {f"MASE {k}".strip(): s.mase or 0.0 for k, s in both.items()}
        row |= {f"wrong {k}".strip(): (s.wape or 0.0) * happened for k, s in both.items()}
        row["wrong naive"] = (score.wape_naive or 0.0) * happened
        found.append(row)
    return found


def run_chances(seed: int, *, world: World) -> list[dict[str, float]]:
    """Return log and Brier scores of P(at least one) of a rare event, beside a mean of 8 weeks and last week."""
    rng = np.random.default_rng(seed)
    people, _ = world.draw(rng)
    rare = np.where(np.isnan(people), np.nan, rng.poisson(0.25 * (np.nan_to_num(people) / world.people) ** 2))
    found = []
    for origin in range(8, WEEKS):
        n, x_h = counted(rare[origin - 8 : origin])
        made = chances(n, x_h)
        told = ~np.isnan(made.chance) & ~np.isnan(rare[origin])
        happened = rare[origin][told] > 0
        mean = 1 - np.exp(-n.sum(axis=0)[told] / np.maximum(x_h.sum(axis=0)[told], 1))
        for name, told_p in (("EB", made.chance[told]), ("mean", mean), ("last", (n[-1][told] > 0).astype(float))):
            p = np.clip(told_p, 0.01, 0.99)
            log_score = -np.where(happened, np.log(p), np.log(1 - p)).mean()
            found.append({f"log {name}": log_score, f"Brier {name}": float(((p - happened) ** 2).mean())})
    return found


def z_flags(now: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return hours with |z| > 3 on the square root scale, z from mean and sd of the same hour's eight weeks."""
    roots, flags = np.sqrt(before), np.zeros(len(now), dtype=bool)
    known = (~np.isnan(before)).sum(axis=0) >= 4
    middle, sd = np.nanmean(roots[:, known], axis=0), np.nanstd(roots[:, known], axis=0, ddof=1)
    flags[known] = np.abs(np.sqrt(now[known]) - middle) > 3 * sd
    return flags


def run_unusual(seed: int, *, world: World) -> list[dict[str, float]]:
    """Return false flags per week without anything planted, and whether one tripled hour is found."""
    rng = np.random.default_rng(seed)
    _, year = world.draw(rng)
    found = []
    for origin in range(8, WEEKS):
        before = year[origin - 8 : origin]
        n, x_h = counted(before)
        row: dict[str, float] = {}
        for planted in (False, True):
            now = year[origin].copy()
            mean = n.sum(axis=0) / np.maximum(x_h.sum(axis=0), 1)
            busy = np.flatnonzero(~np.isnan(now) & (mean >= 5) & (x_h.sum(axis=0) >= 4))
            if planted and not len(busy):
                continue
            slot = int(rng.choice(busy)) if planted else -1
            if planted:  # three times as many events of the same hour: two more draws of its own mean
                now[slot] += rng.poisson(2 * mean[slot])
            told = unusual_hours(*counted(now), monday=date(2026, 11, 9), before_n=n, before_x_h=x_h, max_shown=168)
            flags = z_flags(now, before)
            if planted:
                row |= {
                    "power": float(slot in {24 * r.weekday + r.hour for r in told.rows}),
                    "power z": float(flags[slot]),
                }
            else:
                row |= {"flags": len(told.rows), "any": float(len(told.rows) > 0)}
                row |= {"flags z": float(flags.sum()), "any z": float(flags.any())}
        found.append(row)
    return found


def run_profiles(seed: int, *, world: World) -> list[dict[str, float]]:
    """Return how often the 95 % intervals of violations per hour hold the truth, beside Poisson's, four weeks each."""
    rng = np.random.default_rng(seed)
    calm = replace(world, is_calm=True)
    truth = world.violations * PROFILE.ravel() ** 1.4
    truth *= np.mean([(calm._factors(rng) ** 1.4).mean() for _ in range(2000)])
    found = []
    for _ in range(10):
        _, weeks = calm.draw(rng, weeks=4)
        n, x_h = counted(weeks)
        made = slot_rates(n, x_h)
        told = np.flatnonzero(~np.isnan(made.rate))
        held = (made.lo[told] <= truth[told]) & (truth[told] <= made.hi[told])
        exposure = x_h.sum(axis=0)
        limits = np.array([poisson_limits(n[:, s].sum(), confidence=0.95) for s in told]) / exposure[told, None]
        naive = (limits[:, 0] <= truth[told]) & (truth[told] <= limits[:, 1])
        error, raw = (np.abs(r[told] - truth[told]).mean() for r in (made.rate, made.raw))
        found.append({"held": held.mean(), "held naive": naive.mean(), "error": error, "error raw": raw})
    return found


def _mean(rows: list[dict[str, float]], name: str) -> float:
    return float(np.mean([r[name] for r in rows if name in r]))


def _table(title: str, columns: list[str], lines: Iterator[list[str]]) -> None:
    print(f"\n{title}\n\n| " + " | ".join(columns) + " |\n" + "|---" * len(columns) + "|")
    for line in lines:
        print("| " + " | ".join(line) + " |", flush=True)


def main() -> None:
    """Print the tables of docs/methods/forecasts.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=20, help="years drawn per row")
    parser.add_argument("--seed", type=int, default=20261109)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.worlds)
    with ProcessPoolExecutor(2) as pool:

        def rows(run: Callable[..., list[dict[str, float]]], **arguments: Any) -> list[dict[str, float]]:
            return [row for year in pool.map(partial(run, **arguments), seeds, chunksize=2) for row in year]

        def forecasts() -> Iterator[list[str]]:
            for world in WORLDS:
                for which, quantity in enumerate(("people in view", "violations per hour")):
                    found = rows(run_forecasts, world=world, which=which)
                    wape = [
                        _mean(found, k) / _mean(found, "happened") for k in ("wrong", "wrong median", "wrong naive")
                    ]
                    mase = [_mean(found, k) for k in ("MASE", "MASE median", "MASE naive")]
                    yield [
                        world.name, quantity, f"{len(found):,}", *(f"{v:.2f}" for v in mase),
                        *(f"{v:.0%}" for v in wape), f"{_mean(found, 'hit'):.0%}",
                    ]  # fmt: skip

        columns = ["world", "quantity", "weeks", "MASE", "MASE, plain median", "MASE, seasonal naive"]
        columns += ["WAPE", "WAPE, plain median", "WAPE, seasonal naive", "in the 80 % range"]
        _table("Forecasts", columns, forecasts())

        def rare() -> Iterator[list[str]]:
            for world in WORLDS:
                found = rows(run_chances, world=world)
                yield [world.name, *(f"{_mean(found, f'{s} {k}'):.3f}" for s in ("log", "Brier") for k in _RARE)]

        titles = ("empirical Bayes", "mean of 8 weeks", "as last week")
        _table("Rare events", ["world", *(f"{s}, {t}" for s in ("log score", "Brier") for t in titles)], rare())

        def unusual() -> Iterator[list[str]]:
            for world in WORLDS:
                found = rows(run_unusual, world=world)
                flags = [
                    f"{_mean(found, k):.2f} ({_mean(found, a):.0%})"
                    for k, a in (("flags", "any"), ("flags z", "any z"))
                ]
                power = [f"{_mean(found, k):.0%}" for k in ("power", "power z")]
                yield [world.name, f"{len(found):,}", *flags, *power]

        columns = ["world", "weeks", "false flags a week (weeks with any)", "the same, |z| > 3"]
        _table("Unusual hours", [*columns, "tripled hour found", "the same, |z| > 3"], unusual())

        def profiles() -> Iterator[list[str]]:
            for world in (*WORLDS[:2], *WORLDS[3:]):
                found = rows(run_profiles, world=world)
                held = [f"{_mean(found, k):.1%}" for k in ("held", "held naive")]
                yield [world.name, *held, *(f"{_mean(found, k):.2f}" for k in ("error", "error raw"))]

        columns = ["world", "95 % intervals that hold", "Poisson's", "mean error", "mean error of the raw rate"]
        _table("Hours of the week, four weeks", columns, profiles())


_RARE = ("EB", "mean", "last")

if __name__ == "__main__":
    main()
