"""A calibration from people alone: the camera and its stated error, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.calibration_error import PROBE_M, LikelyCameras, error_map, likely_cameras, view_map
from vsd_analytics.engine.calibration_fit import DEPTH, Fitted, camera_of, fit_camera, heights_m
from vsd_analytics.engine.camera_model import CameraModel
from vsd_analytics.engine.camera_moves import Turn, usual_turn
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.sightings import n_at_once, n_persons, sightings
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import to_floor

MIN_ROWS: Final = 40
MIN_PEOPLE: Final = 8
"""Fewer persons may all be short or tall."""
MIN_ROWS_UNTRACKED, MIN_PARTS = 80, 30
"""Without track ids the same few people may come back in all frames: so many walks, or parts of walks, are enough, or
`MIN_PEOPLE` at once."""
FEW_PEOPLE, FEW_WALKS = 30, 100
"""Persons by track ids, or walks and parts of walks without, below which an accepted calibration is often wrong by more
than a tenth, and along the view by more (docs/engine.md)."""
MAX_SCATTER: Final = 0.20
"""Heights that differ more than this are not those of upright people."""
TALL, MAX_TALL = 1.3, 0.1
"""Nobody is this much taller than usual; more than so many who are mean that the usual ones were cut off."""
MAX_BOX_TILT_DEG: Final = 40.0
"""Above, the bottom edge of a box is so far from the feet that a camera in ten is off by 23 % (docs/engine.md)."""
MAX_ERROR: Final = 0.30
"""Relative sd of a distance of 2 m from which on a calibration would mislead."""


@dataclass(frozen=True, slots=True)
class FromPeople(LikelyCameras):
    """A camera found from the people it sees: the origin is below it, x runs right and y ahead.

    Attributes:
        camera: The camera.
        n_rows: Whole upright people in all frames.
        n_people: Persons by track id; None without tracks.
        n_walks: Those, or walks and parts of walks without track ids.
        n_walkers: Persons whose speeds took part.
        uses_joints: Whether joints measured, not boxes.
        scatter: Robust relative sd of the heights.
        error: Relative sd of a distance of 2 m by the camera's part alone, median over where people were.
        depth_m: Depth of a body, as fitted (`sightings.Body`).
        usual_turn: Turn by which the heights of these people would be equal; later people are compared with it.
        map: x, y, sd of a distance of 2 m and the camera's part of it, metres, per cell of 1 m with people, shape
            (k, 4).
        view_map: The same for all floor in view up to `calibration_error.REACH_M`; at most `FARTHEST_SD_M`.
    """

    camera: CameraModel
    n_rows: int
    n_people: int | None
    n_walks: int
    n_walkers: int
    uses_joints: bool
    scatter: float
    error: float
    depth_m: float
    usual_turn: Turn
    map: Array
    view_map: Array

    @property
    def is_of_few(self) -> bool:
        """Return whether it rests on fewer people than a calibration should."""
        return self.n_walks < (FEW_WALKS if self.n_people is None else FEW_PEOPLE)


def calibrate_from_people(people: People, *, size_px: tuple[int, int]) -> FromPeople:
    """Return the camera that explains the people it sees, with its stated error.

    Args:
        people: Boxes or joints over time, with or without track ids; an hour is better than a minute.
        size_px: Width and height of the picture.

    Raises:
        CalibrationError: The people cannot carry a calibration (E411); the message says why.
    """
    seen = sightings(people, size_px=size_px)
    n_walks = n_persons(seen) if seen.has_tracks else len(np.unique(seen.who))
    n_people = n_walks if seen.has_tracks else None
    least, least_walks = (MIN_ROWS, MIN_PEOPLE) if seen.has_tracks else (MIN_ROWS_UNTRACKED, MIN_PARTS)
    is_few = n_walks < least_walks and (seen.has_tracks or n_at_once(seen) < MIN_PEOPLE)
    if len(seen.low) < least or is_few:
        whose = f"{n_walks} persons" if seen.has_tracks else f"about {n_walks} persons (without track ids)"
        many = f"{len(seen.low)} whole people in {len(people.frames):,} frames, of {whose}"
        raise _refused(many, f"give at least {least}, of {least_walks} persons; {_whole(seen.has_lean)}")
    outside = np.mean((seen.low < 0).any(axis=1) | (seen.low > np.array(size_px)).any(axis=1))
    if outside > 0.2:
        raise _refused(f"{outside:.0%} of the feet lie outside {size_px[0]}x{size_px[1]} pixels", "check --size")
    fitted = fit_camera(seen, size_px=size_px)
    if fitted is None:
        raise _refused("no camera explains the places and heights of the people", "check --size and the columns")
    tilt_deg = np.degrees(fitted.camera.tilt_rad)
    if not seen.has_lean and tilt_deg > MAX_BOX_TILT_DEG:
        raise _refused(
            f"the camera looks down by {tilt_deg:.0f} degrees, and the bottom of a box is not at the feet there",
            "give joints in place of boxes, or measure points: --points FILE",
        )
    if not fitted.scatter <= MAX_SCATTER:
        raise _refused(
            f"the heights of the people differ by {fitted.scatter:.0%} for the best camera",
            "take boxes or joints of whole standing people only",
        )
    giant_m = TALL * seen.body.high_m
    giants = float(np.mean(heights_m(fitted.camera, seen, float(fitted.vector[DEPTH]))[0] > giant_m))
    if giants > MAX_TALL:
        raise _refused(
            f"by the best camera {giants:.0%} of the bodies reach above {giant_m:.1f} m",
            "take whole people only: these have parts of bodies among them",
        )
    homography = fitted.camera.homography()
    likely = _likely(fitted)
    cells = error_map(homography, likely, seen.low, picture_px=size_px)
    cells = cells[np.isfinite(cells).all(axis=1)]
    error = _typical_error(cells, to_floor(homography, seen.low, picture_px=size_px))
    if not error <= MAX_ERROR:
        raise _refused(
            f"a distance of 2 m would be uncertain by {error * PROBE_M:.1f} m",
            "record for longer, with track ids and with people near and far; or measure points: --points FILE",
        )
    return FromPeople(
        camera=fitted.camera,
        homography=homography,
        likely=likely,
        size_px=size_px,
        n_rows=len(seen.low),
        n_people=n_people,
        n_walks=n_walks,
        n_walkers=fitted.n_walkers,
        uses_joints=seen.has_lean,
        scatter=fitted.scatter,
        error=error,
        depth_m=float(fitted.vector[DEPTH]),
        usual_turn=usual_turn(seen, fitted.camera, depth_m=float(fitted.vector[DEPTH])),
        map=cells,
        view_map=view_map(homography, likely, picture_px=size_px),
    )


def _likely(fitted: Fitted) -> Array:
    """Return homographies of cameras drawn, with the sign of the fitted one so that floor stays floor."""
    cameras = likely_cameras(fitted.vector, fitted.covariance, uses_joints=fitted.seen.has_lean)
    drawn = [camera_of(v, fitted.size_px) for v in cameras]
    return np.array([camera.homography() for camera in drawn])


def _typical_error(cells: Array, xy: NDArray[np.float64]) -> float:
    """Return the median over people of the camera's relative error in the cell they are in."""
    if not len(cells):
        return np.inf
    known = {(float(x), float(y)): float(sd) for x, y, _, sd in cells}
    at = np.floor(xy[np.isfinite(xy).all(axis=1)]) + 0.5
    return float(np.median([known.get((float(x), float(y)), np.inf) for x, y in at]) / PROBE_M)


def _whole(uses_joints: bool) -> str:
    if uses_joints:
        return "only skeletons with a neck and both ankles count"
    return "boxes that the picture's edge cuts off do not count"


def _refused(why: str, fix: str) -> CalibrationError:
    return CalibrationError("these people cannot calibrate the camera", code="E411", why=why, fix=fix)
