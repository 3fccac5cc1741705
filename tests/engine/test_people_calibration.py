"""Calibration from people: simulated cameras are found within the stated error, and thin data are refused in words."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from engine.pair_errors import distances, pair_errors
from engine.simulated_people import SIZE, Scene, SimulatedCamera, boxes_only, simulate
from engine.vsd_in_a_shop import shop, write_boxes

from vsd_analytics.engine.camera_model import CameraModel
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people import People
from vsd_analytics.engine.people_calibration import FromPeople, calibrate_from_people
from vsd_analytics.engine.safe_space import pairs_of_frames
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import to_floor

CAMERAS = {
    "shop": SimulatedCamera(height_m=3.2, tilt_deg=20, f_widths=0.75, roll_deg=1.0),
    "hall": SimulatedCamera(height_m=6.0, tilt_deg=28, f_widths=0.9, roll_deg=-1.5),
    "street": SimulatedCamera(height_m=7.5, tilt_deg=20, f_widths=1.2, k1=-0.05),
}


@cache
def walk(camera: SimulatedCamera, seed: int = 1, **more: float) -> Scene:
    return simulate(camera, seed=seed, n_tracks=60, seconds=15, **more)  # type: ignore[arg-type]


@cache
def calibrated(camera: SimulatedCamera, seed: int = 1, **more: float) -> FromPeople:
    return calibrate_from_people(walk(camera, seed, **more).people, size_px=SIZE)


def found_m(people: People, found: FromPeople) -> np.ndarray:  # type: ignore[type-arg]
    uv = floor_points(people, homography=found.homography, picture_px=SIZE)
    return distances(people.frame, to_floor(found.homography, uv, picture_px=SIZE))


@pytest.mark.parametrize("name", CAMERAS)
def test_joints_of_walking_people_give_the_camera(name: str) -> None:
    scene, found = walk(CAMERAS[name]), calibrated(CAMERAS[name])
    score = pair_errors(distances(scene.people.frame, scene.xy), found_m(scene.people, found))
    assert score.error < 0.05
    assert score.f1 > 0.94
    assert found.camera.height_m == pytest.approx(CAMERAS[name].height_m, rel=0.06)
    assert np.degrees(found.camera.tilt_rad) == pytest.approx(CAMERAS[name].tilt_deg, abs=2.5)
    assert np.degrees(found.camera.roll_rad) == pytest.approx(CAMERAS[name].roll_deg, abs=0.7)


@pytest.mark.parametrize("name", CAMERAS)
def test_boxes_give_distances_within_a_tenth(name: str) -> None:
    scene = walk(CAMERAS[name])
    people = boxes_only(scene)
    score = pair_errors(distances(people.frame, scene.xy), found_m(people, calibrate_from_people(people, size_px=SIZE)))
    assert score.error < 0.10
    assert score.f1 > 0.89


def test_children_and_sitting_people_hardly_move_the_result() -> None:
    camera = CAMERAS["hall"]
    errors = []
    for share in (0.0, 0.2):
        scene = walk(camera, children=share, sitting=share)
        found = calibrated(camera, children=share, sitting=share)
        errors.append(pair_errors(distances(scene.people.frame, scene.xy), found_m(scene.people, found)).error)
    assert errors[1] < errors[0] + 0.04


def test_people_without_track_ids_calibrate_as_well() -> None:
    scene = walk(CAMERAS["street"])
    nameless = replace(scene.people, track=np.full(len(scene.people), None, dtype=object))
    found = calibrate_from_people(nameless, size_px=SIZE)
    assert (found.n_people, found.n_walkers) == (None, 0)
    assert pair_errors(distances(scene.people.frame, scene.xy), found_m(nameless, found)).error < 0.08


def test_true_distances_lie_within_the_stated_error() -> None:
    inside = []
    for camera in (CAMERAS["hall"], CAMERAS["street"]):
        scene, found = walk(camera), calibrated(camera)
        a, b = pairs_of_frames(scene.people.frame)
        true = np.linalg.norm(scene.xy[a] - scene.xy[b], axis=1)
        near = np.flatnonzero((true > 0.3) & (true < 4))[::5]
        uv = floor_points(scene.people, homography=found.homography, picture_px=SIZE)
        sd = found.distance_sd_m(uv[a[near]], uv[b[near]])
        off = np.abs(found_m(scene.people, found)[near] - true[near])
        inside.append(float(np.mean(off[np.isfinite(off)] < 1.645 * sd[np.isfinite(off)])))
    assert min(inside) >= 0.85
    assert np.mean(inside) >= 0.9


def test_error_map_grows_with_the_distance_from_the_camera() -> None:
    found = calibrated(CAMERAS["street"])
    away = np.hypot(found.map[:, 0], found.map[:, 1])
    near, far = away < np.quantile(away, 0.2), away > np.quantile(away, 0.8)
    assert found.map[far, 2].mean() > 1.3 * found.map[near, 2].mean()


def test_homography_of_a_camera_model_is_the_planted_one() -> None:
    planted = SimulatedCamera(height_m=5, tilt_deg=35, roll_deg=3, f_widths=0.8)
    tilt, roll = np.radians([planted.tilt_deg, planted.roll_deg])
    model = CameraModel(0.8 * SIZE[0], tilt, roll, 5.0, (SIZE[0] / 2, SIZE[1] / 2))
    spots = np.array([(100.0, 1000.0), (1800.0, 700.0), (960.0, 540.0)])
    np.testing.assert_allclose(to_floor(model.homography(), spots, picture_px=SIZE), planted.to_floor(spots), atol=1e-9)


def refused(people: People, size_px: tuple[int, int] = SIZE) -> str:
    with pytest.raises(CalibrationError) as error:
        calibrate_from_people(people, size_px=size_px)
    assert error.value.code == "E411"
    assert error.value.fix
    return str(error.value.why)


def test_few_people_are_refused() -> None:
    scene = walk(CAMERAS["hall"])
    assert "whole people" in refused(scene.people.rows(np.arange(30)))
    one = scene.people.track == scene.people.track[0]
    assert "of 1 persons" in refused(
        replace(scene.people.rows(np.tile(np.flatnonzero(one), 3)), frames=scene.people.frames)
    )


def test_wrong_picture_size_is_refused() -> None:
    assert "outside 640x480" in refused(walk(CAMERAS["hall"]).people, (640, 480))


def test_boxes_from_a_camera_that_looks_steeply_down_are_refused() -> None:
    steep = SimulatedCamera(height_m=5, tilt_deg=52, f_widths=0.7)
    assert "bottom of a box" in refused(boxes_only(simulate(steep, seed=1, n_tracks=80, seconds=15)))


def test_boxes_of_any_height_are_refused() -> None:
    rng = np.random.default_rng(1)
    corner = rng.uniform((100, 100), (1500, 700), (400, 2))
    size = np.exp(rng.uniform(np.log(20), np.log(300), (400, 2)))
    frame = np.arange(400, dtype=np.int64)
    people = People(
        frame,
        np.full(400, None, dtype=object),
        np.column_stack([corner, corner + size]),
        np.full((400, 25, 2), np.nan),
        frame,
    )
    assert refused(people)


def test_from_boxes_to_pairs_with_their_error_in_the_store(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import duckdb

    vsd = shop(tmp_path, capsys)
    scene = walk(CAMERAS["street"])
    source, out = write_boxes(tmp_path / "people.csv", boxes_only(scene)), tmp_path / "frames.jsonl"
    code, printed, err = vsd("calibrate", "cam-1", "--from-people", str(source), "--size", "1920x1080")
    assert code == 0, err
    assert "picture widths" in printed
    assert "error (one sd)" in printed
    start = ["--hz", "2", "--start", "2026-11-09T08:00:00+01:00"]
    assert vsd("engine", "run", str(source), "--camera", "cam-1", *start, "--out", str(out))[0] == 0
    truth = tmp_path / "truth.csv"
    rows = zip(scene.people.frame, scene.people.track, scene.xy.tolist(), strict=True)
    truth.write_text("frame,track_id,x_m,y_m\n" + "".join(f"{f},{t},{x},{y}\n" for f, t, (x, y) in rows))
    code, printed, _ = vsd("evaluate", str(out), "--truth", str(truth), "--json")
    assert code == 0
    assert json.loads(printed)["pairs"]["pooled"]["f1"]["value"] > 0.89
    assert vsd("ingest", str(out))[0] == 0
    pairs = f"'{tmp_path}/store/pairs/**/*.parquet'"
    n, n_known, low = duckdb.sql(
        f"select count(*), count(distance_sd_mm), min(distance_sd_mm) from {pairs}"
    ).fetchall()[0]
    assert n == n_known > 100
    assert low > 0


def test_a_calibration_from_few_people_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vsd = shop(tmp_path, capsys)
    people = boxes_only(walk(CAMERAS["street"]))
    names = sorted(set(people.track), key=int)
    for n, is_few in ((20, True), (len(names), False)):
        some = people.rows(np.isin(people.track.astype(str), names[:n]))
        source = write_boxes(tmp_path / f"{n}.csv", some)
        code, _, err = vsd("calibrate", "cam-1", "--from-people", str(source), "--size", "1920x1080")
        assert code == 0, err
        assert ("warning[W406]: camera cam-1 is calibrated from 20 persons, fewer than 30" in err) is is_few


def test_refused_calibration_changes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vsd = shop(tmp_path, capsys)
    source = write_boxes(tmp_path / "people.csv", boxes_only(walk(CAMERAS["hall"])).rows(np.arange(20)))
    code, _, err = vsd("calibrate", "cam-1", "--from-people", str(source))
    assert code == 2
    assert "E411" in err
    assert not (tmp_path / "calibration").exists()


@pytest.mark.parametrize("name", ["shop", "hall"])
def test_boxes_that_jump_from_frame_to_frame_do_not_bring_the_camera_down_to_the_heads(name: str) -> None:
    scene = walk(CAMERAS[name])
    people, rng = boxes_only(scene), np.random.default_rng(4)
    jumping = people.box + rng.normal(0, 0.04, people.box.shape) * (people.box[:, 3] - people.box[:, 1])[:, None]
    found = calibrate_from_people(replace(people, box=jumping), size_px=SIZE)
    assert np.degrees(found.camera.tilt_rad) == pytest.approx(CAMERAS[name].tilt_deg, abs=5)
    assert found.camera.height_m == pytest.approx(CAMERAS[name].height_m, rel=0.12)
    assert pair_errors(distances(people.frame, scene.xy), found_m(people, found)).error < 0.12


def test_boxes_that_are_half_a_body_are_refused() -> None:
    people, rng = boxes_only(walk(CAMERAS["hall"])), np.random.default_rng(4)
    cut = people.box.copy()
    is_cut = rng.random(len(cut)) < 0.5
    cut[is_cut, 3] = cut[is_cut][:, [1, 3]].mean(axis=1)
    assert refused(replace(people, box=cut))
    assert refused(replace(people, box=cut, track=np.full(len(people), None, dtype=object)))
