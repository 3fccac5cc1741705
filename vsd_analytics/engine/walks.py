"""How people walk, as a tracker needs it: velocities that last some seconds, and Kalman filters side by side.

A velocity is forgotten slowly (an Ornstein-Uhlenbeck process). Seen backward in time the process is the same, so a walk
can be filtered from its end, too, and what both filters say of one instant can be compared.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array

Rows = NDArray[np.intp]

WALK_M_S: Final = 1.0
"""Sd of each part of the velocity of a person."""
LASTS_S: Final = 12.5
"""How long a velocity lasts: in one second it changes by sd .4 m/s."""


class Walks:
    """Filters side by side: state x, y, vx, vy, shape (n, 4), and its covariance, shape (n, 4, 4)."""

    def __init__(self, state: Array, covariance: Array) -> None:
        self.state, self.covariance = state, covariance

    @classmethod
    def unseen(cls, n: int) -> Walks:
        """Return room for so many walks."""
        return cls(np.zeros((n, 4)), np.zeros((n, 4, 4)))

    @classmethod
    def begun(cls, xy: Array, covariance: Array) -> Walks:
        """Return walks seen once, with a velocity that is usual for people."""
        walks = cls.unseen(len(xy))
        walks.state[:, :2], walks.covariance[:, :2, :2] = xy, covariance
        walks.covariance[:, [2, 3], [2, 3]] = WALK_M_S**2
        return walks

    def __getitem__(self, rows: Rows) -> Walks:
        return Walks(self.state[rows], self.covariance[rows])

    def put(self, rows: Rows, walks: Walks) -> None:
        """Replace some walks."""
        self.state[rows], self.covariance[rows] = walks.state, walks.covariance

    def after(self, step_s: Array) -> Walks:
        """Return the walks after one time step each, shape (n,)."""
        left = np.exp(-step_s / LASTS_S)
        gone = -np.expm1(-step_s / LASTS_S)
        move, pushed = np.zeros((len(left), 2, 2)), np.zeros((len(left), 2, 2))
        move[:, 0, 0], move[:, 0, 1], move[:, 1, 1] = 1.0, LASTS_S * gone, left
        pushed[:, 0, 0] = LASTS_S**2 * np.maximum(0.0, 2 * step_s / LASTS_S - gone * (2 + gone))
        pushed[:, 0, 1] = pushed[:, 1, 0] = LASTS_S * gone**2
        pushed[:, 1, 1] = gone * (1 + left)
        both = np.zeros((2, len(left), 4, 4))
        for axis in (0, 1):
            both[:, :, axis::2, axis::2] = move, WALK_M_S**2 * pushed
        return Walks(
            (both[0] @ self.state[..., None])[..., 0],
            both[0] @ self.covariance @ np.swapaxes(both[0], 1, 2) + both[1],
        )

    def seen(self, xy: Array, covariance: Array) -> Walks:
        """Return the walks after a sighting of each."""
        gain = self.covariance[:, :, :2] @ np.linalg.inv(self.covariance[:, :2, :2] + covariance)
        state = self.state + (gain @ (xy - self.state[:, :2])[..., None])[..., 0]
        return Walks(state, self.covariance - gain @ self.covariance[:, :2])

    def backward(self) -> Walks:
        """Return the walks with time reversed."""
        sign = np.array([1.0, 1.0, -1.0, -1.0])
        return Walks(self.state * sign, self.covariance * sign[:, None] * sign)


def surprise(off: Array, covariance: Array) -> Array:
    """Return -2 log of the normal density at some offsets, shape (..., 2) with covariances (..., 2, 2)."""
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    x, y, determinant = off[..., 0], off[..., 1], a * c - b**2
    square = (c * x**2 - 2 * b * x * y + a * y**2) / determinant
    return np.asarray(square + np.log(determinant) + 2 * np.log(2 * np.pi))


def joined(past: Walks, future: Walks) -> Array:
    """Return -2 log of how likely futures are after pasts, relative to no knowledge of where they would begin.

    Both are of the same instant, `future` filtered backward from the end. Both know what velocities are usual, so
    that is taken out once: the product of the two densities is integrated over the density of usual velocities.
    """
    off = future.state - past.state
    total = past.covariance + future.covariance
    solved = np.linalg.solve(total, np.concatenate([off[..., None], past.covariance], axis=-1))
    moved = past.covariance[:, 2:] @ solved
    velocity = past.state[:, 2:] + moved[..., 0]
    left = WALK_M_S**2 * np.eye(2) - past.covariance[:, 2:, 2:] + moved[:, :, 3:]
    usual = np.sum(velocity * np.linalg.solve(left, velocity[..., None])[..., 0], axis=-1)
    apart = np.sum(off * solved[..., 0], axis=-1) + np.linalg.slogdet(total)[1]
    sizes = 2 * np.log(2 * np.pi) - 8 * np.log(WALK_M_S)
    return np.asarray(apart - usual + np.linalg.slogdet(left)[1] + sizes)
