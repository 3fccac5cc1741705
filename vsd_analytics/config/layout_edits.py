"""Reader of a file of layout edits (`vsd whatif EDIT.toml`), in the words of `vsd.toml`."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any, Final, get_args

from vsd_analytics.config.floors import fixture_kind, read_floor, read_polygon
from vsd_analytics.config.opening_hours import read_opening
from vsd_analytics.config.project import refused
from vsd_analytics.config.reader import Mistakes, TableReader
from vsd_analytics.config.toml_lines import TomlText, read_toml, syntax_problem
from vsd_analytics.errors import UsageError, VsdError, nearest
from vsd_analytics.owners import is_there
from vsd_analytics.site.layout import DoorEdit, DoorKind, Edit, FixtureEdit, LayoutEdits, OneWayEdit, OpeningEdit
from vsd_analytics.site.model import Fixture, Point, Site
from vsd_analytics.site.places import fixtures_at

EXAMPLE: Final = '[[fixture]] with id = "display", polygon = [[1, 5], [2, 5], [2, 6], [1, 6]]'
_LINE: Final = "[[4.0, 2.0], [4.0, 3.8]]"
WIDTH_M: Final = (0.3, 50.0)
OVERLAP_M2: Final = 0.05


def read_edits(path: Path, site: Site, *, last_day: date) -> LayoutEdits:
    """Read a file of edits; every mistake of it is reported at once, with its line.

    A `[[fixture]]` with the id of a fixture that is there moves it to `polygon`, or takes it away with `remove = true`;
    any other id adds one. With `places`, a list of middles, it is tried at each. A `[[door]]` gets another width, a
    `[[one_way]]` one direction, `[site]` other opening hours.

    Args:
        path: The file.
        site: The site it is about.
        last_day: Local day whose fixtures are edited.

    Raises:
        UsageError: E101, there is no such file.
        ConfigError: E103, it has mistakes; E121 is one of them where it is no TOML.
    """
    if not is_there(path) or not path.is_file():
        raise UsageError(f"there is no file {str(path)!r}", fix=f"write it: {EXAMPLE}; docs/whatif.md has all edits")
    text, problem = read_toml(path, name=path.name)
    return _edits(text, problem, site, last_day)


def read_edits_text(text: str, site: Site, *, last_day: date) -> LayoutEdits:
    """Read edits that somebody typed, as `read_edits`.

    Args:
        text: The text of such a file.
        site: The site it is about.
        last_day: Local day whose fixtures are edited.

    Raises:
        ConfigError: E103, as there.
    """
    typed = TomlText("the text", text)
    return _edits(typed, syntax_problem(typed), site, last_day)


def _edits(text: TomlText, problem: VsdError | None, site: Site, last_day: date) -> LayoutEdits:
    if problem is not None:
        raise refused(text.file, (problem,))
    mistakes = Mistakes(text)
    root = TableReader(tomllib.loads(text.text), path=(), label=text.file, mistakes=mistakes, folder=site.root)
    floor_id = read_floor(root, {floor.floor_id: floor for floor in site.floors})
    there = {f.fixture_id: f for f in fixtures_at(site, floor_id, last_day)}
    tables = root.each("fixture")
    edited = {str(table.values.get("id")) for table in tables}
    standing = [f for f in there.values() if f.fixture_id not in edited]
    edits: list[Edit | None] = [edit for table in tables for edit in _fixture(table, there, standing)]
    edits += [_door(table) for table in root.each("door")]
    edits += [_one_way(table) for table in root.each("one_way")]
    edits += [_opening(root.inner("site"), mistakes)]
    root.close()
    known = tuple(edit for edit in edits if edit is not None)
    if not known and not mistakes.all:
        mistakes.add((), f"{text.file} edits nothing", code="E123", fix=f"add an edit, such as {EXAMPLE}")
    if mistakes.all:
        raise refused(text.file, mistakes.all)
    return LayoutEdits(floor_id, known, text.text)


def _fixture(
    table: TableReader, there: Mapping[str, Fixture], standing: Sequence[Fixture]
) -> Sequence[FixtureEdit | None]:
    fixture_id = table.id("id", example='"display"')
    old = there.get(fixture_id or "")
    name = table.text("name", example='"Display"') or (old.name if old is not None else fixture_id or "")
    is_removed = table.flag("remove") or False
    middles = None if is_removed else table.points("places", least=2, example="[[2.5, 7.0], [6.0, 3.5]]")
    polygon = read_polygon(table, "polygon", required=not is_removed and not (middles and old))
    follow_share = _share(table, "follow_share")
    fixture_kind(table)
    table.number("height_m", minimum=0.01, maximum=100, unit="metres", example="1.6")
    table.flag("movable")
    table.close()
    if fixture_id is None:
        return ()
    if is_removed and old is None:
        table.unknown(
            "id", f"removes {fixture_id!r}, which is not there", nearest(fixture_id, there),
            instead=f"fixtures of the floor: {', '.join(there) or 'none'}",
        )  # fmt: skip
        return ()
    if is_removed and polygon is not None:
        table.fault("polygon", f"{table.label} has remove and polygon", fix="take one of the two lines out")
        return ()
    if follow_share is not None and old is None:
        table.fault(
            "follow_share", f"{table.label} follow_share: {fixture_id!r} is new, so nobody stays at it yet",
            why="it is the share of the stays at a fixture that move with it", fix="take the line out",
        )  # fmt: skip
        return ()
    old_polygon = None if old is None else old.polygon
    shape = polygon or old_polygon
    if shape is None or (polygon is None and not is_removed and middles is None):
        return ()
    edit = FixtureEdit(fixture_id, name, old_polygon, polygon, follow_share)
    if middles is None:
        return [edit if polygon is None or _has_room(table, "polygon", polygon, standing) else None]
    tried = []
    for k, middle in enumerate(middles, start=1):
        place = _moved(shape, middle)
        has_room = _has_room(table, "places", place, standing)
        tried.append(replace(edit, name=f"{name} {k}", new_polygon=place, is_choice=True) if has_room else None)
    return tried


def _moved(polygon: tuple[Point, ...], middle: Point) -> tuple[Point, ...]:
    """Return a polygon moved to a middle: that of the rectangle around it."""
    from_x, from_y = ((min(v) + max(v)) / 2 for v in zip(*polygon, strict=True))
    return tuple((round(x + middle[0] - from_x, 3), round(y + middle[1] - from_y, 3)) for x, y in polygon)


def _has_room(table: TableReader, key: str, polygon: Sequence[Point], standing: Sequence[Fixture]) -> bool:
    """Return whether a polygon lies beside what stays where it is, after noting a mistake where it does not."""
    below = _overlapped(polygon, standing)
    if below is not None:
        table.fault(
            key, f"{table.label} {key} lies on {below.fixture_id!r}, which stays where it is", code="E128",
            why="two fixtures cannot be at one place", fix="move it beside that one, or move or remove that one, too",
        )  # fmt: skip
    return below is None


def _overlapped(polygon: Sequence[Point], standing: Sequence[Fixture]) -> Fixture | None:
    """Return a fixture on which a polygon lies, by more than corners given to the centimetre may."""
    import shapely

    shape = shapely.Polygon(polygon)
    return next((f for f in standing if shape.intersection(shapely.Polygon(f.polygon)).area > OVERLAP_M2), None)


def _door(table: TableReader) -> DoorEdit | None:
    name = table.text("name", example='"Main door"') or "door"
    line = _line(table)
    kinds: tuple[DoorKind, ...] = get_args(DoorKind)
    kind = table.word("kind", kinds, example="exit", fix="exit")
    if kind is None and "kind" not in table.values:
        table.missing("kind", '"exit"', why="a queue forms before an exit; an entrance meters the way behind it")
    widths = [_width(table, key, example) for key, example in (("width_m", "1.8"), ("new_width_m", "1.2"))]
    table.close()
    width_m, new_width_m = widths
    if line is None or kind is None or width_m is None or new_width_m is None:
        return None
    if width_m == new_width_m:
        table.fault("new_width_m", f"{table.label} new_width_m equals width_m", fix="give the width thought of")
        return None
    return DoorEdit(name, line, kind, width_m, new_width_m)


def _one_way(table: TableReader) -> OneWayEdit | None:
    name = table.text("name", example='"Aisle 2"') or "way"
    line = _line(table)
    table.close()
    return None if line is None else OneWayEdit(name, line)


def _opening(table: TableReader, mistakes: Mistakes) -> OpeningEdit | None:
    opening = read_opening(table)
    follow_share = _share(table, "follow_share")
    table.close()
    if opening is None and table.values and not mistakes.all:
        table.missing("opening", '{ mon-sat = "08:00-20:00" }')
    return None if opening is None else OpeningEdit(tuple(opening), follow_share)


def _line(table: TableReader) -> tuple[Point, Point] | None:
    points = table.points("line", least=2, example=_LINE)
    if points is None:
        if "line" not in table.values:
            table.missing("line", _LINE, why="its two ends say where people pass, in floor metres")
        return None
    if len(points) != 2 or math.dist(*points) < WIDTH_M[0]:
        table.refuse("line", f"must be two points at least {WIDTH_M[0]} m apart", _LINE, code="E128")
        return None
    return points[0], points[1]


def _width(table: TableReader, key: str, example: str) -> float | None:
    if key not in table.values:
        table.missing(key, example, why="the rule is the ratio of the two clear widths")
    return table.number(key, minimum=WIDTH_M[0], maximum=WIDTH_M[1], unit="metres", example=example)


def _share(table: TableReader, key: str) -> float | None:
    return table.number(key, minimum=0, maximum=1, unit="", example="0.5")


def edit_words(edits: LayoutEdits) -> dict[str, Any]:
    """Return the values of a file of edits, without its comments and spaces."""
    return tomllib.loads(edits.text)
