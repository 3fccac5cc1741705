"""The map of the week before, of this week, and of the difference, over the same camera-hours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely

from vsd_analytics.figures.panels import Array, Flags
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.density import Density, FloorGrid, fixtures_before, floor_fixtures, without_patches
from vsd_analytics.figures.week.floor_maps import floor_extent, map_fixtures
from vsd_analytics.figures.week.model_map import ChangedPlace, ChangeMaps
from vsd_analytics.figures.week.results import AreaRow

STEPS: Final = (1.0, 3.0)
"""Lower ends of the two bands of a difference, violations per m2 per open hour; the same every week."""
SMALLEST_M2: Final = 0.5
"""A coloured patch of less floor is chance or the edge of another, and left blank."""


def change_maps(data: WeekData, *, areas: Sequence[AreaRow]) -> ChangeMaps | None:
    """Return the maps of two weeks and their difference; None where nothing can be placed or compared.

    Nor is there one where few people were on the floor in either week.

    Both densities are over the camera-hours that count in both weeks (`TwoPeriods.used`), smoothed as the week's own
    map. The difference is taken before the bands are drawn; a coloured patch behind which either week has fewer
    violations than may be printed (but some) is left blank.

    Args:
        data: The week.
        areas: The areas as the page shows them; held back ones name no place.
    """
    extent = floor_extent(data)
    used: tuple[Flags, Flags] = (data.pair.used(0), data.pair.used(1))
    if extent is None or data.why_no_violations is not None or data.why_no_places is not None or not used[1].any():
        return None
    if data.hidden.why_untimed is not None or data.hidden_before.why_untimed is not None:
        return None  # bands would be drawn around single people
    grid = FloorGrid(data, extent)
    before = grid.density(data.pair.before, used=used[0])
    now = grid.density(data.pair.now, used=used[1])
    change = now.values - before.values
    fewer, more = (
        _without_small(sign * change, before, now, mask=data.mask, cell_m=grid.cell_m) for sign in (-1.0, 1.0)
    )
    steps = data.site.settings.heat_steps
    return ChangeMaps(
        before=grid.bands(before.without_small(), steps=steps),
        now=grid.bands(now.without_small(), steps=steps),
        fewer=grid.bands(fewer, steps=STEPS),
        more=grid.bands(more, steps=STEPS),
        steps=STEPS,
        hours_compared=float((data.hours.recorded_s * used[1]).sum()) / 3600,
        places=_places(data, grid, fewer, more, areas),
        fixtures_before=None if fixtures_before(data) == floor_fixtures(data) else map_fixtures(fixtures_before(data)),
    )


def _without_small(rise: Array, before: Density, now: Density, *, mask: Mask, cell_m: float) -> Array:
    """Return a rise without specks and patches behind which either week has too few violations to print."""

    def is_left_out(own: Flags) -> bool:
        is_speck = own.sum() * cell_m**2 < SMALLEST_M2
        return bool(is_speck) or mask.hides(before.near(own), now.near(own))

    return without_patches(rise, least=STEPS[0], is_left_out=is_left_out)


def _places(
    data: WeekData, grid: FloorGrid, fewer: Array, more: Array, areas: Sequence[AreaRow]
) -> tuple[ChangedPlace, ...]:
    """Return what changed on coloured floor by area; a cell in several areas is the first one's."""
    x, y = grid.axes()
    rest = np.ones(grid.shape, dtype=np.bool_)
    inside: dict[str | None, Flags] = {}
    for area in data.areas:
        own = rest & shapely.contains_xy(shapely.Polygon(area.polygon), x[None, :], y[:, None])
        inside[area.area_id], rest = own, rest & ~own
    inside[None] = rest
    places = []
    for row in areas:
        if row.is_masked or row.is_held_back:
            continue
        own = inside[row.area_id]
        amounts = [float(v[own & (v >= STEPS[0])].sum()) * grid.cell_m**2 for v in (fewer, more)]
        if any(amounts):
            places.append(ChangedPlace(area_id=row.area_id, name=row.name, fewer=amounts[0], more=amounts[1]))
    return tuple(sorted(places, key=lambda p: (-max(p.fewer, p.more), p.name)))
