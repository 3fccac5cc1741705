"""People of a picture with several planes: each by the homography of the plane in whose polygon the foot point lies.

A homography maps one plane. By the floor's, somebody on a stage appears farther away than the stage: by
height / (lens height - height) of the distance from the camera. So each plane has its own, to metres of the same floor
plan, and distances between planes are in space, where their heights are stated.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.calibration_error import LikelyCameras
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.safe_space import SafeSpaces, pairs_of_frames
from vsd_analytics.engine.seen import ABOVE_HORIZON, NO_FOOT, OFF_PLANES, Seen
from vsd_analytics.geometry.homography import as_matrix, to_floor
from vsd_analytics.site.model import Calibration, Plane

NO_PLANE = -1


@dataclass(frozen=True, slots=True)
class Standing:
    """What each person has under the feet.

    Attributes:
        uv: Foot points in pixels, shape (n, 2); NaN where unknown.
        plane: Number of the plane; the camera's own calibration comes after the last; `NO_PLANE` outside, shape (n,).
        homography: Pixels to plan metres, NaN outside all planes, shape (n, 3, 3).
        xy: Places on the plan in metres, shape (n, 2); NaN where unknown.
        height_m: Height above the floor, shape (n,); NaN where it is not stated.
    """

    uv: Array
    plane: NDArray[np.intp]
    homography: Array
    xy: Array
    height_m: Array

    @property
    def floor_per_px(self) -> Array:
        """Return the derivative of places by pixels, metres per pixel, shape (n, 2, 2)."""
        h = self.homography
        w = np.einsum("nj,nj->n", h[:, 2, :2], self.uv) + h[:, 2, 2]
        return np.asarray((h[:, :2, :2] - self.xy[:, :, None] * h[:, 2, None, :2]) / w[:, None, None])


def plane_numbers(planes: Sequence[Plane], uv: Array) -> NDArray[np.intp]:
    """Return the number of the first plane whose polygon holds each point, its edge included; else `NO_PLANE`.

    Args:
        planes: In the order in which they are tried.
        uv: Pixels, shape (n, 2); NaN is on no plane.
    """
    import shapely

    number = np.full(len(uv), NO_PLANE, dtype=np.intp)
    known = np.asarray(np.isfinite(uv).all(axis=1))
    for i, plane in reversed(list(enumerate(planes))):
        inside = shapely.intersects_xy(shapely.Polygon(plane.polygon_px), *np.nan_to_num(uv).T)
        number[inside & known] = i
    return number


def off_planes(people: People, planes: Sequence[Plane]) -> People:
    """Return the people who stand on none of some planes: they tell something about the camera's own calibration."""
    return people.rows(plane_numbers(planes, feet(people)) == NO_PLANE) if planes else people


def standing(
    people: People,
    *,
    planes: Sequence[Plane],
    calibration: Calibration | None,
    picture_px: tuple[int, int] | None,
) -> Standing:
    """Return the plane, the place and the height of each person.

    Args:
        people: As detected.
        planes: Planes of the picture in force, the first that matches wins.
        calibration: The camera's own, for the rest of the picture, at height 0; None = the rest is no floor.
        picture_px: Width and height of the picture.
    """
    uv = feet(people)
    if calibration is not None:  # only there are all planes' verticals known
        # knees and hips are at another height above each plane
        by_feet = np.isfinite(uv).all(axis=1, keepdims=True)
        uv = np.where(by_feet, floor_points(people, homography=calibration.homography, picture_px=picture_px), np.nan)
    plane = plane_numbers(planes, uv)
    homography, xy, height_m = np.full((len(uv), 3, 3), np.nan), np.full((len(uv), 2), np.nan), np.full(len(uv), np.nan)
    for i, each in enumerate(planes):
        rows = plane == i
        h = homography[rows] = as_matrix(each.calibration.homography)
        mapped = np.column_stack([uv[rows], np.ones(rows.sum())]) @ h.T  # the whole polygon is below the horizon
        xy[rows] = mapped[:, :2] / mapped[:, 2:]
        if each.height_m is not None:
            height_m[rows] = each.height_m[0] + xy[rows] @ np.array(each.height_m[1:])
    if calibration is not None:
        rest = (plane == NO_PLANE) & np.isfinite(uv).all(axis=1)
        plane[rest], height_m[rest] = len(planes), 0.0
        homography[rest] = as_matrix(calibration.homography)
        xy[rest] = to_floor(calibration.homography, uv[rest], picture_px=picture_px)
    return Standing(uv, plane, homography, xy, height_m)


def locate_on_planes(
    people: People,
    *,
    planes: Sequence[Plane],
    calibration: Calibration | None,
    picture_px: tuple[int, int] | None,
    within_m: float,
    distance_m: float = 2.0,
    stated_error: Callable[[Calibration], LikelyCameras | None] = lambda _: None,
) -> Seen:
    """Return where people are on the floor plan, and the pairs nearer than a distance.

    The distance of two people is that in space: on a ramp it is along the ramp. Where a plane does not state its
    height, two people on it are as far apart as on the plan, and somebody on it has no pair with people on another
    plane: that distance is unknown. The camera's own calibration has height 0.

    Args:
        people: As detected.
        planes: Planes of the picture in force, the first that matches wins.
        calibration: The camera's own, for the rest of the picture; None = the rest is no floor.
        picture_px: Width and height of the picture.
        within_m: Pairs from this distance on are left out.
        distance_m: Two persons nearer than this are too close; a safe space has half of it as its radius.
        stated_error: The stated error of a calibration; it gives the distances within its plane their sd.
    """
    on = standing(people, planes=planes, calibration=calibration, picture_px=picture_px)
    a, b = pairs_of_frames(people.frame)
    is_same = on.plane[a] == on.plane[b]
    rise = on.height_m[a] - on.height_m[b]
    distance = np.hypot(np.linalg.norm(on.xy[a] - on.xy[b], axis=1), np.where(is_same & np.isnan(rise), 0.0, rise))
    near = distance < within_m  # NaN is not near
    a, b = a[near], b[near]
    no_foot = ~np.isfinite(on.uv).all(axis=1)
    outside = (on.plane == NO_PLANE) & ~no_foot
    reasons = {
        NO_FOOT: int(no_foot.sum()),
        OFF_PLANES: int(outside.sum()),
        ABOVE_HORIZON: int((~np.isfinite(on.xy).all(axis=1) & ~no_foot & ~outside).sum()),
    }
    used = [*(plane.calibration for plane in planes), *([] if calibration is None else [calibration])]
    sd_m = np.full(len(a), np.nan)
    for i, each in enumerate(used):
        rows = np.flatnonzero((on.plane[a] == i) & (on.plane[b] == i))
        error = stated_error(each) if len(rows) else None
        if error is not None:
            sd_m[rows] = error.distance_sd_m(on.uv[a[rows]], on.uv[b[rows]])
    return Seen(
        people=people,
        uv=on.uv,
        xy=on.xy,
        a=a,
        b=b,
        distance_m=distance[near],
        quality="metric",
        engine=f"vsd-people {_name(planes, calibration)}",
        left_out={why: n for why, n in reasons.items() if n},
        spaces=SafeSpaces(on.homography, on.xy, np.full(len(people), distance_m / 2), distance_m / 2),
        sd_m=sd_m if np.isfinite(sd_m).any() else None,
        has_planes=True,
    )


def _name(planes: Sequence[Plane], calibration: Calibration | None) -> str:
    """Return "planes" and 8 hexadecimal digits of the BLAKE2 hash of all that decides where people are."""
    parts = [(plane.polygon_px, plane.height_m, plane.calibration.calibration_id) for plane in planes]
    known = repr((parts, None if calibration is None else calibration.calibration_id))
    return f"planes {hashlib.blake2b(known.encode(), digest_size=4).hexdigest()}"
