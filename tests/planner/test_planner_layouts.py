"""Fixtures with dates on the planner's page: each selection draws what stood there in its days."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from planner import planted_shop as planted

from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.site.model import Fixture, Site

MOVED = datetime(planted.MONDAY.year, planted.MONDAY.month, planted.MONDAY.day, 5, tzinfo=UTC)


def display(x_m: float, **dates: datetime) -> Fixture:
    ring = ((x_m, 11.0), (x_m + 1, 11.0), (x_m + 1, 12.0), (x_m, 12.0))
    return Fixture("display", "Display", "ground", ring, is_movable=True, **dates)


@pytest.fixture(scope="module")
def moved(shop: Site) -> PlannerData:
    both = (*shop.fixtures, display(2.0, valid_to=MOVED), display(12.0, valid_from=MOVED))
    return planted.known(planted.with_settings(replace(shop, fixtures=both), **planted.WHOLE))


def test_each_week_has_the_fixtures_of_its_end(moved: PlannerData) -> None:
    now, before = ([f.ring[0][0] for f in layout if f.fixture_id == "display"] for layout in moved.layouts[:2])
    assert (now, before) == ([12.0], [2.0])


def test_a_floor_on_which_nothing_was_moved_has_one_layout(exact: PlannerData) -> None:
    assert exact.layouts == ()
    assert "data-in=" not in render_planner(exact)


@pytest.mark.browser
def test_the_week_draws_its_own_layout_and_the_difference_both(
    tab: Callable[..., Any], moved: PlannerData, tmp_path: Path
) -> None:
    path = tmp_path / "planner.html"
    path.write_text(render_planner(moved), encoding="utf-8")
    page = tab(path.as_uri())
    page.wait_for_function("document.body.dataset.first")
    seen = """() => [...document.querySelectorAll('#plan g[data-in]')].map(e =>
        [e.dataset.in, getComputedStyle(e).visibility, getComputedStyle(e.firstChild).fill !== 'none'])
        .filter(e => e[0].length === 1).sort()"""
    assert page.evaluate(seen) == [["0", "visible", True], ["1", "hidden", True]]
    assert not page.is_visible("#moved")
    page.check("[name=show][value=difference]")
    assert page.evaluate(seen) == [["0", "visible", True], ["1", "visible", False]]
    assert page.is_visible("#moved"), "the outline has its key"
    assert page.evaluate(
        "[...document.querySelectorAll('.fn[data-in=\"1\"]')].map(e => getComputedStyle(e).visibility)"
    ) == ["hidden"], "what is gone has no name"
