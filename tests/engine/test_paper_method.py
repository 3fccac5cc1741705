"""The paper's method: ratios in both conventions, foot points, body parts, filled safe spaces, pairs."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from engine.simulated_people import SIZE, SimulatedCamera, simulate
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.engine.body import PART_M, ground_points, is_valid, part_px
from vsd_analytics.engine.paper_method import detect, spaces_of
from vsd_analytics.engine.people import N_JOINTS, People
from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.engine.safe_space import SafeSpaces, near_pairs, pairs_of_frames
from vsd_analytics.errors import UsageError
from vsd_analytics.geometry.homography import project


def boxes(rows: list[tuple[float, float, float, float]], frame: list[int] | None = None) -> People:
    n = len(rows)
    frames = np.array(frame or [0] * n, dtype=np.int64)
    none = np.full(n, None, dtype=object)
    return People(frames, none, np.array(rows, dtype=float), np.full((n, N_JOINTS, 2), np.nan), np.unique(frames))


@pytest.mark.parametrize(
    ("at", "there"),
    [((320, 240), (320, 369.231)), ((200, 300), (256, 384)), ((500, 100), (383.220, 346.537))],
)
def test_ratios_map_the_rectangle_as_the_published_code_does(
    at: tuple[float, float], there: tuple[float, float]
) -> None:
    to_picture = np.linalg.inv(Ratios(0.7, 0.7).homography((640, 480)))
    np.testing.assert_allclose(project(to_picture, [at])[0], there, atol=1e-3)


def test_trapezoid_of_shares_is_the_paper_s() -> None:
    to_picture = np.linalg.inv(Ratios(0.4, 0.25, "share").homography((1000, 800)))
    corners = project(to_picture, [(0, 0), (1000, 0), (1000, 800), (0, 800)])
    np.testing.assert_allclose(corners, [(300, 600), (700, 600), (1000, 800), (0, 800)], atol=1e-6)


@given(st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_ratios_mean_the_same_camera_in_both_conventions(horizontal: float, vertical: float) -> None:
    inset = Ratios(horizontal, vertical, "inset")
    share = Ratios(1 - horizontal, 1 - vertical, "share")
    np.testing.assert_allclose(share.homography((640, 480)), inset.homography((640, 480)), rtol=1e-9)
    assert str(inset).startswith("inset ")


@pytest.mark.parametrize(
    ("horizontal", "vertical", "convention"),
    [(1.0, 0.5, "inset"), (0.5, 1.0, "inset"), (0.0, 0.5, "share"), (1.2, 0.5, "share"), (-0.1, 0.5, "inset")],
)
def test_ratios_without_a_trapezoid_are_refused(horizontal: float, vertical: float, convention: str) -> None:
    with pytest.raises(UsageError, match="no trapezoid"):
        Ratios(horizontal, vertical, "share" if convention == "share" else "inset")


def test_foot_point_takes_the_column_of_head_neck_and_torso_and_the_row_of_the_feet() -> None:
    joints = np.full((1, N_JOINTS, 2), np.nan)
    joints[0, 1], joints[0, 8], joints[0, 0] = (100, 50), (104, 120), (102, 30)
    joints[0, 11], joints[0, 14], joints[0, 4] = (60, 200), (150, 210), (300, 400)
    people = People(np.zeros(1, np.int64), np.array([None]), np.full((1, 4), np.nan), joints, np.zeros(1, np.int64))
    np.testing.assert_allclose(ground_points(people), [(102, 205)])  # a hand below the feet does not matter


def test_skeleton_without_a_foot_or_with_few_joints_does_not_count_and_a_plain_box_does() -> None:
    joints = np.full((3, N_JOINTS, 2), np.nan)
    joints[0, :13] = 5.0  # a foot (11) and 13 joints
    joints[1, :11] = 5.0
    joints[1, 15:19] = 5.0  # 15 joints, no foot
    box = np.array([[np.nan] * 4, [0, 0, 9, 9], [0, 0, 9, 9]])
    people = People(np.zeros(3, np.int64), np.full(3, None, dtype=object), box, joints, np.zeros(1, np.int64))
    assert is_valid(people).tolist() == [True, False, True]


def test_missing_torso_gives_a_place_and_no_pair() -> None:
    scene = simulate(SimulatedCamera(), seed=3, n_tracks=20, seconds=1, missing=0.0)
    whole = detect(scene.people, ratios=Ratios(0.3, 0.3), size_px=SIZE, part="torso")
    holed = scene.people.joints.copy()
    a_row = int(whole.a[0])
    holed[a_row, 1] = np.nan
    people = People(scene.people.frame, scene.people.track, scene.people.box, holed, scene.people.frames)
    seen = detect(people, ratios=Ratios(0.3, 0.3), size_px=SIZE, part="torso")
    assert np.isfinite(seen.uv[a_row]).all()
    assert a_row in whole.a
    assert a_row not in {*seen.a, *seen.b}
    assert seen.left_out == {"no torso to measure by: no pairs": 1}


def test_limbs_are_as_long_as_the_population_s_in_a_picture_taken_from_the_side() -> None:
    level = SimulatedCamera(height_m=1.2, tilt_deg=0.5, f_widths=1.0)
    scene = simulate(level, seed=1, n_tracks=150, seconds=4, noise_px=0, missing=0, standing=1.0, reach_m=20)
    px_per_m = SIZE[0] / scene.xy[:, 1]
    for part, tolerance in (("torso", 0.15), ("leg", 0.15), ("arm", 0.20), ("box", 0.10)):
        metres = np.nanmedian(part_px(scene.people, part) / px_per_m)  # type: ignore[arg-type]
        assert metres == pytest.approx(PART_M[part], rel=tolerance), part  # type: ignore[index]


def test_safe_space_inside_another_is_a_violation() -> None:
    """One person behind the other at another scale: the outlines do not cross, the filled ellipses do overlap."""
    spaces = SafeSpaces(np.eye(3), np.array([[0.0, 0.0], [5.0, 0.0]]), np.array([100.0, 10.0]), 1.0)
    near = near_pairs(spaces, np.zeros(2, np.int64), within_m=2.0)
    assert list(zip(near.a, near.b, strict=True)) == [(0, 1)]
    outlines = [shapely.LinearRing(ring) for ring in spaces.ellipses()]
    assert not outlines[0].intersects(outlines[1])


@given(st.integers(0, 10_000), st.floats(0.05, 0.9), st.floats(0.05, 0.9))
def test_discs_overlap_exactly_where_the_filled_ellipses_overlap(seed: int, horizontal: float, vertical: float) -> None:
    rng = np.random.default_rng(seed)
    top = SIZE[1] * 0.95
    people = boxes([(x, y - 150, x + 60, y) for x, y in zip(rng.uniform(0, 1800, 6), rng.uniform(top, 1080, 6))])  # noqa: B905
    spaces = spaces_of(people, ratios=Ratios(horizontal, vertical), size_px=SIZE, part="box", distance_m=2.0)
    rings = [shapely.Polygon(ring) for ring in spaces.ellipses(n_points=720)]
    near = near_pairs(spaces, people.frame, within_m=2.0)
    found = set(zip(near.a.tolist(), near.b.tolist(), strict=True))
    a, b = pairs_of_frames(people.frame)
    for i, j in zip(a.tolist(), b.tolist(), strict=True):
        apart = np.linalg.norm(spaces.centre[i] - spaces.centre[j]) / (spaces.radius[i] + spaces.radius[j])
        if abs(apart - 1) > 1e-3 and rings[i].is_valid and rings[j].is_valid:
            assert rings[i].intersects(rings[j]) == ((i, j) in found)


def test_ellipse_is_as_wide_as_the_radius_is_by_the_person_s_height() -> None:
    people = boxes([(900, 700, 1000, 870)])
    ring = spaces_of(people, ratios=Ratios(0.5, 0.5), size_px=SIZE, part="box", distance_m=2.0).ellipses(n_points=720)[
        0
    ]
    assert np.ptp(ring[:, 0]) / 2 == pytest.approx(100, rel=0.02)  # 170 px are 1.70 m


def test_side_by_side_distance_is_in_metres() -> None:
    people = boxes([(500, 700, 600, 870), (650, 700, 750, 870)])
    seen = detect(people, ratios=Ratios(0.5, 0.5), size_px=SIZE, part="box")
    assert seen.distance_m[0] == pytest.approx(1.5, rel=0.01)
    assert seen.quality == "relative"


def test_pairs_are_within_a_frame_and_each_once() -> None:
    frame = np.array([0, 0, 0, 2, 5, 5], dtype=np.int64)
    a, b = pairs_of_frames(frame)
    assert list(zip(a.tolist(), b.tolist(), strict=True)) == [(0, 1), (0, 2), (1, 2), (4, 5)]
    assert pairs_of_frames(np.empty(0, np.int64))[0].tolist() == []
