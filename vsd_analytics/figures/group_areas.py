"""Violations between groups in the areas of a floor (M9): `analysis.groups.between_groups`, place by place."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from vsd_analytics.figures.panels import Place
from vsd_analytics.figures.periods import Period


def between_groups_by_area(period: Period, able: Collection[str]) -> Mapping[str | None, Place]:
    """Return each area with its violations between groups only; None is the rest of the floor.

    Violations whose groups are unknown count as between groups, as on the whole floor.

    Args:
        period: The days.
        able: Ids of the cameras that take part. Areas that another camera counts anything in are left out: a part of
            an area is no area.
    """
    data = period.data
    takes_part = np.array([c in able for c in data.ids], dtype=np.bool_)
    rows = data.warehouse.rows(
        "select area_id, camera_id, hour_start_ms, count(*)::double as n from violations "
        "where is_open and is_together and floor_id = $floor group by all order by all",
        {"floor": data.floor.floor_id},
    )
    found: dict[str | None, Place] = {}
    for area_id in (*(a.area_id for a in data.areas), None):
        place = period.area(area_id)
        if not (place.cameras & takes_part).any() or (place.cameras & ~takes_part).any():
            continue
        n = place.n.copy()
        for row in rows:
            if row["area_id"] == area_id and row["camera_id"] in able:
                hour = int(np.searchsorted(data.hours.start_ms, row["hour_start_ms"]))
                n[data.ids.index(row["camera_id"]), hour] -= row["n"]
        found[area_id] = Place(np.maximum(n, 0.0), place.exposure_h, place.cameras, place.is_there)
    return found
