"""Walkers of a hall, alone and in couples side by side, and what four cameras with errors see of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
View = tuple[float, float, float, float]

HALL_M = (20.0, 12.0)
HZ = 2
LAST_S = 600
COUPLE_M = 0.6
"""How far apart the two of a couple walk."""
VIEWS: Mapping[str, View] = {"a": (0, 0, 11, 8), "b": (6, 0, 20, 8), "c": (0, 4, 20, 12), "d": (8, 3, 20, 12)}
"""Left, lower, right and upper edge of what a camera sees, m; those at the lower wall look up, the others down."""
NOISE_M = 0.08
LOST = 0.03
"""Share of a camera's records that its detector misses."""
HIDDEN = 0.85
"""Share of records missed of a person whom somebody in front hides."""
CUT_PER_S = 0.02


@dataclass(frozen=True)
class Walker:
    """Where a person truly is.

    Attributes:
        name: Who.
        ms: Instants, milliseconds, shape (n,).
        x_m, y_m: Places then, metres, shape (n,).
    """

    name: str
    ms: NDArray[np.int64]
    x_m: Floats
    y_m: Floats


def people_in_hall(rng: np.random.Generator, *, people: int, couples: float) -> list[Walker]:
    """Return people who walk from place to place and stop now and then, for 20 to 60 s each.

    Args:
        rng: Chance.
        people: About how many are in the hall at once.
        couples: Share of those who come that are a couple.
    """
    instants = np.arange(0, LAST_S, 1 / HZ)
    walkers = []
    for unit in range(int(people / (1 + couples) * LAST_S / 40)):
        began, life = rng.uniform(-40, LAST_S), rng.uniform(20, 60)
        at, place = began, rng.uniform((0, 0), HALL_M)
        way = [(at, *place)]
        while at < began + life:
            if rng.random() < 0.35:
                at += rng.uniform(3, 15)
            else:
                target = rng.uniform((0, 0), HALL_M)
                at += float(np.hypot(*(target - place))) / max(rng.normal(1.25, 0.2), 0.6)
                place = target
            way.append((at, *place))
        points = np.array(way)
        t = instants[(instants >= began) & (instants < began + life)]
        x, y = (np.interp(t, points[:, 0], points[:, k]) for k in (1, 2))
        if rng.random() >= couples:
            walkers.append(Walker(str(unit), _ms(t), x, y))
            continue
        dx, dy = (
            np.interp(t + 1, points[:, 0], points[:, k]) - np.interp(t - 1, points[:, 0], points[:, k]) for k in (1, 2)
        )
        long_m = np.hypot(dx, dy)
        side_x, side_y = (np.where(long_m > 0.05, d / (long_m + 1e-9), still) for d, still in ((-dy, 1.0), (dx, 0.0)))
        for name, side in (("left", -COUPLE_M / 2), ("right", COUPLE_M / 2)):
            walkers.append(Walker(f"{unit}{name}", _ms(t), x + side * side_x, y + side * side_y))
    return walkers


def _ms(seconds: Floats) -> NDArray[np.int64]:
    return np.rint(seconds * 1000).astype(np.int64) + 10_000


def seen_by_cameras(
    rng: np.random.Generator, walkers: Sequence[Walker], *, bias_m: float, clock_s: float
) -> tuple[Mapping[str, View], list[tuple[int, str, str, float, float]]]:
    """Return the cameras' views, and rows of instant (ms), track, camera, x and y (m).

    Args:
        rng: Chance.
        walkers: Who is there.
        bias_m: How far each camera places everybody off, in its own direction; a few hundredths more a metre.
        clock_s: How far clocks of cameras other than the first are off at most.
    """
    who = np.concatenate([np.full(len(w.ms), k) for k, w in enumerate(walkers)])
    ms = np.concatenate([w.ms for w in walkers])
    xy = np.stack([np.concatenate([w.x_m for w in walkers]), np.concatenate([w.y_m for w in walkers])], axis=1)
    rows: list[tuple[int, str, str, float, float]] = []
    for camera, (x0, y0, x1, y1) in VIEWS.items():
        angle = rng.uniform(0, 2 * np.pi)
        bias = bias_m * np.array([np.cos(angle), np.sin(angle)])
        slope = rng.normal(0, bias_m * 0.03, (2, 2))
        late_ms = 0 if camera == "a" else round(rng.uniform(-clock_s, clock_s) * 1000)
        lens = np.array([(x0 + x1) / 2, -2.0 if y0 == 0 else HALL_M[1] + 2])
        piece, last_ms = dict.fromkeys(range(len(walkers)), 0), dict.fromkeys(range(len(walkers)), -(10**9))
        is_in = (xy[:, 0] >= x0) & (xy[:, 0] <= x1) & (xy[:, 1] >= y0) & (xy[:, 1] <= y1)
        for instant in np.unique(ms[is_in]):
            here = np.flatnonzero(is_in & (ms == instant))
            away = xy[here] - lens
            far, turn = np.hypot(*away.T), np.arctan2(*away.T)
            for k, at in enumerate(here):
                in_front = (far < far[k] - 0.2) & (np.abs(turn - turn[k]) * far < 0.35)
                if rng.random() < (HIDDEN if in_front.any() else LOST):
                    continue
                person = int(who[at])
                if instant - last_ms[person] > 3000 or rng.random() < CUT_PER_S / HZ:
                    piece[person] += 1
                last_ms[person] = int(instant)
                x, y = xy[at] + bias + slope @ (xy[at] - np.array(HALL_M) / 2) + rng.normal(0, NOISE_M, 2)
                track = f"{walkers[person].name}#{camera}{piece[person]}"
                rows.append((int(instant) + late_ms, track, camera, float(x), float(y)))
    return VIEWS, rows
