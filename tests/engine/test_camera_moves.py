"""A knocked camera is noticed, with time and angle, and an untouched one is left alone whoever passes."""

from __future__ import annotations

import json
import shutil
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from engine.simulated_people import SIZE, SimulatedCamera
from engine.simulated_weeks import MONDAY_MS, simulate_week
from engine.vsd_in_a_shop import Vsd, in_shop, write_shop

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.engine.camera_model import camera_of_homography
from vsd_analytics.engine.camera_moves import HOUR_MS, CameraCheck, check_camera
from vsd_analytics.engine.people import People
from vsd_analytics.engine.people_calibration import FromPeople, calibrate_from_people

CAMERA = SimulatedCamera(height_m=3.5, tilt_deg=20, f_widths=0.8, roll_deg=1.0, k1=-0.03)
TURNED_H = 2 * 24 + 14.0
"""Wednesday, 14:00 UTC."""


@cache
def known() -> FromPeople:
    return calibrate_from_people(simulate_week(CAMERA, seed=1, days=2), size_px=SIZE)


@cache
def week(tilt_deg: float = 0.0, roll_deg: float = 0.0, seed: int = 2) -> People:
    return simulate_week(
        CAMERA, seed=seed, days=6, people_an_hour=28, moved_h=TURNED_H, tilt_deg=tilt_deg, roll_deg=roll_deg
    )


def checked(people: People) -> CameraCheck:
    return check_camera(people, known().camera, depth_m=known().depth_m, size_px=SIZE, usual=known().usual_turn)


@pytest.mark.parametrize(("tilt", "roll"), [(1.0, 0.0), (-2.0, 0.0), (0.0, 2.0)])
def test_turned_camera_is_found_with_hour_and_angle(tilt: float, roll: float) -> None:
    (move,) = checked(week(tilt, roll)).moves
    assert move.after_ms is not None
    assert move.after_ms - HOUR_MS <= MONDAY_MS + TURNED_H * HOUR_MS <= move.before_ms + HOUR_MS
    assert move.tilt_deg == pytest.approx(tilt, abs=0.3)
    assert move.roll_deg == pytest.approx(roll, abs=0.3)


def test_untouched_camera_has_not_moved_whoever_passes() -> None:
    for seed in (2, 3):
        check = checked(simulate_week(CAMERA, seed=seed, days=5))
        assert check.moves == ()
        assert check.least_deg is not None
        assert check.least_deg < 1.0


def test_camera_that_looks_further_down_makes_distances_too_long() -> None:
    down, up = (checked(week(tilt)).moves[0].distance_change for tilt in (5.0, -2.0))
    assert down > 0.2
    assert up < -0.05


def test_move_before_the_recording_is_found_against_the_calibration() -> None:
    people = week(5.0).between(round(MONDAY_MS + (TURNED_H + 1) * HOUR_MS), None)
    (move,) = checked(people).moves
    assert move.after_ms is None
    assert move.tilt_deg == pytest.approx(5.0, abs=0.5)


def test_camera_put_back_next_day_has_moved_twice() -> None:
    quiet, turned = week(), week(3.0)
    back_ms = MONDAY_MS + round((TURNED_H + 24) * HOUR_MS)
    first, last = turned.between(None, back_ms), quiet.between(back_ms, None)
    n = len(first.frames)
    assert first.ts_ms is not None
    assert last.ts_ms is not None
    both = People(
        np.concatenate([first.frame, last.frame - last.frames[0] + n]),
        np.concatenate([first.track, last.track]),
        np.concatenate([first.box, last.box]),
        np.concatenate([first.joints, last.joints]),
        np.arange(n + len(last.frames)),
        np.concatenate([first.ts_ms, last.ts_ms]),
    )
    there, back = checked(both).moves
    assert there.tilt_deg == pytest.approx(3.0, abs=0.3)
    assert back.tilt_deg == pytest.approx(-3.0, abs=0.3)


def test_few_people_cannot_tell() -> None:
    check = checked(week(5.0).between(None, MONDAY_MS + 11 * HOUR_MS))
    assert (check.moves, check.least_deg) == ((), None)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("mirror", [1, -1])
def test_camera_is_found_in_a_homography_of_any_floor_axes_and_any_scale(sign: int, mirror: int) -> None:
    turned_floor = np.array([[0.6, -0.8, 3.0], [0.8 * mirror, 0.6 * mirror, -7.0], [0.0, 0.0, 1.0]])
    camera = camera_of_homography(sign * turned_floor @ CAMERA.homography(), SIZE)
    assert camera is not None
    assert np.degrees([camera.tilt_rad, camera.roll_rad]) == pytest.approx([20, 1])
    assert (camera.height_m, camera.focal_px) == pytest.approx((3.5, 0.8 * SIZE[0]))
    assert camera_of_homography(np.diag([0.01, 0.02, 1.0]), SIZE) is None


# --- the command ------------------------------------------------------------------------------------------------


def write_timed(path: Path, people: People) -> Path:
    assert people.ts_ms is not None
    ts = people.ts_ms[np.searchsorted(people.frames, people.frame)]
    rows = zip(ts.tolist(), people.track, people.box.round(1).tolist(), strict=True)
    lines = [",".join(map(str, (t, track, *box))) for t, track, box in rows]
    path.write_text("ts,track_id,left,top,right,bottom\n" + "\n".join(lines) + "\n")
    return path


def write_week(folder: Path, tilt_deg: float) -> Path:
    return write_timed(folder / "week.csv", week(tilt_deg))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a shop whose camera is calibrated from the people of two days. Tests work on copies."""
    root = tmp_path_factory.mktemp("calibrated")
    write_shop(root)
    first = write_timed(root / "first.csv", simulate_week(CAMERA, seed=1, days=2))
    assert run(cli, ["-C", str(root), "calibrate", "cam-1", "--from-people", str(first)]) == 0
    return root


@pytest.fixture
def vsd(calibrated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    """Return `vsd(words...)` in a copy of that shop."""
    shutil.copytree(calibrated, tmp_path, dirs_exist_ok=True)
    return in_shop(tmp_path, capsys)


def test_check_of_a_moved_camera_prints_the_command_that_calibrates_it_anew(tmp_path: Path, vsd: Vsd) -> None:
    source = write_week(tmp_path, 3.0)
    code, printed, err = vsd("calibrate", "cam-1", "--check", str(source))
    assert code == 1
    assert "whole people in" in printed
    assert "warning[W405]: camera cam-1 has moved on Wednesday 2025-11-12 about 15:00 (tilt about +" in err
    assert "come out about" in err
    command = err[err.index("vsd calibrate") :].split()
    assert vsd(*command[1:])[0] == 0
    code, printed, err = vsd("calibrate", "cam-1", "--check", str(source))
    assert (code, err) == (0, "")
    assert "the camera has not moved" in printed
    assert "2025-11-12T14:00" in (tmp_path / "calibration" / "cam-1.toml").read_text()


def test_check_as_json_has_the_hour(tmp_path: Path, vsd: Vsd) -> None:
    code, printed, _ = vsd("calibrate", "cam-1", "--check", str(write_week(tmp_path, 3.0)), "--json")
    (move,) = json.loads(printed)["moves"]
    assert code == 1
    assert datetime.fromisoformat(move["from"]) == datetime(2025, 11, 12, 14, tzinfo=UTC)


def test_check_of_a_quiet_week_ends_well(tmp_path: Path, vsd: Vsd) -> None:
    code, printed, err = vsd("calibrate", "cam-1", "--check", str(write_week(tmp_path, 0.0)))
    assert (code, err) == (0, "")
    assert "the camera has not moved" in printed


def test_boxes_without_times_cannot_be_checked(tmp_path: Path, vsd: Vsd) -> None:
    source = tmp_path / "frames.csv"
    source.write_text("frame,left,top,right,bottom\n1,10,10,50,100\n")
    code, _, err = vsd("calibrate", "cam-1", "--check", str(source))
    assert code == 2
    assert "has no ts" in err


def test_engine_run_warns_of_a_move_and_messages_change_with_the_calibration(tmp_path: Path, vsd: Vsd) -> None:
    source, out = write_week(tmp_path, 3.0), tmp_path / "frames.jsonl"
    engine_run = ["engine", "run", str(source), "--camera", "cam-1", "--out", str(out)]
    code, printed, err = vsd(*engine_run, "--json")
    assert code == 0
    assert "W405" in err
    assert len(json.loads(printed)["moves"]) == 1
    command = err[err.index("vsd calibrate") :].split()
    vsd(*command[1:])
    code, printed, err = vsd(*engine_run, "--json")
    done = json.loads(printed)
    assert (code, err, done["moves"]) == (0, "", [])
    messages = [json.loads(line) for line in out.read_text().splitlines()]
    assert len(messages) == done["frames"]
    engines = [message["engine"] for message in messages]
    change = next(i for i, engine in enumerate(engines) if engine != engines[0])
    assert messages[change]["ts"] >= "2025-11-12T14:00"
    assert messages[change - 1]["ts"] < "2025-11-12T14:00"
    assert len(set(engines)) == 2


def test_weeks_on_both_sides_of_a_found_move_are_not_compared(tmp_path: Path, vsd: Vsd) -> None:
    source, out = write_week(tmp_path, 3.0), tmp_path / "frames.jsonl"
    engine_run = ["engine", "run", str(source), "--camera", "cam-1", "--out", str(out)]
    _, _, err = vsd(*engine_run)
    assert vsd(*err[err.index("vsd calibrate") :].split()[1:])[0] == 0
    vsd(*engine_run)
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    is_later = [line["ts"] >= "2025-11-12T14" for line in lines]
    # the same messages without gaps: two days before the move, and the same weekdays of the next week after it
    for later, first_ms in ((False, MONDAY_MS - HOUR_MS), (True, MONDAY_MS + 167 * HOUR_MS)):
        some = [line for line, is_after in zip(lines, is_later, strict=True) if is_after == later]
        times = [datetime.fromtimestamp(first_ms / 1000 + 30 * i, UTC).isoformat() for i in range(2 * 24 * 120)]
        even = [json.dumps(some[i % len(some)] | {"ts": ts}) for i, ts in enumerate(times)]
        out.write_text("\n".join(even) + "\n")
        vsd("ingest", str(out), "--yes")  # made messages: few people are in one frame, which W224 doubts
    code, printed, _ = vsd("compare", "2025-11-10..2025-11-11", "2025-11-17..2025-11-18")
    assert code == 1
    assert "the engine changed from vsd-people" in printed
    assert printed.count("100%") == 2, "both weeks are recorded"
