"""The camera's pictures of single frames: a folder of picture files, or a video.

A picture belongs to the frame whose number its name ends with, such as 12 in `door_000012.jpg`: the rule of
`joint_files`. Where frames are known by time only, the number is their time in UTC milliseconds or seconds. Of a video
the first picture is frame 0.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import People, unusable
from vsd_analytics.errors import InputError, Where
from vsd_analytics.owners import is_there

Picture = NDArray[np.uint8]
"""Blue, green, red, shape (height, width, 3)."""
SUFFIXES: Final = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff"})
SAME_SHAPE: Final = 0.01
"""Pictures whose proportions differ more than this from the camera's show something else."""


class FramePictures(Protocol):
    """Pictures by frame, asked for in the order of frames."""

    def of_frame(self, frame: int) -> Picture | None:
        """Return the picture of a frame by its number in `People.frames`, None where there is none."""


class NoPictures:
    """No frame has a picture."""

    def of_frame(self, frame: int) -> Picture | None:
        """Return None."""
        return None


class PictureFolder:
    """Picture files, of which one at a time is in memory.

    Args:
        folder: The folder, of which files that are no pictures are passed over; or one picture.
        people: Whose frames they are.

    Raises:
        InputError: Two pictures belong to one frame, or none to any (E202).
    """

    def __init__(self, folder: Path, people: People) -> None:
        inside = [folder] if folder.is_file() else folder.iterdir()
        files = sorted(p for p in inside if p.suffix.lower() in SUFFIXES)
        frame_of = _frames_by_number(people)
        self._files: dict[int, Path] = {}
        for index, path in enumerate(files):
            digits = re.findall(r"\d+", path.stem)
            frame = frame_of.get(int(digits[-1]) if digits else index)
            if frame is None:
                continue
            if frame in self._files:
                raise unusable(
                    folder,
                    f"two pictures in {folder} belong to one frame: {self._files[frame].name} and {path.name}",
                    fix="the last number in a name is that of the frame; give a folder with the pictures of one camera",
                )
            self._files[frame] = path
        if not self._files:
            first = f"such as {files[0].name}, " if files else ""
            raise _none_fits(folder, f"it has {len(files):,} pictures, {first}and frames are numbered", people)

    def of_frame(self, frame: int) -> Picture | None:
        """Return the picture of a frame as it is stored; None without a file, or where it cannot be read."""
        path = self._files.get(frame)
        if path is None:
            return None
        # as stored: the pixels of people know nothing of a photo's orientation tag
        picture: Any = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        return None if picture is None else np.asarray(picture, dtype=np.uint8)


class VideoPictures:
    """The pictures of a video, read once from its beginning on.

    Args:
        path: The video.
        people: Whose frames they are.

    Raises:
        InputError: It is no video (E205), or ends before the first frame (E202).
    """

    def __init__(self, path: Path, people: People) -> None:
        self._video = cv2.VideoCapture(str(path))
        if not self._video.isOpened():
            fix = "give a video that OpenCV reads, or a folder of pictures"
            raise InputError(f"cannot read {path.name} as a video", code="E205", where=Where(str(path)), fix=fix)
        rate = float(self._video.get(cv2.CAP_PROP_FPS))
        numbers = people.frames
        if people.ts_ms is not None and len(people.ts_ms):
            since_s = (people.ts_ms - people.ts_ms[0]) / 1000
            numbers = np.round(since_s * rate).astype(np.int64)  # the first frame of the file begins the video
        length = int(self._video.get(cv2.CAP_PROP_FRAME_COUNT))
        if len(numbers) and 0 < length <= numbers[0]:
            raise _none_fits(path, f"it has {length:,} pictures, and frames are numbered", people)
        self._place = dict(zip(people.frames.tolist(), numbers.tolist(), strict=True))
        self._next = 0

    def of_frame(self, frame: int) -> Picture | None:
        """Return the picture of a frame; None after the end, and for a frame before the one asked for last."""
        number = self._place[frame]
        while self._next < number and self._video.grab():
            self._next += 1
        if self._next != number:
            return None
        is_read, picture = self._video.read()
        self._next += 1
        return np.asarray(picture, dtype=np.uint8) if is_read else None


def frame_pictures(source: Path | None, people: People) -> FramePictures:
    """Return the pictures of frames.

    Args:
        source: A folder of pictures or a video; None = no pictures.
        people: Whose frames they are.

    Raises:
        InputError: There is no such file (E201), it cannot be read (E205), or fits no frame (E202).
    """
    if source is None:
        return NoPictures()
    if not is_there(source):
        raise InputError(
            f"there is no file {source}", code="E201", where=Where(str(source)), fix="check the path of --pictures"
        )
    has_files = source.is_dir() or source.suffix.lower() in SUFFIXES
    return PictureFolder(source, people) if has_files else VideoPictures(source, people)


def fitted(picture: Picture, size_px: tuple[int, int], *, source: Path) -> Picture:
    """Return a picture in the size that the people's pixels are of.

    Raises:
        InputError: It has other proportions (E202).
    """
    height, width = picture.shape[:2]
    if (width, height) == size_px:
        return picture
    if abs(width * size_px[1] / (height * size_px[0]) - 1) > SAME_SHAPE:
        raise unusable(
            source,
            f"the pictures of {source.name} are {width}x{height} pixels, and people are in {size_px[0]}x{size_px[1]}",
            why="the proportions differ, so people would be drawn in the wrong places",
            fix="give the pictures that the detector saw, or --size",
        )
    return np.asarray(cv2.resize(picture, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _frames_by_number(people: People) -> dict[int, int]:
    """Return the frame that each number in a picture's name means."""
    if people.ts_ms is None:
        return {frame: frame for frame in people.frames.tolist()}
    timed = list(zip(people.ts_ms.tolist(), people.frames.tolist(), strict=True))
    return {ms // 1000: frame for ms, frame in timed if ms % 1000 == 0} | dict(timed)


def _none_fits(source: Path, what: str, people: People) -> InputError:
    numbers = people.frames if people.ts_ms is None else people.ts_ms
    span = f"{numbers[0]} to {numbers[-1]}" if len(numbers) else "by nothing"
    return unusable(
        source,
        f"no picture of {source.name} belongs to a frame",
        why=f"{what} {span}",
        fix="the last number in a picture's name must be that of its frame",
    )
