"""Crowding, layout and behaviour of a floor, and which of them moved (M23).

The arithmetic is `vsd_analytics.stats.decomposition`: pair-time from the mart `crowding_hours`, maps of 0.25 m cells
from `cell_hours`, over the camera-hours that enter rates (or that both periods recorded).
"""

from __future__ import annotations

from datetime import date
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.panels import Array, Flags, FloorHours, Place, positions
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.stats.decomposition import Mixing, MixingChange, compare_mixing, mixing

CELLS_MAX: Final = 4_000_000
"""Larger maps are not computed: a position far off would fill the memory."""
TOO_LARGE: Final = Reason("map.apart")


def mixing_of(period: Period) -> Mixing:
    """Return crowding, layout and behaviour of a period."""
    data, settings = period.data, period.data.site.settings
    if (why := period.why_no_exposure or period.why_no_places) is not None:
        return _not_measured(why)
    panel = data.panel(pair_time(data), period.days)
    maps = _maps(data, data.hours.is_counted & period.is_inside)
    if maps is None:
        return _not_measured(TOO_LARGE)
    return mixing(
        panel.n,
        panel.exposure_h,
        maps,
        cell_m=FLOOR_CELL_M,
        distance_m=settings.distance_m,
        **settings.for_intervals,
        min_person_h=settings.min_exposure_h,
    )


def mixing_change(pair: TwoPeriods) -> MixingChange:
    """Return which of crowding, layout and behaviour moved the time that pairs spend close."""
    data, settings = pair.data, pair.data.site.settings
    reasons = [p.why_no_exposure or p.why_no_places for p in (pair.before, pair.now)]
    maps = [_maps(data, pair.used(0)), _maps(data, pair.used(1))]
    why = next((r for r in (*reasons, *(TOO_LARGE if m is None else None for m in maps)) if r is not None), None)
    if why is not None or maps[0] is None or maps[1] is None:
        return no_change(why or TOO_LARGE, "not_measurable")
    before, now = pair.compared(pair_time(data))
    return compare_mixing(
        (before.n, now.n),
        (before.exposure_h, now.exposure_h),
        (maps[0], maps[1]),
        cell_m=FLOOR_CELL_M,
        distance_m=settings.distance_m,
        **settings.for_intervals,
        min_person_h=settings.min_exposure_h,
    )


def no_change(why: Reason, state: State = "not_enough_data") -> MixingChange:
    """Return a change that is not given, and why."""
    none = _not_measured(why)
    return MixingChange(none, none, None, None, None, None, None, None, None, state, why)


def pair_time(data: FloorHours) -> Place:
    """Return pair-hours closer than the distance as `n`, and of any two people as `exposure_h`."""
    rows = data.warehouse.table(
        "select camera_id, hour_start_ms, close_pair_s::double / 3600 as n, "
        "copresent_pair_s::double / 3600 as exposure_h from crowding_hours where floor_id = $floor",
        {"floor": data.floor.floor_id},
    )
    n, exposure_h = data.by_hour(rows, "n", "exposure_h")
    return Place(n, exposure_h, np.ones(len(n), dtype=np.bool_))


def _maps(data: FloorHours, used: Flags) -> list[Array] | None:
    """Return a map of person-hours by cell for each camera, over camera-hours `used`; None when one is too large."""
    camera, hour = np.nonzero(used)
    if not len(hour):
        return [np.zeros((1, 1)) for _ in used]
    days = data.hours.day[hour]  # files of other days are not read
    rows = data.warehouse.table(
        "with used as (select unnest($cameras::varchar[]) as camera_id, unnest($hours::bigint[]) as hour_start_ms) "
        "select camera_id, cx, cy, sum(exposure_open_s)::double / 3600 as exposure_h from cell_hours "
        "semi join used using (camera_id, hour_start_ms) "
        "where floor_id = $floor and local_date between $first and $last group by all order by all",
        {
            "cameras": [data.ids[i] for i in camera.tolist()],
            "hours": data.hours.start_ms[hour].tolist(),
            "floor": data.floor.floor_id,
            "first": date.fromordinal(int(days.min())),
            "last": date.fromordinal(int(days.max())),
        },
    )
    of_camera = positions(rows["camera_id"], data.ids, otherwise=-1)
    x, y, exposure_h = (rows[name].to_numpy() for name in ("cx", "cy", "exposure_h"))
    maps = []
    for k in range(len(used)):
        own = (of_camera == k) & (exposure_h > 0)
        if not own.any():
            maps.append(np.zeros((1, 1)))
            continue
        at = y[own] - y[own].min(), x[own] - x[own].min()
        shape = int(at[0].max()) + 1, int(at[1].max()) + 1
        if shape[0] * shape[1] > CELLS_MAX:
            return None
        camera_map = np.zeros(shape)
        camera_map[at] = exposure_h[own]
        maps.append(camera_map)
    return maps


def _not_measured(why: Reason) -> Mixing:
    return Mixing(0.0, 0.0, None, None, None, None, None, 0, "not_measurable", why)
