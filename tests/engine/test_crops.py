"""Joints from crops: RTMPose's columns and rows, MoveNet's shares, back in pixels of the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from engine.detector_models import constant_model
from numpy.typing import NDArray

from vsd_analytics.engine.crops import JointFinder, placed_crop
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.detector import Detector
from vsd_analytics.engine.people import COCO_17
from vsd_analytics.errors import InputError

POINTS = np.column_stack([np.linspace(20, 170, 17).round(), np.linspace(10, 240, 17).round()])
SCORES = np.where(np.arange(17) % 4 == 3, 0.1, 0.8)
BOX = np.array([300.0, 100.0, 360.0, 300.0])


def simcc(n: int, places: NDArray) -> NDArray:
    """Return scores whose greatest is at twice the place."""
    scores = np.zeros((1, 17, 2 * n), dtype=np.float32)
    scores[0, np.arange(17), (2 * places).astype(int)] = SCORES
    return scores


def rtmpose(path: Path) -> Path:
    columns, rows = simcc(192, POINTS[:, 0]), simcc(256, POINTS[:, 1])
    return constant_model(path, {"simcc_y": rows, "simcc_x": columns}, shape=(1, 3, 256, 192))


def movenet(path: Path) -> Path:
    joints = np.column_stack([POINTS[:, ::-1] / 256, SCORES]).astype(np.float32)
    return constant_model(path, {"output_0": joints.reshape(1, 1, 17, 3)}, shape=(1, 256, 256, 3), kind="int32")


@pytest.mark.parametrize(("write", "size"), [(rtmpose, (192, 256)), (movenet, (256, 256))])
def test_joints_of_a_crop_are_in_pixels_of_the_picture(write, size: tuple[int, int], tmp_path: Path) -> None:
    finder = JointFinder(write(tmp_path / "joints.onnx"))
    picture = np.zeros((480, 640, 3), dtype=np.uint8)
    people = finder.with_joints(picture, Detections.of(BOX[None], np.ones(1)))
    scale = min(size[0] / 75, size[1] / 250)  # the box with a margin of a quarter fits into the input
    expected = (POINTS - np.array(size) / 2) / scale + [330, 200]
    joints = people.joints[0, list(COCO_17)]
    sure = SCORES > 0.5
    np.testing.assert_allclose(joints[sure], expected[sure], atol=0.01)
    assert np.isnan(joints[~sure]).all()
    np.testing.assert_array_equal(people.box, BOX[None])


def test_a_crop_has_the_whole_box_in_its_middle() -> None:
    placed = placed_crop(BOX, (192, 256))
    corners = BOX.reshape(2, 2) * placed.scale + np.array(placed.offset)
    assert (corners >= 0).all()
    assert (corners <= [192, 256]).all()
    np.testing.assert_allclose(corners.mean(axis=0), [96, 128])


def test_boxes_of_one_model_get_joints_of_another(tmp_path: Path) -> None:
    dets = np.array([[[10, 10, 40, 90, 0.9]]], dtype=np.float32)
    model = constant_model(tmp_path / "boxes.onnx", {"dets": dets, "labels": np.zeros((1, 1), dtype=np.int64)})
    detector = Detector(model, joints=rtmpose(tmp_path / "joints.onnx"))
    people = detector.people(np.zeros((64, 64, 3), dtype=np.uint8))
    assert np.isfinite(people.joints).any()


def test_a_model_of_no_joints_is_refused(tmp_path: Path) -> None:
    model = constant_model(tmp_path / "other.onnx", {"x": np.zeros((1, 4), dtype=np.float32)})
    with pytest.raises(InputError) as refused:
        JointFinder(model)
    assert refused.value.code == "E216"
    assert "leave out --joints" in str(refused.value.fix)
