"""A camera over a week of opening hours: who passes changes by the hour, and somebody may knock the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from engine.simulated_people import SIZE, SimulatedCamera, floor_places, nearest_m, skeleton, surface

from vsd_analytics.engine.people import People

MONDAY_MS = 1_762_732_800_000  # 2025-11-10, a Monday
OPEN = range(9, 21)


def simulate_week(
    camera: SimulatedCamera,
    *,
    seed: int,
    days: int = 7,
    people_an_hour: int = 40,
    moved_h: float | None = None,
    tilt_deg: float = 0.0,
    roll_deg: float = 0.0,
    noise_px: float = 2.0,
    reach_m: float = 15.0,
) -> People:
    """Return boxes with times of people who walk through, four pictures of each, two seconds apart.

    In the afternoon up to 40 % are children, and from 12 to 14 up to half sit at one end of the floor. How many come,
    and where they walk, changes by the hour and at random from day to day.

    Args:
        camera: As it hangs on Monday.
        seed: Of everything drawn.
        days: From Monday on.
        people_an_hour: Mean.
        moved_h: Hours after Monday 00:00 UTC from which the camera is turned; None = never.
        tilt_deg: By how much further down.
        roll_deg: By how much clockwise.
        noise_px: Of each side of a box.
        reach_m: Depth of the floor.
    """
    rng = np.random.default_rng(seed)
    busy = rng.uniform(0.3, 1.7, 24)
    children = 0.05 + rng.uniform(0, 0.35) * np.exp(-(((np.arange(24) - 16) / 1.5) ** 2))
    sitting = np.where((np.arange(24) >= 12) & (np.arange(24) < 14), rng.uniform(0, 0.5), 0.02)
    depth_of_hour = np.exp(rng.normal(0, 0.4, 24))
    low = nearest_m(camera)
    start, when = [], []
    for day in range(days):
        for hour in OPEN:
            n = rng.poisson(people_an_hour * busy[hour] * np.exp(rng.normal(0, 0.2)))
            start.append((day * 24 + hour + np.sort(rng.random(n))) * 3600)
            when.append(np.full(n, hour))
    begin_s, hour_of = np.concatenate(start), np.concatenate(when)
    n = len(begin_s)
    xy = floor_places(camera, n, low, reach_m, rng)
    pushed = (
        low + 0.5 + (reach_m - 0.5) * ((xy[:, 1] - low - 0.5) / (reach_m - 0.5)).clip(0, 1) ** depth_of_hour[hour_of]
    )
    xy *= (pushed / xy[:, 1])[:, None]
    is_child, sits = rng.random(n) < children[hour_of], rng.random(n) < sitting[hour_of]
    xy[sits] *= ((low + reach_m * rng.uniform(0.7, 0.9, sits.sum())) / xy[sits, 1])[:, None]
    tall = np.where(is_child, rng.normal(1.2, 0.15, n), rng.normal(1.7, 0.08, n))
    heading, speed = rng.uniform(0, 2 * np.pi, n), np.where(sits, 0, rng.normal(1.2, 0.3, n))
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])
    shape = np.concatenate([skeleton(), surface()])
    rows = []
    for step in range(4):
        t = begin_s + 2 * step
        at = xy + ahead * (speed * 2 * (step - 1.5))[:, None]
        body = shape[None] * tall[:, None, None] * np.where(sits[:, None], (1, 1, 0.75), (1, 1, 1))[:, None, :]
        side = np.column_stack([ahead[:, 1], -ahead[:, 0]])
        flat = body[..., :1] * side[:, None] + body[..., 1:2] * ahead[:, None]
        swing = 0.12 * tall * np.sin(rng.uniform(0, 2 * np.pi, n)) * (speed > 0)
        for sign, legs in ((1, (11, 22, 23, 24)), (-1, (14, 19, 20, 21))):
            flat[:, legs] += sign * swing[:, None, None] * ahead[:, None]
        xyz = np.concatenate([flat + at[:, None], body[..., 2:]], axis=2)
        uv = camera.project(xyz)
        if moved_h is not None:
            turned = replace(camera, tilt_deg=camera.tilt_deg + tilt_deg, roll_deg=camera.roll_deg + roll_deg)
            uv = np.where((t >= moved_h * 3600)[:, None, None], turned.project(xyz), uv)
        box = np.concatenate([uv.min(axis=1), uv.max(axis=1)], axis=1) + rng.normal(0, noise_px, (n, 4))
        inside = ((uv > 0) & (uv < SIZE)).all(axis=(1, 2)) & (box[:, 2] > box[:, 0]) & (box[:, 3] > box[:, 1])
        rows.append(np.column_stack([np.round(t * 1000), np.arange(n), box])[inside])
    found = np.concatenate(rows)
    found = found[np.argsort(found[:, 0], kind="stable")]
    ts, frame = np.unique(found[:, 0].astype(np.int64), return_inverse=True)
    return People(
        frame=frame.astype(np.int64),
        track=found[:, 1].astype(int).astype(str).astype(object),
        box=found[:, 2:],
        joints=np.full((len(found), 25, 2), np.nan),
        frames=np.arange(len(ts)),
        ts_ms=MONDAY_MS + ts,
    )
