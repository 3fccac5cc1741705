"""The picture of a spot: which camera, which part, and bands where the homography puts them, not over shelves."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import shapely

from vsd_analytics.figures.week.bands import heat_bands, sampled
from vsd_analytics.figures.week.model_map import FloorMap, MapBand, MapFixture, MapSpot, Ring
from vsd_analytics.geometry.embedded_pictures import SCENE_TONE, scene_image
from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.report.draw import spot_pictures
from vsd_analytics.report.draw.floor_frame import Edges
from vsd_analytics.simulate.cameras import HEIGHT_PX, WIDTH_PX, PinholeCamera
from vsd_analytics.site.model import Calibration, Camera, Fixture

NEAR = PinholeCamera("near", "Near", 5.0, 0.0, 3.2, 90.0)
FAR = PinholeCamera("far", "Far", 5.0, 14.0, 4.0, -90.0, tilt_deg=32.0)
AWAY = PinholeCamera("away", "Away", 5.0, 0.0, 3.2, -90.0)
SPOT = (5.0, 5.0)
HEIGHT_M = 0.5


@dataclass
class Data:
    """What cards ask of a week."""

    cameras: list[Camera]
    fixtures: tuple[Fixture, ...] = ()
    floor: Any = field(default_factory=lambda: SimpleNamespace(floor_id="f"))
    this: Any = field(default_factory=lambda: SimpleNamespace(span_ms=(0, 10**14)))

    @property
    def site(self) -> Any:
        return SimpleNamespace(fixtures=self.fixtures)


def camera(folder: Path, planted: PinholeCamera, **more: Any) -> Camera:
    path = folder / f"{planted.camera_id}.png"
    cv2.imwrite(str(path), np.tile(np.linspace(40, 220, WIDTH_PX).astype(np.uint8), (HEIGHT_PX, 1)))
    calibration = Calibration(tuple(map(tuple, planted.homography.tolist())), None, "0")
    options = {"calibrations": (calibration,), "picture": path, "picture_px": (WIDTH_PX, HEIGHT_PX)} | more
    return Camera(planted.camera_id, planted.name, "f", **options)


def bands(radius_m: float = 1.2) -> tuple[MapBand, ...]:
    x, y = np.meshgrid(np.arange(60) * 0.25 + 0.125, np.arange(60) * 0.25 + 0.125)
    hills = [np.clip(6 * (1 - np.hypot(x - a, y - b) / radius_m), 0, None) for a, b in (SPOT, (9.0, 9.0))]
    return heat_bands(sum(hills), cell_m=0.25, origin_m=(0.0, 0.0), steps=(0.5, 1.0, 2.0, 4.0))


def test_the_camera_that_shows_the_spot_most_finely_is_taken(tmp_path: Path) -> None:
    data = Data([camera(tmp_path, c) for c in (AWAY, FAR, NEAR)])
    picture = spot_pictures.spot_picture(data, bands(), number=2, at=SPOT)  # type: ignore[arg-type]
    assert picture is not None
    assert (picture.number, picture.camera_id) == (2, "near")
    u, v, _ = NEAR.project(*(np.array([c]) for c in (*SPOT, 0.0)))
    du, dv, _ = NEAR.project(np.array([5.01, 5.0]), np.array([5.0, 5.01]), np.zeros(2))
    area = abs((du[0] - u[0]) * (dv[1] - v[0]) - (du[1] - u[0]) * (dv[0] - v[0]))
    assert picture.px_per_m == pytest.approx(np.sqrt(area) * 100, rel=0.01)


@pytest.mark.parametrize("without", [{"picture": None}, {"calibrations": ()}, {"picture_px": None}])
def test_a_camera_without_picture_or_calibration_shows_nothing(tmp_path: Path, without: dict[str, Any]) -> None:
    poor = camera(tmp_path, NEAR, **without)
    assert spot_pictures.spot_picture(Data([poor]), bands(), number=1, at=SPOT) is None  # type: ignore[arg-type]
    both = spot_pictures.spot_picture(Data([poor, camera(tmp_path, FAR)]), bands(), number=1, at=SPOT)  # type: ignore[arg-type]
    assert both is not None
    assert both.camera_id == "far"


def test_a_calibration_that_begins_after_the_week_does_not_count(tmp_path: Path) -> None:
    later = Calibration(tuple(map(tuple, NEAR.homography.tolist())), datetime(5200, 1, 1, tzinfo=UTC), "1")
    data = Data([camera(tmp_path, NEAR, calibrations=(later,))])
    assert spot_pictures.spot_picture(data, bands(), number=1, at=SPOT) is None  # type: ignore[arg-type]


def test_a_spot_without_a_band_or_out_of_view_has_no_picture(tmp_path: Path) -> None:
    near = camera(tmp_path, NEAR)
    assert spot_pictures.spot_picture(Data([near]), bands(), number=1, at=(5.0, 9.0)) is None  # type: ignore[arg-type]
    assert spot_pictures.spot_picture(Data([camera(tmp_path, AWAY)]), bands(), number=1, at=SPOT) is None  # type: ignore[arg-type]


def test_only_the_spots_own_bands_are_shown() -> None:
    own = spot_pictures.own_bands(bands(), SPOT)
    assert [b.lower for b in own] == [0.5, 1.0, 2.0, 4.0]
    for band in own:
        (polygon,) = band.polygons
        assert shapely.Polygon(polygon[0]).contains(shapely.Point(SPOT))


def test_bands_lie_where_the_camera_sees_their_floor(tmp_path: Path) -> None:
    data = Data([camera(tmp_path, NEAR)])
    picture = spot_pictures.spot_picture(data, bands(), number=1, at=SPOT)  # type: ignore[arg-type]
    assert picture is not None
    for own, seen in zip(spot_pictures.own_bands(bands(), SPOT), picture.shown.bands, strict=True):
        ring = np.array(own.polygons[0][0])
        u, v, _ = NEAR.project(ring[:, 0], ring[:, 1], np.zeros(len(ring)))
        wanted, found = shapely.Polygon(np.column_stack([u, v])), shapely.Polygon(seen.polygons[0][0])
        assert wanted.symmetric_difference(found).area < 0.12 * wanted.area, "curves cut corners a little"
    x0, y0, x1, y1 = picture.shown.extent
    assert 0 <= x0 < x1 <= WIDTH_PX
    assert 0 <= y0 < y1 <= HEIGHT_PX
    assert (x1 - x0) / (y1 - y0) == pytest.approx(16 / 9, rel=0.01)


def test_what_a_shelf_hides_is_not_painted(tmp_path: Path) -> None:
    shelf = ((4.0, 3.6), (6.0, 3.6), (6.0, 4.0), (4.0, 4.0))
    cam = camera(tmp_path, NEAR)
    known, unknown = (Fixture("s", "Shelf", "f", shelf, height_m=h) for h in (HEIGHT_M, None))
    hidden, whole = (
        spot_pictures.spot_picture(Data([cam], (f,)), bands(), number=1, at=SPOT)  # type: ignore[arg-type]
        for f in (known, unknown)
    )
    assert hidden is not None
    assert whole is not None

    def shape(picture: Any) -> Any:
        return shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in picture.shown.bands[0].polygons])

    corners = np.array([(x, y, z) for x, y in shelf for z in (0.0, HEIGHT_M)])
    u, v, _ = NEAR.project(*corners.T)
    silhouette = shapely.MultiPoint(np.column_stack([u, v])).convex_hull
    assert shape(whole).intersection(silhouette).area > 1000, "the shelf stands before the spot"
    assert shape(hidden).intersection(silhouette).area < 0.002 * shape(whole).area
    assert shape(hidden).symmetric_difference(shape(whole).difference(silhouette)).area < 0.01 * shape(whole).area


def test_a_camera_that_sees_over_the_shelf_is_taken_before_a_finer_one_that_does_not(tmp_path: Path) -> None:
    shelf = ((4.0, 3.6), (6.0, 3.6), (6.0, 4.0), (4.0, 4.0))
    near, far = camera(tmp_path, NEAR), camera(tmp_path, FAR)
    for height_m, alone in ((0.05, "near"), (0.9, None), (1.3, None)):  # nearly nothing hidden, most of the spot, all
        fixtures = (Fixture("s", "Shelf", "f", shelf, height_m=height_m),)
        chosen = spot_pictures.spot_picture(Data([near, far], fixtures), bands(), number=1, at=SPOT)  # type: ignore[arg-type]
        assert chosen is not None
        assert chosen.camera_id == (alone or "far")
        only = spot_pictures.spot_picture(Data([near], fixtures), bands(), number=1, at=SPOT)  # type: ignore[arg-type]
        assert (only.camera_id if only is not None else None) == alone


def test_a_curve_through_a_ring_keeps_its_straight_edges() -> None:
    ring: Ring = ((0.0, 0.0), (4.0, 0.0), (5.0, 2.0), (4.0, 4.0), (0.0, 4.0))
    wall = MapFixture(fixture_id="w", name="W", kind="wall", ring=((-1.0, -1.0), (0.0, -1.0), (0.0, 5.0), (-1.0, 5.0)))
    sharp = Edges([wall]).holds(ring)
    assert sharp == [True, False, False, False, True]
    curve = sampled(ring, sharp=sharp)
    assert curve[0] == (0.0, 0.0)
    assert curve[-1] == (0.0, 4.0)
    assert shapely.Polygon(ring).buffer(1e-9).contains(shapely.Polygon(curve))


@pytest.mark.parametrize("at", [SPOT, (5.0, 9.0), (2.5, 4.0), (7.5, 6.0)])
@pytest.mark.parametrize("stretch", [(1.0, 1.0), (3.0, 1.0), (1.0, 3.0), (0.4, 0.4)])
def test_a_picture_shows_its_spot_away_from_the_edges_at_the_scale_it_says(
    tmp_path: Path, at: tuple[float, float], stretch: tuple[float, float]
) -> None:
    """Whatever the shape: the peak lies in the middle three fifths of what is shown, of the camera or of the floor."""
    x, y = np.meshgrid(np.arange(60) * 0.25 + 0.125, np.arange(60) * 0.25 + 0.125)
    hill = np.clip(6 * (1 - np.hypot((x - at[0]) / stretch[0], (y - at[1]) / stretch[1]) / 1.2), 0, None)
    made = heat_bands(hill, cell_m=0.25, origin_m=(0.0, 0.0), steps=(0.5, 1.0, 2.0, 4.0))
    floor = FloorMap(kind="floor", title="F", extent=(0.0, 0.0, 15.0, 15.0), bands=made)
    data = Data([camera(tmp_path, c) for c in (NEAR, FAR)])
    (picture,) = spot_pictures.spot_pictures(data, floor, spots=[(1, at)])  # type: ignore[arg-type]
    x0, y0, x1, y1 = picture.shown.extent
    assert (x1 - x0) / (y1 - y0) == pytest.approx(16 / 9, rel=0.01)
    if picture.camera_id is None:
        assert picture.across_m == pytest.approx(x1 - x0)
        u, v, lowest = *at, 0.1
    else:
        planted = {c.camera_id: c for c in (NEAR, FAR)}[picture.camera_id]
        (u,), (v,), _ = planted.project(*(np.array([c]) for c in (*at, 0.0)))
        left, right = to_floor(planted.homography, [(x0, v), (x1, v)], picture_px=(WIDTH_PX, HEIGHT_PX))
        lowest = spot_pictures.EDGE_SHARE
        assert picture.across_m == pytest.approx(float(np.hypot(*(right - left))), rel=0.03)
        assert picture.across_m >= spot_pictures.ACROSS_M * 0.97
    assert lowest <= (u - x0) / (x1 - x0) <= 1 - lowest
    assert lowest <= (v - y0) / (y1 - y0) <= 1 - lowest


def test_a_spot_at_the_edge_of_every_picture_is_shown_on_the_floor(tmp_path: Path) -> None:
    at = (5.0, 12.6)  # the near camera's picture ends just behind it
    x, y = np.meshgrid(np.arange(60) * 0.25 + 0.125, np.arange(60) * 0.25 + 0.125)
    hill = np.clip(6 * (1 - np.hypot(x - at[0], y - at[1]) / 1.2), 0, None)
    made = heat_bands(hill, cell_m=0.25, origin_m=(0.0, 0.0), steps=(0.5, 1.0, 2.0, 4.0))
    data = Data([camera(tmp_path, NEAR)])
    assert spot_pictures.spot_picture(data, made, number=1, at=at) is None  # type: ignore[arg-type]
    spot = MapSpot(number=1, name="End", at=at)
    floor = FloorMap(kind="floor", title="F", extent=(0.0, 0.0, 15.0, 15.0), bands=made, spots=(spot,))
    picture = spot_pictures.floor_picture(floor, number=1, at=at)
    x0, y0, x1, y1 = picture.shown.extent
    assert picture.camera_id is None
    assert picture.shown.spots == (spot,)
    for ring in (p[0] for band in picture.shown.bands for p in band.polygons):
        assert all(x0 <= a <= x1 and y0 <= b <= y1 for a, b in ring)
    assert y1 <= 15.0 + spot_pictures.BESIDE_M


# the picture itself ---------------------------------------------------------------------------------------------------


def decoded(uri: str) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(base64.b64decode(uri.split(",")[1]), np.uint8), cv2.IMREAD_GRAYSCALE))


def test_a_scene_is_cut_toned_and_small(tmp_path: Path) -> None:
    scene = np.full((720, 1280), 60, dtype=np.uint8)
    scene[:, 640:] = 200
    cv2.imwrite(str(tmp_path / "s.png"), scene)
    part = decoded(scene_image(tmp_path / "s.png", cut=(640, 0, 1280, 360), of_px=(1280, 720)))
    assert part.shape == (360, 640)
    assert part.mean() == pytest.approx(200 * SCENE_TONE, abs=2)
    half = decoded(scene_image(tmp_path / "s.png", cut=(0, 0, 320, 180), of_px=(640, 360)))
    assert half.mean() == pytest.approx(60 * SCENE_TONE, abs=2), "a file of another size is cut in proportion"


def test_even_a_noisy_scene_fits(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (720, 1280), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "n.png"), noise)
    uri = scene_image(tmp_path / "n.png", cut=(0, 0, 1280, 720), of_px=(1280, 720), max_bytes=7000)
    assert len(base64.b64decode(uri.split(",")[1])) <= 7000
