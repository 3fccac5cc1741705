"""`vsd evaluate`: how good an engine's messages are, against true positions."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import FilePath, json_option, path_option
from vsd_analytics.cli.output import count, emit_json, rounded
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vsd_analytics.engine.evaluation import Evaluation
    from vsd_analytics.engine.scores import Score, Scores
    from vsd_analytics.site.model import Camera


@click.command()
@click.argument("messages", type=FilePath())
@path_option("--truth", help="CSV of true positions: frame or ts, track_id, x_m, y_m.")
@click.option(
    "--distance",
    "distance_m",
    type=click.FloatRange(min=0, min_open=True),
    default=2.0,
    metavar="METRES",
    help="Pairs closer than this violate (default: 2).",
)
@click.option(
    "--by",
    type=click.Choice(["id", "place"]),
    help="How persons are brought together: by track id (default), or by where they are.",
)
@click.option(
    "--within",
    "within_m",
    type=click.FloatRange(min=0, min_open=True),
    metavar="METRES",
    help="With --by place: persons farther apart are not the same (default: 1).",
)
@click.option(
    "--ignore",
    "uncounted",
    multiple=True,
    metavar="AREA|CAMERA|FILE",
    help="Area in which nobody counts, camera whose ignore_px does not count, or CSV of area,x_m,y_m; may be repeated.",
)
@click.option("--size", metavar="WxH", help="Picture size of a data set without images.")
@json_option
@pass_project
def evaluate(
    project: Project,
    messages: Path,
    truth: Path | None,
    distance_m: float,
    by: str | None,
    within_m: float | None,
    uncounted: tuple[str, ...],
    size: str | None,
    as_json: bool,
) -> None:
    """Compare an engine's frame messages with true positions: precision, recall and F1 of pairs and persons.

    Scores are pooled over all frames, and averaged over frames. Their 95 % intervals come from blocks of time. Persons
    are compared by their track id, or with --by place by where they are: as many as possible within a metre, then the
    nearest. Only frames that both files have are scored. Where a truth leaves real people out, name that area with
    --ignore.

    A folder with Images, HumanJoints and Annotations, as the paper's authors published, needs no --truth: the ratios
    are searched for each part of the body, and the calibration from people is scored beside them.

    \b
    Example:
      vsd evaluate frames.jsonl --truth positions.csv
      vsd evaluate frames.jsonl --truth positions.csv --distance 1.5 --json
      vsd evaluate frames.jsonl --truth positions.csv --by place --ignore far-end
    """
    from vsd_analytics.engine.evaluation import evaluate as compare
    from vsd_analytics.engine.place_matching import WITHIN_M, matched_by_place, without_uncounted
    from vsd_analytics.engine.truth import read_messages, read_positions

    if within_m is not None and by != "place":
        raise UsageError("--within belongs to --by place", fix="--by place")
    if messages.is_dir():
        if spare := [name for name, value in (("--by", by), ("--ignore", uncounted), ("--truth", truth)) if value]:
            raise UsageError(f"a data set has its own truth and ids; {spare[0]} is for messages", fix="leave it out")
        _data_set(project, messages, distance_m=distance_m, size=size, as_json=as_json)
        return
    if truth is None:
        raise UsageError("nothing to compare the messages with", fix=f"vsd evaluate {messages} --truth positions.csv")
    if size is not None:
        raise UsageError("--size belongs to a data set without images", fix="leave out --size")
    positions = read_positions(truth)
    detections = read_messages(messages, clock=positions.clock, keeps_unnamed=by == "place")
    if by == "place":
        detections = matched_by_place(detections, positions, within_m=WITHIN_M if within_m is None else within_m)
    counted, left_out = positions, [0, 0]
    if uncounted:
        areas = [corners for name in uncounted for corners in _areas(project, name)]
        detections, counted, *left_out = without_uncounted(detections, positions, areas)
    done = compare(detections, counted, distance_m=distance_m)
    if positions.n_bad:
        project.say(f"warning: {positions.n_bad:,} rows of {truth.name} have no usable position")
    if as_json:
        more = {"n_uncounted": dict(zip(("found", "true"), left_out, strict=True))} if uncounted else {}
        emit_json(rounded({**_as_dict(done), **more}))
        return
    for line in _lines(done):
        click.echo(line)
    if uncounted:
        click.echo(f"{left_out[0]:,} found and {left_out[1]:,} true persons in areas that do not count")


def _areas(project: Project, name: str) -> list[NDArray[np.float64]]:
    """Return the corners of an area of vsd.toml, of what a camera ignores of the floor, or of all areas of a file."""
    import numpy as np

    from vsd_analytics.engine.truth import read_areas_csv

    if Path(name).suffix.lower() == ".csv":
        return read_areas_csv(Path(name))
    area = next((area for area in project.site.areas if area.area_id == name), None)
    camera = next((camera for camera in project.site.cameras if camera.camera_id == name), None)
    if area is None and camera is not None:
        return _ignored_by(camera)
    if area is None:
        known = ", ".join(area.area_id for area in project.site.areas) or "it has none"
        raise UsageError(f"--ignore: there is no area {name!r} in vsd.toml", why=known, fix="--ignore areas.csv")
    return [np.array(area.polygon, dtype=np.float64)]


def _ignored_by(camera: Camera) -> list[NDArray[np.float64]]:
    """Return the corners of the floor that a camera ignores, by its latest calibration."""
    import numpy as np
    import shapely

    from vsd_analytics.geometry.camera_views import ignored_floor

    floor = ignored_floor(camera, camera.calibrations[-1] if camera.calibrations else None)
    if floor is None:
        raise UsageError(
            f"--ignore: camera {camera.camera_id!r} ignores nothing that lies on a known floor",
            why="it needs ignore_px, picture_px and a calibration",
            fix="under its [[camera]]: ignore_px = [[[0, 0], [400, 0], [400, 300], [0, 300]]]",
        )
    parts = [part for part in shapely.get_parts(floor) if part.geom_type == "Polygon"]
    return [np.asarray(part.exterior.coords[:-1], dtype=np.float64) for part in parts]


def _data_set(project: Project, folder: Path, *, distance_m: float, size: str | None, as_json: bool) -> None:
    """Print the paper's tables for a folder of its layout."""
    from vsd_analytics.cli.options import parse_size
    from vsd_analytics.engine.published_layout import read_sequences
    from vsd_analytics.engine.reproduction import reproduce

    sequences = read_sequences(folder, size_px=parse_size(size) if size else None)
    for sequence in sequences:
        if sequence.n_unknown:
            project.say(
                f"warning: {sequence.name}: {count(sequence.n_unknown, 'annotated person')} not in the files of joints"
            )
        for why, n in sequence.people.bad.items():
            project.say(f"warning: {sequence.name}: {n:,}: {why}")
    rows = reproduce(sequences, distance_m=distance_m)
    if as_json:
        emit_json(rounded({"distance_m": distance_m, "rows": [asdict(row) for row in rows]}))
        return
    click.echo(f"persons closer than {distance_m:g} m to somebody, mean over frames; pairs pooled over frames")
    heads = f"{'F1 persons':<20}{'0/0 as 0':<10}{'torso ratios':<14}{'F1 pairs':<20}setting"
    click.echo(f"{'sequence':<28}{'method':<8}{heads}")
    for row in rows:
        scores = f"{_text(row.persons.f1):<20}{_number(row.f1_published):<10}{_number(row.f1_torso_ratios):<14}"
        click.echo(f"{row.sequence:<28}{row.method:<8}{scores}{_text(row.pairs.f1):<20}{row.setting}".rstrip())


def _as_dict(done: Evaluation) -> dict[str, Any]:
    values = asdict(done)
    for what in ("pairs", "persons", "detection"):
        values[what] = dict(zip(("pooled", "frame_mean"), values[what], strict=True))
    return values


def _lines(done: Evaluation) -> list[str]:
    scored = f"{done.n_frames:,} frames, {done.n_true_pairs:,} true and {done.n_found_pairs:,} found violations"
    lines = [
        f"{scored} (closer than {done.distance_m:g} m)",
        f"{'':<20}{'precision':<20}{'recall':<20}{'F1':<20}",
    ]
    for what, (of_all, of_frames) in (
        ("pairs", done.pairs),
        ("persons", done.persons),
        ("all people", done.detection),
    ):
        lines += [_row(f"{what}, pooled", of_all), _row(f"{what}, frame mean", of_frames)]
    if done.n_distances:
        lines.append(
            f"distance error: median {done.distance_error:.1%} over {done.n_distances:,} pairs of persons up to 6 m, "
            f"median bias {done.distance_bias:+.1%}"
        )
    for n, what in (
        (done.n_unlabelled, "frames without truth are not scored"),
        (done.n_unprocessed, "frames without a message are not scored"),
        (done.n_unnamed, "persons without an id are not compared"),
    ):
        if n:
            lines.append(f"{n:,} {what}")
    return lines


def _row(name: str, scores: Scores) -> str:
    return f"{name:<20}" + "".join(f"{_text(s):<20}" for s in (scores.precision, scores.recall, scores.f1)).rstrip()


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3f}"


def _text(score: Score) -> str:
    return f"{score.value:.3f} ({score.lo:.3f}–{score.hi:.3f})" if score.value == score.value else "–"
