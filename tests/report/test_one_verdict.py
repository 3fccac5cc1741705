"""One change, one verdict: page, planner, command and Python, from messages, of an area that is cleared to none."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from datetime import timedelta

import pytest
from report.ingested_worlds import MONDAY, Place, messages, report, toml, world

from vsd_analytics.answer import Reason, value_of
from vsd_analytics.api.project import open_project
from vsd_analytics.cli import main
from vsd_analytics.cli.answers import answers_json
from vsd_analytics.figures.change_outcome import WORKS_WEEKS
from vsd_analytics.figures.change_weeks import REFERENCE_WEEKS
from vsd_analytics.planner.change_words import change_words
from vsd_analytics.planner.planner_data import planner_pages
from vsd_analytics.report.pages.change_story import came_of
from vsd_analytics.report.pages.logged_changes import log_rows
from vsd_analytics.report.pages.things_to_know import things
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Site
from vsd_analytics.wording.languages import speaking

N_BEFORE, N_AFTER = 13, 4
TOO_EARLY = Reason("logged_change.not_yet_long", least=WORKS_WEEKS)
AREAS = {
    "queue": ("Queue", (1, 1, 5, 5)),
    "door": ("Door", (21, 1, 25, 5)),
    "aisle": ("Aisle", (1, 21, 5, 25)),
    "desk": ("Desk", (21, 21, 25, 25)),
}
QUEUE, DOOR, AISLE, DESK = ((float(x), float(y)) for y in (3, 23) for x in (3, 23))
FIRST = MONDAY - timedelta(weeks=N_BEFORE)
SUNDAY = MONDAY + timedelta(weeks=N_AFTER) - timedelta(days=1)


def counts_of(week: int) -> Callable[[int, int], Mapping[Place, int]]:
    def counts(day: int, hour: int) -> Mapping[Place, int]:
        wave = (3 * day + 5 * week) % 7
        queue = 0 if week >= N_BEFORE else 18 + wave
        return {QUEUE: queue, DOOR: 15 + (wave + day) % 5, AISLE: 12 + (wave + week) % 4, DESK: 14 + (wave * day) % 4}

    return counts


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a shop whose queue has about 150 violations a week, and none since a rope was set on the last Monday."""
    streams = [
        messages(counts_of(w), monday=FIRST + timedelta(weeks=w), hours=(9, 10)) for w in range(N_BEFORE + N_AFTER)
    ]
    config = toml(areas=AREAS, opening='{ mon-sun = "09:00-10:00" }', more="[analysis]\nwashout_days = 0\n")
    entry = {"at": f"{MONDAY}T06:00:00+01:00", "text": "Rope set", "area": "queue"}
    return world(tmp_path_factory.mktemp("rope"), config, *streams, log=[entry])


def printed(site: Site, *arguments: str) -> str:
    with redirect_stdout(io.StringIO()) as said, pytest.raises(SystemExit):
        main(["-C", str(site.root), *arguments])
    return said.getvalue()


def test_an_area_cleared_to_none_is_a_clear_fall_on_every_page_since(site: Site) -> None:
    for week in range(N_AFTER):
        made = report(site, MONDAY + timedelta(weeks=week))
        (change,) = made.change_effects
        assert change.running is not None
        assert (change.running.verdict, change.running.change, change.n_watched) == ("clear_fall", -1.0, week + 1)
        assert change.running.change_hi is not None
        assert -1 < change.running.change_hi < 0
        assert (change.outcome, change.not_yet) == ("fell", TOO_EARLY)
        (line,) = made.logged_changes
        assert line.avoided_min == line.usual_min
        with speaking("en"):
            assert "obody there is too close any more, instead of " in came_of(change)
            assert "person-minutes a week (none, at most " in came_of(change)
            page = render_html(made)
        told = "Changes at the site do not show in the figures yet"
        assert told not in page
        assert "inf" not in json.dumps(change.running.change_hi)
        assert "needs at least" not in came_of(change)


def test_page_planner_command_and_python_give_one_verdict_on_one_reference(site: Site) -> None:
    """The reference is that of the entry: weeks since do not shorten it, though a page looks back twelve weeks only."""
    page = report(site, MONDAY + timedelta(weeks=N_AFTER - 1))
    (change,) = page.change_effects
    (planner,) = planner_pages(site, MONDAY + timedelta(weeks=N_AFTER - 1))
    (of_planner,) = [c for c in planner.changes if c.text == "Rope set"]
    told = json.loads(printed(site, "compare", "--change", "1", "--json"))
    found = open_project(site.root).change(1)
    assert found.running is not None
    assert found.running.n_reference == REFERENCE_WEEKS
    assert of_planner.answers is not None
    days = (page.week.monday, page.week.sunday)
    of_page = json.loads(json.dumps(answers_json(of_planner.answers, days=days, notes=()), default=str))
    for name, answer in told["answers"].items():
        assert of_page["answers"][name]["rows"] == answer["rows"], name
    (command,) = told["answers"]["change_so_far"]["rows"]
    ratio = command["so_far_change"]
    assert change.running is not None
    for of_command, python, of_page in (
        (1 + ratio["value"], found.running.value, 1 + (change.running.change or 0.0)),
        (1 + ratio["lo"], found.running.lo, 1 + (change.running.change_lo or 0.0)),
        (1 + ratio["hi"], found.running.hi, 1 + (change.running.change_hi or 0.0)),
        (command["e_value"]["value"], found.running.e_value, change.e_value),
        (command["n_weeks_after"], found.running.n_weeks, change.n_watched),
    ):
        assert of_command == pytest.approx(python, rel=1e-5, abs=1e-6)
        assert of_page == pytest.approx(python, rel=1e-9, abs=1e-9)
    assert command["so_far_verdict"] == found.running.verdict == change.running.verdict == "clear_fall"
    (entry,) = told["answers"]["logged_change"]["rows"]
    assert entry["outcome"] == found.outcome == change.outcome == "fell"
    text = printed(site, "compare", "--change", "1")
    assert "too early to say that it works: that takes 8 weeks" in text
    assert "cannot tell" not in text
    with speaking("en"):
        story = came_of(change)
        assert story.startswith("Nobody there is too close any more, instead of ")
        (line,) = page.logged_changes
        (row,) = [row for row in log_rows(page, with_weeks=True) if row.result]
        assert change_words(of_planner).verdict == story == told["story"] == came_of(line)
        assert row.result.startswith(story.partition(", compared with")[0])
        assert story[1:] in things(page)[0].text
    assert f"Queue: {story}" in text
    (of_week,) = page.answers["changes"].rows
    assert value_of(of_week, "so_far_change").value == pytest.approx(change.running.change)
    assert (of_week["outcome"], of_week["n_weeks_after"]) == (change.outcome, change.n_watched)
