"""The authors' layout: read as they read it, and one command gives the tables of the paper and ours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from engine.simulated_people import SIZE, Scene, SimulatedCamera, simulate
from engine.vsd_in_a_shop import shop
from PIL import Image

from vsd_analytics.engine.body import part_px
from vsd_analytics.engine.published_layout import read_sequences
from vsd_analytics.engine.ratio_search import search
from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.engine.scores import f1_of
from vsd_analytics.errors import InputError

CAMERA = SimulatedCamera(height_m=4, tilt_deg=22, f_widths=0.9)
SEQUENCE = "seq-1"


def write_data_set(folder: Path, scene: Scene, *, by_image_name: bool = False, skipped: int | None = None) -> Path:
    """Write a simulated sequence in the layout; the person number `skipped` of each frame is not annotated."""
    images, joints = folder / "Images" / SEQUENCE, folder / "HumanJoints" / SEQUENCE
    for place in (images, joints, folder / "Annotations", folder / "Calibrations"):
        place.mkdir(parents=True)
    annotation = {}
    for place, frame in enumerate(scene.people.frames.tolist()):
        rows = np.flatnonzero(scene.people.frame == frame)
        name = f"view_{frame:05}"
        Image.new("L", SIZE if place == 0 else (2, 2)).save(images / f"{name}.png")
        people = []
        for row in rows:
            flat = np.column_stack([np.nan_to_num(scene.people.joints[row]), np.ones(25)])
            people.append({"pose_keypoints_2d": flat.ravel().tolist()})
        (joints / f"{name}_keypoints.json").write_text(json.dumps({"people": people}))
        if len(rows):
            listed = [i for i in range(len(rows)) if i != skipped]
            xy = scene.xy[rows[listed]]
            matrix = np.linalg.norm(xy[:, None] - xy[None], axis=2).tolist()
            key = name if by_image_name else f"{place:06}"
            annotation[key] = {"PersonList": listed, "DistanceMatrix": matrix}
    (folder / "Annotations" / f"{SEQUENCE}_joints.json").write_text(json.dumps(annotation))
    (folder / "Calibrations" / f"{SEQUENCE}.json").write_text(
        json.dumps({"Homography": np.eye(3).tolist(), "Scale": 1})
    )
    return folder


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate(CAMERA, seed=5, n_tracks=40, seconds=6, missing=0.0)


@pytest.mark.parametrize("by_image_name", [False, True])
def test_distances_belong_to_the_persons_they_are_of(by_image_name: bool, tmp_path: Path, scene: Scene) -> None:
    (sequence,) = read_sequences(write_data_set(tmp_path / "Sim", scene, by_image_name=by_image_name, skipped=1))
    labelled = sequence.labelled
    assert sequence.name == "Sim/seq-1"
    assert labelled.size_px == SIZE
    feet = CAMERA.to_floor(np.nanmean(labelled.people.joints[:, [21, 24]], axis=1))  # both heels
    apart = np.linalg.norm(feet[labelled.a] - feet[labelled.b], axis=1)
    near = labelled.distance_m < 6
    assert np.median(np.abs(apart - labelled.distance_m)[near]) < 0.4
    assert np.corrcoef(apart[near], labelled.distance_m[near])[0, 1] > 0.95
    assert len(labelled.people) < len(sequence.people)  # the skipped ones


def test_persons_keep_their_numbers_where_one_has_no_joints_and_a_file_cannot_be_read(
    tmp_path: Path, scene: Scene
) -> None:
    folder = write_data_set(tmp_path / "Sim", scene)
    (whole,) = read_sequences(folder)
    path = sorted((folder / "HumanJoints" / SEQUENCE).iterdir())[2]
    content = json.loads(path.read_text())
    content["people"][0]["pose_keypoints_2d"] = [0.0] * 75
    path.write_text(json.dumps(content))
    sorted((folder / "HumanJoints" / SEQUENCE).iterdir())[1].write_text("{")
    (holed,) = read_sequences(folder)
    third = int(whole.people.frames[2])
    assert whole.people.frames[1] not in holed.people.frames
    joints = [s.labelled.people.joints[s.labelled.people.frame == third] for s in (whole, holed)]
    assert np.isnan(joints[1][0]).all()
    np.testing.assert_array_equal(joints[0][1:], joints[1][1:])


def test_unknown_distances_are_no_pairs(tmp_path: Path, scene: Scene) -> None:
    folder = write_data_set(tmp_path / "Sim", scene)
    (whole,) = read_sequences(folder)
    path = folder / "Annotations" / f"{SEQUENCE}_joints.json"
    content = json.loads(path.read_text())
    matrix = content[min(content)]["DistanceMatrix"]
    matrix[0][1], matrix[0][2] = None, -1
    path.write_text(json.dumps(content))
    (holed,) = read_sequences(folder)
    assert len(holed.labelled.a) == len(whole.labelled.a) - 2


def test_grid_search_finds_ratios_near_those_of_the_camera(tmp_path: Path, scene: Scene) -> None:
    (sequence,) = read_sequences(write_data_set(tmp_path / "Sim", scene))
    torso = search([sequence.labelled], part="torso")
    assert torso.f1 > 0.8
    assert torso.f1 == f1_of(torso.pairs)
    flat = search([sequence.labelled], part="torso", grid=[Ratios(0.0, 0.0)])
    assert flat.f1 < torso.f1 - 0.05


@pytest.mark.parametrize("missing", [0.0, 0.05])
def test_torso_measures_better_than_arm(missing: float, tmp_path: Path) -> None:
    seen = simulate(CAMERA, seed=5, n_tracks=40, seconds=6, missing=missing)
    (sequence,) = read_sequences(write_data_set(tmp_path / "Sim", seen))
    torso, arm = (search([sequence.labelled], part=part, by="persons") for part in ("torso", "arm"))  # type: ignore[arg-type]
    assert torso.f1 > arm.f1 + 0.02


def test_arms_would_be_ahead_if_the_trunk_hid_none_as_either_side_will_do(tmp_path: Path) -> None:
    seen = simulate(CAMERA, seed=5, n_tracks=40, seconds=6, missing=0.05, hidden_missing=0.0)
    (sequence,) = read_sequences(write_data_set(tmp_path / "Sim", seen))
    measured = {part: np.isfinite(part_px(sequence.people, part)).mean() for part in ("torso", "arm")}  # type: ignore[arg-type]
    assert measured["torso"] < 0.93
    assert measured["arm"] > 0.97
    torso, arm = (search([sequence.labelled], part=part, by="persons") for part in ("torso", "arm"))  # type: ignore[arg-type]
    assert torso.f1 < arm.f1 - 0.03


def test_one_command_scores_every_part_and_the_calibration_from_people(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], scene: Scene
) -> None:
    vsd = shop(tmp_path, capsys)
    write_data_set(tmp_path / "sets" / "Sim", scene)
    code, printed, err = vsd("evaluate", str(tmp_path / "sets"), "--json")
    assert code == 0, err
    rows = {(r["sequence"], r["method"]): r for r in json.loads(printed)["rows"]}
    assert {method for _, method in rows} == {"torso", "leg", "arm", "box", "people"}
    ours, torso = rows["Sim/all", "people"], rows["Sim/all", "torso"]
    assert ours["pairs"]["f1"]["value"] > 0.9
    assert torso["persons"]["f1"]["lo"] <= torso["persons"]["f1"]["value"] <= torso["persons"]["f1"]["hi"]
    assert torso["f1_published"] <= torso["persons"]["f1"]["value"]
    assert torso["f1_torso_ratios"] == torso["persons"]["f1"]["value"]
    box = rows["Sim/seq-1", "box"]
    assert box["f1_torso_ratios"] < box["persons"]["f1"]["value"]
    assert ours["f1_torso_ratios"] is None


def test_a_second_skeleton_on_a_person_counts_no_more_in_the_calibration(tmp_path: Path, scene: Scene) -> None:
    folder = write_data_set(tmp_path / "Sim", scene)
    (clean,) = read_sequences(folder)
    for path in (folder / "HumanJoints" / SEQUENCE).iterdir():
        people = json.loads(path.read_text())["people"]
        path.write_text(json.dumps({"people": people + people}))
    (doubled,) = read_sequences(folder)
    assert doubled.people.bad["second skeleton on the same person"] >= len(scene.people)
    np.testing.assert_array_equal(doubled.people.joints, clean.people.joints)
    np.testing.assert_array_equal(doubled.labelled.people.joints, clean.labelled.people.joints)


def test_data_sets_are_found_where_their_archive_unpacked_them(tmp_path: Path, scene: Scene) -> None:
    folder = write_data_set(tmp_path / "archive" / "dataset" / "Sim", scene)
    (folder / "Images" / SEQUENCE / ".listing").write_text("not a picture")
    (folder / "HumanJoints" / SEQUENCE / "._view_00000_keypoints.json").write_bytes(b"\0\5\x16\7")  # macOS
    (sequence,) = read_sequences(tmp_path)
    assert sequence.name == "Sim/seq-1"
    assert sequence.people.bad.keys() == {"second skeleton on the same person"}  # two walk through each other
    assert sequence.n_unknown == 0


def test_places_are_no_names_of_images_that_begin_with_one(tmp_path: Path, scene: Scene) -> None:
    folder = write_data_set(tmp_path / "Sim", scene)
    for kind, end in (("Images", ".png"), ("HumanJoints", "_keypoints.json")):
        for path in sorted((folder / kind / SEQUENCE).iterdir()):
            number = int(path.name.removeprefix("view_")[:5]) + 1
            path.rename(path.with_name(f"{number:06}{end}"))
    annotation = folder / "Annotations" / f"{SEQUENCE}_joints.json"
    by_place = json.loads(annotation.read_text())
    del by_place["000000"]  # as if nobody were in the first frame: then both namings have all keys but one
    annotation.write_text(json.dumps(by_place))
    (sequence,) = read_sequences(folder)
    first = int(sequence.labelled.people.frames[0])
    assert first == 2  # the file 000002
    by_name = {f"{int(key) + 1:06}": frame for key, frame in by_place.items()}
    last = max(by_name)
    del by_name[last]  # nobody in the last frame
    annotation.write_text(json.dumps(by_name))
    (named,) = read_sequences(folder)
    assert int(named.labelled.people.frames[0]) == first
    assert named.labelled.distance_m[0] == sequence.labelled.distance_m[0]
    assert named.n_unknown == 0


def test_annotated_persons_without_joints_are_counted_and_reported_beside_the_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], scene: Scene
) -> None:
    vsd = shop(tmp_path, capsys)
    folder = write_data_set(tmp_path / "Sim", scene)
    sorted((folder / "HumanJoints" / SEQUENCE).iterdir())[0].write_text('{"people": []}')
    (sequence,) = read_sequences(folder)
    n_gone = int(np.sum(scene.people.frame == scene.people.frames[0]))
    assert sequence.n_unknown == n_gone
    code, printed, err = vsd("evaluate", str(folder))
    assert code == 0
    assert "Sim/seq-1" in printed
    assert "inset 0." in printed
    assert f"{n_gone} annotated persons not in the files of joints" in err


@pytest.mark.parametrize(
    "frame",
    [
        '{"PersonList": [[0], [1]], "DistanceMatrix": [[0, 1], [1, 0]]}',
        '{"PersonList": [0, 1], "DistanceMatrix": [[0, 1]]}',
        '{"PersonList": [0, 1], "DistanceMatrix": {"0": 1}}',
        '{"PersonList": [0, 0], "DistanceMatrix": [[0, 1], [1, 0]]}',
        '{"PersonList": null, "DistanceMatrix": null}',
    ],
)
def test_annotated_frame_that_cannot_be_used_is_refused_in_words(frame: str, tmp_path: Path, scene: Scene) -> None:
    folder = write_data_set(tmp_path / "Sim", scene)
    (folder / "Annotations" / f"{SEQUENCE}_joints.json").write_text(f'{{"000000": {frame}}}')
    with pytest.raises(InputError, match="cannot read the annotation"):
        read_sequences(folder)


def test_annotation_of_other_frames_is_refused(tmp_path: Path, scene: Scene) -> None:
    folder = write_data_set(tmp_path / "Sim", scene)
    frame = '{"PersonList": [0], "DistanceMatrix": [[0]]}'
    (folder / "Annotations" / f"{SEQUENCE}_joints.json").write_text(f'{{"other": {frame}, "000001": null}}')
    with pytest.raises(InputError, match=r"no frame of seq-1_joints\.json has a file of joints"):
        read_sequences(folder)


def test_folder_of_another_layout_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no sequence"):
        read_sequences(tmp_path)


def test_annotation_without_distances_is_refused(tmp_path: Path, scene: Scene) -> None:
    folder = write_data_set(tmp_path / "Sim", scene)
    (folder / "Annotations" / f"{SEQUENCE}_joints.json").write_text('{"000000": {"PersonList": [0]}}')
    with pytest.raises(InputError, match="cannot read the annotation"):
        read_sequences(folder)
