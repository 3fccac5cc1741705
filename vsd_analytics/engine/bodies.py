"""From boxes to bodies on a floor: doubles and impossible heights go, half bodies get the feet that cannot be seen.

A camera whose homography is known says how high the body in a box is, and where on the floor somebody of usual height
is whose head is seen at a pixel. The usual height is the median of the whole boxes of the same camera, so it holds
for its people and for what its detector puts into a box. Order and effect of the steps are measured in docs/engine.md.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.engine.camera_model import CameraModel
from vsd_analytics.engine.detections import Detections, joined
from vsd_analytics.engine.floor_points import below_boxes, photographer
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.sightings import BOX, EDGE_PX
from vsd_analytics.engine.suppression import is_inside
from vsd_analytics.geometry.homography import to_floor

INSIDE_SHARE: Final = 0.8
"""A box with this part of its area in another may be a second one on the same person."""
SAME_PLACE_M: Final = 0.8
"""It is, where the feet of both are nearer than two people stand."""
WHOLE_M: Final = (1.3, 2.4)
"""Heights of whole bodies: lower boxes are taken as upper halves, higher ones as nobody."""
LEAST_LEARNT: Final = 20
"""With fewer whole boxes the usual height is that of `sightings.BOX`."""
MOST_LEARNT: Final = 20_000

FARTHEST_M: Final = 60.0
"""People farther away are too small for distances, so tiles are not made for them."""

DOUBLE, TOO_HIGH = "a second one on the same person", "of an impossible height"


class Bodies:
    """People of one camera, picture by picture.

    Args:
        homography: 3x3, pixels to floor metres; None = not known: then nothing is changed.
        size_px: Width and height of the picture.
    """

    def __init__(self, homography: ArrayLike | None, size_px: tuple[int, int]) -> None:
        self.size_px = size_px
        self.homography = None if homography is None else np.asarray(homography, dtype=np.float64)
        self.camera = None if homography is None else photographer(homography, size_px)
        self.left_out: Counter[str] = Counter()
        self.n_extended = 0
        self._heights_m: Array = np.empty(0)

    @property
    def usual_m(self) -> float:
        """Return the median height of whole boxes."""
        return float(np.median(self._heights_m)) if len(self._heights_m) >= LEAST_LEARNT else BOX.high_m

    def learn(self, detections: Detections) -> None:
        """Add the heights of whole boxes to those of which the usual one is the median."""
        if self.camera is None or not len(detections):
            return
        height_m = heights_m(detections.box, self.camera)
        with np.errstate(invalid="ignore"):
            is_whole = ~touches_edge(detections.box, self.size_px) & (height_m > WHOLE_M[0]) & (height_m < WHOLE_M[1])
        self._heights_m = np.concatenate([self._heights_m, height_m[is_whole]])[-MOST_LEARNT:].copy()

    def cleaned(self, detections: Detections) -> Detections:
        """Return the people of a picture, each once and with boxes down to the floor.

        Boxes of people who have joints stay as they are: joints show what of a body is seen.
        """
        if self.camera is None or not len(detections):
            return detections
        box = detections.box
        is_box = ~np.isfinite(detections.joints).any(axis=(1, 2))
        height_m = heights_m(box, self.camera)
        with np.errstate(invalid="ignore"):
            too_high = is_box & (height_m > WHOLE_M[1])
            is_half = is_box & ((height_m < WHOLE_M[0]) | (box[:, 3] > self.size_px[1] - EDGE_PX)) & ~too_high
        self.left_out[TOO_HIGH] += int(too_high.sum())
        self.n_extended += int(is_half.sum())
        box = np.where(is_half[:, None], to_floor_boxes(box, self.camera, self.usual_m), box)
        some = Detections(box, detections.score, detections.joints).rows(~too_high)
        double = self._doubles(some, is_half[~too_high])  # of whole bodies: the feet of an upper half are elsewhere
        self.left_out[DOUBLE] += int(double.sum())
        return some.rows(~double)

    def _doubles(self, detections: Detections, is_half: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which boxes lie in another one whose feet are at the same place.

        Of two that lie in each other, the one whose feet were seen stays, else the surer one.
        """
        assert self.camera is not None
        assert self.homography is not None
        xy = to_floor(self.homography, below_boxes(detections.box, self.camera), picture_px=self.size_px)
        apart_m = np.linalg.norm(xy[:, None] - xy[None], axis=2)
        with np.errstate(invalid="ignore"):
            lies_in = is_inside(detections.box, share=INSIDE_SHARE) & (apart_m < SAME_PLACE_M)
        double = np.zeros(len(detections), dtype=bool)
        for row in np.lexsort((detections.score, ~is_half)).tolist():  # halves first, and the least sure of each
            double[row] = bool((lies_in[row] & ~double).any())
        return double


def people_with_bodies(people: People, bodies: Bodies) -> People:
    """Return the people of many pictures as `Bodies.cleaned` makes them, by the usual height of all of them."""
    frames = np.unique(people.frame)
    edges = np.searchsorted(people.frame, [*frames.tolist(), np.iinfo(np.int64).max])
    detections_of = [
        Detections.of(people.box[start:stop], np.ones(stop - start), people.joints[start:stop])
        for start, stop in pairwise(edges.tolist())
    ]
    for detections in detections_of:
        bodies.learn(detections)
    cleaned = [bodies.cleaned(detections) for detections in detections_of]
    every = joined(cleaned)
    frame = np.repeat(frames, [len(detections) for detections in cleaned])
    track = np.full(len(every), None, dtype=object)
    return replace(people, frame=frame, track=track, box=every.box, joints=every.joints)


def body_sizes_px(homography: ArrayLike, size_px: tuple[int, int]) -> tuple[float, float] | None:
    """Return how high small and large bodies are in a picture: the 10 and 90 % quantiles over the floor in view.

    None where no camera explains the homography.
    """
    camera = photographer(homography, size_px)
    if camera is None:
        return None
    columns, rows = (np.linspace(0, size, 40) for size in size_px)
    uv = np.column_stack([axis.ravel() for axis in np.meshgrid(columns, rows)])
    foot = camera.on_plane(uv, 0.0)
    foot = foot[np.linalg.norm(foot - camera.height_m * camera.down(), axis=1) < FARTHEST_M]  # NaN is not
    head = foot - BOX.high_m * camera.down()
    is_seen = (foot[:, 2] > 0) & (head[:, 2] > 0)
    height_px = np.linalg.norm((foot[:, :2] / foot[:, 2:] - head[:, :2] / head[:, 2:])[is_seen], axis=1)
    if not len(height_px):
        return None
    small, large = np.quantile(height_px * camera.focal_px, [0.1, 0.9])
    return float(small), float(large)


def touches_edge(box: Array, size_px: tuple[int, int]) -> NDArray[np.bool_]:
    """Return which boxes the picture's edge may cut off, shape (n,)."""
    whole = (box[:, :2] > EDGE_PX).all(axis=1) & (box[:, 2:] < np.array(size_px) - EDGE_PX).all(axis=1)
    return np.asarray(~whole)


def heights_m(box: Array, camera: CameraModel) -> Array:
    """Return how high upright bodies in boxes are, metres, shape (n,); NaN above the horizon."""
    foot = camera.on_plane(below_boxes(box, camera), 0.0)
    slope, down = (box[:, 1] - camera.centre_px[1]) / camera.focal_px, camera.down()
    # the point foot - k down has the row of the top edge: (y - k down_y) / (z - k down_z) = slope
    return np.asarray((foot[:, 1] - slope * foot[:, 2]) / (down[1] - slope * down[2]))


def to_floor_boxes(box: Array, camera: CameraModel, height_m: float) -> Array:
    """Return boxes whose bottom edge is at the feet of somebody of a height who has the head at the top edge.

    A bottom edge may come to lie below the picture. Boxes at or above the horizon of that height stay as they are.
    """
    head = np.column_stack([(box[:, 0] + box[:, 2]) / 2, box[:, 1]])
    foot = camera.on_plane(head, height_m) + height_m * camera.down()
    bottom = foot[:, 1] / foot[:, 2] * camera.focal_px + camera.centre_px[1]
    with np.errstate(invalid="ignore"):
        lower = np.isfinite(bottom) & (foot[:, 2] > 0) & (bottom > box[:, 1] + 1)
    return np.column_stack([box[:, :3], np.where(lower, bottom, box[:, 3])])
