"""Joints of people whose boxes another model found: each box is cut out with a margin and looked at by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from vsd_analytics.engine.decoders.families import crop_decoder_for
from vsd_analytics.engine.detections import Detections, body_joints
from vsd_analytics.engine.frame_pictures import Picture
from vsd_analytics.engine.model_input import Placed
from vsd_analytics.engine.network import Network
from vsd_analytics.engine.people import Array

MARGIN: Final = 1.25
"""A crop is this much larger than the box, as RTMPose was trained."""


class JointFinder:
    """Finds the joints of people in their boxes.

    Args:
        model: File of ONNX.
        providers: Execution providers of onnxruntime; None = a GPU where there is one, else the processor.
        n_threads: Processor threads.

    Raises:
        UsageError: onnxruntime is not installed (E101).
        InputError: No such file (E201), no network (E215), or of no known family (E216).
    """

    def __init__(self, model: Path, *, providers: Sequence[str] | None = None, n_threads: int = 1) -> None:
        self.network = Network(model, providers=providers, n_threads=n_threads)
        self.decoder = crop_decoder_for(self.network.signature, model=model)

    def with_joints(self, picture: Picture, detections: Detections) -> Detections:
        """Return the same people with joints."""
        joints = [self._joints(picture, box) for box in detections.box]
        return replace(detections, joints=np.array(joints, dtype=np.float64).reshape(detections.joints.shape))

    def _joints(self, picture: Picture, box: Array) -> Array:
        preparation = self.decoder.preparation
        placed = placed_crop(box, preparation.size_px)
        (sx, sy), (dx, dy) = placed.scale, placed.offset
        matrix = np.array([[sx, 0.0, dx], [0.0, sy, dy]])
        crop = cv2.warpAffine(picture, matrix, preparation.size_px, flags=cv2.INTER_LINEAR)
        tensor = preparation.normalised(np.asarray(crop, dtype=np.uint8))
        points, scores = self.decoder.points(self.network.run({self.network.signature.inputs[0].name: tensor}))
        back = (points - np.array(placed.offset)) / np.array(placed.scale)
        return np.asarray(body_joints(back[None], scores[None])[0])


def placed_crop(box: Array, size_px: tuple[int, int]) -> Placed:
    """Return how a crop around a box, with its margin and the proportions of the input, lies in the input."""
    width, height = float(box[2] - box[0]) * MARGIN, float(box[3] - box[1]) * MARGIN
    scale = min(size_px[0] / width, size_px[1] / height)
    middle = (box[:2] + box[2:]) / 2
    return Placed((scale, scale), (size_px[0] / 2 - middle[0] * scale, size_px[1] / 2 - middle[1] * scale))
