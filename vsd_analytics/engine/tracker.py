"""Track ids for a detector that has none: people followed on the floor from frame to frame.

Each track is a Kalman filter with constant velocity on the floor. A foot point far away is uncertain along the view and
certain across it, so its covariance is mapped through the homography, and a sighting belongs to the track that makes it
most likely (Yi and others, UCMCTrack: Multi-Object Tracking with Uniform Camera Motion Compensation, AAAI 2024).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.calibration_error import floor_per_px
from vsd_analytics.engine.people import Array, People
from vsd_analytics.geometry.homography import to_floor

FOOT_SHARE: Final = 0.05
"""Error of a foot point in body heights of the picture, as in UCMCTrack."""
FOOT_PX: Final = 1.0
"""And at least so many pixels."""
WALK_M_S: Final = 1.0
"""Sd of each part of the velocity of a person not seen before."""
TURN_M_S2: Final = 0.4
"""Sd of the acceleration that people walk with."""
GATE: Final = 9.2
"""Squared Mahalanobis distance up to which a sighting may belong to a track: 99 % with two degrees of freedom."""
_NEVER: Final = 1e6
LOST_S: Final = 1.0
LOST_FRAMES: Final = 2
LOST_MOST_S: Final = 5.0
"""A track ends when it was seen neither for `LOST_S` nor in so many frames, and in any case after `LOST_MOST_S`."""


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
    uv = feet(people)
    xy = to_floor(homography, uv, picture_px=picture_px)
    return tracked_at(people, xy, floor_per_px(homography, uv, picture_px=picture_px), ts_ms=ts_ms)


def tracked_at(people: People, xy: Array, per_px: Array, *, ts_ms: NDArray[np.int64]) -> People:
    """Return the people with track ids, as `tracked`, from places on the floor.

    Args:
        people: As detected.
        xy: Floor metres, shape (n, 2).
        per_px: Derivative of the places by pixels, metres per pixel, shape (n, 2, 2).
        ts_ms: UTC milliseconds of each of `people.frames`.
    """
    outline = people.outline
    sd_px = np.maximum(FOOT_PX, FOOT_SHARE * (outline[:, 3] - outline[:, 1]))
    covariance = per_px @ np.swapaxes(per_px, 1, 2) * (sd_px**2)[:, None, None]
    numbers = follow(xy, covariance, np.searchsorted(people.frames, people.frame), ts_ms / 1000)
    return with_ids(people, numbers, ts_ms=ts_ms)


def with_ids(people: People, numbers: NDArray[np.int64], *, ts_ms: NDArray[np.int64]) -> People:
    """Return the people with ids of track numbers: `START-N`, so that those of two files never meet."""
    start = int(ts_ms[0]) if len(ts_ms) else 0
    ids = np.empty(len(people), dtype=object)
    ids[:] = [f"{start:x}-{number}" for number in numbers.tolist()]
    return People(people.frame, ids, people.box, people.joints, people.frames, people.ts_ms, people.bad)


def follow(xy: Array, covariance: Array, frame: NDArray[np.intp], time_s: Array) -> NDArray[np.int64]:
    """Return the track number of each sighting, shape (n,), from 1.

    Args:
        xy: Floor metres, NaN where unknown, shape (n, 2).
        covariance: Of `xy`, square metres, shape (n, 2, 2).
        frame: Row of the frame in `time_s`, in order, shape (n,).
        time_s: Seconds of each frame.
    """
    number = np.zeros(len(xy), dtype=np.int64)
    tracks, n_tracks = _Tracks.none(), 0
    edges = np.searchsorted(frame, np.arange(len(time_s) + 1))
    is_known = np.asarray(np.isfinite(xy).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
    for i, now_s in enumerate(time_s.tolist()):
        rows = np.arange(edges[i], edges[i + 1])
        rows = rows[is_known[rows]]
        tracks.advance(now_s, i)
        of_track, of_row = tracks.matches(xy[rows], covariance[rows])
        tracks.update(of_track, xy[rows[of_row]], covariance[rows[of_row]], now_s, i)
        number[rows[of_row]] = tracks.number[of_track]
        new = np.setdiff1d(rows, rows[of_row])
        number[new] = n_tracks + 1 + np.arange(len(new))
        n_tracks += len(new)
        tracks.begin(number[new], xy[new], covariance[new], now_s, i)
    number[~is_known] = n_tracks + 1 + np.arange(np.sum(~is_known))
    return number


class _Tracks:
    """Kalman filters side by side: state x, y, vx, vy; covariance; number; when and in which frame last seen."""

    def __init__(self, state: Array, covariance: Array, number: NDArray[np.int64], seen_s: Array, seen: Array) -> None:
        self.state, self.covariance, self.number, self.seen_s, self.seen = state, covariance, number, seen_s, seen
        self._now_s = -np.inf

    @classmethod
    def none(cls) -> _Tracks:
        return cls(np.empty((0, 4)), np.empty((0, 4, 4)), np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))

    def advance(self, now_s: float, frame: int) -> None:
        """Predict all tracks at an instant; leave out those not seen for long."""
        unseen_s = now_s - self.seen_s
        is_recent = (unseen_s <= LOST_S) | (frame - self.seen <= LOST_FRAMES)
        alive = np.flatnonzero(is_recent & (unseen_s <= LOST_MOST_S))
        self.state, self.covariance, self.number = self.state[alive], self.covariance[alive], self.number[alive]
        self.seen_s, self.seen = self.seen_s[alive], self.seen[alive]
        step = now_s - self._now_s if np.isfinite(self._now_s) else 0.0
        self._now_s = now_s
        move = np.eye(4)
        move[0, 2] = move[1, 3] = step
        pushed = np.kron(np.array([[step**4 / 4, step**3 / 2], [step**3 / 2, step**2]]), np.eye(2)) * TURN_M_S2**2
        self.state = self.state @ move.T
        self.covariance = move @ self.covariance @ move.T + pushed

    def matches(self, xy: Array, covariance: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the rows of tracks and of sightings that belong together."""
        off = xy[None] - self.state[:, None, :2]
        both = self.covariance[:, None, :2, :2] + covariance[None]
        determinant = both[..., 0, 0] * both[..., 1, 1] - both[..., 0, 1] ** 2
        square = (
            both[..., 1, 1] * off[..., 0] ** 2
            - 2 * both[..., 0, 1] * off[..., 0] * off[..., 1]
            + both[..., 0, 0] * off[..., 1] ** 2
        ) / determinant
        # the likelihood has the size of the covariance in it: else the most uncertain track would take everybody
        cost = np.where(square < GATE, square + np.log(determinant), _NEVER)
        of_track, of_row = linear_sum_assignment(cost)
        is_one = cost[of_track, of_row] < _NEVER
        return of_track[is_one], of_row[is_one]

    def update(self, rows: NDArray[np.intp], xy: Array, covariance: Array, now_s: float, frame: int) -> None:
        """Move tracks by what was seen of them."""
        prior = self.covariance[rows]
        gain = prior[:, :, :2] @ np.linalg.inv(prior[:, :2, :2] + covariance)
        self.state[rows] += np.einsum("nij,nj->ni", gain, xy - self.state[rows, :2])
        self.covariance[rows] = prior - gain @ prior[:, :2, :]
        self.seen_s[rows], self.seen[rows] = now_s, frame

    def begin(self, number: NDArray[np.int64], xy: Array, covariance: Array, now_s: float, frame: int) -> None:
        """Add tracks of people not seen before, with unknown velocity."""
        n = len(number)
        first = np.tile(np.diag([0.0, 0.0, WALK_M_S**2, WALK_M_S**2]), (n, 1, 1))
        first[:, :2, :2] = covariance
        self.state = np.concatenate([self.state, np.column_stack([xy, np.zeros((n, 2))])])
        self.covariance = np.concatenate([self.covariance, first])
        self.number = np.concatenate([self.number, number])
        self.seen_s = np.concatenate([self.seen_s, np.full(n, now_s)])
        self.seen = np.concatenate([self.seen, np.full(n, float(frame))])
