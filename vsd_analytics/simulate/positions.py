"""Positions of all people of a day at every frame, computed for the whole day at once with NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.simulate.shop import FloatArray, Shop
from vsd_analytics.simulate.walking import Walker

IntArray = NDArray[np.int64]
Places = tuple[FloatArray, FloatArray]

_APART_M = 0.5
_SWAY_M = 0.07
_STEP_M = 0.4
_FAR_S = 1e6
_SIDE_M, _AHEAD_M = np.array([0.0, 0.85, -0.85, 0.3]), np.array([0.0, -0.1, -0.2, -0.95])


@dataclass(frozen=True, slots=True)
class PersonFrames:
    """Persons and frames; rows are ordered by person, then frame.

    Attributes:
        person: Person of each row, from 0.
        party: Single or group of each row, from 0.
        frame: Frame of each row.
        x_m: Floor x.
        y_m: Floor y.
    """

    person: IntArray
    party: IntArray
    frame: IntArray
    x_m: FloatArray
    y_m: FloatArray


def person_frames(
    shop: Shop,
    walkers: Sequence[Walker],
    *,
    first_frame_s: float,
    interval_s: float,
    n_frames: int,
    noise: np.random.Generator,
) -> PersonFrames:
    """Return the position of every person at every frame.

    Leaders follow their ways. The others of a group walk beside or behind them, where there is room. Everybody sways a
    little, people closer than half a metre step apart, and nobody is inside a fixture.

    Args:
        shop: The shop.
        walkers: One per single or group.
        first_frame_s: Time of frame 0 on the walkers' clock.
        interval_s: Seconds from frame to frame.
        n_frames: Frames of the day; later ones are cut off.
        noise: Source of randomness.
    """
    if not walkers:
        none = np.zeros(0, dtype=np.int64)
        return PersonFrames(none, none, none, np.zeros(0), np.zeros(0))
    ways = _Ways(walkers)
    sizes = np.array([w.size for w in walkers])
    party_of = np.repeat(np.arange(len(walkers)), sizes)
    rank_of = np.arange(len(party_of)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    first = np.ceil((ways.begin_s - first_frame_s) / interval_s).astype(np.int64)[party_of]
    last = np.floor((ways.end_s - first_frame_s) / interval_s).astype(np.int64)[party_of]
    counts = np.maximum(np.minimum(last, n_frames - 1) - first + 1, 0)
    person = np.repeat(np.arange(len(party_of)), counts)
    frame = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
    at_s = frame * interval_s + first_frame_s

    x, y = _in_formation(shop, ways, person=person, party_of=party_of, rank_of=rank_of, at_s=at_s, noise=noise)
    phase, period = noise.uniform(0, 2 * np.pi, (2, len(rank_of))), noise.uniform(9.0, 25.0, (2, len(rank_of)))
    x += _SWAY_M * np.sin(2 * np.pi * at_s / period[0, person] + phase[0, person])
    y += _SWAY_M * np.sin(2 * np.pi * at_s / period[1, person] + phase[1, person])
    x, y = shop.nearest_free(*_apart(frame, x, y))
    return PersonFrames(person, party_of[person], frame, x, y)


class _Ways:
    """The knots of all ways on one time axis, each way `_FAR_S` after the one before.

    So one call of `np.interp` interpolates all ways, without a loop over the walkers.
    """

    def __init__(self, walkers: Sequence[Walker]) -> None:
        self.begin_s = np.array([w.t_s[0] for w in walkers])
        self.end_s = np.array([w.t_s[-1] for w in walkers])
        self._shift = _FAR_S * np.arange(len(walkers), dtype=np.float64)
        self._t = np.concatenate([np.asarray(w.t_s) + s for w, s in zip(walkers, self._shift, strict=True)])
        self._x = np.concatenate([w.x_m for w in walkers])
        self._y = np.concatenate([w.y_m for w in walkers])
        dx, dy = np.diff(self._x), np.diff(self._y)
        length = np.hypot(dx, dy)
        walks = (length > _STEP_M) & (np.diff(self._t) < _FAR_S / 2)
        facing = np.maximum.accumulate(np.where(walks, np.arange(len(length)), 0))
        length = np.maximum(length, 1e-9)
        self._ux, self._uy = (dx / length)[facing], (dy / length)[facing]

    def at(self, party: IntArray, at_s: FloatArray) -> Places:
        """Return the places of leaders; before the beginning and after the end of a way those of its ends."""
        t = np.clip(at_s, self.begin_s[party], self.end_s[party]) + self._shift[party]
        return np.interp(t, self._t, self._x), np.interp(t, self._t, self._y)

    def heading(self, party: IntArray, at_s: FloatArray) -> Places:
        """Return the unit vectors along which leaders walk (mean of 2 s), or last walked if they stand still."""
        ux, uy = np.zeros(len(at_s)), np.zeros(len(at_s))
        for ahead_s in (-1.0, 0.0, 1.0):
            t = np.clip(at_s + ahead_s, self.begin_s[party] + 1e-3, self.end_s[party] - 1e-3) + self._shift[party]
            knot = np.searchsorted(self._t, t) - 1
            ux += self._ux[knot]
            uy += self._uy[knot]
        length = np.maximum(np.hypot(ux, uy), 1e-9)
        return ux / length, uy / length


def _in_formation(
    shop: Shop,
    ways: _Ways,
    *,
    person: IntArray,
    party_of: IntArray,
    rank_of: IntArray,
    at_s: FloatArray,
    noise: np.random.Generator,
) -> Places:
    """Return the places of leaders, and of the others of their groups: side by side, or in file where it is narrow."""
    # one draw per person, whatever the frame interval, so that the same seed gives the same groups
    jitter = noise.normal(0, 0.08, (2, len(rank_of))) * (rank_of > 0)
    flip = np.where(noise.random(len(rank_of)) < 0.5, -1.0, 1.0)[np.cumsum(rank_of == 0) - 1]
    side_m, ahead_m = (_SIDE_M[rank_of] + jitter[0]) * flip, _AHEAD_M[rank_of] + jitter[1]

    x, y = ways.at(party_of[person], at_s)
    rows = np.flatnonzero(rank_of[person] > 0)
    who, rank, here_x, here_y = person[rows], rank_of[person[rows]], x[rows], y[rows]
    ux, uy = ways.heading(party_of[who], at_s[rows])
    to_x, to_y = ways.at(party_of[who], at_s[rows] - 0.5 * rank)  # in file: where the leader was just before
    open_rows = np.ones(len(rows), dtype=np.bool_)
    for share, along_m in ((1.0, ahead_m[who]), (0.6, ahead_m[who] - 0.4), (0.0, -0.65 * rank)):
        s, a = share * side_m[who], along_m
        try_x, try_y = here_x - s * uy + a * ux, here_y + s * ux + a * uy
        fits = open_rows & shop.is_clear(here_x, here_y, try_x, try_y)
        to_x[fits], to_y[fits] = try_x[fits], try_y[fits]
        open_rows &= ~fits
    x[rows], y[rows] = to_x, to_y
    return x, y


def _apart(frame: IntArray, x: FloatArray, y: FloatArray) -> Places:
    """Return places where people of one frame closer than half a metre have stepped apart to half a metre."""
    order = np.lexsort((x, frame))
    f, xs, ys = frame[order], x[order].copy(), y[order].copy()
    # sorted by frame and x, people who are close are near in this order: four neighbours cover all but a dense crowd
    for lag in range(1, 5):
        dx, dy = xs[lag:] - xs[:-lag], ys[lag:] - ys[:-lag]
        distance = np.hypot(dx, dy)
        near = np.flatnonzero((f[lag:] == f[:-lag]) & (distance < _APART_M))
        d = distance[near]
        ux = np.where(d > 1e-6, dx[near] / np.maximum(d, 1e-6), 1.0)
        uy = np.where(d > 1e-6, dy[near] / np.maximum(d, 1e-6), 0.0)
        push = (_APART_M - d) / 2
        np.add.at(xs, near + lag, ux * push)
        np.add.at(ys, near + lag, uy * push)
        np.add.at(xs, near, -ux * push)
        np.add.at(ys, near, -uy * push)
    moved_x, moved_y = np.empty_like(x), np.empty_like(y)
    moved_x[order], moved_y[order] = xs, ys
    return moved_x, moved_y
