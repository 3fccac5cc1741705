"""The people of a source of pictures, found by a detector, as the rest of the engine reads them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.detections import Detections, joined
from vsd_analytics.engine.people import People

DIGITS_PX = 2
"""Pixels are kept to a hundredth, so that a run that goes on after a stop gives the same bytes."""


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
    """

    frames: list[SeenFrame] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)

    def add(self, frame: SeenFrame) -> None:
        """Add a frame, or the name of one that cannot be read."""
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


def collected(frames: Iterable[SeenFrame], *, on_frame: Callable[[int], None]) -> PeopleOfPictures:
    """Return all frames; `on_frame` is told the people of each."""
    people = PeopleOfPictures()
    for frame in frames:
        people.add(frame)
        on_frame(0 if frame.detections is None else len(frame.detections))
    return people
