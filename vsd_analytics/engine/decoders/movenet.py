"""MoveNet multipose: up to six people, each with 17 joints and a box, in shares of the input.

A row has y, x and score of each joint, then top, left, bottom, right and score of the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.detections import Detections, body_joints
from vsd_analytics.engine.model_input import Preparation
from vsd_analytics.engine.network import Signature

N_COLUMNS: Final = 17 * 3 + 5
MOST_PEOPLE: Final = 6


@dataclass(frozen=True, slots=True)
class MoveNet:
    """Decoder of MoveNet multipose.

    Attributes:
        preparation: What it expects of a picture.
    """

    preparation: Preparation
    family: str = "movenet"
    has_joints: bool = True

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        (output,) = outputs.values()
        rows = np.asarray(output[0], dtype=np.float64)
        rows = rows[rows[:, -1] >= least_score]
        joints = rows[:, :51].reshape(len(rows), 17, 3)
        size = np.array(self.preparation.size_px)
        box = rows[:, [52, 51, 54, 53]] * np.tile(size, 2)
        return Detections.of(box, rows[:, -1], body_joints(joints[..., [1, 0]] * size, joints[..., 2]))


def movenet(signature: Signature, notes: ModelNotes) -> MoveNet | None:
    """Return the decoder of a network with the output of MoveNet multipose, None for others."""
    shapes = [port.shape for port in signature.outputs]
    if len(shapes) != 1 or len(shapes[0]) != 3 or shapes[0][1:] != (MOST_PEOPLE, N_COLUMNS):
        return None
    preparation = Preparation(
        signature.picture_px or (256, 256),
        fit="centre",
        is_rgb=True,
        pad=0,
        is_channels_last=signature.is_channels_last,
        kind=signature.inputs[0].kind,
    )
    return MoveNet(preparation)
