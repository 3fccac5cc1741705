"""`vsd engine run`: frame messages that `vsd ingest` reads."""

from __future__ import annotations

import json
from pathlib import Path

import duckdb
import numpy as np
import pytest
from engine.simulated_people import SimulatedCamera, boxes_only, simulate
from engine.vsd_in_a_shop import Vsd, shop, write_boxes

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

CAMERA = SimulatedCamera(height_m=4, tilt_deg=25)


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    return shop(tmp_path, capsys)


def messages(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_paper_s_pairs_of_boxes_reach_the_store_with_their_distances(tmp_path: Path, vsd: Vsd) -> None:
    people = boxes_only(simulate(CAMERA, seed=1, n_tracks=25, seconds=5))
    source, out = write_boxes(tmp_path / "people.csv", people), tmp_path / "frames.jsonl"
    start = ["--hz", "2", "--start", "2026-11-09T08:00:00+01:00"]
    code, printed, err = vsd(
        *("engine", "run", str(source), "--camera", "cam-1", "--method", "paper", "--ratios", "0.3,0.4", *start),
        *("--out", str(out)),
    )
    assert (code, err) == (0, "")
    assert "vsd-paper inset 0.3/0.4 box" in printed
    found = messages(out)
    assert [m["seq"] for m in found] == people.frames.tolist()
    assert found[0]["ts"] == "2026-11-09T07:00:00.000Z"
    n_pairs = sum(len(m["pairs"]) for m in found)  # type: ignore[arg-type]
    assert n_pairs > 20
    code, _, err = vsd("ingest", str(out))
    assert code == 0, err
    stored = duckdb.sql(f"select count(*), min(distance_mm) from '{tmp_path}/store/pairs/**/*.parquet'").fetchall()
    nearest = min(pair["distance_m"] for m in found for pair in m["pairs"])  # type: ignore[attr-defined]
    assert stored == [(n_pairs, round(nearest * 1000))]


def test_metres_of_a_calibrated_camera_are_the_true_ones(tmp_path: Path, vsd: Vsd) -> None:
    scene = simulate(CAMERA, seed=2, noise_px=0, missing=0, standing=1.0, seconds=2)
    people = boxes_only(scene)
    np.savetxt(tmp_path / "matrix.txt", CAMERA.homography())
    assert vsd("calibrate", "cam-1", "--matrix", str(tmp_path / "matrix.txt"))[0] == 0
    source, out = write_boxes(tmp_path / "people.csv", people), tmp_path / "frames.jsonl"
    code, printed, _ = vsd("engine", "run", str(source), "--camera", "cam-1", "--out", str(out), "--json")
    assert code == 0
    assert json.loads(printed)["persons"] == len(people)
    persons = [p for m in messages(out) for p in m["persons"]]  # type: ignore[attr-defined]
    xy = np.array([(p["x_m"], p["y_m"]) for p in persons])
    assert np.median(np.linalg.norm(xy - scene.xy, axis=1)) < 0.5  # the edge of a box is before the body
    assert [p["id"] for p in persons] == people.track.tolist()


def test_people_without_ids_are_sent_without_pairs_that_would_join_frames(tmp_path: Path, vsd: Vsd) -> None:
    people = boxes_only(simulate(CAMERA, seed=2, seconds=2))
    np.savetxt(tmp_path / "matrix.txt", CAMERA.homography())
    vsd("calibrate", "cam-1", "--matrix", str(tmp_path / "matrix.txt"))
    source, out = write_boxes(tmp_path / "people.csv", people, with_tracks=False), tmp_path / "frames.jsonl"
    command = ["engine", "run", str(source), "--camera", "cam-1", "--out", str(out)]
    code, _, err = vsd(*command)
    assert code == 0
    assert "give --start and --hz" in err
    assert not any("pairs" in m or "id" in p for m in messages(out) for p in m["persons"])  # type: ignore[attr-defined]
    vsd(*command, "--method", "paper")
    ids = [p["id"] for m in messages(out) for p in m["persons"]]  # type: ignore[attr-defined]
    assert len(ids) == len(set(ids)) == len(people)


def test_run_without_a_calibration_names_the_command_that_makes_one(tmp_path: Path, vsd: Vsd) -> None:
    source = write_boxes(tmp_path / "people.csv", boxes_only(simulate(CAMERA, seed=2, seconds=1)))
    code, _, err = vsd("engine", "run", str(source), "--camera", "cam-1", "--out", str(tmp_path / "x.jsonl"))
    assert code == 2
    assert "vsd calibrate cam-1 --from-people" in err
    assert not (tmp_path / "x.jsonl").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--camera", "cam-7"], "no camera 'cam-7'"),
        (["--camera", "cam-1", "--method", "paper", "--ratios", "0.7"], "not two numbers"),
        (["--camera", "cam-1", "--size", "big"], "not a picture size"),
    ],
)
def test_wrong_option_is_an_error_with_its_name(words: list[str], says: str, tmp_path: Path, vsd: Vsd) -> None:
    source = write_boxes(tmp_path / "people.csv", boxes_only(simulate(CAMERA, seed=2, seconds=1)))
    code, _, err = vsd("engine", "run", str(source), "--out", str(tmp_path / "x.jsonl"), *words)
    assert code == 2
    assert says in err


def test_people_without_a_place_are_a_number_and_nothing_goes_to_quarantine(tmp_path: Path, vsd: Vsd) -> None:
    np.savetxt(tmp_path / "matrix.txt", CAMERA.homography())
    assert vsd("calibrate", "cam-1", "--matrix", str(tmp_path / "matrix.txt"))[0] == 0
    head_alone = [0.0] * 51
    head_alone[:3] = [900, 300, 0.9]
    head_alone[15:21] = [850, 350, 0.9, 950, 350, 0.9]
    people = [{"image_id": 0, "category_id": 1, "keypoints": head_alone, "score": 0.9}]
    (tmp_path / "joints.json").write_text(json.dumps(people))
    out = tmp_path / "frames.jsonl"
    words = ["engine", "run", str(tmp_path / "joints.json"), "--camera", "cam-1", "--start", "2026-11-09T08:00"]
    code, printed, _ = vsd(*words, "--track", "--out", str(out))
    assert code == 0
    assert "1 person not used" in printed
    assert "so that feet are seen" in printed
    (message,) = messages(out)
    assert (message["persons"], message["unplaced"]) == ([], 1)
    code, printed, err = vsd("ingest", str(out))
    assert (code, err) == (0, "")
    assert "left out: 1 person without a place" in printed


def test_start_without_an_offset_is_in_the_zone_of_the_site_as_for_ingest(tmp_path: Path, vsd: Vsd) -> None:
    np.savetxt(tmp_path / "matrix.txt", CAMERA.homography())
    vsd("calibrate", "cam-1", "--matrix", str(tmp_path / "matrix.txt"))
    source = write_boxes(tmp_path / "people.csv", boxes_only(simulate(CAMERA, seed=2, seconds=1)))
    words = ["engine", "run", str(source), "--camera", "cam-1", "--hz", "2", "--out", str(tmp_path / "f.jsonl")]
    assert vsd(*words, "--start", "2026-11-09T08:00")[0] == 0
    assert messages(tmp_path / "f.jsonl")[0]["ts"] == "2026-11-09T07:00:00.000Z"  # the site is in Rome


@pytest.mark.parametrize(
    "words",
    [
        ("engine", "run", "{address}", "--camera", "cam-1", "--detector", "model.onnx"),
        ("engine", "run", "door.mp4", "--camera", "cam-1", "--detector", "model.onnx", "--pictures", "{address}"),
        ("engine", "probe", "model.onnx", "{address}"),
        ("calibrate", "cam-1", "--from-people", "{address}"),
        ("evaluate", "{address}"),
    ],
    ids=" ".join,
)
def test_an_address_of_a_camera_is_no_file_and_its_password_is_not_repeated(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    given = [word.format(address="rtsp://viewer:swordfish@camera.example:554/stream1") for word in words]
    assert run(cli, given) == 2
    told = capsys.readouterr()
    assert "swordfish" not in told.out + told.err
    assert "error[E204]" in told.err
    assert "vsd engine live" in told.err
