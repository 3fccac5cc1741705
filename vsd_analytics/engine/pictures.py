"""Pictures of one camera from a file: a video, a folder of pictures, or a single one, read once from the beginning.

A video's pictures have the times of its presentation time stamps, so a changing rate or a lost picture moves no other.
Pictures of a folder have the number that their name ends with (`picture_number`): a frame number, or an instant.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import cv2
import numpy as np

from vsd_analytics.engine.box_table import EPOCH_MS_FROM
from vsd_analytics.engine.frame_pictures import SUFFIXES, Picture
from vsd_analytics.engine.people import unusable
from vsd_analytics.errors import InputError, Where
from vsd_analytics.owners import is_there

VIDEO_SUFFIXES: Final = frozenset(
    {".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".ts", ".mts", ".mpg", ".mpeg", ".wmv", ".flv", ".3gp", ".mjpeg"}
)
EPOCH_S_FROM: Final = 1e9
"""Numbers in names from here on are seconds since 1970; from `EPOCH_MS_FROM` on milliseconds."""
SHORT_S: Final = 1.0
"""Containers state their number of pictures by their duration, so less than this at the end is not missing."""
EARLY_S: Final = 0.0005
"""A picture that comes this much before its turn is on time: stamps are rounded to milliseconds."""


@dataclass(frozen=True, slots=True)
class TimedPicture:
    """A picture and when it was.

    Attributes:
        number: Frame number: of a video its place, from 0.
        ms: Milliseconds since the source began; since 1970 where the source has a clock.
        picture: None where it cannot be read.
        name: What a message calls it.
    """

    number: int
    ms: int
    picture: Picture | None
    name: str


class PictureSource(Protocol):
    """Pictures in order of time."""

    has_clock: bool
    """Whether `TimedPicture.ms` are UTC milliseconds."""
    size_px: tuple[int, int]
    """Width and height of all pictures."""

    def n_pictures(self, hz: float) -> int | None:
        """Return about how many pictures `pictures` yields; None = not known."""

    def pictures(self, hz: float, *, after: int = -1) -> Iterator[TimedPicture]:
        """Yield pictures in order.

        Args:
            hz: Of a video, pictures a second; of numbered pictures, how many there were a second.
            after: Those up to this frame number are passed over.
        """


class VideoFile:
    """A video, of which the pictures nearest after 0, 1/hz, 2/hz, ... seconds are taken.

    Args:
        path: The video.

    Raises:
        InputError: It is no video (E205).
    """

    has_clock = False

    def __init__(self, path: Path) -> None:
        self.path = path
        video = cv2.VideoCapture(str(path))
        is_read, picture = video.read()
        if not is_read:
            raise InputError(
                f"cannot read {path.name} as a video",
                code="E205",
                where=Where(str(path)),
                fix="give a video that ffmpeg reads, complete, or a folder of pictures",
            )
        self.size_px = (int(picture.shape[1]), int(picture.shape[0]))
        self.rate_hz = float(video.get(cv2.CAP_PROP_FPS))
        self._length = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
        video.release()

    def n_pictures(self, hz: float) -> int | None:
        """Return about how many pictures are taken; None for a video that does not tell its length."""
        if self._length <= 0 or not self.rate_hz > 0:
            return None
        return max(1, math.ceil(self._length * min(1.0, hz / self.rate_hz)))

    def pictures(self, hz: float, *, after: int = -1) -> Iterator[TimedPicture]:
        """Yield the pictures that are due; those in between are decoded and not converted."""
        video = cv2.VideoCapture(str(self.path))
        number, last, begin_ms, at_ms = -1, -1, None, 0.0
        while video.grab():
            number += 1
            stamp_ms = float(video.get(cv2.CAP_PROP_POS_MSEC))
            begin_ms = stamp_ms if begin_ms is None else begin_ms
            if number and stamp_ms <= begin_ms and self.rate_hz > 0:  # a stream of pictures without stamps
                stamp_ms = begin_ms + 1000 * number / self.rate_hz
            at_ms = stamp_ms - begin_ms
            turn = math.floor((at_ms / 1000 + EARLY_S) * hz)
            if turn <= last:
                continue
            last = turn
            if number > after:
                is_read, picture = video.retrieve()
                yield TimedPicture(number, round(at_ms), _of(picture) if is_read else None, f"frame {number}")
        video.release()
        if number + 1 + SHORT_S * self.rate_hz < self._length:  # the file says about how many it has
            yield TimedPicture(number + 1, round(at_ms), None, f"frames {number + 1} to {self._length - 1}")


class PictureFiles:
    """Files of pictures, in order of the number that their names end with, or in order of names.

    Args:
        files: The pictures.
        path: What the user gave.

    Raises:
        InputError: There is none that can be read, or two have one number (E202).
    """

    def __init__(self, files: list[Path], path: Path) -> None:
        self.path = path
        numbers = [picture_number(file) for file in files]
        if any(number is None for number in numbers):
            numbers = list(range(len(files)))
        ordered = sorted(zip(numbers, files, strict=True), key=lambda pair: (pair[0], pair[1].name))
        self._files: list[tuple[int, Path]] = [(int(number or 0), file) for number, file in ordered]
        for (number, file), (following, other) in zip(self._files, self._files[1:], strict=False):
            if number == following:
                raise unusable(
                    path,
                    f"two pictures of {path.name} have one number: {file.name} and {other.name}",
                    fix="the last number in a name is that of the frame; give the pictures of one camera",
                )
        self.has_clock = bool(self._files) and all(number >= EPOCH_S_FROM for number, _ in self._files)
        first = next((picture for _, file in self._files if (picture := read_picture(file)) is not None), None)
        if first is None:
            raise unusable(path, f"{path.name} has no picture that can be read", fix="give PNG, JPEG or WebP files")
        self.size_px = (int(first.shape[1]), int(first.shape[0]))

    def n_pictures(self, hz: float) -> int | None:
        """Return how many files there are."""
        return len(self._files)

    def pictures(self, hz: float, *, after: int = -1) -> Iterator[TimedPicture]:
        """Yield all pictures; one of another size counts as one that cannot be read."""
        for place, (number, file) in enumerate(self._files):
            frame = place if self.has_clock else number
            if frame <= after:
                continue
            picture = read_picture(file)
            if picture is not None and (picture.shape[1], picture.shape[0]) != self.size_px:
                picture = None
            ms = _clock_ms(number) if self.has_clock else round(number * 1000 / hz)
            yield TimedPicture(frame, ms, picture, file.name)


def picture_number(file: Path) -> int | None:
    """Return the last run of digits in a picture's name, such as 12 in `door_000012.jpg`; None without digits."""
    runs = re.findall(r"[0-9]{1,15}", file.stem)
    return int(runs[-1]) if runs else None


def read_picture(file: Path) -> Picture | None:
    """Return a picture as it is stored, without turning it; None where it cannot be read."""
    try:
        picture: Any = cv2.imread(str(file), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:  # more pixels than OpenCV reads
        return None
    return None if picture is None else _of(picture)


def _clock_ms(number: int) -> int:
    return number if number >= EPOCH_MS_FROM else number * 1000


def _of(picture: Any) -> Picture:
    return np.asarray(picture, dtype=np.uint8)


def is_picture_source(path: Path) -> bool:
    """Return whether a path is a video, a picture, or a folder with pictures and without people of a detector."""
    if path.is_dir():
        names = [file.suffix.lower() for file in path.iterdir()]
        return any(name in SUFFIXES for name in names) and not {".json", ".txt", ".csv"} & set(names)
    return path.suffix.lower() in VIDEO_SUFFIXES | SUFFIXES


def picture_source(path: Path) -> PictureSource:
    """Return the pictures of a video, a folder or a single file.

    Raises:
        InputError: There is no such file (E201), or it has no pictures (E202, E205).
    """
    if not is_there(path):
        raise InputError(f"there is no file {path}", code="E201", where=Where(str(path)), fix="check the path")
    if path.is_dir():
        files = [file for file in path.iterdir() if file.suffix.lower() in SUFFIXES and not file.name.startswith(".")]
        return PictureFiles(files, path)
    return PictureFiles([path], path) if path.suffix.lower() in SUFFIXES else VideoFile(path)
