"""The maps beside the week's own, from planted worlds: changes, footsteps, views, pictures of spots."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import shapely
from report import ingested_worlds as w

from vsd_analytics.figures.week.areas import areas
from vsd_analytics.figures.week.change_maps import change_maps
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.floor_maps import floor_extent
from vsd_analytics.figures.week.footsteps_and_views import footsteps, views
from vsd_analytics.figures.week.model_map import ChangeMaps, Extent, Footsteps, MapBand, MapViews
from vsd_analytics.report.draw import small_maps
from vsd_analytics.report.draw.floor_plan import floor_map
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.map_figures import map_figures
from vsd_analytics.report.pages.spot_cards import spot_scene
from vsd_analytics.simulate.cameras import PinholeCamera
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import open_warehouse

SHELF = (
    '[[fixture]]\nid = "shelf"\nname = "Shelf <1>"\nfloor = "ground"\n'
    "polygon = [[1, 4], [5, 4], [5, 4.6], [1, 4.6]]\nheight_m = 1.6\n"
)
MONDAYS = (w.BEFORE, w.MONDAY)
HOURS, OPENING = (9, 10), '{ mon-sun = "09:00-10:00" }'
CAMERAS = {
    "cam-1": PinholeCamera("cam-1", "Near", 3.75, -3.0, 3.2, 90.0),
    "cam-2": PinholeCamera("cam-2", "Far", 3.75, 14.0, 4.0, -90.0, tilt_deg=30.0),
}


def busy(day: int, hour: int) -> dict[w.Place, int]:
    return {w.QUEUE: 30 + 2 * (day % 3), w.DOOR: 40 + day % 4}


def moved(day: int, hour: int) -> dict[w.Place, int]:
    return {w.QUEUE: 45 + 2 * (day % 3), w.DOOR: 8 + day % 4}


def shapes(bands: tuple[MapBand, ...]) -> list[Any]:
    return [shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in b.polygons]) for b in bands]


def calibrated(folder: Path, *names: str) -> str:
    """Write calibrations and pictures, and return lines for `[[camera]]` tables (all the same files: one camera)."""
    for name in names:
        rows = "\n".join(" ".join(f"{v:.10g}" for v in row) for row in CAMERAS[name].homography)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.txt").write_text(rows + "\n")
        scene = np.tile(np.linspace(40, 220, 1280).astype(np.uint8), (720, 1))
        cv2.imwrite(str(folder / f"{name}.png"), scene)
    return f'homography = "{names[0]}.txt"\npicture = "{names[0]}.png"'


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    folder = tmp_path_factory.mktemp("maps")
    config = w.toml(cameras=("cam-1", "cam-2"), camera=calibrated(folder, "cam-1"), opening=OPENING, more=SHELF)
    nobody = [w.messages(lambda d, h: {}, monday=m, hours=HOURS, camera="cam-2", is_alone=False) for m in MONDAYS]
    streams = [w.messages(busy, monday=w.BEFORE, hours=HOURS), w.messages(moved, hours=HOURS), *nobody]
    return w.report(w.world(folder, config, *streams))


@dataclass(frozen=True)
class Maps:
    """The maps beside the week's own, made without the rest of its report."""

    change: ChangeMaps | None
    steps: Footsteps | None
    views: MapViews | None
    extent: Extent


def maps_of(site: Site) -> Maps:
    with open_warehouse(site, w.BEFORE, w.MONDAY + timedelta(days=6)) as warehouse:
        data = WeekData(warehouse, floor=site.floors[0], monday=w.MONDAY)
        extent = floor_extent(data)
        assert extent is not None
        return Maps(
            change=change_maps(data, areas=areas(data, is_compared=True, rest="Rest").rows),
            steps=footsteps(data, extent=extent),
            views=views(data, extent=extent, labels={}),
            extent=extent,
        )


# changes --------------------------------------------------------------------------------------------------------------


def test_the_difference_lies_where_it_was_planted(report: WeekReport) -> None:
    shown = report.change_maps
    assert shown is not None
    assert [b.lower for b in shown.fewer] == [1.0, 3.0]
    fewer, more = shapes(shown.fewer), shapes(shown.more)
    door, queue = (shapely.Point(p[0] + 0.75, p[1]) for p in (w.DOOR, w.QUEUE))  # the middle of a pair
    assert all(s.contains(door) and not s.contains(queue) for s in fewer)
    assert all(s.contains(queue) and not s.contains(door) for s in more)
    assert fewer[0].contains(fewer[1])
    title = map_figures(report).change
    assert title is not None
    assert title.title == "Fewer at Door, more at Queue"


def test_what_changed_at_a_place_is_what_was_planted(report: WeekReport) -> None:
    assert report.change_maps is not None
    places = {p.name: (p.fewer, p.more) for p in report.change_maps.places}
    days = np.arange(7)
    fewer = np.mean((40 + days % 4) - (8 + days % 4))
    assert places["Door"] == (pytest.approx(fewer, rel=0.1), 0)
    assert places["Queue"] == (0, pytest.approx(15, rel=0.1))


def test_hours_of_one_week_only_change_nothing(tmp_path: Path) -> None:
    """The queue is busy on Sunday, which only this week recorded: per hour it is busier, over the same hours not."""

    def sunday(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 80 if day == 6 else 20}

    streams = [w.messages(sunday, monday=w.BEFORE, days=range(6), hours=HOURS), w.messages(sunday, hours=HOURS)]
    shown = maps_of(w.world(tmp_path, w.toml(opening=OPENING), *streams)).change
    assert shown is not None
    assert (shown.fewer, shown.more) == ((), ())
    assert shown.hours_compared == pytest.approx(6, abs=0.1)
    assert shapes(shown.before)[0].equals(shapes(shown.now)[0])


def test_a_few_violations_more_are_not_shown(tmp_path: Path) -> None:
    def few(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 30, w.DOOR: 4 if (day, hour) == (0, 9) else 0}

    streams = [
        w.messages(lambda d, h: {w.QUEUE: 30}, monday=w.BEFORE, days=range(1), hours=HOURS),
        w.messages(few, days=range(1), hours=HOURS),
    ]
    site = w.world(tmp_path, w.toml(opening=OPENING), *streams)
    shown = maps_of(site).change
    assert shown is not None
    assert shown.more == ()
    free = replace(site, settings=site.settings.with_values({"mask_below": 2}))
    exact = maps_of(free).change
    assert exact is not None
    assert exact.more != (), "the four are enough to colour floor"


def test_without_a_week_before_and_without_views_there_is_nothing_to_draw(tmp_path: Path) -> None:
    found = w.report(w.world(tmp_path, w.toml(opening=OPENING), w.messages(busy, hours=HOURS)))
    assert (found.change_maps, found.views) == (None, None)
    figures = map_figures(found)
    assert (figures.change, figures.views) == (None, None)


def test_each_changed_patch_has_its_sign_inside_it(report: WeekReport) -> None:
    assert report.change_maps is not None
    floor = report.maps[0]
    drawing = str(small_maps.mini_change(floor, report.change_maps, name="x", label="d"))
    signs = re.findall(r'<path class="sg[^"]*"[^>]* d="M([\d.]+) ([\d.]+)h([\d.]+)(M[^"]*)?"', drawing)
    kinds = [("fewer", False)] * len(report.change_maps.fewer[0].polygons)
    kinds += [("more", True)] * len(report.change_maps.more[0].polygons)
    assert [bool(plus) for *_, plus in signs] == [is_plus for _, is_plus in kinds]
    frame = small_maps.mini_frame(floor)
    for (x, y, length, _), (kind, _) in zip(signs, kinds, strict=True):
        at = shapely.Point(float(x) + float(length) / 2, float(y))
        bands = getattr(report.change_maps, kind)
        assert any(s.buffer(0.5).contains(at) for s in small_maps._shapes(bands[0], frame))


# footsteps and views --------------------------------------------------------------------------------------------------


def test_footsteps_are_cells_where_enough_tracks_stood(report: WeekReport) -> None:
    steps = report.footsteps
    assert steps is not None
    cells = {(cx + k, cy) for cy, cx, n in steps.runs for k in range(n)}
    stood = {(int((x + s * 1.5) / 0.25), int(y / 0.25)) for x, y in (w.QUEUE, w.DOOR) for s in (0, 1)}
    assert stood <= cells


def test_a_cell_with_four_tracks_is_not_shown(tmp_path: Path) -> None:
    """Two pairs on two days and nobody else: four people in all in each cell, whatever their frames."""

    def few(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 2 if day in (0, 1) and hour == 9 else 0, w.DOOR: 5 if (day, hour) == (0, 9) else 0}

    site = w.world(tmp_path, w.toml(opening=OPENING), w.messages(few, days=range(2), hours=HOURS))
    steps = maps_of(site).steps
    assert steps is not None
    cells = {(cx + k, cy) for cy, cx, n in steps.runs for k in range(n)}
    assert (int(w.DOOR[0] / 0.25), int(w.DOOR[1] / 0.25)) in cells
    assert (int(w.QUEUE[0] / 0.25), int(w.QUEUE[1] / 0.25)) not in cells


def test_who_walks_at_night_makes_a_map_without_a_plan_no_larger(tmp_path: Path) -> None:
    at_night = w.messages(lambda day, hour: {(40.0, 2.0): 5}, days=range(1), hours=(2, 3))
    streams = [[w.messages(busy, days=range(1), hours=HOURS)] for _ in range(2)]
    streams[1].insert(0, at_night)
    by_day, with_night = (
        maps_of(w.world(tmp_path / name, w.toml(opening=OPENING), *messages)).extent
        for name, messages in zip(("day", "night"), streams, strict=True)
    )
    assert with_night == by_day
    assert by_day[2] < 40.0


def test_views_and_their_overlap_have_the_planted_sizes(tmp_path: Path) -> None:
    planted = {"cam-1": [[0, 0], [10, 0], [10, 6], [0, 6]], "cam-2": [[6, 0], [14, 0], [14, 6], [6, 6]]}
    config = w.toml(cameras=("cam-1", "cam-2"), opening=OPENING)
    for name, ring in planted.items():
        config = config.replace(f'name = "Camera {name[-1]}"\n', f'name = "Camera {name[-1]}"\nview = {ring}\n')
    maps = maps_of(w.world(tmp_path, config + SHELF, w.messages(busy, days=range(1), hours=HOURS)))
    found = maps.views
    assert found is not None
    whole = shapely.box(*maps.extent)
    shelf = shapely.box(1, 4, 5, 4.6)
    one, two = (shapely.Polygon(r).intersection(whole) for r in planted.values())
    assert [v.area_m2 for v in found.cameras] == pytest.approx([one.difference(shelf).area, two.area])
    assert found.shared_m2 == pytest.approx(one.intersection(two).area)
    floor = whole.difference(shelf)
    assert found.unseen_m2 == pytest.approx(floor.difference(one.union(two)).area)


# drawings -------------------------------------------------------------------------------------------------------------


def test_every_drawing_has_a_name_and_unique_ids_and_escapes_what_people_wrote(report: WeekReport) -> None:
    figures = map_figures(report)
    drawings = [p.drawing for f in (figures.change, figures.footsteps, figures.views) if f for p in f.panels]
    drawings += [spot_scene(report, p.number) for p in report.spot_pictures]
    assert len(drawings) >= 6
    ids = [i for d in drawings for i in re.findall(r' id="([^"]+)"', d)]
    assert len(ids) == len(set(ids))
    for drawing in drawings:
        assert re.match(r'<svg [^>]*role="img" aria-label="[^"]+"', drawing)
        assert "<1>" not in drawing
        cv2_free = re.sub(r'href="data:[^"]+"', "", drawing)
        assert "http" not in cv2_free
        for mark in re.findall(r"<path [^>]*>", drawing):
            assert "fill=" in mark, "literal colours, for mail and files"


def test_the_page_draws_fixtures_with_their_names_once(report: WeekReport) -> None:
    drawing = floor_map(report.maps[0], index=0, rules=report.rules, label="map")
    assert drawing.count("Shelf &lt;1&gt;") == 1
    assert all("Shelf" not in p.drawing for p in map_figures(report).change.panels)  # type: ignore[union-attr]


def test_same_report_same_drawings(report: WeekReport) -> None:
    assert map_figures(report) == map_figures(report)
    assert isinstance(report.generated_at, datetime)
