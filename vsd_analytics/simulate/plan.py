"""The made-up shop as its site describes it: the building as an SVG plan, everything in it as fixtures."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

from vsd_analytics.config.reader import suggest_id
from vsd_analytics.simulate.shop import (
    DEPTH_M,
    DOOR,
    SHOP_AFTER,
    SHOP_BEFORE,
    WIDTH_M,
    ShopFixture,
    polygon,
)
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


def fixtures(moved_at: datetime | None = None) -> tuple[Fixture, ...]:
    """Return the fixtures of the shop as `vsd.toml` describes them.

    Args:
        moved_at: When the display was moved, which then is listed at both places; None = only where it is now.
    """
    now = tuple(_fixture(f) for f in SHOP_AFTER.fixtures)
    if moved_at is None:
        return now
    before = [_fixture(f) for f in SHOP_BEFORE.fixtures if f not in SHOP_AFTER.fixtures]
    moved = {f.fixture_id for f in before}
    return (
        *(replace(f, valid_from=moved_at) if f.fixture_id in moved else f for f in now),
        *(replace(f, valid_to=moved_at) for f in before),
    )


def _fixture(f: ShopFixture) -> Fixture:
    return Fixture(suggest_id(f.label), f.label, "ground", polygon(f.rect), _KINDS[f.kind], f.is_movable, f.height_m)


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
