"""A made-up corridor under two cameras, as records of a store: people walk from a door past the bread to the till.

The floor between both views is blind, a border, or seen by both; tracks are cut, and a camera is dead on some days.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from warehouse.small_projects import DAY, HOUR, T0, Frame, Person, make_site, put

from vsd_analytics.site.model import Area, Camera, Site

Floats = NDArray[np.float64]
SPANS = {"door": (0.0, 2.0), "bread": (6.0, 8.0), "hall": (9.5, 16.5), "till": (18.0, 21.0), "exit": (22.0, 24.0)}
"""Areas along the corridor, from x to x, metres."""
LANES = {"bread": (3.0, 4.0), "hall": (0.0, 1.0)}
"""From y to y, where an area does not reach over the whole corridor: who does not stop passes beside it."""
BREAD_SHARE, ON_SHARE = 0.6, 0.7
"""Share of those who come in that stop at the bread; of these, the share who go on to the till."""
CAPACITY = 2
STOP_S = {"bread": (20.0, 0.7), "hall": (12.0, 0.5), "till": (25.0, 0.5)}
"""Median of a stop and standard deviation of its logarithm."""
STOPS_IN_HALL = 0.5
BUSY = np.array([0.7, 1.6])
"""People of each of the two open hours of a day, over their mean."""


@dataclass(frozen=True)
class World:
    """How cameras see the corridor.

    Attributes:
        name: For tables.
        views: From x to x of either camera's view.
        cut_per_s: Rate at which a track is lost and another one begins.
        dead_days: Share of the days on which the second camera records nothing.
        dead_busy: Share of the days on which it records nothing in the busy hour.
        per_hour: People who come in an hour.
        day_sd: Standard deviation of a day's factor on people (logarithm).
    """

    name: str
    views: tuple[tuple[float, float], tuple[float, float]] = ((-2.0, 13.0), (13.0, 26.0))
    cut_per_s: float = 0.0
    dead_days: float = 0.0
    dead_busy: float = 0.0
    per_hour: float = 45.0
    day_sd: float = 0.15


@dataclass(frozen=True)
class Walker:
    """Somebody's way.

    Attributes:
        start_s: When the first record lies, seconds of the open time.
        x, y: Where at each second, metres.
        way: Areas in the order in which they are entered.
        stays: Seconds in each area that was entered; "wait" is the time from the till to the exit.
    """

    start_s: int
    x: Floats
    y: Floats
    way: tuple[str, ...]
    stays: dict[str, float]


def walker(start_s: int, rng: np.random.Generator) -> Walker:
    """Return somebody who comes in by the door, and leaves by the exit or the door."""
    speed = float(np.clip(rng.normal(1.2, 0.15), 0.8, 1.7))
    at_bread = rng.random() < BREAD_SHARE
    goes_on = rng.random() < ON_SHARE if at_bread else True
    stops = [("bread", 7.0)] * at_bread + ([("hall", 13.0 + rng.uniform(-2.5, 2.5))] * (rng.random() < STOPS_IN_HALL)
             + [("till", 19.5)] if goes_on else [])  # fmt: skip
    corners, at, t = [(0.0, 1.0)], 1.0, 0.0
    for name, x in stops:
        median, spread = STOP_S[name]
        t += abs(x - at) / speed
        corners += [(t, x), (t := t + median * float(np.exp(rng.normal(0, spread))), x)]
        at = x
    end = 23.0 if goes_on else 1.0
    corners.append((t + abs(end - at) / speed, end))
    times, places = np.array(corners).T
    x = np.interp(np.arange(int(times[-1]) + 1), times, places)
    y = np.full(len(x), rng.uniform(1.2, 2.8))
    for name, place in stops:
        if name in LANES:
            y[np.abs(x - place) < 1e-9] = sum(LANES[name]) / 2
    here = np.full(len(x), "", dtype=object)
    for name in SPANS:
        here[is_in(name, x, y)] = name
    named = here[here != ""]
    way = tuple(named[np.append(True, named[1:] != named[:-1])])
    stays = {name: float((here == name).sum()) for name in set(named)}
    if "exit" in stays:
        stays["wait"] = float(np.argmax(here == "exit") - np.argmax(here == "till"))
    return Walker(start_s, x, y, way, stays)


def is_in(name: str, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Return where a place lies in an area."""
    (lo, hi), (low, high) = SPANS[name], LANES.get(name, (0.0, 4.0))
    return np.asarray((x >= lo) & (x < hi) & (y >= low) & (y < high))


def site(root: Path, world: World) -> Site:
    """Return the corridor: two cameras, five areas; the till is a queue with a capacity."""
    areas = tuple(
        Area(
            name, name.title(), "ground", ((lo, low), (hi, low), (hi, high), (lo, high)), has_visits=True,
            is_door=name in ("door", "exit"), is_queue=name == "till", capacity=CAPACITY if name == "till" else None,
            served_in="exit" if name == "till" else None,
        )
        for name, (lo, hi) in SPANS.items()
        for low, high in [LANES.get(name, (0.0, 4.0))]
    )  # fmt: skip
    cameras = [
        Camera(c, c, "ground", hz=1.0, view=((lo, -1), (hi, -1), (hi, 5), (lo, 5)))
        for c, (lo, hi) in zip("ab", world.views, strict=True)
    ]
    made = make_site(root, cameras=cameras, opening=(((480, 600),),) * 7)
    return replace(made, areas=areas)


def fill(made: Site, world: World, *, n_days: int, seed: int, is_stored: bool = True) -> list[Walker]:
    """Put some days into the site's store; return who walked."""
    rng = np.random.default_rng(seed)
    rows: list[Person | Frame] = []
    everybody = []
    for day in range(n_days):
        dead = rng.random() < world.dead_days
        dead_from = HOUR if rng.random() < world.dead_busy else 2 * HOUR
        level = np.exp(rng.normal(-(world.day_sd**2) / 2, world.day_sd))
        starts = [
            int(h * 3600 + s)
            for h, busy in enumerate(BUSY)
            for s in rng.uniform(0, 3300, rng.poisson(world.per_hour * busy * level))
        ]
        for k, start_s in enumerate(starts):
            who = walker(start_s, rng)
            everybody.append(who)
            if not is_stored:
                continue
            for camera, (lo, hi) in zip("ab", world.views, strict=True):
                seen = np.flatnonzero((who.x >= lo) & (who.x < hi))
                cuts = rng.random(len(seen)) < -np.expm1(-world.cut_per_s)
                # who leaves the view and comes back has another number
                piece = np.cumsum(cuts | (np.diff(seen, prepend=seen[:1]) > 1))
                for s, p in zip(seen.tolist(), piece.tolist(), strict=True):
                    at = (who.start_s + s) * 1000
                    if camera == "a" or not (dead or at >= dead_from):
                        rows.append(
                            Person(
                                T0 + day * DAY + at,
                                f"{camera}{day}-{k}-{p}",
                                round(who.x[s] * 1000),
                                round(who.y[s] * 1000),
                                camera,
                            )
                        )
        for camera in "ab":
            until = 2 * HOUR if camera == "a" else 0 if dead else dead_from
            rows += [Frame(T0 + day * DAY + t, camera) for t in range(0, until, 1000)]
    if is_stored:
        put(made, rows)
    return everybody


BORDER, OVERLAP, BLIND = ((-2.0, 13.0), (13.0, 26.0)), ((-2.0, 15.0), (11.0, 26.0)), ((-2.0, 11.0), (15.0, 26.0))
WHOLE = ((-2.0, 26.0), (26.0, 28.0))
WORLDS = (
    World("one camera sees all", views=WHOLE),
    World("one camera, half of the tracks cut", views=WHOLE, cut_per_s=0.02),
    World("a border in the hall", views=BORDER),
    World("4 m of the hall seen by both", views=OVERLAP),
    World("4 m of the hall blind", views=BLIND),
    World("blind, and half of the tracks cut", views=BLIND, cut_per_s=0.02),
    World("blind, cut, camera b dead on 2 days of 7", views=BLIND, cut_per_s=0.02, dead_days=0.29),
    World("blind, cut, b dead in the busy hour of 4 days of 7", views=BLIND, cut_per_s=0.02, dead_busy=0.57),
)
