"""Monoloco's output as an engine: metres on the floor, its spread, its own flag apart."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest
from engine.monoloco_output import write_monoloco
from engine.simulated_people import SIZE, Scene, SimulatedCamera, simulate
from engine.vsd_in_a_shop import Vsd, shop

from vsd_analytics.engine.monoloco_files import is_monoloco, read_monoloco
from vsd_analytics.engine.monoloco_method import floor_of_calibration, floor_of_people, locate_monoloco
from vsd_analytics.engine.people_files import read_people
from vsd_analytics.engine.safe_space import pairs_of_frames
from vsd_analytics.errors import CalibrationError, InputError

CAMERA = SimulatedCamera(height_m=4, tilt_deg=25, roll_deg=2)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate(CAMERA, seed=4, n_tracks=60, seconds=20, noise_px=1)


def pair_errors(found: Any, floor: Any, scene: Scene) -> np.ndarray:
    """Return found / true - 1 of all pairs of 1 to 6 m."""
    seen = locate_monoloco(found, floor, within_m=1e3)
    true = np.linalg.norm(scene.xy[seen.a] - scene.xy[seen.b], axis=1)
    some = (true > 1) & (true < 6)
    return np.asarray(seen.distance_m[some] / true[some] - 1)


def test_places_without_error_are_the_true_ones_under_any_calibration_of_the_floor(
    scene: Scene, tmp_path: Path
) -> None:
    write_monoloco(tmp_path / "m", scene, spread=0.0)
    found = read_monoloco(tmp_path / "m")
    shifted = np.array([[0, -1, 7.0], [1, 0, -3.0], [0, 0, 1]])  # a plan that is turned and has its origin elsewhere
    floor = floor_of_calibration(shifted @ CAMERA.homography(), picture_px=SIZE, name="c")
    seen = locate_monoloco(found, floor, within_m=2.5)
    there = np.column_stack([7 - scene.xy[:, 1], scene.xy[:, 0] - 3])
    assert seen.xy is not None
    np.testing.assert_allclose(seen.xy, there, atol=0.02)
    a, b = pairs_of_frames(scene.people.frame)
    assert len(seen.a) == pytest.approx((np.linalg.norm(scene.xy[a] - scene.xy[b], axis=1) < 2.5).sum(), abs=1)


@pytest.mark.parametrize(("tilt_deg", "height_m"), [(10, 3), (25, 4), (45, 8)])
def test_tilt_comes_from_the_people_where_no_calibration_gives_it(
    tilt_deg: float, height_m: float, tmp_path: Path
) -> None:
    camera = replace(CAMERA, tilt_deg=tilt_deg, height_m=height_m)
    scene = simulate(camera, seed=4, n_tracks=60, seconds=20, noise_px=1)
    write_monoloco(tmp_path / "m", scene, spread=0.06)
    floor = floor_of_people(read_monoloco(tmp_path / "m"))
    found = np.degrees(np.arcsin(np.linalg.norm(np.cross(floor.turn[1], [0, 0, 1]))))
    assert found == pytest.approx(tilt_deg, abs=2.0)


def test_turning_level_removes_the_error_that_tilt_makes(scene: Scene, tmp_path: Path) -> None:
    write_monoloco(tmp_path / "m", scene, spread=0.0)
    found = read_monoloco(tmp_path / "m")
    a, b = pairs_of_frames(scene.people.frame)
    true = np.linalg.norm(scene.xy[a] - scene.xy[b], axis=1)
    some = (true > 1) & (true < 6)
    as_if_level = np.linalg.norm((found.xyz[a] - found.xyz[b])[:, [0, 2]], axis=1)
    before = np.median(np.abs(as_if_level[some] / true[some] - 1))
    after = np.median(np.abs(pair_errors(found, floor_of_people(found), scene)))
    assert before > 0.04
    assert after < 0.01


def test_spread_along_the_view_becomes_the_sd_of_a_distance(scene: Scene, tmp_path: Path) -> None:
    write_monoloco(tmp_path / "m", scene, spread=0.05)
    found = read_monoloco(tmp_path / "m")
    floor = floor_of_calibration(CAMERA.homography(), picture_px=SIZE, name="c")
    seen = locate_monoloco(found, floor, within_m=1e3)
    true = np.linalg.norm(scene.xy[seen.a] - scene.xy[seen.b], axis=1)
    some = true > 3  # nearer, the distance cannot be as much too short as too long
    assert seen.sd_m is not None
    within = np.abs(seen.distance_m - true)[some] < 1.645 * seen.sd_m[some]
    assert 0.86 < within.mean() < 0.97
    across = np.abs(scene.xy[seen.a, 1] - scene.xy[seen.b, 1]) < 0.3
    assert np.median(seen.sd_m[across & some]) < 0.6 * np.median(seen.sd_m[some])  # sideways it is sure


def test_few_people_or_people_at_one_place_leave_the_tilt_open(scene: Scene, tmp_path: Path) -> None:
    write_monoloco(tmp_path / "m", scene, spread=0.06)
    found = read_monoloco(tmp_path / "m")
    few = np.arange(len(found.xyz)) < 30
    with pytest.raises(CalibrationError, match="tilted") as refused:
        floor_of_people(replace(found, people=found.people.rows(few), xyz=found.xyz[few]))
    assert "too few" in str(refused.value.why)
    rng = np.random.default_rng(1)
    one = np.array([0.3, 0.5, 8.0]) * (1 + rng.laplace(0, 0.1, (len(found.xyz), 1))) + rng.normal(0, 0.1, (1, 3))
    with pytest.raises(CalibrationError, match="tilted"):
        floor_of_people(replace(found, xyz=one + rng.normal(0, 0.05, one.shape)))


def test_both_names_of_its_keys_and_its_joints_are_read(scene: Scene, tmp_path: Path) -> None:
    write_monoloco(tmp_path / "old", scene)
    write_monoloco(tmp_path / "new", scene, names=("xyz", "distance"))
    old, new = (read_monoloco(tmp_path / name) for name in ("old", "new"))
    np.testing.assert_array_equal(old.xyz, new.xyz)
    assert is_monoloco(tmp_path / "old")
    people = read_people(tmp_path / "old")  # for --method people, and for vsd calibrate --from-people
    assert people.frames.tolist() == scene.people.frames.tolist()
    wrist = people.joints[:, 4]
    known = np.isfinite(scene.people.joints[:, 4]).all(axis=1)
    np.testing.assert_allclose(wrist[known], scene.people.joints[known, 4])
    assert np.isnan(wrist[~known]).all()


def test_spread_with_dropout_is_monoloco_s_whole_one(tmp_path: Path) -> None:
    content = {
        "boxes": [[0, 0, 9, 9, 1]] * 2,
        "xyz_pred": [[0, 1, 9]] * 2,
        "stds_ale": [0.5, 0.5],
        "stds_epi": [0, 0.9],
    }
    (tmp_path / "1.monoloco.json").write_text(json.dumps(content))
    np.testing.assert_allclose(read_monoloco(tmp_path).sd_m, [0.5 * np.sqrt(2), 0.9])


def test_empty_frames_count_and_damaged_ones_are_counted(scene: Scene, tmp_path: Path) -> None:
    folder = tmp_path / "m"
    write_monoloco(folder, scene)
    (folder / "door_000090.png.monoloco.json").write_text("{}")
    (folder / "door_000091.png.monoloco.json").write_text('{"xyz_pred": [[1, 2')
    (folder / "door_000092.png.monoloco.json").write_text('{"xyz_pred": [[1, 2, 3]], "boxes": []}')
    (folder / "door_000093.png.monoloco.json").write_text('{"xyz_pred": [["x", 2, 3]], "boxes": [[0, 0, 9, 9]]}')
    found = read_monoloco(folder)
    assert found.people.frames[-2:].tolist() == [90, 93]
    assert found.people.bad == {"file that is not Monoloco's JSON": 2, "person whose values are no numbers": 1}
    assert len(found.xyz) == len(found.people) == len(scene.people)


def test_folder_without_its_files_is_an_error_with_the_option_to_use(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no person of Monoloco") as refused:
        read_monoloco(tmp_path)
    assert "--output_types json" in str(refused.value.fix)


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    return shop(tmp_path, capsys)


def run(vsd: Vsd, tmp_path: Path, scene: Scene, *words: str) -> tuple[int, str, str]:
    if not (tmp_path / "m").exists():
        write_monoloco(tmp_path / "m", scene)
    start = ["--hz", "2", "--start", "2026-11-09T08:00", "--out", str(tmp_path / "f.jsonl")]
    return vsd("engine", "run", str(tmp_path / "m"), "--camera", "cam-1", "--method", "monoloco", *start, *words)


def test_pairs_reach_the_store_with_their_spread_and_without_its_own_flag(
    scene: Scene, tmp_path: Path, vsd: Vsd
) -> None:
    np.savetxt(tmp_path / "matrix.txt", CAMERA.homography())
    vsd("calibrate", "cam-1", "--matrix", str(tmp_path / "matrix.txt"))
    code, printed, err = run(vsd, tmp_path, scene, "--track")
    assert (code, err) == (0, "")
    n = len(scene.people)
    assert "flagged by Monoloco's own rule" in printed
    messages = [json.loads(line) for line in (tmp_path / "f.jsonl").read_text().splitlines()]
    assert {m["quality"] for m in messages} == {"body"}
    assert messages[0]["engine"].startswith("monoloco ")
    assert sum(len(m["persons"]) for m in messages) == n
    assert "social" not in (tmp_path / "f.jsonl").read_text()
    pairs = [p for m in messages for p in m["pairs"]]
    assert len(pairs) > 20
    assert all(p["sd_m"] > 0.1 for p in pairs)
    assert vsd("ingest", str(tmp_path / "f.jsonl"))[0] == 0
    stored = duckdb.sql(f"select count(distance_sd_mm) from '{tmp_path}/store/pairs/**/*.parquet'").fetchall()
    assert stored == [(len(pairs),)]


def test_camera_without_a_calibration_takes_its_tilt_from_the_people(scene: Scene, tmp_path: Path, vsd: Vsd) -> None:
    code, printed, _ = run(vsd, tmp_path, scene, "--json")
    assert code == 0
    done = json.loads(printed)
    assert done["engine"] == "monoloco tilt from its people"
    assert done["social_flags"] == {"persons": len(scene.people) // 2, "of": len(scene.people)}
    assert "pairs" not in json.loads((tmp_path / "f.jsonl").read_text().splitlines()[0])  # derived by the reader
