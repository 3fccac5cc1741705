"""The floor as the drawing of the planner's page: plan, areas, fixtures, hotspots, and layers over the map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from vsd_analytics.figures.hotspots import FloorSpot
from vsd_analytics.figures.share.counts import mask_of
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.planner.flow_layer import FlowLayer, flow_layer
from vsd_analytics.planner.layouts import FixtureLabel, drawn_fixtures
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.report.draw.floor_frame import Frame
from vsd_analytics.report.draw.svg import smooth_path, straight_path

UNIT: Final = 100
"""Units of the drawing in a metre of floor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A text on the floor, in units of the drawing."""

    text: str
    x: int
    y: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerDrawing:
    """The floor as the page's SVG, in units of the drawing, y down."""

    width: int
    height: int
    image: str | None
    image_box: tuple[int, int, int, int]
    is_paper: bool
    unseen: str
    bands: tuple[str, ...]
    areas: tuple[tuple[str, str], ...]
    fixtures: tuple[Markup, ...]
    fixture_names: tuple[FixtureLabel, ...]
    hotspots: tuple[tuple[str, str, Label], ...]
    labels: tuple[Label, ...]
    flow: FlowLayer | None


def frame_of(shown: FloorMap) -> Frame:
    """Return the frame of the drawing of a map."""
    x0, y0, x1, y1 = shown.extent
    return Frame(shown, width=(x1 - x0) * UNIT, height=(y1 - y0) * UNIT)


def drawing_of(data: PlannerData) -> PlannerDrawing:
    """Return the drawing of a floor that has a map."""
    shown, settings = data.shown, data.site.settings
    assert shown is not None
    x0, y0, x1, y1 = shown.extent
    width, height = round((x1 - x0) * UNIT), round((y1 - y0) * UNIT)
    frame = frame_of(shown)
    bands = {b.lower: smooth_path(frame.rings(b.polygons)) for b in shown.bands}
    box = (0, 0, 0, 0)
    if shown.image is not None:
        left, top = frame.at((shown.image.extent[0], shown.image.extent[3]))
        right, bottom = frame.at((shown.image.extent[2], shown.image.extent[1]))
        box = (round(left), round(top), round(right - left), round(bottom - top))
    spots = []
    for spot in data.hotspots.spots:
        x, y = frame.at((spot.place.x_m, spot.place.y_m))
        outline = straight_path(frame.rings(spot.place.polygons))
        spots.append((spot_id(spot), outline, Label(text=str(spot.number), x=round(x), y=round(y))))
    labels = []
    for area in shown.areas:
        ring = frame.ring(area.ring)
        x, y = min(p[0] for p in ring), min(p[1] for p in ring)
        if 0 <= x < width and 0 <= y < height:
            labels.append(Label(text=area.name, x=round(x), y=round(y)))
    fixtures, names = drawn_fixtures(data.layouts or (shown.fixtures,), frame)
    return PlannerDrawing(
        width=width,
        height=height,
        image=None if shown.image is None else shown.image.data_uri,
        image_box=box,
        is_paper=shown.image is not None and shown.image.is_opaque,
        unseen=straight_path(frame.rings(shown.unseen)),
        bands=tuple(bands.get(step, "") for step in data.site.settings.heat_steps),
        areas=tuple((_area_place(a.area_id), straight_path([frame.ring(a.ring)])) for a in shown.areas),
        fixtures=fixtures,
        fixture_names=names,
        hotspots=tuple(spots),
        labels=tuple(labels),
        flow=flow_layer(data.space, shown, frame, least=mask_of(data.site).below, distance_unit=settings.distance_unit),
    )


def _area_place(area_id: str | None) -> str:
    return "rest" if area_id is None else f"area:{area_id}"


def spot_id(spot: FloorSpot) -> str:
    """Return the id of a hotspot on the page."""
    return f"spot:{spot.number}"
