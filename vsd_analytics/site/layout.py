"""Edits of a layout that somebody thinks about: fixtures, doors, one-way rules and opening hours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from vsd_analytics.site.model import Point

Spans = tuple[tuple[int, int], ...]
DoorKind = Literal["exit", "entrance"]


@dataclass(frozen=True, slots=True)
class FixtureEdit:
    """A fixture or barrier that is added, moved or removed.

    Attributes:
        fixture_id: Its id; that of a fixture of the site where it is moved or removed.
        name: Display name; free text, always escaped.
        old_polygon: Where it is, floor metres; None where it is added.
        new_polygon: Where it would be; None where it is removed.
        follow_share: Share of the stays at it that would move with it, 0 to 1; None = not stated.
        is_choice: One of several places for one fixture, which are compared.
    """

    fixture_id: str
    name: str
    old_polygon: tuple[Point, ...] | None
    new_polygon: tuple[Point, ...] | None
    follow_share: float | None = None
    is_choice: bool = False


@dataclass(frozen=True, slots=True)
class DoorEdit:
    """A way through a line that gets another width.

    Attributes:
        name: Display name.
        line: The two ends of the opening, floor metres.
        kind: "exit": people queue in front of it; "entrance": it meters the way behind it.
        width_m: Clear width now.
        new_width_m: Clear width thought of.
    """

    name: str
    line: tuple[Point, Point]
    kind: DoorKind
    width_m: float
    new_width_m: float


@dataclass(frozen=True, slots=True)
class OneWayEdit:
    """A way through a line that people would walk in one direction only.

    Attributes:
        name: Display name.
        line: Two points, floor metres; the direction allowed crosses it from its left to its right side, seen from the
            first point towards the second.
    """

    name: str
    line: tuple[Point, Point]


@dataclass(frozen=True, slots=True)
class OpeningEdit:
    """Other opening hours.

    Attributes:
        opening: For weekday 0 (Monday) to 6: (start, end) in minutes after local midnight.
        follow_share: Share of the people of hours that close who would come in an open hour; None = not stated.
    """

    opening: tuple[Spans, ...]
    follow_share: float | None = None


Edit: TypeAlias = FixtureEdit | DoorEdit | OneWayEdit | OpeningEdit


@dataclass(frozen=True, slots=True)
class LayoutEdits:
    """A file of edits, each of which is answered by itself.

    Attributes:
        floor_id: Their floor.
        edits: The edits in the order of the file.
        text: The file.
    """

    floor_id: str
    edits: tuple[Edit, ...]
    text: str
