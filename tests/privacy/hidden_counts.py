"""A reader who collects every number of two weeks and solves for the counts that were held back.

The unknowns are violations by week, point of the floor, day and hour. Every number of the JSON file and the CSV tables
becomes a row `low <= sum of some unknowns <= high`: counts as they are, rates times recorded hours,
numbers of six digits as the interval they were rounded from, "<5" as 1 to 4. The least and the greatest value of a sum
of unknowns under all rows is what the reader can know of it (`scipy.optimize.milp`).
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, timedelta
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from report import ingested_worlds as worlds
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from vsd_analytics.errors import ReportError
from vsd_analytics.figures import hotspots as analysis
from vsd_analytics.report.pages.json_and_csv import to_csv, to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import open_warehouse

if TYPE_CHECKING:
    from privacy import person_times

BELOW = 5
FIRST, N_DAYS, HOURS = worlds.MONDAY - timedelta(weeks=26), 3, (9, 11)
POINTS: Mapping[worlds.Place, tuple[str | None, int]] = {
    (1.5, 1.5): ("queue", 0),
    (2.5, 4.5): ("queue", 1),
    (8.0, 3.0): ("door", 1),
    (3.0, 9.0): (None, 0),
    (20.0, 6.0): (None, 1),
}
"""Where violations happen: the area (None: the rest of the floor) and the camera that sees it."""
PLACES = ("queue", "door", None)
SETTINGS = "[analysis]\nhotspot_days = 14\nhotspot_min_days = 4\nhotspot_min_violations = 20\n"
CLOSE_H = worlds.CLOSE_S / 3600
"""Time that each of the two people of a violation is too close: two frames."""
Key = tuple[int, int, int, int]
"""Week, point, day, hour."""
Weights = Mapping[Key, float]


@dataclass
class World:
    """A site of which everything is known.

    Attributes:
        site: The project.
        n: Violations by key.
        lost: Week, camera and day of which nothing was recorded.
        cut_h: Time of a week, camera, day and hour that was erased.
        pairs: Pairs of people who stood there, by key, whether too close or not; None = those counted.
    """

    site: Site
    n: dict[Key, int]
    lost: set[tuple[int, int, int]]
    cut_h: Mapping[Key, float] = field(default_factory=dict)
    pairs: Mapping[Key, int] | None = None

    @property
    def n_weeks(self) -> int:
        return 1 + max(key[0] for key in self.n)

    def sum(self, keys: Iterable[Key]) -> int:
        return sum(self.n[key] for key in keys)

    def x_h(self, week: int, camera: int, days: Iterable[int] = range(N_DAYS)) -> float:
        """Return the recorded open hours of a camera."""
        hours = product((d for d in days if (week, camera, d) not in self.lost), range(*HOURS))
        return sum(1 - self.cut_h.get((week, camera, d, h), 0.0) for d, h in hours)

    def both(self, week: int, camera: int) -> list[int]:
        """Return the days on which a camera recorded both this week and the one before."""
        return [d for d in range(N_DAYS) if not {(week, camera, d), (week - 1, camera, d)} & self.lost]


@dataclass
class Known:
    """What a reader knows: rows of weights with their limits, and where each came from.

    Attributes:
        rows: Weights, limits, source.
        held_least: What a count is at least that is held back beside a small one; 0 in a week that was shared before,
            as a count may be held back for its change.
    """

    rows: list[tuple[Weights, float, float, str]] = field(default_factory=list)
    held_least: int = BELOW

    def exact(self, keys: Iterable[Key], n: float, source: str) -> None:
        self.rows.append((dict.fromkeys(keys, 1.0), n, n, source))

    def between(self, weights: Weights, low: float, high: float, source: str) -> None:
        self.rows.append((weights, low, high, source))

    def rounded(self, weights: Weights, value: float | None, source: str, *, digits: int = 6) -> None:
        """Add a number that was rounded to so many significant digits."""
        if value is not None:
            slack = abs(value) * 10.0 ** (1 - digits) + 1e-9
            self.rows.append((weights, value - slack, value + slack, source))


def keys_of(
    week: int,
    *,
    place: str | bool | None = True,
    camera: int | None = None,
    day: int | None = None,
    hour: int | None = None,
) -> list[Key]:
    """Return the unknowns of a week: of a place (True: all), a camera, a day, an hour."""
    points = [
        p for p, (area, of) in enumerate(POINTS.values()) if (place is True or area == place) and camera in (None, of)
    ]
    days, hours = range(N_DAYS) if day is None else [day], range(*HOURS) if hour is None else [hour]
    return [(week, p, d, h) for p, d, h in product(points, days, hours)]


def monday(week: int) -> date:
    """Return the first day of a week."""
    return FIRST + timedelta(weeks=week)


def build(folder: Path, seed: int, *, n_weeks: int, busy: Mapping[tuple[int, int], float] | None = None) -> World:
    """Return a world of few violations; some places, cameras and weeks have hardly any, some days are not recorded.

    Args:
        folder: Where it is written.
        seed: Of chance.
        n_weeks: Its weeks.
        busy: Violations an hour by week and point, instead of those by chance.
    """
    rng = np.random.default_rng(seed)
    mean = rng.choice([0.0, 0.3, 1.0, 6.0, 20.0], size=(n_weeks, len(POINTS)), p=[0.15, 0.3, 0.2, 0.2, 0.15])
    mean[:, 0] = np.where(rng.random(n_weeks) < 0.8, 25.0, mean[:, 0])
    for at, n_per_hour in (busy or {}).items():
        mean[at] = n_per_hour
    lost = {(w, c, d) for w, c, d in product(range(n_weeks), range(2), range(N_DAYS)) if d > 0 and rng.random() < 0.1}
    cameras = [camera for _, camera in POINTS.values()]
    n = {}
    for w, p, d, h in product(range(n_weeks), range(len(POINTS)), range(N_DAYS), range(*HOURS)):
        n[w, p, d, h] = 0 if (w, cameras[p], d) in lost else min(int(rng.poisson(mean[w, p])), 60)
    return write(folder, n, lost)


def write(folder: Path, n: dict[Key, int], lost: set[tuple[int, int, int]], *, weeks: int | None = None) -> World:
    """Write and ingest a world, or its first weeks."""
    config = worlds.toml(cameras=("cam-1", "cam-2"), opening='{ mon-wed = "09:00-11:00" }', more=SETTINGS)
    world = World(worlds.world(folder, config), n, lost)
    for week in range(world.n_weeks if weeks is None else weeks):
        add_week(world, week)
    return world


def add_week(world: World, week: int) -> None:
    """Ingest a week."""
    days = range(N_DAYS)
    parts = [(c, [d for d in days if (week, c, d) not in world.lost]) for c in range(2)]
    worlds.add(world.site, *(stream(world, week, c, of) for c, of in parts), name=f"week-{week}")


def stream(world: World, week: int, camera: int, days: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Return a camera's frames of some days of a week."""

    def counts(day: int, hour: int) -> Mapping[worlds.Place, int]:
        return {at: world.n[week, p, day, hour] for p, (at, (_, of)) in enumerate(POINTS.items()) if of == camera}

    return worlds.messages(
        counts, monday=monday(week), hours=HOURS, camera=f"cam-{camera + 1}", days=days, is_alone=camera == 0
    )


def published(
    world: World,
    weeks: Sequence[int],
    *,
    held_least: int = BELOW,
    times: person_times.Times | None = None,
    planners: Container[int] | None = None,
) -> Known:
    """Return everything that leaves the operator's hands about some weeks; nothing of those that are refused.

    Args:
        world: What was counted.
        weeks: The weeks.
        held_least: As for `Known`.
        times: What is known of person-time, to which their numbers are added.
        planners: The weeks of which a planner is made; None = all.
    """
    from privacy import other_outputs, person_times

    known = Known(held_least=held_least)
    for week in weeks:
        try:
            report = week_report(world.site, monday(week))
        except ReportError:
            continue
        told = json.loads(to_json(report))
        read_json(known, world, week, told)
        read_csv(known, world, week, to_csv(report))
        if times is not None:
            person_times.read_json(times, world, week, told)
        if planners is not None and week not in planners:
            continue
        hours = [(date.fromisoformat(c["day"]) - monday(week), c) for c in told["when"]["cells"]]
        hidden_hours = {(d.days, c["hour"]) for d, c in hours if c["violations"] is None}
        other_outputs.read_planner(known, world, week, hidden_hours, times=times)
    return known


def _rate(known: Known, world: World, week: int, place: str | bool | None, e: Mapping[str, Any], source: str) -> None:
    """Add how often (M0), the week before and the change: sums over cameras of violations per recorded hour."""

    def per_hour(of: int, days: Callable[[int], Iterable[int]]) -> dict[Key, float]:
        weights = {}
        for c in range(2):
            hours = world.x_h(of, c, days(c))
            weights |= {k: 1 / hours for k in keys_of(of, place=place, camera=c) if k[2] in list(days(c)) and hours}
        return weights

    known.rounded(per_hour(week, lambda c: range(N_DAYS)), e["value"], f"{source}.value")
    if e.get("previous") is not None:
        then = per_hour(week - 1, lambda c: world.both(week, c))
        known.rounded(then, e["previous"], f"{source}.previous")
        if e.get("change") is not None:
            now = per_hour(week, lambda c: world.both(week, c))
            known.rounded(now, (1 + e["change"]) * e["previous"], f"{source}.change", digits=5)


def _time_close_before(known: Known, world: World, week: int, share: float | None, source: str) -> None:
    """Add the share of time too close on the rest of the floor in the week before, over the hours compared.

    One person stands there alone, in view of the first camera, for as long as that camera recorded. Of weeks with a
    day that a camera lost, a reader does not know which days of which camera are compared.
    """
    if share is None or not share < 1 or any(w in (week - 1, week) for w, _, _ in world.lost):
        return
    days = {camera: world.both(week, camera) for camera in range(2)}
    keys = [k for c in days for k in keys_of(week - 1, place=None, camera=c) if k[2] in days[c]]
    alone_h = world.x_h(week - 1, 0, days[0])
    known.rounded(dict.fromkeys(keys, 2 * CLOSE_H), alone_h * share / (1 - share), source, digits=5)


def _label(known: Known, keys: list[Key], n: float | None, row: Mapping[str, Any], source: str) -> None:
    """Add a count, or what its label says of it."""
    if n is not None:
        known.exact(keys, n, source)
    elif row["is_masked"]:
        known.between(dict.fromkeys(keys, 1.0), 1, BELOW - 1, f"{source} <{BELOW}")
    elif row["is_held_back"]:
        known.between(dict.fromkeys(keys, 1.0), known.held_least, np.inf, f"{source} held back")


def read_json(known: Known, world: World, week: int, told: Mapping[str, Any]) -> None:
    """Add the numbers of a report's JSON."""
    source = f"{told['week']['iso']} json"
    every = keys_of(week)
    level = told["level"]
    _rate(known, world, week, True, level["violation_rate"], f"{source} level.often")
    if level["violations"] is not None:
        known.exact(every, level["violations"], f"{source} level.violations")
    _per_person_hour(known, every, level["encounter_rate"], level["exposure_h"], f"{source} level.risky")
    _time_close(known, every, level["close_time_share"], level["exposure_h"], f"{source} level.close_share")
    for row in told["areas"]:
        place, name = row["area_id"], f"{source} areas.{row['area_id']}"
        keys = keys_of(week, place=place)
        _label(known, keys, row["counted"], row, name)
        _rate(known, world, week, place, row["violation_rate"], f"{name}.often")
        _per_person_hour(known, keys, row["encounter_rate"], row["exposure_h"], f"{name}.risky")
        _time_close(known, keys, row["close_time_share"], row["exposure_h"], f"{name}.close_share")
        if row["close_time_share"] is not None and place is None:
            _time_close_before(
                known, world, week, row["close_time_share"].get("previous"), f"{name}.close_share.previous"
            )
    for cell in told["when"]["cells"]:
        day = (date.fromisoformat(cell["day"]) - monday(week)).days
        if day < N_DAYS:
            keys = keys_of(week, day=day, hour=cell["hour"])
            _label(known, keys, cell["violations"], cell, f"{source} when {day} {cell['hour']}")
            share = cell["close_time_share"]
            if share is not None and share < 1 and (week, 0, day) not in world.lost:  # one person stands alone: 1 h
                hours = dict.fromkeys(keys, 2 * CLOSE_H)
                alone_h = 1 - world.cut_h.get((week, 0, day, cell["hour"]), 0.0)
                known.rounded(hours, alone_h * share / (1 - share), f"{source} when close_share", digits=5)
    for row in told["trend"]["weeks"] if told["trend"] else []:
        of = (date.fromisoformat(row["monday"]) - FIRST).days // 7
        if row["violation_rate"] is not None:
            _rate(known, world, of, True, {"value": row["violation_rate"]["value"]}, f"{source} trend {of}")
    tables = {name: answer["rows"] for name, answer in told["answers"].items()}
    for row in tables["trend"]:
        of = (date.fromisocalendar(int(row["week"][:4]), int(row["week"][-2:]), 1) - FIRST).days // 7
        _rate(known, world, of, True, row["violation_rate"], f"{source} M28 {of}")
    [violations], [durations] = tables["violations"], tables["durations"]
    for name, n in (("M8", violations["n_violations"]["value"]), ("M10", durations["n_measured"]["value"])):
        if n is not None:
            known.exact(every, n, f"{source} {name}")
    [close] = tables["close_time"]
    _time_close(known, every, close["close_time_share"], close["exposure_h"], f"{source} M6")
    for row in tables["areas"]:
        _rate(known, world, week, row["area_id"], row["violation_rate"], f"{source} M15")
    for row in tables["readings"]:
        if row["reading"] == "all" and row["n_violations"]["value"] is not None:
            known.exact(every, row["n_violations"]["value"], f"{source} M9")
    spots = (*tables["hotspots"], *tables["past_hotspots"])
    shapes = spot_points(world, week) if spots else {}
    for row in spots:
        if row["spot_id"] not in shapes:
            continue
        near, people = shapes[row["spot_id"]]
        window = [k for of in (week - 1, week) for k in keys_of(of)]
        n, close_h = row["n_violations"]["value"], row.get("violation_h", {}).get("value")
        if n is not None:
            known.exact([k for k in window if k[1] in near], n, f"{source} M20.n")
        if (
            row["excess_ratio"]["value"] is not None
        ):  # a reader who knows what is expected there, and how long each violation lasts
            hours = {k: people[k[1]] * CLOSE_H for k in window if people[k[1]]}
            close_h = sum(h * world.n[k] for k, h in hours.items()) if close_h is None else close_h
            known.rounded(hours, close_h, f"{source} M20.ratio", digits=5)
    _read_map(known, world, week, told["figures"]["M17"]["rows"] or (), source)


def _read_map(known: Known, world: World, week: int, rows: Iterable[Mapping[str, Any]], source: str) -> None:
    """Add the time too close by square of a metre, for a reader who knows how long each violation lasts (M17)."""
    for row in rows:
        weights = {}
        for p, ((x, y), (_, camera)) in enumerate(POINTS.items()):
            is_in = [int(at) + 0.5 == row["x_m"] and int(y) + 0.5 == row["y_m"] for at in (x, x + 1.5)]
            if any(is_in) and (hours := world.x_h(week, camera)):
                weights |= {k: sum(is_in) * CLOSE_H * 3600 / hours for k in keys_of(week) if k[1] == p}
        known.rounded(weights, row["value"], f"{source} M17 {row['x_m']} {row['y_m']}", digits=5)


def _per_person_hour(known: Known, keys: list[Key], e: Mapping[str, Any] | None, hours: float | None, s: str) -> None:
    if e is not None and e["value"] is not None and hours is not None:
        known.rounded(dict.fromkeys(keys, 1.0), e["value"] * hours, s, digits=5)


def _time_close(known: Known, keys: list[Key], e: Mapping[str, Any] | None, hours: float | None, s: str) -> None:
    """Add a share of person-time too close, for a reader who knows person-hours and how long each violation lasts."""
    if e is not None and e["value"] is not None and hours is not None:
        known.rounded(dict.fromkeys(keys, 2 * CLOSE_H), e["value"] * hours, s, digits=5)


def spot_points(world: World, week: int) -> dict[str, tuple[list[int], list[int]]]:
    """Return the points whose violations each hotspot counts, and how many of a point's two people stand in it."""
    until = monday(week) + timedelta(days=6)
    first, _ = analysis.days_needed(world.site, until)
    with open_warehouse(world.site, first, until) as warehouse:
        found = analysis.hotspots(warehouse, until=until)
    inside = {}
    for spot in (*found.spots, *found.resolved, *found.watching):
        shape = shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in spot.place.polygons])
        around = shape.buffer(1.0, join_style="mitre")
        near = [p for p, (x, y) in enumerate(POINTS) if shapely.contains_xy(around, x + 0.76, y + 0.01)]
        people = [sum(bool(shapely.contains_xy(shape, x + s, y + 0.01)) for s in (0.01, 1.51)) for x, y in POINTS]
        inside[spot.spot_id] = near, people
    return inside


def read_csv(known: Known, world: World, week: int, files: Mapping[str, str]) -> None:
    """Add the numbers of the CSV tables."""
    for row in csv.DictReader(io.StringIO(files["hours.csv"])):
        start = row["start"]
        day = (date.fromisoformat(start[:10]) - monday(week)).days
        if day < N_DAYS and row["violations"]:
            known.exact(keys_of(week, day=day, hour=int(start[11:13])), int(row["violations"]), "hours.csv")
    for row in csv.DictReader(io.StringIO(files["areas.csv"])):
        place = row["area"] or None
        if row["counted"]:
            known.exact(keys_of(week, place=place), int(row["counted"]), "areas.csv counted")
        if row["per_open_hour"]:
            _rate(known, world, week, place, {"value": float(row["per_open_hour"])}, "areas.csv per_open_hour")


def small_counts(world: World) -> dict[str, list[Key]]:
    """Return what must stay hidden: small counts of the floor or a place in a week, and of the floor in an hour."""
    sums = {f"week {w}, {place}": keys_of(w, place=place) for w in range(world.n_weeks) for place in (True, *PLACES)}
    sums |= {
        f"week {w}, day {d}, hour {h}": keys_of(w, day=d, hour=h)
        for w, d, h in product(range(world.n_weeks), range(N_DAYS), range(*HOURS))
    }
    return {name: keys for name, keys in sums.items() if 0 < world.sum(keys) < BELOW}


def broken(known: Known, world: World) -> list[str]:
    """Return the rows that the world itself does not fulfil: mistakes of the reader."""
    found = []
    for weights, low, high, source in known.rows:
        total = sum(w * world.n[k] for k, w in weights.items())
        if not low - 1e-6 <= total <= high + 1e-6:
            found.append(f"{source}: {total} is not in {low} to {high}")
    return found


def worked_out(known: Known, world: World) -> dict[str, int]:
    """Return the hidden counts of which a reader finds the only possible value."""
    index = {key: i for i, key in enumerate(world.n)}
    rows = sparse.dok_array((len(known.rows), len(index)))
    for i, (weights, _, _, _) in enumerate(known.rows):
        for key, w in weights.items():
            rows[i, index[key]] = w
    low, high = (np.array([row[i] for row in known.rows]) for i in (1, 2))
    constraints = LinearConstraint(rows.tocsr(), low - 1e-7, high + 1e-7)
    found = {}
    for name, keys in small_counts(world).items():
        c = np.zeros(len(index))
        c[[index[k] for k in keys]] = 1
        limits = []
        for sign in (1, -1):
            best = milp(sign * c, constraints=constraints, integrality=np.ones(len(index)), bounds=Bounds(0, 400))
            limits.append(None if best.x is None else round(sign * best.fun))
        if None in limits or limits[0] == limits[1]:
            found[name] = world.sum(keys)
    return found


def kind(name: str) -> str:
    """Return what sort of count one of `small_counts` is."""
    if "hour" in name:
        return "the floor in an hour"
    return "the floor in a week" if name.endswith("True") else "an area, or the rest, in a week"
