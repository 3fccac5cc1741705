"""`vsd engine probe`: what is understood of a model, and what it finds in a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.detection import chosen_detector, detector_settings
from vsd_analytics.cli.options import FilePath, json_option, path_option
from vsd_analytics.cli.output import count, emit_json, plain, rounded
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import InputError, UsageError, Where

if TYPE_CHECKING:
    from vsd_analytics.engine.detector import Detector


@click.command()
@click.argument("model", type=FilePath())
@click.argument("picture", type=FilePath())
@path_option("--out", help="JPEG to write with what was found (default: PICTURE with -probe at the end of its name).")
@detector_settings
@json_option
@pass_project
def probe(project: Project, /, model: Path, picture: Path, out: Path | None, as_json: bool, **given: Any) -> int:
    """Say what is understood of MODEL, run it on PICTURE, and draw the people that it finds.

    The picture written shows people: delete it when you have looked at it. Needs no project.

    \b
    Example:
      vsd engine probe nanodet.onnx door.jpg
      vsd engine probe rtmdet.onnx door.jpg --joints rtmpose.onnx --tile 640
    """
    from vsd_analytics.engine.overlay import draw_detections
    from vsd_analytics.engine.pictures import read_picture
    from vsd_analytics.engine.tiles import tiles_of
    from vsd_analytics.owners import is_there
    from vsd_analytics.store.durable import publish

    chosen = chosen_detector({**given, "detector": model})
    assert chosen is not None
    detector = chosen.opened()
    if not is_there(picture):
        raise InputError(f"there is no file {picture}", code="E201", where=Where(str(picture)), fix="check the path")
    pixels = read_picture(picture)
    if pixels is None:
        raise InputError(
            f"cannot read {picture.name} as a picture",
            code="E205",
            where=Where(str(picture)),
            fix="give a PNG, JPEG or WebP file; vsd engine run takes videos",
        )
    to = picture.with_name(f"{picture.stem}-probe.jpg") if out is None else out
    if to.resolve() == picture.resolve():
        raise UsageError("--out is the picture itself", fix="--out look.jpg")
    size_px = (int(pixels.shape[1]), int(pixels.shape[0]))
    side = chosen.tile_px
    tiles = tiles_of(size_px, side_px=side, overlap_px=(side // 8, side // 4)) if side else None
    people = detector.people(pixels, tiles=tiles)
    publish(to, draw_detections(pixels, people))
    if as_json:
        emit_json(rounded({**_understood(detector), "people": _people(people), "picture": str(to)}))
        return 0
    for line in _lines(detector):
        click.echo(plain(line))
    parts = f" in {len(tiles)} parts" if tiles else ""
    click.echo(plain(f"{picture.name}: {count(len(people), 'person').replace('persons', 'people')}{parts}"))
    for box, score in zip(people.box.round().astype(int).tolist(), people.score.tolist(), strict=True):
        click.echo(f"  score {score:.2f}  {box[0]}, {box[1]} to {box[2]}, {box[3]}")
    click.echo(plain(f"{to}   look: it shows people; delete it afterwards"))
    if not len(people):
        project.say(
            "nobody found: is somebody in the picture? Try --score 0.2; else colours, mean, sd or person may be "
            f"others: say so in {model.with_suffix('.toml').name} beside the model (docs/detectors.md)"
        )
    return 0


def _understood(detector: Detector) -> dict[str, Any]:
    preparation = detector.decoder.preparation
    return {
        "family": detector.decoder.family,
        "has_joints": detector.decoder.has_joints or detector.joint_finder is not None,
        "signature": str(detector.network.signature),
        "provider": detector.network.provider,
        "size_px": list(preparation.size_px),
        "fit": preparation.fit,
        "colours": "rgb" if preparation.is_rgb else "bgr",
        "mean": list(preparation.mean),
        "sd": list(preparation.sd),
    }


def _lines(detector: Detector) -> list[str]:
    seen = _understood(detector)
    joints = " with joints" if seen["has_joints"] else ""
    finder = "" if detector.joint_finder is None else f" of {detector.joint_finder.decoder.family}"
    numbers = {key: ", ".join(f"{value:g}" for value in seen[key]) for key in ("mean", "sd")}
    return [
        f"{detector.network.path.name}: {seen['family']}, boxes{joints}{finder}",
        f"  {seen['signature']}",
        f"  input {seen['size_px'][0]}x{seen['size_px'][1]}, {seen['colours']}, fit {seen['fit']}, "
        f"mean {numbers['mean']}, sd {numbers['sd']}; on {seen['provider'].removesuffix('ExecutionProvider').lower()}",
    ]


def _people(people: Any) -> list[dict[str, Any]]:
    return [
        {"score": float(score), "box_px": box.tolist()} for box, score in zip(people.box, people.score, strict=True)
    ]
