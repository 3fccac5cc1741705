"""What cameras see, against rays and brute force."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from planted_cameras import SIZE, look

from vsd_analytics import geometry
from vsd_analytics.site import Calibration, Camera, Floor

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
    view = geometry.seen_floor(h, picture_px=SIZE)
    (nearest,) = geometry.to_floor(h, [(SIZE[0] / 2, SIZE[1])], picture_px=SIZE)
    xy = np.random.default_rng(seed).uniform(nearest - 33, nearest + 33, (500, 2))
    uv = geometry.to_image(h, xy, picture_px=SIZE)
    in_picture = np.all((uv >= 0) & (uv <= SIZE), axis=1)
    expected = in_picture & (np.hypot(*(xy - nearest).T) < geometry.VIEW_REACH_M)
    at_border = shapely.distance(shapely.points(xy), view.exterior) < 0.05
    assert np.array_equal(shapely.contains_xy(view, *xy.T)[~at_border], expected[~at_border])


def test_view_stops_at_the_plan() -> None:
    bounds = (-2.0, 0.0, 2.0, 6.0)
    one = camera("a", look(at=(0, 0)))
    view = geometry.view_polygon(one, calibration=one.calibrations[0], bounds=bounds)
    assert view is not None
    assert shapely.box(*bounds).covers(view)
    whole = geometry.view_polygon(one, calibration=one.calibrations[0])
    assert view.equals(whole & shapely.box(*bounds))


def test_view_outside_the_plan_is_empty_not_unknown() -> None:
    one = camera("a", look(at=(0, 0)))
    view = geometry.view_polygon(one, calibration=one.calibrations[0], bounds=(500, 500, 510, 510))
    assert view is not None
    assert view.is_empty


def test_view_without_picture_size_or_homography_is_unknown() -> None:
    one = camera("a", look(at=(0, 0)), picture_px=None)
    assert geometry.view_polygon(one, calibration=one.calibrations[0]) is None
    assert geometry.view_polygon(camera("b"), calibration=None) is None


def test_given_view_wins_over_the_homography() -> None:
    square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    one = camera("a", look(at=(0, 0)), view=square)
    assert geometry.view_polygon(one, calibration=one.calibrations[0]) == shapely.Polygon(square)


# owners ---------------------------------------------------------------------------------------------------------------


def three_cameras() -> list[Camera]:
    return [
        camera("a", look(at=(0, -6))),
        camera("b", look(at=(9, 3), pan_deg=90)),
        camera("c", look(at=(0, 12), pan_deg=180)),
    ]


def finest_by_hand(cameras: list[Camera], cell_m: float) -> dict[tuple[int, int], str]:
    """Return, without smoothing, the camera with the most pixels per metre in each cell two or more see."""
    views = {c.camera_id: geometry.seen_floor(c.calibrations[0].homography, picture_px=SIZE) for c in cameras}
    found = {}
    for cx in range(-80, 80):
        for cy in range(-80, 80):
            x, y = (cx + 0.5) * cell_m, (cy + 0.5) * cell_m
            fine = {}
            for c in cameras:
                if views[c.camera_id].contains(shapely.Point(x, y)):
                    (u0, v0), (u1, v1), (u2, v2) = geometry.to_image(
                        c.calibrations[0].homography, [(x, y), (x + 1e-4, y), (x, y + 1e-4)], picture_px=SIZE
                    )
                    fine[c.camera_id] = abs((u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0))
            if len(fine) > 1:
                found[cx, cy] = max(fine, key=fine.__getitem__)
    return found


def test_owner_is_the_finest_camera_but_for_smoothed_borders() -> None:
    cameras = [
        camera("a", look(at=(0, -6))),
        camera("b", look(at=(9, 3), pan_deg=90)),
        camera("c", look(at=(0, 12), pan_deg=180)),
    ]
    expected = finest_by_hand(cameras, 0.5)
    cells = geometry.owner_cells(cameras, cell_m=0.5)
    found = {(cell.cx, cell.cy): cell.camera_id for cell in cells}
    assert found.keys() == expected.keys()
    assert len(found) == len(cells) > 100
    assert set(Counter(found.values())) == {"a", "b", "c"}
    for cell, owner in found.items():
        around = [expected.get((cell[0] + i, cell[1] + j)) for i in range(-2, 3) for j in range(-2, 3)]
        if len({name for name in around if name}) == 1:
            assert owner == expected[cell]  # away from borders nothing moves
    assert sum(found[cell] != expected[cell] for cell in found) < 0.1 * len(found)


def test_owner_borders_are_smoother_than_the_raw_ones() -> None:
    cameras = [
        camera("a", look(at=(0, -6))),
        camera("b", look(at=(9, 3), pan_deg=90)),
        camera("c", look(at=(0, 12), pan_deg=180)),
    ]

    def edges(owner: dict[tuple[int, int], str]) -> int:
        steps = ((1, 0), (0, 1))
        return sum(owner.get((x + i, y + j), name) != name for (x, y), name in owner.items() for i, j in steps)

    found = {(cell.cx, cell.cy): cell.camera_id for cell in geometry.owner_cells(cameras, cell_m=0.5)}
    assert edges(found) <= edges(finest_by_hand(cameras, 0.5))


def test_one_owner_for_twins_whatever_the_cell() -> None:
    h = look(at=(0, 0))
    cells = geometry.owner_cells([camera("a", h), camera("b", h)], cell_m=0.5)
    assert {cell.camera_id for cell in cells} == {"a"}


def test_owner_does_not_hang_on_the_order_of_cameras() -> None:
    cameras = [camera("a", look(at=(0, -6))), camera("b", look(at=(9, 3), pan_deg=90))]
    one, other = (set(geometry.owner_cells(c, cell_m=0.5)) for c in (cameras, cameras[::-1]))
    assert one == other


def test_cells_of_one_view_are_not_listed() -> None:
    far = [camera("a", look(at=(0, 0))), camera("b", look(at=(200, 0)))]
    assert geometry.owner_cells(far, cell_m=0.5) == []
    assert geometry.owner_cells(far[:1], cell_m=0.5) == []
    assert geometry.owner_cells([], cell_m=0.5) == []


def test_camera_without_known_view_takes_no_part() -> None:
    h = look(at=(0, 0))
    assert geometry.owner_cells([camera("a", h), camera("b", h, picture_px=None), camera("c")], cell_m=0.5) == []


def test_cameras_of_two_floors_do_not_compete() -> None:
    h = look(at=(0, 0))
    upper = Camera("b", "b", "upper", camera("b", h).calibrations, picture_px=SIZE)
    assert geometry.owner_cells([camera("a", h), upper], cell_m=0.5) == []


def test_floors_are_listed_one_by_one_when_asked() -> None:
    h = look(at=(0, 0))
    cameras = [camera("a", h), camera("b", h)]
    assert geometry.owner_cells(cameras, cell_m=0.5, floor=FLOOR) == geometry.owner_cells(cameras, cell_m=0.5)
    assert geometry.owner_cells(cameras, cell_m=0.5, floor=Floor("upper", "U")) == []


def test_engines_of_metres_share_by_nearness() -> None:
    left = camera("left", view=((0, 0), (6, 0), (6, 4), (0, 4)))
    right = camera("right", view=((4, 0), (10, 0), (10, 4), (4, 4)))
    cells = geometry.owner_cells([left, right], cell_m=0.5)
    assert {(c.cx, c.cy) for c in cells} == {(x, y) for x in range(8, 12) for y in range(8)}
    assert all(c.camera_id == ("left" if c.cx < 10 else "right") for c in cells)


def test_neighbours_cannot_give_a_cell_to_a_camera_that_does_not_see_it() -> None:
    left = camera("a", view=((-70, -40), (10, -40), (10, 40), (-70, 40)))
    right = camera("b", view=((-10, -40), (70, -40), (70, 40), (-10, 40)))
    notched = ((0, 0), (3, 0), (3, 3), (1.5, 3), (1.5, 1), (1.0, 1), (1.0, 3), (0, 3))  # a slit one cell wide
    owners = {
        (c.cx, c.cy): c.camera_id for c in geometry.owner_cells([left, right, camera("c", view=notched)], cell_m=0.5)
    }
    assert owners[1, 3] == "c"
    assert owners[3, 3] == "c"
    assert "c" not in {owner for (cx, cy), owner in owners.items() if not (0 <= cx < 6 and 0 <= cy < 6)}
    view = shapely.Polygon(notched)
    assert all(
        view.contains(shapely.Point((cx + 0.5) / 2, (cy + 0.5) / 2)) for (cx, cy), o in owners.items() if o == "c"
    )


# unseen ---------------------------------------------------------------------------------------------------------------


def test_unseen_and_seen_make_the_plan() -> None:
    bounds = (-10.0, -5.0, 15.0, 20.0)
    cameras = [camera("a", look(at=(0, -6))), camera("b", look(at=(9, 3), pan_deg=90))]
    dark = geometry.unseen(FLOOR, cameras=cameras, bounds=bounds)
    assert dark is not None
    views = [geometry.view_polygon(c, calibration=c.calibrations[0], bounds=bounds) for c in cameras]
    seen = shapely.union_all(views)
    assert sum(p.area for p in dark) + seen.area == pytest.approx(25 * 25)
    assert shapely.union_all(dark).intersection(seen).area == pytest.approx(0, abs=1e-9)


def test_unseen_is_unknown_when_one_view_is() -> None:
    cameras = [camera("a", look(at=(0, 0))), camera("b")]
    assert geometry.unseen(FLOOR, cameras=cameras, bounds=(0, 0, 9, 9)) is None


def test_cameras_of_other_floors_see_nothing_here() -> None:
    upper = Camera("b", "b", "upper")
    (whole,) = geometry.unseen(FLOOR, cameras=[upper], bounds=(0, 0, 9, 9)) or []
    assert whole.area == 81


def test_view_in_the_middle_leaves_a_hole() -> None:
    middle = camera("m", view=((3, 3), (6, 3), (6, 6), (3, 6)))
    (ring,) = geometry.unseen(FLOOR, cameras=[middle], bounds=(0, 0, 9, 9)) or []
    assert (ring.area, len(ring.interiors)) == (72, 1)
