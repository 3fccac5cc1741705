"""Areas at the border of the view are distinguished from those inside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.figures.borders import UNKNOWN, area_borders
from vsd_analytics.geometry import camera_views
from vsd_analytics.site.model import Area, Camera, Floor, Site


def square(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


@pytest.fixture
def site(tmp_path: Path) -> Site:
    """Return a view of 20 x 10 m in two halves, with an area inside, one along its edge, one unseen, one half at it."""
    cameras = tuple(Camera(f"c{i}", f"C{i}", "f", view=square(10 * i, 0, 10 * i + 10, 10)) for i in range(2))
    places = {
        "inside": square(8, 3, 12, 7),
        "edge": square(2, 0, 6, 0.75),
        "unseen": square(30, 0, 32, 2),
        "mixed": square(14, 0, 16, 4),
    }
    areas = tuple(Area(name, name, "f", polygon) for name, polygon in places.items())
    return Site("s", "S", "UTC", tmp_path, floors=(Floor("f", "F"),), cameras=cameras, areas=areas)


def test_areas_along_the_edge_are_border_and_those_inside_are_not(site: Site) -> None:
    found = {b.area_id: b for b in area_borders(site, at_ms=0)}
    assert list(found) == ["inside", "edge", "unseen", "mixed"]
    assert (found["inside"].share, found["inside"].is_border, found["inside"].note) == (0, False, None)
    assert (found["edge"].share, found["unseen"].share) == (1, 1)
    assert found["edge"].note == Reason("border.risk_low", share=1.0)
    assert 0 < (found["mixed"].share or 0) < 0.5
    assert found["mixed"].note is None


def test_an_unknown_view_is_not_taken_for_one(site: Site) -> None:
    blind = replace(site, cameras=(*site.cameras, Camera("c9", "C9", "f")))
    assert [(b.share, b.is_border, b.note) for b in area_borders(blind, at_ms=0)] == [(None, None, UNKNOWN)] * 4


def test_seen_share_is_that_of_points_drawn_in_the_disc() -> None:
    views = [shapely.Polygon(square(0, 0, 10, 10)), shapely.Polygon(square(8, 2, 14, 6))]
    middles = [(5.0, 5.0), (0.0, 0.0), (0.0, 5.0), (11.0, 6.5), (13.0, 4.0), (40.0, 40.0)]
    rng = np.random.default_rng(1)
    angle, radius = rng.uniform(0, 2 * np.pi, 20_000), 2 * np.sqrt(rng.uniform(0, 1, 20_000))
    offsets = np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))
    drawn = [shapely.contains_xy(shapely.union_all(views), *(np.array(m) + offsets).T).mean() for m in middles]
    assert camera_views.seen_share(middles, views=views, radius_m=2.0) == pytest.approx(drawn, abs=0.015)
    within = camera_views.seen_share([(0.0, 5.0)], views=views, radius_m=2.0, bounds=(0, 0, 20, 20))
    assert within == pytest.approx([1.0])
