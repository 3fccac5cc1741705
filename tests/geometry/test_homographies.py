"""Homographies against OpenCV, planted cameras and brute force."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from planted_cameras import SIZE, look

from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry import camera_views

cameras = st.builds(
    look,
    height_m=st.floats(2, 12),
    tilt_deg=st.floats(10, 80),
    pan_deg=st.floats(-180, 180),
    at=st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
    f_px=st.floats(500, 1500),
)
pixels = st.lists(st.tuples(st.floats(0, SIZE[0]), st.floats(0, SIZE[1])), min_size=1, max_size=20)


@given(h=cameras, uv=pixels)
def test_floor_points_are_those_of_opencv_or_beyond_the_horizon(
    h: NDArray[np.float64], uv: list[tuple[float, float]]
) -> None:
    points = np.array(uv)
    ours = camera_views.to_floor(h, points, picture_px=SIZE)
    w = np.column_stack([points, np.ones(len(points))]) @ h[2]
    assume(np.all(np.abs(w) > 1e-6 * np.abs(h).max()))
    bottom = np.array([SIZE[0] / 2, SIZE[1], 1.0]) @ h[2]
    on_floor = w * bottom > 0
    theirs = cv2.perspectiveTransform(points[None], h)[0]
    assert np.array_equal(np.isnan(ours[:, 0]), ~on_floor)
    assert np.allclose(ours[on_floor], theirs[on_floor], rtol=1e-9, atol=1e-9)


@given(h=cameras, scale=st.sampled_from([-3.0, -1e-6, 1e6, 2.0]), uv=pixels)
def test_scale_and_sign_of_the_matrix_do_not_matter(
    h: NDArray[np.float64], scale: float, uv: list[tuple[float, float]]
) -> None:
    one, other = (camera_views.to_floor(m, uv, picture_px=SIZE) for m in (h, h * scale))
    assert np.allclose(one, other, rtol=1e-6, atol=1e-6, equal_nan=True)


@given(h=cameras, x=st.floats(-8, 8), ahead=st.floats(1.0, 20))
def test_picture_and_floor_are_inverse(h: NDArray[np.float64], x: float, ahead: float) -> None:
    uv = np.array([[SIZE[0] / 2 + 20 * x, SIZE[1] - ahead]])
    there = camera_views.to_floor(h, uv, picture_px=SIZE)
    assert np.allclose(camera_views.to_image(h, there, picture_px=SIZE), uv, atol=1e-5)


def test_point_above_the_horizon_is_missing_not_somewhere() -> None:
    h = look(tilt_deg=10)
    horizon_v = SIZE[1] / 2 - 900 * np.tan(np.radians(10))
    above, below = camera_views.to_floor(h, [(640, horizon_v - 5), (640, horizon_v + 5)], picture_px=SIZE)
    assert np.all(np.isnan(above))
    assert below[1] > 100
    assert np.all(
        np.isfinite(cv2.perspectiveTransform(np.array([[[640, horizon_v - 5]]]), h))
    )  # what it would have been


def test_floor_behind_the_camera_is_in_no_picture() -> None:
    h = look(tilt_deg=35)
    ahead, behind = camera_views.to_image(h, [(0, 5), (0, -20)], picture_px=SIZE)
    assert np.all(np.isfinite(ahead))
    assert np.all(np.isnan(behind))


def test_planted_camera_sees_the_floor_where_it_is() -> None:
    h = look(height_m=3, tilt_deg=45, at=(10, 20))
    assert np.allclose(camera_views.to_floor(h, [(SIZE[0] / 2, SIZE[1] / 2)], picture_px=SIZE), [[10, 23]], atol=1e-9)


@given(h=cameras)
def test_side_of_the_floor_is_found_without_the_picture_size(h: NDArray[np.float64]) -> None:
    assert camera_views.ground_sign(h) == camera_views.ground_sign(h, picture_px=SIZE)


def test_steep_camera_without_picture_size_keeps_its_floor() -> None:
    for tilt in (70, 90, 100, 110):  # beyond 90 the horizon lies below the picture
        h = look(tilt_deg=tilt)
        assert camera_views.ground_sign(h) == camera_views.ground_sign(h, picture_px=SIZE)


def test_missing_pixels_are_missing_metres() -> None:
    assert np.all(np.isnan(camera_views.to_floor(look(), [(np.nan, 5.0)])))
    assert camera_views.to_floor(look(), np.empty((0, 2))).shape == (0, 2)


@given(h=cameras, u=st.floats(100, 1180), v=st.floats(500, 720))
def test_resolution_is_the_area_ratio_of_a_small_square(h: NDArray[np.float64], u: float, v: float) -> None:
    import shapely

    (x, y), side = camera_views.to_floor(h, [(u, v)], picture_px=SIZE)[0], 1e-4
    assume(np.isfinite(x))
    square = np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]])
    area = shapely.Polygon(camera_views.to_image(h, square, picture_px=SIZE)).area
    (resolution,) = camera_views.ground_resolution(h, [(x, y)], picture_px=SIZE)
    assert resolution == pytest.approx(np.sqrt(area) / side, rel=1e-2)


# fitting --------------------------------------------------------------------------------------------------------------

SPOTS = np.array([[100, 700], [1200, 680], [900, 400], [300, 420], [640, 550], [700, 450]], dtype=float)


@given(h=cameras, n=st.integers(4, 6), shift=st.sampled_from([0.0, 500_000.0]))
def test_planted_homography_is_found(h: NDArray[np.float64], n: int, shift: float) -> None:
    xy = camera_views.to_floor(h, SPOTS, picture_px=SIZE)
    assume(np.all(np.isfinite(xy)) and np.ptp(xy) < 60)
    fit = camera_views.fit_homography(np.column_stack([SPOTS, xy + shift])[:n])
    again = camera_views.to_floor(fit.homography, SPOTS, picture_px=SIZE)
    assert np.allclose(again, xy + shift, atol=0.01)
    assert fit.rmse_m < 0.005


def test_error_is_the_distance_on_the_floor() -> None:
    rng = np.random.default_rng(7)
    spots = rng.uniform((0, 350), SIZE, (400, 2))
    xy = camera_views.to_floor(look(), spots, picture_px=SIZE)
    fit = camera_views.fit_homography(np.column_stack([spots, xy + rng.normal(0, 0.1, xy.shape)]))
    assert fit.rmse_m == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert fit.errors_m.shape == (400,)
    assert fit.rmse_m == pytest.approx(np.sqrt(np.mean(fit.errors_m**2)))


def test_wrong_point_has_the_largest_error() -> None:
    xy = camera_views.to_floor(look(), SPOTS, picture_px=SIZE)
    xy[4] += (1.0, 0.5)
    fit = camera_views.fit_homography(np.column_stack([SPOTS, xy]))
    assert np.argmax(fit.errors_m) == 4
    assert fit.errors_m[4] > 0.3


def test_errors_keep_the_order_of_the_points() -> None:
    xy = camera_views.to_floor(look(), SPOTS, picture_px=SIZE)
    xy[4] += (1.0, 0.5)
    order = [4, 2, 0, 5, 1, 3]
    assert np.argmax(camera_views.fit_homography(np.column_stack([SPOTS, xy])[order]).errors_m) == 0


@pytest.mark.parametrize(
    ("points", "code"),
    [
        ([(0, 0, 0, 0), (1, 0, 1, 0), (0, 1, 0, 1)], "E401"),
        ([(0, 0, 0, 0), (1, 0, 1, 0), (0, 1, 0, 1), (0, 1, 0, 1)], "E401"),
        ([(i, 2 * i, i, -i) for i in range(6)], "E402"),
        ([(0, 0, 0, 0), (9, 0, 1, 0), (9, 9, 2, 0.001), (0, 9, 3, 0)], "E402"),
        ([(0, 0, 0, 0), (50, 50, 1, 1), (100, 100, 2, 2), (0, 100, 0, 2)], "E402"),
        ([(0, 0, 0, 0), (100, 0, 1, 0), (100, 100, 0, 1), (0, 100, 1, 1)], "E402"),  # two corners swapped: a bow tie
    ],
)
def test_points_that_fix_nothing_are_refused(points: list[tuple[float, ...]], code: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        camera_views.fit_homography(np.array(points, dtype=float))
    assert caught.value.code == code


@pytest.mark.realdata
def test_known_calibration_of_a_street_is_found_again(realdata: Callable[[str], Path]) -> None:
    h = np.loadtxt(realdata("oxtown/H_image_to_ground_m.txt"))
    spots = np.array([[100, 900], [1800, 1000], [960, 500], [300, 300], [1500, 300]], dtype=float)
    fit = camera_views.fit_homography(
        np.column_stack([spots, camera_views.to_floor(h, spots, picture_px=(1920, 1080))])
    )
    assert np.allclose(np.array(fit.homography), h / h[2, 2], rtol=1e-3, atol=1e-6)
    assert fit.rmse_m < 1e-4
