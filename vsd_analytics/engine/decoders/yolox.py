"""YOLOX: a box, an objectness and class scores for each cell of three grids.

A box is the offset of its middle from the cell's corner and the logarithms of its size, both in strides (Ge and others,
YOLOX, 2021). Some exports have pixels in their place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.engine.decoders.cells import cells_of, n_cells
from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.model_input import Preparation
from vsd_analytics.engine.network import Signature

STRIDES: Final = (8, 16, 32)
LARGEST_LOG: Final = 20.0
"""Sizes above this are pixels: as a logarithm of strides it would be a box of billions of pixels."""


@dataclass(frozen=True, slots=True)
class Yolox:
    """Decoder of YOLOX.

    Attributes:
        preparation: What it expects of a picture.
        person: Number of the class of a person.
    """

    preparation: Preparation
    person: int
    family: str = "yolox"
    has_joints: bool = False

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        (output,) = outputs.values()
        rows = np.asarray(output[0], dtype=np.float64)
        score = rows[:, 4] * rows[:, 5 + self.person]
        chosen = np.flatnonzero(score >= least_score)
        middle, size = rows[chosen, :2], rows[chosen, 2:4]
        if rows[:, 2:4].max(initial=0.0) <= LARGEST_LOG:
            corner, stride = cells_of(self.preparation.size_px, STRIDES, begin=0.0)
            middle = corner[chosen] + middle * stride[chosen, None]
            size = np.exp(size) * stride[chosen, None]
        return Detections.of(np.concatenate([middle - size / 2, middle + size / 2], axis=1), score[chosen])


def yolox(signature: Signature, notes: ModelNotes) -> Yolox | None:
    """Return the decoder of a network with the outputs of YOLOX, None for others."""
    if len(signature.outputs) != 1 or len(signature.outputs[0].shape) != 3:
        return None
    size_px = signature.picture_px or (640, 640)
    _, rows, columns = signature.outputs[0].shape
    if columns is None or columns < 6 or rows != n_cells(size_px, STRIDES):
        return None
    return Yolox(Preparation(size_px, kind=signature.inputs[0].kind), notes.person(0))
