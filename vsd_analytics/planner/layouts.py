"""Fixtures on the planner's page: which of them each selection shows, and each drawn once with its name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Any

import shapely
from markupsafe import Markup

from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.density import fixtures_at
from vsd_analytics.figures.week.floor_maps import map_fixtures
from vsd_analytics.figures.week.model_map import MapFixture
from vsd_analytics.planner.logged_changes import PlannerChange
from vsd_analytics.report.draw.floor_frame import Frame, fixtures
from vsd_analytics.report.draw.svg import el

Layout = tuple[MapFixture, ...]


def layouts(data: WeekData, *, before: date, changes: Sequence[PlannerChange]) -> tuple[Layout, ...]:
    """Return the fixtures at the end of this week, of the other week, and before and after each logged change.

    Args:
        data: This week.
        before: First day of the other week.
        changes: The logged changes; sides without weeks have this week's layout.

    Returns:
        2 + 2 * n_changes layouts; none where they are all alike.
    """
    days = [data.sunday, before + timedelta(days=6)]
    for change in changes:
        days += [data.sunday if side is None else side.days[1] for side in (change.before, change.after)]
    all_layouts = tuple(map_fixtures(fixtures_at(data, day)) for day in days)
    return all_layouts if len(set(all_layouts)) > 1 else ()


def movable(layout: Layout) -> list[dict[str, Any]]:
    """Return id, name and corners of each fixture, for the page's "Try a layout"."""
    return [{"id": f.fixture_id, "name": f.name, "ring": f.ring} for f in layout]


@dataclass(frozen=True, slots=True, kw_only=True)
class FixtureLabel:
    """A fixture's name in its middle, along its longer side, and the room it has, in units of the drawing.

    `layouts` are the numbers of those it belongs to, with spaces between; "" where there is one layout.
    """

    text: str
    x: int
    y: int
    along: int
    is_upright: bool
    layouts: str


def drawn_fixtures(layouts: Sequence[Layout], frame: Frame) -> tuple[tuple[Markup, ...], tuple[FixtureLabel, ...]]:
    """Return the fixtures of all layouts, walls first, and their names.

    Args:
        layouts: Fixtures by selection of the page; at least one layout.
        frame: The frame.
    """
    every = sorted(dict.fromkeys(f for layout in layouts for f in layout), key=lambda f: f.kind != "wall")
    fixture_layouts = [
        (f, " ".join(str(k) for k, layout in enumerate(layouts) if f in layout) if len(layouts) > 1 else "")
        for f in every
    ]
    drawings = tuple(_fixture(f, frame, among) for f, among in fixture_layouts)
    return drawings, tuple(_fixture_label(f, frame, among) for f, among in fixture_layouts)


def _fixture(fixture: MapFixture, frame: Frame, among: str) -> Markup:
    drawn = Markup("").join(fixtures((fixture,), frame, is_named=False))
    return el("g", drawn, data_in=among) if among else drawn


def _fixture_label(fixture: MapFixture, frame: Frame, among: str) -> FixtureLabel:
    shape = shapely.Polygon(frame.ring(fixture.ring))
    at = shape.centroid if shape.centroid.within(shape) else shape.representative_point()
    left, top, right, bottom = shape.bounds
    wide, tall = round(right - left), round(bottom - top)
    room = 2 * max(wide, tall) if fixture.is_movable else max(wide, tall)
    is_upright = tall > wide and not fixture.is_movable
    return FixtureLabel(
        text=fixture.name, x=round(at.x), y=round(at.y), along=room, is_upright=is_upright, layouts=among
    )
