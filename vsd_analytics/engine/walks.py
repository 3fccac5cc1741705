"""How people walk, as a tracker needs it: velocities that last some seconds, and Kalman filters side by side.

A velocity is forgotten slowly (an Ornstein-Uhlenbeck process). Seen backward in time the process is the same, so a walk
can be filtered from its end, too, and what both filters say of one instant can be compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array

Rows = NDArray[np.intp]

WALK_M_S: Final = 1.0
"""Sd of each part of the velocity of a person."""
LASTS_S: Final = 12.5
"""How long a velocity lasts: in one second it changes by sd .4 m/s."""


@dataclass(frozen=True, slots=True)
class Velocities:
    """What velocities are usual where people are: means, shape (n, 2), and covariances, shape (n, 2, 2)."""

    mean: Array
    covariance: Array

    @classmethod
    def anywhere(cls, n: int) -> Velocities:
        """Return what is assumed of people in any place."""
        return cls(np.zeros((n, 2)), np.tile(WALK_M_S**2 * np.eye(2), (n, 1, 1)))

    def __getitem__(self, rows: Rows) -> Velocities:
        return Velocities(self.mean[rows], self.covariance[rows])

    def backward(self) -> Velocities:
        """Return the velocities with time reversed."""
        return Velocities(-self.mean, self.covariance)


class Walks:
    """Filters side by side: state x, y, vx, vy, shape (n, 4), its covariance, shape (n, 4, 4), and usual velocities."""

    def __init__(self, state: Array, covariance: Array, usual: Velocities) -> None:
        self.state, self.covariance, self.usual = state, covariance, usual

    @classmethod
    def unseen(cls, n: int) -> Walks:
        """Return room for so many walks."""
        return cls(np.zeros((n, 4)), np.zeros((n, 4, 4)), Velocities.anywhere(n))

    @classmethod
    def begun(cls, xy: Array, covariance: Array, usual: Velocities) -> Walks:
        """Return walks seen once, with a velocity that is usual there."""
        walks = cls.unseen(len(xy))
        walks.state[:, :2], walks.covariance[:, :2, :2] = xy, covariance
        walks.state[:, 2:], walks.covariance[:, 2:, 2:] = usual.mean, usual.covariance
        walks.usual = usual
        return walks

    def __getitem__(self, rows: Rows) -> Walks:
        return Walks(self.state[rows], self.covariance[rows], self.usual[rows])

    def put(self, rows: Rows, walks: Walks) -> None:
        """Replace some walks."""
        self.state[rows], self.covariance[rows] = walks.state, walks.covariance
        self.usual.mean[rows], self.usual.covariance[rows] = walks.usual.mean, walks.usual.covariance

    def after(self, step_s: Array) -> Walks:
        """Return the walks after one time step each, shape (n,)."""
        left = np.exp(-step_s / LASTS_S)
        gone = -np.expm1(-step_s / LASTS_S)
        move, pushed = np.zeros((len(left), 2, 2)), np.zeros((len(left), 2, 2))
        move[:, 0, 0], move[:, 0, 1], move[:, 1, 1] = 1.0, LASTS_S * gone, left
        pushed[:, 0, 0] = LASTS_S**2 * np.maximum(0.0, 2 * step_s / LASTS_S - gone * (2 + gone))
        pushed[:, 0, 1] = pushed[:, 1, 0] = LASTS_S * gone**2
        pushed[:, 1, 1] = gone * (1 + left)
        both = np.zeros((len(left), 4, 4))
        for axis in (0, 1):
            both[:, axis::2, axis::2] = move
        noise = pushed[:, :, None, :, None] * self.usual.covariance[:, None, :, None, :]
        drift = self.usual.mean * gone[:, None]
        state = (both @ self.state[..., None])[..., 0]
        state[:, :2] += self.usual.mean * step_s[:, None] - LASTS_S * drift
        state[:, 2:] += drift
        covariance = both @ self.covariance @ np.swapaxes(both, 1, 2) + noise.reshape(-1, 4, 4)
        return Walks(state, covariance, self.usual)

    def seen(self, xy: Array, covariance: Array, usual: Velocities) -> Walks:
        """Return the walks after a sighting of each, where other velocities may be usual."""
        gain = self.covariance[:, :, :2] @ np.linalg.inv(self.covariance[:, :2, :2] + covariance)
        state = self.state + (gain @ (xy - self.state[:, :2])[..., None])[..., 0]
        return Walks(state, self.covariance - gain @ self.covariance[:, :2], usual)

    def backward(self) -> Walks:
        """Return the walks with time reversed."""
        sign = np.array([1.0, 1.0, -1.0, -1.0])
        return Walks(self.state * sign, self.covariance * sign[:, None] * sign, self.usual.backward())

    def turned(self) -> Walks:
        """Return the walks with time reversed, the last one first."""
        return self.backward()[np.arange(len(self.state))[::-1]]


def surprise(off: Array, covariance: Array) -> Array:
    """Return -2 log of the normal density at some offsets, shape (..., 2) with covariances (..., 2, 2)."""
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    x, y, determinant = off[..., 0], off[..., 1], a * c - b**2
    square = (c * x**2 - 2 * b * x * y + a * y**2) / determinant
    return np.asarray(square + np.log(determinant) + 2 * np.log(2 * np.pi))


def joined(past: Walks, future: Walks) -> Array:
    """Return -2 log of how likely futures are after pasts, relative to no knowledge of where they would begin.

    Both are of the same instant, `future` filtered backward from the end with the velocities that are usual anywhere.
    What it assumes of them is taken out: the product of both densities is integrated over the density of those.
    """
    off, solved, velocity, left = _together(past, future)
    usual = np.sum(velocity * np.linalg.solve(left, velocity[..., None])[..., 0], axis=-1)
    apart = np.sum(off * solved[..., 0], axis=-1) + np.linalg.slogdet(past.covariance + future.covariance)[1]
    sizes = 2 * np.log(2 * np.pi) - 8 * np.log(WALK_M_S)
    return np.asarray(apart - usual + np.linalg.slogdet(left)[1] + sizes)


def joined_velocity(past: Walks, future: Walks) -> Velocities:
    """Return the velocities by past and future together: means, and covariances of their errors."""
    _, _, velocity, left = _together(past, future)
    both = WALK_M_S**2 * np.eye(2) - left
    # the future's usual velocity, of mean 0, is taken out
    mean = WALK_M_S**2 * np.linalg.solve(left, velocity[..., None])[..., 0]
    error = WALK_M_S**2 * np.linalg.solve(left, both)
    return Velocities(np.asarray(mean, dtype=np.float64), np.asarray(error, dtype=np.float64))


def _together(past: Walks, future: Walks) -> tuple[Array, Array, Array, Array]:
    """Return what past and future differ by, that in units of both, the joint velocity, and what it leaves of usual."""
    off = future.state - past.state
    total = past.covariance + future.covariance
    solved = np.linalg.solve(total, np.concatenate([off[..., None], past.covariance], axis=-1))
    moved = past.covariance[:, 2:] @ solved
    left = WALK_M_S**2 * np.eye(2) - past.covariance[:, 2:, 2:] + moved[:, :, 3:]
    return off, solved, past.state[:, 2:] + moved[..., 0], left
