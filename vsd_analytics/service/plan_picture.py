"""The plan of a floor to point at: where a click on it is in floor metres, and the corners that were pointed at."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from typing import Final

from markupsafe import Markup

from vsd_analytics.figures.week.model_map import Extent, FloorMap
from vsd_analytics.report.draw.bare_floor import bare_floor
from vsd_analytics.report.draw.cell_map import HEIGHT_MAX, WIDTH, floor_ink
from vsd_analytics.report.draw.floor_frame import Frame
from vsd_analytics.report.draw.svg import ACCENT, MUTED, RULE, WHITE, Look, el, straight_path
from vsd_analytics.site.model import Floor, Point, Site

MARGIN_M: Final = 1.0
GRID_STEPS_M: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
GRID_LINES_MAX: Final = 12
CORNERS_MAX: Final = 40
_CORNER: Final = re.compile(r"(-?\d{1,5}(?:\.\d{1,3})?)\s*,\s*(-?\d{1,5}(?:\.\d{1,3})?)")


class PlanPicture:
    """The plan of a floor as a picture with a grid of metres.

    Args:
        site: The site.
        floor: The floor.
        day: Local day whose fixtures are shown.
    """

    def __init__(self, site: Site, floor: Floor, *, day: date) -> None:
        shown = bare_floor(site, floor, until=day, extent=_extent(site, floor))
        left = {a.area_id for a in site.areas if a.end_day is not None and a.end_day <= day}
        self._shown: FloorMap = replace(shown, areas=tuple(a for a in shown.areas if a.area_id not in left))
        self._frame = Frame(self._shown, width=WIDTH, height=HEIGHT_MAX)

    def height_px(self, width_px: int) -> int:
        """Return how high it is where it is so wide."""
        return round(width_px * self._frame.height / self._frame.width)

    def place_m(self, click_px: tuple[int, int], *, width_px: int) -> Point | None:
        """Return where a click is, to 0.1 m; None where it is none: the keyboard clicks at 0, 0."""
        if click_px == (0, 0):
            return None
        unit = self._frame.width / width_px / self._frame.scale
        return round(self._frame.x0 + click_px[0] * unit, 1), round(self._frame.y1 - click_px[1] * unit, 1)

    def uri(self, corners: Sequence[Point]) -> str:
        """Return the picture with the corners of a place, as a data address."""
        frame = self._frame
        rings = [frame.at(corner) for corner in corners]
        lines, numbers = self._grid()
        parts = [el("rect", fill=WHITE, **frame.whole), *lines, floor_ink(self._shown), *numbers]
        if len(rings) > 1:
            path = straight_path([rings]) if len(rings) > 2 else f"M{_pair(rings[0])}L{_pair(rings[1])}"
            parts.append(el("path", fill=ACCENT, fill_opacity=0.22, stroke=ACCENT, stroke_width=3, d=path))
        dot: Look = {"fill": ACCENT, "stroke": WHITE, "stroke_width": 2, "r": 7}
        parts += [el("circle", **dot, cx=round(x), cy=round(y)) for x, y in rings]
        svg = el(
            "svg", Markup("").join(parts), xmlns="http://www.w3.org/2000/svg",
            viewBox=f"0 0 {frame.width} {frame.height}", width=frame.width, height=frame.height,
        )  # fmt: skip
        return f"data:image/svg+xml;base64,{base64.b64encode(str(svg).encode()).decode()}"

    def _grid(self) -> tuple[list[Markup], list[Markup]]:
        """Draw lines of whole metres, and the number of each at the left and lower edge."""
        frame = self._frame
        x0, y0, x1, y1 = self._shown.extent
        widest = max(x1 - x0, y1 - y0)
        step = next((s for s in GRID_STEPS_M if widest / s <= GRID_LINES_MAX), GRID_STEPS_M[-1])
        xs = {k * step: round(frame.at((k * step, y0))[0]) for k in range(math.ceil(x0 / step), int(x1 // step) + 1)}
        ys = {k * step: round(frame.at((x0, k * step))[1]) for k in range(math.ceil(y0 / step), int(y1 // step) + 1)}
        paths = [*(f"M{x} 0V{frame.height}" for x in xs.values()), *(f"M0 {y}H{frame.width}" for y in ys.values())]
        look: Look = {"fill": MUTED, "font_size": 13, "stroke": WHITE, "stroke_width": 3, "paint_order": "stroke"}
        numbers = [el("text", f"{m}", **look, x=x + 3, y=frame.height - 4) for m, x in xs.items()]
        numbers += [el("text", f"{m}", **look, x=3, y=y - 3) for m, y in ys.items()]
        return [el("path", stroke=RULE, stroke_width=1, d="".join(paths))], numbers


def corners_of(text: str) -> tuple[Point, ...]:
    """Return the corners that a field names: "2,7 3,7 3,8" or "2,7; 3,7; 3,8".

    Raises:
        ValueError: Something in it is no corner.
    """
    left = _CORNER.sub("", text)
    if left.strip(" ;\t\r\n"):
        raise ValueError(f"{left.strip()[:40]!r} is no corner")
    return tuple((float(x), float(y)) for x, y in _CORNER.findall(text))[:CORNERS_MAX]


def corners_text(corners: Sequence[Point]) -> str:
    """Return corners as a field has them."""
    return " ".join(f"{x:g},{y:g}" for x, y in corners)


def _extent(site: Site, floor: Floor) -> Extent:
    """Return the box around everything that is known of a floor without a plan."""
    rings = [a.polygon for a in site.areas if a.floor_id == floor.floor_id]
    rings += [f.polygon for f in site.fixtures if f.floor_id == floor.floor_id]
    rings += [c.view for c in site.cameras if c.floor_id == floor.floor_id and c.view]
    xs, ys = ([corner[axis] for ring in rings for corner in ring] or [0.0, 10.0] for axis in (0, 1))
    return min(xs) - MARGIN_M, min(ys) - MARGIN_M, max(xs) + MARGIN_M, max(ys) + MARGIN_M


def _pair(point: Point) -> str:
    return f"{point[0]:.1f} {point[1]:.1f}"
