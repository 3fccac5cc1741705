"""DETR, RT-DETR and RF-DETR: a box and class scores for each query, without any suppression.

Boxes are middle and size in shares of the picture (Carion and others, 2020). Scores are logits: of one sigmoid each, or
in DETR of a softmax whose last class is nobody.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.model_input import IMAGENET_MEAN, IMAGENET_SD, Preparation
from vsd_analytics.engine.network import Signature

SOFTMAX_CLASSES: Final = 92
"""DETR has COCO's 91 numbers and one for nobody."""
COCO_91: Final = 91
"""RF-DETR has COCO's own numbers, in which 1 is a person; with 80 classes a person is 0."""
MOST_QUERIES: Final = 1000


@dataclass(frozen=True, slots=True)
class Detr:
    """Decoder of DETR.

    Attributes:
        preparation: What it expects of a picture.
        boxes: Name of the output of boxes.
        logits: Name of the output of class scores.
        person: Number of the class of a person.
        is_softmax: Whether scores are of one softmax.
    """

    preparation: Preparation
    boxes: str
    logits: str
    person: int
    is_softmax: bool
    family: str = "detr"
    has_joints: bool = False

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        box, logits = (np.asarray(outputs[name][0], dtype=np.float64) for name in (self.boxes, self.logits))
        if self.is_softmax:
            share = np.exp(logits - logits.max(axis=1, keepdims=True))
            score = share[:, self.person] / share.sum(axis=1)
        else:
            score = 1 / (1 + np.exp(-logits[:, self.person]))
        box, score = box[score >= least_score], score[score >= least_score]
        middle, half = box[:, :2], box[:, 2:] / 2
        corners = np.concatenate([middle - half, middle + half], axis=1)
        return Detections.of(corners * np.tile(self.preparation.size_px, 2), score)


def detr(signature: Signature, notes: ModelNotes) -> Detr | None:
    """Return the decoder of a network with the outputs of DETR and its kin, None for others."""
    three = [port for port in signature.outputs if len(port.shape) == 3]
    boxes = next((port for port in three if port.shape[2] == 4), None)
    logits = next((port for port in three if port is not boxes and port.shape[2] != 4), None)
    if boxes is None or logits is None or boxes.shape[1] != logits.shape[1] or (boxes.shape[1] or 0) > MOST_QUERIES:
        return None
    n_classes = logits.shape[2]
    usual = {COCO_91: 1, SOFTMAX_CLASSES: 1, 80: 0, 1: 0}.get(n_classes or 0)
    if usual is None and "person" not in notes.values:
        return None
    size_px = signature.picture_px or ((560, 560) if n_classes == COCO_91 else (640, 640))
    is_plain = n_classes == 80  # RT-DETR takes colours from 0 to 1
    preparation = Preparation(
        size_px,
        fit="stretch",
        is_rgb=True,
        mean=(0.0, 0.0, 0.0) if is_plain else IMAGENET_MEAN,
        sd=(255.0, 255.0, 255.0) if is_plain else IMAGENET_SD,
        kind=signature.inputs[0].kind,
    )
    return Detr(preparation, boxes.name, logits.name, notes.person(usual or 0), is_softmax=n_classes == SOFTMAX_CLASSES)
