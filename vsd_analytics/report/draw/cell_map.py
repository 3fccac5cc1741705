"""A map of cells as inline SVG: colours of the report on a floor's plan, bare floor or a camera's picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from vsd_analytics.figures.week.model_map import FloorMap, Ring
from vsd_analytics.report.draw import floor_frame as draw
from vsd_analytics.report.draw.area_names import area_names
from vsd_analytics.report.draw.floor_frame import Frame
from vsd_analytics.report.draw.svg import BAR, INK, MUTED, RAMP_LIGHT, WHITE, Look, el, straight_path
from vsd_analytics.wording import format as fmt

WIDTH, HEIGHT_MAX, LEGEND_HEIGHT = 720, 640, 54
LOW: Final = "#efece4"
"""Colour of a known cell below the lowest step."""


@dataclass(frozen=True, slots=True)
class MapCell:
    """One known cell.

    Attributes:
        ring: Its corners, in the unit of the map.
        value: Its value.
    """

    ring: Ring
    value: float


def doubling_steps(values: NDArray[np.float64]) -> tuple[float, ...]:
    """Return the lower ends of five classes, each twice the one before; the highest holds the top 3 % of the values.

    Args:
        values: Any shape; NaN where nothing is known.
    """
    known = values[np.isfinite(values) & (values > 0)]
    top = float(np.percentile(known, 97)) if known.size else 1.0
    return tuple(float(f"{top / 2**k:.2g}") for k in range(len(RAMP_LIGHT) - 1, -1, -1))


def cell_map(
    shown: FloorMap, cells: Sequence[MapCell], *, steps: Sequence[float], unit: str, label: str, name: str
) -> Markup:
    """Draw cells in the colour of their class, below the plan's ink and the fixtures, with a legend.

    Args:
        shown: The floor or picture; its bands are not drawn.
        cells: The known cells; all others stay bare.
        steps: Lower ends of the five classes.
        unit: Of the values, for the legend.
        label: Text alternative.
        name: Begins the ids in the drawing, so that two drawings on a page do not share them.
    """
    frame = Frame(shown, width=WIDTH, height=HEIGHT_MAX)
    image = None if shown.image is None else draw.image(shown.image, frame)
    drawn = [draw.ground(frame)]
    if image is not None and not frame.is_metric:
        drawn.append(image)
    values = np.array([cell.value for cell in cells])
    class_of = np.searchsorted(np.asarray(steps), values, side="right")
    opacity = None if frame.is_metric else "0.75"
    for k, colour in enumerate((LOW, *RAMP_LIGHT)):
        rings = [frame.ring(cells[i].ring) for i in np.flatnonzero(class_of == k).tolist()]
        if rings:
            drawn.append(el("path", fill=colour, fill_opacity=opacity, d=straight_path(rings)))
    if frame.is_metric:
        drawn += [] if image is None else [image]
        drawn += _things(shown, frame)
    clip = el("clipPath", el("rect", **frame.whole), id=f"{name}-clip")
    edge = el("rect", fill="none", stroke=BAR, stroke_width=1.5, **frame.whole)
    inside = el("g", Markup("").join(drawn), clip_path=f"url(#{name}-clip)")
    body = Markup("").join([el("defs", clip), inside, edge, _legend(steps, unit, y=frame.height + 10)])
    return _svg(body, box=(frame.width, frame.height + LEGEND_HEIGHT), label=label)


def floor_ink(shown: FloorMap) -> Markup:
    """Draw what lies over the heat of a floor, on clear ground: the plan's ink, fixtures, outlines of areas."""
    frame = Frame(shown, width=WIDTH, height=HEIGHT_MAX)
    image = [] if shown.image is None else [draw.image(shown.image, frame)]
    return _svg(Markup("").join([*image, *_things(shown, frame)]), box=(frame.width, frame.height), label=shown.title)


def _things(shown: FloorMap, frame: Frame) -> list[Markup]:
    """Draw the fixtures, and the areas as dashed outlines; each is named where it has room."""
    things = draw.fixtures(shown.fixtures, frame)
    look: Look = {"fill": "none", "stroke": MUTED, "stroke_width": 1.4}
    for area in shown.areas:
        things.append(el("path", **look, stroke_dasharray="3 4", d=straight_path([frame.ring(area.ring)])))
    size = draw.FONT - 2
    halo: Look = {"stroke": WHITE, "stroke_width": 3, "paint_order": "stroke"}
    for name in area_names(shown.areas, shown.fixtures, frame, sizes={float(size): float(draw.FONT_FIXTURE)}):
        things.append(el("text", name.text, fill=INK, font_size=size, x=round(name.x), y=round(name.y), **halo))
    return things


def _legend(steps: Sequence[float], unit: str, *, y: float) -> Markup:
    parts, x = [], 0.0
    for colour, step in zip((LOW, *RAMP_LIGHT), (None, *steps), strict=True):
        words = f"under {fmt.number(steps[0])}" if step is None else f"from {fmt.number(step)}"
        parts.append(el("rect", fill=colour, stroke=BAR, stroke_width=0.5, x=x, y=y, width=14, height=14))
        parts.append(el("text", words, fill=INK, font_size=12, x=x + 18, y=y + 12))
        x += 28 + draw.text_width(words, 12)
    parts.append(el("text", unit, fill=MUTED, font_size=12, x=0, y=y + 32))
    return Markup("").join(parts)


def _svg(body: Markup, *, box: tuple[float, float], label: str) -> Markup:
    width, height = (round(side) for side in box)
    return el(
        "svg",
        body,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {width} {height}",
        width=width,
        height=height,
        role="img",
        aria_label=label,
        font_family="DejaVu Sans, Helvetica, Arial, sans-serif",
        style="max-width:100%;height:auto",
    )
