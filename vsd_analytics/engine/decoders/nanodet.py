"""NanoDet and NanoDet-Plus: class scores and distances to the four sides as distributions, cell by cell.

The distance to a side is the mean of a softmax over bins 0, 1, 2, ... in strides (Li and others, Generalized Focal
Loss, 2020). NanoDet has one output of scores and one of bins for each stride; NanoDet-Plus has one output of both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.engine.decoders.cells import cells_of, n_cells
from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.model_input import IMAGENET_MEAN, IMAGENET_SD, Preparation
from vsd_analytics.engine.network import Signature

STRIDES: Final = (8, 16, 32)
PLUS_STRIDES: Final = (8, 16, 32, 64)
PLUS_BINS: Final = 8
COCO_CLASSES: Final = 80
"""With fewer classes than bins, scores are the narrower output."""
MIDDLE: Final = 0.5
"""NanoDet's distances begin in the middle of a cell, those of NanoDet-Plus at its upper left corner."""


@dataclass(frozen=True, slots=True)
class NanoDet:
    """Decoder of NanoDet.

    Attributes:
        preparation: What it expects of a picture.
        n_classes: Class scores of a cell.
        is_plus: Whether it is NanoDet-Plus.
        person: Number of the class of a person.
    """

    preparation: Preparation
    n_classes: int
    is_plus: bool
    person: int
    family: str = "nanodet"
    has_joints: bool = False

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        if self.is_plus:
            (both,) = (output[0] for output in outputs.values())
            scores, bins = both[:, : self.n_classes], both[:, self.n_classes :]
            corner, stride = cells_of(self.preparation.size_px, PLUS_STRIDES, begin=0.0)
        else:
            parts = sorted((output[0] for output in outputs.values()), key=lambda part: -len(part))
            scores = np.concatenate([part for part in parts if part.shape[1] == self.n_classes])
            bins = np.concatenate([part for part in parts if part.shape[1] != self.n_classes])
            corner, stride = cells_of(self.preparation.size_px, STRIDES, begin=MIDDLE)
        score = scores[:, self.person]
        chosen = np.flatnonzero(score >= least_score)
        logits = bins[chosen].reshape(len(chosen), 4, bins.shape[1] // 4)
        share = np.exp(logits - logits.max(axis=2, keepdims=True))
        share /= share.sum(axis=2, keepdims=True)
        side = share @ np.arange(logits.shape[2]) * stride[chosen, None]
        at = corner[chosen]
        return Detections.of(np.concatenate([at - side[:, :2], at + side[:, 2:]], axis=1), score[chosen])


def nanodet(signature: Signature, notes: ModelNotes) -> NanoDet | None:
    """Return the decoder of a network with the outputs of NanoDet, None for others."""
    shapes = [port.shape for port in signature.outputs]
    if any(len(shape) != 3 or shape[2] is None for shape in shapes):
        return None
    size_px = signature.picture_px or (416, 416)
    preparation = Preparation(
        size_px, mean=IMAGENET_MEAN[::-1], sd=IMAGENET_SD[::-1], pad=0, kind=signature.inputs[0].kind
    )
    widths = sorted({int(shape[2] or 0) for shape in shapes})
    if len(shapes) == 1:  # four sides of 8 bins after the class scores
        n_classes = widths[0] - 4 * PLUS_BINS
        is_plus = n_classes > 0 and shapes[0][1] == n_cells(size_px, PLUS_STRIDES)
        return NanoDet(preparation, n_classes, True, notes.person(0)) if is_plus else None
    each = [n_cells(size_px, (stride,)) for stride in STRIDES]
    if len(widths) != 2 or sorted(shape[1] or 0 for shape in shapes) != sorted([*each, *each]):
        return None
    n_classes = widths[1] if widths[1] == COCO_CLASSES else widths[0]
    return NanoDet(preparation, n_classes, False, notes.person(0))
