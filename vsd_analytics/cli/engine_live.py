"""`vsd engine live`: the pictures of all cameras as they come, into the store."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.detection import chosen_detector, detector_options
from vsd_analytics.cli.listen import machine_clock, rhythm_options
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    import threading
    from collections.abc import Sequence

    from vsd_analytics.live.live_camera import LiveCamera, TileChoice
    from vsd_analytics.site.model import Camera

USUAL_HZ = 1.0
"""Pictures a second, as in the paper."""


@click.command()
@click.option("--camera", "camera_ids", multiple=True, metavar="ID", help="Only this camera; may be given again.")
@click.option(
    "--hz",
    type=click.FloatRange(min=0, min_open=True, max=100),
    help="Pictures a second of each camera (default: hz of the camera, else 1).",
)
@click.option(
    "--look",
    "look_port",
    is_flag=False,
    flag_value=0,
    type=click.IntRange(0, 65535),
    metavar="[PORT]",
    help="Serve a page on this machine that shows pictures and plan as they are now (default: a free port).",
)
@detector_options
@rhythm_options
@json_option
@pass_project
def live(
    project: Project,
    /,
    camera_ids: tuple[str, ...],
    hz: float | None,
    look_port: int | None,
    fold_every_s: float,
    status_every_s: float,
    as_json: bool,
    **given: Any,
) -> int:
    """Look at all cameras with a source around the clock, and store where people are.

    A camera's `source` in vsd.toml is an address of RTSP or HTTP, a device such as /dev/video0, or a video, which is
    shown again and again. No picture is written to a disk. A picture that was not looked at is missing in vsd coverage:
    the camera is away, hangs or repeats one picture, the detector is too slow, or the disk is full. Messages of [mqtt]
    are stored as well, as by vsd listen. SIGTERM and Ctrl-C store what was seen, and end with exit code 0.
    status/listen.json and vsd doctor show the state of each camera.

    With --look, one page on this machine shows the picture as it is now with people, circles of the legal distance and
    lines between those too close, beside the plan; it is drawn in memory and written nowhere. There a camera can be
    calibrated by eye.

    \b
    Example:
      vsd engine live --detector model.onnx
      vsd engine live --detector model.onnx --look
      vsd engine live --detector model.onnx --camera entrance --hz 2
    """
    import os
    import threading
    import zlib
    from functools import partial

    from vsd_analytics.cli.alarms import live_alarms
    from vsd_analytics.cli.exit_codes import stop_signals
    from vsd_analytics.live.listener import Listener
    from vsd_analytics.live.live_camera import TileChoice
    from vsd_analytics.live.mqtt import password_of
    from vsd_analytics.live.picture_door import PictureDoor
    from vsd_analytics.live.single_instance import single_listener

    chosen = chosen_detector(given)
    if chosen is None:
        raise UsageError("nothing finds people in the pictures", fix="vsd engine live --detector model.onnx")
    cameras = _with_sources(project, camera_ids, is_looked_at=look_port is not None)
    broker = project.site.broker
    with (
        single_listener(project.root),
        stop_signals(is_second_final=True) as stopped,
        live_alarms(project, clock=machine_clock(project)) as alarms,
    ):
        password = None if broker is None else password_of(broker, environ=os.environ)
        has_news = threading.Event()
        detector = chosen.opened()
        tiles = TileChoice(input_px=detector.decoder.preparation.size_px, side_px=chosen.tile_px)
        looked_at = _live_cameras(project, cameras, tiles, hz=hz, has_news=has_news)
        door = PictureDoor(looked_at, detector, has_news=has_news, report=project.say)
        listener = Listener(
            project.site,
            broker=broker,
            password=password,
            door=door,
            clock=machine_clock(project),
            observers=[] if alarms is None else [alarms],
            fold_every_s=fold_every_s,
            status_every_s=status_every_s,
            seed=zlib.crc32(door.name.encode() if broker is None else broker.client_id.encode()),
            report=project.say,
        )
        listener.status.engine = door.as_dict
        if alarms is not None:
            listener.status.alarms = alarms.as_dict
            if listener.link is not None:
                alarms.delivery.publish = partial(listener.link.publish, qos=1)
        names = ", ".join(camera.camera_id for camera in cameras)
        project.say(f"looking at {names}; Ctrl-C ends it")
        with contextlib.ExitStack() as opened:
            if look_port is not None:
                _serve_look(project, looked_at, look_port, opened)
            status = listener.run(should_stop=stopped.is_set)
    if as_json:
        emit_json(status.as_dict(now=machine_clock(project)()))
    else:
        for camera in looked_at:
            n = camera.source.counts.n_replaced + camera.n_hung + camera.n_unstored
            name = camera.camera.camera_id
            project.say(f"{name}: {camera.n_processed:,} pictures looked at, {n:,} read and not counted")
    return 0


def _serve_look(project: Project, looked_at: Sequence[LiveCamera], port: int, opened: contextlib.ExitStack) -> None:
    """Serve the look page until `opened` is closed."""
    from vsd_analytics.live.look_page import look_policy, render_look_page
    from vsd_analytics.live.look_server import LookServer
    from vsd_analytics.live.look_view import LookView
    from vsd_analytics.wording.languages import speaking

    site, cameras = project.site, tuple(camera.camera for camera in looked_at)
    with speaking(site.language):
        pages = {c.camera_id: render_look_page(site, c, cameras=cameras) for c in cameras}
    look = LookServer(
        LookView(site, looked_at),
        pages=pages,
        policy=look_policy(),
        port=port,
        language=site.language,
        clock=machine_clock(project),
    )
    opened.callback(look.close)
    project.say(f"look: {look.address}")


def _with_sources(project: Project, camera_ids: Sequence[str], *, is_looked_at: bool) -> list[Camera]:
    """Return the cameras to look at; one without a calibration only where somebody looks, who can make one."""
    from vsd_analytics.site.cameras_by_name import camera_called

    site = project.site
    for camera_id in camera_ids:
        if camera_called(site, camera_id, option="--camera").source is None:
            fix = 'under its [[camera]]: source = "rtsp://192.168.1.20/stream1", "/dev/video0" or "door.mp4"'
            raise UsageError(f"camera {camera_id!r} has no source", fix=fix)
    today = project.now.astimezone(site.zone).date()
    there = [c for c in site.cameras if c.is_there(today, today)]  # records of the others would go to quarantine
    cameras = [c for c in there if c.source is not None and (not camera_ids or c.camera_id in camera_ids)]
    if not cameras:
        raise UsageError(
            "no camera of vsd.toml has a source",
            why="nothing says where pictures come from",
            fix='under a [[camera]]: source = "rtsp://192.168.1.20/stream1", "/dev/video0" or "door.mp4"',
        )
    for camera in cameras:
        if not camera.calibrations and not camera.planes and not is_looked_at:
            raise UsageError(
                f"camera {camera.camera_id!r} has no calibration",
                why="nothing says where on the floor its people are",
                fix=f"vsd calibrate {camera.camera_id} --points FILE, or by eye: vsd engine live --look",
            )
    return cameras


def _live_cameras(
    project: Project, cameras: Sequence[Camera], tiles: TileChoice, *, hz: float | None, has_news: threading.Event
) -> list[LiveCamera]:
    """Return the cameras with their sources, which are not started yet."""
    import os
    import zlib
    from functools import partial

    from vsd_analytics.engine.live_sources import LiveSource, be_quiet
    from vsd_analytics.live.batches import delays_s
    from vsd_analytics.live.live_camera import LiveCamera
    from vsd_analytics.live.passwords import source_password

    be_quiet()
    clock, settings, looked_at = machine_clock(project), project.site.settings, []
    for camera in cameras:
        assert camera.source is not None
        address = camera.source.address
        source = LiveSource(
            address if camera.source.is_network else str(project.root / address),
            hz=hz or camera.hz or USUAL_HZ,
            now_ms=lambda: round(clock().timestamp() * 1000),
            delays_s=partial(delays_s, seed=zlib.crc32(camera.camera_id.encode())),
            has_news=has_news,
            username=camera.source.username,
            password=source_password(camera, environ=os.environ),
        )
        looked_at.append(
            LiveCamera(
                camera,
                source,
                within_m=settings.pair_max_m,
                distance_m=settings.distance_m,
                tiles=tiles,
            )
        )
    return looked_at
