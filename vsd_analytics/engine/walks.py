"""How people walk, as a tracker needs it: velocities that last some seconds, and Kalman filters for many tracks at once.

A velocity is forgotten slowly (an Ornstein-Uhlenbeck process). Seen backward in time the process is the same, so a walk
can be filtered from its end, too, and what both filters say of one instant can be compared.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from vsd_analytics.engine.people import Array

WALK_M_S: Final = 1.0
"""Sd of each part of the velocity of a person."""
LASTS_S: Final = 12.5
"""How long a velocity lasts: in one second it changes by sd .4 m/s."""
_ANY_M_S: Final = 10.0
"""Sd of a velocity of which nothing is assumed."""


class Walks:
    """Filters side by side: state x, y, vx, vy, shape (n, 4), and its covariance, shape (n, 4, 4)."""

    def __init__(self, state: Array, covariance: Array) -> None:
        self.state, self.covariance = state, covariance

    @classmethod
    def unseen(cls, n: int) -> Walks:
        return cls(np.zeros((n, 4)), np.zeros((n, 4, 4)))

    @classmethod
    def begun(cls, xy: Array, covariance: Array, *, is_any: bool = False) -> Walks:
        """Return walks seen once, with a person's usual velocity or (`is_any`) any."""
        walks = cls.unseen(len(xy))
        walks.state[:, :2], walks.covariance[:, :2, :2] = xy, covariance
        walks.covariance[:, [2, 3], [2, 3]] = (_ANY_M_S if is_any else WALK_M_S) ** 2
        return walks

    def __getitem__(self, rows: Array) -> Walks:
        return Walks(self.state[rows], self.covariance[rows])

    def put(self, rows: Array, walks: Walks) -> None:
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
    """Return -2 log of the normal density at some offsets, shape (..., k) with covariances (..., k, k)."""
    size = off.shape[-1] * np.log(2 * np.pi)
    if off.shape[-1] == 2:
        a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
        x, y, determinant = off[..., 0], off[..., 1], a * c - b**2
        return np.asarray((c * x**2 - 2 * b * x * y + a * y**2) / determinant + np.log(determinant) + size)
    square = np.sum(off * np.linalg.solve(covariance, off[..., None])[..., 0], axis=-1)
    return np.asarray(square + np.linalg.slogdet(covariance)[1] + size)


def joined(past: Walks, future: Walks) -> Array:
    """Return -2 log of how likely futures are after pasts, relative to no knowledge of where they would begin.

    Both are of the same instant. `future` is filtered backward from the end and began with any velocity.
    """
    speed = np.eye(2) * WALK_M_S**2
    together = surprise(past.state - future.state, past.covariance + future.covariance)
    return together - surprise(future.state[:, 2:], future.covariance[:, 2:, 2:] + speed)
