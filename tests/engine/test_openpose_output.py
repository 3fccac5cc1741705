"""OpenPose as it is: nobody has an id, joints and halves of bodies are missing, skeletons are doubles or nobody."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine.openpose_output import NONE, USUAL, Faults, write_openpose
from engine.simulated_people import SIZE, Scene, SimulatedCamera, simulate
from engine.vsd_in_a_shop import shop

from vsd_analytics.engine.doubles import is_double, without_doubles
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people_calibration import calibrate_from_people
from vsd_analytics.engine.people_files import read_people
from vsd_analytics.engine.safe_space import pairs_of_frames
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import to_floor

CAMERA = SimulatedCamera(height_m=4.5, tilt_deg=24, f_widths=0.9)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate(CAMERA, seed=8, n_tracks=60, seconds=10, noise_px=1.0, missing=0.0)


def f1(folder: Path, scene: Scene, faults: Faults, *, is_clean: bool) -> float:
    """Return the F1 of pairs under 2 m by the true camera; pairs with ghosts and doubles are false."""
    owner = write_openpose(folder, scene, faults=faults, seed=3)
    people = read_people(folder)
    used = ~is_double(people) if is_clean else np.ones(len(people), dtype=bool)
    people, owner = people.rows(used), owner[used]
    xy = to_floor(
        CAMERA.homography(),
        floor_points(people, homography=CAMERA.homography(), picture_px=SIZE),
        picture_px=SIZE,
    )
    a, b = pairs_of_frames(scene.people.frame)
    near = np.linalg.norm(scene.xy[a] - scene.xy[b], axis=1) < 2
    true = set(zip(a[near].tolist(), b[near].tolist(), strict=True))
    a, b = pairs_of_frames(people.frame)
    near = np.linalg.norm(xy[a] - xy[b], axis=1) < 2
    found = [(min(pair), max(pair)) for pair in zip(owner[a[near]].tolist(), owner[b[near]].tolist(), strict=True)]
    return 2 * len(true.intersection(found)) / (len(true) + len(found))


@pytest.mark.parametrize(
    ("faults", "least"),
    [
        (NONE, 0.96),
        (replace(NONE, doubles=0.1), 0.94),
        (replace(NONE, half=0.2), 0.93),
        (replace(NONE, missing=0.3), 0.93),
        (USUAL, 0.85),
    ],
    ids=["none", "doubles", "halves", "missing", "usual"],
)
def test_pairs_are_found_in_spite_of_faults(faults: Faults, least: float, tmp_path: Path, scene: Scene) -> None:
    assert f1(tmp_path / "joints", scene, faults, is_clean=True) > least


def test_doubles_would_be_pairs(tmp_path: Path, scene: Scene) -> None:
    faults = replace(NONE, doubles=0.2)
    with_doubles, without = (f1(tmp_path / str(i), scene, faults, is_clean=bool(i)) for i in (0, 1))
    assert without > with_doubles + 0.05


def test_no_one_is_a_double_where_nobody_is_doubled(tmp_path: Path, scene: Scene) -> None:
    write_openpose(tmp_path / "joints", scene, faults=NONE, seed=3)
    people = read_people(tmp_path / "joints")
    a, b = pairs_of_frames(people.frame)
    apart = np.linalg.norm(scene.xy[a] - scene.xy[b], axis=1)
    within = np.unique(np.concatenate([side[apart < 0.5] for side in (a, b)]))
    assert set(np.flatnonzero(is_double(people))) <= set(within.tolist())
    named = replace(people, track=scene.people.track)
    assert without_doubles(named) is named


def test_faults_leave_the_calibration_nearly_as_good(tmp_path: Path, scene: Scene) -> None:
    write_openpose(tmp_path / "joints", scene, faults=USUAL, seed=3, every=50)
    found = calibrate_from_people(read_people(tmp_path / "joints"), size_px=SIZE)
    assert found.uses_joints
    assert found.n_people is None
    assert found.camera.height_m == pytest.approx(4.5, rel=0.08)
    assert np.degrees(found.camera.tilt_rad) == pytest.approx(24, abs=2.5)


def test_ten_pictures_of_walkers_calibrate(tmp_path: Path) -> None:
    few = simulate(CAMERA, seed=8, n_tracks=160, seconds=100, hz=0.1, noise_px=1.0, missing=0.0, standing=0.0)
    write_openpose(tmp_path / "joints", few, faults=replace(USUAL, ghosts=0.0), seed=3)
    people = read_people(tmp_path / "joints")
    assert len(people.frames) == 10
    assert np.isfinite(people.joints[:, [1, 11, 14]]).all(axis=(1, 2)).sum() < 150
    found = calibrate_from_people(people, size_px=SIZE)
    assert found.camera.height_m == pytest.approx(4.5, rel=0.15)


def test_few_people_who_stay_are_not_taken_for_many(tmp_path: Path) -> None:
    camera = SimulatedCamera(height_m=4.5, tilt_deg=24, f_widths=0.9)
    staying = simulate(camera, seed=8, n_tracks=8, seconds=30, standing=1.0, missing=0.0)
    write_openpose(tmp_path / "joints", staying, faults=replace(USUAL, ghosts=0.0), seed=3)
    people = read_people(tmp_path / "joints")
    assert len(people) > 400
    with pytest.raises(CalibrationError) as refused:
        calibrate_from_people(people, size_px=SIZE)
    assert "persons (without track ids)" in str(refused.value.why)
    assert "a neck and both ankles" in str(refused.value.fix)


def test_a_second_skeleton_on_a_person_counts_no_more_in_a_calibration(
    tmp_path: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
) -> None:
    vsd = shop(tmp_path, capsys)
    folder = tmp_path / "joints"
    write_openpose(folder, scene, faults=NONE, seed=3)
    printed = []
    for is_doubled in (False, True):
        for path in folder.iterdir() if is_doubled else ():
            people = json.loads(path.read_text())["people"]
            path.write_text(json.dumps({"version": 1.3, "people": people + people}))
        code, found, err = vsd("calibrate", "cam-1", "--from-people", str(folder), "--size", "1920x1080", "--json")
        assert code == 0, err
        printed.append({key: value for key, value in json.loads(found).items() if key != "warnings"})
    assert printed[0] == printed[1]


def test_folder_of_openpose_goes_from_calibration_to_messages(
    tmp_path: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
) -> None:
    vsd = shop(tmp_path, capsys)
    folder = tmp_path / "joints"
    write_openpose(folder, scene, faults=USUAL, seed=3)
    (folder / "door_000000000900_keypoints.json").write_text('{"version": 1.3, "people": []}')
    (folder / "settings.json").write_text('{"model": "BODY_25"}')
    code, printed, err = vsd("calibrate", "cam-1", "--from-people", str(folder), "--size", "1920x1080")
    assert code == 0, err
    assert "skeletons" in printed
    code, printed, err = vsd(
        *("engine", "run", str(folder), "--camera", "cam-1", "--hz", "2", "--start", "2026-11-09T08:00"),
        *("--out", str(tmp_path / "frames.jsonl"), "--json"),
    )
    assert code == 0, err
    done = json.loads(printed)
    assert done["frames"] == len(scene.people.frames) + 1
    assert done["bad_rows"]["second skeleton on the same person"] > 0
    assert done["bad_rows"]["file without a frame number in its name"] == 1
    assert done["left_out"]["no foot, or no body above it"] > 0
