"""`vsd evaluate`: how good an engine's messages are, against true positions."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import json_option, path_option
from vsd_analytics.cli.output import count, emit_json, rounded
from vsd_analytics.cli.project import Project, pass_project

if TYPE_CHECKING:
    from vsd_analytics.engine.evaluation import Evaluation
    from vsd_analytics.engine.scores import Score, Scores


@click.command()
@click.argument("messages", type=click.Path(path_type=Path))
@path_option("--truth", help="CSV of true positions: frame or ts, track_id, x_m, y_m.")
@click.option(
    "--distance",
    "distance_m",
    type=click.FloatRange(min=0, min_open=True),
    default=2.0,
    metavar="METRES",
    help="Pairs closer than this violate (default: 2).",
)
@click.option("--size", metavar="WxH", help="Picture size of a data set without images.")
@json_option
@pass_project
def evaluate(
    project: Project, messages: Path, truth: Path | None, distance_m: float, size: str | None, as_json: bool
) -> None:
    """Compare an engine's frame messages with true positions: precision, recall and F1 of pairs and persons.

    Scores are pooled over all frames, and averaged over frames. Their 95 % intervals come from blocks of time. Persons
    are compared by their track id. Only frames that both files have are scored.

    A folder with Images, HumanJoints and Annotations, as the paper's authors published, needs no --truth: the ratios
    are searched for each part of the body, and the calibration from people is scored beside them.

    \b
    Example:
      vsd evaluate frames.jsonl --truth positions.csv
      vsd evaluate frames.jsonl --truth positions.csv --distance 1.5 --json
    """
    from vsd_analytics.engine.evaluation import evaluate as compare
    from vsd_analytics.engine.truth import read_messages, read_positions
    from vsd_analytics.errors import UsageError

    if messages.is_dir():
        _data_set(project, messages, distance_m=distance_m, size=size, as_json=as_json)
        return
    if truth is None:
        raise UsageError("nothing to compare the messages with", fix=f"vsd evaluate {messages} --truth positions.csv")
    positions = read_positions(truth)
    done = compare(read_messages(messages, clock=positions.clock), positions, distance_m=distance_m)
    if positions.n_bad:
        project.say(f"warning: {positions.n_bad:,} rows of {truth.name} have no usable position")
    if as_json:
        emit_json(rounded(_as_dict(done)))
        return
    for line in _lines(done):
        click.echo(line)


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
    for what in ("pairs", "persons"):
        values[what] = dict(zip(("pooled", "frame_mean"), values[what], strict=True))
    return values


def _lines(done: Evaluation) -> list[str]:
    scored = f"{done.n_frames:,} frames, {done.n_true_pairs:,} true and {done.n_found_pairs:,} found violations"
    lines = [
        f"{scored} (closer than {done.distance_m:g} m)",
        f"{'':<20}{'precision':<20}{'recall':<20}{'F1':<20}",
    ]
    for what, (of_all, of_frames) in (("pairs", done.pairs), ("persons", done.persons)):
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
