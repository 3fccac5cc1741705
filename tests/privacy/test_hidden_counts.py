"""No count that is held back can be worked out from all that leaves the operator's hands (`hidden_counts`).

`prove_hidden_counts.py` does the same for a hundred weeks and more.
"""

from __future__ import annotations

import csv
import io
import json
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from planner import planted_shop as planted
from privacy import hidden_counts as hidden
from privacy import other_outputs

from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.duckdb_file import export_duckdb
from vsd_analytics.report.pages.json_and_csv import to_csv, to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.wording.reasons import reason_text

DOOR = 2
BUSY = {
    **{(w, p): n for w in range(4) for p, n in ((0, 20.0), (1, 0.0), (3, 4.0), (4, 3.0))},
    **{(0, DOOR): 25.0, (1, DOOR): 25.0, (2, DOOR): 25.0, (3, DOOR): 0.5},
    **{(3, 1): 8.0, (3, 4): 0.0},
}
"""Three weeks with a hotspot at the door, and one with hardly anybody there, whose camera sees the queue then."""
TWO_WEEKS = (2, 3)
N_SHOWN = 10


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> hidden.World:
    made = hidden.build(tmp_path_factory.mktemp("hidden") / "site", 1, n_weeks=4, busy=BUSY)
    assert 0 < made.sum(hidden.keys_of(3, place="door")) < hidden.BELOW
    return made


@pytest.fixture(scope="module")
def reports(world: hidden.World) -> dict[int, WeekReport]:
    return {w: week_report(world.site, hidden.monday(w)) for w in TWO_WEEKS}


def spots(report: WeekReport) -> list[dict[str, Any]]:
    answers = json.loads(to_json(report))["answers"]
    return [*answers["hotspots"]["rows"], *answers["past_hotspots"]["rows"]]


def test_hotspots_of_two_weeks_do_not_tell_the_small_count_of_the_later(reports: dict[int, WeekReport]) -> None:
    before, now = ({s["spot_id"]: s for s in spots(reports[w])} for w in TWO_WEEKS)
    assert next(iter(before.values()))["n_violations"]["value"] > hidden.BELOW
    at_door = [s for s in now.values() if s["area_id"] == "door"]
    assert at_door
    for spot in at_door:
        assert {"n_violations", "excess_ratio"} <= spot.keys()
        for name in spot.keys() & {"n_violations", "excess_ratio", "violation_h", "excess_min_per_week", "q"}:
            assert spot[name]["value"] is spot[name]["lo"] is None, f"{name} of {spot['spot_id']}"


def test_a_hotspot_with_a_small_week_is_shown_without_figures(tmp_path: Path) -> None:
    """The door is a hotspot in five weeks of six, also in the last; in the third last it has hardly a violation."""
    rates = ((0, 20.0), (1, 0.0), (DOOR, 25.0), (3, 4.0), (4, 3.0))
    busy = {**{(w, p): n for w in range(6) for p, n in rates}, (3, DOOR): 0.7}
    small = hidden.build(tmp_path / "site", 1, n_weeks=6, busy=busy)
    assert 0 < small.sum(hidden.keys_of(3, place="door")) < hidden.BELOW
    report = week_report(planted.with_settings(small.site, hotspot_days=42), hidden.monday(5))
    assert report.spots is not None
    [card] = [c for c in report.spots.cards if c.area_id == "door"]
    assert report.spots.kind == "tested"
    assert (card.ratio.value if card.ratio else 0, card.excess_min_per_week) == (None, None)
    [row] = [r for r in csv.DictReader(io.StringIO(to_csv(report)["hotspots.csv"])) if r["area"] == "door"]
    assert (row["ratio"], row["ratio_lo"], row["excess_min_per_week"]) == ("", "", "")
    assert reason_text(GIVES_AWAY) in render_html(report)


def test_time_too_close_is_hidden_with_the_count_of_its_place_and_hour(reports: dict[int, WeekReport]) -> None:
    told = json.loads(to_json(reports[3]))
    hidden_areas = {a["area_id"]: a for a in told["areas"] if a["is_masked"] or a["is_held_back"]}
    assert "door" in hidden_areas
    for rows in (hidden_areas.values(), (r for r in told["answers"]["areas"]["rows"] if r["area_id"] in hidden_areas)):
        for row in rows:
            share = row["close_time_share"]
            assert (share["value"] if isinstance(share, dict) else share) is None
    assert all(a["close_time_share"]["value"] is not None for a in json.loads(to_json(reports[2]))["areas"])
    for cell in told["when"]["cells"]:
        assert cell["close_time_share"] is None or not (cell["is_masked"] or cell["is_held_back"])


def test_no_count_held_back_can_be_worked_out_from_all_numbers_of_two_weeks(
    world: hidden.World, reports: dict[int, WeekReport]
) -> None:
    known = hidden.Known()
    for week in TWO_WEEKS:
        hidden.read_json(known, world, week, json.loads(to_json(reports[week])))
        hidden.read_csv(known, world, week, to_csv(reports[week]))
    assert hidden.broken(known, world) == []
    assert hidden.small_counts(world)
    assert hidden.worked_out(known, world) == {}


def test_the_planner_the_cards_and_the_duckdb_file_tell_no_count_that_is_held_back(
    world: hidden.World, reports: dict[int, WeekReport], tmp_path: Path
) -> None:
    known = hidden.published(world, TWO_WEEKS)
    for week in TWO_WEEKS:
        other_outputs.read_cards(known, world, week, first=world)
    for output in ("planner hour", "planner cells", "planner area:door", "card of day"):
        assert any(output in source for *_, source in known.rows), output
    export_duckdb(world.site, hidden.monday(2), hidden.monday(3), out=tmp_path / "weeks.duckdb")
    assert other_outputs.read_duckdb(known, world, tmp_path / "weeks.duckdb") > N_SHOWN
    assert hidden.broken(known, world) == []
    assert hidden.worked_out(known, world) == {}


def test_smoothed_maps_tell_no_count_that_is_held_back(world: hidden.World, reports: dict[int, WeekReport]) -> None:
    """M18 and M19 are sums over the squares around; `test_leaks` shows what the operator's would tell."""
    known = hidden.published(world, TWO_WEEKS, planners=())
    for week in TWO_WEEKS:
        figures = json.loads(to_json(reports[week]))["figures"]
        n_read = other_outputs.read_smoothed_maps(known, world, week, figures)
        assert n_read or week == TWO_WEEKS[-1], "the floor of hidden places has no squares"
    assert hidden.broken(known, world) == []
    assert hidden.worked_out(known, world) == {}


def test_the_reader_finds_what_the_planner_by_area_and_hour_gave_away(
    world: hidden.World, reports: dict[int, WeekReport]
) -> None:
    """Until version 2.0 the page had hours of areas: one of them and the report's hour of the floor tell the others."""
    known = hidden.published(world, TWO_WEEKS)
    for place, day, hour in product(("queue", None), range(hidden.N_DAYS), range(*hidden.HOURS)):
        keys = hidden.keys_of(3, place=place, day=day, hour=hour)
        known.exact(keys, world.sum(keys), "hour of an area")
    assert any(name.startswith("week 3") for name in hidden.worked_out(known, world))


def test_the_reader_finds_what_is_given_away(world: hidden.World) -> None:
    known = hidden.Known()
    known.exact(hidden.keys_of(3), world.sum(hidden.keys_of(3)), "floor")
    for place in ("queue", None):
        known.exact(hidden.keys_of(3, place=place), world.sum(hidden.keys_of(3, place=place)), str(place))
    found = hidden.worked_out(known, world)
    assert found["week 3, door"] == world.sum(hidden.keys_of(3, place="door"))
