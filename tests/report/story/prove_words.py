"""Prove the words of a year of reports: python tests/report/story/prove_words.py --sites 40.

Sites in which nothing is changed, with an entry in the log each month at a random place and day, as somebody writes
who tidies up: in which share of site-years does a page say that something worked? And sites whose floor does change by
more than 15 % from one week to the next: how often does the page say "about the same"?

Days and weeks are those of `change_worlds` (no people walk here, and nothing is the demo's), planted as marts of a
warehouse that ends with the week reported. Figures, verdicts and rules of words are the product's own.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).parents[2] / name) for name in ("", "figures", "stats")]

from change_worlds import MUSEUM, OFFICE, Drawn, World, draw
from planted_changes import area, site_of
from planted_marts import plant
from report import sample_weeks as sample

from vsd_analytics.figures import before_after
from vsd_analytics.figures.change_outcome import WORKS_E
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.week import areas as report_areas
from vsd_analytics.figures.week import change_effects
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_sections import LoggedChangeEffect
from vsd_analytics.figures.week.results import WeekRef
from vsd_analytics.report.model.assemble import floor_level
from vsd_analytics.report.model.site_changes import log_lines
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.story import story_of
from vsd_analytics.site.model import Site
from vsd_analytics.stats.running_verdict import log_e_values
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.catalogue import say

FIRST: Final = date(2025, 6, 2)  # a Monday
REFERENCE, YEAR = 12, 52
N_AREAS: Final = 8
AREAS = tuple(area(f"place-{k}", 10.0 * k) for k in range(N_AREAS))
STEPS: Final = (0.7, 0.8, 1.25, 1.5)
"""True changes of the floor, all beyond 15 %."""
STEPS_A_YEAR: Final = 3
"""For good, and far enough apart that the weeks before each are like one another."""
ALONE: Final = 500
"""Running verdicts alone cost little: so many sites for each whose pages are made."""
CLEAR_E: Final = 20.0
"""Evidence from which a running verdict is clear."""
WORLDS: Final = (
    replace(OFFICE, n_areas=N_AREAS, weeks_before=REFERENCE, weeks_after=YEAR),
    replace(MUSEUM, n_areas=N_AREAS, weeks_before=REFERENCE, weeks_after=YEAR),
)


WORKED: Final = {
    "a change works": ("works",),
    "a change works, moved people on, or left less time too close": ("works", "moved", "fell"),
    "an area fell since an entry": ("fell since",),
}
"""What may be said of a change, by words of the table."""


@dataclass
class Year:
    """What the pages of one site said in a year.

    Attributes:
        worked: Weeks of which a page said that a change works, that time too close moved on or fell after it, or that
            an area fell since an entry, by which of these.
        same: Weeks called about the same though the floor's true rate changed by more than 15 %.
        n_changed: Weeks in which it did.
        n_same: Weeks called about the same.
    """

    worked: Counter[str] = field(default_factory=Counter)
    same: int = 0
    n_changed: int = 0
    n_same: int = 0


def monday(week: int) -> date:
    return FIRST + timedelta(weeks=week)


@contextmanager
def planted(site: Site, n: np.ndarray, violation_h: np.ndarray, exposure_h: np.ndarray) -> Iterator[Warehouse]:
    """Open a warehouse of one open hour a day with these days, each array of shape (n_areas, n_days)."""
    hours: list[dict[str, Any]] = []
    by_area: list[dict[str, Any]] = []
    by_cell: list[dict[str, Any]] = []
    for d in range(n.shape[1]):
        day = FIRST + timedelta(days=d)
        at = {
            "floor_id": "ground",
            "camera_id": "cam",
            "hour_start_ms": round(datetime(day.year, day.month, day.day, 9, tzinfo=UTC).timestamp() * 1000),
        }
        for k, place in enumerate(site.areas):
            by_area.append(
                {
                    **at,
                    "area_id": place.area_id,
                    "n_violations_open": int(n[k, d]),
                    "exposure_open_s": 3600 * exposure_h[k, d],
                    "violation_open_s": 3600 * violation_h[k, d],
                }
            )
        cell = {"cx": 2, "cy": 2, "n_violations_open": int(n[0, d]), "exposure_open_s": 3600 * exposure_h[0, d]}
        by_cell.append({**at, "local_date": day, **cell})
        hours.append(
            {
                **at,
                "camera_no": 0,
                "local_date": day,
                "local_hour": 9,
                "fold": 0,
                "open_s": 3600.0,
                "recorded_open_s": 3600.0,
                "is_inferred": False,
                "n_violations_open": int(n[:, d].sum()),
                "exposure_open_s": 3600 * exposure_h[:, d].sum(),
                "violation_s": 3600 * violation_h[:, d].sum(),
            }
        )
    seen = [{"camera_id": "cam", "floor_id": "ground", "started_ms": 0, "x_m": 1.0}]
    made = {"camera_hours": hours, "area_hours": by_area, "cell_hours": by_cell, "violations": seen}
    with Warehouse(site, FIRST, FIRST + timedelta(days=n.shape[1] - 1)) as warehouse:
        for name, rows in made.items():
            plant(warehouse, name, pa.Table.from_pylist(rows))
        yield warehouse


def entries(rng: np.random.Generator) -> list[dict[str, str]]:
    """Return twelve entries of the log, one in each 30 days of the year, each of a random area at a random hour."""
    found = []
    for month in range(12):
        day = monday(REFERENCE) + timedelta(days=30 * month + int(rng.integers(0, 30)))
        hour = int(rng.integers(7, 19))
        place = f"place-{rng.integers(0, N_AREAS)}"
        found.append({"at": f"{day}T{hour:02d}:00:00+00:00", "text": "Plant pot watered", "area": place})
    return found


def week_of(
    warehouse: Warehouse, week: int, log: list[dict[str, str]]
) -> tuple[WeekData, tuple[LoggedChangeEffect, ...]]:
    """Return a week and the logged changes on its page, as known at its end."""
    first = monday(week)
    warehouse.first, warehouse.last = monday(max(0, week - 25)), first + timedelta(days=6)
    known = [entry for entry in log if entry["at"][:10] <= warehouse.last.isoformat()]
    lines = "".join(json.dumps(entry) + "\n" for entry in known)
    (warehouse.site.root / "log.jsonl").write_text(lines, encoding="utf-8")
    data = WeekData(warehouse, floor=warehouse.site.floors[0], monday=first)
    shown = [
        number
        for number, entry in enumerate(known, 1)
        if (warehouse.last - date.fromisoformat(entry["at"][:10])).days < change_effects.SHOWN_DAYS
    ]
    found = [before_after.before_after(warehouse, number) for number in shown]
    return data, change_effects.change_effects(data, found)


def report_of(warehouse: Warehouse, week: int, log: list[dict[str, str]]) -> WeekReport:
    """Return a week's report without maps, hours and records: all that the words of changes are made from."""
    data, changes = week_of(warehouse, week, log)
    areas = report_areas.areas(data, is_compared=True, rest="the rest of the floor")
    base = sample.normal()
    coverage = replace(base.coverage, outages=())
    return replace(
        base,
        story=None,
        week=WeekRef.of(data.monday, zone="UTC"),
        previous=WeekRef.of(data.monday - WEEK, zone="UTC"),
        coverage=coverage,
        level=floor_level(data, is_compared=True, areas=areas),
        areas=areas.rows,
        busiest_spot=report_areas.busiest_spot(data, areas.rows),
        log=log_lines(data, coverage, is_compared=True),
        change_effects=changes,
    )


def said_of_changes(changes: Sequence[LoggedChangeEffect]) -> str | None:
    """Return what is said of logged changes: "works", "moved", "fell", or None. All parts of a page ask `outcome`."""
    said = {change.outcome for change in changes}
    return next((name for name in ("works", "moved", "fell") if name in said), None)


def said_of(report: WeekReport) -> str | None:
    """Return what the page says worked: "works", "moved", "fell", "fell since"; None if it says no such thing."""
    if said := said_of_changes(report.change_effects):
        return said
    titles = {thing.title for thing in story_of(report).things if thing.kind == "worked"}
    falls = {say("things.fell_since", area=line.area_name) for line in report.log if line.area_name}
    return "fell since" if titles & falls else None


def quiet_year(drawn: Drawn, site: int, folder: Path, *, seed: int, is_whole: bool = True) -> Year:
    """Return what is said in a year in which nothing is done but writing into the log.

    Args:
        drawn: Sites.
        site: Number of the site.
        folder: Where its project is written.
        seed: Of the log.
        is_whole: Read all words of the page; False = what is said of logged changes, which takes a quarter of the time.
    """
    year, log = Year(), entries(np.random.default_rng([seed, site]))
    with planted(site_of(folder, areas=AREAS), drawn.n[site], drawn.violation_h[site], drawn.exposure_h[site]) as days:
        for week in range(REFERENCE, REFERENCE + YEAR):
            if not is_whole:
                year.worked[said_of_changes(week_of(days, week, log)[1]) or "nothing"] += 1
                continue
            report = report_of(days, week, log)
            year.worked[said_of(report) or "nothing"] += 1
            year.n_same += report.level.violation_rate.verdict == "about_same"
    return year


def changing_year(drawn: Drawn, site: int, folder: Path, *, seed: int) -> Year:
    """Return what is said in a year in which the floor changes three times for good, by more than 15 %."""
    rng = np.random.default_rng([seed, site, 2])
    apart = YEAR // STEPS_A_YEAR
    factor = np.ones(REFERENCE + YEAR)
    for k in range(STEPS_A_YEAR):
        factor[REFERENCE + apart * k + int(rng.integers(0, 4)) :] *= rng.choice(STEPS)
    expected = drawn.n[site] * np.repeat(factor, 7)
    n = rng.poisson(expected).astype(np.float64)
    violation_h = np.divide(drawn.violation_h[site] * n, drawn.n[site], out=np.zeros(n.shape), where=drawn.n[site] > 0)
    year = Year()
    with planted(site_of(folder, areas=AREAS), n, violation_h, drawn.exposure_h[site]) as days:
        for week in range(REFERENCE, REFERENCE + YEAR):
            days.first, days.last = monday(max(0, week - 25)), monday(week) + timedelta(days=6)
            data = WeekData(days, floor=days.site.floors[0], monday=monday(week))
            level = floor_level(data, is_compared=True, areas=report_areas.Areas(rows=()))
            has_changed = factor[week] != factor[week - 1]
            is_same = level.violation_rate.verdict == "about_same"
            year.n_changed += has_changed
            year.same += is_same and has_changed
            year.n_same += is_same
    return year


def running_alone(world: World, n_sites: int, *, seed: int, least_e: float) -> tuple[float, float]:
    """Return how often a running verdict falsely says clear fall with so much evidence, of one change and of twelve.

    Of all weeks that the change is on the page; without the other conditions of `outcome`, and as if changes of a year
    were independent: so not below what a page says.
    """
    weeks = change_effects.SHOWN_DAYS // 7 - 1
    drawn = draw(replace(world, weeks_after=weeks), n_sites, seed)
    hours = drawn.violation_h.reshape(*drawn.violation_h.shape[:2], -1, 7).sum(axis=3)
    y = np.log(hours[:, 0]) - np.log(hours[:, 1:].sum(axis=1))
    before, after = y[:, :REFERENCE], y[:, REFERENCE:]
    mean = before.mean(axis=1)
    log_e = log_e_values(REFERENCE, mean, ((before - mean[:, None]) ** 2).sum(axis=1), after)
    is_fall = np.cumsum(after, axis=1) / np.arange(1, weeks + 1) < mean[:, None]
    one = float(((np.abs(log_e) >= np.log(least_e)) & is_fall).any(axis=1).mean())
    return one, 1 - (1 - one) ** 12


def main() -> None:
    """Print the table of docs/methods/pages.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="number of the first site: to go on where a run ended")
    parser.add_argument("--seed", type=int, default=20261122)
    parts = ("running", "changes", "same")
    parser.add_argument("--only", choices=parts, help="running verdicts alone, pages on logged changes, on the floor")
    arguments = parser.parse_args()
    started, first, n, seed = time.process_time(), arguments.first, arguments.sites, arguments.seed
    print("| what a page says | world | sites | promised | found |\n|---|---|---|---|---|")
    for world in WORLDS:
        for what, least_e, promised in (
            ("clear", CLEAR_E, "–"),
            ("as sure as “works” needs", WORKS_E, "at most 5 % of site-years"),
        ):
            one, year = running_alone(world, ALONE * n, seed=seed, least_e=least_e)
            found = f"{year:.1%} of site-years ({one:.2%} of changes)"
            name = f"running verdict alone: a fall, {what}"
            print(f"| {name} | {world.name} | {ALONE * n:,} | {promised} | {found} |", flush=True)
        if arguments.only == "running":
            continue
        drawn = draw(world, first + n, seed)
        if arguments.only != "same":
            quiet = []
            for site in range(first, first + n):
                with tempfile.TemporaryDirectory() as folder:
                    quiet.append(quiet_year(drawn, site, Path(folder), seed=seed, is_whole=not arguments.only))
            for what, kinds in WORKED.items():
                if arguments.only and kinds == ("fell since",):
                    continue
                n_years = sum(any(year.worked[kind] for kind in kinds) for year in quiet)
                n_weeks = sum(year.worked[kind] for year in quiet for kind in kinds)
                promised = "at most 5 % of site-years" if kinds == ("works",) else "–"
                found = f"{n_years} of {n} site-years, {n_weeks} weeks"
                print(f"| {what} | {world.name} | {n} | {promised} | {found} |", flush=True)
        if arguments.only != "changes":
            changing = []
            for site in range(first, first + n):
                with tempfile.TemporaryDirectory() as folder:
                    changing.append(changing_year(drawn, site, Path(folder), seed=seed))
            same, changed, called = (sum(getattr(y, k) for y in changing) for k in ("same", "n_changed", "n_same"))
            what = "about the same, though it changed by 20 % or more"
            found = f"{same} of {changed} such weeks; of all {n * YEAR:,} weeks, {called} are called so"
            print(f"| {what} | {world.name} | {n} | at most 5 % | {found} |", flush=True)
    print(f"\n{time.process_time() - started:.0f} s of processor time")


if __name__ == "__main__":
    main()
