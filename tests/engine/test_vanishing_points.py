"""`vsd calibrate --lines`: a camera from the straight edges of one picture."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from engine.simulated_people import SIZE, SimulatedCamera
from engine.simulated_rooms import room_picture
from engine.vsd_in_a_shop import Vsd, shop

from vsd_analytics.engine.vanishing_points import camera_from_segments, line_segments
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import to_floor, to_image

Picture = np.ndarray  # type: ignore[type-arg]
CAMERA = SimulatedCamera(height_m=3.4, tilt_deg=28, roll_deg=1.5, f_widths=1.0)


@pytest.mark.parametrize(
    ("tilt_deg", "f_widths", "turn_deg", "k1"),
    [(15, 1.3, 20, 0.0), (28, 1.0, -35, -0.05), (40, 0.65, 10, 0.0), (55, 0.9, 30, 0.0), (25, 0.9, 0, 0.0)],
)
def test_edges_of_a_room_give_tilt_roll_and_focal_length(
    tilt_deg: float, f_widths: float, turn_deg: float, k1: float
) -> None:
    camera = SimulatedCamera(height_m=3.4, tilt_deg=tilt_deg, roll_deg=1.5, f_widths=f_widths, k1=k1)
    picture = room_picture(camera, seed=1, turn_deg=turn_deg)
    found = camera_from_segments(line_segments(picture), size_px=SIZE, height_m=3.4)
    assert np.degrees(found.camera.tilt_rad) == pytest.approx(tilt_deg, abs=1.0)
    assert np.degrees(found.camera.roll_rad) == pytest.approx(1.5, abs=1.0)
    assert found.camera.focal_px / SIZE[0] == pytest.approx(f_widths, rel=0.08 if turn_deg else 0.35)  # 0: left open
    assert found.share > 0.5


@pytest.fixture(scope="module")
def room() -> Picture:
    return room_picture(CAMERA, seed=2, turn_deg=25)


def test_the_same_picture_gives_the_same_camera_with_true_distances_on_the_floor(room: Picture) -> None:
    segments = line_segments(room)
    found, again = (camera_from_segments(segments, size_px=SIZE, height_m=3.4) for _ in range(2))
    assert found == again
    spots = np.array([(-2.0, 5.0), (-1.0, 6.5), (0.0, 5.0), (2.0, 8.0), (1.0, 10.0)])
    there = to_floor(found.camera.homography(), to_image(CAMERA.homography(), spots), picture_px=SIZE)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(there, axis=0), axis=1), np.linalg.norm(np.diff(spots, axis=0), axis=1), rtol=0.03
    )


def test_edges_in_all_directions_and_too_few_edges_are_refused() -> None:
    rng = np.random.default_rng(0)
    start = rng.uniform(0, SIZE, (200, 2))
    turn = rng.uniform(0, np.pi, 200)
    clutter = np.column_stack([start, start + 120 * np.column_stack([np.cos(turn), np.sin(turn)])])
    with pytest.raises(CalibrationError, match="show no camera") as refused:
        camera_from_segments(clutter, size_px=SIZE, height_m=3.0)
    assert refused.value.code == "E413"
    with pytest.raises(CalibrationError, match="show no camera") as refused:
        camera_from_segments(clutter[:20], size_px=SIZE, height_m=3.0)
    assert "20 long straight edges" in str(refused.value.why)


@pytest.fixture(scope="module")
def pictures(room: Picture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with pictures of a room, of nothing, and of the room in half the size."""
    folder = tmp_path_factory.mktemp("pictures")
    cv2.imwrite(str(folder / "room.png"), room)
    cv2.imwrite(str(folder / "grey.png"), np.full((1080, 1920), 120, dtype=np.uint8))
    cv2.imwrite(str(folder / "small.png"), room[::2, ::2])
    return folder


@pytest.fixture
def vsd(pictures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    shutil.copytree(pictures, tmp_path, dirs_exist_ok=True)
    return shop(tmp_path, capsys)


def test_a_picture_and_a_height_calibrate_a_camera(tmp_path: Path, vsd: Vsd) -> None:
    code, printed, err = vsd("calibrate", "cam-1", "--lines", str(tmp_path / "room.png"), "--height", "3.4")
    assert (code, err) == (0, "")
    assert "straight edges" in printed
    matrix = np.loadtxt(tmp_path / "calibration" / "cam-1.txt")
    spots = to_image(CAMERA.homography(), [(0.0, 5.0), (0.0, 9.0)])
    ahead = to_floor(matrix, spots, picture_px=SIZE)
    assert np.linalg.norm(ahead[1] - ahead[0]) == pytest.approx(4.0, rel=0.03)
    words = ["--lines", str(tmp_path / "room.png"), "--height", "3.4", "--json"]
    assert json.loads(vsd("calibrate", "cam-1", *words)[1])["tilt_deg"] == pytest.approx(28, abs=0.5)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--lines", "room.png"], "--height"),
        (["--height", "3"], "--lines"),
        (["--lines", "grey.png", "--height", "3"], "0 long straight edges"),
        (["--lines", "small.png", "--height", "3"], "960x540"),
        (["--lines", "vsd.toml", "--height", "3"], "cannot read"),
        (["--lines", "room.png", "--height", "3", "--draw"], "exclude each other"),
    ],
)
def test_what_cannot_calibrate_is_an_error_for_people(
    words: list[str], says: str, tmp_path: Path, vsd: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = vsd("calibrate", "cam-1", *words)
    assert code == 2
    assert says in err
    assert not (tmp_path / "calibration").exists()
