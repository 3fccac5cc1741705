"""The people of a source of pictures, found by a detector, as the rest of the engine reads them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.detections import Detections, joined
from vsd_analytics.engine.detector import Detector
from vsd_analytics.engine.people import People
from vsd_analytics.engine.pictures import PictureSource
from vsd_analytics.engine.tiles import PictureTile, tiles_for

N_FIRST: Final = 5
"""So many pictures show how large people are where no calibration does."""
DIGITS_PX: Final = 2
"""Pixels are rounded to a hundredth, so that a run that goes on after a stop gives the same bytes."""


@dataclass(frozen=True, slots=True)
class SeenFrame:
    """What a detector found in one picture.

    Attributes:
        number: Frame number.
        ms: Milliseconds as in `TimedPicture`.
        detections: Its people; None where the picture cannot be read: the frame is missing then, and not empty.
        name: What a message calls the picture.
    """

    number: int
    ms: int
    detections: Detections | None
    name: str = ""


@dataclass(slots=True)
class PeopleOfPictures:
    """Collects frames one by one.

    Attributes:
        frames: Those that were processed.
        unread: Names of pictures that cannot be read.
        seq: Running number of each processed frame. Pictures that cannot be read have one, too, so that a gap shows
            them; pictures that were not taken have none.
    """

    frames: list[SeenFrame] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    seq: dict[int, int] = field(default_factory=dict)

    def add(self, frame: SeenFrame) -> None:
        """Add a frame, or the name of one that cannot be read."""
        if frame.detections is not None:
            self.seq[frame.number] = len(self.frames) + len(self.unread)
        if frame.detections is None:
            self.unread.append(frame.name)
        else:
            self.frames.append(frame)

    def people(self) -> People:
        """Return the people of all processed frames; their bad rows count the pictures that cannot be read."""
        detections = [frame.detections for frame in self.frames if frame.detections is not None]
        every = joined(detections)
        numbers = np.array([frame.number for frame in self.frames], dtype=np.int64)
        bad = {"picture that cannot be read": len(self.unread)} if self.unread else {}
        return People(
            frame=np.repeat(numbers, [len(part) for part in detections]),
            track=np.full(len(every), None, dtype=object),
            box=every.box,
            joints=every.joints,
            frames=numbers,
            bad=bad,
        )

    @property
    def ms(self) -> NDArray[np.int64]:
        """Return the milliseconds of each processed frame."""
        return np.array([frame.ms for frame in self.frames], dtype=np.int64)


def rounded_px(detections: Detections) -> Detections:
    """Return detections with pixels to a hundredth and scores to a ten-thousandth."""
    return Detections(detections.box.round(DIGITS_PX), detections.score.round(4), detections.joints.round(DIGITS_PX))


def seen_frames(
    source: PictureSource, detector: Detector, *, hz: float, tiles: Sequence[PictureTile], after: int = -1
) -> Iterator[SeenFrame]:
    """Yield what a detector finds in each picture of a source.

    Args:
        source: The pictures.
        detector: The detector.
        hz: As in `PictureSource.pictures`.
        tiles: Parts that the detector looks at one by one.
        after: Pictures up to this frame number are passed over.
    """
    for shot in source.pictures(hz, after=after):
        seen = None if shot.picture is None else rounded_px(detector.people(shot.picture, tiles=tiles))
        yield SeenFrame(shot.number, shot.ms, seen, shot.name)


def tiles_of_source(
    source: PictureSource, detector: Detector, *, hz: float, body_px: tuple[float, float] | None
) -> list[PictureTile]:
    """Return tiles for the bodies of a source.

    Args:
        source: The pictures.
        detector: The detector; its input says how large a body must be.
        hz: As in `PictureSource.pictures`.
        body_px: Height of small and of large bodies; None = as the detector finds them in the first pictures at once.
    """
    if body_px is None:
        shots = (shot.picture for shot in islice(source.pictures(hz), N_FIRST))
        boxes = [detector.people(picture).box for picture in shots if picture is not None]
        heights = np.concatenate([box[:, 3] - box[:, 1] for box in boxes]) if boxes else np.empty(0)
        if len(heights):
            small, large = np.quantile(heights, [0.1, 0.9])
            body_px = (float(small), float(large))
    return tiles_for(source.size_px, input_px=detector.decoder.preparation.size_px, body_px=body_px)
