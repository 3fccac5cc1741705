"""Draws weeks with known truth and prints how often the intervals of `vsd_analytics.stats` hold it.

Run `python tests/stats/prove_intervals.py --weeks 2000`; the tables are in docs/methods/ranges.md.

The world: a site with four cameras of unequal share, each with its own weekday profile, open 13 hours (8 on Sunday).
A day moves all its violations by a common factor, gamma with mean 1 and sd `day_sd`; given that, each camera's daily
count is Poisson, so counts are gamma-Poisson (negative binomial). People move with the same factor to the power 0.7
times one of their own, so that a crowded day is also a riskier one. Of the weekday profiles (`PROFILES`) one is
measured, the others are assumed in part or wholly.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import date, datetime, time, timedelta
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.special import gammaln, stdtrit

from vsd_analytics.site.model import Site
from vsd_analytics.stats.changes import compare_encounter_rates, compare_exposure, compare_violation_rates
from vsd_analytics.stats.rates import encounter_rate, violation_rate

HOUR = timedelta(hours=1)

OFFICE = (0.224, 0.217, 0.197, 0.226, 0.137)
PROFILES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "office, closed at weekends": (OFFICE, (10.0,) * 5),
    "office, weekends assumed": ((*OFFICE, 0.069, 0.069), (10.0,) * 7),
    "shop, assumed": ((0.80, 0.82, 0.88, 0.95, 1.15, 1.50, 0.90), (13.0,) * 6 + (8.0,)),
}
"""Violations per open hour of each weekday, up to a factor, and open hours, from Monday on.

OFFICE is measured: shares of 4,592 contacts of the SocioPatterns workplace 2013 by weekday (records of a pair in a row,
20 s each, are one contact; two weeks of five days from 2013-06-24, 8 to 19 o'clock; no record at weekends). Where
weekends are assumed, Saturday and Sunday have half of Friday each.
"""
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
        restless: How many times the weeks before's sd the stated sd is.
    """

    episodes: float
    day_sd: float
    n_days_down: int = 0
    is_weekend_down: bool = False
    is_shock_shared: bool = True
    profile: str = "shop, assumed"
    restless: float = 1.0

    @property
    def open_h(self) -> np.ndarray:
        """Return opening hours, shape (4, n_days)."""
        return np.tile(PROFILES[self.profile][1], (4, 1))

    @property
    def n_days(self) -> int:
        """Return the days a week on which it is open."""
        return self.open_h.shape[1]

    @property
    def expected(self) -> np.ndarray:
        """Return expected violations, shape (4, n_days)."""
        shape = np.array(PROFILES[self.profile][0]) * (1 + TILT[:, : self.n_days]) * self.open_h
        return self.episodes * CAMERA_SHARE * shape / shape.sum(axis=1, keepdims=True)

    @property
    def expected_people(self) -> np.ndarray:
        """Return expected person-hours, shape (4, n_days): flatter over the week than violations."""
        shape = np.array(PROFILES[self.profile][0]) ** 0.7 * self.open_h
        people = self.episodes / 1.5 * CAMERA_SHARE * shape / shape.sum()
        k = 1 / self.day_sd**2
        return people * np.exp(gammaln(k + 0.7) - gammaln(k) - 0.7 * np.log(k))

    def draw(self, rng: np.random.Generator, weeks: int, *, effect: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Draw violations and person-hours of `weeks` weeks, each (weeks, 4, n_days), all cameras up."""
        size = (weeks, 1 if self.is_shock_shared else 4, self.n_days)
        factor = rng.gamma(1 / self.day_sd**2, self.day_sd**2, size)
        own = rng.gamma(4 / self.day_sd**2, self.day_sd**2 / 4, size)
        k = 1 / self.day_sd**2
        mean = np.exp(gammaln(k + 0.7) - gammaln(k) - 0.7 * np.log(k))
        people = self.expected_people / mean * factor**0.7 * own
        return rng.poisson(effect * self.expected * factor).astype(float), people

    def hours(self, rng: np.random.Generator, weeks: int) -> np.ndarray:
        """Draw recorded open hours, shape (weeks, 4, n_days)."""
        hours = np.tile(self.open_h, (weeks, 1, 1))
        for week in hours if self.n_days_down else ():
            week[rng.integers(4), rng.permutation(self.n_days)[: self.n_days_down]] = 0
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
    past_n, past_people = (
        a.reshape(weeks, HISTORY_WEEKS, 4, world.n_days) for a in world.draw(rng, weeks * HISTORY_WEEKS)
    )
    n, people = world.draw(rng, weeks)
    x = world.hours(rng, weeks)
    n, people = n * (x > 0), people * (x > 0)
    whole_week = float((world.expected.sum(axis=1) / world.open_h.sum(axis=1)).sum())
    found: dict[str, list[tuple[Any, float]]] = {}
    for i in range(weeks):
        history = {
            "weekday": np.arange(world.n_days),
            "history_weekday": np.tile(np.arange(world.n_days), HISTORY_WEEKS),
            "history_n": past_n[i].transpose(1, 0, 2).reshape(4, -1),
        }
        past_x = np.tile(world.open_h, HISTORY_WEEKS)
        plain, informed = violation_rate(n[i], x[i]), violation_rate(n[i], x[i], history_x_h=past_x, **history)
        recorded = float(((world.expected * (x[i] > 0)).sum(axis=1) / x[i].sum(axis=1)).sum())
        up = x[i] > 0
        risk = float((world.expected * up).sum() / (world.expected_people * up).sum())
        days = n[i].sum(axis=0), people[i].sum(axis=0)
        history["history_n"] = past_n[i].sum(axis=1).ravel()
        per_person_h = encounter_rate(*days, history_exposure_h=past_people[i].sum(axis=1).ravel(), **history)
        for name, estimate, truth in (
            ("M0, first weeks", plain, whole_week),
            ("M0, four weeks of history", informed, whole_week),
            ("M0, four weeks, truth of recorded hours", informed, recorded),
            ("M7, first weeks", encounter_rate(*days), risk),
            ("M7, four weeks of history", per_person_h, risk),
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
    past = replace(world, day_sd=world.day_sd / world.restless).draw(rng, weeks * HISTORY_WEEKS)
    past_n, past_people = (array.reshape(weeks, HISTORY_WEEKS, 4, world.n_days) for array in past)
    past_x = np.tile(world.open_h, (HISTORY_WEEKS, 1, 1))
    n_a, people_a, n_b, people_b = (array * (x > 0) for array in (n_a, people_a, n_b, people_b))
    found: dict[str, list[tuple[Any, float]]] = {}
    for i in range(weeks):
        sums = [array[i].sum(axis=0) for array in (n_a, people_a, n_b, people_b)]
        per_open_h, people = (n_a[i], x[i], n_b[i], x[i]), (people_a[i], x[i], people_b[i], x[i])
        encounter_rate_past = {"history_n": past_n[i].sum(axis=1), "history_exposure_h": past_people[i].sum(axis=1)}
        for name, estimate, truth in (
            ("M0, first weeks", compare_violation_rates(*per_open_h), effect),
            ("M0, four weeks", compare_violation_rates(*per_open_h, history_n=past_n[i], history_x_h=past_x), effect),
            ("M7, first weeks", compare_encounter_rates(*sums), effect),
            ("M7, four weeks", compare_encounter_rates(*sums, **encounter_rate_past), effect),
            ("people, four weeks", compare_exposure(*people, history_h=past_people[i], history_x_h=past_x), 1.0),
            ("D/(D-1)", per_camera_change(per_open_h[:2], per_open_h[2:]), effect),
            ("naive", naive_change(rng, per_open_h[:2], per_open_h[2:]), effect),
        ):
            found.setdefault(name, []).append((estimate, truth))
    return {name: score(estimates) for name, estimates in found.items()}


def worlds() -> Iterator[World]:
    """Yield the worlds of the tables."""
    for profile in PROFILES:
        for episodes in (300, 3000):
            for day_sd in (0.05, 0.10, 0.25):
                yield World(episodes, day_sd, profile=profile)
                yield World(episodes, day_sd, n_days_down=4, profile=profile)


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


def restless_worlds() -> Iterator[World]:
    """Yield worlds whose days differ more in the weeks compared than in the weeks before."""
    for profile in PROFILES:
        for episodes in (300, 3000):
            for restless in (1.5, 2.0, 4.0):
                yield World(episodes, 0.20, profile=profile, restless=restless)


def _head(world: World) -> str:
    if world.restless > 1:
        sds = f"{world.day_sd / world.restless:.2f}, then {world.day_sd:.2f}"
        return f"| {world.profile} | {world.episodes:,.0f} | {sds} | all up | "
    if world.is_weekend_down:
        return f"| {world.profile} | {world.episodes:,.0f} | {world.day_sd:.2f} | largest down Thursday to Sunday | "
    cameras = f"one of four down {world.n_days_down} days" if world.n_days_down else "all up"
    own = "" if world.is_shock_shared else ", each its own days"
    return f"| {world.profile} | {world.episodes:,.0f} | {world.day_sd:.2f} | {cameras}{own} | "


def _table(
    title: str,
    run: Callable[[World], dict[str, Score]],
    columns: list[str],
    *,
    over: Iterator[World],
    shown: Callable[[Score], str],
) -> None:
    print(f"\n{title}\n\n| weekdays | violations a week | day sd | cameras | " + " | ".join(columns) + " |")
    print("|---" * (4 + len(columns)) + "|")
    with ProcessPoolExecutor(2) as pool:
        found = list(zip(each := list(over), pool.map(run, each), strict=True))
    for world, scores in found:
        print(_head(world) + " | ".join(shown(scores[name]) for name in columns) + " |", flush=True)


def make_people(folder: Path, monday: date, *, weeks: int, seed: int) -> Site:
    """Simulate weeks of the demo shop, open from 17 to 18 h, and ingest what its four cameras send every 2 s."""
    from vsd_analytics.config.project import load_site
    from vsd_analytics.simulate.cameras import CAMERAS
    from vsd_analytics.simulate.demo import ingest_demo
    from vsd_analytics.simulate.demo_project import write_demo_project
    from vsd_analytics.simulate.frame_messages import day_text
    from vsd_analytics.simulate.people import simulate_day

    write_demo_project(folder, weeks=1, seed=seed)
    shutil.rmtree(folder / "engine")
    (folder / "log.jsonl").unlink()
    toml = (folder / "vsd.toml").read_text(encoding="utf-8")
    opening = '{ mon-sat = "08:00-21:00", sun = "10:00-18:00" }'
    assert opening in toml
    (folder / "vsd.toml").write_text(toml.replace(opening, '{ mon-sun = "17:00-18:00" }'), encoding="utf-8")
    site, files = load_site(folder), []
    for k in range(7 * weeks):
        opens = datetime.combine(monday + timedelta(days=k), time(17), site.zone)
        day = simulate_day(opens, closes=opens + HOUR, seed=seed, interval_s=2.0, display_moved=False)
        for camera in CAMERAS:
            files.append(folder / f"{camera.camera_id}_{day.day.isoformat()}.jsonl")
            files[-1].write_bytes(day_text(day, camera, seed=seed).text)
    result = ingest_demo(site, files, seed=seed)
    assert result.n_rejected == 0
    return site


def people_table(*, judged: int, weeks: int, seed: int) -> None:
    """Print the last `judged` of `weeks` simulated weeks of people; the truth of levels is the mean of all weeks."""
    from vsd_analytics.figures.panels import FloorHours
    from vsd_analytics.figures.periods import Period, TwoPeriods
    from vsd_analytics.figures.rates import (
        encounter_rate_change,
        encounter_rate_level,
        violation_rate_change,
        violation_rate_level,
    )
    from vsd_analytics.warehouse.warehouse import Warehouse

    first = date(2026, 1, 5)
    mondays = [first + timedelta(weeks=k) for k in range(weeks)]
    with TemporaryDirectory() as folder:
        site = make_people(Path(folder) / "shop", first, weeks=weeks, seed=seed)
        with Warehouse(site, first, mondays[-1] + timedelta(days=6)) as warehouse:
            data = FloorHours(warehouse, floor=site.floors[0])
            periods = [Period(data, monday, monday + timedelta(days=6)) for monday in mondays]
            levels = [(violation_rate_level(p, p.whole), encounter_rate_level(p, p.whole)) for p in periods]
            pairs = [TwoPeriods(a, b) for a, b in pairwise(periods)]
            changes = [(violation_rate_change(p, p.now.whole), encounter_rate_change(p, p.now.whole)) for p in pairs]
            rows = warehouse.rows("select local_date, sum(violation_records) as n from hours group by all")
    records = np.zeros(weeks)
    for row in rows:
        records[(row["local_date"] - first).days // 7] += float(row["n"] or 0)
    truth = [float(np.mean([pair[k].value for pair in levels])) for k in (0, 1)]
    columns = ["violations", "M0", "M7", "M0 on the week before", "M7 on the week before", "naive, M0"]
    print(f"\nPeople: M0 {truth[0]:.1f}, M7 {truth[1]:.2f}, records {records.sum():,.0f}\n")
    print("| week | " + " | ".join(columns) + " |\n" + "|---" * (1 + len(columns)) + "|")
    held = np.zeros((judged, 5), dtype=np.bool_)
    for row_no, k in enumerate(range(weeks - judged, weeks)):
        rate, half = levels[k][0].value, 1.96 / records[k] ** 0.5
        naive = _Naive(rate * np.exp(-half), rate * np.exp(half))
        cells = [(levels[k][0], truth[0]), (levels[k][1], truth[1]), *((c, 1.0) for c in changes[k - 1])]
        cells.append((naive, truth[0]))
        held[row_no] = [e.lo <= value <= e.hi for e, value in cells]
        shown = [
            f"{e.lo:.{d}f} to {e.hi:.{d}f}{'' if is_held else ' (missed)'}"
            for (e, _), d, is_held in zip(cells, (0, 2, 2, 2, 0), held[row_no], strict=True)
        ]
        print(f"| {row_no + 1} | {levels[k][0].n_events:,.0f} | " + " | ".join(shown) + " |")
    print("| hold the truth | | " + " | ".join(f"{n} of {judged}" for n in held.sum(axis=0)) + " |", flush=True)


def main() -> None:
    """Print the tables of docs/methods/ranges.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weeks", type=int, default=2000, help="weeks drawn per cell")
    parser.add_argument("--seed", type=int, default=20261109)
    parser.add_argument("--people", type=int, default=0, help="weeks of the people simulator that are judged")
    settings = vars(parser.parse_args())
    if judged := settings.pop("people"):
        people_table(judged=judged, weeks=judged + 14, seed=settings["seed"])
        return
    held = lambda s: f"{100 * s.coverage:.1f} % (±{100 * s.width:.0f} %)"  # noqa: E731
    levels = ["M0, first weeks", "M0, four weeks of history", "M0, four weeks, truth of recorded hours"]
    levels += ["M7, first weeks", "M7, four weeks of history", "naive"]
    changes = partial(run_changes, **settings)
    _table("Levels", partial(run_levels, **settings), levels, over=worlds(), shown=held)
    _table("Levels, busy days missed", partial(run_levels, **settings), levels, over=weekend_worlds(), shown=held)
    columns = ["M0, first weeks", "M0, four weeks", "M7, first weeks", "M7, four weeks"]
    _table("Week over week", changes, [*columns, "people, four weeks", "naive"], over=worlds(), shown=held)
    _table("Week over week, hard", changes, ["M0, first weeks", "D/(D-1)"], over=hard_worlds(), shown=held)
    _table("Week over week, less steady than before", changes, columns, over=restless_worlds(), shown=held)
    power = lambda s: f"{100 * s.clear:.0f} %"  # noqa: E731
    fall = partial(run_changes, effect=0.86, **settings)
    _table("Power for a true fall of 14 %", fall, columns, over=worlds(), shown=power)


if __name__ == "__main__":
    main()
