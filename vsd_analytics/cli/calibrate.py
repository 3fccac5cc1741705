"""`vsd calibrate`: a camera's map from picture to floor."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.options import json_option, language_option, path_option
from vsd_analytics.cli.output import emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError
from vsd_analytics.site.instants import instant

if TYPE_CHECKING:
    from datetime import datetime

    import numpy as np
    from numpy.typing import NDArray

    from vsd_analytics.config.calibrate import Calibrated
    from vsd_analytics.engine.people import People
    from vsd_analytics.engine.people_calibration import FromPeople
    from vsd_analytics.site.model import Camera


@click.command()
@click.argument("camera")
@path_option("--matrix", help="3x3 homography, picture px to floor m.")
@path_option("--points", help="CSV of u,v,x,y: four points or more.")
@path_option(
    "--camera-file",
    "camera_files",
    multiple=True,
    help="Camera matrix, place and lens distortion: OpenCV's XML, YAML or JSON, or Oxford's; repeat it for two files.",
)
@click.option(
    "--unit",
    type=click.Choice(["m", "cm", "mm"]),
    default="m",
    help="Length unit of --camera-file (default: m); its floor is z = 0.",
)
@path_option("--from-people", help="Boxes or joints of people over time (see vsd engine run); needs no measuring.")
@path_option(
    "--check", help="Boxes or joints with times: tell whether the camera has moved since its calibration, and when."
)
@path_option(
    "--lines",
    help="Picture of a place with right angles: its straight edges show focal length and tilt; with --height.",
)
@click.option(
    "--height",
    "height_m",
    type=click.FloatRange(min=0.5, max=100),
    metavar="M",
    help="Height of the lens, with --lines.",
)
@click.option("--draw", is_flag=True, help="Write a page to click points, areas, fixtures and views by hand.")
@path_option("--picture", help="Picture for --draw (default: the camera's).")
@click.option("--open", "is_opened", is_flag=True, help="Open the page of --draw in a browser.")
@language_option
@click.option("--size", metavar="WxH", help="Picture size in pixels, with --from-people, --check and --camera-file.")
@click.option("--from", "valid_from", metavar="INSTANT", help="When the camera was put there (default: always).")
@json_option
@pass_project
def calibrate(
    project: Project,
    camera: str,
    matrix: Path | None,
    points: Path | None,
    camera_files: tuple[Path, ...],
    unit: str,
    from_people: Path | None,
    check: Path | None,
    lines: Path | None,
    height_m: float | None,
    draw: bool,
    picture: Path | None,
    is_opened: bool,
    size: str | None,
    valid_from: str | None,
    as_json: bool,
) -> int:
    """Compute a camera's homography from picture to floor, and draw a picture to check it.

    With --from-people, nothing is measured by hand: people of usual height and walks give horizon, focal length,
    tilt, roll and height of the camera. The error is stated, and too uncertain results are refused. The floor's
    origin is then below the camera, x to the right and y ahead.

    With --check, nothing is calibrated: people of later days tell whether the camera has moved (exit code 1), when, by
    how much, and the command that calibrates it again from then on. Weeks before and after it are then not compared.

    With --camera-file, a lens with distortion gets the homography that fits the floor in the picture best, up to 30 m,
    and what that leaves is printed and stored as the error.

    With --lines, the vanishing points of floor, shelves and walls in a picture give focal length, tilt and roll. The
    height of the lens above the floor sets the scale. The origin is below the camera, as with --from-people.

    With --draw, nothing is calibrated: the page it writes takes points by click on the picture and on the plan, shows
    circles of the legal distance on the picture, and gives the points as CSV. Areas, fixtures and what the camera sees
    are drawn on it, too; it gives their lines for vsd.toml. It needs no server and no network.

    Without --matrix, --points, --camera-file, --lines, --from-people, --check and --draw, draw the calibration in force
    again.

    \b
    Example:
      vsd calibrate cam-1 --draw --open
      vsd calibrate cam-1 --points points.csv
      vsd calibrate cam-1 --matrix cam-1.txt --from 2026-11-01T07:00
      vsd calibrate cam-1 --from-people people.csv --size 1920x1080
      vsd calibrate cam-1 --check week.csv
      vsd calibrate cam-1 --lines pictures/cam-1.png --height 3.2
      vsd calibrate cam-1 --camera-file intr.xml --camera-file extr.xml --unit cm
      vsd calibrate cam-1
    """
    from vsd_analytics.config import calibrate as calibration

    ways = (matrix, points, camera_files or None, from_people, check, lines, draw or None)
    if sum(given is not None for given in ways) > 1:
        which = "--matrix, --points, --camera-file, --from-people, --check, --lines and --draw"
        raise UsageError(f"{which} exclude each other", fix="give one of them")
    if (lines is None) != (height_m is None):
        raise UsageError("--lines and --height go together", fix="--lines PICTURE --height 3.2, in metres")
    since = None if valid_from is None else instant(valid_from, zone=project.site.timezone, what="--from")
    if (picture is not None or is_opened) and not draw:
        raise UsageError("--picture and --open belong to --draw", fix=f"vsd calibrate {camera} --draw")
    if draw:
        return _draw(project, camera, picture=picture, is_opened=is_opened, as_json=as_json)
    if check is not None:
        return _check(project, camera, check, size=size, as_json=as_json)
    if camera_files:
        return _from_camera_files(project, camera, camera_files, unit=unit, size=size, since=since, as_json=as_json)
    if lines is not None and height_m is not None:
        return _from_lines(project, camera, lines, height_m=height_m, since=since, as_json=as_json)
    if from_people is not None:
        return _from_people(project, camera, from_people, size=size, since=since, as_json=as_json)
    done = calibration.calibrate(project.site, camera_id=camera, matrix=matrix, points=points, valid_from=since)
    return _shown(project, done, _lines(done), {}, as_json=as_json)


def _draw(project: Project, camera_id: str, *, picture: Path | None, is_opened: bool, as_json: bool) -> int:
    """Write the page to calibrate a camera by hand."""
    from vsd_analytics.calibration_page.page import render_calibration_page
    from vsd_analytics.config.calibrate import FOLDER
    from vsd_analytics.site.cameras_by_name import camera_called
    from vsd_analytics.store.durable import publish

    project.speak()
    camera = camera_called(project.site, camera_id)
    page = render_calibration_page(project.site, camera, picture=picture)
    path = project.root / FOLDER / f"{camera.camera_id}-draw.html"
    publish(path, page.encode())
    if as_json:
        emit_json({"camera_id": camera.camera_id, "page": str(path), "bytes": len(page.encode())})
    else:
        click.echo(f"{path}   {len(page.encode()) / 1000:.0f} KB")
    if is_opened:
        click.launch(str(path))
    return 0


def _shown(project: Project, done: Calibrated, lines: list[str], more: dict[str, object], *, as_json: bool) -> int:
    """Print what was done and its warnings; return the exit code."""
    if as_json:
        emit_json({**_as_dict(done), **more})
    else:
        for line in lines:
            click.echo(line)
        for code, sentence in done.warnings:
            project.say(f"warning[{code}]: {sentence}")
    return 1 if {"W402", "W403"} & {code for code, _ in done.warnings} else 0


def _from_people(
    project: Project, camera_id: str, people: Path, *, size: str | None, since: datetime | None, as_json: bool
) -> int:
    """Calibrate a camera from the people it sees while the result will be in force, and put it into force."""
    from vsd_analytics.engine.ignored_parts import in_parts
    from vsd_analytics.engine.people_files import read_each_once
    from vsd_analytics.engine.pictures import is_picture_source
    from vsd_analytics.engine.plane_method import off_planes
    from vsd_analytics.site.cameras_by_name import camera_called

    if people.exists() and is_picture_source(people):
        raise UsageError(
            f"{people.name} has pictures, and nothing has found people in them yet",
            fix=f"vsd engine run {people} --camera {camera_id} --detector MODEL.onnx --from-people",
        )
    camera = camera_called(project.site, camera_id)
    picture_px = _picture_px(camera, size)
    every = read_each_once(people, size_px=picture_px)
    seen = off_planes(every.rows(~in_parts(every.outline, camera.ignore_px)), camera.planes)
    if since is not None and seen.ts_ms is not None:
        seen = seen.between(round(since.timestamp() * 1000), None)
    done, calibration = put_into_force_from_people(project, camera_id, seen, size_px=picture_px, since=since)
    return _shown(project, done, _people_lines(done, calibration), _people_dict(calibration), as_json=as_json)


def put_into_force_from_people(
    project: Project, camera_id: str, seen: People, *, size_px: tuple[int, int], since: datetime | None = None
) -> tuple[Calibrated, FromPeople]:
    """Calibrate a camera from people, write the result with its stated error, and put it into force."""
    from vsd_analytics.engine.people_calibration import FEW_PEOPLE, FEW_WALKS, calibrate_from_people
    from vsd_analytics.engine.people_calibration_file import write_stated_error
    from vsd_analytics.geometry.stated_errors import beside

    calibration = calibrate_from_people(seen, size_px=size_px)
    done = _put_into_force(project, camera_id, calibration.homography, since=since)
    write_stated_error(beside(project.site.root / done.file, "people"), calibration, calibration_id=done.calibration_id)
    if calibration.is_of_few:
        whom = (
            f"about {calibration.n_walks} walks" if calibration.n_people is None else f"{calibration.n_people} persons"
        )
        least = FEW_WALKS if calibration.n_people is None else FEW_PEOPLE
        project.say(
            f"warning[W406]: camera {camera_id} is calibrated from {whom}, fewer than {least}: distances along the "
            "view may be a quarter off. Record for ten minutes or more, and calibrate again; or measure points: "
            f"vsd calibrate {camera_id} --draw"
        )
    return done, calibration


def _from_lines(
    project: Project, camera_id: str, picture: Path, *, height_m: float, since: datetime | None, as_json: bool
) -> int:
    """Calibrate a camera from the straight lines of a picture, and put the result into force."""
    import numpy as np

    from vsd_analytics.engine.vanishing_points import camera_from_lines
    from vsd_analytics.site.cameras_by_name import camera_called

    known = camera_called(project.site, camera_id).picture_px
    estimate = camera_from_lines(picture, height_m=height_m)
    if known is not None and known != estimate.size_px:
        sizes = ["{}x{}".format(*size) for size in (estimate.size_px, known)]
        raise UsageError(
            f"{picture.name} has {sizes[0]} pixels, and the camera's pictures {sizes[1]}",
            fix="give a picture as the engine sees it",
        )
    camera = estimate.camera
    tilt, roll, spread = np.degrees([camera.tilt_rad, camera.roll_rad, estimate.tilt_sd_rad])
    focal = camera.focal_px / estimate.size_px[0]
    done = _put_into_force(project, camera_id, camera.homography(), since=since)
    lines = [
        f"{camera_id}: from {estimate.n_segments} straight edges, {estimate.share:.0%} of their length in three "
        "directions",
        f"tilt {tilt:.1f} degrees (one sd {spread:.1f}), roll {roll:.1f} degrees, "
        f"focal length {focal:.2f} picture widths",
        f"distances are as right as the height given, {height_m:g} m",
        *_lines(done)[1:],
    ]
    more: dict[str, object] = {
        "height_m": height_m,
        "tilt_deg": round(float(tilt), 2),
        "roll_deg": round(float(roll), 2),
        "focal_px": round(camera.focal_px, 1),
        "tilt_sd_deg": round(float(spread), 2),
        "n_segments": estimate.n_segments,
        "share_of_length": round(estimate.share, 3),
    }
    return _shown(project, done, lines, more, as_json=as_json)


def _from_camera_files(
    project: Project,
    camera_id: str,
    files: tuple[Path, ...],
    *,
    unit: str,
    size: str | None,
    since: datetime | None,
    as_json: bool,
) -> int:
    """Calibrate a camera from files that describe it, and put the result into force."""
    from vsd_analytics.config import calibrate as calibration
    from vsd_analytics.geometry.camera_files import floor_fit, read_camera
    from vsd_analytics.site.cameras_by_name import camera_called

    picture_px = _picture_px(camera_called(project.site, camera_id), size)
    fit = floor_fit(read_camera(files, unit_m={"m": 1.0, "cm": 0.01, "mm": 0.001}[unit]), picture_px=picture_px)
    done = _put_into_force(project, camera_id, fit.homography, since=since)
    calibration.state_error(project.site.root / done.file, calibration_id=done.calibration_id, error_m=fit.error_m)
    lines = [f"{camera_id}: given camera without lens distortion", *_lines(done)[1:]]
    if fit.error_m:
        left = f"{fit.error_m:.2f} m (root mean square), {fit.worst_m:.2f} m at most"
        lines[0] = f"{camera_id}: given camera; the best homography leaves of the lens distortion {left}"
    more: dict[str, object] = {"lens_error_m": round(fit.error_m, 4), "lens_worst_m": round(fit.worst_m, 4)}
    return _shown(project, done, lines, more, as_json=as_json)


def _put_into_force(
    project: Project, camera_id: str, homography: NDArray[np.float64], *, since: datetime | None
) -> Calibrated:
    import tempfile

    import numpy as np

    from vsd_analytics.config import calibrate as calibration

    with tempfile.TemporaryDirectory() as folder:
        matrix = Path(folder) / f"{camera_id}.txt"
        np.savetxt(matrix, homography, fmt="%.12g")
        return calibration.calibrate(project.site, camera_id=camera_id, matrix=matrix, valid_from=since)


def _check(project: Project, camera_id: str, source: Path, *, size: str | None, as_json: bool) -> int:
    """Tell whether a camera has moved since its latest calibration; 1 when it has, or when nobody can tell."""
    from vsd_analytics.cli import moved_cameras
    from vsd_analytics.engine.ignored_parts import in_parts
    from vsd_analytics.engine.people_files import read_each_once
    from vsd_analytics.site.cameras_by_name import camera_called

    camera = camera_called(project.site, camera_id)
    picture_px = _picture_px(camera, size)
    every = read_each_once(source, size_px=picture_px)
    people = every.rows(~in_parts(every.outline, camera.ignore_px))
    ts_ms = moved_cameras.timed(people, source)
    check = moved_cameras.check_people(camera, people, ts_ms=ts_ms, size_px=picture_px)
    if check is None:
        raise UsageError(
            f"camera {camera_id!r} has no calibration to check",
            why="its matrix is that of no camera above a floor" if camera.calibrations else None,
            fix=f"vsd calibrate {camera_id} --from-people {source} --size {picture_px[0]}x{picture_px[1]}",
        )
    if as_json:
        emit_json({"camera_id": camera_id, **moved_cameras.check_dict(check, zone=project.site.timezone)})
    else:
        for line in moved_cameras.check_lines(camera_id, check):
            click.echo(line)
        moved_cameras.warn_of_moves(project, camera, check, source)
    return 1 if check.moves or check.least_deg is None else 0


def _picture_px(camera: Camera, size: str | None) -> tuple[int, int]:
    from vsd_analytics.cli.options import known_size, parse_size

    return known_size(camera, camera.picture_px if size is None else parse_size(size))


def _people_lines(done: Calibrated, calibration: FromPeople) -> list[str]:
    import numpy as np

    camera = calibration.camera
    what = "skeletons" if calibration.uses_joints else "boxes"
    who = (
        ""
        if calibration.n_people is None
        else f" of {calibration.n_people:,} persons, {calibration.n_walkers:,} of them walking"
    )
    near, far = np.quantile(calibration.map[:, 2], [0.1, 0.9])
    tilt, roll = np.degrees([camera.tilt_rad, camera.roll_rad])
    return [
        f"{done.camera_id}: from {calibration.n_rows:,} {what}{who}",
        f"camera {camera.height_m:.2f} m high, tilt {tilt:.1f} degrees, roll {roll:.1f} degrees, "
        f"focal length {camera.focal_px / calibration.size_px[0]:.2f} picture widths",
        f"error (one sd): distances {calibration.error:.0%} by the camera; 2 m with the feet's error ±{near:.2f} m in "
        f"the best tenth of the floor, ±{far:.2f} m in the worst",
        *_lines(done)[1:],
    ]


def _people_dict(calibration: FromPeople) -> dict[str, object]:
    import numpy as np

    camera = calibration.camera
    return {
        "height_m": round(camera.height_m, 3),
        "tilt_deg": round(float(np.degrees(camera.tilt_rad)), 2),
        "roll_deg": round(float(np.degrees(camera.roll_rad)), 2),
        "focal_px": round(camera.focal_px, 1),
        "n_rows": calibration.n_rows,
        "n_people": calibration.n_people,
        "n_walks": calibration.n_walks,
        "is_of_few": calibration.is_of_few,
        "n_walkers": calibration.n_walkers,
        "distance_error": round(calibration.error, 4),
        "error_map": [
            dict(zip(("x_m", "y_m", "sd_of_2_m", "camera_part"), row, strict=True))
            for row in calibration.map.round(3).tolist()
        ],
    }


def _lines(done: Calibrated) -> list[str]:
    lines = [f"{done.camera_id}: given matrix, nothing to measure its error by"]
    if done.error_m is not None and done.worst_m is not None:
        rms, worst = f"{done.error_m * 100:.1f} cm (root mean square)", f"{done.worst_m * 100:.1f} cm"
        lines = [f"{done.camera_id}: {done.n_points} points, error {rms}, worst {worst} at point {done.worst_point}"]
    return [
        *lines,
        f"{done.file}   calibration {done.calibration_id}",
        f"{done.overlay}   look: 1 m squares on the floor",
    ]


def _as_dict(done: Calibrated) -> dict[str, object]:
    warnings = [{"code": code, "message": sentence} for code, sentence in done.warnings]
    return {**asdict(done), "warnings": warnings}
