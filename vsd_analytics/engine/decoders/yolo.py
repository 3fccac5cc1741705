"""Exports of ultralytics' YOLO: boxes with class scores, or of one class with 17 joints.

Three layouts: columns of middle, size and scores for each cell (YOLOv8 and later); the same as rows with an objectness,
three for each cell (YOLOv5); and rows of corners, score and class after the model's own suppression (YOLOv10, YOLO26).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from vsd_analytics.engine.decoders.cells import n_cells
from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.detections import Detections, body_joints
from vsd_analytics.engine.model_input import Preparation
from vsd_analytics.engine.network import Signature
from vsd_analytics.engine.people import Array

STRIDES: Final = (8, 16, 32)
JOINT_COLUMNS: Final = 17 * 3
POSE_COLUMNS: Final = 4 + 1 + JOINT_COLUMNS
MOST_ROWS: Final = 1000
"""A model that suppresses doubles itself gives fewer rows; one that does not has a row for each of its many cells."""

Layout = Literal["columns", "objectness", "final"]


@dataclass(frozen=True, slots=True)
class Yolo:
    """Decoder of YOLO.

    Attributes:
        preparation: What it expects of a picture.
        layout: Which of the three.
        has_joints: Whether 17 joints follow the score.
        person: Number of the class of a person.
    """

    preparation: Preparation
    layout: Layout
    has_joints: bool
    person: int
    family: str = "yolo"

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        (output,) = outputs.values()
        rows: Array = np.asarray(output[0].T if self.layout == "columns" else output[0], dtype=np.float64)
        if self.layout == "final":
            rows = rows[(rows[:, 4] >= least_score) & (rows[:, 5].round() == self.person)]
            return Detections.of(rows[:, :4], rows[:, 4], self._joints(rows[:, 6:]))
        if self.layout == "objectness":
            score = rows[:, 4] * rows[:, 5 + self.person]
        else:
            score = rows[:, 4 + (0 if self.has_joints else self.person)]
        rows, score = rows[score >= least_score], score[score >= least_score]
        half = rows[:, 2:4] / 2
        box = np.concatenate([rows[:, :2] - half, rows[:, :2] + half], axis=1)
        return Detections.of(box, score, self._joints(rows[:, 5:]))

    def _joints(self, columns: Array) -> Array | None:
        if not self.has_joints:
            return None
        joints = columns.reshape(len(columns), 17, 3)
        return body_joints(joints[..., :2], joints[..., 2])


def yolo(signature: Signature, notes: ModelNotes) -> Yolo | None:
    """Return the decoder of a network with the outputs of YOLO, None for others."""
    if len(signature.outputs) != 1 or len(signature.outputs[0].shape) != 3:
        return None
    size_px = signature.picture_px or (640, 640)
    preparation = Preparation(
        size_px, fit="centre", is_rgb=True, sd=(255.0, 255.0, 255.0), kind=signature.inputs[0].kind
    )
    _, first, last = signature.outputs[0].shape
    cells, person = n_cells(size_px, STRIDES), notes.person(0)
    if first is not None and first >= 5 and (last == cells or (last is None and first < MOST_ROWS)):
        return Yolo(preparation, "columns", has_joints=first == POSE_COLUMNS, person=person)
    if last in {6, 6 + JOINT_COLUMNS} and (first is None or first <= MOST_ROWS):
        return Yolo(preparation, "final", has_joints=last != 6, person=person)
    if last is not None and last > 5 and first == 3 * cells:
        return Yolo(preparation, "objectness", has_joints=False, person=person)
    return None
