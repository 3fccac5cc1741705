"""Track ids for a detector that has none: people followed on the floor, forward and backward in time by turns.

A foot point far away is uncertain along the view and certain across it, so its covariance is mapped through the
homography (Yi and others, UCMCTrack, AAAI 2024). A link between two frames competes with the end of one track and the
begin of another, which are likely at the border of the picture and where tracks of the same recording begin and end.
How people usually walk in a place is learnt from the same tracks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from scipy.special import ndtr

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.calibration_error import floor_per_px
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.walks import WALK_M_S, Rows, Velocities, Walks, joined, joined_velocity, surprise
from vsd_analytics.geometry.homography import to_floor

FOOT_SHARE: Final = 0.05
"""Error of a foot point in body heights of the picture, as in UCMCTrack."""
FOOT_PX: Final = 1.0
"""And at least so many pixels."""
OUTSIDE_M2: Final = 0.05
"""Persons per square metre beyond the border of the picture, who may step into it."""
BEGIN_M2_S: Final = 0.002
"""Tracks that begin inside the picture, per square metre and second, before any are known."""
END_S: Final = 0.01
"""Share of tracks that end inside the picture, per second."""
LEAVE: Final = 0.7
"""Share of those who could step out of the picture that do."""
MISSED: Final = 0.03
"""Chance that the detector misses somebody for a while."""
KNOWN_S: Final = 100.0
"""After so many seconds the begins that were found in a place count as much as what is assumed."""
KNOWN_PERSON_S: Final = 20.0
"""And after so many seconds of persons in a place the ends."""
SWEEPS: Final = 5
"""After the first, forward: backward and forward by turns, each with what the last one found."""
RARE_S: Final = 0.2
"""With more frequent frames one sweep and no usual velocities: they only cost time, and ids got no better."""
KNOWN_PERSONS: Final = 10.0
"""After so many persons the velocities found in a place count as much as what is assumed."""
CELL_M: Final = 1.0
"""Begins and ends are counted in squares of three such cells."""
LOST_S: Final = 1.0
LOST_FRAMES: Final = 2
LOST_MOST_S: Final = 5.0
"""A track ends when it was seen neither for `LOST_S` nor in so many frames, and in any case after `LOST_MOST_S`."""
_NO_TRACK: Final = -1
_HOPELESS: Final = 15.0
"""By so much a link may look worse from the past alone than no link; then the future is not asked."""


def tracked(
    people: People, *, homography: ArrayLike, picture_px: tuple[int, int] | None, ts_ms: NDArray[np.int64]
) -> People:
    """Return the people with track ids: `START-N`, the file's first instant in hexadecimal milliseconds and a number.

    Ids of files that begin at different instants therefore differ. A person without a place on the floor has an id of
    its own.

    Args:
        people: As detected; their ids, if any, are left aside.
        homography: 3x3, pixels to floor metres.
        picture_px: Width and height of the picture.
        ts_ms: UTC milliseconds of each of `people.frames`.
    """
    uv = floor_points(people, homography=homography, picture_px=picture_px)
    xy = to_floor(homography, uv, picture_px=picture_px)
    per_px = floor_per_px(homography, uv, picture_px=picture_px)
    return tracked_at(people, xy, per_px, picture_px=picture_px, ts_ms=ts_ms)


def tracked_at(
    people: People, xy: Array, per_px: Array, *, picture_px: tuple[int, int] | None, ts_ms: NDArray[np.int64]
) -> People:
    """Return the people with track ids, as `tracked`, from places on the floor.

    Args:
        people: As detected.
        xy: Floor metres, shape (n, 2).
        per_px: Derivative of the places by pixels, metres per pixel, shape (n, 2, 2).
        picture_px: Width and height of the picture; None = nobody knows where it ends.
        ts_ms: UTC milliseconds of each of `people.frames`.
    """
    outline = people.outline
    sd_px = np.maximum(FOOT_PX, FOOT_SHARE * (outline[:, 3] - outline[:, 1]))
    covariance = per_px @ np.swapaxes(per_px, 1, 2) * (sd_px**2)[:, None, None]
    border_s = None if picture_px is None else _border_s(feet(people), per_px, picture_px)
    rows = np.searchsorted(people.frames, people.frame)
    return with_ids(people, follow(xy, covariance, rows, ts_ms / 1000, border_s=border_s), ts_ms=ts_ms)


def with_ids(people: People, numbers: NDArray[np.int64], *, ts_ms: NDArray[np.int64]) -> People:
    """Return the people with ids of track numbers: `START-N`, so that those of two files never meet."""
    start = int(ts_ms[0]) if len(ts_ms) else 0
    ids = np.empty(len(people), dtype=object)
    ids[:] = [f"{start:x}-{number}" for number in numbers.tolist()]
    return People(people.frame, ids, people.box, people.joints, people.frames, people.ts_ms, people.bad)


def _border_s(uv: Array, per_px: Array, picture_px: tuple[int, int]) -> Array:
    """Return how many seconds of usual walking it is to each side of the picture, shape (n, 4)."""
    a, b, c, d = per_px[:, 0, 0], per_px[:, 0, 1], per_px[:, 1, 0], per_px[:, 1, 1]
    px_m = np.column_stack([np.hypot(d, b), np.hypot(c, a)]) / np.abs(a * d - b * c)[:, None]
    return np.concatenate([uv, np.array(picture_px) - uv], axis=1) / np.tile(WALK_M_S * px_m, 2)


def follow(
    xy: Array, covariance: Array, frame: NDArray[np.intp], time_s: Array, *, border_s: Array | None = None
) -> NDArray[np.int64]:
    """Return the track number of each sighting, shape (n,), from 1.

    Args:
        xy: Floor metres, NaN where unknown, shape (n, 2).
        covariance: Of `xy`, square metres, shape (n, 2, 2).
        frame: Row of the frame in `time_s`, in order, shape (n,).
        time_s: Seconds of each frame.
        border_s: Seconds of usual walking to each side of the picture, shape (n, 4); None = not known.
    """
    known = np.flatnonzero(np.isfinite(xy).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
    border_s = np.full((len(xy), 4), np.inf) if border_s is None else border_s
    seen = _FloorSightings.of(xy[known], covariance[known], frame[known], time_s, border_s[known])
    before = _links(seen, None)
    is_rare = len(time_s) > 1 and (time_s[-1] - time_s[0]) / (len(time_s) - 1) > RARE_S
    for sweep in range(SWEEPS if is_rare else 1):
        learnt = seen.with_ends(before)
        if is_rare:
            learnt = learnt.with_velocities(before)
        is_forward = sweep % 2 == 1
        before = _links(learnt, before) if is_forward else _reversed(_links(learnt.backward(), _reversed(before)))
    number = np.zeros(len(xy), dtype=np.int64)
    number[known] = _numbers(before)
    n_tracks = int(number.max(initial=0))
    number[number == 0] = n_tracks + 1 + np.arange(len(xy) - len(known))
    return number


@dataclass(frozen=True, slots=True)
class _FloorSightings:
    """All sightings in order of time.

    What begins and ends of tracks cost at each (-2 log of their likelihood), and which velocities are usual there.
    """

    xy: Array
    covariance: Array
    frame: Rows
    time_s: Array
    begin: Array
    end: Array
    usual: Velocities

    @classmethod
    def of(cls, xy: Array, covariance: Array, frame: Rows, time_s: Array, border_s: Array) -> _FloorSightings:
        step_s = np.diff(time_s, prepend=np.nan, append=np.nan)

        def crossing(step: Array) -> Array:
            """Return the chance that somebody of unknown direction crosses the border in a time."""
            with np.errstate(invalid="ignore"):
                return np.asarray(1 - np.prod(ndtr(border_s / step[:, None]), axis=1))

        since, until = step_s[frame], step_s[frame + 1]
        begin = np.nan_to_num(BEGIN_M2_S * since + OUTSIDE_M2 * crossing(since), nan=1.0)
        end = np.nan_to_num(np.minimum(END_S * until + LEAVE * crossing(until), 0.95), nan=1.0)
        usual = Velocities.anywhere(len(xy))
        return cls(xy, covariance, frame, time_s, -2 * np.log(begin), -2 * np.log(end), usual)

    def with_ends(self, before: Rows) -> _FloorSightings:
        """Return the same with begins and ends as the tracks found have them; no sighting counts for itself."""
        n_frames = len(self.time_s)
        if n_frames < 2:
            return self
        step_s = (self.time_s[-1] - self.time_s[0]) / (n_frames - 1)
        begins = (before == _NO_TRACK) & (self.frame > 0)
        ends = self.frame < n_frames - 1
        ends[before[before != _NO_TRACK]] = False
        cells = np.floor(self.xy / CELL_M).astype(np.int64)
        near = _Counts(cells)
        weight = KNOWN_S / step_s
        begin = weight * np.exp(-self.begin / 2) + (near.of(begins) - begins) / (3 * CELL_M) ** 2
        weight_end = KNOWN_PERSON_S / step_s
        end = weight_end * np.exp(-self.end / 2) + near.of(ends) - ends
        share = np.minimum(end / (weight_end + near.of(np.ones(len(ends)))), 0.95)
        return replace(
            self,
            begin=np.where(self.frame > 0, -2 * np.log(begin / (weight + n_frames)), self.begin),
            end=np.where(self.frame < n_frames - 1, -2 * np.log(share), self.end),
        )

    def with_velocities(self, before: Rows) -> _FloorSightings:
        """Return the same with velocities as usual in each place as those of the tracks found there.

        A person counts once in a cell, however long there, and never for itself.
        """
        b = np.flatnonzero(before != _NO_TRACK)
        if not len(b):
            return self
        a = before[b]
        step_s = self.time_s[self.frame[b]] - self.time_s[self.frame[a]]
        pasts = _filtered(self, before)
        found = joined_velocity(pasts[a].after(step_s), _futures(self, before)[b])
        velocity, error = np.zeros((len(before), 2)), np.zeros((len(before), 2, 2))
        for rows in (a, b):  # the first of a track has the velocity of its second
            velocity[rows], error[rows] = found.mean, found.covariance
        is_known = np.zeros(len(before), dtype=bool)
        is_known[a] = is_known[b] = True
        cells = np.floor(self.xy / CELL_M).astype(np.int64)
        cells_of_track = np.column_stack([_numbers(before), cells])
        _, of, times = np.unique(cells_of_track, axis=0, return_inverse=True, return_counts=True)
        weight = is_known / times[of.reshape(-1)]
        everybody, own = _Counts(cells), _Counts(cells_of_track)

        def others(value: Array) -> Array:
            return everybody.of(weight * value) - own.of(weight * value)

        n = KNOWN_PERSONS + others(np.ones(len(before)))
        mean = np.column_stack([others(velocity[:, i]) for i in (0, 1)]) / n[:, None]
        square = velocity[:, :, None] * velocity[:, None, :] + error
        xx, xy, yy = (others(square[:, i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
        usual = KNOWN_PERSONS * WALK_M_S**2
        second = np.stack([xx + usual, xy, xy, yy + usual], axis=1).reshape(-1, 2, 2) / n[:, None, None]
        return replace(self, usual=Velocities(mean, second - mean[:, :, None] * mean[:, None, :]))

    def backward(self) -> _FloorSightings:
        """Return the sightings with time reversed."""
        frame = len(self.time_s) - 1 - self.frame[::-1]
        time_s = self.time_s[-1] - self.time_s[::-1] if len(self.time_s) else self.time_s
        usual = self.usual[np.arange(len(frame))[::-1]].backward()
        return _FloorSightings(
            self.xy[::-1], self.covariance[::-1], frame, time_s, self.end[::-1], self.begin[::-1], usual
        )

    def rows(self) -> list[Rows]:
        """Return the sightings of each frame."""
        edges = np.searchsorted(self.frame, np.arange(1, len(self.time_s)))
        return np.split(np.arange(len(self.frame)), edges)


class _Counts:
    """How many sightings lie in the three by three cells around each."""

    def __init__(self, cells: NDArray[np.int64]) -> None:
        unique, self._of = np.unique(cells, axis=0, return_inverse=True)
        self._of = self._of.reshape(-1)
        index = {tuple(cell): row for row, cell in enumerate(unique.tolist())}
        near = [
            (row, index[other])
            for (*who, x, y), row in index.items()
            for other in ((*who, x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1))
            if other in index
        ]
        self._row, self._near = np.array(near, dtype=np.intp).reshape(-1, 2).T

    def of(self, counted: Array | NDArray[np.bool_]) -> Array:
        """Return the sum of a value over the sightings around each."""
        here = np.bincount(self._of, counted)
        return np.asarray(np.bincount(self._row, here[self._near]), dtype=np.float64)[self._of]


def _after(before: Rows) -> Rows:
    """Return the next sighting of each, of the one before each, and the other way round."""
    after = np.full(len(before), _NO_TRACK)
    linked = np.flatnonzero(before != _NO_TRACK)
    after[before[linked]] = linked
    return after


def _reversed(before: Rows) -> Rows:
    """Return the links with time reversed."""
    after = _after(before)[::-1]
    return np.where(after == _NO_TRACK, _NO_TRACK, len(before) - 1 - after)


def _numbers(before: Rows) -> NDArray[np.int64]:
    number = np.cumsum(before == _NO_TRACK)
    for row in np.flatnonzero(before != _NO_TRACK).tolist():
        number[row] = number[before[row]]
    return np.asarray(number, dtype=np.int64)


def _filtered(seen: _FloorSightings, before: Rows) -> Walks:
    """Return what each sighting and all earlier ones of its track say of the walk at its instant."""
    walks, anywhere = Walks.unseen(len(before)), Velocities.anywhere(len(before))
    for rows in seen.rows():
        new, old = rows[before[rows] == _NO_TRACK], rows[before[rows] != _NO_TRACK]
        walks.put(new, Walks.begun(seen.xy[new], seen.covariance[new], anywhere[new]))
        if len(old):
            step_s = seen.time_s[seen.frame[old]] - seen.time_s[seen.frame[before[old]]]
            walks.put(old, walks[before[old]].after(step_s).seen(seen.xy[old], seen.covariance[old], anywhere[old]))
    return walks


def _futures(seen: _FloorSightings, before: Rows) -> Walks:
    """Return what each sighting and all later ones of its track say of the walk at its instant."""
    return _filtered(seen.backward(), _reversed(before)).backward()[np.arange(len(before))[::-1]]


def _links(seen: _FloorSightings, before: Rows | None) -> Rows:
    """Return the sighting before each in its track, -1 at begins, chosen frame by frame in order of time.

    Args:
        seen: All sightings.
        before: Links as they were: they say what comes after each sighting. None = from the past alone.
    """
    n = len(seen.frame)
    futures = None if before is None else _futures(seen, before)
    before = np.full(n, _NO_TRACK) if before is None else before.copy()
    after = _after(before)
    pasts = Walks.unseen(n)
    open_rows = np.empty(0, dtype=np.intp)
    for i, rows in enumerate(seen.rows()):
        unseen_s = seen.time_s[i] - seen.time_s[seen.frame[open_rows]]
        is_recent = (unseen_s <= LOST_S + 1e-9) | (i - seen.frame[open_rows] <= LOST_FRAMES)
        alive = is_recent & (unseen_s <= LOST_MOST_S)
        open_rows = open_rows[alive]
        past = pasts[open_rows].after(unseen_s[alive])
        of_open, of_row = _matches(seen, open_rows, rows, past, futures, after)
        a, b = open_rows[of_open], rows[of_row]
        after[before[rows[before[rows] != _NO_TRACK]]] = _NO_TRACK
        before[rows] = _NO_TRACK
        before[after[a[after[a] != _NO_TRACK]]] = _NO_TRACK
        before[b], after[a] = a, b
        pasts.put(rows, Walks.begun(seen.xy[rows], seen.covariance[rows], seen.usual[rows]))
        pasts.put(b, past[of_open].seen(seen.xy[b], seen.covariance[b], seen.usual[b]))
        still = np.ones(len(open_rows), dtype=bool)
        still[of_open] = False
        open_rows = np.concatenate([open_rows[still], rows])
    return before


def _matches(
    seen: _FloorSightings, open_rows: Rows, rows: Rows, past: Walks, futures: Walks | None, after: Rows
) -> tuple[Rows, Rows]:
    """Return which of the open tracks have which of a frame's sightings: the most likely assignment, or none."""
    if not len(open_rows) or not len(rows):
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    frame = seen.frame[rows[0]]
    missed = np.where(frame - seen.frame[open_rows] > 1, -2 * np.log(MISSED), 0.0)
    apart = seen.end[open_rows].copy()
    off = seen.xy[rows][None] - past.state[:, None, :2]
    link = surprise(off, past.covariance[:, None, :2, :2] + seen.covariance[rows][None]) + missed[:, None]
    if futures is not None:
        a, b = np.nonzero(link < apart[:, None] + seen.begin[rows] + _HOPELESS)
        link[:] = np.inf
        if len(a):
            link[a, b] = joined(past[a], futures[rows[b]]) + missed[a]
        late = np.flatnonzero((after[open_rows] != _NO_TRACK) & (seen.frame[after[open_rows]] > frame))
        if len(late):  # seen again after this frame: that link would be lost
            then = after[open_rows[late]]
            step_s = seen.time_s[seen.frame[then]] - seen.time_s[frame]
            other = joined(past[late].after(step_s), futures[then]) - 2 * np.log(MISSED)
            apart[late] = np.minimum(apart[late], other - seen.begin[then])
    gain = np.minimum(link - apart[:, None] - seen.begin[rows], 0.0)
    of_open, of_row = linear_sum_assignment(gain)
    is_one = gain[of_open, of_row] < 0
    return of_open[is_one], of_row[is_one]
