"""`vsd engine run --overlay`: one picture a frame, readable in colour and in grey, over the right picture."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from engine.simulated_people import SIZE, SimulatedCamera, upright_boxes
from engine.vsd_in_a_shop import Vsd, shop, write_boxes

from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.overlay import BONES, OverlayLook, draw_frame
from vsd_analytics.engine.people import N_JOINTS, People
from vsd_analytics.geometry.homography import to_image

CAMERA = SimulatedCamera(height_m=4, tilt_deg=25)
LOOK = OverlayLook(SIZE, 2.0, lambda metres: f"{metres:g} m")
GROUND = 238


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    command = shop(tmp_path, capsys)
    np.savetxt(tmp_path / "matrix.txt", CAMERA.homography())
    assert command("calibrate", "cam-1", "--matrix", str(tmp_path / "matrix.txt"))[0] == 0
    return command


def standing(places: list[tuple[float, float]], frame: list[int] | None = None) -> People:
    """Return boxes of people whose feet are at places on the floor, metres."""
    foot = to_image(CAMERA.homography(), places, picture_px=SIZE)
    frames = np.array(frame or [0] * len(places), dtype=np.int64)
    box = upright_boxes(CAMERA, foot)
    track = np.array([str(i) for i in range(len(places))], dtype=object)
    return People(frames, track, box, np.full((len(places), N_JOINTS, 2), np.nan), np.unique(frames))


def drawn(people: People) -> np.ndarray:
    seen = locate(people, homography=CAMERA.homography(), picture_px=SIZE, within_m=2.5, name="test")
    canvas = np.full((SIZE[1], SIZE[0], 3), GROUND, dtype=np.uint8)
    return draw_frame(canvas, seen, np.arange(len(people)), np.flatnonzero(seen.distance_m < 2), look=LOOK)


def at(picture: np.ndarray, x_m: float, y_m: float) -> np.ndarray:
    u, v = to_image(CAMERA.homography(), [(x_m, y_m)], picture_px=SIZE)[0].round().astype(int)
    return picture[v, u].astype(int)


def run(vsd: Vsd, folder: Path, *words: str) -> tuple[int, str, str]:
    people = standing([(0, 8), (1.2, 8), (-3, 9), (0, 8)], frame=[3, 3, 3, 5])
    source = write_boxes(folder / "people.csv", people)
    start = ["--hz", "2", "--start", "2026-11-09T08:00", "--out", str(folder / "frames.jsonl")]
    return vsd("engine", "run", str(source), "--camera", "cam-1", *start, "--overlay", str(folder / "out"), *words)


def test_a_safe_space_ends_at_half_the_distance_from_the_feet() -> None:
    picture = drawn(standing([(0, 8)]))
    for side in (-1, 1):
        assert at(picture, side * 0.9, 8)[0] - at(picture, side * 0.9, 8)[2] > 20  # blue
        assert at(picture, side * 1.1, 8).tolist() == [GROUND] * 3


def test_people_too_close_are_red_with_a_line_between_their_feet_and_the_others_blue() -> None:
    picture = drawn(standing([(0, 8), (1.2, 8), (-4, 9)]))
    line = at(picture, 0.25, 8)
    assert line[2] - line[0] > 150
    assert at(picture, 0.0, 8.8)[2] > at(picture, 0.0, 8.8)[0]
    assert at(picture, -4.0, 9.6)[0] > at(picture, -4.0, 9.6)[2]


def test_people_exactly_as_far_apart_as_allowed_are_not_too_close() -> None:
    picture = drawn(standing([(0, 8), (2.01, 8)]))
    assert at(picture, 1.005, 8).tolist() != at(drawn(standing([(0, 8), (1.99, 8)])), 1.005, 8).tolist()
    assert at(picture, 0, 8.8)[0] > at(picture, 0, 8.8)[2]


def test_in_grey_only_safe_spaces_of_people_too_close_are_hatched() -> None:
    picture = cv2.cvtColor(drawn(standing([(0, 8), (1.2, 8), (-4, 8)])), cv2.COLOR_BGR2GRAY).astype(int)

    def shades(x_m: float) -> int:
        u, v = to_image(CAMERA.homography(), [(x_m, 7.5)], picture_px=SIZE)[0].round().astype(int)
        return int(np.ptp(picture[v - 8 : v + 8, u - 8 : u + 8]))

    assert shades(1.4) > 25
    assert shades(-3.8) < 8


def test_a_person_without_a_place_is_drawn_without_a_safe_space() -> None:
    people = standing([(0, 8)])
    people.box[:] = (900, 10, 960, 60)  # above the horizon
    picture = drawn(people)
    assert picture[60, 930].max() < 200  # its box
    assert (picture[100:] == GROUND).all()


def test_bones_join_joints_of_the_skeleton_once() -> None:
    assert len({frozenset(bone) for bone in BONES}) == len(BONES) == N_JOINTS - 1  # a tree
    assert {joint for bone in BONES for joint in bone} == set(range(N_JOINTS))


def test_every_frame_has_a_picture_also_without_people_and_the_same_bytes_again(tmp_path: Path, vsd: Vsd) -> None:
    code, printed, err = run(vsd, tmp_path)
    assert (code, err) == (0, "")
    assert "2 pictures, on grey ground" in printed
    names = [f"frame-{n:08d}.jpg" for n in (3, 5)]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == names
    first = [(tmp_path / "out" / name).read_bytes() for name in names]
    assert cv2.imread(str(tmp_path / "out" / names[0])).shape == (1080, 1920, 3)
    (tmp_path / "out").rename(tmp_path / "before")
    assert run(vsd, tmp_path)[0] == 0
    assert [(tmp_path / "out" / name).read_bytes() for name in names] == first


def test_the_paper_s_own_ellipses_are_drawn_with_its_method(tmp_path: Path, vsd: Vsd) -> None:
    code, printed, _ = run(vsd, tmp_path, "--method", "paper", "--ratios", "0.4,0.5", "--json")
    assert code == 0
    assert json.loads(printed)["pictures"] == 2
    picture = cv2.imread(str(tmp_path / "out" / "frame-00000005.jpg")).astype(int)
    foot = to_image(CAMERA.homography(), [(0, 8)], picture_px=SIZE)[0].round().astype(int)
    half_px = 180 / 1.7  # a box of 180 px is 1.70 m high
    for off, is_inside in ((0.85, True), (1.2, False)):
        blue, _, red = picture[foot[1] + 3, foot[0] + round(off * half_px)]
        assert (blue - red > 20) == is_inside, off


def test_pictures_are_found_by_the_number_in_their_names(tmp_path: Path, vsd: Vsd) -> None:
    (tmp_path / "seen").mkdir()
    for number, shade in ((3, 60), (4, 90)):
        picture = np.full((540, 960, 3), shade, dtype=np.uint8)
        cv2.imwrite(str(tmp_path / "seen" / f"door2_{number:06d}.png"), picture)
    code, printed, err = run(vsd, tmp_path, "--pictures", str(tmp_path / "seen"))
    assert (code, err) == (0, "")
    assert "2 pictures, 1 of them on the camera's" in printed
    shades = [int(cv2.imread(str(tmp_path / "out" / f"frame-{n:08d}.jpg"))[1000, 1800].mean().round()) for n in (3, 5)]
    assert shades == [60, GROUND]


def test_pictures_of_a_video_are_those_of_the_frames_numbers(tmp_path: Path, vsd: Vsd) -> None:
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (960, 540))
    for shade in (0, 20, 40, 60, 80, 100, 120):
        video.write(np.full((540, 960, 3), shade, dtype=np.uint8))
    video.release()
    assert run(vsd, tmp_path, "--pictures", str(tmp_path / "v.avi"))[0] == 0
    for number, shade in ((3, 60), (5, 100)):
        picture = cv2.imread(str(tmp_path / "out" / f"frame-{number:08d}.jpg"))
        assert picture[1000, 1800].mean() == pytest.approx(shade, abs=3)


def test_pictures_of_frames_by_time_are_named_by_their_milliseconds(tmp_path: Path, vsd: Vsd) -> None:
    source = tmp_path / "people.csv"
    source.write_text("ts,left,top,right,bottom\n1794211200.5,900,500,960,700\n1794211201.5,900,500,960,700\n")
    (tmp_path / "seen").mkdir()
    cv2.imwrite(str(tmp_path / "seen" / "1794211201500.png"), np.full((1080, 1920, 3), 70, dtype=np.uint8))
    words = ["--out", str(tmp_path / "f.jsonl"), "--overlay", str(tmp_path / "o"), "--pictures", str(tmp_path / "seen")]
    code, printed, err = vsd("engine", "run", str(source), "--camera", "cam-1", *words)
    assert (code, err) == (0, "")
    assert "1 of them on the camera's" in printed
    assert cv2.imread(str(tmp_path / "o" / "frame-00000001.jpg"))[1000, 1800].mean() == pytest.approx(70, abs=1)


def test_pictures_that_exist_are_not_written_over_and_no_messages_are_written_then(tmp_path: Path, vsd: Vsd) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "frame-00000005.jpg").write_text("mine")
    code, _, err = run(vsd, tmp_path)
    assert code == 2
    assert "frame-00000005.jpg" in err
    assert (tmp_path / "out" / "frame-00000005.jpg").read_text() == "mine"
    assert not (tmp_path / "out" / "frame-00000003.jpg").exists()
    assert not (tmp_path / "frames.jsonl").exists()


@pytest.mark.parametrize(
    ("names", "shape", "says"),
    [
        (["a_3.png", "b_3.png"], (1080, 1920), "two pictures"),
        (["a_3.png"], (1000, 1000), "1000x1000"),
        (["a_7.png"], (1080, 1920), "no picture of seen belongs to a frame"),
        ([], (1080, 1920), "0 pictures"),
    ],
)
def test_pictures_that_cannot_be_the_frames_are_refused(
    names: list[str], shape: tuple[int, int], says: str, tmp_path: Path, vsd: Vsd
) -> None:
    (tmp_path / "seen").mkdir()
    for name in names:
        cv2.imwrite(str(tmp_path / "seen" / name), np.zeros((*shape, 3), dtype=np.uint8))
    code, _, err = run(vsd, tmp_path, "--pictures", str(tmp_path / "seen"))
    assert code == 2
    assert says in err


@pytest.mark.parametrize(
    ("pictures", "says"), [("nowhere", "there is no file"), ("people.csv", "cannot read people.csv as a video")]
)
def test_pictures_that_are_none_are_an_error_for_people(pictures: str, says: str, tmp_path: Path, vsd: Vsd) -> None:
    code, _, err = run(vsd, tmp_path, "--pictures", str(tmp_path / pictures))
    assert code == 2
    assert says in err
    assert "Traceback" not in err


def test_pictures_without_an_overlay_are_refused(tmp_path: Path, vsd: Vsd) -> None:
    source = write_boxes(tmp_path / "people.csv", standing([(0, 8)]))
    words = ["--out", str(tmp_path / "f.jsonl"), "--pictures", str(tmp_path)]
    code, _, err = vsd("engine", "run", str(source), "--camera", "cam-1", *words)
    assert code == 2
    assert "--overlay" in err
