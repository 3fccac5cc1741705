"""A floor as it was at the end of a day, with plan, fixtures and areas, and nothing on it yet."""

from __future__ import annotations

from datetime import date

from vsd_analytics.figures.week.floor_maps import map_fixtures
from vsd_analytics.figures.week.model_map import Extent, FloorMap, MapArea, MapImage
from vsd_analytics.geometry.camera_views import plan_bounds
from vsd_analytics.geometry.embedded_pictures import has_paper, plan_image
from vsd_analytics.site.model import Floor, Site
from vsd_analytics.site.places import fixtures_at


def bare_floor(site: Site, floor: Floor, *, until: date, extent: Extent) -> FloorMap:
    """Return a floor as it was at the end of a day, ready to draw.

    Args:
        site: The site.
        floor: The floor.
        until: The day; fixtures are those at its end.
        extent: Left, bottom, right, top in floor metres, where there is no plan.
    """
    bounds = plan_bounds(floor)
    image = None
    if floor.plan is not None and bounds is not None:
        image = MapImage(data_uri=plan_image(floor.plan)[0], extent=bounds, is_opaque=has_paper(floor.plan))
    areas = [a for a in site.areas if a.floor_id == floor.floor_id]
    return FloorMap(
        kind="floor" if image is None else "plan",
        title=floor.name,
        extent=bounds or extent,
        image=image,
        fixtures=map_fixtures(fixtures_at(site, floor.floor_id, until)),
        areas=tuple(MapArea(area_id=a.area_id, name=a.name, ring=a.polygon) for a in areas),
    )
