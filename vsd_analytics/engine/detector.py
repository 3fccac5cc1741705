"""A detector: any model of people in ONNX, picture by picture.

The model is the user's: none is shipped and nothing is downloaded. Its family is known by its inputs and outputs
(`decoders`), or by a TOML file beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from vsd_analytics.engine.crops import JointFinder
from vsd_analytics.engine.decoders.decoder import Decoder
from vsd_analytics.engine.decoders.families import decoder_for
from vsd_analytics.engine.detections import Detections, joined
from vsd_analytics.engine.frame_pictures import Picture
from vsd_analytics.engine.model_input import other_inputs
from vsd_analytics.engine.network import Network
from vsd_analytics.engine.suppression import each_once
from vsd_analytics.engine.tiles import PictureTile

LEAST_SCORE: Final = 0.45
"""Below, double boxes and mannequins make more false pairs than people found make true ones (docs/detectors.md)."""


class Detector:
    """Finds people in pictures.

    Args:
        model: File of ONNX; a file of the same name with `.toml` says what its outputs do not show.
        providers: Execution providers of onnxruntime; None = a GPU where there is one, else the processor.
        n_threads: Processor threads.
        least_score: People with a lower score are left out.
        joints: File of a second model, which finds the joints in each box; None = those of the first, if it has any.

    Raises:
        UsageError: onnxruntime is not installed (E101).
        InputError: No such file (E201), no network (E215), or of no known family (E216).
    """

    def __init__(
        self,
        model: Path,
        *,
        providers: Sequence[str] | None = None,
        n_threads: int = 1,
        least_score: float = LEAST_SCORE,
        joints: Path | None = None,
    ) -> None:
        self.network = Network(model, providers=providers, n_threads=n_threads)
        self.decoder: Decoder = decoder_for(self.network.signature, model=model)
        self.least_score = least_score
        self.joint_finder = None if joints is None else JointFinder(joints, providers=providers, n_threads=n_threads)

    def people(self, picture: Picture, *, tiles: Sequence[PictureTile] | None = None) -> Detections:
        """Return the people of a picture, each once, the surest first.

        Args:
            picture: Blue, green, red, shape (height, width, 3).
            tiles: Parts to look at one by one (`tiles_of`); None = the whole picture at once.
        """
        size_px = (int(picture.shape[1]), int(picture.shape[0]))
        parts = []
        for tile in tiles or [PictureTile(0, 0, *size_px)]:
            part = self._in_tile(picture, tile)
            parts.append(part.rows(~tile.is_cut(part, size_px)))
        people = each_once(joined(parts))
        return people if self.joint_finder is None else self.joint_finder.with_joints(picture, people)

    def _in_tile(self, picture: Picture, tile: PictureTile) -> Detections:
        tensor, placed = self.decoder.preparation.tensor(tile.cut(picture))
        picture_port, *ports = self.network.signature.inputs
        others = other_inputs(ports, self.decoder.preparation.size_px) or {}
        outputs = self.network.run({picture_port.name: tensor, **others})
        detections = self.decoder.decode(outputs, least_score=self.least_score)
        return within(placed.back(detections), tile)


def within(detections: Detections, tile: PictureTile) -> Detections:
    """Return the people of a tile in pixels of the whole picture, with boxes cut off where the tile ends."""
    size = np.array([tile.right - tile.left, tile.bottom - tile.top])
    box = np.clip(detections.box, 0, np.tile(size, 2))
    is_there = (box[:, 2] - box[:, 0] >= 1) & (box[:, 3] - box[:, 1] >= 1)
    inside = Detections(box, detections.score, detections.joints).rows(is_there)
    return inside.mapped((1.0, 1.0), (tile.left, tile.top))
