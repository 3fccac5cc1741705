"""The map of the week before, of this week, and of the difference, over the same camera-hours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely

from vsd_analytics.analysis.panels import Array, Flags
from vsd_analytics.report import words
from vsd_analytics.report.density import Density, FloorGrid
from vsd_analytics.report.mapping import floor_extent
from vsd_analytics.report.model import AreaRow, ChangedPlace, ChangeMaps
from vsd_analytics.report.privacy import is_small
from vsd_analytics.report.weekdata import WeekData
from vsd_analytics.report.wording import say

STEPS: Final = (1.0, 3.0)
"""Lower ends of the two bands of a difference, violations per m2 per open hour; the same every week."""
SMALLEST_M2: Final = 0.5
"""A coloured patch of less floor is chance or the edge of another, and left blank."""
NAMED_SHARE: Final = 0.2
"""A place is named beside the greatest when it changed by at least this share of it."""
NAMED_MAX: Final = 2


def change_maps(data: WeekData, *, areas: Sequence[AreaRow]) -> ChangeMaps | None:
    """Return the maps of two weeks and their difference; None where nothing can be placed or compared.

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
    grid = FloorGrid(data, extent)
    before = grid.density(data.pair.before, used=used[0])
    now = grid.density(data.pair.now, used=used[1])
    below = data.site.settings.mask_below
    change = now.values - before.values
    fewer, more = (_without_small(sign * change, before, now, below=below, cell_m=grid.cell_m) for sign in (-1.0, 1.0))
    steps = data.site.settings.heat_steps
    return ChangeMaps(
        before=grid.bands(before.without_small(), steps=steps),
        now=grid.bands(now.without_small(), steps=steps),
        fewer=grid.bands(fewer, steps=STEPS),
        more=grid.bands(more, steps=STEPS),
        steps=STEPS,
        hours_compared=float((data.hours.recorded_s * used[1]).sum()) / 3600,
        places=_places(data, grid, fewer, more, areas),
    )


def change_title(shown: ChangeMaps) -> str:
    """Return the finding of the three maps, such as "Fewer at Main entrance, more at Checkout queue"."""
    fewer = _named([(p.fewer, p) for p in shown.places])
    more = _named([(p.more, p) for p in shown.places])
    if fewer and more:
        return say("maps.change_both", fewer=fewer, more=more)
    if fewer:
        return say("maps.change_fewer", fewer=fewer)
    return say("maps.change_more", more=more) if more else say("maps.change_none")


def _named(amounts: Sequence[tuple[float, ChangedPlace]]) -> str:
    """Return the places that changed most, in words; "" when none did."""
    found = sorted((item for item in amounts if item[0] > 0), key=lambda item: (-item[0], item[1].name))
    kept = [p for n, p in found if n >= NAMED_SHARE * found[0][0]][:NAMED_MAX]
    return words.joined(say("maps.rest") if p.area_id is None else p.name for p in kept)


def _without_small(rise: Array, before: Density, now: Density, *, below: int, cell_m: float) -> Array:
    """Return a rise without specks and patches behind which either week has too few violations to print."""
    from scipy.ndimage import label

    patches, n_patches = label(rise >= STEPS[0])
    kept = rise.copy()
    for k in range(1, n_patches + 1):
        own = patches == k
        is_speck = own.sum() * cell_m**2 < SMALLEST_M2
        if is_speck or any(is_small(week.near(own), below=below) for week in (before, now)):
            kept[own] = 0.0
    return kept


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
    found = []
    for row in areas:
        if row.is_masked or row.is_held_back:
            continue
        own = inside[row.area_id]
        amounts = [float(v[own & (v >= STEPS[0])].sum()) * grid.cell_m**2 for v in (fewer, more)]
        if any(amounts):
            found.append(ChangedPlace(area_id=row.area_id, name=row.name, fewer=amounts[0], more=amounts[1]))
    return tuple(sorted(found, key=lambda p: (-max(p.fewer, p.more), p.name)))
