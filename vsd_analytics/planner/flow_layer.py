"""How people move over the floor, as a layer of the planner's map: desire lines between areas, and walking directions.

Both are of the whole week, as the report draws them (M37, M42): at least `mask_below` people in each line and arrow,
and nothing over floor that no camera recorded.
"""

from __future__ import annotations

from dataclasses import dataclass

from vsd_analytics.answer import Answers
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.report.draw.floor_frame import Frame
from vsd_analytics.report.draw.flow_maps import WIDTHS, direction_paths, line_paths, width_steps
from vsd_analytics.report.pages.map_figures import arrows_of, cell_side_m, lines_of, rows_of
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

MAP_PX = 900
"""Width of the map on a screen, nearly; lines are as wide there as in a small drawing of the report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowLine:
    """People who go from an area to another.

    Attributes:
        start, end: Ids of the two places on the page.
        path: To fill.
    """

    start: str
    end: str
    path: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowLayer:
    """What can be laid over the map.

    Attributes:
        lines: Desire lines, widest first.
        lines_legend: What their width means.
        arrows: Width on the screen in pixels, and the path to stroke.
        arrows_legend: What an arrow is.
    """

    lines: tuple[FlowLine, ...]
    lines_legend: str
    arrows: tuple[tuple[float, str], ...]
    arrows_legend: str


def flow_layer(answers: Answers, floor: FloorMap, frame: Frame, *, least: int, distance_unit: str) -> FlowLayer | None:
    """Return the layer; None where nobody asks for it or nothing is known.

    Args:
        answers: Answers on how the space is used.
        floor: The map it lies on.
        frame: The drawing.
        least: People of the least arrow.
        distance_unit: "m" or "ft".
    """
    between, cells = rows_of(answers, "flow"), rows_of(answers, "walking_directions")
    unit = frame.width / MAP_PX
    drawn = [(line, path) for line, path in line_paths(floor, lines_of(between), frame, unit=unit) if path]
    lines = tuple(FlowLine(start=f"area:{i.start}", end=f"area:{i.end}", path=path) for i, path in drawn)
    arrows, arrows_legend = arrows_of(cells), ""
    paths: tuple[tuple[float, str], ...] = ()
    if arrows:
        cell_m = cell_side_m(cells)
        arrow_paths = direction_paths(floor, arrows, frame, cell_m=cell_m, unit=unit)
        paths = tuple((wide, path) for wide, path in zip(WIDTHS, arrow_paths, strict=True) if path)
        cell = fmt.distance(cell_m, distance_unit)
        widest = fmt.count(round(width_steps(arrows)[-1]))
        arrows_legend = say("planner.use.arrows_legend", cell=cell, least=fmt.count(least), widest=widest)
    if not lines and not paths:
        return None
    top = fmt.number(drawn[0][0].per_open_h) if drawn else ""
    return FlowLayer(
        lines=lines,
        lines_legend=say("planner.use.lines_legend", n=top) if drawn else "",
        arrows=paths,
        arrows_legend=arrows_legend,
    )
