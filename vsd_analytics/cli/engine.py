"""`vsd engine`: the reference engine, from joints or boxes to frame messages."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from vsd_analytics.cli.options import json_option, known_size, parse_size, path_option
from vsd_analytics.cli.output import count, emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError
from vsd_analytics.site.instants import instant

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vsd_analytics.engine.calibration_error import LikelyCameras
    from vsd_analytics.engine.monoloco_files import MonolocoPeople
    from vsd_analytics.engine.people import People
    from vsd_analytics.engine.ratios import Ratios
    from vsd_analytics.engine.seen import Seen
    from vsd_analytics.site.model import Calibration, Camera, Plane

_Parts: TypeAlias = "list[tuple[Seen, NDArray[np.int64]]]"
"""What was seen under each of a camera's calibrations, and the times of its frames."""

NO_CLOCK = "2000-01-01T00:00:00Z"
"""Instant of frame 0 where nothing says when it was: visibly not a time of a camera."""


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
    """

    project: Project
    camera: Camera
    people: People
    picture_px: tuple[int, int] | None
    ts_ms: NDArray[np.int64]
    is_tracked: bool

    @property
    def known_px(self) -> tuple[int, int]:
        """Return the size of the picture; UsageError E101 where it is not known."""
        return known_size(self.camera, self.picture_px)


@click.group()
def engine() -> None:
    """Find people too close to each other, from the joints or boxes of any detector.

    \b
    Example:
      vsd engine run people.csv --camera cam-1 --out frames.jsonl
    """


@engine.command()
@click.argument("people", type=click.Path(path_type=Path))
@click.option("--camera", "camera_id", required=True, metavar="ID", help="Camera of vsd.toml that saw them.")
@path_option("--out", required=True, help="JSON Lines file to write.")
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
@click.option("--hz", type=click.FloatRange(min=0, min_open=True), help="Frames a second (default: hz of the camera).")
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
@json_option
@pass_project
def run(
    project: Project,
    people: Path,
    camera_id: str,
    out: Path,
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
    as_json: bool,
) -> int:
    """Turn the people of a detector into frame messages that vsd ingest reads.

    PEOPLE is an OpenPose or Monoloco folder, a JSON file of COCO-17, HALPE-26 or BODY_25 joints, a folder of
    ultralytics labels, or a CSV file of boxes: frame or ts, track_id (may be absent), left, top, right, bottom.

    With --overlay and --pictures, people are on the pictures written: they are personal data, and nothing deletes them.

    \b
    Example:
      vsd engine run people.csv --camera cam-1 --out frames.jsonl
      vsd engine run joints/ --camera cam-1 --hz 25 --start 2026-11-09T08:00 --out frames.jsonl
      vsd engine run boxes.csv --camera cam-1 --hz 2 --start 2026-11-09T08:00 --track --out frames.jsonl
      vsd engine run joints/ --camera cam-1 --method paper --ratios 0.5,0.8 --out frames.jsonl
      vsd engine run monoloco/ --camera cam-1 --method monoloco --track --hz 10 --out frames.jsonl
      vsd engine run joints/ --camera cam-1 --out frames.jsonl --overlay look/ --pictures door.mp4
    """
    from vsd_analytics.config.calibrate import camera_called
    from vsd_analytics.engine.messages import frame_messages, instants_ms
    from vsd_analytics.engine.monoloco_files import read_monoloco
    from vsd_analytics.engine.people_files import read_each_once, read_people
    from vsd_analytics.store.durable import publish

    if track and method == "paper":
        raise UsageError("--track needs metres on the floor", fix="leave out --method paper")
    if pictures is not None and overlay is None:
        raise UsageError("--pictures is what --overlay draws on", fix="--overlay overlay/")
    camera = camera_called(project.site, camera_id, option="--camera")
    picture_px = parse_size(size) if size else camera.picture_px
    own = read_monoloco(people) if method == "monoloco" else None
    read = read_people if method == "paper" else read_each_once  # the paper's method takes skeletons as they are
    found = read(people, size_px=picture_px) if own is None else own.people
    rate = hz or camera.hz or 1.0
    if found.ts_ms is None and start is None:
        project.say(
            f"warning: {people.name} has no ts: frame 0 is put at {NO_CLOCK}, {rate:g} frames a second; "
            f"give --start and --hz before you ingest it"
        )
    begin = instant(start or NO_CLOCK, zone=project.site.timezone, what="--start")
    ts_ms = instants_ms(found, start=begin, hz=rate)
    detected = DetectedPeople(project, camera, found, picture_px, ts_ms, is_tracked=track)
    moves: list[dict[str, object]] = []
    if method == "paper":
        parts = [(_paper(detected, part=part, ratios=_ratios(ratios, convention)), ts_ms)]
    else:
        parts = _calibrated(detected) if own is None else _monoloco(detected, own)
        moves = _moves(detected, people)
    drawn = {} if overlay is None else _overlay(detected, parts, to=overlay, on=pictures)
    lines = [line for seen, when in parts for line in frame_messages(seen, camera=camera_id, ts_ms=when)]
    publish(out, b"".join(line + b"\n" for line in lines))
    done = {
        "file": str(out),
        "engine": ", ".join(seen.engine for seen, _ in parts),
        "frames": len(lines),
        "persons": sum(len(seen.people) for seen, _ in parts),
        "pairs": sum(len(seen.a) for seen, _ in parts),
        "left_out": dict(sum((Counter(seen.left_out) for seen, _ in parts), Counter())),
        "bad_rows": dict(found.bad),
        **({} if own is None else _social(own)),
        "moves": moves,
        **drawn,
    }
    if as_json:
        emit_json(done)
    else:
        _print(done)
    return 0


def _print(done: dict[str, Any]) -> None:
    frames, persons, pairs = (count(done[what], what[:-1]) for what in ("frames", "persons", "pairs"))
    click.echo(f"{done['file']}: {frames}, {persons}, {pairs} ({done['engine']})")
    if "overlay" in done:
        on = f"{done['pictured']:,} of them on the camera's" if done["pictured"] else "on grey ground"
        click.echo(f"{done['overlay']}/: {count(done['pictures'], 'picture')}, {on}")
    if "social_flags" in done:
        flags = done["social_flags"]
        click.echo(
            f"  {flags['persons']:,} of {count(flags['of'], 'person')} flagged by Monoloco's own rule of people who "
            "face each other: not a distance, and not in the messages"
        )
    for what, n in done["left_out"].items():
        click.echo(f"  {count(n, 'person')} not used: {what}")
    for what, n in done["bad_rows"].items():
        click.echo(f"  {count(n, 'bad row')}: {what}")


def _ratios(text: str, convention: str) -> Ratios:
    from vsd_analytics.engine.ratios import Ratios

    try:
        horizontal, vertical = (float(word) for word in text.split(","))
    except ValueError:
        raise UsageError(f"--ratios: {text!r} is not two numbers", fix="--ratios 0.7,0.7") from None
    return Ratios(horizontal, vertical, "share" if convention == "share" else "inset")


def _paper(detected: DetectedPeople, *, part: str | None, ratios: Ratios) -> Seen:
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


def _calibrated(detected: DetectedPeople) -> _Parts:
    """Return what was seen by the metres of the camera's calibrations."""
    from vsd_analytics.engine.floor_method import locate
    from vsd_analytics.engine.plane_method import locate_on_planes, standing
    from vsd_analytics.engine.tracker import tracked, tracked_at

    camera, people, picture_px = detected.camera, detected.people, detected.picture_px
    if not camera.calibrations and not camera.planes:
        raise UsageError(
            f"camera {camera.camera_id!r} has no calibration",
            why="--method people measures in metres on the floor",
            fix=f"vsd calibrate {camera.camera_id} --from-people PEOPLE --size 1920x1080, or --method paper",
        )
    timed, parts = replace(people, ts_ms=detected.ts_ms), []
    settings = detected.project.site.settings
    reach = {"within_m": settings.pair_max_m, "distance_m": settings.distance_m}
    for from_ms, to_ms, used, planes in _grounds(camera):
        part = timed.between(from_ms, to_ms)
        if not len(part.frames):
            continue
        when, part = part.ts_ms, replace(part, ts_ms=None) if people.ts_ms is None else part
        assert when is not None
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


def _grounds(camera: Camera) -> list[tuple[int, int, Calibration | None, tuple[Plane, ...]]]:
    """Return the spans of UTC milliseconds in which a camera has the same calibration and planes, and these."""
    from datetime import UTC, datetime
    from itertools import pairwise

    from vsd_analytics.geometry.plane_views import plane_starts, planes_in_force
    from vsd_analytics.warehouse.dimensions import FOREVER_MS, calibration_spans, in_force

    changes = {from_ms for from_ms, _, _ in calibration_spans(camera)}
    changes |= {round(start.timestamp() * 1000) for start in plane_starts(camera.planes)}
    found = []
    for from_ms, to_ms in pairwise([*sorted(changes | {-FOREVER_MS}), FOREVER_MS]):
        at = None if from_ms == -FOREVER_MS else datetime.fromtimestamp(from_ms / 1000, UTC)
        used = in_force(camera, from_ms)
        found.append((from_ms, to_ms, used[0] if used else None, planes_in_force(camera.planes, at)))
    return found


def _monoloco(detected: DetectedPeople, own: MonolocoPeople) -> _Parts:
    """Return what Monoloco placed under each of the camera's calibrations, else on the plane of its people."""
    from vsd_analytics.engine.monoloco_method import floor_of_calibration, floor_of_people, locate_monoloco
    from vsd_analytics.warehouse.dimensions import calibration_spans

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


def _social(own: MonolocoPeople) -> dict[str, object]:
    """Return how many people Monoloco's own rule flags: a judgement of its own, which is no distance."""
    import numpy as np

    judged = np.isfinite(own.is_social)
    if not judged.any():
        return {}
    return {"social_flags": {"persons": int(np.nansum(own.is_social)), "of": int(judged.sum())}}


def _overlay(detected: DetectedPeople, parts: _Parts, *, to: Path, on: Path | None) -> dict[str, object]:
    """Draw what was seen; return what was drawn, for `--json`."""
    from vsd_analytics.engine.frame_pictures import frame_pictures
    from vsd_analytics.engine.overlay import OverlayLook, write_overlay
    from vsd_analytics.wording.format import distance

    people, settings = detected.people, detected.project.site.settings
    look = OverlayLook(detected.known_px, settings.distance_m, lambda metres: distance(metres, settings.distance_unit))
    n_pictured = write_overlay(to, parts, pictures=frame_pictures(on, people), source=on, look=look)
    return {"overlay": str(to), "pictures": len(people.frames), "pictured": n_pictured}


def _stated_error(used: Calibration) -> LikelyCameras | None:
    from vsd_analytics.engine.people_calibration_file import read_stated_error
    from vsd_analytics.geometry.stated_errors import beside

    if used.source is None:
        return None
    return read_stated_error(beside(used.source, "people"), calibration_id=used.calibration_id)


def _moves(detected: DetectedPeople, source: Path) -> list[dict[str, object]]:
    """Warn when the camera has moved since its calibration; return its moves for `--json`."""
    from vsd_analytics.cli import moved_cameras

    project, camera = detected.project, detected.camera
    check = moved_cameras.check_people(camera, detected.people, ts_ms=detected.ts_ms, size_px=detected.picture_px)
    if check is None:
        return []
    moved_cameras.warn_of_moves(project, camera, check, source)
    return moved_cameras.moves_list(check, zone=project.site.timezone)
