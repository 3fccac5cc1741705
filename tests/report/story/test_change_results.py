"""The ledger of changes and the results of what was tried: only a controlled comparison says that a change worked."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Any

import pytest
from report import model_classes as m
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.change_outcome import outcome
from vsd_analytics.figures.week.model_sections import LoggedChangeResult
from vsd_analytics.planner.change_words import change_words
from vsd_analytics.planner.logged_changes import PlannerChange
from vsd_analytics.report.pages.logged_changes import came_of, log_rows, result_words
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Area

AT = datetime(2026, 10, 12, 6, 30, tzinfo=weeks.ROME)


def floor(lo: float, hi: float, verdict: str) -> m.Estimate:
    return m.Estimate(value=None, change=(lo + hi) / 2, change_lo=lo, change_hi=hi, verdict=verdict)  # type: ignore[arg-type]


GONE = floor(-0.25, -0.11, "clear_fall")
MOVED = floor(-0.05, 0.03, "about_same")
UNKNOWN = floor(-0.3, 0.2, "cannot_tell")
"""What became of the whole floor, of which the area's fall is 20 %."""


def change(verdict: str, lo: float, hi: float, **more: Any) -> m.LoggedChangeEffect:
    middle = (lo + hi) / 2
    effect = m.Estimate(value=None, change=middle, change_lo=lo, change_hi=hi, verdict=verdict)  # type: ignore[arg-type]
    said: dict[str, Any] = {"running": effect, "net": GONE, "moved_elsewhere": 0.1, "compared_with": ("Pharmacy",)}
    said |= {"design": "beside", "is_credible": True, "e_value": 400.0, "contribution": -0.2}
    return m.LoggedChangeEffect(number=3, at=AT, text="Moved", area_name="Door", **(said | more))


def line(**more: Any) -> LoggedChangeResult:
    said: dict[str, Any] = {"number": 3, "at": AT, "text": "Moved", "area_id": "door", "area_name": "Door"}
    return LoggedChangeResult(**(said | more))


@pytest.mark.parametrize(
    ("made", "said", "begins"),
    [
        (
            change("clear_fall", -0.9, -0.8),
            "works",
            "So far it works: people there spend between 90% less and",
        ),
        (change("clear_fall", -0.9, -0.8, moved_elsewhere=0.9, net=MOVED), "moved", "There is less time too close th"),
        (change("clear_fall", -0.9, -0.8, moved_elsewhere=0.0, net=UNKNOWN), "fell", "People there spend between 90% "),
        (change("clear_fall", -0.9, -0.8, moved_elsewhere=0.9, net=UNKNOWN), "fell", "People there spend between 90% "),
        (change("clear_fall", -0.9, -0.8, moved_elsewhere=0.6), "fell", "People there spend between 90% "),
        (change("clear_fall", -0.9, -0.8, net=None), "doubtful", "There is less time too close there ("),
        (change("clear_fall", -0.9, -0.8, e_value=30.0), "doubtful", "There is less time too close there ("),
        (change("clear_fall", -0.9, -0.8, is_credible=False), "doubtful", "There is less time too close there ("),
        (change("clear_fall", -0.9, -0.8, doubts=(Reason("redesign.nobody_there"),)), "doubtful", "There is less time"),
        (change("about_same", -0.1, 0.05), "about_same", "Since then there is about as much time too close there (b"),
        (change("clear_rise", 0.2, 0.9), "rose", "Since then there is more time too close"),
        (change("cannot_tell", -0.3, 0.5), "cannot_tell", "Cannot tell yet: anything between 30% less and 50% more"),
        (change("clear_fall", -0.9, -0.8, design="alone"), "alone", "Cannot tell: no other area was left alone"),
        (change("clear_fall", -0.9, -0.8, running=None), "too_early", "Cannot tell yet."),
    ],
)
def test_what_came_of_a_change_never_claims_more_than_its_running_verdict(
    made: m.LoggedChangeEffect, said: str, begins: str
) -> None:
    assert outcome(made) == said
    assert came_of(made).startswith(begins)


@pytest.mark.parametrize(
    ("made", "begins"),
    [
        (change("clear_fall", -0.9, -0.8), "It worked: time too close at Door fell by 85%"),
        (
            change("clear_fall", -0.9, -0.8, moved_elsewhere=0.9, net=MOVED),
            "Time too close at Door fell by 85%, but it",
        ),
        (change("clear_fall", -0.9, -0.8, net=UNKNOWN), "Time too close at Door fell by 85%, compared with areas that"),
        (change("clear_fall", -0.9, -0.8, e_value=30.0), "Time too close at Door fell by 85%. Other things"),
        (change("about_same", -0.1, 0.05), "About the same: at Door"),
        (change("clear_rise", 0.2, 0.9), "Time too close at Door clearly rose, by 55%"),
        (change("cannot_tell", -0.3, 0.5), "Cannot tell yet: at Door, anything from 30% less to 50% more time"),
        (change("clear_fall", -0.9, -0.8, design="alone"), "Cannot tell: no other area was left alone"),
        (change("clear_fall", -0.9, -0.8, running=None), "Cannot tell yet."),
        (
            change("clear_fall", -0.9, -0.8, state="not_enough_data", reason=Reason("redesign.nobody_there")),
            "No result",
        ),
    ],
)
def test_the_planner_says_of_a_change_what_the_page_says(made: m.LoggedChangeEffect, begins: str) -> None:
    door = Area("door", "Door", "ground", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    logged = PlannerChange(number=3, at=AT, text="Moved", area=door, result=made, before=None, after=None, hidden={})
    assert change_words(logged).verdict.startswith(begins)


def test_a_change_that_works_says_what_it_avoids_a_week_with_its_range() -> None:
    words = result_words(
        line(
            outcome="works", usual_min=1868.3, avoided_min=1701.0, avoided_lo=1638.0, avoided_hi=1746.0,
            compared_with=("Pharmacy",), floor_verdict="cannot_tell", floor_avoided_min=-317.0,
            floor_avoided_lo=-1030.0, floor_avoided_hi=366.0,
        )
    )  # fmt: skip
    assert words == (
        "Avoids about 1,700 a week of the usual 1,900 there (likely between 1,600 and 1,700), compared with Pharmacy. "
        "Whole floor: anything from 1,000 more to 370 fewer."
    )


def test_a_change_that_cannot_be_told_says_what_is_possible_and_how_long_it_is_watched() -> None:
    words = result_words(
        line(
            outcome="cannot_tell", usual_min=669.0, avoided_min=35.0, avoided_lo=-360.0, avoided_hi=279.0,
            watched_until=date(2027, 5, 4),
        )
    )  # fmt: skip
    assert words == "Cannot tell yet: from 360 more to 280 fewer there, of 670 a week. Watched until Tue 4 May."


def test_a_change_that_cannot_be_told_speaks_of_the_floor_only_where_that_is_clear() -> None:
    said = {
        "outcome": "cannot_tell",
        "usual_min": 669.0,
        "avoided_min": 35.0,
        "avoided_lo": -360.0,
        "avoided_hi": 279.0,
    }
    floor = {"floor_avoided_min": 300.0, "floor_avoided_lo": 100.0, "floor_avoided_hi": 500.0}
    assert "Whole floor: fewer" in result_words(line(**said, **floor, floor_verdict="clear_fall"))
    for vague in ("about_same", "cannot_tell"):
        assert "Whole floor" not in result_words(line(**said, **floor, floor_verdict=vague))


def test_a_change_of_the_whole_site_claims_nothing() -> None:
    assert result_words(line(outcome="site_wide", area_id=None)) == ""


def test_the_list_of_changes_carries_what_each_avoided() -> None:
    report = weeks.normal()
    logged = next(one for one in report.log if one.area_id is not None)
    own = line(at=logged.at, text=logged.text, outcome="too_early")
    (row,) = [r for r in log_rows(replace(report, logged_changes=(own,)), with_weeks=False) if r.result]
    assert row.result == "Cannot tell yet."
    page = render_html(replace(report, logged_changes=(own,)))
    assert "what they avoided" in page
    assert "what they avoided" not in render_html(report)


def test_of_the_log_the_page_folds_only_what_has_no_result_and_says_nothing_of_the_weeks_compared() -> None:
    report = sections.complete()
    logged = next(one for one in report.log if one.area_id is not None)
    long_ago = replace(logged, at=logged.at - timedelta(weeks=8))
    results = (line(at=long_ago.at, text="Rope set", outcome="too_early"),)
    outage = report.coverage.outages[0]
    entries = {
        "this week": logged,
        "long ago": replace(long_ago, text="Wall painted", area_id=None),
        "long ago, with a result": replace(long_ago, text="Rope set"),
        "a gap that the page shows with the data": replace(logged, at=outage.start, text="No data", kind="detected"),
    }
    rows = log_rows(replace(report, log=tuple(entries.values()), logged_changes=results, trend=None), with_weeks=False)
    news = {row.text.rstrip("."): row.is_news for row in rows}
    assert news == {logged.text.rstrip("."): True, "Wall painted": False, "Rope set": True, "No data": False}
