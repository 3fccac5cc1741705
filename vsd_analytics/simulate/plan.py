"""The floor plan of the made-up shop as SVG; one user unit is one plan pixel."""

from __future__ import annotations

from html import escape

from vsd_analytics.simulate.shop import DEPTH_M, DISPLAY_BEFORE, DOOR, WIDTH_M, Rect, Shop

M_PER_PX = 0.025

_FILLS = {
    "room": "#f0ede6",
    "shelf": "#dcd7cc",
    "till": "#dcd7cc",
    "counter": "#dcd7cc",
    "display": "#ffffff",
    "trolleys": "#f0ede6",
}


def plan_svg(shop: Shop) -> str:
    """Return the plan: walls, rooms, shelves, tills, the display and its old place, the door, labels.

    Args:
        shop: The shop as it stands now.
    """
    width, depth = WIDTH_M / M_PER_PX, DEPTH_M / M_PER_PX
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{depth:g}" '
        f'viewBox="0 0 {width:g} {depth:g}">',
    ]
    if shop.display != DISPLAY_BEFORE:
        parts.append(_rect(DISPLAY_BEFORE, 'fill="none" stroke="#8b8577" stroke-width="1.5" stroke-dasharray="3 4"'))
        parts.append(_label(DISPLAY_BEFORE, "Old place", 9.5))
    for fixture in shop.fixtures:
        stroke = "#4a4f57" if fixture.kind in {"room", "display"} else "#a39d90"
        line = 4 if fixture.kind == "room" else 1.5
        parts.append(_rect(fixture.rect, f'fill="{_FILLS[fixture.kind]}" stroke="{stroke}" stroke-width="{line}"'))
        if fixture.label:
            tall = fixture.kind == "room" and fixture.rect[2] - fixture.rect[0] < 2
            parts.append(_label(fixture.rect, fixture.label, 12, upright=tall))
    for number, x in enumerate((4.4 + 2.75, 7.9 + 2.75, 11.4 + 2.75), start=1):
        parts.append(_label((x - 0.5, 6.9, x + 0.5, 7.3), f"Aisle {number}", 12))
    left, right = DOOR[0] / M_PER_PX, DOOR[2] / M_PER_PX
    wall = f"M{left:g} {depth - 2:g}H2V2H{width - 2:g}V{depth - 2:g}H{right:g}"
    parts.append(f'<path d="{wall}" fill="none" stroke="#4a4f57" stroke-width="4"/>')
    parts.append(_label((DOOR[0], 0.0, DOOR[2], 0.7), "Door", 12))
    return "\n".join([*parts, "</svg>", ""])


def _rect(rect: Rect, style: str) -> str:
    x0, y0, x1, y1 = rect
    x, y, w, h = x0 / M_PER_PX, (DEPTH_M - y1) / M_PER_PX, (x1 - x0) / M_PER_PX, (y1 - y0) / M_PER_PX
    return f'<rect x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" {style}/>'


def _label(rect: Rect, text: str, size_px: float, *, upright: bool = False) -> str:
    x, y = (rect[0] + rect[2]) / 2 / M_PER_PX, (DEPTH_M - (rect[1] + rect[3]) / 2) / M_PER_PX
    turn = f' transform="rotate(-90 {x:g} {y:g})"' if upright else ""
    return (
        f'<text x="{x:g}" y="{y + size_px / 3:g}" font-family="sans-serif" font-size="{size_px:g}" '
        f'text-anchor="middle" fill="#525d68"{turn}>{escape(text)}</text>'
    )
