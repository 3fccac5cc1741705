"""The ledger of changes and the results of what was tried: only a controlled comparison says that a change worked."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Any

import pytest
from report import model_classes as m
from report import sample_sections as sections
from report import sample_weeks as weeks
from report.change_tables import planner_answers

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.model_sections import LoggedChangeResult
from vsd_analytics.planner.change_words import change_words
from vsd_analytics.planner.logged_changes import PlannerChange
from vsd_analytics.report.pages.logged_changes import came_of, log_rows, result_words
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Area

AT = datetime(2026, 10, 12, 6, 30, tzinfo=weeks.ROME)


def change(outcome: str, verdict: str, lo: float, hi: float, **more: Any) -> m.LoggedChangeEffect:
    middle = -1.0 if lo == -1 else (lo + hi) / 2
    effect = m.Estimate(value=None, change=middle, change_lo=lo, change_hi=hi, verdict=verdict)  # type: ignore[arg-type]
    said: dict[str, Any] = {"running": effect, "outcome": outcome, "moved_elsewhere": 0.9, "design": "beside"}
    said |= {"compared_with": ("Pharmacy",), "is_credible": True, "e_value": 400.0, "contribution": -0.2}
    return m.LoggedChangeEffect(number=3, at=AT, text="Moved", area_name="Door", **(said | more))


def line(**more: Any) -> LoggedChangeResult:
    said: dict[str, Any] = {"number": 3, "at": AT, "text": "Moved", "area_id": "door", "area_name": "Door"}
    return LoggedChangeResult(**(said | more))


FALL = ("clear_fall", -0.9, -0.8)
NONE = ("clear_fall", -1.0, -0.97)
WENT = (m.ReceivingArea(area_name="Aisle", change=0.3, change_lo=0.2, change_hi=0.4),)


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (
            change("works", *FALL),
            "So far it works: people there spend between 90% less and 80% less time too close than before, compared "
            "with Pharmacy; no other area clearly took people up.",
        ),
        (
            change("works", *FALL, receivers=WENT),
            "So far it works: people there spend between 90% less and 80% less time too close than before, compared "
            "with Pharmacy; Aisle (+20% to +40%) took people up.",
        ),
        (
            change("works", *NONE),
            "So far it works: nobody there is too close any more (none, at most 3% of the time before), compared with "
            "Pharmacy; no other area clearly took people up.",
        ),
        (
            change("moved", *FALL, receivers=WENT),
            "There is less time too close there, but the rest of the floor took up 90% of it; Aisle (+20% to +40%) "
            "took people up.",
        ),
        (
            change("fell", *FALL, not_yet=Reason("logged_change.not_yet_gone")),
            "People there spend between 90% less and 80% less time too close than before, compared with Pharmacy; no "
            "other area clearly took people up. Whether it moved elsewhere is not known yet.",
        ),
        (
            change("fell", *NONE, not_yet=Reason("logged_change.not_yet_long", least=8)),
            "Nobody there is too close any more (none, at most 3% of the time before), compared with Pharmacy; no "
            "other area clearly took people up. Too early to say that it works: that takes 8 weeks.",
        ),
        (
            change("doubtful", *NONE),
            "There is less time too close there (none, at most 3% of the time before), but something else may have "
            "done it.",
        ),
        (
            change("about_same", "about_same", -0.1, 0.05),
            "Since then there is about as much time too close there (between 10% less and 5% more).",
        ),
        (
            change("rose", "clear_rise", 0.2, 0.9),
            "Since then there is more time too close there (between 20% more and 90% more).",
        ),
        (
            change("cannot_tell", "cannot_tell", -0.3, 0.5),
            "Cannot tell yet: anything between 30% less and 50% more time too close is possible.",
        ),
        (change("alone", *FALL), "Cannot tell: no other area was left alone in these weeks."),
        (change("too_early", *FALL, running=None), "Cannot tell yet."),
    ],
)
def test_what_came_of_a_change_is_its_outcome_with_its_range_and_who_took_people_up(
    made: m.LoggedChangeEffect, says: str
) -> None:
    assert came_of(made) == says


@pytest.mark.parametrize(
    ("made", "begins"),
    [
        (
            change("works", *FALL),
            "It works so far: time too close at Door fell by 85%, compared with areas that were lef",
        ),
        (change("moved", *FALL), "Time too close at Door fell by 85%, but it"),
        (change("fell", *FALL), "Time too close at Door fell by 85%, compared with areas that"),
        (change("doubtful", *FALL), "Time too close at Door fell by 85%. Other things"),
        (change("about_same", "about_same", -0.1, 0.05), "About the same: at Door"),
        (change("rose", "clear_rise", 0.2, 0.9), "Time too close at Door clearly rose, by 55%"),
        (
            change("cannot_tell", "cannot_tell", -0.3, 0.5),
            "Cannot tell yet: at Door, anything from 30% less to 50% more time",
        ),
        (change("alone", *FALL), "Cannot tell: no other area was left alone"),
        (change("too_early", *FALL, running=None), "Cannot tell yet."),
        (change("too_early", *FALL, state="not_enough_data", reason=Reason("logged_change.nobody_there")), "No result"),
    ],
)
def test_the_planner_says_of_a_change_what_the_page_says(made: m.LoggedChangeEffect, begins: str) -> None:
    door = Area("door", "Door", "ground", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    answers = planner_answers(made)
    logged = PlannerChange(number=3, at=AT, text="Moved", area=door, answers=answers, before=None, after=None)
    assert change_words(logged).verdict.startswith(begins)


def test_a_change_that_works_says_what_it_avoids_a_week_with_its_range() -> None:
    words = result_words(
        line(
            outcome="works", usual_min=1868.3, avoided_min=1701.0, avoided_lo=1638.0, avoided_hi=1746.0,
            compared_with=("Pharmacy",), floor_avoided_min=-317.0,
            floor_avoided_lo=-1030.0, floor_avoided_hi=366.0,
        )
    )  # fmt: skip
    assert words == (
        "Avoids about 1,700 a week of the usual 1,900 there (likely between 1,600 and 1,700), compared with Pharmacy; "
        "no other area clearly took people up. Whole floor: anything from 1,000 more to 370 fewer."
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
    clear = {"floor_avoided_min": 300.0, "floor_avoided_lo": 100.0, "floor_avoided_hi": 500.0}
    assert "Whole floor: fewer" in result_words(line(**said, **clear))
    assert "Whole floor" not in result_words(line(**said, **{**clear, "floor_avoided_lo": -20.0}))


def test_a_change_of_the_whole_site_claims_nothing() -> None:
    assert result_words(line(outcome="site_wide", area_id=None)) == ""


def test_the_list_of_changes_carries_what_each_avoided() -> None:
    report = weeks.normal()
    logged = next(one for one in report.log if one.area_id is not None)
    own = line(at=logged.at, text=logged.text, outcome="too_early")
    (row,) = [r for r in log_rows(replace(report, logged_changes=(own,)), with_weeks=False) if r.result]
    assert row.result == "Cannot tell yet."
    page = render_html(replace(report, logged_changes=(own,)))
    assert "what came after them" in page
    assert "what came after them" not in render_html(report)


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
