"""People who walk between places and stay there, and everything the marts and headline numbers say about them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import date
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from warehouse.small_projects import Frame, Pair, Person, make_site, open_days

from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import encounter_rate_level, violation_rate_level
from vsd_analytics.site.model import Site
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.warehouse.sqlfiles import relations

Record = Person | Pair | Frame
SIDE_MM = 20_000


def shoppers(seed: int, *, start: int, seconds: int, step_ms: int, n_people: int) -> list[Person]:
    """Return people who each walk alone between places and stay at each for 10 to 60 s.

    Args:
        seed: Seed of everything.
        start: First instant, UTC milliseconds.
        seconds: How long.
        step_ms: Milliseconds from frame to frame.
        n_people: How many, all the time; those of fewer people are among those of more.
    """
    found = []
    for i in range(n_people):
        rng = np.random.default_rng([seed, i])
        xy, at_ms, knots = rng.uniform(0, SIDE_MM, 2), 0.0, []
        while at_ms < seconds * 1000:
            goal = rng.uniform(0, SIDE_MM, 2)
            arrives_ms = at_ms + np.hypot(*(goal - xy)) / rng.uniform(0.8, 1.4)
            leaves_ms = arrives_ms + rng.uniform(10_000, 60_000)
            knots += [(at_ms, *xy), (arrives_ms, *goal)]
            xy, at_ms = goal, leaves_ms
        t_ms, x_mm, y_mm = np.array([*knots, (at_ms, *xy)]).T
        instants = np.arange(0, seconds * 1000, step_ms)
        x, y = (np.rint(np.interp(instants, t_ms, v)).astype(int) for v in (x_mm, y_mm))
        found += [Person(start + int(t), f"t{i}", int(a), int(b)) for t, a, b in zip(instants, x, y, strict=True)]
    return found


def true_spells(people: list[Person], *, gap_s: float) -> np.ndarray:
    """Return for how many tenths of a second any two people are closer than 2 m, apart for `gap_s` at most."""
    by_track: dict[str, list[tuple[int, int]]] = {}
    for p in people:
        by_track.setdefault(str(p.track), []).append((p.x, p.y))  # type: ignore[arg-type]
    spells = []
    for a, b in combinations([np.array(xy) for xy in by_track.values()], 2):
        near = np.concatenate([[0], (((a - b) ** 2).sum(axis=1) < 2000**2).astype(int), [0]])
        turns = np.flatnonzero(np.diff(near))
        starts, ends = turns[::2], turns[1::2]
        is_apart = starts[1:] - ends[:-1] > gap_s * 10
        spells += [ends[np.append(is_apart, True)] - starts[np.append(True, is_apart)]] if len(turns) else []
    return np.concatenate(spells)


def marts(site: Site, first: str, last: str) -> dict[str, list[str]]:
    """Return every row of every mart as sorted text."""
    with open_days(site, first, last) as warehouse:
        return {
            name: sorted(json.dumps(row, default=str) for row in warehouse.rows(f"select * from {name}"))
            for name in relations("marts")
            if name != "heatmap"
        }


def headline(site: Site, first: str, last: str) -> tuple[RateEstimate, RateEstimate, dict[str, float]]:
    """Return M0, M7, and sums over the hours of the range."""
    with open_days(site, first, last) as warehouse:
        period = Period(
            FloorHours(warehouse, floor=site.floors[0]), date.fromisoformat(first), date.fromisoformat(last)
        )
        sums = warehouse.rows(
            "select sum(person_records)::double as person_records, sum(exposure_s)::double as exposure_s, "
            "sum(violation_records)::double as violation_records, sum(violation_s)::double as violation_s, "
            "sum(n_violations)::double as n_violations, sum(recorded_s)::double as recorded_s from hours"
        )[0]
        return violation_rate_level(period, period.whole), encounter_rate_level(period, period.whole), sums


def small_site(root: Path, **more: Any) -> Site:
    """Return a site whose headline numbers speak from a tenth of a person-hour on, in hours recorded for minutes."""
    return make_site(root, **{"min_exposure_h": 0.1, "partial_hour_share": 0.01, **more})


def close_pairs(people: Sequence[Person], *, within_mm: int = 2_500) -> list[Pair]:
    """Return pairs as an engine sends them."""
    frames: dict[int, list[Person]] = {}
    for p in people:
        frames.setdefault(p.ts, []).append(p)
    found = []
    for ts, group in frames.items():
        for i, p in enumerate(group):
            for j, q in enumerate(group[i + 1 :], start=i + 1):
                mm = int(np.hypot(p.x - q.x, p.y - q.y))  # type: ignore[operator]
                if mm <= within_mm:
                    found.append(Pair(ts, p.track, q.track, mm, xy=(p.x, p.y, q.x, q.y), persons=(i, j)))
    return found


def swapped(pair: Pair) -> Pair:
    """Return the same pair, the other person first."""
    (xa, ya, xb, yb), (a, b) = pair.xy, pair.persons
    return Pair(pair.ts, pair.b, pair.a, pair.mm, pair.camera, (xb, yb, xa, ya), (b, a))
