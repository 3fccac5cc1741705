"""Any network that gives boxes, scores and perhaps classes of people, as a TOML file beside the model says.

`scores = "output"` is a whole output, `"output[4]"` one of its columns, `"output[4:84]"` some: then class `person` of
them is the score.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.model_input import Preparation
from vsd_analytics.engine.network import Signature
from vsd_analytics.engine.people import Array


@dataclass(frozen=True, slots=True)
class Columns:
    """Some columns of an output."""

    name: str
    first: int | None
    end: int | None

    def taken(self, outputs: Outputs) -> Array:
        """Return them, shape (n, k)."""
        values = np.asarray(outputs[self.name], dtype=np.float64)
        rows = values.reshape(-1, values.shape[-1]) if values.ndim > 2 or self.first is not None else values.T
        rows = values.reshape(-1, 1) if values.ndim < 3 and self.first is None and values.shape[0] == 1 else rows
        return rows[:, self.first : self.end]


@dataclass(frozen=True, slots=True)
class StatedBoxes:
    """Decoder of boxes as notes say.

    Attributes:
        preparation: What it expects of a picture.
        boxes: Where four numbers of each box are.
        scores: Where scores are.
        classes: Where class numbers are; None = scores are by class, or all are people.
        layout: `corners` (left, top, right, bottom), `middle` (and size) or `size` (left, top, width, height).
        is_share: Whether boxes are shares of the input, not pixels.
        person: Number of the class of a person.
    """

    preparation: Preparation
    boxes: Columns
    scores: Columns
    classes: Columns | None
    layout: str
    is_share: bool
    person: int
    family: str = "boxes"
    has_joints: bool = False

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people in pixels of the input (`Decoder.decode`)."""
        box, scores = self.boxes.taken(outputs), self.scores.taken(outputs)
        score = scores[:, self.person if scores.shape[1] > 1 else 0]
        is_sure = score >= least_score
        if self.classes is not None:
            is_sure &= self.classes.taken(outputs)[:, 0].round() == self.person
        box, score = box[is_sure], score[is_sure]
        first, second = box[:, :2], box[:, 2:]
        if self.layout == "middle":
            first, second = first - second / 2, first + second / 2
        elif self.layout == "size":
            second = first + second
        corners = np.concatenate([first, second], axis=1)
        return Detections.of(corners * np.tile(self.preparation.size_px, 2) if self.is_share else corners, score)


def boxes(signature: Signature, notes: ModelNotes) -> StatedBoxes | None:
    """Return the decoder that notes describe; None where they name no boxes and scores of this network."""
    keys = notes.values
    box, scores = (_columns(keys.get(key, ""), signature) for key in ("boxes", "scores"))
    classes = _columns(keys["classes"], signature) if "classes" in keys else None
    if box is None or scores is None or ("classes" in keys and classes is None):
        return None
    preparation = Preparation(
        signature.picture_px or (640, 640),
        is_channels_last=signature.is_channels_last,
        kind=signature.inputs[0].kind,
    )
    layout, unit = keys.get("layout", "corners"), keys.get("unit", "px")
    return StatedBoxes(preparation, box, scores, classes, layout, unit == "share", notes.person(0))


def _columns(text: str, signature: Signature) -> Columns | None:
    match = re.fullmatch(r"(.+?)(?:\[(\d+)(?::(\d+))?\])?", text)
    if match is None or signature.output(match[1]) is None:
        return None
    if match[2] is None:
        return Columns(match[1], None, None)
    first = int(match[2])
    return Columns(match[1], first, first + 1 if match[3] is None else int(match[3]))
