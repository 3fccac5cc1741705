"""Draws weeks with known truth and prints how often the intervals of `vsd_analytics.stats` hold it.

Run `python tests/stats/prove_intervals.py --weeks 2000`; the tables stand in docs/statistics.md.

The world: a site with four cameras of unequal share, each with its own weekday profile, open 13 hours (8 on Sunday).
A day moves all its violations by a common factor, gamma with mean 1 and sd `day_sd`; given that, each camera's daily
count is Poisson, so counts are gamma-Poisson (negative binomial). People move with the same factor to the power 0.7
times one of their own, so that a crowded day is also a riskier one. The profile is assumed, not measured; its
highest day has 1.9 times the violations per hour of its lowest.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.special import gammaln, stdtrit

from vsd_analytics.stats.changes import compare_exposure, compare_how_often, compare_how_risky
from vsd_analytics.stats.rates import how_often, how_risky

WEEKDAYS = np.arange(7)
OPEN_H = np.tile([13.0] * 6 + [8.0], (4, 1))
PROFILE = np.array([0.80, 0.82, 0.88, 0.95, 1.15, 1.50, 0.90])
TILT = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.1, 0.1, 0.0, 0.0, 0.0, -0.1, -0.1],
        [-0.1, 0.0, 0.0, 0.0, 0.0, 0.1, 0.2],
        [0.0, 0.1, -0.1, 0.1, -0.1, 0.0, 0.0],
    ]
)
CAMERA_SHARE = np.array([[0.4], [0.3], [0.2], [0.1]])
HISTORY_WEEKS = 4
RECORDS_PER_EPISODE = 10  # 3 and a geometric number of mean 7: violations last at least 3 s at one record a second


@dataclass(frozen=True)
class World:
    """A site whose truth is known.

    Attributes:
        episodes: Mean violations a week with all cameras up.
        day_sd: Standard deviation of the day's factor.
        n_days_down: Days one camera is down, both drawn anew each week.
        is_weekend_down: The camera with the largest share is down from Thursday to Sunday, every week.
        is_shock_shared: One factor per day for all cameras; else one for each camera.
    """

    episodes: float
    day_sd: float
    n_days_down: int = 0
    is_weekend_down: bool = False
    is_shock_shared: bool = True

    @property
    def expected(self) -> np.ndarray:
        """Return expected violations, shape (4, 7)."""
        shape = PROFILE * (1 + TILT) * OPEN_H
        return self.episodes * CAMERA_SHARE * shape / shape.sum(axis=1, keepdims=True)

    @property
    def expected_people(self) -> np.ndarray:
        """Return expected person-hours, shape (4, 7): flatter over the week than violations."""
        shape = PROFILE**0.7 * OPEN_H
        people = self.episodes / 1.5 * CAMERA_SHARE * shape / shape.sum()
        k = 1 / self.day_sd**2
        return people * np.exp(gammaln(k + 0.7) - gammaln(k) - 0.7 * np.log(k))

    def draw(self, rng: np.random.Generator, weeks: int, *, effect: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Draw violations and person-hours of `weeks` weeks, each of shape (weeks, 4, 7), all cameras up."""
        size = (weeks, 1 if self.is_shock_shared else 4, 7)
        factor = rng.gamma(1 / self.day_sd**2, self.day_sd**2, size)
        own = rng.gamma(4 / self.day_sd**2, self.day_sd**2 / 4, size)
        k = 1 / self.day_sd**2
        mean = np.exp(gammaln(k + 0.7) - gammaln(k) - 0.7 * np.log(k))
        people = self.expected_people / mean * factor**0.7 * own
        return rng.poisson(effect * self.expected * factor).astype(float), people

    def hours(self, rng: np.random.Generator, weeks: int) -> np.ndarray:
        """Draw recorded open hours, shape (weeks, 4, 7)."""
        hours = np.tile(OPEN_H, (weeks, 1, 1))
        for week in hours if self.n_days_down else ():
            week[rng.integers(4), rng.permutation(7)[: self.n_days_down]] = 0
        if self.is_weekend_down:
            hours[:, 0, 3:] = 0
        return hours


@dataclass(frozen=True)
class Score:
    """Of one figure in one world: how often its interval held the truth, how wide it was, how often it spoke."""

    coverage: float
    width: float
    clear: float


def score(estimates: list[tuple[Any, float]]) -> Score:
    """Return the score of intervals paired with their truths; one without limits holds anything."""
    held = [e.lo is None or e.lo <= truth <= e.hi for e, truth in estimates]
    widths = [np.log(e.hi / e.lo) / 2 for e, _ in estimates if e.lo]
    clear = [getattr(e, "verdict", "").startswith("clear") for e, _ in estimates]
    return Score(float(np.mean(held)), float(np.median(widths)), float(np.mean(clear)))


@dataclass(frozen=True)
class _Naive:
    lo: float
    hi: float


def naive_level(rng: np.random.Generator, n: np.ndarray, x: np.ndarray) -> _Naive:
    """Return the interval of a rate from records as if they were a Poisson count, per violation."""
    records = sum(3 * int(total) + rng.negative_binomial(max(int(total), 1), 1 / 8) for total in n.sum(axis=1))
    rate = (n.sum(axis=1) / x.sum(axis=1)).sum() * records / RECORDS_PER_EPISODE / max(n.sum(), 1)
    return _Naive(rate * np.exp(-1.96 / records**0.5), rate * np.exp(1.96 / records**0.5))


def naive_change(rng: np.random.Generator, before: tuple[Any, Any], after: tuple[Any, Any]) -> _Naive:
    """Return the interval of a ratio from records as if they were Poisson counts."""
    a, b = naive_level(rng, *before), naive_level(rng, *after)
    theta = (b.lo * b.hi / (a.lo * a.hi)) ** 0.5
    half = np.hypot(np.log(a.hi / a.lo), np.log(b.hi / b.lo)) / 2
    return _Naive(theta * np.exp(-half), theta * np.exp(half))


def per_camera_change(before: tuple[Any, Any], after: tuple[Any, Any]) -> _Naive:
    """Return the interval of a ratio with k = D/(D-1) and df = D-1 whatever days each camera missed."""
    logs, influences = [], []
    for n, x in (before, after):
        rates = n.sum(axis=1) / x.sum(axis=1)
        logs.append(np.log(rates.sum()))
        influences.append(((n - rates[:, None] * x) / x.sum(axis=1)[:, None]).sum(axis=0) / rates.sum())
    n_days = int((before[1] > 0).any(axis=0).sum())
    se = np.sqrt(n_days / (n_days - 1) * ((influences[1] - influences[0]) ** 2).sum())
    log_theta, half = logs[1] - logs[0], stdtrit(n_days - 1, 0.975) * se
    return _Naive(np.exp(log_theta - half), np.exp(log_theta + half))


def run_levels(world: World, *, weeks: int, seed: int) -> dict[str, Score]:
    """Return scores of levels. The truth of M0 is the week with all cameras up, and once that of recorded hours."""
    rng = np.random.default_rng(seed)
    past_n, past_people = (a.reshape(weeks, HISTORY_WEEKS, 4, 7) for a in world.draw(rng, weeks * HISTORY_WEEKS))
    n, people = world.draw(rng, weeks)
    x = world.hours(rng, weeks)
    n, people = n * (x > 0), people * (x > 0)
    whole_week = float((world.expected.sum(axis=1) / OPEN_H.sum(axis=1)).sum())
    found: dict[str, list[tuple[Any, float]]] = {}
    for i in range(weeks):
        history = {
            "weekday": WEEKDAYS,
            "history_weekday": np.tile(WEEKDAYS, HISTORY_WEEKS),
            "history_n": past_n[i].transpose(1, 0, 2).reshape(4, -1),
        }
        past_x = np.tile(OPEN_H, HISTORY_WEEKS)
        plain, informed = how_often(n[i], x[i]), how_often(n[i], x[i], history_x_h=past_x, **history)
        recorded = float(((world.expected * (x[i] > 0)).sum(axis=1) / x[i].sum(axis=1)).sum())
        up = x[i] > 0
        risk = float((world.expected * up).sum() / (world.expected_people * up).sum())
        days = n[i].sum(axis=0), people[i].sum(axis=0)
        history["history_n"] = past_n[i].sum(axis=1).ravel()
        risky = how_risky(*days, history_exposure_h=past_people[i].sum(axis=1).ravel(), **history)
        for name, estimate, truth in (
            ("M0, first weeks", plain, whole_week),
            ("M0, four weeks of history", informed, whole_week),
            ("M0, four weeks, truth of recorded hours", informed, recorded),
            ("M7, first weeks", how_risky(*days), risk),
            ("M7, four weeks of history", risky, risk),
            ("naive", naive_level(rng, n[i], x[i]), whole_week),
        ):
            found.setdefault(name, []).append((estimate, truth))
    return {name: score(estimates) for name, estimates in found.items()}


def run_changes(world: World, *, weeks: int, seed: int, effect: float = 1.0) -> dict[str, Score]:
    """Return scores of week-over-week changes; violations of the second week are `effect` times as frequent."""
    rng = np.random.default_rng(seed)
    n_a, people_a = world.draw(rng, weeks)
    n_b, people_b = world.draw(rng, weeks, effect=effect)
    x = world.hours(rng, weeks)
    n_a, people_a, n_b, people_b = (array * (x > 0) for array in (n_a, people_a, n_b, people_b))
    found: dict[str, list[tuple[Any, float]]] = {"M0": [], "M7": [], "people": [], "D/(D-1)": [], "naive": []}
    for i in range(weeks):
        sums = [array[i].sum(axis=0) for array in (n_a, people_a, n_b, people_b)]
        found["M0"].append((compare_how_often(n_a[i], x[i], n_b[i], x[i]), effect))
        found["M7"].append((compare_how_risky(*sums), effect))
        found["people"].append((compare_exposure(people_a[i], x[i], people_b[i], x[i]), 1.0))
        found["D/(D-1)"].append((per_camera_change((n_a[i], x[i]), (n_b[i], x[i])), effect))
        found["naive"].append((naive_change(rng, (n_a[i], x[i]), (n_b[i], x[i])), effect))
    return {name: score(estimates) for name, estimates in found.items()}


def worlds() -> Iterator[World]:
    """Yield the worlds of the tables."""
    for episodes in (300, 3000):
        for day_sd in (0.05, 0.10, 0.25):
            yield World(episodes, day_sd)
            yield World(episodes, day_sd, n_days_down=4)


def weekend_worlds() -> Iterator[World]:
    """Yield worlds in which the missed days are the busy ones, on the camera that matters most."""
    for episodes in (300, 3000):
        for day_sd in (0.05, 0.25):
            yield World(episodes, day_sd, is_weekend_down=True)


def hard_worlds() -> Iterator[World]:
    """Yield worlds that try the small-sample correction: long outages, days that move each camera on its own."""
    for episodes in (300, 3000):
        for is_shared in (True, False):
            for n_days_down in (4, 5, 6):
                yield World(episodes, 0.10, n_days_down=n_days_down, is_shock_shared=is_shared)


def _head(world: World) -> str:
    if world.is_weekend_down:
        return f"| {world.episodes:,.0f} | {world.day_sd:.2f} | largest down Thursday to Sunday | "
    cameras = f"one of four down {world.n_days_down} days" if world.n_days_down else "all up"
    own = "" if world.is_shock_shared else ", each its own days"
    return f"| {world.episodes:,.0f} | {world.day_sd:.2f} | {cameras}{own} | "


def _table(
    title: str,
    run: Callable[[World], dict[str, Score]],
    columns: list[str],
    *,
    over: Iterator[World],
    shown: Callable[[Score], str],
) -> None:
    print(f"\n{title}\n\n| violations a week | day sd | cameras | " + " | ".join(columns) + " |")
    print("|---" * (3 + len(columns)) + "|")
    for world in over:
        scores = run(world)
        print(_head(world) + " | ".join(shown(scores[name]) for name in columns) + " |", flush=True)


def main() -> None:
    """Print the tables of docs/statistics.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weeks", type=int, default=2000, help="weeks drawn per cell")
    parser.add_argument("--seed", type=int, default=20261109)
    settings = vars(parser.parse_args())
    held = lambda s: f"{100 * s.coverage:.1f} % (±{100 * s.width:.0f} %)"  # noqa: E731
    levels = ["M0, first weeks", "M0, four weeks of history", "M0, four weeks, truth of recorded hours"]
    levels += ["M7, first weeks", "M7, four weeks of history", "naive"]
    changes = partial(run_changes, **settings)
    _table("Levels", partial(run_levels, **settings), levels, over=worlds(), shown=held)
    _table("Levels, busy days missed", partial(run_levels, **settings), levels, over=weekend_worlds(), shown=held)
    _table("Week over week", changes, ["M0", "M7", "people", "naive"], over=worlds(), shown=held)
    _table("Week over week, hard", changes, ["M0", "D/(D-1)"], over=hard_worlds(), shown=held)
    power = lambda s: f"{100 * s.clear:.0f} %"  # noqa: E731
    fall = partial(run_changes, effect=0.86, **settings)
    _table("Power for a true fall of 14 %", fall, ["M0", "M7"], over=worlds(), shown=power)


if __name__ == "__main__":
    main()
