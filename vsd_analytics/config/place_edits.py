"""Marks areas and fixtures on a floor from a day on, says until when they are there, and takes that back, with who.

What holds is in `vsd.toml`: a table `[[area]]` or `[[fixture]]` at its end, or `to` in the table that is there. Who did
it and when is a line of `places.jsonl`, written before. Past weeks keep the places they had.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Any, Final, Literal, get_args

from vsd_analytics.config.append_only import AppendOnlyFile
from vsd_analytics.config.config_edits import Tables, drop_table, rewrite, with_key, with_table, without_table
from vsd_analytics.config.log_records import NAME_MAX_CHARS, is_name
from vsd_analytics.config.project import FILE as CONFIG
from vsd_analytics.config.reader import suggest_id
from vsd_analytics.errors import ConfigError, UsageError, Where
from vsd_analytics.geometry.camera_views import plan_bounds
from vsd_analytics.site.model import FixtureKind, Floor, Point, Site
from vsd_analytics.site.places import known_floor

PlaceKind = Literal["area", "shelf", "wall", "till", "other"]
KINDS: Final[tuple[PlaceKind, ...]] = ("area", *get_args(FixtureKind))
AREA_MIN_M2: Final = 0.01
Action = Literal["marked", "ended", "unmarked", "reopened"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceEdit:
    """Something that was done to an area or a fixture.

    Attributes:
        at: When it was written.
        action: "marked": it is there from `day` on; "ended": `day` is the first day on which it is not; "unmarked" and
            "reopened" take these back.
        key: "area" or "fixture".
        place_id: Its id.
        day: Local day.
        name: What it is called.
        by: Who; None = not stated.
        table: What was written at the end of `vsd.toml`, where it was marked.
    """

    at: datetime
    action: Action
    key: str
    place_id: str
    day: date
    name: str
    by: str | None = None
    table: dict[str, Any] | None = None


def _as_line(change: PlaceEdit) -> dict[str, Any]:
    fields = {name: getattr(change, name) for name in PlaceEdit.__slots__}
    dates = {"at": change.at.isoformat(), "day": change.day.isoformat()}
    return {name: value for name, value in (fields | dates).items() if value is not None}


PLACES: Final = AppendOnlyFile(
    "places.jsonl", PlaceEdit, _as_line, "a change of a place", "areas and fixtures themselves are in vsd.toml"
)


def mark_place(
    site: Site,
    *,
    kind: PlaceKind,
    name: str,
    floor_id: str,
    polygon: Sequence[Point],
    first: date,
    at: datetime,
    by: str | None = None,
) -> PlaceEdit:
    """Write an area or a fixture into `vsd.toml`, durably. Its id is made of its name.

    Args:
        site: The site.
        kind: "area", or a kind of fixture.
        name: What it is called.
        floor_id: Its floor.
        polygon: Its corners in floor metres.
        first: First local day it is there: of the running week or later.
        at: When this is done, in the site's zone.
        by: Who; None = not stated.

    Raises:
        UsageError: E101, the day lies in a week that is over, the floor is unknown, the corners make no area or lie
            beside the plan, or a name is none.
        ConfigError: E103, the file cannot be written to in this way.
        DiskError: E304 to E306, the disk refused; `vsd.toml` is as before.
    """
    _check_corners(known_floor(site, floor_id), polygon)
    _check_day(first, at)
    _check_name(name, "a place is called by")
    if by is not None:
        _check_name(by, "--by must be")
    key, place_id = "area" if kind == "area" else "fixture", _free_id(site, name)
    table: dict[str, Any] = {"id": place_id, "name": name}
    table |= {"floor": floor_id} if len(site.floors) > 1 else {}
    table |= {} if kind == "area" else {"kind": kind}
    table |= {"polygon": [list(corner) for corner in polygon], "from": first.isoformat()}
    change = PlaceEdit(
        at=at, action="marked", key=key, place_id=place_id, day=first, name=name, by=by, table=table
    )  # fmt: skip

    def with_place(text: str, tables: Tables) -> str:
        tables.setdefault(key, []).append(table)
        return with_table(text, key, table)

    rewrite(site, with_place, refusal=lambda: _other_way(name), before=lambda: _note(site, change))
    return change


def end_place(site: Site, place_id: str, day: date, *, at: datetime, by: str | None = None) -> PlaceEdit | None:
    """Write the first day on which an area or a fixture is not there any more. Returns None where it has one.

    Args:
        site: The site.
        place_id: Its id.
        day: Local day, of the running week or later.
        at: When this is done, in the site's zone.
        by: Who; None = not stated.

    Raises:
        UsageError: E101, there is no such place, or the day lies in a week that is over.
        ConfigError: E103, it begins later, or the file cannot be written to in this way.
        DiskError: E304 to E306, the disk refused; `vsd.toml` is as before.
    """
    _check_day(day, at)
    if by is not None:
        _check_name(by, "--by must be")
    changes: list[PlaceEdit] = []

    def with_end(text: str, tables: Tables) -> str | None:
        key, number, table = _table_of(tables, place_id)
        if "to" in table:
            return None
        table["to"] = day.isoformat()
        changes.append(
            PlaceEdit(at=at, action="ended", key=key, place_id=place_id, day=day, name=str(table.get("name")), by=by)
        )
        return with_key(text, key, number, "to", day.isoformat())

    rewrite(site, with_end, refusal=lambda: _other_way(place_id), before=lambda: _note(site, changes[0]))
    return changes[0] if changes else None


def take_place_back(site: Site, change: PlaceEdit, *, at: datetime, by: str | None = None) -> bool:
    """Take back that a place was marked or ended. Returns False where it is so already.

    Raises:
        UsageError: E101, weeks with it are over.
        ConfigError: E103, the lines in `vsd.toml` are not as this program wrote them.
        DiskError: E304 to E306, the disk refused; `vsd.toml` is as before.
    """
    if change not in can_take_back(site, today=at.date()):
        if change in standing(site):
            raise UsageError(
                f"{change.name} cannot be taken back",
                why="weeks with it are over, and their figures keep it",
                fix=f"vsd mark --end {change.place_id} --from {at.date()}",
            )
        return False
    action: Action = "unmarked" if change.action == "marked" else "reopened"
    undone = PlaceEdit(
        at=at, action=action, key=change.key, place_id=change.place_id, day=change.day, name=change.name, by=by
    )  # fmt: skip

    def without(text: str, tables: Tables) -> str:
        if change.table is not None:
            drop_table(tables, change.key, change.table)
            return without_table(text, change.key, change.table)
        key, number, table = _table_of(tables, change.place_id)
        table.pop("to", None)
        return with_key(text, key, number, "to", None)

    return rewrite(site, without, refusal=lambda: _other_way(change.name), before=lambda: _note(site, undone))


def standing(site: Site) -> tuple[PlaceEdit, ...]:
    """Return the marks and ends that `vsd.toml` still says, in the order they were made.

    No id is used twice, so a mark holds as long as its id is there: also where a program died before it wrote
    `vsd.toml`.
    """
    there: dict[str, date | None] = {a.area_id: a.end_day for a in site.areas}
    for fixture in site.fixtures:
        until = fixture.valid_to
        there[fixture.fixture_id] = None if until is None else until.astimezone(site.zone).date()
    last = {(c.place_id, c.action): c for c in PLACES.read(site) if c.place_id in there}
    return tuple(
        c for c in last.values() if c.action == "marked" or (c.action == "ended" and there[c.place_id] == c.day)
    )


def can_take_back(site: Site, *, today: date) -> tuple[PlaceEdit, ...]:
    """Return the changes of which no whole week has figures yet, without marks of places that were ended since."""
    changes = standing(site)
    ended = {c.place_id for c in changes if c.action == "ended"}
    monday = today - timedelta(days=today.weekday())
    return tuple(
        c for c in changes if c.day >= monday and not (c.action == "marked" and c.place_id in ended)
    )  # fmt: skip


def _note(site: Site, change: PlaceEdit) -> None:
    PLACES.add(site, change)


def _free_id(site: Site, name: str) -> str:
    """Return an id that neither is nor was anything's."""
    taken = {a.area_id for a in site.areas} | {f.fixture_id for f in site.fixtures}
    taken |= {c.place_id for c in PLACES.read(site)}
    wish = suggest_id(name)
    numbers = (f"{wish[:58]}-{n}" for n in range(2, len(taken) + 3))
    return next(one for one in (wish, *numbers) if one not in taken)


def _table_of(tables: Tables, place_id: str) -> tuple[str, int, dict[str, Any]]:
    """Return the kind, number and values of the last table with an id."""
    for key in ("area", "fixture"):
        for number, table in reversed(list(enumerate(tables.get(key, [])))):
            if table.get("id") == place_id:
                return key, number, table
    known = [str(t.get("id")) for key in ("area", "fixture") for t in tables.get(key, [])]
    raise UsageError(f"there is no area or fixture {place_id!r}", fix=f"one of: {', '.join(known) or 'none yet'}")


def _check_day(day: date, at: datetime) -> None:
    monday = at.date() - timedelta(days=at.weekday())
    if day < monday:
        why = f"the week of {day} is over, and its figures keep the places they were made with"
        raise UsageError("places cannot change in the past", why=why, fix=f"a day from {monday} on")


def _check_corners(floor: Floor, polygon: Sequence[Point]) -> None:
    import shapely

    shape = shapely.Polygon(polygon) if len(polygon) >= 3 else shapely.Polygon()
    fix = '--corners "2,7 3,7 3,8 2,8": around it, in floor metres'
    if not shape.is_valid or shape.area < AREA_MIN_M2:
        raise UsageError("the corners make no area", why="its edges cross or touch, or it is empty", fix=fix)
    bounds = plan_bounds(floor)
    if bounds is not None and not shapely.box(*bounds).intersects(shape):
        why = f"it reaches from {bounds[0]:g},{bounds[1]:g} to {bounds[2]:g},{bounds[3]:g}"
        raise UsageError(f"the place lies beside the plan of {floor.name}", why=why, fix=fix)


def _check_name(name: str, what: str) -> None:
    if not is_name(name):
        raise UsageError(f"{what} 1 to {NAME_MAX_CHARS} printable characters", fix='a name such as "Display"')


def _other_way(name: str) -> ConfigError:
    return ConfigError(
        f"{name} cannot be written into {CONFIG}",
        why="the file writes its tables in another way than this program",
        where=Where(CONFIG),
        fix="edit its [[area]] or [[fixture]] there",
    )
