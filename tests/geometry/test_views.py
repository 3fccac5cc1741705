"""What cameras see, against rays and brute force."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from planted_cameras import SIZE, look

from vsd_analytics.geometry import camera_views
from vsd_analytics.site.model import Calibration, Camera, Floor

FLOOR = Floor("f", "F")


def camera(name: str, h: NDArray[np.float64] | None = None, **more: object) -> Camera:
    calibrations = () if h is None else (Calibration(tuple(map(tuple, h.tolist())), None, "0"),)
    given_ = {"picture_px": SIZE if h is not None else None, **more}
    return Camera(name, name, "f", calibrations, **given_)  # type: ignore[arg-type]


looks = st.builds(
    look,
    at=st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
    pan_deg=st.floats(-180, 180),
    tilt_deg=st.floats(8, 90),
    height_m=st.floats(2, 8),
)


@settings(max_examples=40)
@given(h=looks, seed=st.integers(0, 1000))
def test_view_is_the_floor_in_the_picture_within_reach(h: NDArray[np.float64], seed: int) -> None:
    view = camera_views.seen_floor(h, picture_px=SIZE)
    (nearest,) = camera_views.to_floor(h, [(SIZE[0] / 2, SIZE[1])], picture_px=SIZE)
    xy = np.random.default_rng(seed).uniform(nearest - 33, nearest + 33, (500, 2))
    uv = camera_views.to_image(h, xy, picture_px=SIZE)
    in_picture = np.all((uv >= 0) & (uv <= SIZE), axis=1)
    expected = in_picture & (np.hypot(*(xy - nearest).T) < camera_views.VIEW_REACH_M)
    at_border = shapely.distance(shapely.points(xy), view.exterior) < 0.05
    assert np.array_equal(shapely.contains_xy(view, *xy.T)[~at_border], expected[~at_border])


def test_view_stops_at_the_plan() -> None:
    bounds = (-2.0, 0.0, 2.0, 6.0)
    one = camera("a", look(at=(0, 0)))
    view = camera_views.view_polygon(one, calibration=one.calibrations[0], bounds=bounds)
    assert view is not None
    assert shapely.box(*bounds).covers(view)
    whole = camera_views.view_polygon(one, calibration=one.calibrations[0])
    assert view.equals(whole & shapely.box(*bounds))


def test_view_outside_the_plan_is_empty_not_unknown() -> None:
    one = camera("a", look(at=(0, 0)))
    view = camera_views.view_polygon(one, calibration=one.calibrations[0], bounds=(500, 500, 510, 510))
    assert view is not None
    assert view.is_empty


def test_view_without_picture_size_or_homography_is_unknown() -> None:
    one = camera("a", look(at=(0, 0)), picture_px=None)
    assert camera_views.view_polygon(one, calibration=one.calibrations[0]) is None
    assert camera_views.view_polygon(camera("b"), calibration=None) is None


def test_given_view_wins_over_the_homography() -> None:
    square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    one = camera("a", look(at=(0, 0)), view=square)
    assert camera_views.view_polygon(one, calibration=one.calibrations[0]) == shapely.Polygon(square)


# unseen ---------------------------------------------------------------------------------------------------------------


def test_unseen_and_seen_make_the_plan() -> None:
    bounds = (-10.0, -5.0, 15.0, 20.0)
    cameras = [camera("a", look(at=(0, -6))), camera("b", look(at=(9, 3), pan_deg=90))]
    dark = camera_views.unseen(FLOOR, cameras=cameras, bounds=bounds)
    assert dark is not None
    views = [camera_views.view_polygon(c, calibration=c.calibrations[0], bounds=bounds) for c in cameras]
    seen = shapely.union_all(views)
    assert sum(p.area for p in dark) + seen.area == pytest.approx(25 * 25)
    assert shapely.union_all(dark).intersection(seen).area == pytest.approx(0, abs=1e-9)


def test_unseen_is_unknown_when_one_view_is() -> None:
    cameras = [camera("a", look(at=(0, 0))), camera("b")]
    assert camera_views.unseen(FLOOR, cameras=cameras, bounds=(0, 0, 9, 9)) is None


def test_cameras_of_other_floors_see_nothing_here() -> None:
    upper = Camera("b", "b", "upper")
    (whole,) = camera_views.unseen(FLOOR, cameras=[upper], bounds=(0, 0, 9, 9)) or []
    assert whole.area == 81


def test_view_in_the_middle_leaves_a_hole() -> None:
    middle = camera("m", view=((3, 3), (6, 3), (6, 6), (3, 6)))
    (ring,) = camera_views.unseen(FLOOR, cameras=[middle], bounds=(0, 0, 9, 9)) or []
    assert (ring.area, len(ring.interiors)) == (72, 1)
