"""Floors of people for the proof of the hotspots: people who walk, stand, come in company, and cells drawn at once.

Nothing here is the demo's simulator. `people` has positions of single people frame by frame: exposure and time in
violation are counted pair by pair, and what random mixing would make is summed cell by cell as the formula of M19 says.
`cells` draws the same three from stated variation of days, weeks and patches of floor, a hundred times faster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from vsd_analytics.stats.decomposition import closeness, nearby

ROWS, COLUMNS = 14, 20
"""Floors have so many cells of 1 m."""
LEGAL_M = 2.0
PLANTED_M = 1.6
"""Radius of a planted place."""
HOURS, FRAMES = 8, 40
"""Opening hours a day; frames an hour, so far apart that walkers have crossed half the floor."""


@dataclass(frozen=True)
class Cube:
    """Person-hours by day and cell, shape (n_days, ROWS, COLUMNS), and the planted place (row, column)."""

    violation_h: np.ndarray
    exposure_h: np.ndarray
    mixed_h: np.ndarray
    place: tuple[int, int]


@dataclass(frozen=True)
class People:
    """A floor of people.

    Attributes:
        in_company: Share of groups that are couples, who stay 0.9 m apart.
        peaks: How uneven the crowd is: 0 = everywhere alike.
        is_corridor: They cross from left to right; otherwise they stand or stroll.
        noise_m: Error of positions at the left and at the right half of the floor.
        counter_share: Share of the people that wait at a counter, one person beside the other.
        groups: Groups in view at a time, on average over the day.
        day_sd: How much days differ in their number of people (log).
    """

    in_company: float = 0.0
    peaks: float = 0.0
    is_corridor: bool = False
    noise_m: tuple[float, float] = (0.0, 0.0)
    counter_share: float = 0.0
    groups: float = 8.0
    day_sd: float = 0.25


@dataclass(frozen=True)
class Variation:
    """How cells vary beyond what crowding explains, and what is planted.

    Attributes:
        day_sd: Of the whole floor by day (log).
        patch_sd: Of patches some 5 m wide by day (log).
        correlation: Of a patch's days with the next day's.
        week_sd: Of patches by week (log).
        ratio: Of time in violation within `PLANTED_M` of a place to what crowding explains.
        fixed_days_ago: Days at the end on which the planted place is like the others.
        hours: Person-hours a day.
    """

    day_sd: float = 0.25
    patch_sd: float = 0.3
    correlation: float = 0.0
    week_sd: float = 0.0
    ratio: float = 1.0
    fixed_days_ago: int = 0
    hours: float = 150.0


def away(place: tuple[int, int]) -> np.ndarray:
    """Return the distance of each cell from a place, in cells (metres)."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    return np.hypot(y - place[0], x - place[1])


def inner() -> np.ndarray:
    """Return the cells that are tested: those that do not lie at the border of the view."""
    cells = np.zeros((ROWS, COLUMNS), dtype=bool)
    cells[1:-1, 1:-1] = True
    return cells


def cells(world: Variation, rng: np.random.Generator, *, n_days: int = 28) -> Cube:
    """Return a floor whose cells vary as stated: an uneven crowd, mixed at random, with shocks, in encounters."""
    x = _crowd(rng, peaks=1.0)
    busy = np.resize([0.9, 0.85, 0.9, 1.0, 1.2, 1.4, 0.75], n_days) * np.exp(rng.normal(0, world.day_sd, n_days))
    exposure_h = world.hours * x * busy[:, None, None] * rng.gamma(25, 1 / 25, (n_days, ROWS, COLUMNS))
    others = 6.0 * busy[:, None, None]
    near = nearby(exposure_h, closeness(cell_m=1.0, distance_m=LEGAL_M))
    mixed_h = exposure_h * -np.expm1(-others * near / exposure_h.sum(axis=(1, 2), keepdims=True))
    shock = _patches(world.patch_sd, world.correlation, rng, n_days)
    shock = shock + np.repeat(_patches(world.week_sd, 0.0, rng, -(-n_days // 7)), 7, axis=0)[:n_days]
    place = int(rng.integers(4, ROWS - 4)), int(rng.integers(4, COLUMNS - 4))
    risk = np.where(away(place) <= PLANTED_M, world.ratio, 1.0)
    planted = np.arange(n_days) < n_days - world.fixed_days_ago
    risk = np.where(planted[:, None, None], risk, 1.0)
    wanted = mixed_h * risk * np.exp(shock + rng.normal(0, 0.1, (n_days, 1, 1)))
    episode_h = 20 / 3600
    return Cube(np.minimum(rng.poisson(wanted / episode_h) * episode_h, exposure_h), exposure_h, mixed_h, place)


def people(world: People, rng: np.random.Generator, *, n_days: int = 28) -> Cube:
    """Return a floor of single people: positions frame by frame, counted pair by pair."""
    frame, x, y = positions(world, rng, n_days=n_days)
    return _counted(frame, x, y, np.arange(n_days * HOURS * FRAMES) // FRAMES, n_days)


def positions(
    world: People, rng: np.random.Generator, *, n_days: int = 28
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frame, x and y (metres) of each person seen, by frame; a day has `HOURS` x `FRAMES` frames."""
    n_frames = n_days * HOURS * FRAMES
    of_hour = 0.6 + 0.8 * np.sin(np.pi * (np.arange(HOURS) + 0.5) / HOURS)
    busy = np.exp(rng.normal(0, world.day_sd, n_days))
    n = rng.poisson(world.groups * np.repeat((busy[:, None] * of_hour).ravel(), FRAMES))
    frame = np.repeat(np.arange(n_frames), n)
    x, y = _places(world, rng, len(frame))
    is_couple = rng.uniform(size=len(frame)) < world.in_company
    angle = (
        np.full(int(is_couple.sum()), np.pi / 2) if world.is_corridor else rng.uniform(0, 2 * np.pi, is_couple.sum())
    )
    if world.counter_share:
        frame, x, y = _with_counter(world, frame, x, y, rng)
        is_couple, angle = np.zeros(len(frame), dtype=bool), np.zeros(0)
    frame = np.concatenate([frame, frame[is_couple]])
    x, y = (np.concatenate([v, v[is_couple] + 0.9 * way(angle)]) for v, way in ((x, np.cos), (y, np.sin)))
    sd = np.where(x < COLUMNS / 2, *world.noise_m)
    x, y = x + rng.normal(0, 1, len(x)) * sd, y + rng.normal(0, 1, len(y)) * sd
    seen = (x >= 0) & (x < COLUMNS) & (y >= 0) & (y < ROWS)
    frame, x, y = frame[seen], x[seen], y[seen]
    order = np.argsort(frame, kind="stable")
    return frame[order], x[order], y[order]


def _counted(frame: np.ndarray, x: np.ndarray, y: np.ndarray, hour: np.ndarray, n_days: int) -> Cube:
    """Return exposure, time in violation and of random mixing of people sorted by frame."""
    n = np.bincount(frame, minlength=len(hour))
    first = np.concatenate([[0], np.cumsum(n)[:-1]])
    after = first[frame] + n[frame] - np.arange(len(frame)) - 1  # people of the same frame further down
    a = np.repeat(np.arange(len(frame)), after)
    b = a + 1 + np.arange(len(a)) - np.repeat(np.cumsum(after) - after, after)
    close = (x[a] - x[b]) ** 2 + (y[a] - y[b]) ** 2 < LEGAL_M**2
    is_close = np.zeros(len(frame), dtype=bool)
    is_close[a[close]] = is_close[b[close]] = True
    each_h = 1 / FRAMES
    n_hours = n_days * HOURS
    at = (hour[frame] * ROWS + y.astype(int)) * COLUMNS + x.astype(int)
    shape = (n_hours, ROWS, COLUMNS)
    exposure, violation = (
        np.bincount(at, weights=w, minlength=n_hours * ROWS * COLUMNS).reshape(shape) * each_h
        for w in (np.ones(len(frame)), is_close.astype(float))
    )
    by_hour = np.bincount(hour, weights=n, minlength=n_hours)
    others = np.bincount(hour, weights=n * (n - 1.0), minlength=n_hours) / np.maximum(by_hour, 1)
    usual = exposure.reshape(n_days, HOURS, ROWS, COLUMNS).sum(axis=0)  # one map for each hour of the day
    near = nearby(usual, closeness(cell_m=1.0, distance_m=LEGAL_M)) / usual.sum(axis=(1, 2), keepdims=True)
    mixed = exposure * -np.expm1(-others[:, None, None] * np.tile(near, (n_days, 1, 1)))
    by_day = [v.reshape(n_days, HOURS, ROWS, COLUMNS).sum(axis=1) for v in (violation, exposure, mixed)]
    return Cube(by_day[0], by_day[1], by_day[2], (-1, -1))


def _places(world: People, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where people are: along a corridor alike, else as an uneven crowd has it."""
    if not world.peaks:
        return rng.uniform(0, COLUMNS, n), rng.uniform(0, ROWS, n)
    share = _crowd(rng, peaks=world.peaks)
    cell = rng.choice(ROWS * COLUMNS, size=n, p=share.ravel())
    return cell % COLUMNS + rng.uniform(size=n), cell // COLUMNS + rng.uniform(size=n)


def _with_counter(
    world: People, frame: np.ndarray, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return people of whom some wait at a counter in the middle, 0.8 m apart in the order in which they came."""
    waits = rng.uniform(size=len(frame)) < world.counter_share
    before = np.cumsum(waits) - waits
    start = np.searchsorted(frame, frame)
    number = before - before[start]
    middle = COLUMNS / 2 - 3
    return frame, np.where(waits, np.minimum(middle + 0.8 * number, COLUMNS - 0.1), x), np.where(waits, ROWS / 2, y)


def _crowd(rng: np.random.Generator, *, peaks: float) -> np.ndarray:
    """Return shares of person-time by cell: five peaks of random place and width over an even floor."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    crowd = np.full((ROWS, COLUMNS), 0.15)
    for _ in range(5):
        row, column = rng.uniform(0, ROWS), rng.uniform(0, COLUMNS)
        height, width = peaks * rng.uniform(0.4, 1.5), rng.uniform(2, 5)
        crowd += height * np.exp(-((y - row) ** 2 + (x - column) ** 2) / (2 * width**2))
    return crowd / crowd.sum()


def _patches(sd: float, correlation: float, rng: np.random.Generator, n: int) -> np.ndarray:
    """Return normal shocks of patches of floor, shape (n, ROWS, COLUMNS), correlated from each step to the next."""
    own = ndimage.gaussian_filter(rng.normal(0, 1, (n, ROWS, COLUMNS)), sigma=(0, 2, 2), mode="wrap")
    own *= sd / own.std()
    for k in range(1, n):
        own[k] = correlation * own[k - 1] + np.sqrt(1 - correlation**2) * own[k]
    return own
