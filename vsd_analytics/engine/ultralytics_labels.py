"""Labels that ultralytics writes with `save_txt`: one text file per frame in which somebody was found.

A line is `class xc yc width height`, then 17 joints of `x y confidence` if it is a pose, then the confidence of the
person and the track id if they were asked for. All coordinates are shares of the picture.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from vsd_analytics.engine.people import Array, People, PeopleRows, joints_of, unusable
from vsd_analytics.errors import UsageError

PERSON_CLASS = 0
N_BOX, N_POSE = 5, 5 + 17 * 3


def read_labels(folder: Path, *, size_px: tuple[int, int] | None) -> People:
    """Read a folder of labels; a frame without a file had nobody in it.

    Args:
        folder: The text files; the frame number is the last run of digits of a name.
        size_px: Width and height of the picture.

    Raises:
        UsageError: The size is not given (E101).
        InputError: No line can be used (E202).
    """
    if size_px is None:
        raise UsageError(
            f"{folder.name} holds shares of the picture, and its size is not known", fix="--size 1920x1080"
        )
    rows = PeopleRows()
    for path in sorted(folder.glob("*.txt")):
        digits = re.findall(r"\d+", path.stem)
        if not digits:
            rows.bad["file without a number in its name"] += 1
            continue
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                values = np.array([float(word) for word in line.split()])
            except ValueError:
                values = np.empty(0)
            if len(values) < N_BOX:
                rows.bad["line that is no label"] += 1
            elif values[0] == PERSON_CLASS:
                _add(rows, int(digits[-1]), values, np.array(size_px, dtype=np.float64))
    if not rows.frame:
        raise unusable(folder, f"{folder.name} has no person", fix="give a folder of save_txt")
    numbers = rows.frame
    rows.frames.update(range(min(numbers), max(numbers) + 1))
    return rows.people()


def _add(rows: PeopleRows, frame: int, values: Array, size: Array) -> None:
    middle, extent = values[1:3] * size, values[3:5] * size
    box = np.concatenate([middle - extent / 2, middle + extent / 2]).tolist()
    is_pose = len(values) >= N_POSE
    rest = values[N_POSE:] if is_pose else values[N_BOX:]
    joints = None
    if is_pose:
        triples = values[N_BOX:N_POSE].reshape(-1, 3)
        joints = joints_of(triples[:, :2] * size, triples[:, 2])
    track = int(rest[1]) if len(rest) == 2 else None
    rows.add(frame, track=track, box=box, joints=joints)
