"""People as a detector saw them in the pictures of one camera: boxes, joints, or both.

Joints are in the order of OpenPose's BODY_25. Other skeletons are mapped to it. A joint that a detector did not find
is NaN, never (0, 0).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.errors import InputError, Where

Array = NDArray[np.float64]

N_JOINTS: Final = 25
NOSE, NECK, MID_HIP = 0, 1, 8
HEAD: Final = (0, 15, 16, 17, 18)
FEET: Final = (11, 14, 19, 20, 21, 22, 23, 24)
ANKLES: Final = (11, 14)
SHOULDERS: Final = (2, 5)
HIPS: Final = (9, 12)

COCO_17: Final = (0, 16, 15, 18, 17, 5, 2, 6, 3, 7, 4, 12, 9, 13, 10, 14, 11)
"""BODY_25 index of each COCO joint: nose, eyes, ears, shoulders, elbows, wrists, hips, knees, ankles, left first."""
HALPE_26: Final = (*COCO_17, -1, 1, 8, 19, 22, 20, 23, 21, 24)
"""The same for HALPE: COCO's, top of the head (BODY_25 has none), neck, hip, big toes, small toes, heels."""
BODY_25: Final = tuple(range(N_JOINTS))
BODY_25B: Final = (*COCO_17, -1, -1, 19, 20, 21, 22, 23, 24)
"""The same for OpenPose's BODY_25B: COCO's, upper neck and top of the head (BODY_25 has neither), toes and heels."""
OPENPOSE_COCO_18: Final = (0, 1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18)
OPENPOSE_MPI_15: Final = (-1, 1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14, -1)
"""The same for OpenPose's MPI: its first joint is the top of the head, its last the chest."""
SKELETONS: Final[Mapping[int, tuple[int, ...]]] = {
    15: OPENPOSE_MPI_15,
    17: COCO_17,
    18: OPENPOSE_COCO_18,
    25: BODY_25,
    26: HALPE_26,
    133: COCO_17,  # COCO whole body: its first 17, without face and hands
    136: HALPE_26,  # HALPE whole body
}
"""Order of joints by their number."""


def unusable(path: Path, what: str, *, fix: str, why: str | None = None) -> InputError:
    """Return the error (E202) of a file or folder that can be read but not used, as `what` says."""
    return InputError(what, code="E202", where=Where(str(path)), why=why, fix=fix)


@dataclass(frozen=True, slots=True)
class People:
    """Persons in the frames of one camera; one row per person and frame, in order of frames.

    Attributes:
        frame: Frame number of each person, shape (n,).
        track: Track id of each person; None without tracking, shape (n,), objects.
        box: Left, top, right, bottom in pixels; NaN where the detector gave none, shape (n, 4).
        joints: x, y in pixels, NaN where missing, shape (n, 25, 2).
        frames: Numbers of all processed frames in order, also those without people.
        ts_ms: UTC milliseconds of each of `frames`; None when the file has frame numbers only.
        bad: Rows that could not be used, by reason.
    """

    frame: NDArray[np.int64]
    track: NDArray[np.object_]
    box: Array
    joints: Array
    frames: NDArray[np.int64]
    ts_ms: NDArray[np.int64] | None = None
    bad: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def has_joints(self) -> bool:
        """Return whether any person has a joint."""
        return bool(np.isfinite(self.joints).any())

    @property
    def outline(self) -> Array:
        """Return each person's box, else the smallest box around the joints, shape (n, 4)."""
        is_known = np.isfinite(self.joints)
        low = np.where(is_known, self.joints, np.inf).min(axis=1)
        high = np.where(is_known, self.joints, -np.inf).max(axis=1)
        around = np.concatenate([low, high], axis=1)
        around = np.where(np.isfinite(around), around, np.nan)
        return np.where(np.isfinite(self.box), self.box, around)

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> People:
        """Return some of the persons, over the same frames."""
        return replace(
            self, frame=self.frame[chosen], track=self.track[chosen], box=self.box[chosen], joints=self.joints[chosen]
        )

    def between(self, first_ms: int | None, end_ms: int | None) -> People:
        """Return the frames of [first_ms, end_ms) and their persons; None = no limit. Needs `ts_ms`."""
        if self.ts_ms is None:
            raise ValueError("frames without times")
        low = 0 if first_ms is None else int(np.searchsorted(self.ts_ms, first_ms))
        high = len(self.frames) if end_ms is None else int(np.searchsorted(self.ts_ms, end_ms))
        frames = self.frames[low:high]
        some = self.rows(np.flatnonzero(np.isin(self.frame, frames)))
        return replace(some, frames=frames, ts_ms=self.ts_ms[low:high])


def joints_of(points: Array, confidence: Array, order: Sequence[int] | None = None) -> Array | None:
    """Return one person's joints in the order of BODY_25.

    A joint with confidence 0 or below, with both coordinates 0, or with a coordinate that is not finite is missing.
    Skeletons without neck and hip centre get the middle of the shoulders and of the hips.

    Args:
        points: Pixels, shape (k, 2).
        confidence: Shape (k,).
        order: BODY_25 index of each joint, -1 for none; None = by the number of joints.

    Returns:
        Shape (25, 2), NaN where missing; None for a number of joints that no known skeleton has.
    """
    order = SKELETONS.get(len(points)) if order is None else order
    if order is None:
        return None
    is_missing = (confidence <= 0) | ~np.isfinite(confidence) | (points == 0).all(axis=1) | ~np.isfinite(points).all(1)
    known = np.where(is_missing[:, None], np.nan, points)[: len(order)]
    joints = np.full((N_JOINTS, 2), np.nan)
    target = np.array(order)
    joints[target[target >= 0]] = known[target >= 0]
    for middle, sides in ((NECK, SHOULDERS), (MID_HIP, HIPS)):
        if middle not in order:
            joints[middle] = joints[list(sides)].mean(axis=0)
    return joints


def is_body_25b(joints: Array) -> bool:
    """Return whether skeletons read as BODY_25 are BODY_25B: joints 1 and 2 nearer to the nose than 15 and 16.

    In BODY_25 these are neck and shoulder, and the eyes; in BODY_25B the eyes, and the ankles.

    Args:
        joints: Shape (n, 25, 2), NaN where missing.
    """
    away = np.linalg.norm(joints[:, [1, 2, 15, 16]] - joints[:, :1], axis=2)
    known = away[np.isfinite(away).all(axis=1)]
    return bool(len(known)) and bool(np.mean(known[:, :2].max(axis=1) < known[:, 2:].min(axis=1)) > 0.5)


def from_body_25b(joints: Array) -> Array:
    """Return skeletons of BODY_25B in the order of BODY_25, shape (n, 25, 2)."""
    everywhere = np.ones(N_JOINTS)
    turned = [skeleton for one in joints if (skeleton := joints_of(one, everywhere, order=BODY_25B)) is not None]
    return np.array(turned).reshape(joints.shape)


@dataclass
class PeopleRows:
    """Collects persons and frames one by one; `people` makes arrays of them.

    With `keeps_empty`, a person without a usable box or joint has a row, too, so that others keep their place in the
    frame.
    """

    frame: list[int] = field(default_factory=list)
    track: list[str | None] = field(default_factory=list)
    box: list[Sequence[float]] = field(default_factory=list)
    joints: list[Array] = field(default_factory=list)
    frames: set[int] = field(default_factory=set)
    bad: Counter[str] = field(default_factory=Counter)
    n_joints: set[int] = field(default_factory=set)
    keeps_empty: bool = False

    def add(self, frame: int, *, track: object = None, box: Sequence[float] | None, joints: Array | None) -> None:
        """Add a person; one without a usable box or joint is counted as bad."""
        usable_box = box is not None and bool(np.isfinite(box).all()) and box[2] > box[0] and box[3] > box[1]
        if not usable_box and (joints is None or not np.isfinite(joints).any()):
            self.skip(frame, "neither a box nor a joint")
            return
        self._append(frame, None if track is None else str(track), box if usable_box else None, joints)

    def skip(self, frame: int, why: str) -> None:
        """Count a person as bad; with `keeps_empty`, add a row without box and joints."""
        self.bad[why] += 1
        if self.keeps_empty:
            self._append(frame, None, None, None)

    def _append(self, frame: int, track: str | None, box: Sequence[float] | None, joints: Array | None) -> None:
        self.frame.append(frame)
        self.track.append(track)
        self.box.append((np.nan,) * 4 if box is None else box)
        self.joints.append(np.full((N_JOINTS, 2), np.nan) if joints is None else joints)

    def people(self) -> People:
        """Return what was added, in order of frames."""
        order = np.argsort(np.array(self.frame, dtype=np.int64), kind="stable")
        if self._one_id_for_everybody() or self._ids_are_places():
            self.track = [None] * len(self.track)
        joints = np.array(self.joints, dtype=np.float64).reshape(-1, N_JOINTS, 2)
        is_other_25 = self.n_joints == {N_JOINTS} and is_body_25b(joints)
        track = np.empty(len(order), dtype=object)
        track[:] = self.track
        return People(
            frame=np.array(self.frame, dtype=np.int64)[order],
            track=track[order],
            box=np.array(self.box, dtype=np.float64).reshape(-1, 4)[order],
            joints=(from_body_25b(joints) if is_other_25 else joints)[order],
            frames=np.array(sorted(self.frames | set(self.frame)), dtype=np.int64),
            bad=dict(self.bad),
        )

    def _one_id_for_everybody(self) -> bool:
        """Return whether several persons of a frame all have the only id there is: the tool did not track."""
        return len(set(self.track)) == 1 and len(set(self.frame)) < len(self.frame)

    def _ids_are_places(self) -> bool:
        """Return whether ids are the places in the list of each frame, 0, 1, 2, in lists of different lengths.

        The tool did not track then. In lists of one length they may be the ids of people who stay.
        """
        ids: dict[int, list[str | None]] = {}
        for frame, track in zip(self.frame, self.track, strict=True):
            ids.setdefault(frame, []).append(track)
        lengths = {len(frame_ids) for frame_ids in ids.values()}
        return len(lengths) > 2 and all(
            frame_ids == [str(i) for i in range(len(frame_ids))] for frame_ids in ids.values()
        )
