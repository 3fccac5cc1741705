"""`vsd calibrate`: a camera's map from picture to floor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.instants import instant
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json
from vsd_analytics.cli.project import Project, pass_project

if TYPE_CHECKING:
    from vsd_analytics.config.calibrate import Calibrated


@click.command()
@click.argument("camera")
@click.option(
    "--matrix", type=click.Path(path_type=Path), metavar="FILE", help="3x3 homography, picture px to floor m."
)
@click.option("--points", type=click.Path(path_type=Path), metavar="FILE", help="CSV of u,v,x,y: four points or more.")
@click.option("--from", "valid_from", metavar="INSTANT", help="When the camera was put there (default: always).")
@json_option
@pass_project
def calibrate(
    project: Project, camera: str, matrix: Path | None, points: Path | None, valid_from: str | None, as_json: bool
) -> int:
    """Compute a camera's homography from picture to floor, and draw a picture to check it.

    Without --matrix and --points, draw the calibration in force again.

    \b
    Example:
      vsd calibrate cam-1 --points points.csv
      vsd calibrate cam-1 --matrix cam-1.txt --from 2026-11-01T07:00
      vsd calibrate cam-1
    """
    from vsd_analytics.config import calibrate as calibration
    from vsd_analytics.errors import UsageError

    if matrix is not None and points is not None:
        raise UsageError("--matrix and --points exclude each other", fix="give one of them")
    since = None if valid_from is None else instant(valid_from, zone=project.site.timezone, what="--from")
    done = calibration.calibrate(project.site, camera_id=camera, matrix=matrix, points=points, valid_from=since)
    if as_json:
        emit_json(_as_dict(done))
    else:
        for line in _lines(done):
            click.echo(line)
        for code, sentence in done.warnings:
            project.say(f"warning[{code}]: {sentence}")
    return 1 if {"W402", "W403"} & {code for code, _ in done.warnings} else 0


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
    return {
        "camera_id": done.camera_id,
        "file": str(done.file),
        "overlay": str(done.overlay),
        "calibration_id": done.calibration_id,
        "n_points": done.n_points,
        "error_m": done.error_m,
        "worst_m": done.worst_m,
        "worst_point": done.worst_point,
        "is_in_force": done.is_in_force,
        "warnings": [{"code": code, "message": sentence} for code, sentence in done.warnings],
    }
