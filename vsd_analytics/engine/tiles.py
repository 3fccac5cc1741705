"""Parts of a picture that a detector sees one by one, so that people who are small in the picture are large enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.frame_pictures import Picture

EDGE_PX: Final = 4.0
"""A box this near to a tile's inner edge is cut off there: the next tile has it whole."""


@dataclass(frozen=True, slots=True)
class PictureTile:
    """A part of a picture, pixels: left and top are inside, right and bottom outside."""

    left: int
    top: int
    right: int
    bottom: int

    def cut(self, picture: Picture) -> Picture:
        """Return this part of a picture."""
        return picture[self.top : self.bottom, self.left : self.right]

    def is_cut(self, detections: Detections, size_px: tuple[int, int]) -> NDArray[np.bool_]:
        """Return which boxes of the whole picture touch an edge of the tile that is none of the picture, shape (n,)."""
        box, (width, height) = detections.box, size_px
        at_edge = np.column_stack(
            [
                (box[:, 0] < self.left + EDGE_PX) & (self.left > 0),
                (box[:, 1] < self.top + EDGE_PX) & (self.top > 0),
                (box[:, 2] > self.right - EDGE_PX) & (self.right < width),
                (box[:, 3] > self.bottom - EDGE_PX) & (self.bottom < height),
            ]
        )
        return np.asarray(at_edge.any(axis=1), dtype=np.bool_)


LEAST_BODY_PX: Final = 40.0
"""A body of a person must be so high in a network's input; published detectors lose smaller ones."""
MOST_TILES: Final = 8
OVERLAP_WIDTH: Final = 0.5
"""Width of a body against its height, with arms and a stride."""


def tiles_for(
    size_px: tuple[int, int], *, input_px: tuple[int, int], body_px: tuple[float, float] | None
) -> list[PictureTile]:
    """Return the fewest tiles in which small bodies are `LEAST_BODY_PX` high for the network, at most `MOST_TILES`.

    Args:
        size_px: Width and height of the picture.
        input_px: Width and height of the network's input.
        body_px: Height of small and of large bodies in the picture (`bodies.body_sizes_px`); None = not known: then
            the whole picture at once.
    """
    whole = [PictureTile(0, 0, *size_px)]
    if body_px is None:
        return whole
    side_px = min(input_px) * body_px[0] / LEAST_BODY_PX
    if side_px >= max(size_px):
        return whole
    side_px = min(side_px, *size_px)
    overlap_px = (round(OVERLAP_WIDTH * body_px[1]), round(body_px[1]))
    while len(tiles := tiles_of(size_px, side_px=int(side_px), overlap_px=overlap_px)) > MOST_TILES:
        side_px *= 1.1
    return tiles


def tiles_of(size_px: tuple[int, int], *, side_px: int, overlap_px: tuple[int, int]) -> list[PictureTile]:
    """Return tiles that cover a picture, evenly spaced.

    Args:
        size_px: Width and height of the picture.
        side_px: Width and height of a tile; the picture's where that is less.
        overlap_px: What neighbours share at least, beside and above each other: as much as a body is wide and high.
    """
    spans = []
    for length, shared in zip(size_px, overlap_px, strict=True):
        side = min(side_px, length)
        step = max(1, side - min(shared, side // 2))
        n = 1 + max(0, -(-(length - side) // step))
        begins = np.linspace(0, length - side, n).round().astype(int)
        spans.append([(int(begin), int(begin) + side) for begin in begins])
    return [PictureTile(left, top, right, bottom) for top, bottom in spans[1] for left, right in spans[0]]
