"""What a detector found so far, in a file beside the result, so that a run that was stopped goes on where it was.

The first line says of what: source, model and settings. A journal of anything else is begun again. It holds boxes and
joints and no picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np

from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.people import N_JOINTS
from vsd_analytics.engine.people_of_pictures import SeenFrame
from vsd_analytics.store.durable import file_digest


class DetectionJournal:
    """Frames of one run, each on disk before the next one is looked at.

    Args:
        path: The file.
        about: What the frames depend on.
    """

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        self.path = path
        self.frames: list[SeenFrame] = []
        header = msgspec.json.encode(dict(about), order="sorted") + b"\n"
        lines = path.read_bytes().splitlines(keepends=True) if path.is_file() else []
        if lines and lines[0] == header:
            whole = [line for line in lines[1:] if line.endswith(b"\n")]  # the last one may be torn
            self.frames = [_frame(line) for line in whole]
            lines = [header, *whole]
        else:
            lines = [header]
        self._file: BinaryIO = path.open("wb")
        self._file.write(b"".join(lines))
        self._file.flush()

    @property
    def last(self) -> int:
        """Return the number of the last frame; -1 without any."""
        return self.frames[-1].number if self.frames else -1

    def add(self, frame: SeenFrame) -> None:
        """Write a frame."""
        self._file.write(_line(frame))
        self._file.flush()
        self.frames.append(frame)

    def close(self) -> None:
        """Close the file; it stays until its frames are where they belong."""
        self._file.close()


def about_run(source: Path, models: list[Path], **settings: Any) -> dict[str, Any]:
    """Return what the frames of a run depend on: names, sizes and times of the source, bytes of models, settings."""
    files = sorted(source.iterdir()) if source.is_dir() else [source]
    stats = [file.stat() for file in files]
    return {
        "source": [[file.name, stat.st_size, stat.st_mtime_ns] for file, stat in zip(files, stats, strict=True)],
        "models": [file_digest(model) for model in models],
        **settings,
    }


def _line(frame: SeenFrame) -> bytes:
    seen: dict[str, Any] = {"frame": frame.number, "ms": frame.ms, "name": frame.name}
    if frame.detections is not None:
        joints = frame.detections.joints
        has_joints = bool(np.isfinite(joints).any())
        seen |= {"box": frame.detections.box.tolist(), "score": frame.detections.score.tolist()}
        seen |= {"joints": joints.tolist() if has_joints else None}
    return msgspec.json.encode(seen) + b"\n"  # NaN becomes null


def _frame(line: bytes) -> SeenFrame:
    seen = msgspec.json.decode(line)
    detections = None
    if "box" in seen:
        joints = None
        if seen["joints"] is not None:
            joints = np.array(seen["joints"], dtype=np.float64).reshape(-1, N_JOINTS, 2)
        detections = Detections.of(np.array(seen["box"], dtype=np.float64), np.array(seen["score"]), joints)
    return SeenFrame(seen["frame"], seen["ms"], detections, seen["name"])
