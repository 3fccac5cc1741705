"""The made-up shop as its site describes it: the building as an SVG plan, everything in it as fixtures."""

from __future__ import annotations

from vsd_analytics.config.reader import suggest_id
from vsd_analytics.simulate.shop import DEPTH_M, DOOR, WIDTH_M, Shop, polygon
from vsd_analytics.site.model import Fixture, FixtureKind

M_PER_PX = 0.025

_KINDS: dict[str, FixtureKind] = {
    "room": "wall",
    "shelf": "shelf",
    "counter": "shelf",
    "display": "shelf",
    "till": "till",
    "trolleys": "other",
}


def fixtures(shop: Shop) -> tuple[Fixture, ...]:
    """Return the fixtures of the shop as `vsd.toml` describes them.

    Args:
        shop: The shop as it is now.
    """
    return tuple(
        Fixture(suggest_id(f.label), f.label, "ground", polygon(f.rect), _KINDS[f.kind], f.is_movable, f.height_m)
        for f in shop.fixtures
    )


def plan_svg() -> str:
    """Return the plan of the building: its outer walls and the door.

    One user unit is one plan pixel (`M_PER_PX` metres). What can be moved is no part of a building's plan: see
    `fixtures`.
    """
    width, depth = WIDTH_M / M_PER_PX, DEPTH_M / M_PER_PX
    left, right = DOOR[0] / M_PER_PX, DOOR[2] / M_PER_PX
    wall = f"M{left:g} {depth - 2:g}H2V2H{width - 2:g}V{depth - 2:g}H{right:g}"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{depth:g}" '
        f'viewBox="0 0 {width:g} {depth:g}">',
        f'<path d="{wall}" fill="none" stroke="#4a4f57" stroke-width="4"/>',
    ]
    return "\n".join([*parts, "</svg>", ""])
