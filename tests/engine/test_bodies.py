"""Whole bodies from boxes: feet that cannot be seen, doubles, impossible heights; and tiles by the size of people."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from engine.simulated_people import SIZE, SimulatedCamera, boxes_only, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vsd_analytics.engine.bodies import (
    DOUBLE,
    TOO_HIGH,
    Bodies,
    body_sizes_px,
    heights_m,
    people_with_bodies,
)
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.detector import Detector
from vsd_analytics.engine.floor_points import below_boxes, photographer
from vsd_analytics.engine.tiles import PictureTile, tiles_for, tiles_of
from vsd_analytics.geometry.homography import to_floor

CAMERA = SimulatedCamera(height_m=4, tilt_deg=25)
H = CAMERA.homography()
Array = NDArray[np.float64]


def box_of(x_m: float, y_m: float, height_m: float = 1.7) -> Array:
    """Return the box of an upright body: the middle of head and feet, as wide as .4 of its height."""
    ends = np.array([[x_m, y_m, 0.0, 1.0], [x_m, y_m, height_m, 1.0]]) @ CAMERA.matrix().T
    (foot_u, foot_v), (head_u, head_v) = ends[:, :2] / ends[:, 2:]
    half, middle = 0.2 * (foot_v - head_v), (foot_u + head_u) / 2
    return np.array([middle - half, head_v, middle + half, foot_v])


def found(*boxes: Array) -> Detections:
    return Detections.of(np.array(boxes), np.linspace(0.9, 0.8, len(boxes)))


def place(box: Array) -> Array:
    camera = photographer(H, SIZE)
    assert camera is not None
    return to_floor(H, below_boxes(box.reshape(-1, 4), camera), picture_px=SIZE)


def learnt(*boxes: Array) -> Bodies:
    """Return a camera that has seen 25 whole bodies of 1.7 m, and then what was found."""
    bodies = Bodies(H, SIZE)
    for k in range(25):
        bodies.learn(found(box_of(-2 + 0.2 * k, 8 + 0.2 * k)))
    assert bodies.usual_m == pytest.approx(1.7, abs=0.01)
    return bodies


@settings(deadline=None, max_examples=40)
@given(x=st.floats(-3, 3), y=st.floats(7, 20), height=st.floats(1.4, 2.1))
def test_the_height_of_a_whole_body_is_its_true_one(x: float, y: float, height: float) -> None:
    camera = photographer(H, SIZE)
    assert camera is not None
    assert heights_m(box_of(x, y, height)[None], camera)[0] == pytest.approx(height, abs=0.02)


@settings(deadline=None, max_examples=40)
@given(x=st.floats(-3, 3), y=st.floats(9, 20), seen=st.floats(0.3, 0.55))
def test_feet_behind_something_are_put_where_the_usual_height_says(x: float, y: float, seen: float) -> None:
    whole = box_of(x, y)
    half = whole.copy()
    half[3] = whole[1] + seen * (whole[3] - whole[1])
    bodies = learnt()
    cleaned = bodies.cleaned(found(half))
    assert np.linalg.norm(place(cleaned.box[0]) - [x, y]) < 0.25
    assert np.linalg.norm(place(half) - [x, y]) > 1.0  # what the box alone would say
    assert bodies.n_extended == 1


def test_feet_below_the_picture_are_there_and_whole_bodies_stay_as_they_are() -> None:
    whole, cut = box_of(0, 10), box_of(1, 4.6)
    assert cut[3] > SIZE[1]
    cleaned = learnt().cleaned(found(whole, np.r_[cut[:3], SIZE[1]]))
    np.testing.assert_array_equal(cleaned.box[0], whole)
    assert cleaned.box[1, 3] > SIZE[1] + 10
    assert np.linalg.norm(place(cleaned.box[1]) - [1, 4.6]) < 0.3


def test_an_upper_half_on_a_whole_body_is_a_double_and_two_people_in_a_row_are_none() -> None:
    whole = box_of(0, 10)
    half = whole.copy()
    half[3] = (whole[1] + whole[3]) / 2
    bodies = learnt()
    cleaned = bodies.cleaned(found(half + np.array([3, 2, -3, 0]), whole))
    np.testing.assert_array_equal(cleaned.box, whole[None])  # though the half is surer
    assert bodies.left_out[DOUBLE] == 1
    behind = box_of(0.1, 11.5)  # hidden from the waist on by the one in front
    behind[3] = min(behind[3], whole[3])
    bodies = learnt()
    assert len(bodies.cleaned(found(whole, behind))) == 2
    assert not bodies.left_out[DOUBLE]


def test_a_box_higher_than_any_person_is_left_out_and_counted() -> None:
    bodies = learnt()
    assert len(bodies.cleaned(found(box_of(0, 10), box_of(2, 10, 3.0)))) == 1
    assert bodies.left_out == {TOO_HIGH: 1, DOUBLE: 0}


def test_without_a_homography_nothing_changes_and_joints_are_never_moved() -> None:
    whole = found(box_of(0, 10), box_of(0, 10) + 1)
    assert Bodies(None, SIZE).cleaned(whole) is whole
    half = box_of(0, 10)
    half[3] -= 0.6 * (half[3] - half[1])
    with_joints = Detections(half[None], np.ones(1), np.full((1, 25, 2), 5.0))
    np.testing.assert_array_equal(learnt().cleaned(with_joints).box, half[None])


def test_people_of_a_file_are_learnt_from_all_frames_before_any_is_changed() -> None:
    people = boxes_only(simulate(CAMERA, seed=4, n_tracks=30, seconds=4, missing=0))
    bodies = Bodies(H, SIZE)
    cleaned = people_with_bodies(people, bodies)
    assert 1.4 < bodies.usual_m < 1.9
    assert set(cleaned.frame) <= set(people.frame)
    assert len(cleaned) > 0.7 * len(people)


@given(
    width=st.integers(200, 4000),
    height=st.integers(200, 3000),
    side=st.integers(50, 4000),
    overlap=st.tuples(st.integers(0, 500), st.integers(0, 500)),
)
def test_tiles_cover_the_picture_and_share_what_was_asked(
    width: int, height: int, side: int, overlap: tuple[int, int]
) -> None:
    tiles = tiles_of((width, height), side_px=side, overlap_px=overlap)
    columns = sorted({(t.left, t.right) for t in tiles})
    rows = sorted({(t.top, t.bottom) for t in tiles})
    assert len(tiles) == len(columns) * len(rows)
    for spans, length, shared in ((columns, width, overlap[0]), (rows, height, overlap[1])):
        assert (spans[0][0], spans[-1][1]) == (0, length)
        assert {end - begin for begin, end in spans} == {min(side, length)}
        least = min(shared, min(side, length) // 2)
        assert all(a[1] - b[0] >= least - 1 for a, b in pairwise(spans))


def test_small_people_need_tiles_and_large_ones_or_a_large_network_none() -> None:
    size, body = (1920, 1080), (120.0, 280.0)
    assert len(tiles_for(size, input_px=(416, 416), body_px=body)) == 2
    assert tiles_for(size, input_px=(640, 640), body_px=body) == [PictureTile(0, 0, 1920, 1080)]
    assert len(tiles_for(size, input_px=(416, 416), body_px=(400.0, 900.0))) == 1
    assert len(tiles_for(size, input_px=(416, 416), body_px=None)) == 1
    assert 4 <= len(tiles_for(size, input_px=(320, 320), body_px=(20.0, 60.0))) <= 8


def test_sizes_of_bodies_follow_from_the_homography() -> None:
    small, large = body_sizes_px(H, SIZE) or (0.0, 0.0)
    heights = [box_of(0, y)[3] - box_of(0, y)[1] for y in (5, 30)]
    assert heights[1] < small < large < heights[0] * 1.2
    assert body_sizes_px(np.diag([0.01, 0.01, 1.0]), SIZE) is None


def test_a_box_that_a_tile_cuts_is_left_to_the_next_tile() -> None:
    tile = PictureTile(100, 0, 300, 200)
    boxes = found(*(np.array(b, float) for b in ([101, 5, 150, 90], [150, 2, 299, 90], [150, 2, 250, 199.5])))
    assert tile.is_cut(boxes, (400, 200)).tolist() == [True, True, False]
    assert tile.is_cut(boxes, (300, 400)).tolist() == [True, False, True]


@pytest.mark.realdata
def test_a_real_detector_finds_most_people_of_a_real_street(realdata) -> None:
    from vsd_analytics.engine.pictures import VideoFile

    detector = Detector(realdata("detector_models/nanodet_416.onnx"))
    clip: Path = realdata("oxtown/oxford_clip_frames_0_99.mp4")
    matrix = np.loadtxt(realdata("oxtown/H_image_to_ground_m.txt"))
    tiles = tiles_for(SIZE, input_px=(416, 416), body_px=body_sizes_px(matrix, SIZE))
    assert len(tiles) == 2
    shot = next(VideoFile(clip).pictures(1))
    assert shot.picture is not None
    assert 10 <= len(detector.people(shot.picture, tiles=tiles)) <= 18  # 11 are annotated, and some are left out
