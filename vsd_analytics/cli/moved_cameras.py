"""Whether a camera was moved, for `vsd calibrate --check` and `vsd engine run`: the check, its sentences, its JSON."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Final
from zoneinfo import ZoneInfo

from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from vsd_analytics.cli.project import Project
    from vsd_analytics.engine.camera_moves import CameraCheck, CameraMove
    from vsd_analytics.engine.people import People
    from vsd_analytics.site.model import Camera

CODE: Final = "W405"
_SHORT_MS: Final = 2 * 3_600_000
"""A move between two instants that are nearer than this has one time: about."""
_NO_ROLL_DEG: Final = 0.5


def check_people(
    camera: Camera, people: People, *, ts_ms: NDArray[np.int64], size_px: tuple[int, int] | None
) -> CameraCheck | None:
    """Return the moves of a camera since its latest calibration, by the people it saw outside its planes.

    Args:
        camera: The camera.
        people: Boxes or joints.
        ts_ms: UTC milliseconds of each of `people.frames`.
        size_px: Width and height of the picture.

    Returns:
        None where it has no calibration, or one that no camera above a floor has.
    """
    from dataclasses import replace

    from vsd_analytics.engine.camera_model import camera_of_homography
    from vsd_analytics.engine.camera_moves import check_camera
    from vsd_analytics.engine.people_calibration_file import StatedCamera, read_stated_camera
    from vsd_analytics.engine.plane_method import off_planes
    from vsd_analytics.engine.sightings import BOX
    from vsd_analytics.geometry.stated_errors import beside

    if not camera.calibrations or size_px is None:
        return None
    latest = camera.calibrations[-1]
    known = None
    if latest.source is not None:
        known = read_stated_camera(beside(latest.source, "people"), calibration_id=latest.calibration_id)
    if known is None:
        model = camera_of_homography(latest.homography, size_px)
        if model is None:
            return None
        known = StatedCamera(model, BOX.depth_m, None)
    from_ms = None if latest.valid_from is None else round(latest.valid_from.timestamp() * 1000)
    since = off_planes(replace(people, ts_ms=ts_ms).between(from_ms, None), camera.planes)
    return check_camera(since, known.camera, depth_m=known.depth_m, size_px=size_px, usual=known.usual_turn)


def timed(people: People, path: Path) -> NDArray[np.int64]:
    """Return the times of frames; UsageError where the file has none."""
    if people.ts_ms is None:
        raise UsageError(
            f"{path.name} has no ts", why="when a camera moved needs times", fix="give boxes with ts in place of frame"
        )
    return people.ts_ms


def move_sentence(camera: Camera, move: CameraMove, *, zone: str, source: str) -> str:
    """Return when and how a camera moved, what it does to distances, and the command that calibrates it again."""
    turn = f"tilt about {move.tilt_deg:+.1f} degrees"
    if abs(move.roll_deg) >= _NO_ROLL_DEG:
        turn += f", roll about {move.roll_deg:+.1f}"
    longer = "too long" if move.distance_change > 0 else "too short"
    since = since_text(move, zone=zone)
    return (
        f"camera {camera.camera_id} has moved {_when(move, zone=zone)} ({turn}): by its calibration, distances since "
        f"then come out about {abs(move.distance_change):.0%} {longer}. Calibrate it again from then on: "
        f"vsd calibrate {camera.camera_id} --from-people {source} --from {since}"
    )


def since_text(move: CameraMove, *, zone: str) -> str:
    """Return the local minute from which a new calibration should hold, as `--from` takes it."""
    return f"{_since(move, zone=zone):%Y-%m-%dT%H:%M}"


def moves_list(check: CameraCheck, *, zone: str) -> list[dict[str, object]]:
    """Return moves for `--json`; `from` is the instant from which a new calibration should hold."""
    return [
        {
            "after": None if move.after_ms is None else _local(move.after_ms, zone).isoformat(),
            "before": _local(move.before_ms, zone).isoformat(),
            "from": _since(move, zone=zone).isoformat(),
            "tilt_deg": round(move.tilt_deg, 2),
            "roll_deg": round(move.roll_deg, 2),
            "distance_change": round(move.distance_change, 3),
        }
        for move in check.moves
    ]


def check_dict(check: CameraCheck, *, zone: str) -> dict[str, object]:
    """Return a check for `--json`."""
    return {
        "n_people": check.n_people,
        "n_stretches": check.n_slots,
        "least_tilt_deg": None if check.least_deg is None else round(check.least_deg, 2),
        "moves": moves_list(check, zone=zone),
    }


def warn_of_moves(project: Project, camera: Camera, check: CameraCheck, source: Path) -> None:
    """Print a warning for each move of a camera, with the command that calibrates it again."""
    for move in check.moves:
        sentence = move_sentence(camera, move, zone=project.site.timezone, source=str(source))
        project.say(f"warning[{CODE}]: {sentence}")


def check_lines(camera_id: str, check: CameraCheck) -> list[str]:
    """Return what was checked and with what result, without the moves."""
    seen = f"{camera_id}: {check.n_people:,} whole people in {check.n_slots} stretches of an hour or more"
    if check.least_deg is None:
        return [seen, "too few to tell whether the camera has moved: give some days, or a week"]
    lines = [f"{seen}; a tilt of {check.least_deg:.1f} degrees or more would be found"]
    return lines if check.moves else [*lines, "the camera has not moved (a turn to the side does not show)"]


def _when(move: CameraMove, *, zone: str) -> str:
    if move.after_ms is None:
        return f"between its calibration and {_local(move.before_ms, zone):%A %Y-%m-%d %H:%M}"
    if move.before_ms - move.after_ms < _SHORT_MS:
        return f"on {_since(move, zone=zone):%A %Y-%m-%d about %H:%M}"
    first, last = _local(move.after_ms, zone), _local(move.before_ms, zone)
    return f"between {first:%A %Y-%m-%d %H:%M} and {last:%A %Y-%m-%d %H:%M}"


def _since(move: CameraMove, *, zone: str) -> datetime:
    """Return the instant of the move for `--from`: the nearest hour, or the first people seen after a longer gap."""
    if move.after_ms is None or move.before_ms - move.after_ms >= _SHORT_MS:
        return _local(move.before_ms, zone).replace(second=0, microsecond=0)
    middle = _local((move.after_ms + move.before_ms) // 2, zone) + timedelta(minutes=30)
    return middle.replace(minute=0, second=0, microsecond=0)


def _local(ms: int, zone: str) -> datetime:
    return datetime.fromtimestamp(ms / 1000, UTC).astimezone(ZoneInfo(zone))
