"""Floor on which a calibration states too uncertain distances: dotted, not coloured; and the error on spot cards."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path

import pytest
import shapely
from report import ingested_worlds as w

from vsd_analytics.config import load_site
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.geometry.calibration_files import calibration_id, read_matrix
from vsd_analytics.report.draw.floor_plan import floor_map
from vsd_analytics.report.draw.svg import INK, WHITE
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.story import finish
from vsd_analytics.report.pages.week import render_html

FAR_M = 6.0
"""Beyond this y, the sd of a distance of 2 m is 1.4 m; it is 0.4 m before."""


def state_error(folder: Path, *, camera_id: str, far_sd_m: float) -> None:
    """Write a matrix of one centimetre a pixel and, beside it, what a calibration from people states."""
    matrix = folder / "calibration" / f"{camera_id}.txt"
    matrix.parent.mkdir(exist_ok=True)
    matrix.write_text("0.01 0 0\n0 0.01 0\n0 0 1\n")
    cells = [(x + 0.5, y + 0.5, far_sd_m if y >= FAR_M else 0.4, 0.1) for x in range(20) for y in range(12)]
    content = {"calibration_id": calibration_id(read_matrix(matrix)), "map": cells}
    (matrix.parent / f"{camera_id}-from-people.json").write_text(json.dumps(content))
    (matrix.parent / f"{camera_id}.toml").write_text(f'[[calibration]]\nhomography = "calibration/{matrix.name}"\n')


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a floor with violations at the queue, near, and in the aisle, far from the camera. Tests copy it."""
    config = w.toml(camera="view = [[0, 0], [20, 0], [20, 12], [0, 12]]\n", site="distance_m = 2.0\n")
    counts = w.steady({w.QUEUE: 20, w.AISLE: 30})
    streams = w.messages(counts, monday=w.BEFORE), w.messages(counts)
    return w.world(tmp_path_factory.mktemp("stored"), config, *streams).root


def report(root: Path) -> WeekReport:
    return finish(w.report(load_site(root)))


@pytest.fixture(scope="module")
def unstated(stored: Path) -> WeekReport:
    return report(stored)


@pytest.fixture(scope="module")
def stated(stored: Path, unstated: WeekReport, tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    return report(with_error(stored, tmp_path_factory.mktemp("stated"), far_sd_m=1.4))


def with_error(stored: Path, folder: Path, *, far_sd_m: float) -> Path:
    """Return a copy of the floor, with its facts, whose camera's calibration states an error."""
    root = Path(shutil.copytree(stored, folder / "shop"))
    state_error(root, camera_id="cam-1", far_sd_m=far_sd_m)
    return root


def floor_of(polygons: tuple[tuple[tuple[tuple[float, float], ...], ...], ...]) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in polygons])


AISLE = shapely.Point(w.AISLE[0] + 0.75, w.AISLE[1])
QUEUE = shapely.Point(w.QUEUE[0] + 0.75, w.QUEUE[1])


def test_floor_with_uncertain_distances_is_dotted_and_not_coloured(stated: WeekReport) -> None:
    dotted = floor_of(stated.maps[0].uncertain)
    assert dotted.contains(AISLE)
    assert not dotted.contains(QUEUE)
    assert dotted.bounds[1] == FAR_M
    coloured = floor_of(stated.maps[0].bands[0].polygons)
    assert coloured.contains(QUEUE)
    assert not coloured.intersects(AISLE)


def test_the_page_says_what_dots_mean(stated: WeekReport) -> None:
    page = render_html(stated)
    assert 'fill="url(#dot0)"' in page
    text = re.sub(r"<[^>]+>", " ", page)
    assert "Too far from the camera to tell: distances uncertain by more than 1 m" in text
    assert "On the dotted floor distances are too uncertain to tell." in page


def test_floor_without_a_stated_error_is_coloured_as_before(stored: Path, unstated: WeekReport, tmp_path: Path) -> None:
    assert unstated.maps[0].uncertain == ()
    assert floor_of(unstated.maps[0].bands[0].polygons).contains(AISLE)
    page = render_html(unstated)
    assert "dotted floor" not in page
    assert "Too far from the camera" not in page
    certain = report(with_error(stored, tmp_path, far_sd_m=0.9))
    assert certain.maps[0].uncertain == ()
    assert certain.maps[0].bands == unstated.maps[0].bands


def test_the_change_of_uncertain_floor_is_not_drawn_either(stated: WeekReport, unstated: WeekReport) -> None:
    assert stated.change_maps is not None
    assert unstated.change_maps is not None
    assert not floor_of(stated.change_maps.now[0].polygons).intersects(AISLE)
    assert floor_of(unstated.change_maps.now[0].polygons).contains(AISLE)


def test_the_card_of_a_spot_has_the_error_at_that_spot(stated: WeekReport, unstated: WeekReport) -> None:
    assert stated.spots is not None
    card = next(c for c in stated.spots.cards if c.area_id == "queue")
    assert card.evidence is not None
    assert card.evidence.error_m == pytest.approx(0.4 / math.sqrt(2))
    assert "positions accurate to 0.28 m" in render_html(stated)
    assert "position error not known" in render_html(unstated)


def test_error_of_another_matrix_is_not_taken(stored: Path, unstated: WeekReport, tmp_path: Path) -> None:
    root = with_error(stored, tmp_path, far_sd_m=1.4)
    path = root / "calibration" / "cam-1-from-people.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"calibration_id": "00000000"}))
    assert report(root).maps[0].bands == unstated.maps[0].bands


def test_dots_on_a_picture_are_white_with_a_dark_edge(stated: WeekReport) -> None:
    square = ((((100.0, 100.0), (300.0, 100.0), (300.0, 200.0), (100.0, 200.0)),),)
    shown = FloorMap(kind="picture", title="Door", extent=(0, 0, 640, 480), uncertain=square)
    drawing = floor_map(shown, index=3, rules=stated.rules, label="Door")
    dot = drawing[drawing.index('id="dot3"') : drawing.index("</pattern>", drawing.index('id="dot3"'))]
    assert f'fill="{WHITE}"' in dot
    assert f'stroke="{INK}"' in dot
    assert 'fill="url(#dot3)"' in drawing
