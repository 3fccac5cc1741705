"""People with 3-D skeletons in the picture of a simulated camera: joints, boxes, and where everybody really is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from engine.simulated_arms import ARMS, ELBOWS_AND_WRISTS, arms_of, behind_trunk, elbows_and_wrists
from numpy.typing import NDArray

from vsd_analytics.engine.people import N_JOINTS, People

Array = NDArray[np.float64]
SIZE = (1920, 1080)
HIDDEN_MISSING = 0.9
"""Share of hidden joints that a detector does not find."""

# BODY_25 joints of a standing person of height 1: to the right, ahead, up
_RIGHT = {2: (-0.11, 0.0, 0.82), 3: (-0.13, 0.0, 0.63), 4: (-0.13, 0.03, 0.47), 9: (-0.06, 0.0, 0.53)}
_RIGHT |= {10: (-0.06, 0.0, 0.285), 11: (-0.06, 0.0, 0.045), 22: (-0.07, 0.10, 0.01), 23: (-0.09, 0.09, 0.01)}
_RIGHT |= {24: (-0.06, -0.02, 0.015), 15: (-0.02, 0.06, 0.94), 17: (-0.045, 0.0, 0.93)}
_MIRROR = {2: 5, 3: 6, 4: 7, 9: 12, 10: 13, 11: 14, 22: 19, 23: 20, 24: 21, 15: 16, 17: 18}
_MIDDLE = {0: (0.0, 0.07, 0.92), 1: (0.0, 0.0, 0.84), 8: (0.0, 0.0, 0.53)}


def skeleton() -> Array:
    joints = np.zeros((N_JOINTS, 3))
    for i, at in {**_RIGHT, **_MIDDLE}.items():
        joints[i] = at
    for i, j in _MIRROR.items():
        joints[j] = joints[i] * (-1, 1, 1)
    return joints


@dataclass(frozen=True)
class SimulatedCamera:
    """A pinhole camera above (0, 0) that looks along +y; the picture has 1920 x 1080 pixels.

    `tilt_deg` is down from level, `roll_deg` clockwise, `f_widths` the focal length in picture widths, `k1` the radial
    distortion of OpenCV's model.
    """

    height_m: float = 4.0
    tilt_deg: float = 25.0
    roll_deg: float = 0.0
    f_widths: float = 1.0
    k1: float = 0.0

    def matrix(self) -> Array:
        """Return the 3x4 projection without distortion."""
        t, r = np.radians(self.tilt_deg), np.radians(self.roll_deg)
        level = np.array([[1, 0, 0], [0, -np.sin(t), -np.cos(t)], [0, np.cos(t), -np.sin(t)]])
        turn = np.array([[np.cos(r), np.sin(r), 0], [-np.sin(r), np.cos(r), 0], [0, 0, 1]])
        rotation = turn @ level
        f = self.f_widths * SIZE[0]
        k = np.array([[f, 0, SIZE[0] / 2], [0, f, SIZE[1] / 2], [0, 0, 1]])
        return np.asarray(k @ np.column_stack([rotation, -rotation @ np.array([0, 0, self.height_m])]))

    def homography(self) -> Array:
        return np.asarray(np.linalg.inv(self.matrix()[:, [0, 1, 3]]))

    def project(self, xyz: Array) -> Array:
        """Return pixels, NaN behind the camera; shape (..., 2)."""
        seen = np.concatenate([xyz, np.ones((*xyz.shape[:-1], 1))], axis=-1) @ self.matrix().T
        uv = seen[..., :2] / np.where(seen[..., 2:] > 0.1, seen[..., 2:], np.nan)
        f, middle = self.f_widths * SIZE[0], np.array(SIZE) / 2
        off = (uv - middle) / f
        return np.asarray(middle + off * (1 + self.k1 * np.sum(off**2, axis=-1, keepdims=True)) * f)

    def straightened(self, uv: Array) -> Array:
        """Return pixels without the distortion, by Newton's method; shape (..., 2)."""
        f, middle = self.f_widths * SIZE[0], np.array(SIZE) / 2
        off = (uv - middle) / f
        bent = np.linalg.norm(off, axis=-1, keepdims=True)
        straight = bent.copy()
        for _ in range(20):
            straight -= (straight * (1 + self.k1 * straight**2) - bent) / (1 + 3 * self.k1 * straight**2)
        return np.asarray(middle + off * np.where(bent > 0, straight / np.maximum(bent, 1e-12), 1) * f)

    def to_floor(self, uv: Array) -> Array:
        q = np.column_stack([uv, np.ones(len(uv))]) @ self.homography().T
        return np.asarray(q[:, :2] / q[:, 2:])


def upright_boxes(camera: SimulatedCamera, feet: Array, *, wide_px: float = 60.0, high_px: float = 180.0) -> Array:
    """Return boxes around upright bodies without depth whose feet are at pixels, shape (n, 4)."""
    down = camera.matrix()[:, 2]
    below = down[:2] / down[2]  # where verticals meet
    top = feet + (feet - below) * (-high_px / (feet - below)[:, 1:])
    middle = (feet[:, 0] + top[:, 0]) / 2
    return np.column_stack([middle - wide_px / 2, top[:, 1], middle + wide_px / 2, feet[:, 1]])


def surface() -> Array:
    """Return points on the outside of a body of height 1, beside the joints: head with hair, shoulders, hips, shoes."""
    turn = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(8)])
    head = [ring * 0.055 * np.sqrt(1 - z**2) + (0, 0.01, 0.95 + 0.06 * z) for z in (0.0, 0.6, 0.9, 1.0)]
    trunk = [ring * (0.14, 0.08, 0) + (0, 0, z) for z in (0.55, 0.65, 0.8)]
    return np.concatenate([*head, *trunk])


@dataclass(frozen=True)
class Scene:
    """What the camera saw, and the floor position of each person in it, shape (n, 2), metres.

    The people have joints and no boxes; `box` are those around their whole bodies, shape (n, 4).
    """

    people: People
    box: Array
    xy: Array
    camera: SimulatedCamera


def simulate(
    camera: SimulatedCamera,
    *,
    seed: int,
    n_tracks: int = 60,
    hz: float = 2.0,
    seconds: float = 20.0,
    reach_m: float = 18.0,
    noise_px: float = 2.0,
    missing: float = 0.05,
    hidden_missing: float = HIDDEN_MISSING,
    children: float = 0.0,
    sitting: float = 0.0,
    standing: float = 0.2,
) -> Scene:
    """Let people of different height walk in all directions, and return what is seen of them inside the picture.

    Adults are 1.70 +- 0.08 m, children 1.20 +- 0.15 m. Sitting people have 0.75 of their height and do not move. The
    share `missing` of all joints is missing, and `hidden_missing` of those of arms that the own trunk hides.
    """
    rng = np.random.default_rng(seed)
    low = nearest_m(camera)
    starts = floor_places(camera, n_tracks, low, reach_m, rng)
    heights = np.where(
        rng.random(n_tracks) < children, rng.normal(1.2, 0.15, n_tracks), rng.normal(1.7, 0.08, n_tracks)
    )
    sits = rng.random(n_tracks) < sitting
    moves = (rng.random(n_tracks) >= standing) & ~sits
    heading = rng.uniform(0, 2 * np.pi, n_tracks)
    speed = np.where(moves, rng.normal(1.3, 0.2, n_tracks), 0.0)
    frames = np.arange(round(hz * seconds))
    begin = rng.uniform(-seconds / 2, seconds / 2, n_tracks)
    rows: list[tuple[int, int]] = []
    places: list[Array] = []
    joints: list[Array] = []
    boxes: list[Array] = []
    shape = np.concatenate([skeleton(), surface()])
    own = np.random.default_rng([seed, 1])  # of its own, so that arms change nothing else
    walk, stand = arms_of(n_tracks, own)
    arms = np.where(moves[:, None, None], walk, stand)
    for frame in frames:
        t = frame / hz
        turn = heading + 0.15 * np.sin(t / 3 + begin)
        ahead = np.column_stack([np.cos(turn), np.sin(turn)])
        xy = starts + ahead * (speed * (t - seconds / 2 - begin))[:, None]
        step = np.sin(2 * np.pi * t * 0.9 + np.arange(n_tracks)) * moves
        hands = elbows_and_wrists(arms, step)
        for i in range(n_tracks):
            size = heights[i] * np.array([1, 1, 0.75 if sits[i] else 1.0])
            shape[list(ELBOWS_AND_WRISTS)] = hands[i]
            body = shape * size
            side = np.array([ahead[i, 1], -ahead[i, 0]])
            swing = 0.12 * heights[i] * step[i]
            flat = body[:, :1] * side + body[:, 1:2] * ahead[i]
            legs = np.array([11, 22, 23, 24]), np.array([14, 19, 20, 21])
            flat[legs[0]] += swing * ahead[i]
            flat[legs[1]] -= swing * ahead[i]
            uv = camera.project(np.column_stack([flat + xy[i], body[:, 2]]))
            if not np.all((uv > 0) & (uv < SIZE)):  # NaN is outside
                continue
            boxes.append(np.concatenate([uv.min(axis=0), uv.max(axis=0)]) + rng.normal(0, noise_px, 4))
            uv = uv[:N_JOINTS] + rng.normal(0, noise_px, (N_JOINTS, 2))
            uv[rng.random(N_JOINTS) < missing] = np.nan
            lens = np.array([-side @ xy[i], -ahead[i] @ xy[i], camera.height_m]) / size
            is_hidden = behind_trunk(shape[None, ARMS], lens[None])[0]
            uv[ARMS, :] = np.where((is_hidden & (own.random(len(ARMS)) < hidden_missing))[:, None], np.nan, uv[ARMS, :])
            rows.append((int(frame), i))
            places.append(xy[i])
            joints.append(uv)
    joint = np.array(joints).reshape(-1, N_JOINTS, 2)
    track = np.empty(len(rows), dtype=object)
    track[:] = [str(i) for _, i in rows]
    people = People(
        frame=np.array([f for f, _ in rows], dtype=np.int64),
        track=track,
        box=np.full((len(rows), 4), np.nan),
        joints=joint,
        frames=frames.astype(np.int64),
    )
    return Scene(people, np.array(boxes).reshape(-1, 4), np.array(places).reshape(-1, 2), camera)


def boxes_only(scene: Scene) -> People:
    """Return the same people as boxes without joints."""
    people = scene.people
    return People(people.frame, people.track, scene.box, np.full_like(people.joints, np.nan), people.frames)


def nearest_m(camera: SimulatedCamera) -> float:
    uv = np.array([[SIZE[0] / 2, SIZE[1] * 0.98]])
    return float(camera.to_floor(uv)[0, 1])


def floor_places(camera: SimulatedCamera, n: int, low: float, reach_m: float, rng: np.random.Generator) -> Array:
    """Return floor positions spread over what the camera sees up to `reach_m` behind the nearest floor it sees."""
    y = low + (reach_m - 0.5) * rng.random(n) ** 0.8 + 0.5
    t = np.radians(camera.tilt_deg)
    depth = y * np.cos(t) + camera.height_m * np.sin(t)
    half = depth / camera.f_widths / 2
    return np.column_stack([rng.uniform(-0.85, 0.85, n) * half, y])
