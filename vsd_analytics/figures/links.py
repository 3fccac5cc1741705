"""Links over floor where nobody is followed: estimated by time and walking speed, beside the flow that was seen (M37).

Blind floor, borders between the views of two cameras, and floor that both see are alike here: a track ends where its
camera counts the person for the last time. Only hours count in which all cameras of the floor recorded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.figures.panels import positions
from vsd_analytics.figures.periods import Period
from vsd_analytics.site.model import Area
from vsd_analytics.stats.track_links import IN_WAVES, LinkedShare, TrackEnds, link_counts, linked_share

_WAYS: Final = """
select
    began_by,
    ended_by,
    began_ms,
    began_x_m::double as began_x_m,
    began_y_m::double as began_y_m,
    first_area_id,
    entered_hour_ms,
    ended_ms,
    ended_x_m::double as ended_x_m,
    ended_y_m::double as ended_y_m,
    last_area_id,
    left_hour_ms
from track_ways
where floor_id = $floor and (first_area_id is not null or last_area_id is not null)
order by began_ms, camera_id, track_id
"""
_LEFT: Final = """
select
    area_id,
    left_hour_ms,
    count(*)::double as n
from moves
where floor_id = $floor and is_departure and is_exit_counted and is_open_then and left_date between $first and $last
group by area_id, left_hour_ms
order by area_id, left_hour_ms
"""


@dataclass(frozen=True, slots=True)
class AreaLink:
    """People who are estimated to go from one area to another unseen.

    Attributes:
        origin: The area they leave.
        to: The area they enter next, as far as anybody saw.
        share: Share of those who leave `origin`, in hours in which all cameras recorded.
    """

    origin: Area
    to: Area
    share: LinkedShare


@dataclass(frozen=True, slots=True)
class Links:
    """Links of a floor in a period.

    Attributes:
        links: Those that are more than chance gives, most first. Fewer than `mask_below` people are none. Where people
            come in waves they have no share, as one cause may send them to both areas.
        recorded_share: Share of the open hours in which all cameras recorded.
    """

    links: tuple[AreaLink, ...]
    recorded_share: float


def links(period: Period) -> Links:
    """Return the links between the areas of a floor that ask for visits."""
    data, settings = period.data, period.data.site.settings
    asked = [a for a in data.areas if a.has_visits]
    hours = data.hours
    together = hours.all_counted(np.ones(len(data.ids), dtype=np.bool_)) & period.is_inside
    open_h = float(hours.open_s[period.is_inside].sum())
    recorded = float(hours.open_s[together].sum()) / open_h if open_h else 0.0
    if not asked or not together.any():
        return Links((), recorded)
    days = np.array([d.toordinal() for d in period.days], dtype=np.int64)
    ids = [a.area_id for a in asked]
    rows = data.warehouse.table(_WAYS, {"floor": data.floor.floor_id})

    def column(name: str) -> np.ndarray:
        return np.asarray(rows[name].to_numpy(zero_copy_only=False))

    def one(area: str, when: str, hour: str, *, is_used_only: bool) -> TrackEnds:
        of_area = positions(rows[area], ids, otherwise=-1)
        at_hour = np.nan_to_num(column(hour).astype(np.float64), nan=-1.0).astype(np.int64)
        at = np.minimum(np.searchsorted(hours.start_ms, at_hour), len(hours.start_ms) - 1)
        chosen = (of_area >= 0) & (together[at] if is_used_only else True)
        day = np.clip(np.searchsorted(days, hours.day[at]), 0, len(days) - 1)
        return TrackEnds(
            column(f"{when}_ms")[chosen] / 1000.0,
            column(f"{when}_x_m")[chosen],
            column(f"{when}_y_m")[chosen],
            of_area[chosen],
            positions(rows[f"{when}_by"], data.ids, otherwise=-1)[chosen],
            day[chosen],
        )

    ends = one("last_area_id", "ended", "left_hour_ms", is_used_only=True)
    starts = one("first_area_id", "began", "entered_hour_ms", is_used_only=False)
    counts = link_counts(ends, starts, n_areas=len(asked), n_days=len(days))
    gone = data.warehouse.table(_LEFT, {"floor": data.floor.floor_id, "first": period.first, "last": period.last})
    at = np.minimum(np.searchsorted(hours.start_ms, gone["left_hour_ms"].to_numpy()), len(hours.start_ms) - 1)
    left = np.zeros((len(asked), len(days)))
    used = together[at]
    where = positions(gone["area_id"], ids, otherwise=-1)[used], np.searchsorted(days, hours.day[at])[used]
    np.add.at(left, where, gone["n"].to_numpy()[used])
    area_links = []
    for a, origin in enumerate(asked):
        for b, to in enumerate(asked):
            share = linked_share(
                counts, a, b, left[a],
                **settings.for_intervals,
            )  # fmt: skip
            is_enough = share.n_links - share.n_chance >= period.data.mask.least(0)
            is_in_waves = share.reason is not None and share.reason.code == IN_WAVES
            if a != b and is_enough and (is_in_waves or (share.value and (share.lo is None or share.lo > 0))):
                area_links.append(AreaLink(origin, to, share))
    return Links(tuple(sorted(area_links, key=lambda link: -link.share.possible)), recorded)
