"""From a picture to the numbers that go into a network, and from its pixels back to those of the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.frame_pictures import Picture
from vsd_analytics.engine.network import Port

Fit = Literal["corner", "centre", "stretch"]
"""How a picture of other proportions goes in: scaled into the upper left corner or into the middle and padded, or
stretched."""
IMAGENET_MEAN, IMAGENET_SD = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)
"""Red, green and blue of ImageNet's pictures, 0 to 255."""
GREY: Final = 114
"""What YOLO, YOLOX and RTMDet are padded with."""
TYPES: Final = {"float": np.float32, "float16": np.float16, "double": np.float64, "int32": np.int32, "uint8": np.uint8}


def other_inputs(ports: Sequence[Port], size_px: tuple[int, int]) -> dict[str, NDArray[Any]] | None:
    """Return what goes into a network beside the picture: its size, or which of its pixels count (all).

    None where an input is none of those that exports of DETR, RT-DETR and PicoDet have.
    """
    width, height = size_px
    known = {
        "pixel_mask": np.ones((1, height, width)),
        "orig_target_sizes": np.array([[width, height]]),
        "im_shape": np.array([[height, width]]),
        "scale_factor": np.ones((1, 2)),
    }
    if any(port.name not in known for port in ports):
        return None
    return {port.name: known[port.name].astype(TYPES.get(port.kind, np.int64)) for port in ports}


@dataclass(frozen=True, slots=True)
class Placed:
    """How a picture lies in a network's input: pixel (u, v) is at (u, v) * scale + offset there."""

    scale: tuple[float, float]
    offset: tuple[float, float]

    def back(self, detections: Detections) -> Detections:
        """Return people of the network's pixels in pixels of the picture."""
        (sx, sy), (dx, dy) = self.scale, self.offset
        return detections.mapped((1 / sx, 1 / sy), (-dx / sx, -dy / sy))


@dataclass(frozen=True, slots=True)
class Preparation:
    """What a network expects of a picture.

    Attributes:
        size_px: Width and height.
        fit: How other proportions go in.
        is_rgb: Red comes first, not blue.
        mean: Taken off each colour, in the order that goes in.
        sd: What the rest is divided by.
        pad: Grey of the padding.
        is_channels_last: Shape (1, height, width, 3), not (1, 3, height, width).
        kind: Type of the numbers (`TYPES`).
    """

    size_px: tuple[int, int]
    fit: Fit = "corner"
    is_rgb: bool = False
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sd: tuple[float, float, float] = (1.0, 1.0, 1.0)
    pad: int = GREY
    is_channels_last: bool = False
    kind: str = "float"

    def tensor(self, picture: Picture) -> tuple[NDArray[Any], Placed]:
        """Return the input of one picture, and how the picture lies in it."""
        width, height = self.size_px
        if self.fit == "stretch":
            scale = (width / picture.shape[1], height / picture.shape[0])
        else:
            both = min(width / picture.shape[1], height / picture.shape[0])
            scale = (both, both)
        inner = (max(1, round(picture.shape[1] * scale[0])), max(1, round(picture.shape[0] * scale[1])))
        offset = ((width - inner[0]) // 2, (height - inner[1]) // 2) if self.fit == "centre" else (0, 0)
        is_smaller = inner[0] < picture.shape[1]
        resized = cv2.resize(picture, inner, interpolation=cv2.INTER_AREA if is_smaller else cv2.INTER_LINEAR)
        whole = np.full((height, width, 3), self.pad, dtype=np.uint8)
        whole[offset[1] : offset[1] + inner[1], offset[0] : offset[0] + inner[0]] = resized
        return self.normalised(whole), Placed(scale, offset)

    def normalised(self, picture: Picture) -> NDArray[Any]:
        """Return a picture of the right size as the network's input."""
        ordered: NDArray[Any] = picture[..., ::-1] if self.is_rgb else picture
        kind = TYPES[self.kind]
        if self.mean != (0.0, 0.0, 0.0) or self.sd != (1.0, 1.0, 1.0):
            mean, sd = (np.asarray(three, dtype=np.float32) for three in (self.mean, self.sd))
            ordered = (ordered.astype(np.float32) - mean) / sd
        axes = ordered if self.is_channels_last else np.moveaxis(ordered, -1, 0)
        return np.ascontiguousarray(axes[None], dtype=kind)
