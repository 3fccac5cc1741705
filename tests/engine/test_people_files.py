"""Readers of people: every layout of joints and boxes gives the same arrays, and what is missing is never (0, 0)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from vsd_analytics.engine.people import (
    BODY_25,
    BODY_25B,
    FEET,
    MID_HIP,
    NECK,
    OPENPOSE_COCO_18,
    OPENPOSE_MPI_15,
    People,
)
from vsd_analytics.engine.people_files import read_people
from vsd_analytics.errors import InputError, UsageError

DOWNWARDS = [0, *range(5, 19), 1, 2, 3, 4, *range(19, 25)]  # eyes and ears are above the rest of the body
BODY = np.column_stack([np.arange(25) + 100.0, 200.0 + 10 * np.array(DOWNWARDS), np.full(25, 0.9)])
COCO = np.column_stack([np.arange(17) + 100.0, 300.0 + 10 * np.arange(17), np.full(17, 0.9)])
HALPE = np.column_stack([np.arange(26) + 100.0, 300.0 + 10 * np.arange(26), np.full(26, 0.9)])


def write(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content))
    return path


def openpose(folder: Path, frames: dict[int, list[np.ndarray]]) -> Path:  # type: ignore[type-arg]
    folder.mkdir()
    for number, persons in frames.items():
        people = [{"person_id": [-1], "pose_keypoints_2d": p.ravel().tolist()} for p in persons]
        write(folder / f"door_{number:012d}_keypoints.json", {"version": 1.3, "people": people})
    return folder


def test_openpose_folder_has_a_frame_for_every_file_also_without_people(tmp_path: Path) -> None:
    people = read_people(openpose(tmp_path / "joints", {0: [BODY, BODY], 1: [], 7: [BODY]}))
    assert people.frames.tolist() == [0, 1, 7]
    assert people.frame.tolist() == [0, 0, 7]
    np.testing.assert_array_equal(people.joints[2], BODY[:, :2])
    assert people.track.tolist() == [None, None, None]


def test_joint_that_was_not_found_is_missing_and_not_at_the_corner_of_the_picture(tmp_path: Path) -> None:
    holed = BODY.copy()
    holed[[3, 11]] = 0
    people = read_people(openpose(tmp_path / "joints", {0: [holed]}))
    assert np.isnan(people.joints[0, [3, 11]]).all()
    assert np.isfinite(people.joints[0]).all(axis=1).sum() == 23
    assert people.outline[0].tolist() == [100, 200, 124, 440]


def test_joint_without_confidence_is_missing(tmp_path: Path) -> None:
    doubtful = BODY.copy()
    doubtful[5, 2] = 0
    people = read_people(openpose(tmp_path / "joints", {0: [doubtful]}))
    assert np.isnan(people.joints[0, 5]).all()


def test_person_without_any_joint_is_counted_as_bad(tmp_path: Path) -> None:
    people = read_people(openpose(tmp_path / "joints", {0: [BODY, np.zeros((25, 3))]}))
    assert (len(people), people.bad) == (1, {"neither a box nor a joint": 1})


def test_joints_as_shares_of_the_picture_are_refused(tmp_path: Path) -> None:
    scaled = BODY * (1 / 1920, 1 / 1080, 1)
    with pytest.raises(InputError, match="no pixels") as refused:
        read_people(openpose(tmp_path / "joints", {0: [scaled]}))
    assert refused.value.code == "E202"
    assert "--keypoint_scale 0" in str(refused.value.fix)


def layouts() -> dict[str, tuple[object, np.ndarray]]:  # type: ignore[type-arg]
    flat = COCO.ravel().tolist()
    points, scores = COCO[:, :2].tolist(), COCO[:, 2].tolist()
    box = [90.0, 280.0, 50.0, 200.0]
    return {
        "coco": ([{"image_id": 12, "category_id": 1, "keypoints": flat, "score": 0.8}], COCO),
        "alphapose": ([{"image_id": "12.jpg", "keypoints": flat, "score": 2.8, "box": box, "idx": 4}], COCO),
        "alphapose-halpe": ([{"image_id": "12.jpg", "keypoints": HALPE.ravel().tolist(), "score": 2.8}], HALPE),
        "mmpose": (
            {
                "meta_info": {"dataset_name": "coco"},
                "instance_info": [
                    {
                        "frame_id": 12,
                        "instances": [
                            {
                                "keypoints": points,
                                "keypoint_scores": scores,
                                "bbox": [[90, 280, 140, 480]],
                                "bbox_score": 0.9,
                            }
                        ],
                    }
                ],
            },
            COCO,
        ),
        "mmpose-inferencer": (
            [{"frame_id": 12, "instances": [{"keypoints": points, "keypoint_scores": scores}]}],
            COCO,
        ),
        "openpifpaf": ({"frame": 12, "predictions": [{"keypoints": flat, "bbox": box, "score": 1, "id_": 4}]}, COCO),
    }


@pytest.mark.parametrize("name", layouts())
def test_every_layout_of_coco_joints_gives_the_same_skeleton(name: str, tmp_path: Path) -> None:
    content, given = layouts()[name]
    people = read_people(write(tmp_path / "found.json", content))
    assert people.frame.tolist() == [12]
    joints = people.joints[0]
    np.testing.assert_array_equal(joints[0], given[0, :2])  # nose
    np.testing.assert_array_equal(joints[5], given[5, :2])  # left shoulder
    np.testing.assert_array_equal(joints[2], given[6, :2])  # right shoulder
    np.testing.assert_array_equal(joints[14], given[15, :2])  # left ankle
    if len(given) == 17:
        np.testing.assert_array_equal(joints[NECK], given[[5, 6], :2].mean(axis=0))
        np.testing.assert_array_equal(joints[MID_HIP], given[[11, 12], :2].mean(axis=0))
        assert np.isfinite(joints[list(FEET)]).all(axis=1).sum() == 2
    else:
        np.testing.assert_array_equal(joints[NECK], given[18, :2])
        np.testing.assert_array_equal(joints[19], given[20, :2])  # left big toe
        np.testing.assert_array_equal(joints[24], given[25, :2])  # right heel


@pytest.mark.parametrize("name", ["alphapose", "mmpose", "openpifpaf"])
def test_boxes_have_sides_whatever_order_a_tool_writes_them_in(name: str, tmp_path: Path) -> None:
    people = read_people(write(tmp_path / "found.json", layouts()[name][0]))
    assert people.box[0].tolist() == [90, 280, 140, 480]


def test_track_ids_of_alphapose_and_openpifpaf_are_read(tmp_path: Path) -> None:
    for name in ("alphapose", "openpifpaf"):
        assert read_people(write(tmp_path / "found.json", layouts()[name][0])).track.tolist() == ["4"]


def test_frame_with_no_instances_is_a_frame(tmp_path: Path) -> None:
    content = [{"frame_id": 0, "instances": []}, *layouts()["mmpose-inferencer"][0]]  # type: ignore[misc]
    assert read_people(write(tmp_path / "found.json", content)).frames.tolist() == [0, 12]


def test_skeleton_that_is_not_known_is_counted(tmp_path: Path) -> None:
    odd = {"image_id": 1, "keypoints": [1.0, 2.0, 1.0] * 19}
    people = read_people(write(tmp_path / "found.json", [odd, layouts()["coco"][0][0]]))  # type: ignore[index]
    assert people.bad == {"skeleton of 19 joints, which is not known": 1}


def test_ultralytics_labels_become_pixels(tmp_path: Path) -> None:
    shares = COCO * (1 / 1920, 1 / 1080, 1)
    line = " ".join(str(v) for v in [0, 0.5, 0.5, 0.1, 0.4, *shares.ravel(), 0.9, 7])
    (tmp_path / "door_3.txt").write_text(f"{line}\n2 0.1 0.1 0.1 0.1\n")
    (tmp_path / "door_5.txt").write_text("0 0.5 0.5 0.1 0.4\nrubbish\n")
    people = read_people(tmp_path, size_px=(1920, 1080))
    assert people.frames.tolist() == [3, 4, 5]
    assert people.track.tolist() == ["7", None]
    np.testing.assert_allclose(people.joints[0, 0], COCO[0, :2])
    np.testing.assert_allclose(people.box[1], [864, 324, 1056, 756])
    assert people.bad == {"line that is no label": 1}
    with pytest.raises(UsageError, match="size is not known"):
        read_people(tmp_path)


BOXES = """frame,track_id,left,top,right,bottom
4,7,10,20,50,120
0,7,10,20,40,120
0,,60,20,90,120
2,8,x,20,90,120
2,8,90,20,60,120
soon,8,60,20,90,120
"""


def boxes(tmp_path: Path, text: str) -> People:
    path = tmp_path / "people.csv"
    path.write_text(text)
    return read_people(path)


def test_bad_rows_of_boxes_are_counted_by_reason_and_the_others_read(tmp_path: Path) -> None:
    people = boxes(tmp_path, BOXES)
    assert people.frame.tolist() == [0, 0, 4]
    assert people.track.tolist() == ["7", None, "7"]
    assert people.box[2].tolist() == [10, 20, 50, 120]
    assert people.bad == {
        "frame that is no whole number": 1,
        "side that is no number": 1,
        "box without width or height": 1,
    }


def test_frame_numbers_that_no_row_has_are_frames_without_people(tmp_path: Path) -> None:
    text = "frame,left,top,right,bottom\n0,1,2,3,4\n10,1,2,3,4\n5,1,2,3,4\n30,1,2,3,4\n"
    assert boxes(tmp_path, text).frames.tolist() == [0, 5, 10, 15, 20, 25, 30]


@pytest.mark.parametrize("first", ["2026-11-09T08:00:00Z", "1794211200", "1794211200000", "2026-11-09 09:00:00+01:00"])
def test_instants_are_iso_text_or_seconds_or_milliseconds(first: str, tmp_path: Path) -> None:
    people = boxes(tmp_path, f"ts,left,top,right,bottom\n{first},1,2,3,4\n")
    assert people.ts_ms is not None
    assert people.ts_ms.tolist() == [1_794_211_200_000]


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        ("frame,left,top,right\n1,2,3,4\n", "E203", "bottom"),
        ("left,top,right,bottom\n1,2,3,4\n", "E203", "frame"),
        ("frame,left,top,right,bottom\n1,9,9,3,4\n", "E202", "no usable box"),
        ("frame,left,top,right,bottom\n", "E202", "no usable box"),
        ("", "E205", "as a table"),
    ],
)
def test_table_that_has_no_boxes_is_refused_in_words(text: str, code: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=says) as refused:
        boxes(tmp_path, text)
    assert refused.value.code == code
    assert refused.value.fix


def test_file_that_is_not_there_is_an_error_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nobody\.csv"):
        read_people(tmp_path / "nobody.csv")


def test_two_videos_in_one_folder_are_refused_and_not_laid_over_each_other(tmp_path: Path) -> None:
    folder = openpose(tmp_path / "joints", {12: [BODY]})
    write(folder / "shop_000000000012_keypoints.json", {"people": []})
    with pytest.raises(InputError, match="two files of joints are frame 12") as refused:
        read_people(folder)
    assert "folder of its own" in str(refused.value.fix)
    assert "door_000000000012_keypoints.json" in str(refused.value.why)


def test_one_id_for_two_persons_of_a_frame_is_no_track(tmp_path: Path) -> None:
    person = {"keypoints": COCO.ravel().tolist(), "idx": 0}
    both = [{**person, "image_id": "1.jpg"}, {**person, "image_id": "1.jpg"}, {**person, "image_id": "2.jpg"}]
    assert read_people(write(tmp_path / "all.json", both)).track.tolist() == [None] * 3
    assert read_people(write(tmp_path / "one.json", both[1:])).track.tolist() == ["0", "0"]


def test_places_in_the_list_of_a_frame_are_no_track_ids(tmp_path: Path) -> None:
    people = [[{"person_id": [i], "pose_keypoints_2d": BODY.ravel().tolist()} for i in range(n)] for n in (3, 1, 2)]
    (tmp_path / "joints").mkdir()
    for number, persons in enumerate(people):
        write(tmp_path / "joints" / f"{number:012}_keypoints.json", {"people": persons})
    assert set(read_people(tmp_path / "joints").track) == {None}
    people[1][0]["person_id"] = [2]
    write(tmp_path / "joints" / f"{1:012}_keypoints.json", {"people": people[1]})
    assert read_people(tmp_path / "joints").track.tolist() == ["0", "1", "2", "2", "0", "1"]


def test_file_without_digits_is_no_frame_among_numbered_ones(tmp_path: Path) -> None:
    folder = openpose(tmp_path / "joints", {0: [BODY], 3: [BODY]})
    write(folder / "settings.json", {"model": "BODY_25"})
    people = read_people(folder)
    assert people.frames.tolist() == [0, 3]
    assert people.bad == {"file without a frame number in its name": 1}


def test_folder_of_several_cameras_is_refused_with_their_names(tmp_path: Path) -> None:
    for camera in ("C1", "C2"):
        (tmp_path / "joints").mkdir(exist_ok=True)
        openpose(tmp_path / "joints" / camera, {0: [BODY]})
    with pytest.raises(InputError) as refused:
        read_people(tmp_path / "joints")
    assert refused.value.why == "one folder is one camera: C1, C2"
    assert str(refused.value.fix).endswith("C1")


def test_first_versions_of_openpose_are_read_and_faces_alone_are_nobody(tmp_path: Path) -> None:
    (tmp_path / "joints").mkdir()
    old, face = {"pose_keypoints": BODY.ravel().tolist()}, {"pose_keypoints_2d": [], "face_keypoints_2d": [1, 2, 1]}
    write(tmp_path / "joints" / "0_keypoints.json", {"people": [face, old]})
    people = read_people(tmp_path / "joints")
    assert (len(people), people.bad) == (1, {"neither a box nor a joint": 1})


def test_ids_and_frames_with_a_decimal_point_are_whole_numbers(tmp_path: Path) -> None:
    person = {"image_id": 12.0, "keypoints": COCO.ravel().tolist(), "idx": [3.0]}
    people = read_people(write(tmp_path / "found.json", [person]))
    assert (people.frame.tolist(), people.track.tolist()) == ([12], ["3"])


def test_frame_number_of_thirty_digits_and_scores_of_another_length_are_counted(tmp_path: Path) -> None:
    flat = COCO.ravel().tolist()
    long = {"image_id": "1" * 30 + ".jpg", "keypoints": flat}
    short = {"image_id": 1, "keypoints": COCO[:, :2].tolist(), "keypoint_scores": [1.0, 1.0]}
    people = read_people(write(tmp_path / "found.json", [long, short, {"image_id": 2, "keypoints": flat}]))
    assert people.frame.tolist() == [2]
    assert people.bad == {"person without a frame": 1, "person whose joints are no numbers": 1}


def in_other_order(order: tuple[int, ...]) -> np.ndarray:  # type: ignore[type-arg]
    """Return a body of BODY_25 in another skeleton's order; joints that BODY_25 lacks are not found."""
    body = np.vstack([STANDING, np.zeros(3)])
    return body[list(order)]


STANDING = np.ones((25, 3))
STANDING[:, 0] = 500 + np.arange(25)
STANDING[:, 1] = np.repeat(
    [110, 150, 190, 230, 150, 190, 230, 240, 300, 360, 240, 300, 360, 105, 108, 370],
    [1, 2, 1, 1, 1, 1, 1, 2, 1, 1, 1, 1, 1, 2, 2, 6],
)


@pytest.mark.parametrize("order", [OPENPOSE_COCO_18, OPENPOSE_MPI_15, BODY_25B, BODY_25], ids=["18", "15", "25B", "25"])
def test_other_models_of_openpose_give_the_same_body(order: tuple[int, ...], tmp_path: Path) -> None:
    joints = read_people(openpose(tmp_path / "joints", {0: [in_other_order(order)]})).joints[0]
    known = [i for i in order if i >= 0]
    np.testing.assert_array_equal(joints[known], STANDING[known, :2])
    assert np.isfinite(joints[[NECK, MID_HIP]]).all()
    assert np.isfinite(joints).all(axis=1).sum() == len({*known, NECK, MID_HIP})


def test_results_of_ultralytics_as_json_are_read(tmp_path: Path) -> None:
    points = {"x": COCO[:, 0].tolist(), "y": COCO[:, 1].tolist(), "visible": COCO[:, 2].tolist()}
    sides = {"x1": 90.0, "y1": 280.0, "x2": 140.0, "y2": 480.0}
    write(tmp_path / "door_3.json", [{"name": "person", "class": 0, "box": sides, "keypoints": points, "track_id": 4}])
    people = read_people(tmp_path)
    assert (people.frame.tolist(), people.track.tolist(), people.box[0].tolist()) == ([3], ["4"], [90, 280, 140, 480])
    np.testing.assert_array_equal(people.joints[0, 14], COCO[15, :2])
