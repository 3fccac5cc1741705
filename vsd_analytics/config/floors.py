"""Floors, cameras, areas, fixtures and counting lines of `vsd.toml`."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import date, datetime, time
from functools import partial
from pathlib import Path
from typing import Any, get_args
from zoneinfo import ZoneInfo

from vsd_analytics.config.calibrations import read_calibrations, view_of_planes
from vsd_analytics.config.camera_source import read_camera_source
from vsd_analytics.config.reader import DATE, Form, TableReader
from vsd_analytics.config.values import BOX_MAX_M2, is_simple, parse_instant, parse_picture_px, zone
from vsd_analytics.errors import nearest
from vsd_analytics.geometry.picture_size import picture_size
from vsd_analytics.site.lines import Line, Side
from vsd_analytics.site.model import Area, Camera, Fixture, FixtureKind, Floor, Point

PLAN_SUFFIXES = (".svg", ".png", ".jpg", ".jpeg")

LINE_LEAST_M, LINE_MOST_M = 0.3, 1000.0
"""Shorter than a person is wide, or longer than any floor: the unit is wrong."""
_SIDES: tuple[Side, ...] = get_args(Side)
_POLYGON = "[[12, 4.2], [20, 4.2], [20, 7.2], [12, 7.2]]"
_IGNORE_PX = "[[[1500, 0], [1919, 0], [1919, 600], [1500, 600]]]"
_IGNORE_FORM: Form = {"type": "array", "items": {"type": "array", "items": {"type": "array"}, "minItems": 3}}
_LINE = "[[18.2, 0.8], [20.7, 0.8]]"
_CORNER_MAX_M = 1e6  # as far as coordinate_max_m may reach
_PICTURE_PX: Form = {"type": "array", "items": {"type": "integer", "minimum": 1}, "minItems": 2, "maxItems": 2}


def read_floors(root: TableReader) -> dict[str, Floor]:
    """Return the floors by id; a site that names none has one, "floor"."""
    floors: dict[str, Floor] = {}
    for table in root.each("floor"):
        floor_id = _unique(table, table.id("id", example='"ground"'), floors, kind="floor")
        name = table.text("name", example='"Ground floor"', required=True)
        plan = _picture(table, "plan", suffixes=PLAN_SUFFIXES)
        scale = table.number("plan_m_per_px", minimum=1e-6, maximum=1000, unit="metres per plan pixel", example="0.05")
        origin = table.pair("plan_origin_m", example="[-60.0, -40.0]")
        if "plan" in table.values and "plan_m_per_px" not in table.values:
            table.missing(
                "plan_m_per_px", "0.05", why="it is a known length in metres / the same length in plan pixels"
            )
        target = table.number(
            "target_per_open_h", minimum=0.01, maximum=1e6, unit="violations per open hour", example="120"
        )
        capacity = _capacity(table)
        table.close()
        key = floor_id or table.label  # a floor without a good id still lets cameras be checked
        floors[key] = Floor(key, name or key, plan, scale, origin or (0.0, 0.0), target, capacity)
    return floors or {"floor": Floor("floor", "Floor")}


def _raw(root: TableReader, key: str) -> list[Any]:
    """Return the items of an array of tables as the file has them; its own reader says what is wrong with them."""
    items = root.values.get(key)
    return items if isinstance(items, list) else []


def read_cameras(root: TableReader, *, floors: Mapping[str, Floor], timezone: str) -> tuple[Camera, ...]:
    """Return the cameras in the order of the file.

    Args:
        root: Reader of the whole file.
        floors: Floors they may look at.
        timezone: Zone of calibration dates without an offset.

    A site whose lines door counters count needs none.
    """
    has_counters = any(isinstance(line, dict) and line.get("counted_by") == "counter" for line in _raw(root, "line"))
    if "camera" not in root.values and not has_counters:
        fix = 'add: [[camera]] with id = "cam-1" and name = "Entrance"'
        root.mistakes.add((), f"{root.label} has no [[camera]]", code="E123", fix=fix)
    tables = root.each("camera")
    cameras: dict[str, Camera] = {}
    for table in tables:
        camera_id = _unique(table, table.id("id", example='"cam-1"'), cameras, kind="camera")
        name = table.text("name", example='"Entrance"', required=True)
        floor_id = read_floor(table, floors)
        calibrations, planes = read_calibrations(table, camera_id, timezone=timezone)
        picture = _picture(table, "picture")
        first_day, end_day = _days(table, timezone=timezone, things="cameras")
        camera = Camera(
            camera_id=camera_id or "",
            name=name or "",
            floor_id=floor_id,
            calibrations=calibrations,
            picture=picture,
            picture_px=_picture_px(table, picture),
            hz=table.number("hz", minimum=0.001, maximum=1000, unit="frames per second", example="1.0"),
            clock=zone(table, "clock") or "UTC",
            engine_ids=table.texts("engine_ids", example='["entrance-left"]'),
            view=read_polygon(table, "view"),
            has_clock="clock" in table.values,
            planes=planes,
            source=read_camera_source(table, camera_id),
            first_day=first_day,
            end_day=end_day,
            ignore_px=table.parsed("ignore_px", example=_IGNORE_PX, parse=_ignored, form=_IGNORE_FORM) or (),
        )
        if planes and "view" not in table.values:
            camera = replace(camera, view=view_of_planes(table, camera))
        table.close()
        if camera_id is not None:
            cameras[camera_id] = camera
    _check_engine_ids(tables)
    return tuple(cameras.values())


def read_areas(root: TableReader, *, floors: Mapping[str, Floor], timezone: str) -> tuple[Area, ...]:
    """Return the areas in the order of the file.

    Args:
        root: Reader of the whole file.
        floors: Floors they may be on.
        timezone: Zone of the site, in which days begin.
    """
    areas: dict[str, Area] = {}
    tables = root.each("area")
    for table in tables:
        area_id = _unique(table, table.id("id", example='"checkout-queue"'), areas, kind="area")
        name = table.text("name", example='"Checkout queue"', required=True)
        floor_id = read_floor(table, floors)
        polygon = read_polygon(table, "polygon", required=True)
        ask = table.text("ask", example='"Could the queue end at the other wall?"')
        first_day, end_day = _days(table, timezone=timezone, things="areas")
        has_visits, is_door, is_staff = (table.flag(key) or False for key in ("visits", "door", "staff"))
        long_s = table.number("long_visit_s", minimum=1, maximum=86_400, unit="seconds", example="120")
        is_queue, served_in = table.flag("queue") or False, table.text("served_in", example='"till-1"')
        limit = table.number("queue_limit", minimum=0, maximum=1_000_000, unit="people", example="5")
        capacity = _capacity(table)
        table.close()
        if area_id is not None:
            areas[area_id] = Area(
                area_id,
                name or "",
                floor_id,
                polygon or (),
                ask,
                first_day,
                end_day,
                has_visits=has_visits,
                is_door=is_door,
                is_staff=is_staff,
                long_visit_s=long_s,
                is_queue=is_queue,
                served_in=served_in,
                queue_limit=limit,
                capacity=capacity,
            )
    for table in tables:
        _check_queue(table, areas)
    return tuple(areas.values())


def _capacity(table: TableReader) -> int | None:
    capacity = table.number("capacity", minimum=1, maximum=1_000_000, unit="people", example="40", whole=True)
    return None if capacity is None else int(capacity)


def _check_queue(table: TableReader, areas: Mapping[str, Area]) -> None:
    """Note a queue that leads to no other area of its floor, and keys of a queue in an area that is none."""
    area, end = areas.get(str(table.values.get("id"))), areas.get(str(table.values.get("served_in")))
    if area is not None and area.queue_limit is not None and not area.is_queue:
        table.fault("queue_limit", f"{table.label} has queue_limit but is no queue", fix="add: queue = true")
    if area is None or area.served_in is None:
        return
    if not area.is_queue:
        table.fault("served_in", f"{table.label} has served_in but is no queue", fix="add: queue = true")
    elif end is None or end is area or end.floor_id != area.floor_id:
        others = [a.area_id for a in areas.values() if a is not area and a.floor_id == area.floor_id]
        what = f"is served in {area.served_in!r}, which is no other area of its floor"
        instead = "describe the place of service, such as a till, with [[area]]"
        table.unknown("served_in", what, nearest(area.served_in, others), instead=instead)


def read_fixtures(root: TableReader, *, floors: Mapping[str, Floor], timezone: str) -> tuple[Fixture, ...]:
    """Return the fixtures in the order of the file: what nobody walks through, and the maps show.

    One that was moved is listed once for each place, with the same id and dates that do not overlap.

    Args:
        root: Reader of the whole file.
        floors: Floors they may stand on.
        timezone: Zone of dates without an offset.
    """
    fixtures: list[Fixture] = []
    for table in root.each("fixture"):
        fixture_id = table.id("id", example='"shelf-1"')
        name = table.text("name", example='"Shelf 1"', required=True)
        floor_id = read_floor(table, floors)
        polygon = read_polygon(table, "polygon", required=True)
        kind = fixture_kind(table)
        is_movable = table.flag("movable") or False
        height_m = table.number("height_m", minimum=0.01, maximum=100, unit="metres", example="1.6")
        since, until = _dates(table, timezone=timezone)
        table.close()
        same = [f for f in fixtures if f.fixture_id == fixture_id and _overlap(f, since, until)]
        if same and (since, until, same[0].valid_from, same[0].valid_to) == (None,) * 4:
            _unique(table, fixture_id, [f.fixture_id for f in same], kind="fixture")
        elif same:
            table.fault(
                "id",
                f"{table.label} is in two places at once: the dates of two fixtures {fixture_id!r} overlap",
                code="E125",
                why="a fixture that was moved has one place until it was moved, and another from then on",
                fix='to = "2026-11-09T06:30" at the old place, from = "2026-11-09T06:30" at the new one',
            )
        elif fixture_id is not None:
            fixtures.append(
                Fixture(fixture_id, name or "", floor_id, polygon or (), kind, is_movable, height_m, since, until)
            )
    return tuple(fixtures)


def read_lines(root: TableReader, *, floors: Mapping[str, Floor], timezone: str) -> tuple[Line, ...]:
    """Return the counting lines in the order of the file.

    Args:
        root: Reader of the whole file.
        floors: Floors they may be on.
        timezone: Zone of the site, in which days begin.
    """
    lines: dict[str, Line] = {}
    for table in root.each("line"):
        line_id = _unique(table, table.id("id", example='"entrance"'), lines, kind="line")
        name = table.text("name", example='"Entrance"', required=True)
        floor_id = read_floor(table, floors)
        counted_by = table.word("counted_by", ("cameras", "counter"), example="counter", fix="counter") or "cameras"
        is_by_counter = counted_by == "counter"
        ends = _line_ends(table)
        if not is_by_counter and "points" not in table.values:
            table.missing("points", _LINE, instead="counted_by")
        left = table.text("left", example='"street"') or "left"
        right = table.text("right", example='"shop"') or "right"
        inside = table.word("inside", _SIDES, example="right", fix="left")
        first_day, end_day = _days(table, timezone=timezone, things="lines")
        if left == right:
            table.fault(
                "right",
                f"{table.label}: both sides are called {left!r}",
                code="E125",
                why="the two directions of a line are told apart by the names of its sides",
                fix='left = "street", right = "shop"',
            )
        table.close()
        if line_id is not None and (ends is not None or is_by_counter):
            life = (first_day, end_day)
            lines[line_id] = Line(line_id, name or "", floor_id, ends, left, right, inside, *life, is_by_counter)
    return tuple(lines.values())


def _line_ends(table: TableReader) -> tuple[Point, Point] | None:
    """Return the two ends of a line."""
    points = table.points("points", least=2, example=_LINE)
    if points is None:
        return None
    first, second = points[0], points[-1]
    length_m = math.dist(first, second)
    if (
        len(points) == 2
        and LINE_LEAST_M <= length_m <= LINE_MOST_M
        and max(map(abs, (*first, *second))) <= _CORNER_MAX_M
    ):
        return first, second
    what = f"has {len(points)} points" if len(points) != 2 else f"is {length_m:g} m long"
    table.fault(
        "points",
        f"{table.label} {what}",
        code="E128",
        why=f"a counting line goes straight from one point to another, {LINE_LEAST_M:g} to {LINE_MOST_M:,.0f} m away",
        fix=f"points = {_LINE}; draw a bent line as several",
    )
    return None


def _dates(table: TableReader, *, timezone: str) -> tuple[datetime | None, datetime | None]:
    """Return the UTC instants `from` which and `to` which something is there; a date is its midnight."""
    parse, example = partial(parse_instant, timezone=timezone), "2026-11-09T06:30:00+01:00"
    since, until = (table.parsed(key, example=example, parse=parse, form=DATE) for key in ("from", "to"))
    if since is not None and until is not None and until <= since:
        table.fault("to", f"{table.label} ends before it begins", code="E125", fix="give a later to, or leave it out")
        return None, None
    return since, until


def _days(table: TableReader, *, timezone: str, things: str) -> tuple[date | None, date | None]:
    """Return the local days `from` which and `to` which a thing counts: whole days, since figures are made of days."""
    since, until = _dates(table, timezone=timezone)
    instants = [at if at is None else at.astimezone(ZoneInfo(timezone)) for at in (since, until)]
    for key, at in zip(("from", "to"), instants, strict=True):
        if at is not None and at.time() != time():
            table.fault(
                key,
                f"{table.label} {key} has a time of day, but {things} count whole days",
                code="E125",
                why="the figures of that day would mix hours with and without it",
                fix=f'{key} = "{at.date()}"',
            )
    first_day, end_day = (None if at is None else at.date() for at in instants)
    return first_day, end_day


def _overlap(one: Fixture, since: datetime | None, until: datetime | None) -> bool:
    """Tell whether a fixture is there at some time between two instants; None = without an end."""
    is_before = one.valid_to is not None and since is not None and one.valid_to <= since
    is_after = one.valid_from is not None and until is not None and one.valid_from >= until
    return not (is_before or is_after)


def fixture_kind(table: TableReader) -> FixtureKind:
    """Return the kind of a fixture; "shelf" where none is stated."""
    known: tuple[FixtureKind, ...] = get_args(FixtureKind)
    return table.word("kind", known, example="shelf", fix="other") or known[0]


def _unique(table: TableReader, value: str | None, taken: Iterable[str], *, kind: str) -> str | None:
    if value is not None and value in taken:
        table.fault(
            "id",
            f"two {kind}s have the id {value!r}",
            code="E125",
            why="every id stands for one thing",
            fix="give one of them another id",
        )
        return None
    return value


def read_floor(table: TableReader, floors: Mapping[str, Floor]) -> str:
    """Return the floor a camera, area or fixture is on; a site with one floor needs no `floor` key."""
    only = next(iter(floors))
    value = table.text("floor", example=f'"{only}"')
    if value is None:
        if "floor" not in table.values and len(floors) > 1:
            table.missing("floor", f'"{only}"', why=f"the site has {len(floors)} floors")
        return only
    if value not in floors:
        instead = f"known floors: {', '.join(floors)}; or describe it with [[floor]]"
        what = f"is on floor {value!r}, which is not described"
        table.unknown("floor", what, nearest(value, floors), instead=instead)
        return only
    return value


def _picture(table: TableReader, key: str, *, suffixes: tuple[str, ...] | None = None) -> Path | None:
    """Return a picture file that can be read."""
    path = table.file(key, example=f'"{key}s/example.png"')
    if path is None:
        return None
    if suffixes is not None and path.suffix.lower() not in suffixes:
        table.fault(key, f"{table.label} {key} must be an SVG, PNG or JPG picture", code="E126", fix=_as_picture(path))
    elif picture_size(path) is None:
        what = f"{table.label} {key} {table.values[key]!r} is not a readable picture"
        table.fault(key, what, code="E126", fix="export it as PNG again")
    return path


def _as_picture(path: Path) -> str:
    """Return how an architect's drawing becomes a picture with a known scale."""
    file = shlex.quote(path.name)
    match path.suffix.lower():
        case ".dxf":
            return (
                f"vsd check {file} --picture {shlex.quote(path.stem)}.svg makes it, and prints the lines for vsd.toml"
            )
        case ".dwg":
            return "save it as DXF in the CAD program; then: vsd check FILE.dxf --picture plan.svg"
        case ".pdf":
            return (
                f"pdftoppm -png -r 150 -singlefile {file} plan makes plan.png; its plan_m_per_px is scale * "
                "0.0254 / 150: 0.0169 for 1:100"
            )
    return "export it as PNG"


def _picture_px(table: TableReader, picture: Path | None) -> tuple[int, int] | None:
    """Return the picture size given, else that of the picture file."""
    given: tuple[int, int] | None = table.parsed(
        "picture_px", example="[1920, 1080]", parse=parse_picture_px, form=_PICTURE_PX
    )
    if given is not None or picture is None:
        return given
    size_px = picture_size(picture)
    return (round(size_px[0]), round(size_px[1])) if size_px else None


def read_polygon(table: TableReader, key: str, *, required: bool = False) -> tuple[Point, ...] | None:
    """Return the corners of a simple polygon in floor metres."""
    points = table.points(key, least=3, example=_POLYGON)
    if points is None:
        if required and key not in table.values:
            table.missing(key, _POLYGON)
        return None
    xs, ys = zip(*points, strict=True)
    box_m2 = (max(xs) - min(xs)) * (max(ys) - min(ys))
    if max(map(abs, (*xs, *ys))) > _CORNER_MAX_M or box_m2 > BOX_MAX_M2:
        table.fault(
            key,
            f"{table.label} {key} is too large: {box_m2:g} m2 from corner to corner",
            code="E128",
            why=f"at most {BOX_MAX_M2:,.0f} m2, and no corner beyond {_CORNER_MAX_M:,.0f} m; corners are in metres",
            fix="give the corners in floor metres, not millimetres or pixels; split a very large area",
        )
        return None
    return points if is_simple(table, key, points) else None


def _ignored(value: Any) -> tuple[tuple[Point, ...], ...]:
    """Return polygons in a picture."""
    from shapely import Polygon

    polygons: list[tuple[Point, ...]] = []
    for corners in value if isinstance(value, list) else [value]:
        pairs = [c for c in corners if isinstance(c, list) and len(c) == 2] if isinstance(corners, list) else []
        numbers = [v for pair in pairs for v in pair]
        if len(pairs) < 3 or len(pairs) != len(corners) or not all(type(v) in (int, float) for v in numbers):
            raise ValueError("it is no list of polygons, each with three corners [column, row] or more, in pixels")
        shape = Polygon(pairs)
        if not (shape.is_valid and shape.area > 0):
            raise ValueError("a polygon crosses or touches itself, or has no area")
        polygons.append(tuple((float(u), float(v)) for u, v in pairs))
    return tuple(polygons)


def _check_engine_ids(tables: Iterable[TableReader]) -> None:
    """Note engine ids that two cameras have, or that are the id of another camera."""
    owners = {str(table.values.get("id")): table.values.get("id") for table in tables}
    for table in tables:
        given = table.values.get("engine_ids")
        for engine_id in given if isinstance(given, list) else ():
            owner = table.values.get("id")
            if isinstance(engine_id, str) and owners.setdefault(engine_id, owner) != owner:
                table.fault(
                    "engine_ids",
                    f"engine id {engine_id!r} also means camera {owners[engine_id]!r}",
                    code="E125",
                    why="records of one engine id belong to one camera",
                    fix="name each engine id at one camera",
                )
