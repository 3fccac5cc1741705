"""Finds the area or the floor that somebody names."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, datetime, time, timedelta

from vsd_analytics.errors import UsageError, nearest
from vsd_analytics.site.model import Area, Fixture, Floor, Site


def known_area(site: Site, area_id: str) -> Area:
    """Return an area by its id; UsageError E101 when there is none."""
    area = next((a for a in site.areas if a.area_id == area_id), None)
    if area is None:
        known = [a.area_id for a in site.areas]
        near = nearest(area_id, known) or next(iter(known), None)
        raise UsageError(
            f"the site has no area {area_id!r}",
            why=f"its areas are: {', '.join(known)}" if known else "vsd.toml describes no [[area]]",
            fix=f"--area {near}" if known else "describe the area in vsd.toml",
            in_python=f'"{near}"' if known else None,
        )
    return area


def known_floor(site: Site, floor_id: str | None, areas: Sequence[Area] = ()) -> Floor:
    """Return the floor that is meant: by its id, by areas that lie on it, or the only one of the site.

    Raises:
        UsageError: E101, it is unknown, or several are possible.
    """
    floors = {f.floor_id: f for f in site.floors}
    wanted = {a.floor_id for a in areas} | ({floor_id} if floor_id is not None else set())
    if not wanted and len(floors) == 1:
        wanted = set(floors)
    if len(wanted) != 1 or not wanted <= floors.keys():
        what = "the areas lie on several floors" if areas else f"which floor? This site has {', '.join(floors)}"
        near = _near_floor(floor_id, list(floors))
        raise UsageError(what, fix=f"--floor {near}", in_python=f'floor_id="{near}"')
    return floors[wanted.pop()]


def named_floors(site: Site, floor_id: str | None) -> list[str]:
    """Return the ids of all floors with cameras, or only of the one that is named.

    Raises:
        UsageError: E101, there is no floor of this id, or no camera looks at it: all figures but those of door counters
            need one.
    """
    floors = [f.floor_id for f in site.floors]
    if floor_id is not None and floor_id not in floors:
        why = f"this site has {', '.join(floors)}"
        near = _near_floor(floor_id, floors)
        raise UsageError(
            f"no floor has the id {floor_id!r}", why=why, fix=f"--floor {near}", in_python=f'floor_id="{near}"'
        )
    asked = [floor_id] if floor_id is not None else floors
    seen = [floor for floor in asked if any(camera.floor_id == floor for camera in site.cameras)]
    if not seen:
        is_counted = any(line.is_by_counter and line.floor_id in asked for line in site.lines)
        raise UsageError(
            f"no [[camera]] of vsd.toml looks at {'any floor' if floor_id is None else f'floor {floor_id!r}'}",
            why="people are seen by cameras; a door counter counts who passes" if is_counted else None,
            fix="vsd lines --week last --page" if is_counted else "add [[camera]] with its floor to vsd.toml",
        )
    return seen


def _near_floor(floor_id: str | None, floors: Sequence[str]) -> str:
    return nearest(floor_id or "", floors) or floors[0]


def fixtures_at(site: Site, floor_id: str, day: date) -> tuple[Fixture, ...]:
    """Return the fixtures that stand on a floor at the end of a local day."""
    end = datetime.combine(day + timedelta(days=1), time(), tzinfo=site.zone) - timedelta(seconds=1)
    return tuple(f for f in site.fixtures if f.floor_id == floor_id and f.is_there(end))


def joined_floors(site: Site) -> list[str]:
    """Return the floors on which people are followed from camera to camera: with `join_views`, of several cameras."""
    cameras = [c.floor_id for c in site.cameras] if site.settings.join_views else []
    return [f.floor_id for f in site.floors if cameras.count(f.floor_id) > 1]
