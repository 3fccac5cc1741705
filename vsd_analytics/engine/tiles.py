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
class Tile:
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


def tiles_of(size_px: tuple[int, int], *, side_px: int | None, overlap_px: int) -> list[Tile]:
    """Return tiles that cover a picture, evenly spaced; one for the whole picture without `side_px`.

    Args:
        size_px: Width and height of the picture.
        side_px: Width and height of a tile; the picture's where that is less.
        overlap_px: What neighbours share at least: as much as a body is high.
    """
    if side_px is None:
        return [Tile(0, 0, *size_px)]
    spans = []
    for length in size_px:
        side = min(side_px, length)
        step = max(1, side - min(overlap_px, side // 2))
        n = 1 + max(0, -(-(length - side) // step))
        begins = np.linspace(0, length - side, n).round().astype(int)
        spans.append([(int(begin), int(begin) + side) for begin in begins])
    return [Tile(left, top, right, bottom) for top, bottom in spans[1] for left, right in spans[0]]
