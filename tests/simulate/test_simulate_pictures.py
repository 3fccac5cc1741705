"""Pictures of the empty shop: the same every time, small, and true to the cameras that take them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from vsd_analytics.simulate.cameras import CAMERAS, HEIGHT_PX, WIDTH_PX, PinholeCamera
from vsd_analytics.simulate.plan import fixtures
from vsd_analytics.simulate.scene_pictures import picture
from vsd_analytics.simulate.shop import SHOP_AFTER, SHOP_BEFORE


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.camera_id)
def test_pictures_are_small_grey_pngs_and_always_the_same(camera: PinholeCamera) -> None:
    data = picture(camera, SHOP_AFTER)
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert len(data) < 90_000
    assert data == picture(camera, SHOP_AFTER)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image.shape == (HEIGHT_PX, WIDTH_PX)


def test_the_display_is_where_the_homography_says() -> None:
    """The two pictures differ at the display's old and new place, and nowhere else."""
    camera = CAMERAS[0]
    before, after = (
        cv2.imdecode(np.frombuffer(picture(camera, s), np.uint8), cv2.IMREAD_UNCHANGED).astype(int)
        for s in (SHOP_BEFORE, SHOP_AFTER)
    )
    rows, columns = np.nonzero(np.abs(before - after) > 20)
    x0, y0, x1, y1 = SHOP_BEFORE.display
    corners = np.array([(x, y, z) for x in (x0 - 0.4, x1 + 0.4) for y in (y0 - 0.4, y1 + 0.4) for z in (0.0, 1.5)])
    u, v, _ = camera.project(*corners.T)
    hull = cv2.convexHull(np.column_stack([u, v]).astype(np.float32))
    inside = [cv2.pointPolygonTest(hull, (float(c), float(r)), True) > -30 for r, c in zip(rows, columns, strict=True)]
    assert len(inside) > 5000
    assert np.mean(inside) > 0.999


def test_fixtures_of_the_site_are_those_of_the_pictures() -> None:
    described = fixtures()
    assert len({f.fixture_id for f in described}) == len(described) == len(SHOP_AFTER.fixtures)
    assert [f.height_m for f in described] == [f.height_m for f in SHOP_AFTER.fixtures]
    assert {f.name for f in described if f.is_movable} == {"Fruit", "Trolleys", "Display"}
    assert {f.kind for f in described} == {"wall", "shelf", "till", "other"}
