"""What the look page shows of a camera: its newest picture with people on it, and the same people on the plan.

A calibration by eye is the paper's (`engine.ratios`): two ratios are moved until the circles look right. They tell
proportions; the bodies seen lately, by their usual size, say how many metres they are.
"""

from __future__ import annotations

import base64
import tempfile
import threading
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.config.calibrate import calibrate
from vsd_analytics.config.project import load_site
from vsd_analytics.engine.body import PART_M, Part
from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.frame_pictures import fitted
from vsd_analytics.engine.overlay import OverlayLook, draw_frame, jpeg
from vsd_analytics.engine.paper_method import spaces_of
from vsd_analytics.engine.people import People
from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.engine.seen import Seen
from vsd_analytics.live.live_camera import LiveCamera, LiveFrame
from vsd_analytics.live.status import iso_utc
from vsd_analytics.site.model import Site
from vsd_analytics.wording.format import distance

LEAST_BODIES: Final = 5
"""With fewer people seen so far nothing says how many metres the ratios are."""


class LookView:
    """The cameras as they are now.

    Args:
        site: The project.
        cameras: The cameras; from now on they keep their newest frame in memory.
    """

    def __init__(self, site: Site, cameras: Sequence[LiveCamera]) -> None:
        self.site = site
        self._cameras = {camera.camera.camera_id: camera for camera in cameras}
        self._saving = threading.Lock()
        for camera in cameras:
            camera.is_looked_at = True

    def now(self, camera_id: str, ratios: Ratios | None) -> dict[str, Any]:
        """Return the newest frame of a camera, as the page takes it.

        Args:
            camera_id: The camera; KeyError where it is not looked at.
            ratios: Calibration by eye to look through; None = the one in force.
        """
        camera = self._cameras[camera_id]
        state = camera.as_dict()
        shown: dict[str, Any] = {
            "state": state["state"],
            "at": state["last"],
            "calibration": None,
            "picture": None,
            "persons": [],
            "pairs": [],
            "bodies": sum(len(people) for people in list(camera.recent)),
        }
        frame = camera.newest
        if frame is None:
            return shown
        seen = frame.seen if ratios is None else self._by_eye(camera, frame, ratios)
        return shown | self._shown(camera, frame, seen)

    def save(self, camera_id: str, ratios: Ratios, *, now: datetime) -> str | None:
        """Put a calibration by eye into force; return its id, None where too few people were seen for metres.

        A camera that has a calibration keeps it for the records before `now`.
        """
        camera = self._cameras[camera_id]
        size_px = _size(camera)
        homography = None if size_px is None else metric(list(camera.recent), ratios, size_px)
        if homography is None:
            return None
        with self._saving, tempfile.TemporaryDirectory(dir=self.site.root, prefix=".look-") as folder:
            matrix = Path(folder) / f"{camera_id}.txt"
            np.savetxt(matrix, homography, fmt="%.12g")
            since = now if camera.camera.calibrations else None
            done = calibrate(load_site(self.site.root), camera_id=camera_id, matrix=matrix, valid_from=since)
            camera.camera = load_site(self.site.root).camera(camera_id)
        return done.calibration_id

    def _by_eye(self, camera: LiveCamera, frame: LiveFrame, ratios: Ratios) -> Seen | None:
        size_px = _size(camera)
        homography = None if size_px is None else metric(list(camera.recent), ratios, size_px)
        if homography is None:
            return None
        settings = self.site.settings
        return locate(
            frame.people,
            homography=homography,
            picture_px=size_px,
            within_m=settings.pair_max_m,
            distance_m=settings.distance_m,
            name=str(ratios),
        )

    def _shown(self, camera: LiveCamera, frame: LiveFrame, seen: Seen | None) -> dict[str, Any]:
        settings, size_px = self.site.settings, _size(camera)
        assert size_px is not None
        look = OverlayLook(size_px, settings.distance_m, lambda metres: distance(metres, settings.distance_unit))
        canvas = np.array(fitted(frame.picture, size_px, source=Path(camera.camera.camera_id)))
        shown: dict[str, Any] = {"at": iso_utc(datetime.fromtimestamp(frame.ms / 1000, tz=UTC))}
        if seen is not None:
            close: NDArray[np.intp] = np.flatnonzero(seen.distance_m < settings.distance_m)
            canvas = draw_frame(canvas, seen, np.arange(len(seen.people)), close, look=look)
            too_close = {*seen.a[close].tolist(), *seen.b[close].tolist()}
            xy = np.full((len(seen.people), 2), np.nan) if seen.xy is None else seen.xy
            is_placed: NDArray[np.bool_] = np.asarray(np.isfinite(xy).all(axis=1))
            number = np.cumsum(is_placed) - 1
            shown["persons"] = [
                [*np.round(xy[row], 2).tolist(), row in too_close] for row in np.flatnonzero(is_placed).tolist()
            ]
            shown["pairs"] = [
                [int(number[seen.a[k]]), int(number[seen.b[k]]), round(float(seen.distance_m[k]), 2)]
                for k in close.tolist()
                if is_placed[seen.a[k]] and is_placed[seen.b[k]]
            ]
            shown["calibration"] = seen.engine
        shown["n_people"] = len(frame.people)
        shown["picture"] = f"data:image/jpeg;base64,{base64.b64encode(jpeg(canvas)).decode()}"
        return shown


def metric(recent: Sequence[People], ratios: Ratios, size_px: tuple[int, int]) -> NDArray[np.float64] | None:
    """Return the homography of two ratios in metres, 3x3: x to the right and y ahead of the middle of the lower edge.

    Half the legal distance is as wide on the ratios' plane as each body says by its own size; the median of these
    widths gives the metres of the plane.

    Args:
        recent: People seen lately.
        ratios: The two ratios.
        size_px: Width and height of the picture.
    """
    radii = []
    for people in recent:
        if len(people):
            part: Part = "torso" if people.has_joints else "box"
            assert part in PART_M
            radii.append(spaces_of(people, ratios=ratios, size_px=size_px, part=part, distance_m=2.0).radius)
    radius = np.concatenate(radii) if radii else np.empty(0)
    radius = radius[np.isfinite(radius) & (radius > 0)]
    if len(radius) < LEAST_BODIES:
        return None
    m_per_unit = 1.0 / float(np.median(radius))  # of a distance of 2 m, the radius is 1 m
    to_metres = np.array(
        [[m_per_unit, 0, -m_per_unit * size_px[0] / 2], [0, -m_per_unit, m_per_unit * size_px[1]], [0, 0, 1]]
    )
    return np.asarray(to_metres @ ratios.homography(size_px), dtype=np.float64)


def _size(camera: LiveCamera) -> tuple[int, int] | None:
    return camera.camera.picture_px or camera.source.size_px
