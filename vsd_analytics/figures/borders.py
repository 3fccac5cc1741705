"""Areas at the border of what cameras see: neighbours outside the view are missing, so their risk is underestimated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.hotspot_windows import SEEN_SHARE
from vsd_analytics.geometry import camera_views
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.dimensions import area_cells
from vsd_analytics.warehouse.owner_spans import camera_life, in_force

if TYPE_CHECKING:
    from shapely import Polygon

BORDER_SHARE: Final = 0.5
"""An area with a larger border share than this is ranked by risk only with a note."""

UNKNOWN: Final = Reason("border.unknown")


@dataclass(frozen=True, slots=True)
class AreaBorder:
    """How much of an area lies at the border of what the cameras see.

    Attributes:
        area_id: The area.
        share: Share of its cells around which the cameras see less than four fifths of the disc of the legal distance,
            0 to 1; None when what they see is unknown, or the area holds no cell of its own.
        is_border: The share is above one half; None when it is unknown.
        note: What a reader of its place in a ranking must know; None when there is nothing to report.
    """

    area_id: str
    share: float | None
    is_border: bool | None
    note: Reason | None


def area_borders(site: Site, *, at_ms: int) -> tuple[AreaBorder, ...]:
    """Return how much of each area is border, in the order of vsd.toml, each camera as calibrated at an instant.

    Args:
        site: The project.
        at_ms: UTC milliseconds, such as the end of the week that is ranked.
    """
    cells = area_cells(site)
    is_now = (cells["from_ms"].to_numpy() <= at_ms) & (at_ms < cells["to_ms"].to_numpy())
    ids, cx, cy = (cells[name].to_numpy(zero_copy_only=False)[is_now] for name in ("area_id", "cx", "cy"))
    middles = (np.column_stack((cx, cy)) + 0.5) * FLOOR_CELL_M
    views = {floor.floor_id: _views(site, floor.floor_id, at_ms=at_ms) for floor in site.floors}
    bounds = {floor.floor_id: camera_views.plan_bounds(floor) for floor in site.floors}
    borders = []
    for area in site.areas:
        seen, own = views[area.floor_id], middles[ids == area.area_id]
        if seen is None or not len(own):
            borders.append(AreaBorder(area.area_id, None, None, UNKNOWN if seen is None else None))
            continue
        around = camera_views.seen_share(
            own, views=seen, radius_m=site.settings.distance_m, bounds=bounds[area.floor_id]
        )
        share = float(np.mean(around < SEEN_SHARE))
        is_border = share > BORDER_SHARE
        note = Reason("border.risk_low", share=share)
        borders.append(AreaBorder(area.area_id, share, is_border, note if is_border else None))
    return tuple(borders)


def _views(site: Site, floor_id: str, *, at_ms: int) -> list[Polygon] | None:
    """Return what the cameras of a floor see, or None when that is unknown of one."""
    views = []
    for camera in site.cameras:
        first_ms, end_ms = camera_life(site, camera)
        if camera.floor_id == floor_id and first_ms <= at_ms < end_ms:
            calibrations = in_force(camera, at_ms)
            view = camera_views.view_polygon(camera, calibration=calibrations[0] if calibrations else None)
            if view is None:
                return None
            views.append(view)
    return views
