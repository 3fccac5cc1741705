"""A reader who keeps every version of everything: pages of each week as it ends, and again after the week changed.

A world goes on week by week. While a week runs, pages of its closed days leave; when it is over, its report does. Then
the world changes: some minutes are erased, a camera's day arrives late, the legal distance is another. Everything is
made again, and the reader, who knows where the change was, solves for what was hidden and for what changed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias
from zoneinfo import ZoneInfo

import numpy as np
from privacy import hidden_counts as hidden
from privacy import live_pages, person_times
from privacy.hidden_counts import HOURS, N_DAYS, Key, Known, World
from privacy.other_outputs import read_cards
from privacy.person_times import Times
from report import ingested_worlds as worlds
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from vsd_analytics.errors import ReportError, UsageError
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.json_and_csv import to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.retention.purge import Terms, purge_range
from vsd_analytics.warehouse.warehouse import open_warehouse

Versioned: TypeAlias = tuple[int, Key]
"""Number of the version, and an unknown of it."""
Asked: TypeAlias = tuple[list[tuple[Versioned, float]], int]
"""Weights of unknowns, and the sum they have in truth."""
ASKED_ON = (1, 2, 3, 5)
EACH = 3
"""Pages of weeks that go on are asked for in each third week."""
SLOT_S = worlds.SLOT_MS // 1000


@dataclass
class Versions:
    """What a reader knows of the versions of a world.

    Attributes:
        worlds: What was counted, version by version.
        rows: What the reader knows: weights of unknowns, limits, source.
        changed: Unknowns that may differ from the version before, version by version.
        times: What the reader knows of person-time in each version, all weeks that did not change included.
        n_running: Pages of weeks that went on.
        n_refused: Such pages that were refused.
    """

    worlds: list[World] = field(default_factory=list)
    rows: list[tuple[Mapping[Versioned, float], float, float, str]] = field(default_factory=list)
    changed: list[frozenset[Key]] = field(default_factory=list)
    times: list[Times] = field(default_factory=list)
    n_running: int = 0
    n_refused: int = 0

    def add(self, known: Known, number: int) -> None:
        self.rows += [({(number, k): w for k, w in row.items()}, lo, hi, said) for row, lo, hi, said in known.rows]


def lived(
    folder: Path, seed: int, *, n_weeks: int, days: Sequence[int] = ASKED_ON, has_live_page: bool = False
) -> Versions:
    """Return what a reader has of a world after all its weeks, with pages asked for while they go on.

    Args:
        folder: Where it is written.
        seed: Of chance.
        n_weeks: Its weeks.
        days: Days of each week, from 0, in whose morning a page is asked for.
        has_live_page: The live page is read in every minute.
    """
    made = hidden.build(folder / "whole", seed, n_weeks=n_weeks)
    world = hidden.write(folder / "site", made.n, made.lost, weeks=0)
    versions = Versions([world], changed=[frozenset()], times=[Times()])
    for week in range(n_weeks):
        hidden.add_week(world, week)
        if has_live_page:
            live_pages.read_live(versions.times[0], world, week)
        for day in days if week % EACH == 0 else ():
            try:
                report = week_report(world.site, hidden.monday(week), clock=instant(week, day, 5))
            except (ReportError, UsageError):
                versions.n_refused += 1
                continue
            versions.n_running += 1
            versions.add(so_far(world, week, report, versions.times[0]), 0)
        known = hidden.published(world, [week], times=versions.times[0])
        read_cards(known, world, week, first=world)
        versions.add(known, 0)
    return versions


def so_far(world: World, week: int, report: WeekReport, times: Times) -> Known:
    """Return what a page of a week that goes on tells, and add what it tells of person-time."""
    figures, known = json.loads(to_json(report)), Known()
    last = (date.fromisoformat(figures["week"]["sunday"]) - hidden.monday(week)).days
    days = range(min(last + 1, N_DAYS))
    source = f"week {week} to day {last}"

    def keys(place: str | bool | None) -> list[Key]:
        return [key for key in hidden.keys_of(week, place=place) if key[2] in days]

    def of(place: str | bool | None, row: Mapping[str, Any], n: float | None, name: str) -> None:
        if n is not None:
            known.exact(keys(place), n, name)
        x_h = [world.x_h(week, camera, days) for camera in range(2)]
        cameras = {p: camera for p, (_, camera) in enumerate(hidden.POINTS.values())}
        per_hour = {k: 1 / x_h[cameras[k[1]]] for k in keys(place) if x_h[cameras[k[1]]]}
        known.rounded(per_hour, row["violation_rate"]["value"], f"{name}.often")
        hidden._per_person_hour(known, keys(place), row["encounter_rate"], row["exposure_h"], f"{name}.risky")
        hidden._time_close(known, keys(place), row["close_time_share"], row["exposure_h"], f"{name}.close_share")

    of(True, figures["level"], figures["level"]["violations"], f"{source}, level")
    for row in figures["areas"]:
        of(row["area_id"], row, row["counted"], f"{source}, {row['area_id']}")
        if row["counted"] is None:
            hidden._label(known, keys(row["area_id"]), None, row, f"{source}, {row['area_id']}")
    for cell in figures["when"]["cells"]:
        day = (date.fromisoformat(cell["day"]) - hidden.monday(week)).days
        if day in days:
            at = hidden.keys_of(week, day=day, hour=cell["hour"])
            hidden._label(known, at, cell["violations"], cell, f"{source}, when {day} {cell['hour']}")
    person_times.read_json(times, world, week, figures, through=days[-1])
    return known


def instant(week: int, day: int, hour: int) -> datetime:
    """Return a local instant."""
    on = hidden.monday(week) + timedelta(days=day)
    return datetime(on.year, on.month, on.day, hour, tzinfo=ZoneInfo("Europe/Rome"))


def erased(versions: Versions, week: int, camera: int, day: int, hour: int, *, slots: int) -> None:
    """Erase the first places of an hour of a camera, each of 40 s, and make everything again."""
    before = versions.worlds[-1]
    first = round(instant(week, day, hour).timestamp() * 1000)
    terms = Terms(now=datetime(2027, 1, 1, tzinfo=UTC), reason="request 7")
    purge_range(
        before.site, camera_id=f"cam-{camera + 1}", first_ms=first, after_ms=first + slots * SLOT_S * 1000, terms=terms
    )
    keys = frozenset(k for k in hidden.keys_of(week, camera=camera, day=day, hour=hour))
    n = {key: max(0, v - slots) if key in keys else v for key, v in before.n.items()}
    on = hidden.monday(week) + timedelta(days=day)
    with open_warehouse(before.site, on, on) as warehouse:
        [row] = warehouse.rows(
            "select sum(recorded_open_s) as s from camera_hours where camera_id = $camera and local_hour = $hour",
            {"camera": f"cam-{camera + 1}", "hour": hour},
        )
    cut_h = {**before.cut_h, (week, camera, day, hour): 1 - row["s"] / 3600}
    _again(versions, World(before.site, n, before.lost, cut_h), keys)


def late(versions: Versions, week: int, camera: int, day: int, counts: Callable[[Key], int]) -> None:
    """Ingest a day that a camera had not sent, and make everything again."""
    before = versions.worlds[-1]
    keys = frozenset(hidden.keys_of(week, camera=camera, day=day))
    n = {key: counts(key) if key in keys else v for key, v in before.n.items()}
    after = World(before.site, n, before.lost - {(week, camera, day)}, before.cut_h)
    worlds.add(after.site, hidden.stream(after, week, camera, [day]), name=f"late-{len(versions.worlds)}")
    _again(versions, after, keys)


def nearer(versions: Versions) -> None:
    """Make everything again for a legal distance that nobody falls below."""
    before = versions.worlds[-1]
    site, none = before.site.with_settings(distance_m=1.4), dict.fromkeys(before.n, 0)
    after = World(site, none, before.lost, before.cut_h, pairs=before.n)
    _again(versions, after, frozenset(before.n))


def _again(versions: Versions, world: World, changed: frozenset[Key]) -> None:
    """Make again what may differ: the weeks that changed, the two after each (hotspots), and the last (weeks so far).

    All other outputs would have numbers that the reader has from before.
    """
    versions.worlds.append(world)
    versions.changed.append(changed)
    of = {key[0] for key in changed}
    weeks = sorted({w + k for w in of for k in range(3) if w + k < world.n_weeks} | {world.n_weeks - 1})
    same = [row for row in versions.times[-1].rows if not of & {key[0] for key in row[0]}]
    versions.times.append(Times(same))
    known = hidden.published(
        world, weeks, held_least=0, times=versions.times[-1], planners={w + k for w in of for k in range(2)}
    )
    for week in weeks:
        read_cards(known, world, week, first=versions.worlds[0])
    versions.add(known, len(versions.worlds) - 1)


def times_worked_out(versions: Versions) -> dict[str, float]:
    """Return the person-times of few people, of any version, whose value a reader of that version finds."""
    found = {}
    for number, (world, times) in enumerate(zip(versions.worlds, versions.times, strict=True)):
        found |= {f"version {number}, {name}": t for name, t in person_times.worked_out(times, world).items()}
    return found


def worked_out(versions: Versions) -> dict[str, int]:
    """Return the small counts, and the small changes, of which a reader finds the only possible value."""
    return _solved(versions, protected(versions))


def protected(versions: Versions) -> Mapping[str, Asked]:
    """Return the small counts of every version, and the small changes from one to the next."""
    asked: dict[str, Asked] = {}
    for v, world in enumerate(versions.worlds):
        for name, keys in hidden.small_counts(world).items():
            asked[f"version {v}, {name}"] = [((v, key), 1.0) for key in keys], world.sum(keys)
        for name, keys in _changes(versions, v).items():
            change = world.sum(keys) - versions.worlds[v - 1].sum(keys)
            if 0 < abs(change) < hidden.BELOW:
                parts = [((v, key), 1.0) for key in keys] + [((v - 1, key), -1.0) for key in keys]
                asked[f"change to version {v}, {name}"] = parts, change
    return asked


def _changes(versions: Versions, number: int) -> Mapping[str, Sequence[Key]]:
    """Return the sums of the weeks that changed: floor, places and hours."""
    weeks = {key[0] for key in versions.changed[number]} if number else set()
    sums = {f"week {w}, {place}": hidden.keys_of(w, place=place) for w in weeks for place in (True, *hidden.PLACES)}
    hours = product(weeks, range(N_DAYS), range(*HOURS))
    return sums | {f"week {w}, day {d}, hour {h}": hidden.keys_of(w, day=d, hour=h) for w, d, h in hours}


def _solved(versions: Versions, asked: Mapping[str, Asked]) -> dict[str, int]:
    unknowns = [(v, key) for v, world in enumerate(versions.worlds) for key in world.n]
    index = {unknown: i for i, unknown in enumerate(unknowns)}
    rows = [(weights, low, high) for weights, low, high, _ in versions.rows]
    for v, changed in enumerate(versions.changed[1:], 1):
        rows += [({(v, k): 1.0, (v - 1, k): -1.0}, 0.0, 0.0) for k in versions.worlds[v].n if k not in changed]
    matrix = sparse.dok_array((len(rows), len(index)))
    for i, (weights, _, _) in enumerate(rows):
        for unknown, w in weights.items():
            matrix[i, index[unknown]] = w
    low, high = (np.array([row[k] for row in rows]) for k in (1, 2))
    constraints = LinearConstraint(matrix.tocsr(), low - 1e-7, high + 1e-7)
    revealed = {}
    for name, (parts, truth) in asked.items():
        c = np.zeros(len(index))
        for unknown, w in parts:
            c[index[unknown]] += w
        limits = []
        for sign in (1, -1):
            best = milp(sign * c, constraints=constraints, integrality=np.ones(len(index)), bounds=Bounds(0, 400))
            limits.append(None if best.x is None else round(sign * best.fun))
        if None in limits or limits[0] == limits[1]:
            revealed[name] = truth
    return revealed


def broken(versions: Versions) -> list[str]:
    """Return the rows that the worlds themselves do not fulfil: mistakes of the reader."""
    wrong = []
    for weights, low, high, source in versions.rows:
        total = sum(w * versions.worlds[v].n[key] for (v, key), w in weights.items())
        if not low - 1e-6 <= total <= high + 1e-6:
            wrong.append(f"{source}: {total} is not in {low} to {high}")
    for world, times in zip(versions.worlds, versions.times, strict=True):
        wrong += person_times.broken(times, world)
    return wrong
