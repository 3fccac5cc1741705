"""Where the people of a detector are by each method of `vsd engine run`, under each calibration of their camera."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

from vsd_analytics.cli.options import known_size
from vsd_analytics.cli.project import Project
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vsd_analytics.engine.calibration_error import LikelyCameras
    from vsd_analytics.engine.monoloco_files import MonolocoPeople
    from vsd_analytics.engine.people import People
    from vsd_analytics.engine.ratios import Ratios
    from vsd_analytics.engine.seen import Seen
    from vsd_analytics.site.model import Calibration, Camera, Plane

LocatedParts: TypeAlias = "list[tuple[Seen, NDArray[np.int64]]]"
"""What was seen under each of a camera's calibrations, and the times of its frames."""


@dataclass(frozen=True, slots=True)
class DetectedPeople:
    """The people of a detector, and the camera that saw them.

    Attributes:
        project: The project and clock.
        camera: The camera.
        people: Their joints or boxes.
        picture_px: Width and height of the picture; None = not known.
        ts_ms: UTC milliseconds of the frames.
        is_tracked: Follow people on the floor.
        is_of_pictures: A detector of this program found them, so boxes become whole bodies first (`engine.bodies`).
        changed: Boxes that were left out or changed for it, by what was done.
    """

    project: Project
    camera: Camera
    people: People
    picture_px: tuple[int, int] | None
    ts_ms: NDArray[np.int64]
    is_tracked: bool
    is_of_pictures: bool = False
    changed: Counter[str] = field(default_factory=Counter)

    @property
    def known_px(self) -> tuple[int, int]:
        """Return the size of the picture; UsageError E101 where it is not known."""
        return known_size(self.camera, self.picture_px)


def by_paper(detected: DetectedPeople, *, part: str | None, ratios: Ratios) -> Seen:
    """Return what was seen by the paper's method."""
    from vsd_analytics.engine.body import PART_M
    from vsd_analytics.engine.paper_method import detect

    chosen = next((p for p in PART_M if p == part), "torso" if detected.people.has_joints else "box")
    settings = detected.project.site.settings
    return detect(
        detected.people,
        ratios=ratios,
        size_px=detected.known_px,
        part=chosen,
        distance_m=settings.distance_m,
        within_m=settings.pair_max_m,
    )


def check_calibrated(camera: Camera, *, is_of_pictures: bool) -> None:
    """Raise UsageError (E101) for a camera without a calibration, with the command that makes one."""
    if camera.calibrations or camera.planes:
        return
    raise UsageError(
        f"camera {camera.camera_id!r} has no calibration",
        why="--method people measures in metres on the floor",
        fix=f"vsd calibrate {camera.camera_id} --draw --picture PICTURE, or --from-people with this command"
        if is_of_pictures
        else f"vsd calibrate {camera.camera_id} --from-people PEOPLE --size 1920x1080, or --method paper",
    )


def by_calibrations(detected: DetectedPeople) -> LocatedParts:
    """Return what was seen by the metres of the camera's calibrations."""
    from vsd_analytics.engine.floor_method import locate
    from vsd_analytics.engine.plane_method import locate_on_planes, standing
    from vsd_analytics.engine.tracker import tracked, tracked_at

    camera, people, picture_px = detected.camera, detected.people, detected.picture_px
    check_calibrated(camera, is_of_pictures=detected.is_of_pictures)
    timed, parts = replace(people, ts_ms=detected.ts_ms), []
    settings = detected.project.site.settings
    reach = {"within_m": settings.pair_max_m, "distance_m": settings.distance_m}
    for from_ms, to_ms, used, planes in _grounds(camera):
        part = timed.between(from_ms, to_ms)
        if not len(part.frames):
            continue
        when, part = part.ts_ms, replace(part, ts_ms=None) if people.ts_ms is None else part
        assert when is not None
        if used is not None and not planes:
            part = _with_bodies(detected, part, used)
        if planes:
            if detected.is_tracked:
                on = standing(part, planes=planes, calibration=used, picture_px=picture_px)
                part = tracked_at(part, on.xy, on.floor_per_px, picture_px=picture_px, ts_ms=when)
            seen = locate_on_planes(
                part,
                planes=planes,
                calibration=used,
                picture_px=picture_px,
                **reach,
                stated_error=_stated_error,
            )
        else:
            assert used is not None
            if detected.is_tracked:
                part = tracked(part, homography=used.homography, picture_px=picture_px, ts_ms=when)
            seen = locate(
                part,
                homography=used.homography,
                picture_px=picture_px,
                **reach,
                name=used.calibration_id,
                error=_stated_error(used),
            )
        parts.append((seen, when))
    return parts


def _with_bodies(detected: DetectedPeople, people: People, used: Calibration) -> People:
    """Return the people of pictures with whole bodies (`engine.bodies`), and count what changed."""
    from vsd_analytics.engine.bodies import Bodies, people_with_bodies

    if not detected.is_of_pictures or detected.picture_px is None:
        return people
    bodies = Bodies(used.homography, detected.picture_px)
    people = people_with_bodies(people, bodies)
    detected.changed.update({f"{what}, left out": n for what, n in bodies.left_out.items() if n})
    if bodies.n_extended:
        detected.changed["half a body, with feet where the usual height puts them"] += bodies.n_extended
    return people


def _grounds(camera: Camera) -> list[tuple[int, int, Calibration | None, tuple[Plane, ...]]]:
    """Return the spans of UTC milliseconds in which a camera has the same calibration and planes, and these."""
    from datetime import UTC, datetime
    from itertools import pairwise

    from vsd_analytics.geometry.plane_views import plane_starts, planes_in_force
    from vsd_analytics.warehouse.owner_spans import FOREVER_MS, calibration_spans, in_force

    changes = {from_ms for from_ms, _, _ in calibration_spans(camera)}
    changes |= {round(start.timestamp() * 1000) for start in plane_starts(camera.planes)}
    grounds = []
    for from_ms, to_ms in pairwise([*sorted(changes | {-FOREVER_MS}), FOREVER_MS]):
        at = None if from_ms == -FOREVER_MS else datetime.fromtimestamp(from_ms / 1000, UTC)
        used = in_force(camera, from_ms)
        grounds.append((from_ms, to_ms, used[0] if used else None, planes_in_force(camera.planes, at)))
    return grounds


def by_monoloco(detected: DetectedPeople, own: MonolocoPeople) -> LocatedParts:
    """Return what Monoloco placed under each of the camera's calibrations, else on the plane of its people."""
    from vsd_analytics.engine.monoloco_method import floor_of_calibration, floor_of_people, locate_monoloco
    from vsd_analytics.warehouse.owner_spans import calibration_spans

    settings, ts_ms, floors = detected.project.site.settings, detected.ts_ms, []
    for from_ms, to_ms, used in calibration_spans(detected.camera):
        floor = floor_of_calibration(used.homography, picture_px=detected.known_px, name=used.calibration_id)
        floors.append((from_ms, to_ms, floor))
    timed, parts = replace(own, people=replace(own.people, ts_ms=ts_ms)), []
    for from_ms, to_ms, floor in floors or [(int(ts_ms[0]), int(ts_ms[-1]) + 1, floor_of_people(own))]:
        part = timed.between(from_ms, to_ms)
        when = part.people.ts_ms
        if when is None or not len(when):
            continue
        part = replace(part, people=replace(part.people, ts_ms=own.people.ts_ms))
        reach = {"within_m": settings.pair_max_m, "distance_m": settings.distance_m}
        parts.append((locate_monoloco(part, floor, **reach, ts_ms=when if detected.is_tracked else None), when))
    return parts


def _stated_error(used: Calibration) -> LikelyCameras | None:
    from vsd_analytics.engine.people_calibration_file import read_stated_error
    from vsd_analytics.geometry.stated_errors import beside

    if used.source is None:
        return None
    return read_stated_error(beside(used.source, "people"), calibration_id=used.calibration_id)
