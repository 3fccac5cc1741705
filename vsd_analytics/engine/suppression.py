"""Several boxes on one person: which one stays."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.people import Array

SAME_IOU: Final = 0.5
"""Boxes that share more than this of their union are one person; people who overlap share less (docs/detectors.md)."""


def each_once(detections: Detections, *, same_iou: float = SAME_IOU) -> Detections:
    """Return detections without those that overlap a surer one by more than `same_iou`, the surest first."""
    if not len(detections):
        return detections
    left_top_size = np.column_stack([detections.box[:, :2], detections.box[:, 2:] - detections.box[:, :2]])
    kept = cv2.dnn.NMSBoxes(left_top_size.tolist(), detections.score.tolist(), 0.0, same_iou)
    return detections.rows(np.asarray(kept, dtype=np.intp).ravel())


def areas(box: Array) -> Array:
    """Return the area of boxes, square pixels, shape (n,)."""
    return np.asarray(np.prod(np.maximum(box[:, 2:] - box[:, :2], 0.0), axis=1))


def shared_areas(box: Array) -> Array:
    """Return the area that each two boxes share, square pixels, shape (n, n)."""
    low = np.maximum(box[:, None, :2], box[None, :, :2])
    high = np.minimum(box[:, None, 2:], box[None, :, 2:])
    return np.asarray(np.prod(np.maximum(high - low, 0.0), axis=2))


def is_inside(box: Array, *, share: float) -> NDArray[np.bool_]:
    """Return which boxes lie in another by so much of their own area, shape (n, n): row in column."""
    part = shared_areas(box) / np.maximum(areas(box), 1e-9)[:, None]
    np.fill_diagonal(part, 0.0)
    return np.asarray(part >= share)
