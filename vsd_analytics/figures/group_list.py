"""The groups of a range: those that walk together, and those that are standing in company."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any, Final

from vsd_analytics.figures.operator_counts import local_instant
from vsd_analytics.warehouse.rules import RULES
from vsd_analytics.warehouse.warehouse import Warehouse

_STANDING: Final = """
with companies as (
    select camera_id, window_ms, list(track_id order by track_id) as tracks
    from standing_groups
    where list_contains($cameras::varchar[], camera_id)
    group by camera_id, window_ms, group_id
),

stretches as (
    select
        *,
        window_ms - $window_ms * row_number() over (partition by camera_id, tracks order by window_ms) as stretch
    from companies
)

select
    site_days.site_day,
    camera_id,
    true as is_standing,
    tracks,
    min(window_ms) as first_ms,
    max(window_ms) + $window_ms as last_ms
from stretches
inner join site_days on window_ms // 900000 = site_days.quarter
where site_days.site_day between $first and $last
group by site_days.site_day, camera_id, tracks, stretch
"""


@dataclass(frozen=True, slots=True)
class Group:
    """People who walked or stood together in one camera's view.

    Attributes:
        day: Site day.
        camera_id: The camera.
        is_standing: They stood in company; else they walked together.
        tracks: Their track ids (pseudonyms that end with the site day), in order.
        start, end: Site's zone. Of people who walk, the first and last record of any of them; of standing company,
            the windows of `standing_groups` in which its members are the same.
    """

    day: date
    camera_id: str
    is_standing: bool
    tracks: tuple[str, ...]
    start: datetime
    end: datetime


def groups_of(warehouse: Warehouse, ids: Sequence[str], first: date, last: date) -> tuple[Group, ...]:
    """Return the groups that walk, and those that stand: each company for as long as its members are the same."""
    asked = {"cameras": list(ids), "first": first, "last": last}
    walking = warehouse.rows(
        "select site_day, camera_id, false as is_standing, list(track_id order by track_id) as tracks, "
        "min(first_ms) as first_ms, max(last_ms) as last_ms "
        "from track_groups inner join track_days using (camera_id, site_day, track_id) "
        "where group_id is not null and list_contains($cameras::varchar[], camera_id) "
        "and site_day between $first and $last "
        "group by site_day, camera_id, group_id",
        asked,
    )
    standing = warehouse.rows(_STANDING, asked | {"window_ms": RULES["company_window_ms"]})
    together = {
        (row["camera_id"], row["site_day"], track): k for k, row in enumerate(walking) for track in row["tracks"]
    }

    def is_new(row: Mapping[str, Any]) -> bool:
        """Return whether a company is not all of one walking group, which is listed already."""
        group_numbers = {together.get((row["camera_id"], row["site_day"], track)) for track in row["tracks"]}
        return len(group_numbers) > 1 or None in group_numbers

    rows, zone = [*walking, *filter(is_new, standing)], warehouse.site.zone
    return tuple(
        Group(
            day=row["site_day"],
            camera_id=row["camera_id"],
            is_standing=row["is_standing"],
            tracks=tuple(row["tracks"]),
            start=local_instant(zone, row["first_ms"]),
            end=local_instant(zone, row["last_ms"]),
        )
        for row in sorted(rows, key=lambda row: (row["first_ms"], row["camera_id"], row["tracks"]))
    )
