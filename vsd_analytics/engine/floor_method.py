"""People on a calibrated floor: foot points through the camera's homography, distances in metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.engine.calibration_error import LikelyCameras
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.joint_places import has_feet
from vsd_analytics.engine.people import People
from vsd_analytics.engine.safe_space import SafeSpaces, pairs_of_frames
from vsd_analytics.engine.seen import ABOVE_HORIZON, NO_FOOT, Seen
from vsd_analytics.geometry.homography import as_matrix, to_floor


def locate(
    people: People,
    *,
    homography: ArrayLike,
    picture_px: tuple[int, int] | None,
    within_m: float,
    distance_m: float = 2.0,
    name: str,
    error: LikelyCameras | None = None,
) -> Seen:
    """Return where people are on the floor, and the pairs nearer than a distance.

    Persons without a foot point have no place; persons at or above the horizon neither. Pairs have no `sd_m` with
    somebody whose place is by knees or hips.

    Args:
        people: As detected.
        homography: 3x3, pixels to floor metres.
        picture_px: Width and height of the picture.
        within_m: Pairs from this distance on are left out.
        distance_m: Two persons nearer than this are too close; a safe space has half of it as its radius.
        name: What the homography is, for the messages.
        error: Stated error of the calibration; None = unknown.
    """
    uv = floor_points(people, homography=homography, picture_px=picture_px)
    xy = to_floor(homography, uv, picture_px=picture_px)
    a, b = pairs_of_frames(people.frame)
    distance = np.linalg.norm(xy[a] - xy[b], axis=1)
    near = distance < within_m
    sd_m = None if error is None else error.distance_sd_m(uv[a[near]], uv[b[near]])
    if sd_m is not None and people.has_joints:  # how far off knees and hips put somebody is not in the stated error
        by_feet = has_feet(people) | np.isfinite(people.box).all(axis=1)
        sd_m = np.where(by_feet[a[near]] & by_feet[b[near]], sd_m, np.nan)
    no_foot, above = ~np.isfinite(uv).all(axis=1), np.isfinite(uv).all(axis=1) & ~np.isfinite(xy).all(axis=1)
    reasons = {NO_FOOT: int(no_foot.sum()), ABOVE_HORIZON: int(above.sum())}
    return Seen(
        people=people,
        uv=uv,
        xy=xy,
        a=a[near],
        b=b[near],
        distance_m=distance[near],
        quality="metric",
        engine=f"vsd-people {name}",
        left_out={why: n for why, n in reasons.items() if n},
        spaces=SafeSpaces(as_matrix(homography), xy, np.full(len(people), distance_m / 2), distance_m / 2),
        sd_m=sd_m,
    )
