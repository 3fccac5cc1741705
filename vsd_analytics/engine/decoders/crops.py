"""Networks that find the joints of one person in a crop: RTMPose and MoveNet singlepose.

RTMPose classifies the column and the row of each joint in half pixels (SimCC; Jiang and others, RTMPose, 2023). MoveNet
gives y, x and score in shares of the crop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from vsd_analytics.engine.decoders.decoder import ModelNotes, Outputs
from vsd_analytics.engine.model_input import IMAGENET_MEAN, IMAGENET_SD, Preparation
from vsd_analytics.engine.network import Signature
from vsd_analytics.engine.people import SKELETONS, Array

BINS_PER_PX: Final = 2.0


class CropDecoder(Protocol):
    """What the outputs of a network of one person's joints mean."""

    @property
    def family(self) -> str:
        """Return the name of the family."""

    @property
    def preparation(self) -> Preparation:
        """Return what goes into the network."""

    def points(self, outputs: Outputs) -> tuple[Array, Array]:
        """Return joints in pixels of the crop, shape (k, 2), and their scores, shape (k,)."""


@dataclass(frozen=True, slots=True)
class RtmPose:
    """Decoder of RTMPose.

    Attributes:
        preparation: What it expects of a crop.
        columns: Name of the output of scores by column.
        rows: Name of the output of scores by row.
    """

    preparation: Preparation
    columns: str
    rows: str
    family: str = "rtmpose"

    def points(self, outputs: Outputs) -> tuple[Array, Array]:
        """Return joints of a crop (`CropDecoder.points`); a score is the lesser one of column and row."""
        both = [np.asarray(outputs[name][0], dtype=np.float64) for name in (self.columns, self.rows)]
        place = np.column_stack([scores.argmax(axis=1) for scores in both]) / BINS_PER_PX
        return place, np.minimum(*(scores.max(axis=1) for scores in both))


@dataclass(frozen=True, slots=True)
class MoveNetSingle:
    """Decoder of MoveNet singlepose.

    Attributes:
        preparation: What it expects of a crop.
    """

    preparation: Preparation
    family: str = "movenet-singlepose"

    def points(self, outputs: Outputs) -> tuple[Array, Array]:
        """Return joints of a crop (`CropDecoder.points`)."""
        (output,) = outputs.values()
        joints = np.asarray(output, dtype=np.float64).reshape(17, 3)
        return joints[:, [1, 0]] * np.array(self.preparation.size_px), joints[:, 2]


def rtmpose(signature: Signature, notes: ModelNotes) -> RtmPose | None:
    """Return the decoder of a network with the outputs of RTMPose, None for others."""
    size_px, shapes = signature.picture_px, [port.shape for port in signature.outputs]
    if size_px is None or len(shapes) != 2 or any(len(shape) != 3 or shape[1] not in SKELETONS for shape in shapes):
        return None
    widths = [size * BINS_PER_PX for size in size_px]
    columns = next((port for port in signature.outputs if port.shape[2] == widths[0]), None)
    rows = next((port for port in signature.outputs if port.shape[2] == widths[1] and port is not columns), None)
    if columns is None or rows is None:
        return None
    preparation = Preparation(
        size_px, is_rgb=True, mean=IMAGENET_MEAN, sd=IMAGENET_SD, kind=signature.inputs[0].kind, pad=0
    )
    return RtmPose(preparation, columns.name, rows.name)


def movenet_single(signature: Signature, notes: ModelNotes) -> MoveNetSingle | None:
    """Return the decoder of a network with the output of MoveNet singlepose, None for others."""
    shapes = [port.shape for port in signature.outputs]
    if len(shapes) != 1 or shapes[0][-2:] != (17, 3) or len(shapes[0]) not in {3, 4}:
        return None
    preparation = Preparation(
        signature.picture_px or (192, 192),
        is_rgb=True,
        is_channels_last=signature.is_channels_last,
        kind=signature.inputs[0].kind,
        pad=0,
    )
    return MoveNetSingle(preparation)
