"""Prove the words of a year of reports: python tests/report/words/prove_words.py --sites 40.

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
from collections.abc import Iterator
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
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.week import areas as report_areas
from vsd_analytics.figures.week import redesigns
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.results import WeekRef
from vsd_analytics.report.model.assemble import floor_level
from vsd_analytics.report.model.site_changes import log_lines
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.words.catalogue import say
from vsd_analytics.report.words.headline import story_of
from vsd_analytics.report.words.things_to_know import is_shown_to_work
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse

FIRST: Final = date(2025, 6, 2)  # a Monday
REFERENCE, YEAR = 12, 52
N_AREAS: Final = 8
AREAS = tuple(area(f"place-{k}", 10.0 * k) for k in range(N_AREAS))
STEPS: Final = (0.8, 0.7, 1.25, 1.5)
"""True changes of the floor, all beyond 15 %: one every four weeks, taken back two weeks later."""
WORLDS: Final = (
    replace(OFFICE, n_areas=N_AREAS, weeks_before=REFERENCE, weeks_after=YEAR),
    replace(MUSEUM, n_areas=N_AREAS, weeks_before=REFERENCE, weeks_after=YEAR),
)


@dataclass
class Year:
    """What the pages of one site said in a year.

    Attributes:
        worked: Weeks of which a page said that a change works, that time too close moved on, or that an area fell since
            an entry, by which of these.
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
        by_cell.append({**at, **cell})
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


def report_of(warehouse: Warehouse, week: int, log: list[dict[str, str]]) -> WeekReport:
    """Return a week's report without maps, hours and records: all that the words of changes are made from."""
    first = monday(week)
    warehouse.first, warehouse.last = monday(max(0, week - 25)), first + timedelta(days=6)
    known = [entry for entry in log if entry["at"][:10] <= warehouse.last.isoformat()]
    lines = "".join(json.dumps(entry) + "\n" for entry in known)
    (warehouse.site.root / "log.jsonl").write_text(lines, encoding="utf-8")
    data = WeekData(warehouse, floor=warehouse.site.floors[0], monday=first)
    areas = report_areas.areas(data, is_compared=True, rest="the rest of the floor")
    shown = [
        number
        for number, entry in enumerate(known, 1)
        if (warehouse.last - date.fromisoformat(entry["at"][:10])).days < redesigns.SHOWN_DAYS
    ]
    found = [before_after.before_after(warehouse, number) for number in shown]
    base = sample.normal()
    coverage = replace(base.coverage, outages=())
    return replace(
        base,
        story=None,
        week=WeekRef.of(first, zone="UTC"),
        previous=WeekRef.of(first - WEEK, zone="UTC"),
        coverage=coverage,
        level=floor_level(data, is_compared=True, areas=areas),
        areas=areas.rows,
        busiest_spot=report_areas.busiest_spot(data, areas.rows),
        log=log_lines(data, coverage, is_compared=True),
        redesigns=redesigns.redesigns(data, found),
    )


def said_of(report: WeekReport) -> str | None:
    """Return what the page says worked: "works", "moved", "fell since"; None if it says no such thing.

    Whatever part of the page says it: all of them ask `is_shown_to_work`.
    """
    if any(is_shown_to_work(change) for change in report.redesigns):
        return "works"
    if any(is_shown_to_work(change, wherever=True) for change in report.redesigns):
        return "moved"
    titles = {thing.title for thing in story_of(report).things if thing.kind == "worked"}
    falls = {say("things.fell_since", area=line.area_name) for line in report.log if line.area_name}
    return "fell since" if titles & falls else None


def quiet_year(drawn: Drawn, site: int, folder: Path, *, seed: int) -> Year:
    """Return what is said in a year in which nothing is done but writing into the log."""
    year, log = Year(), entries(np.random.default_rng([seed, site]))
    with planted(site_of(folder, areas=AREAS), drawn.n[site], drawn.violation_h[site], drawn.exposure_h[site]) as days:
        for week in range(REFERENCE, REFERENCE + YEAR):
            report = report_of(days, week, log)
            year.worked[said_of(report) or "nothing"] += 1
            year.n_same += report.level.often.verdict == "about_same"
    return year


def changing_year(drawn: Drawn, site: int, folder: Path, *, seed: int) -> Year:
    """Return what is said in a year in which the floor changes every other week by more than 15 %."""
    rng = np.random.default_rng([seed, site, 2])
    factor = np.ones(REFERENCE + YEAR)
    for week in range(REFERENCE, REFERENCE + YEAR, 4):
        factor[week : week + 2] = rng.choice(STEPS)
    of_day = np.repeat(factor, 7)
    n = np.where(of_day < 1, rng.binomial(drawn.n[site].astype(np.int64), np.minimum(of_day, 1)), drawn.n[site])
    n = np.where(of_day > 1, n + rng.poisson(drawn.n[site] * np.maximum(of_day - 1, 0)), n)
    violation_h = np.divide(drawn.violation_h[site] * n, drawn.n[site], out=np.zeros(n.shape), where=drawn.n[site] > 0)
    year = Year()
    with planted(site_of(folder, areas=AREAS), n, violation_h, drawn.exposure_h[site]) as days:
        for week in range(REFERENCE, REFERENCE + YEAR):
            days.first, days.last = monday(max(0, week - 25)), monday(week) + timedelta(days=6)
            data = WeekData(days, floor=days.site.floors[0], monday=monday(week))
            level = floor_level(data, is_compared=True, areas=report_areas.Areas(rows=()))
            true = factor[week] / factor[week - 1]
            year.n_changed += abs(np.log(true)) > np.log(1.15)
            is_same = level.often.verdict == "about_same"
            year.same += is_same and abs(np.log(true)) > np.log(1.15)
            year.n_same += is_same
    return year


def years(world: World, n_sites: int, *, seed: int, first: int = 0) -> tuple[list[Year], list[Year]]:
    """Return quiet years and changing years of sites from number `first` on."""
    drawn = draw(world, first + n_sites, seed)
    made: tuple[list[Year], list[Year]] = ([], [])
    for site in range(first, first + n_sites):
        for kind, year_of in enumerate((quiet_year, changing_year)):
            with tempfile.TemporaryDirectory() as folder:
                made[kind].append(year_of(drawn, site, Path(folder), seed=seed))
    return made


def main() -> None:
    """Print the table of docs/statistics.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="number of the first site: to go on where a run ended")
    parser.add_argument("--seed", type=int, default=20261122)
    arguments = parser.parse_args()
    started = time.process_time()
    print("| what a page says | world | sites | promised | found |\n|---|---|---|---|---|")
    for world in WORLDS:
        quiet, changing = years(world, arguments.sites, seed=arguments.seed, first=arguments.first)
        n = len(quiet)
        for what, kinds in (
            ("a change works", ("works",)),
            ("works, or moved on", ("works", "moved")),
            ("an area fell since an entry", ("fell since",)),
        ):
            n_years = sum(any(year.worked[kind] for kind in kinds) for year in quiet)
            n_weeks = sum(year.worked[kind] for year in quiet for kind in kinds)
            promised = "at most 5 % of site-years" if kinds == ("works",) else "–"
            print(f"| {what} | {world.name} | {n} | {promised} | {n_years} of {n} site-years, {n_weeks} weeks |")
        same, changed, called = (sum(getattr(y, name) for y in changing) for name in ("same", "n_changed", "n_same"))
        print(
            f"| about the same, though it changed by 20 % or more | {world.name} | {n} | at most 5 % | "
            f"{same} of {changed} such weeks ({same / max(1, changed):.1%}); {same} of {called} weeks called so |",
            flush=True,
        )
    print(f"\n{time.process_time() - started:.0f} s of processor time")


if __name__ == "__main__":
    main()
