"""What OpenPose writes of simulated people, with the faults of its real output.

Faults are drawn for each skeleton on its own: noise that grows with the body, joints that are missing, skeletons of
the upper half alone, a second skeleton on the same person, legs of the person beside, both feet on one leg, and
skeletons where nobody is. Nobody has an id.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from engine.simulated_people import SIZE, Scene
from numpy.typing import NDArray

Array = NDArray[np.float64]
LEGS = (9, 10, 11, 12, 13, 14, 19, 20, 21, 22, 23, 24)
FAR_SIDE = {9: 12, 10: 13, 11: 14, 22: 19, 23: 20, 24: 21}


@dataclass(frozen=True)
class Faults:
    """How often each fault is, as share of skeletons (`missing`: of joints); `noise` in lengths of a body."""

    noise: float = 0.015
    missing: float = 0.1
    half: float = 0.1
    doubles: float = 0.05
    merged: float = 0.02
    one_leg: float = 0.05
    ghosts: float = 0.05


NONE = Faults(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
USUAL = Faults()
MANY = Faults(noise=0.025, missing=0.3, half=0.2, doubles=0.1, merged=0.05, one_leg=0.1, ghosts=0.1)


def write_openpose(folder: Path, scene: Scene, *, faults: Faults, seed: int, every: int = 1) -> NDArray[np.intp]:
    """Write one file a frame, and return the row of the scene that each skeleton is of, -1 for ghosts.

    Args:
        folder: Is made.
        scene: Whom the camera sees, with ids.
        faults: What is wrong.
        seed: Of the faults.
        every: Frame numbers count so many from file to file, as of a video whose other frames were left out.
    """
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    owners: list[int] = []
    joints = scene.people.joints
    length = scene.box[:, 3] - scene.box[:, 1]
    for frame in scene.people.frames.tolist():
        rows = np.flatnonzero(scene.people.frame == frame)
        people: list[dict[str, object]] = []
        for row in rows.tolist():
            copies = 1 + int(rng.random() < faults.doubles)
            for copy in range(copies):
                body = joints[row] + rng.normal(0, faults.noise * length[row], (25, 2))
                if len(rows) > 1 and rng.random() < faults.merged:
                    away = np.linalg.norm(np.nan_to_num(joints[rows, 8] - joints[row, 8], nan=1e9), axis=1)
                    away[rows == row] = np.inf
                    body[list(LEGS)] = joints[rows[away.argmin()]][list(LEGS)]
                if rng.random() < faults.one_leg:
                    for right, left in FAR_SIDE.items():
                        body[right] = body[left] + rng.normal(0, 0.01 * length[row], 2)
                lost = rng.random(25) < faults.missing
                if rng.random() < faults.half:
                    lost[list(LEGS)] = True
                if copy:  # the second skeleton is a part of a body
                    lost |= rng.random(25) < 0.5
                    if lost.all():
                        continue
                body[lost] = np.nan
                people.append(_person(body, np.clip(rng.normal(0.7, 0.15, 25), 0.05, 1), rng))
                owners.append(row)
        for _ in range(rng.binomial(max(len(rows), 1), faults.ghosts)):
            high = rng.uniform(30, 300)
            body = joints[rng.choice(rows)] if len(rows) else np.full((25, 2), 100.0)
            size = float(np.nanmax(np.nanmax(body, axis=0) - np.nanmin(body, axis=0)))
            shape = np.nan_to_num(body - np.nanmean(body, axis=0)) / max(size, 1.0)
            ghost = rng.uniform(0, 1, 2) * SIZE + shape * high + rng.normal(0, 0.1 * high, (25, 2))
            ghost[rng.random(25) < rng.uniform(0.4, 0.9)] = np.nan
            if np.isfinite(ghost).any():
                people.append(_person(ghost, np.clip(rng.normal(0.2, 0.1, 25), 0.05, 1), rng))
                owners.append(-1)
        name = f"door_{frame * every:012}_keypoints.json"
        (folder / name).write_text(json.dumps({"version": 1.3, "people": people}))
    return np.array(owners, dtype=np.intp)


def _person(body: Array, confidence: Array, rng: np.random.Generator) -> dict[str, object]:
    known = np.isfinite(body).all(axis=1)
    flat = np.column_stack([np.where(known[:, None], body, 0.0), np.where(known, confidence, 0.0)]).round(3)
    empty: dict[str, object] = {f"{part}_keypoints_{d}d": [] for part in ("face", "hand_left") for d in (2, 3)}
    return {"person_id": [-1], "pose_keypoints_2d": flat.ravel().tolist(), **empty}
