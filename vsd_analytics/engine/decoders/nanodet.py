"""NanoDet and NanoDet-Plus: class scores and distances to the four sides as distributions, cell by cell.

The distance to a side is the mean of a softmax over bins 0, 1, 2, ... in strides (Li and others, Generalized Focal
Loss, 2020). NanoDet has one output of scores and one of bins for each stride; NanoDet-Plus has one output of both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.engine.decoders.cells import cells_of
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.model_input import IMAGENET_MEAN, IMAGENET_SD, Preparation
from vsd_analytics.engine.network import Signature
from vsd_analytics.engine.people import Array

STRIDES: Final = (8, 16, 32)
PLUS_STRIDES: Final = (8, 16, 32, 64)
MIDDLE: Final = 0.5
"""NanoDet's distances begin in the middle of a cell, those of NanoDet-Plus at its upper left corner."""


@dataclass(frozen=True, slots=True)
class NanoDet:
    """Decoder of NanoDet.

    Attributes:
        preparation: What it expects of a picture.
        n_classes: Class scores of a cell; class 0 is a person.
        is_plus: Whether it is NanoDet-Plus.
    """

    preparation: Preparation
    n_classes: int
    is_plus: bool
    family: str = "nanodet"
    has_joints: bool = False

    def decode(self, outputs: dict[str, Array], *, least_score: float) -> Detections:
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
        score = scores[:, 0]
        chosen = np.flatnonzero(score >= least_score)
        logits = bins[chosen].reshape(len(chosen), 4, -1)
        share = np.exp(logits - logits.max(axis=2, keepdims=True))
        share /= share.sum(axis=2, keepdims=True)
        side = share @ np.arange(logits.shape[2]) * stride[chosen, None]
        at = corner[chosen]
        return Detections.of(np.concatenate([at - side[:, :2], at + side[:, 2:]], axis=1), score[chosen])


def nanodet(signature: Signature) -> NanoDet | None:
    """Return the decoder of a network with the outputs of NanoDet, None for others."""
    size_px = signature.picture_px or (416, 416)
    preparation = Preparation(size_px, mean=IMAGENET_MEAN[::-1], sd=IMAGENET_SD[::-1], pad=0, fit="corner")
    shapes = [port.shape for port in signature.outputs]
    if any(len(shape) != 3 for shape in shapes):
        return None
    cells = [shape[1] for shape in shapes]
    widths = [shape[2] for shape in shapes]
    if len(shapes) == 1 and widths[0] is not None and widths[0] > 32 and (widths[0] - 80) % 4 == 0:
        n_cells = len(cells_of(size_px, PLUS_STRIDES, begin=0.0)[0])
        is_plus = cells[0] == n_cells and widths[0] != 84 and widths[0] != 85
        return NanoDet(preparation, 80, is_plus=True) if is_plus else None
    if len(shapes) != 2 * len(STRIDES) or None in widths:
        return None
    each = [len(cells_of(size_px, (stride,), begin=0.0)[0]) for stride in STRIDES]
    if sorted(cells, key=str) != sorted([*each, *each], key=str):
        return None
    kinds = sorted({width for width in widths if width is not None})
    bins, classes = (kinds[0], kinds[1]) if len(kinds) == 2 and kinds[1] == 80 else (kinds[-1], kinds[0])
    return NanoDet(preparation, classes, is_plus=False) if len(kinds) == 2 and bins % 4 == 0 else None
