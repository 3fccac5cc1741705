"""Safe spaces on the floor, the ellipses they are in the picture, and which of them overlap.

A homography maps the floor in front of the camera one to one to the picture. So two *filled* ellipses overlap in the
picture exactly where their discs overlap on the floor, also when one lies inside the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.engine.people import Array
from vsd_analytics.geometry.homography import as_matrix, to_floor


@dataclass(frozen=True, slots=True)
class SafeSpaces:
    """Discs around people on the floor plane.

    Attributes:
        homography: 3x3, pixels to floor plane, whatever its unit; shape (n, 3, 3) where people are on several planes.
        centre: Floor positions, shape (n, 2); NaN where unknown.
        radius: In the unit of the plane, shape (n,); NaN where unknown.
        radius_m: Metres that a radius means.
    """

    homography: Array
    centre: Array
    radius: Array
    radius_m: float

    def ellipses(self, rows: NDArray[np.intp] | None = None, *, n_points: int = 64) -> Array:
        """Return the rings of discs in the picture.

        Args:
            rows: Which discs; None = all.
            n_points: Points of a ring.

        Returns:
            Pixels, shape (n, n_points, 2); NaN for the part of a disc that lies behind the camera.
        """
        centre, radius = (self.centre, self.radius) if rows is None else (self.centre[rows], self.radius[rows])
        angle = np.linspace(0, 2 * np.pi, n_points, endpoint=False)
        ring = centre[:, None] + radius[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        has_one = self.homography.ndim == 2
        h = self.homography if has_one or rows is None else self.homography[rows]
        back = np.asarray(np.linalg.inv(np.where(np.isfinite(h), h, np.eye(3))), dtype=np.float64)
        middle, edge = (_mapped(back, points) for points in (centre[:, None], ring))
        is_ahead = edge[..., 2:] * middle[..., 2:] > 0  # depth has the sign of the middle's as far as the camera sees
        return np.asarray(np.where(is_ahead, edge[..., :2] / edge[..., 2:], np.nan))


def _mapped(matrix: Array, points: Array) -> Array:
    """Return the homogeneous images of points (n, k, 2) by one map or n of them, shape (n, k, 3)."""
    whole = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
    return np.asarray(whole @ np.swapaxes(matrix, -1, -2))


def safe_spaces(
    homography: ArrayLike,
    uv: Array,
    length_px: Array,
    *,
    length_m: float,
    radius_m: float,
    picture_px: tuple[int, int],
) -> SafeSpaces:
    """Return the disc of each person: as wide in the picture as `radius_m` is by the person's own body.

    The part of the body is `length_px` long in the picture and `length_m` in metres. So the half width of the ellipse
    at the foot point is length_px radius_m / length_m. The scale of the floor plane along the picture's rows turns it
    into the plane's unit.

    Args:
        homography: 3x3, pixels to floor plane.
        uv: Foot points in pixels, shape (n, 2).
        length_px: Length of the part in pixels, shape (n,).
        length_m: Its length in metres in the population.
        radius_m: Radius of the safe space in metres.
        picture_px: Width and height of the picture.
    """
    h = as_matrix(homography)
    centre = to_floor(h, uv, picture_px=picture_px)
    # derivative of the floor position along u: (first two rows - position * third row) / w
    w = uv @ h[2, :2] + h[2, 2]
    per_px = np.linalg.norm((h[:2, 0] - centre * h[2, 0]) / w[:, None], axis=1)
    return SafeSpaces(h, centre, length_px * radius_m / length_m * per_px, radius_m)


@dataclass(frozen=True, slots=True)
class Overlaps:
    """Pairs of persons of one frame each.

    Attributes:
        a: Row of the first person, shape (n,).
        b: Row of the second person.
        distance_m: Approximate distance: the distance on the plane in units of the two radii, times what they mean.
    """

    a: NDArray[np.intp]
    b: NDArray[np.intp]
    distance_m: Array


def pairs_of_frames(frame: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of all pairs of persons within a frame, the lesser row first; `frame` is in order."""
    starts = np.flatnonzero(np.r_[True, frame[1:] != frame[:-1]]) if len(frame) else np.empty(0, dtype=np.intp)
    sizes = np.diff(np.r_[starts, len(frame)])
    rest = np.repeat(starts + sizes, sizes) - np.arange(len(frame)) - 1  # how many persons of the frame follow each
    a = np.repeat(np.arange(len(frame)), rest)
    first = np.repeat(np.cumsum(rest) - rest, rest)
    return a, a + 1 + np.arange(len(a)) - first


def near_pairs(spaces: SafeSpaces, frame: NDArray[np.int64], *, within_m: float) -> Overlaps:
    """Return the pairs of a frame nearer than a distance; safe spaces overlap below twice their radius.

    Args:
        spaces: One disc per person.
        frame: Frame number of each, in order, shape (n,).
        within_m: Pairs from this distance on are left out.
    """
    a, b = pairs_of_frames(frame)
    apart = np.linalg.norm(spaces.centre[a] - spaces.centre[b], axis=1)
    both = spaces.radius[a] + spaces.radius[b]
    distance = apart / both * 2 * spaces.radius_m
    near = distance < within_m  # NaN is not near
    return Overlaps(a[near], b[near], distance[near])
