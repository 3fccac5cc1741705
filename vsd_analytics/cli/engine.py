"""`vsd engine run`: the reference engine, from pictures, joints or boxes to frame messages."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.calibrate import put_into_force_from_people
from vsd_analytics.cli.detection import (
    ChosenDetector,
    chosen_detector,
    detector_options,
    journal_path,
    people_of_source,
    store_messages,
)
from vsd_analytics.cli.engine_live import live
from vsd_analytics.cli.engine_probe import probe
from vsd_analytics.cli.located_people import (
    DetectedPeople,
    by_calibrations,
    by_monoloco,
    by_paper,
    check_calibrated,
)
from vsd_analytics.cli.options import FilePath, json_option, parse_size, path_option
from vsd_analytics.cli.output import count, emit_json, plain
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError
from vsd_analytics.site.instants import instant

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vsd_analytics.cli.located_people import LocatedParts
    from vsd_analytics.engine.monoloco_files import MonolocoPeople
    from vsd_analytics.engine.people import People
    from vsd_analytics.engine.ratios import Ratios

NAMED = 5
"""So many pictures that cannot be read are named on the terminal; --json has all."""
NO_CLOCK = "2000-01-01T00:00:00Z"
"""Instant of frame 0 where nothing says when it was: visibly not a time of a camera."""


@click.group()
def engine() -> None:
    """Find people too close to each other, in pictures or in the joints or boxes of any detector.

    \b
    Example:
      vsd engine probe model.onnx picture.jpg
      vsd engine run door.mp4 --camera cam-1 --detector model.onnx --start 2026-11-09T08:00 --track
      vsd engine run people.csv --camera cam-1 --out frames.jsonl
    """


engine.add_command(live)
engine.add_command(probe)


@engine.command()
@click.argument("source", type=FilePath())
@click.option("--camera", "camera_id", required=True, metavar="ID", help="Camera of vsd.toml that saw them.")
@path_option("--out", help="JSON Lines file to write (default: straight into the store).")
@click.option(
    "--method",
    type=click.Choice(["people", "paper", "monoloco"]),
    default="people",
    help="people: metres by the camera's calibration (default). paper: overlap of safe spaces by two ratios. "
    "monoloco: Monoloco's own metres, turned level.",
)
@click.option(
    "--part",
    type=click.Choice(["torso", "leg", "arm", "box"]),
    help="Part of the body that measures, with --method paper (default: torso, or box where there are no joints).",
)
@click.option("--ratios", metavar="RH,RV", default="0.7,0.7", help="Horizontal and vertical ratio (default: 0.7,0.7).")
@click.option(
    "--convention",
    type=click.Choice(["inset", "share"]),
    default="inset",
    help="What the ratios mean: inset, as in the published code (default), or share, as the paper defines them.",
)
@click.option(
    "--track", is_flag=True, help="Give people track ids by following them on the floor (not with --method paper)."
)
@click.option("--size", metavar="WxH", help="Picture size in pixels (default: picture_px of the camera).")
@click.option(
    "--hz",
    "--fps",
    "hz",
    type=click.FloatRange(min=0, min_open=True),
    help="Frames a second, of pictures those that are taken (default: hz of the camera, else 1).",
)
@click.option(
    "--start", metavar="INSTANT", help="When frame 0 was, for files without ts; without an offset on the site's clock."
)
@path_option(
    "--overlay",
    metavar="DIR",
    help="Draw a picture of each frame: skeletons or boxes, safe spaces, and lines between people too close.",
)
@path_option(
    "--pictures",
    metavar="FOLDER|VIDEO",
    help="What --overlay draws on: the camera's pictures, the last number in a name is the frame's (default: grey).",
)
@detector_options
@click.option(
    "--from-people",
    "is_calibrated",
    is_flag=True,
    help="First calibrate the camera from the people that --detector finds here (as vsd calibrate does).",
)
@click.option(
    "--without-statues",
    is_flag=True,
    help="Leave out people whom --detector finds at one spot for hours: mannequins, pictures of people.",
)
@json_option
@pass_project
def run(
    project: Project,
    /,
    source: Path,
    camera_id: str,
    out: Path | None,
    method: str,
    part: str | None,
    ratios: str,
    convention: str,
    track: bool,
    size: str | None,
    hz: float | None,
    start: str | None,
    overlay: Path | None,
    pictures: Path | None,
    is_calibrated: bool,
    without_statues: bool,
    as_json: bool,
    **given: Any,
) -> int:
    """Turn pictures, or the people of a detector, into frame messages that vsd ingest reads.

    SOURCE is a video, a folder of pictures or a picture, with --detector. Or it comes from a detector: an OpenPose or
    Monoloco folder, a JSON file of COCO-17, HALPE-26 or BODY_25 joints, a folder of ultralytics labels, or a CSV
    file of boxes: frame or ts, track_id (may be absent), left, top, right, bottom.

    With --overlay and --pictures, people are on the pictures written: they are personal data, and nothing deletes them.

    \b
    Example:
      vsd engine run people.csv --camera cam-1 --out frames.jsonl
      vsd engine run joints/ --camera cam-1 --hz 25 --start 2026-11-09T08:00 --out frames.jsonl
      vsd engine run boxes.csv --camera cam-1 --hz 2 --start 2026-11-09T08:00 --track --out frames.jsonl
      vsd engine run joints/ --camera cam-1 --method paper --ratios 0.5,0.8 --out frames.jsonl
      vsd engine run monoloco/ --camera cam-1 --method monoloco --track --hz 10 --out frames.jsonl
      vsd engine run joints/ --camera cam-1 --out frames.jsonl --overlay look/ --pictures door.mp4
      vsd engine run door.mp4 --camera cam-1 --detector model.onnx --start 2026-11-09T08:00 --track
    """
    from vsd_analytics.engine.ignored_parts import engine_ignoring, in_parts
    from vsd_analytics.engine.messages import frame_messages, instants_ms
    from vsd_analytics.engine.monoloco_files import read_monoloco
    from vsd_analytics.engine.people_files import read_each_once, read_people
    from vsd_analytics.engine.seen import IGNORED
    from vsd_analytics.site.cameras_by_name import camera_called
    from vsd_analytics.store.durable import publish

    if track and method == "paper":
        raise UsageError("--track needs metres on the floor", fix="leave out --method paper")
    if pictures is not None and overlay is None:
        raise UsageError("--pictures is what --overlay draws on", fix="--overlay overlay/")
    camera = camera_called(project.site, camera_id, option="--camera")
    picture_px = parse_size(size) if size else camera.picture_px
    rate = hz or camera.hz or 1.0
    begin = instant(start or NO_CLOCK, zone=project.site.timezone, what="--start")
    detector = chosen_detector(given)
    if is_calibrated and detector is None:
        raise UsageError(
            "--from-people belongs to --detector", fix=f"vsd calibrate {camera_id} --from-people {source}, then this"
        )
    if is_calibrated and (measured := next((c for c in camera.calibrations if not c.error_cells), None)) is not None:
        known = "vsd.toml" if measured.source is None else measured.source.name
        raise UsageError(
            f"camera {camera_id!r} has a calibration that was not made from people ({known}), and it would be replaced",
            why="distances of one made from people are less certain, and all records of the camera would get them",
            fix="leave --from-people out; to replace it all the same, first take it out of vsd.toml and calibration/",
        )
    if without_statues and detector is None:
        raise UsageError("--without-statues belongs to --detector", fix="leave it out")
    _check_source(source, detector, method=method, size=size)
    if out is None and start is None and not _has_times(source, detector):
        raise UsageError(
            f"nothing says when the frames of {source.name} were, and the store needs to know",
            fix="--start 2026-11-09T08:00, or --out frames.jsonl for messages without a true time",
        )
    if method == "people" and not is_calibrated:
        check_calibrated(camera, is_of_pictures=detector is not None)
    own = read_monoloco(source) if method == "monoloco" else None
    journal, seq = journal_path(project, source, camera_id, out), None
    if detector is not None:
        every, shots = people_of_source(
            project, source, detector, hz=rate, camera=camera, journal_path=journal, quiet=as_json
        )
        people, ts_ms, picture_px, seq = every.people(), every.ms, shots.size_px, every.seq
        if shots.has_clock:
            people = replace(people, ts_ms=ts_ms)
        else:
            ts_ms = ts_ms + round(begin.timestamp() * 1000)
        people, still = _statues(people, ts_ms, is_left_out=without_statues)
        pictures = source if overlay is not None and pictures is None else pictures
    else:
        read = read_people if method == "paper" else read_each_once  # the paper's method takes skeletons as they are
        people = read(source, size_px=picture_px) if own is None else own.people
        ts_ms = instants_ms(people, start=begin, hz=rate)
    is_ignored = in_parts(people.outline, camera.ignore_px)
    people = people.rows(~is_ignored)
    own = None if own is None else own.rows(~is_ignored)
    if is_calibrated:
        assert picture_px is not None
        put_into_force_from_people(project, camera_id, replace(people, ts_ms=ts_ms), size_px=picture_px)
        project = project.inside(project.root)  # reads the calibration that is in force now
        camera = camera_called(project.site, camera_id, option="--camera")
    if out is None and people.ts_ms is None and start is None:
        raise UsageError(f"{source.name} has no ts, and the store needs times", fix="--start 2026-11-09T08:00 --hz 1")
    if people.ts_ms is None and start is None:
        project.say(
            f"warning: {source.name} has no ts: frame 0 is put at {NO_CLOCK}, {rate:g} frames a second; "
            f"give --start and --hz before you ingest it"
        )
    detected = DetectedPeople(
        project, camera, people, picture_px, ts_ms, is_tracked=track, is_of_pictures=detector is not None
    )
    moves: list[dict[str, object]] = []
    if method == "paper":
        parts = [(by_paper(detected, part=part, ratios=_ratios(ratios, convention)), ts_ms)]
    else:
        parts = by_calibrations(detected) if own is None else by_monoloco(detected, own)
        moves = _moves(detected, source)
    parts = [(replace(seen, engine=engine_ignoring(seen.engine, camera.ignore_px)), when) for seen, when in parts]
    drawn = {} if overlay is None else _overlay(detected, parts, to=overlay, on=pictures)
    lines = [line for seen, when in parts for line in frame_messages(seen, camera=camera_id, ts_ms=when, seq=seq)]
    text = b"".join(line + b"\n" for line in lines)
    if out is None:
        stored = store_messages(project, text, name=f"{camera_id}-{source.stem}.jsonl")
    else:
        publish(out, text)
    if detector is not None:
        journal.unlink(missing_ok=True)
    done = {
        "file": None if out is None else str(out),
        **({"stored": stored} if out is None else {}),
        "engine": ", ".join(seen.engine for seen, _ in parts),
        "frames": len(lines),
        "persons": sum(len(seen.people) for seen, _ in parts),
        "pairs": sum(len(seen.a) for seen, _ in parts),
        "left_out": dict(sum((Counter(seen.left_out) for seen, _ in parts), Counter({IGNORED: int(is_ignored.sum())}))),
        "bad_rows": dict(people.bad),
        **({} if detector is None else {"unread": every.unread, "boxes": dict(detected.changed), "statues": still}),
        **({} if own is None else _social(own)),
        "moves": moves,
        **drawn,
    }
    if as_json:
        emit_json(done)
    else:
        _print(done)
    return 1 if detector is not None and every.unread else 0


def _has_times(source: Path, detector: ChosenDetector | None) -> bool:
    """Return whether frames of a source carry their times; people of other programs are asked after they are read."""
    from vsd_analytics.engine.pictures import picture_source

    return detector is None or picture_source(source).has_clock


def _statues(people: People, ts_ms: NDArray[np.int64], *, is_left_out: bool) -> tuple[People, list[dict[str, object]]]:
    """Return the people, without those who never move if asked, and where these are."""
    import numpy as np

    from vsd_analytics.engine.statues import statues

    who_stay = statues(people, ts_ms=ts_ms)
    if is_left_out and who_stay:
        people = people.rows(np.setdiff1d(np.arange(len(people)), np.concatenate([statue.rows for statue in who_stay])))
    return people, [
        {"box_px": statue.box.round().astype(int).tolist(), "share_of_frames": round(statue.presence, 3)}
        | {"left_out": is_left_out}
        for statue in who_stay
    ]


def _check_source(source: Path, detector: ChosenDetector | None, *, method: str, size: str | None) -> None:
    """Refuse pictures without a detector, and a detector without pictures."""
    from vsd_analytics.engine.pictures import is_picture_source

    has_pictures = is_picture_source(source)
    if has_pictures and detector is None:
        raise UsageError(
            f"{source.name} has pictures, and nothing finds people in them",
            why="this program has no detector of its own",
            fix="--detector model.onnx; docs/detectors.md names models and their licences",
        )
    if detector is None:
        return
    if source.exists() and not has_pictures:
        raise UsageError(
            f"--detector finds people in pictures, and {source.name} is no video, picture or folder of pictures",
            fix="leave out --detector, or give the video",
        )
    if method == "monoloco" or size is not None:
        raise UsageError("--method monoloco and --size are for people that another program found", fix="leave them out")


def _print(done: dict[str, Any]) -> None:
    frames, persons, pairs = (count(done[what], what[:-1]) for what in ("frames", "persons", "pairs"))
    click.echo(f"{done['file'] or 'store'}: {frames}, {persons}, {pairs} ({done['engine']})")
    if "stored" in done:
        click.echo(f"  {count(done['stored'], 'new record')} stored")
    if done.get("unread"):
        names = ", ".join(done["unread"][:NAMED]) + (", ..." if len(done["unread"]) > NAMED else "")
        click.echo(plain(f"  {count(len(done['unread']), 'picture')} cannot be read: {names}"))
    for statue in done.get("statues", ()):
        left, top, right, bottom = statue["box_px"]
        fate = "left out" if statue["left_out"] else "--without-statues leaves it out"
        click.echo(
            f"  somebody never moves, at {(left + right) // 2}, {(top + bottom) // 2} in the picture "
            f"({statue['share_of_frames']:.0%} of the frames): a mannequin or a picture? {fate}"
        )
    for what, n in done.get("boxes", {}).items():
        click.echo(f"  {count(n, 'box').replace('boxs', 'boxes')}: {what}")
    if "overlay" in done:
        on = f"{done['pictured']:,} of them on the camera's" if done["pictured"] else "on grey ground"
        click.echo(f"{done['overlay']}/: {count(done['pictures'], 'picture')}, {on}")
    if "social_flags" in done:
        flags = done["social_flags"]
        click.echo(
            f"  {flags['persons']:,} of {count(flags['of'], 'person')} flagged by Monoloco's own rule of people who "
            "face each other: not a distance, and not in the messages"
        )
    from vsd_analytics.engine.seen import ABOVE_HORIZON, NO_FOOT, OFF_PLANES

    advice = {
        NO_FOOT: "; they are sent as people without a place: hang the camera higher, or turn it, so that feet are seen",
        ABOVE_HORIZON: "; if that is no picture on a wall, look at the calibration: vsd calibrate draws it",
        OFF_PLANES: "; add a plane to the calibration for where they stand",
    }
    for what, n in done["left_out"].items():
        click.echo(f"  {count(n, 'person')} not used: {what}{advice.get(what, '')}")
    for what, n in ({} if "boxes" in done else done["bad_rows"]).items():
        click.echo(f"  {count(n, 'bad row')}: {what}")


def _ratios(text: str, convention: str) -> Ratios:
    from vsd_analytics.engine.ratios import Ratios

    try:
        horizontal, vertical = (float(word) for word in text.split(","))
    except ValueError:
        raise UsageError(f"--ratios: {text!r} is not two numbers", fix="--ratios 0.7,0.7") from None
    return Ratios(horizontal, vertical, "share" if convention == "share" else "inset")


def _social(own: MonolocoPeople) -> dict[str, object]:
    """Return how many people Monoloco's own rule flags: a judgement of its own, which is no distance."""
    import numpy as np

    judged = np.isfinite(own.is_social)
    if not judged.any():
        return {}
    return {"social_flags": {"persons": int(np.nansum(own.is_social)), "of": int(judged.sum())}}


def _overlay(detected: DetectedPeople, parts: LocatedParts, *, to: Path, on: Path | None) -> dict[str, object]:
    """Draw what was seen; return what was drawn, for `--json`."""
    from vsd_analytics.engine.frame_pictures import frame_pictures
    from vsd_analytics.engine.overlay import OverlayLook, write_overlay
    from vsd_analytics.wording.format import distance

    people, settings = detected.people, detected.project.site.settings
    look = OverlayLook(detected.known_px, settings.distance_m, lambda metres: distance(metres, settings.distance_unit))
    n_pictured = write_overlay(to, parts, pictures=frame_pictures(on, people), source=on, look=look)
    return {"overlay": str(to), "pictures": len(people.frames), "pictured": n_pictured}


def _moves(detected: DetectedPeople, source: Path) -> list[dict[str, object]]:
    """Warn when the camera has moved since its calibration; return its moves for `--json`."""
    from vsd_analytics.cli import moved_cameras

    project, camera = detected.project, detected.camera
    check = moved_cameras.check_people(camera, detected.people, ts_ms=detected.ts_ms, size_px=detected.picture_px)
    if check is None:
        return []
    moved_cameras.warn_of_moves(project, camera, check, source)
    return moved_cameras.moves_list(check, zone=project.site.timezone)
