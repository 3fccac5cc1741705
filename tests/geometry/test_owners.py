"""Which of several cameras counts where, against brute force."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from planted_cameras import SIZE, look

from vsd_analytics.geometry import camera_views
from vsd_analytics.geometry.ownership import CUT_FEET_M, PAIR_REACH_M, owner_cells
from vsd_analytics.site.model import Calibration, Camera, Floor

FLOOR = Floor("f", "F")
CELL_M = 0.5
Owners = dict[tuple[int, int], str]


def camera(name: str, h: NDArray[np.float64] | None = None, **more: object) -> Camera:
    calibrations = () if h is None else (Calibration(tuple(map(tuple, h.tolist())), None, "0"),)
    given_ = {"picture_px": SIZE if h is not None else None, **more}
    return Camera(name, name, "f", calibrations, **given_)  # type: ignore[arg-type]


def square(name: str, x0: float, y0: float, x1: float, y1: float) -> Camera:
    return camera(name, view=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def owners(*cameras: Camera) -> Owners:
    cells = owner_cells(cameras, cell_m=CELL_M)
    found = {(cell.cx, cell.cy): cell.camera_id for cell in cells}
    assert len(found) == len(cells)
    return found


THREE = (
    camera("a", look(at=(0, -6))),
    camera("b", look(at=(9, 3), pan_deg=90)),
    camera("c", look(at=(0, 12), pan_deg=180)),
)


def pixels_per_metre(h: object, x: float, y: float) -> float:
    (u0, v0), (u1, v1), (u2, v2) = camera_views.to_image(h, [(x, y), (x + 1e-4, y), (x, y + 1e-4)], picture_px=SIZE)
    return float(abs((u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0)))


def by_hand(*cameras: Camera) -> Owners:
    """Return, without smoothing, the camera that covers each cell best, the finest among equals."""
    views = {c.camera_id: camera_views.seen_floor(c.calibrations[0].homography, picture_px=SIZE) for c in cameras}
    found = {}
    for cx in range(-80, 80):
        for cy in range(-80, 80):
            x, y = (cx + 0.5) * CELL_M, (cy + 0.5) * CELL_M
            merits = {}
            for c in cameras:
                inside = views[c.camera_id].contains(shapely.Point(x, y))
                border_m = views[c.camera_id].exterior.distance(shapely.Point(x, y))
                if inside:
                    fine = pixels_per_metre(c.calibrations[0].homography, x, y)
                    merits[c.camera_id] = (2 if border_m >= PAIR_REACH_M else 1, fine)
                elif border_m <= CUT_FEET_M:
                    merits[c.camera_id] = (0, -border_m)
            if len(merits) > 1:
                found[cx, cy] = max(merits, key=merits.__getitem__)
    return found


def test_owner_covers_its_cell_best_and_is_the_finest_that_does_but_for_smoothed_borders() -> None:
    expected, found = by_hand(*THREE), owners(*THREE)
    assert len(found) > 100
    assert len(found.keys() ^ expected.keys()) < 0.01 * len(found)  # a cell at the very edge of reach
    assert set(Counter(found.values())) == {"a", "b", "c"}
    for cell in found.keys() & expected.keys():
        around = [expected.get((cell[0] + i, cell[1] + j)) for i in range(-2, 3) for j in range(-2, 3)]
        if len({name for name in around if name}) == 1:
            assert found[cell] == expected[cell]  # away from borders nothing moves
    assert sum(found[cell] != expected.get(cell) for cell in found) < 0.1 * len(found)


def test_owner_borders_are_shorter_than_the_raw_ones() -> None:
    def edges(owner: Owners) -> int:
        steps = ((1, 0), (0, 1))
        return sum(owner.get((x + i, y + j), name) != name for (x, y), name in owner.items() for i, j in steps)

    assert edges(owners(*THREE)) < edges(by_hand(*THREE))


@settings(max_examples=8, deadline=None)
@given(
    places=st.lists(
        st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(2, 10), st.floats(2, 10)), min_size=2, max_size=4
    )
)
def test_no_camera_owns_a_cell_that_another_covers_better(places: list[tuple[float, float, float, float]]) -> None:
    cameras = [square(f"c{i}", x, y, x + w, y + d) for i, (x, y, w, d) in enumerate(places)]

    def cover(one: Camera, cell: tuple[int, int]) -> int | None:
        view = shapely.Polygon(one.view)
        middle = shapely.Point((cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M)
        inside, to_view_m, to_border_m = view.contains(middle), view.distance(middle), view.exterior.distance(middle)
        if any(abs(d - edge) < 0.02 for d, edge in ((to_view_m, CUT_FEET_M), (to_border_m, PAIR_REACH_M))):
            return None  # too near to say: round corners are polygons
        return (3 if to_border_m > PAIR_REACH_M else 2) if inside else int(to_view_m < CUT_FEET_M)

    found = owners(*cameras)
    for cx in range(-25, 45):
        for cy in range(-25, 45, 3):
            covers = {c.camera_id: cover(c, (cx, cy)) for c in cameras}
            known = [n for n in covers.values() if n is not None]
            if len(known) < len(cameras):
                continue
            assert ((cx, cy) in found) == (sum(n > 0 for n in known) > 1)
            if (cx, cy) in found:
                assert covers[found[cx, cy]] == max(known)


def test_both_of_a_pair_are_seen_by_the_owner_of_their_midpoint_where_any_camera_sees_around_it() -> None:
    """A narrow view that is finer does not take the middle of pairs it can see only one of."""
    wide = camera("wide", look(at=(0, -6), height_m=10, f_px=500))
    narrow = camera("narrow", look(at=(0, -6), height_m=10, f_px=1500))
    found = owners(wide, narrow)
    view = camera_views.seen_floor(narrow.calibrations[0].homography, picture_px=SIZE)
    middles = {cell: shapely.Point((cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M) for cell in found}
    at_edge = [c for c, m in middles.items() if view.contains(m) and view.exterior.distance(m) < PAIR_REACH_M - 0.05]
    inner = [c for c, m in middles.items() if view.contains(m) and view.exterior.distance(m) > PAIR_REACH_M + 1]
    assert len(at_edge) > 5
    assert len(inner) > 5
    assert {found[c] for c in at_edge} == {"wide"}
    assert {found[c] for c in inner} == {"narrow"}


def test_feet_cut_off_by_one_picture_do_not_count_beside_the_camera_that_sees_them() -> None:
    found = owners(square("a", 0, 0, 10, 10), square("b", 10, 0, 20, 10))
    assert found[17, 10] == "a"  # x = 8.75 m, 1.25 m outside the view of b
    assert found[22, 10] == "b"
    assert (15, 10) not in found  # x = 7.75 m, out of reach of b


def test_where_no_camera_sees_the_nearest_view_counts() -> None:
    found = owners(square("a", 0, 0, 10, 10), square("b", 11.9, 0, 20, 10))
    assert found[20, 10] == "a"  # x = 10.25 m
    assert found[23, 10] == "b"  # x = 11.75 m


def test_one_owner_for_two_equal_cameras_whatever_the_cell() -> None:
    h = look(at=(0, 0))
    assert set(owners(camera("a", h), camera("b", h)).values()) == {"a"}


def test_owner_does_not_hang_on_the_order_of_cameras() -> None:
    assert owners(*THREE) == owners(*THREE[::-1])


def test_cells_of_one_camera_are_not_listed() -> None:
    far = [camera("a", look(at=(0, 0))), camera("b", look(at=(200, 0)))]
    assert owners(*far) == owners(far[0]) == owners() == {}


def test_camera_without_known_view_takes_no_part() -> None:
    h = look(at=(0, 0))
    assert owners(camera("a", h), camera("b", h, picture_px=None), camera("c")) == {}


def test_cameras_of_two_floors_do_not_compete() -> None:
    h = look(at=(0, 0))
    upper = Camera("b", "b", "upper", camera("b", h).calibrations, picture_px=SIZE)
    assert owners(camera("a", h), upper) == {}


def test_floors_are_listed_one_by_one_when_asked() -> None:
    h = look(at=(0, 0))
    cameras = [camera("a", h), camera("b", h)]
    assert owner_cells(cameras, cell_m=CELL_M, floor=FLOOR) == owner_cells(cameras, cell_m=CELL_M)
    assert owner_cells(cameras, cell_m=CELL_M, floor=Floor("upper", "U")) == []


@pytest.mark.parametrize("cy", range(8))
def test_engines_of_metres_share_by_nearness(cy: int) -> None:
    found = owners(square("left", 0, 0, 7, 4), square("right", 3, 0, 10, 4))
    assert [found[cx, cy] for cx in range(6, 14)] == ["left"] * 4 + ["right"] * 4


def test_neighbours_cannot_give_a_cell_to_a_camera_that_does_not_see_it() -> None:
    notched = ((0, 0), (6, 0), (6, 6), (3.5, 6), (3.5, 3), (3.0, 3), (3.0, 6), (0, 6))  # a slit one cell wide
    found = owners(square("a", -70, -40, 10, 40), square("b", -10, -40, 70, 40), camera("c", view=notched))
    view = shapely.Polygon(notched)
    mine = [cell for cell, owner in found.items() if owner == "c"]
    assert (3, 3) in mine
    assert all(view.contains(shapely.Point((cx + 0.5) / 2, (cy + 0.5) / 2)) for cx, cy in mine)
