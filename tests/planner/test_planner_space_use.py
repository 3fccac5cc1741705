"""How a space is used, on the planner's page: the report's figures as a section, and flow as a layer of the map."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import shapely
from figures.walkers_between_areas import HOSTILE, week_of_walkers
from planner.written_address import written_address
from report import ingested_worlds as w

from vsd_analytics.answer import VALUES, Answer, Answers, Value
from vsd_analytics.config.project import load_site
from vsd_analytics.planner.drawing import UNIT
from vsd_analytics.planner.flow_layer import flow_layer
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData, planner_pages
from vsd_analytics.planner.space_use import space_use_view
from vsd_analytics.report.draw.floor_frame import Frame
from vsd_analytics.wording.reasons import read_reason

SHOWN = (
    "() => [...document.querySelectorAll('.dl,.da')].filter(e => e.checkVisibility()).map(e => e.dataset.from || '')"
)


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> PlannerData:
    root = week_of_walkers(tmp_path_factory.mktemp("planner-flow"))
    toml = root / "vsd.toml"
    asking = 'id = "till"\nqueue = true\nserved_in = "door"\ncapacity = 2\n'
    toml.write_text(toml.read_text("utf-8").replace('id = "till"\n', asking), encoding="utf-8")
    return planner_pages(load_site(root), w.MONDAY)[0]


def test_it_has_the_figures_of_the_report(walked: PlannerData) -> None:
    report = w.report(walked.site)
    assert {answer.name for answer in walked.space} == {
        *("visits", "flow", "flow_areas", "flow_routes", "flow_links", "walking_directions"),
        *("queues", "queue_hours", "capacity"),
    }
    assert [answer for answer in walked.space if answer != report.answers[answer.name]] == []


def test_rare_ways_are_others_and_no_name_is_markup(walked: PlannerData) -> None:
    found = space_use_view(walked.space)
    assert found is not None
    to = dict(zip(found.to, next(r for r in found.leaving if r.name == "Door").cells, strict=True))
    assert to["Till"].value == "", "two people went there from the door"
    assert (to["Till"].note, to["Door"].note) == ("under “Others”", "none seen")
    assert float(to[HOSTILE].value.rstrip("%")) + float(to["Others"].value.rstrip("%")) == pytest.approx(100, abs=1)
    assert [r.name for r in found.visits] == ["Door", HOSTILE, "Wine", "Till"]
    page = render_planner(walked)
    assert HOSTILE not in page
    assert "&lt;b&gt;Bread" in page
    assert 'data-from="area:door" data-to="area:till"' not in page


def test_a_reason_stands_where_a_figure_is_missing(walked: PlannerData) -> None:
    why = {"visits": "needs 5 days", "flow": "all were lost"}
    data = replace(walked, space=Answers(without_values(a, why[a.name]) if a.name in why else a for a in walked.space))
    found = space_use_view(data.space)
    assert found is not None
    assert {r.visits_per_open_h.note for r in found.visits} == {"needs 5 days"}
    assert {(r.reason, r.cells) for r in found.leaving} == {("all were lost", ())}
    assert render_planner(data).count("all were lost") == len(found.leaving)


def without_values(answer: Answer, why: str) -> Answer:
    """Return an answer of which nothing is known."""
    missing = Value.missing(read_reason(why))
    known = {c.name: missing for c in answer.columns if c.kind in VALUES and c.name != "recorded_share"}
    return replace(answer, rows=tuple({**row, **known} for row in answer.rows))


def test_nothing_is_drawn_over_floor_that_no_camera_recorded(walked: PlannerData) -> None:
    assert walked.shown is not None
    x0, y0, x1, y1 = walked.shown.extent
    dark = ((5.0, y0), (7.0, y0), (7.0, y1), (5.0, y1))
    frame = Frame(walked.shown, width=(x1 - x0) * UNIT, height=(y1 - y0) * UNIT)
    blind = shapely.Polygon(frame.ring(dark))

    def over(floor: Any) -> list[float]:
        layer = flow_layer(walked.space, floor, frame, least=5, distance_unit="m")
        assert layer is not None
        outer = [re.findall(r"(-?\d+) (-?\d+)", i.path.split("z")[0]) for i in layer.lines]
        return [shapely.Polygon([(int(x), int(y)) for x, y in ring]).intersection(blind).area for ring in outer]

    assert max(over(walked.shown)) > 100
    assert max(over(replace(walked.shown, unseen=((dark,),)))) < 100, "but for whole numbers along the edge"


def test_nobody_asks_nothing_is_said(exact: PlannerData) -> None:
    page = render_planner(exact)
    assert exact.space == Answers()
    assert 'id="flow"' not in page
    assert "How the space is used" not in page


@pytest.mark.browser
@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 390)])
def test_the_layer_is_chosen_by_keyboard_and_kept_in_the_address(
    walked: PlannerData, tab: Callable[..., Any], axe: Callable[..., Any], tmp_path: Path, scheme: str, width: int
) -> None:
    path = tmp_path / "planner.html"
    path.write_text(render_planner(walked), encoding="utf-8")
    page = tab(path.as_uri(), color_scheme=scheme, viewport={"width": width, "height": 900}, bypass_csp=True)
    page.wait_for_function("document.body.dataset.first")
    assert page.evaluate(SHOWN) == []
    page.focus("#flow")
    page.keyboard.press("ArrowDown")
    assert written_address(page).endswith("#flow=lines")
    every = page.evaluate(SHOWN)
    for address in ("#flow=lines&place=area%3Awine", "#flow=arrows"):
        page.evaluate("at => { location.hash = at; dispatchEvent(new HashChangeEvent('hashchange')); }", address)
        assert axe(page) == []
        shown = page.evaluate(SHOWN)
        assert shown == [""] * len(shown) if "arrows" in address else 0 < len(shown) < len(every)
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
    assert page.input_value("#flow") == "arrows"
    assert page.errors == []
