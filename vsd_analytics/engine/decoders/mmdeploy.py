"""RTMDet and RTMO as mmdeploy exports them: boxes after the model's own suppression, in pixels of the input.

RTMDet gives boxes with their scores, and classes; RTMO gives boxes with their scores, and 17 joints (Lu and others,
RTMO, 2023).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.detections import Detections, body_joints
from vsd_analytics.engine.model_input import IMAGENET_MEAN, IMAGENET_SD, Preparation
from vsd_analytics.engine.network import Port, Signature


@dataclass(frozen=True, slots=True)
class RtmDet:
    """Decoder of RTMDet.

    Attributes:
        preparation: What it expects of a picture.
        boxes: Name of the output of left, top, right, bottom and score.
        labels: Name of the output of classes.
        person: Number of the class of a person.
    """

    preparation: Preparation
    boxes: str
    labels: str
    person: int
    family: str = "rtmdet"
    has_joints: bool = False

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        rows, labels = outputs[self.boxes][0], outputs[self.labels][0]
        rows = rows[(labels == self.person) & (rows[:, 4] >= least_score)]
        return Detections.of(rows[:, :4], rows[:, 4])


@dataclass(frozen=True, slots=True)
class Rtmo:
    """Decoder of RTMO.

    Attributes:
        preparation: What it expects of a picture.
        boxes: Name of the output of left, top, right, bottom and score.
        joints: Name of the output of x, y and score of 17 joints.
    """

    preparation: Preparation
    boxes: str
    joints: str
    family: str = "rtmo"
    has_joints: bool = True

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        rows, joints = outputs[self.boxes][0], np.asarray(outputs[self.joints][0], dtype=np.float64)
        is_sure = rows[:, 4] >= least_score
        rows, joints = rows[is_sure], joints[is_sure]
        return Detections.of(rows[:, :4], rows[:, 4], body_joints(joints[..., :2], joints[..., 2]))


def rtmdet(signature: Signature, notes: ModelNotes) -> RtmDet | None:
    """Return the decoder of a network with the outputs of RTMDet, None for others."""
    boxes = _boxes(signature)
    labels = next((p for p in signature.outputs if len(p.shape) == 2), None)
    if boxes is None or labels is None or len(signature.outputs) != 2:
        return None
    preparation = Preparation(
        signature.picture_px or (640, 640),
        mean=IMAGENET_MEAN[::-1],
        sd=IMAGENET_SD[::-1],
        kind=signature.inputs[0].kind,
    )
    return RtmDet(preparation, boxes.name, labels.name, notes.person(0))


def rtmo(signature: Signature, notes: ModelNotes) -> Rtmo | None:
    """Return the decoder of a network with the outputs of RTMO, None for others."""
    boxes = _boxes(signature)
    joints = next((p for p in signature.outputs if len(p.shape) == 4 and p.shape[2:] == (17, 3)), None)
    if boxes is None or joints is None:
        return None
    preparation = Preparation(signature.picture_px or (640, 640), kind=signature.inputs[0].kind)
    return Rtmo(preparation, boxes.name, joints.name)


def _boxes(signature: Signature) -> Port | None:
    return next((port for port in signature.outputs if len(port.shape) == 3 and port.shape[2] == 5), None)
