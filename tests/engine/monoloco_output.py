"""Monoloco's files of a simulated scene: what its network would write, with errors along the view."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from engine.simulated_people import Array, Scene, SimulatedCamera

from vsd_analytics.engine.people import COCO_17


def camera_axes(camera: SimulatedCamera, xyz: Array) -> Array:
    """Return points of the floor's axes in camera axes."""
    t, r = np.radians(camera.tilt_deg), np.radians(camera.roll_deg)
    level = np.array([[1, 0, 0], [0, -np.sin(t), -np.cos(t)], [0, np.cos(t), -np.sin(t)]])
    turn = np.array([[np.cos(r), np.sin(r), 0], [-np.sin(r), np.cos(r), 0], [0, 0, 1]])
    return np.asarray((xyz - [0, 0, camera.height_m]) @ (turn @ level).T)


def write_monoloco(
    folder: Path,
    scene: Scene,
    *,
    spread: float = 0.05,
    seed: int = 0,
    names: tuple[str, str] = ("xyz_pred", "dds_pred"),
) -> Array:
    """Write one file a frame, with Laplace errors of scale `spread` times the distance; return the errors, metres."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    people = scene.people
    heights = rng.normal(0.9, 0.05, len(people))
    middle = camera_axes(scene.camera, np.column_stack([scene.xy, heights]))
    true = np.linalg.norm(middle, axis=1)
    found = true + rng.laplace(0, spread * true) if spread else true
    xyz = middle * (found / true)[:, None]
    for number in people.frames.tolist():
        rows = np.flatnonzero(people.frame == number)
        content: dict[str, object] = {}
        if len(rows):
            joints = people.joints[rows][:, list(COCO_17)]
            known = np.isfinite(joints).all(axis=2)
            keypoints = np.concatenate([np.nan_to_num(joints), np.where(known, 0.9, 0.0)[..., None]], axis=2)
            content = {
                "gt": [False] * len(rows),
                "boxes": [[*box, 0.9] for box in scene.box[rows].round(1).tolist()],
                names[1]: found[rows].tolist(),
                names[0]: xyz[rows].tolist(),
                "stds_ale": (spread * found[rows]).tolist(),
                "stds_epi": [0.0] * len(rows),
                "uv_kps": np.swapaxes(keypoints, 1, 2).tolist(),
                "social_distance": [bool(row % 2) for row in rows],
            }
        (folder / f"door_{number:06d}.png.monoloco.json").write_text(json.dumps(content))
    return np.asarray(found - true)
