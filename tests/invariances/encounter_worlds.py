"""Floors of people with true ids, and what trackers do to them: ids that switch, doubles, places that flicker.

People enter at doors on the edges, alone or in company, walk between places, stand, queue at a counter, and leave.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

HZ = 10
SIDE_M = (24.0, 16.0)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Person records in order of instants: one element each.

    Attributes:
        ts_ms: Instant, from 0 on.
        person: True person.
        track: Id that the tracker gives.
        x_m, y_m: Place.
    """

    ts_ms: Ints
    person: Ints
    track: Ints
    x_m: Floats
    y_m: Floats

    def rows(self, chosen: npt.NDArray[np.generic]) -> Seen:
        """Return some of the records."""
        return Seen(*(getattr(self, name)[chosen] for name in ("ts_ms", "person", "track", "x_m", "y_m")))


def _joined(parts: list[Seen]) -> Seen:
    every = Seen(*(np.concatenate([getattr(p, n) for p in parts]) for n in ("ts_ms", "person", "track", "x_m", "y_m")))
    return every.rows(np.lexsort((every.track, every.ts_ms)))


def walkers(
    rng: np.random.Generator, *, seconds: int, per_hour: float, company: float = 0.3, stays_s: float = 40.0
) -> Seen:
    """Return people who enter at one of four doors, visit one to three places, stand there, and leave.

    Args:
        rng: Source of everything.
        seconds: How long.
        per_hour: Parties that enter.
        company: Share of parties of two, who walk 0.7 m beside each other.
        stays_s: Mean time at a place; spread 15 to 2.5 times that.
    """
    width, depth = SIDE_M
    doors = np.array([(0.0, 4.0), (0.0, 12.0), (width, 8.0), (12.0, depth)])
    places = np.array([(x, y) for x in (4, 8, 12, 16, 20) for y in (3, 8, 13)], dtype=np.float64)
    n = rng.poisson(per_hour * seconds / 3600)
    parts, person = [], 0
    for enters_s in np.sort(rng.uniform(0, seconds, n)):
        door, out = doors[rng.integers(4, size=2)]
        speed, at_s = rng.uniform(0.9, 1.5), float(enters_s)
        knots = [(at_s, *door)]
        here = door
        for _ in range(rng.integers(1, 4)):
            goal = places[rng.integers(len(places))] + rng.normal(0, 0.5, 2)
            at_s += float(np.hypot(*(goal - here))) / speed
            knots.append((at_s, *goal))
            at_s += rng.uniform(0.3, 1.7) * stays_s
            knots.append((at_s, *goal))
            here = goal
        at_s += float(np.hypot(*(out - here))) / speed
        knots.append((at_s, *out))
        t, x, y = np.array(knots).T
        ticks = np.arange(np.ceil(enters_s * HZ), np.floor(min(at_s, seconds) * HZ))
        for beside in (0.0, 0.7) if rng.random() < company else (0.0,):
            sway = 0.08 * np.sin(ticks / HZ * rng.uniform(0.4, 0.9) + rng.uniform(0, 6))
            of = np.full(len(ticks), person)
            parts.append(
                Seen(
                    (ticks * 1000 / HZ).astype(np.int64),
                    of,
                    of,
                    np.interp(ticks / HZ, t, x) + sway + beside * 0.8,
                    np.interp(ticks / HZ, t, y) + beside * 0.6,
                )
            )
            person += 1
    return _joined(parts)


def queue(
    rng: np.random.Generator, *, seconds: int, spacing_m: float = 1.0, serves_s: float = 25.0, n: int = 12
) -> Seen:
    """Return people who stand in a line of `n` and move up each time that the first is served."""
    parts = []
    moves = np.cumsum(rng.gamma(4, serves_s / 4, size=seconds))
    moves = np.concatenate([np.zeros(n - 1), moves[moves < seconds]])
    ticks = np.arange(seconds * HZ) / HZ
    for k in range(len(moves) - n):
        joins, leaves = moves[k], moves[k + n]
        t = ticks[(ticks >= joins) & (ticks < leaves)]
        if not len(t):
            continue
        ahead = np.interp(t, *_steps(moves[k + 1 : k + n], n - 1))
        x = 4 + spacing_m * ahead + 0.05 * np.sin(t * rng.uniform(0.3, 0.8) + rng.uniform(0, 6))
        y = 8 + 0.05 * np.sin(t * rng.uniform(0.3, 0.8) + rng.uniform(0, 6))
        # comes from the right, and leaves downwards
        coming, going = np.clip(1 - (t - joins) / 6, 0, 1), np.clip(1 - (leaves - t) / 5, 0, 1)
        of = np.full(len(t), k)
        parts.append(Seen(np.rint(t * 1000).astype(np.int64), of, of, x + 7 * coming, y - 6 * going))
    return _joined(parts)


def _steps(at_s: Floats, first: int) -> tuple[Floats, Floats]:
    """Return time and number of people ahead of one: a second to move up."""
    t, n = [0.0], [float(first)]
    for k, s in enumerate(at_s):
        t += [max(s, t[-1] + 1e-6), max(s, t[-1] + 1e-6) + 1.0]
        n += [float(first - k), float(first - k - 1)]
    return np.array(t), np.array(n)


def noisy(seen: Seen, rng: np.random.Generator, *, sd_m: float, smooth_s: float = 0.0) -> Seen:
    """Return the records with a normal error of each coordinate, independent, or as smooth as a tracker makes it."""
    error = rng.normal(0, sd_m, (len(seen.ts_ms), 2))
    if smooth_s:
        order = np.lexsort((seen.ts_ms, seen.track))
        track, ts = seen.track[order], seen.ts_ms[order] / 1000
        keep = np.append(0.0, np.where(np.diff(track) == 0, np.exp(-np.abs(np.diff(ts)) / smooth_s), 0.0))
        new = error[order] * np.sqrt(1 - keep**2)[:, None]
        for k in range(1, len(new)):
            new[k] += keep[k] * new[k - 1]
        error[order] = new
    return replace(seen, x_m=seen.x_m + error[:, 0], y_m=seen.y_m + error[:, 1])


def thinned(seen: Seen, *, every_ms: int) -> Seen:
    """Return the records of every so many milliseconds."""
    return seen.rows(seen.ts_ms % every_ms == 0)


def cut(seen: Seen, rng: np.random.Generator, *, share: float, lost_s: float = 0.0) -> Seen:
    """Return the records with a share of the tracks cut once, at an instant drawn evenly; lost for up to `lost_s`."""
    track, first_free = seen.track.copy(), int(seen.track.max()) + 1
    ids = np.unique(track)
    chosen = ids[rng.random(len(ids)) < share]
    is_lost = np.zeros(len(track), dtype=np.bool_)
    for k, of in enumerate(chosen):
        rows = np.flatnonzero(track == of)
        at = rng.uniform(seen.ts_ms[rows[0]], seen.ts_ms[rows[-1]])
        lost = rng.uniform(0, lost_s * 1000)
        later = rows[seen.ts_ms[rows] >= at]
        is_lost[later[seen.ts_ms[later] < at + lost]] = True
        track[later] = first_free + k
    return replace(seen, track=track).rows(~is_lost)


def doubled(
    seen: Seen,
    rng: np.random.Generator,
    *,
    share: float,
    away_m: float = 0.25,
    lasts_s: float = 1e9,
    sd_m: float = 0.05,
) -> Seen:
    """Return the records with a second id beside a share of the tracks, for a stretch of a mean length, near them."""
    ids = np.unique(seen.track)
    chosen = ids[rng.random(len(ids)) < share]
    first_free, parts = int(seen.track.max()) + 1, [seen]
    for k, of in enumerate(chosen):
        own = seen.rows(np.flatnonzero(seen.track == of))
        lasts = own.ts_ms[-1] - own.ts_ms[0] if lasts_s > 1e6 else 1000 * rng.exponential(lasts_s)
        at = rng.uniform(own.ts_ms[0], max(own.ts_ms[0] + 1, own.ts_ms[-1] - lasts))
        own = own.rows((own.ts_ms >= at) & (own.ts_ms <= at + lasts))
        angle = rng.uniform(0, 2 * np.pi)
        dx, dy = rng.normal(0, sd_m, (2, len(own.ts_ms)))
        parts.append(
            replace(
                own,
                track=np.full(len(own.track), first_free + k),
                x_m=own.x_m + away_m * np.cos(angle) + dx,
                y_m=own.y_m + away_m * np.sin(angle) + dy,
            )
        )
    return _joined(parts)
