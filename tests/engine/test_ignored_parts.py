"""`ignore_px` of a camera: people in a mirror are left out and counted, and its floor is neither empty nor seen."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import pytest
import shapely
from engine.blob_video import CAMERA, COLOURS, SIZE, Walk, box_of, write_blob_video
from engine.detector_models import blob_model

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.engine.detector import Detector
from vsd_analytics.engine.ignored_parts import engine_ignoring, in_parts
from vsd_analytics.engine.live_sources import LivePicture, LiveSource
from vsd_analytics.geometry.camera_views import ignored_floor, unseen, view_polygon
from vsd_analytics.live.live_camera import LiveCamera, TileChoice

HERE, MIRRORED, AHEAD = (-1.0, 8.0), (1.5, 8.0), (-1.0, 6.5)
MIRROR = [[190, 30], [319, 30], [319, 160], [190, 160]]
HEAD = '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\n[[camera]]\nid = "cam-1"\nname = "Door"\n'


def shop(root: Path, ignored: object = (MIRROR,)) -> Path:
    """Make a project with one camera."""
    root.mkdir(exist_ok=True)
    np.savetxt(root / "cam-1.txt", CAMERA.homography())
    more = (
        f'homography = "cam-1.txt"\npicture_px = [320, 240]\nsource = "door.avi"\nignore_px = {json.dumps(ignored)}\n'
    )
    (root / "vsd.toml").write_text(HEAD + more)
    blob_model(root / "blobs.onnx", COLOURS[:3], SIZE)
    return root


def walks() -> list[Walk]:
    return [Walk(lambda _, at=at: at) for at in (HERE, MIRRORED, AHEAD)]


def test_whoever_ends_in_a_polygon_is_left_out_its_border_included() -> None:
    boxes = np.array([[180, 40, 200, 100], [195, 40, 215, 160], [0, 0, 9, 9], [195, 40, 215, 161], [np.nan] * 4])
    assert in_parts(boxes, [MIRROR]).tolist() == [True, True, False, False, False]
    assert not in_parts(boxes, []).any()


def test_people_in_a_mirror_are_left_out_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = shop(tmp_path)
    write_blob_video(root / "door.avi", walks(), seconds=4, fps=5)
    words = ("engine", "run", root / "door.avi", "--camera", "cam-1", "--detector", root / "blobs.onnx")
    assert run(cli, ["-C", str(root), *map(str, words), "--out", str(root / "out.jsonl"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["left_out"] == {"in a part of the picture that is ignored": 4}
    messages = [json.loads(line) for line in (root / "out.jsonl").read_text().splitlines()]
    for message in messages:
        assert sorted(round(p["x_m"]) for p in message["persons"]) == [-1, -1]
    assert messages[0]["engine"] == engine_ignoring(messages[0]["engine"].split(" ignoring")[0], [MIRROR_PX])


MIRROR_PX = [tuple(map(float, corner)) for corner in MIRROR]


def test_a_live_camera_leaves_them_out_and_counts_them(tmp_path: Path) -> None:
    root = shop(tmp_path)
    write_blob_video(root / "door.avi", walks(), seconds=1, fps=1)
    import cv2

    picture = cv2.VideoCapture(str(root / "door.avi")).read()[1]
    source = LiveSource("x", hz=1, now_ms=lambda: 0, delays_s=lambda: iter([]), has_news=threading.Event())
    camera = LiveCamera(load_site(root).cameras[0], source, within_m=5, distance_m=2, tiles=TileChoice())
    messages = camera.messages(
        LivePicture(1_780_000_000_000, np.asarray(picture, np.uint8), 0.0), Detector(root / "blobs.onnx")
    )
    assert [len(json.loads(message)["persons"]) for message in messages] == [2]
    assert camera.as_dict()["people_ignored"] == 1


def test_its_floor_is_not_seen_and_the_rest_is(tmp_path: Path) -> None:
    site = load_site(shop(tmp_path))
    camera, calibration = site.cameras[0], site.cameras[0].calibrations[0]
    view = view_polygon(camera, calibration=calibration)
    ignored = ignored_floor(camera, calibration)
    assert view is not None
    assert ignored is not None
    for at, is_seen in ((HERE, True), (MIRRORED, False), (AHEAD, True)):
        foot_u, foot_v = (box_of(at)[0] + box_of(at)[2]) / 2, box_of(at)[3]
        assert bool(shapely.contains_xy(shapely.Polygon(MIRROR), foot_u, foot_v)) is not is_seen
        assert bool(shapely.intersects_xy(view, *at)) is is_seen
        assert bool(shapely.intersects_xy(ignored, *at)) is not is_seen
    whole = view_polygon(load_site(shop(tmp_path / "whole", [])).cameras[0], calibration=calibration)
    assert whole is not None
    assert view.area + ignored.area == pytest.approx(whole.area, rel=1e-3)
    hidden = unseen(site.floors[0], cameras=site.cameras, bounds=(1.4, 7.9, 1.6, 8.1))
    assert hidden is not None
    assert sum(part.area for part in hidden) == pytest.approx(0.04)


def test_a_polygon_within_the_view_leaves_one_outline(tmp_path: Path) -> None:
    inside = [[150, 100], [170, 100], [170, 120], [150, 120]]
    camera = load_site(shop(tmp_path, [inside])).cameras[0]
    view = view_polygon(camera, calibration=camera.calibrations[0])
    assert view is not None
    assert not view.interiors
    assert view.is_valid


@pytest.mark.parametrize(
    "ignored",
    [
        [[0, 0], [9, 0], [9, 9]],
        [[[0, 0], [9, 9]]],
        [[[0, 0], [9, 9], [9, 0], [0, 9]]],
        "mirror",
        [[[0, 0], [9, "a"], [9, 9]]],
    ],
)
def test_what_is_no_list_of_polygons_is_refused_in_words(
    ignored: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = shop(tmp_path, ignored)
    assert run(cli, ["-C", str(root), "doctor"]) != 0
    output = capsys.readouterr()
    assert "ignore_px" in output.out + output.err
    assert "Traceback" not in output.out + output.err


def test_evaluate_leaves_out_what_a_camera_ignores(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = shop(tmp_path)
    message = {"v": 1, "camera": "cam-1", "ts": "2026-11-09T08:00:00Z", "engine": "e", "quality": "metric"}
    persons = [{"id": str(k), "x_m": x, "y_m": y} for k, (x, y) in enumerate((HERE, MIRRORED, AHEAD))]
    (root / "out.jsonl").write_text(json.dumps({**message, "persons": persons}) + "\n")
    rows = [f"2026-11-09T08:00:00Z,{k},{x},{y}" for k, (x, y) in enumerate((HERE, AHEAD))]
    (root / "truth.csv").write_text("\n".join(["ts,track_id,x_m,y_m", *rows]) + "\n")
    words = (
        "evaluate",
        root / "out.jsonl",
        "--truth",
        root / "truth.csv",
        "--by",
        "place",
        "--ignore",
        "cam-1",
        "--json",
    )
    assert run(cli, ["-C", str(root), *map(str, words)]) == 0
    assert json.loads(capsys.readouterr().out)["n_uncounted"] == {"found": 1, "true": 0}
