"""Questions with a memory, places without weight, and dated fixtures, in reports of small worlds."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from report import ingested_worlds as w
from report import model_classes as m
from report import sample_sections as weeks

from vsd_analytics.cli import cli
from vsd_analytics.config.asked_questions import read_asked
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.week.floor_maps import _heaviest_patch, _spots
from vsd_analytics.report.pages.questions import FACTS, candidates
from vsd_analytics.report.pages.spot_cards import cards
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Site

SHORT = '{ mon-sun = "09:00-10:00" }'
COUNTS = {w.QUEUE: 20, w.DOOR: 12, w.AISLE: 5}
WEEKS = ("2026-W44", "2026-W45", "2026-W46")
MOVED = f"{w.MONDAY}T06:30"
STAND = '[[fixture]]\nid = "stand"\nname = "Stand"\nmovable = true\n'
OLD = f'{STAND}polygon = [[9, 1], [10, 1], [10, 2], [9, 2]]\nto = "{MOVED}"\n'
NEW = f'{STAND}polygon = [[13, 6], [14, 6], [14, 7], [13, 7]]\nfrom = "{MOVED}"\n'


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Three weeks of one camera, all alike, with a stand that was moved before the last one began."""
    streams = [w.messages(w.steady(COUNTS), monday=w.MONDAY - timedelta(weeks=k), hours=(9, 10)) for k in (2, 1, 0)]
    config = w.toml(opening=SHORT, more=OLD + NEW)
    return w.world(tmp_path_factory.mktemp("agenda") / "shop", config, *streams)


def vsd(site: Site, *words: str) -> str:
    result = CliRunner().invoke(cli, ["-C", str(site.root), "--now", "2026-11-20T12:00Z", *words])
    assert result.exit_code == 0, result.output
    return result.output


def page(site: Site, week: str) -> str:
    vsd(site, "report", "--week", week, "--format", "html,json")
    return (site.root / "reports" / f"{week}.html").read_text(encoding="utf-8")


def test_weeks_in_their_order_never_ask_alike_and_a_week_made_again_is_the_same_page(site: Site) -> None:
    pages = {week: page(site, week) for week in WEEKS}
    asked = read_asked(site)
    assert len({one.text for one in asked}) == 3
    assert asked[1].text.startswith("Still open from week 44:")
    assert (asked[0].place, asked[0].remedy) == (asked[1].place, asked[1].remedy) != (asked[2].place, asked[2].remedy)
    before = (site.root / "questions.jsonl").read_bytes()
    assert {week: page(site, week) for week in reversed(WEEKS)} == pages
    assert (site.root / "questions.jsonl").read_bytes() == before
    for one, week in zip(asked, WEEKS, strict=True):
        twin = json.loads((site.root / "reports" / f"{week}.json").read_bytes())
        assert (twin["story"]["question"], twin["story"]["question_id"]) == (one.text, one.question_id)
        assert one.question_id in pages[week]


def test_an_answer_is_on_the_next_page_and_not_on_earlier_ones(site: Site) -> None:
    page(site, "2026-W44")
    before = page(site, "2026-W45")
    first = read_asked(site)[0]
    vsd(
        site,
        "log",
        "answer",
        first.question_id,
        "not-possible",
        "--text",
        "No room",
        "--at",
        "2026-11-10",
        "--by",
        "Anna",
    )
    assert page(site, "2026-W45") == before
    assert "Not possible by Anna. No room." in page(site, "2026-W46")
    (site.root / "log.jsonl").unlink()


@pytest.mark.parametrize("answer", ["tried", "not-possible", "later"])
def test_a_week_whose_question_is_answered_asks_nothing_when_it_is_made_again(site: Site, answer: str) -> None:
    first = page(site, "2026-W46")
    asked = read_asked(site)[-1]
    assert f"Q46-{asked.place}" in first
    try:
        vsd(site, "log", "answer", asked.question_id, answer, "--at", "2026-11-18", "--by", "Anna")
        again = page(site, "2026-W46")
        twin = json.loads((site.root / "reports" / "2026-W46.json").read_bytes())
    finally:
        (site.root / "log.jsonl").unlink()
    assert (twin["story"]["question"], twin["story"]["question_id"]) == ("", "")
    assert "by Anna" in again
    assert "A question for this week" not in again
    assert asked == read_asked(site)[-1]  # nothing else was asked in its place
    assert page(site, "2026-W46") == first


@pytest.mark.parametrize(("apart_m", "is_testable"), [(1, True), (30, False)])
def test_a_change_that_no_area_can_be_compared_with_is_not_asked_for(
    site: Site, apart_m: int, is_testable: bool
) -> None:
    toml = (site.root / "vsd.toml").read_text(encoding="utf-8")
    try:
        (site.root / "vsd.toml").write_text(f"{toml}\n[analysis]\nchange_apart_m = {apart_m}\n", encoding="utf-8")
        report = w.report(load_site(site.root))
    finally:
        (site.root / "vsd.toml").write_text(toml, encoding="utf-8")
    assert report.agenda is not None
    known = {p.place: p.is_testable for p in report.agenda.places}
    assert known == {"queue": is_testable, "door": is_testable, "rest": True}
    asked = {c.place for c in candidates(report) if c.remedy not in FACTS}
    assert ({"queue", "door"} <= asked) is is_testable
    assert "floor" in asked  # there is always a question left


def test_a_rise_at_a_place_without_weight_is_no_material_place(site: Site) -> None:
    report = w.report(site)
    assert {a.area_id: a.is_material for a in report.areas} == {"queue": True, "door": True, None: True}
    assert report.spots is not None
    n_spots = len(report.spots.cards) + report.spots.n_more
    toml = (site.root / "vsd.toml").read_text(encoding="utf-8")
    try:
        (site.root / "vsd.toml").write_text(toml + "\n[report]\nmaterial_share = 0.4\n", encoding="utf-8")
        report = w.report(load_site(site.root))
    finally:
        (site.root / "vsd.toml").write_text(toml, encoding="utf-8")
    assert {a.area_id: a.is_material for a in report.areas} == {"queue": True, "door": False, None: False}
    assert report.spots is not None
    assert report.spots.kind == "tested"
    assert report.spots.n_more == n_spots - len(report.spots.cards) > 0  # the planner shows them
    assert report.agenda is not None
    assert [p.place for p in report.agenda.places] == ["queue"]


def test_old_weeks_draw_the_old_layout_and_the_week_of_the_move_draws_both(site: Site) -> None:
    before, now = w.report(site, w.BEFORE), w.report(site)
    rings = [[f.ring for f in r.maps[0].fixtures] for r in (before, now)]
    assert rings[0] == [((9.0, 1.0), (10.0, 1.0), (10.0, 2.0), (9.0, 2.0))]
    assert rings[1] == [((13.0, 6.0), (14.0, 6.0), (14.0, 7.0), (13.0, 7.0))]
    assert before.agenda is not None
    assert now.agenda is not None
    keys = [{r.key for p in made.agenda.places for r in p.remedies} for made in (before, now) if made.agenda]
    assert "move-stand" in keys[0]
    assert "move-stand" not in keys[1]  # it was moved this week: watch first
    assert before.change_maps is not None
    assert before.change_maps.fixtures_before is None
    assert now.change_maps is not None
    assert [f.ring for f in now.change_maps.fixtures_before or ()] == rings[0]
    drawn = render_html(now)
    assert drawn.count('class="gn"') == 2  # beside this week's layout and in the difference
    assert "where Stand stood before" in drawn
    assert 'class="gn"' not in render_html(before)


def test_the_number_of_an_area_is_at_its_heaviest_patch_and_not_where_a_neighbours_edge_reaches_in() -> None:
    own = np.zeros((9, 9))
    own[2:6, 2:6] = 2.0
    own[8, 0] = 5.0  # the edge of a patch that lies outside the area
    kept = _heaviest_patch(own, 0.5)
    assert np.unravel_index(int(kept.argmax()), kept.shape) == (2, 2)
    assert kept[8, 0] == 0.0
    assert not _heaviest_patch(own, 9.0).any()
    settings = SimpleNamespace(heat_steps=(0.5,))
    queue = SimpleNamespace(area_id="queue", name="Queue", polygon=((0, 0), (9, 0), (9, 9), (0, 9)))
    data: Any = SimpleNamespace(areas=[queue], site=SimpleNamespace(settings=settings))
    grid: Any = SimpleNamespace(axes=lambda: (np.arange(9) + 0.5, np.arange(9) + 0.5))
    row: Any = SimpleNamespace(area_id="queue", name="Queue", violation_rate=SimpleNamespace(value=3.0))
    (spot,) = _spots(data, grid, own, [row])
    assert (spot.at, spot.peak) == ((2.5, 2.5), 2.0)


def test_a_card_says_how_often_here_and_how_many_spots_the_planner_has_beside_it() -> None:
    report = weeks.with_tested_spots()
    assert report.spots is not None
    ratio = m.Estimate(value=2.5, lo=2.3, hi=2.7)
    card = replace(report.spots.cards[0], ratio=ratio, here=m.Estimate(value=12.34, previous=15.0))
    made = cards(replace(report, spots=replace(report.spots, kind="tested", cards=(card,), n_more=2)))
    assert made is not None
    assert "Within 1 m of it: 12 violations an open hour, 15 in week 45" in made.cards[0].notes
    assert made.more == "The planner shows 2 more, with little of the time too close."


def test_a_card_does_not_repeat_the_question_that_the_page_asks_at_its_top() -> None:
    report = weeks.with_tested_spots()
    first, second = (c.ask for c in cards(report).cards)  # type: ignore[union-attr]
    assert all((first, second))
    asked = cards(report, question=f"Still open from week 45: {first[:-1]}, above all on Saturday?")
    assert [c.ask for c in asked.cards] == ["", second]  # type: ignore[union-attr]
