"""The floor point below a person: under the trunk and the feet, where the camera shows verticals at a slant."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine.simulated_people import SIZE, Scene, SimulatedCamera, boxes_only, simulate, upright_boxes

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people import ANKLES, HEAD, N_JOINTS, NECK, People
from vsd_analytics.engine.people_calibration import calibrate_from_people
from vsd_analytics.geometry.homography import fit_homography, to_floor

CAMERA = SimulatedCamera(height_m=3.0, tilt_deg=35, roll_deg=2, f_widths=0.7)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate(CAMERA, seed=3, n_tracks=60, seconds=10, reach_m=8.0, noise_px=0.5, missing=0.0)


def off_m(people: People, uv: np.ndarray, scene: Scene, homography: np.ndarray | None = None) -> np.ndarray:
    matrix = CAMERA.homography() if homography is None else homography
    return np.linalg.norm(to_floor(matrix, uv, picture_px=SIZE) - scene.xy, axis=1)


def without(people: People, joints: tuple[int, ...]) -> People:
    left = people.joints.copy()
    left[:, list(joints)] = np.nan
    return replace(people, joints=left)


@pytest.mark.parametrize("turn", [np.eye(3), -np.eye(3), np.diag([1.0, -1.0, 1.0])], ids=["", "sign", "mirror"])
def test_joints_are_taken_down_to_the_floor_below_the_body(scene: Scene, turn: np.ndarray) -> None:
    people, h = scene.people, turn @ CAMERA.homography()
    found = to_floor(h, floor_points(people, homography=h, picture_px=SIZE), picture_px=SIZE) * np.diag(turn)[:2]
    found *= np.diag(turn)[2]
    off = np.linalg.norm(found - scene.xy, axis=1)
    assert np.median(off) < 0.6 * np.median(off_m(people, feet(people), scene))
    assert np.median(off) < 0.06


def test_ankles_alone_are_as_near_as_whole_feet(scene: Scene) -> None:
    toes_and_heels = without(scene.people, (19, 20, 21, 22, 23, 24))
    uv = floor_points(toes_and_heels, homography=CAMERA.homography(), picture_px=SIZE)
    assert np.median(off_m(toes_and_heels, uv, scene)) < 0.06
    assert np.median(off_m(toes_and_heels, feet(toes_and_heels), scene)) > 0.09  # above the floor, so too far away


def test_the_foot_of_a_leaning_box_is_below_the_body_not_below_the_middle() -> None:
    places = np.array([(-3.0, 5.0), (0.0, 4.0), (2.5, 4.0)])
    foot = CAMERA.project(np.column_stack([places, np.zeros(3)]))
    none = np.full(3, None, dtype=object)
    empty = np.full((3, N_JOINTS, 2), np.nan)
    people = People(
        np.zeros(3, dtype=np.int64), none, upright_boxes(CAMERA, foot, high_px=300), empty, np.zeros(1, int)
    )
    assert floor_points(people, homography=CAMERA.homography(), picture_px=SIZE) == pytest.approx(foot, abs=1e-6)
    seen = locate(people, homography=CAMERA.homography(), picture_px=SIZE, within_m=9, name="test")
    assert seen.xy == pytest.approx(places, abs=1e-9)
    assert np.abs(to_floor(CAMERA.homography(), feet(people), picture_px=SIZE) - places).max() > 0.2


def test_boxes_of_bodies_come_nearer_to_the_truth(scene: Scene) -> None:
    people = boxes_only(scene)
    uv = floor_points(people, homography=CAMERA.homography(), picture_px=SIZE)
    h = CAMERA.homography()
    sideways = [np.median(np.abs(to_floor(h, px, picture_px=SIZE) - scene.xy)[:, 0]) for px in (uv, feet(people))]
    assert sideways[0] < 0.8 * sideways[1]
    assert np.median(off_m(people, uv, scene)) < np.median(off_m(people, feet(people), scene))


def test_marks_stay_where_no_camera_is_known(scene: Scene) -> None:
    people = boxes_only(scene)
    marks = feet(people)
    flat = np.diag([0.01, 0.01, 1.0])  # a plan, or a camera that looks straight down
    slanted = np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) @ CAMERA.homography()  # no lens does that
    for h, size in ((CAMERA.homography(), None), (flat, SIZE), (slanted, SIZE)):
        assert floor_points(people, homography=h, picture_px=size).tolist() == marks.tolist()


FEET_AND_ANKLES = (11, 14, 19, 20, 21, 22, 23, 24)


@pytest.mark.parametrize(("hidden", "within_m"), [((), 0.12), ((10, 13), 0.16)], ids=["by knees", "by hips"])
def test_hidden_feet_are_below_knees_or_hips(scene: Scene, hidden: tuple[int, ...], within_m: float) -> None:
    legless = without(scene.people, (*FEET_AND_ANKLES, *hidden))
    found = floor_points(legless, homography=CAMERA.homography(), picture_px=SIZE)
    assert np.median(off_m(legless, found, scene)) < within_m
    seen = locate(legless, homography=CAMERA.homography(), picture_px=SIZE, within_m=2, name="test")
    assert seen.left_out == {}


def test_head_and_shoulders_alone_are_no_place(scene: Scene) -> None:
    bust = without(scene.people, (*FEET_AND_ANKLES, 8, 9, 10, 12, 13))
    assert np.isnan(floor_points(bust, homography=CAMERA.homography(), picture_px=SIZE)).all()


def test_knees_and_hips_are_not_used_where_they_say_little(scene: Scene) -> None:
    low = SimulatedCamera(height_m=1.2, tilt_deg=5, f_widths=0.7)
    people = simulate(low, seed=3, n_tracks=30, seconds=4, reach_m=12.0, missing=0.0).people
    assert len(people) > 20
    legless = without(people, (*FEET_AND_ANKLES, 10, 13))
    assert np.isnan(floor_points(legless, homography=low.homography(), picture_px=SIZE)).all()


def test_skeleton_of_no_body_has_no_place(scene: Scene) -> None:
    people = scene.people
    joints = people.joints.copy()
    dwarf, giant = 5, 6
    for row, size in ((dwarf, 0.15), (giant, 2.5)):
        foot = np.nanmean(joints[row, [11, 14]], axis=0)
        joints[row] = foot + (joints[row] - foot) * size
    at = floor_points(replace(people, joints=joints), homography=CAMERA.homography(), picture_px=SIZE)
    assert np.flatnonzero(np.isnan(at).any(axis=1)).tolist() == [dwarf, giant]


def test_a_wrong_trunk_does_not_move_the_feet(scene: Scene) -> None:
    people = without(scene.people, (8,))
    wrong = people.joints.copy()
    wrong[:, NECK, 0] += 900
    at_feet = floor_points(without(people, (NECK,)), homography=CAMERA.homography(), picture_px=SIZE)
    found = floor_points(replace(people, joints=wrong), homography=CAMERA.homography(), picture_px=SIZE)
    assert found == pytest.approx(at_feet)


def test_people_without_faces_calibrate_by_their_necks() -> None:
    camera = SimulatedCamera(height_m=6.0, tilt_deg=28, f_widths=0.9)
    people = simulate(camera, seed=1, n_tracks=45, seconds=12).people
    whole, faceless = (calibrate_from_people(p, size_px=SIZE) for p in (people, without(people, HEAD)))
    assert whole.n_rows > 0.9 * np.isfinite(people.joints[:, [*ANKLES, NECK]]).all(axis=(1, 2)).sum()
    assert faceless.uses_joints
    assert faceless.camera.height_m == pytest.approx(whole.camera.height_m, rel=0.04)
    assert faceless.camera.height_m == pytest.approx(6.0, rel=0.06)


def test_points_clicked_badly_leave_the_marks_or_make_them_better(scene: Scene) -> None:
    rng = np.random.default_rng(5)
    worse = []
    for _ in range(20):
        rows = rng.choice(len(scene.xy), 6, replace=False)
        clicked = CAMERA.project(np.column_stack([scene.xy[rows], np.zeros(6)])) + rng.normal(0, 8, (6, 2))
        h = np.array(fit_homography(np.column_stack([clicked, scene.xy[rows]])).homography)
        people = scene.people
        marks, found = feet(people), floor_points(people, homography=h, picture_px=SIZE)
        worse.append(np.median(off_m(people, found, scene, h)) - np.median(off_m(people, marks, scene, h)))
    assert np.mean(worse) < 0
    assert max(worse) < 0.08


@pytest.mark.realdata
def test_surveyed_people_in_a_simulated_picture_have_their_exact_distances(realdata: Callable[[str], Path]) -> None:
    # KORTE: places of twelve people in millimetres, in two scenes; its photographs show no feet
    with (realdata("korte") / "ground_truth_locations.csv").open() as lines:
        rows = [row for row in csv.reader(lines) if row[1].startswith("P")]
    frame = np.array([int(row[0]) for row in rows])
    place = np.array([(float(row[2]), float(row[4])) for row in rows]) / 1000
    place -= np.array([place[frame == which].mean(axis=0) for which in (0, 1)])[frame] - (0, 7)
    camera = SimulatedCamera(height_m=3.0, tilt_deg=22, roll_deg=2, f_widths=0.7)
    foot, head = (camera.project(np.column_stack([place, np.full(len(place), z)])) for z in (0.0, 1.7))
    width = 0.15 * (foot[:, 1] - head[:, 1])
    middle = (foot[:, 0] + head[:, 0]) / 2
    box = np.column_stack([middle - width, head[:, 1], middle + width, foot[:, 1]]).round()
    people = People(frame, None, box, np.full((len(box), N_JOINTS, 2), np.nan), np.arange(2))
    found = locate(people, homography=camera.homography(), picture_px=SIZE, within_m=50.0, name="korte")
    true = np.linalg.norm(place[found.a] - place[found.b], axis=1)
    assert len(true) == 30
    assert np.sum(found.distance_m < 2) == np.sum(true < 2) == 13
    assert np.abs(found.distance_m - true).max() < 0.02
