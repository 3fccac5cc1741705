"""The ledger of changes and the results of what was tried: only a controlled comparison says that a change worked."""

from __future__ import annotations

from dataclasses import fields, replace
from datetime import date, datetime, timedelta
from typing import Any

import pytest
from report import model_classes as m
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.model_sections import JudgedChange, LoggedChangeResult
from vsd_analytics.planner.change_words import change_words
from vsd_analytics.planner.logged_changes import PlannerChange
from vsd_analytics.report.pages.change_story import came_of, result_words
from vsd_analytics.report.pages.logged_changes import log_rows
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
MINUTES: dict[str, Any] = {"usual_min": 1868.3, "avoided_min": 1588.0}
LEFT = m.Estimate(value=None, change=-0.4, change_lo=-0.5, change_hi=-0.3, verdict="clear_fall")
EFFECT = "85% less time too close there, about 1,600 of 1,900 person-minutes a week (likely −90% to −80%)"
SOON = m.Foreseen(change=-0.3, power=0.8, weeks=8, weeks_max=26, clear_by=date(2026, 12, 8), n_areas=4)


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (
            change("works", *FALL, **MINUTES),
            f"It works so far: {EFFECT}, compared with Pharmacy; no other area clearly took people up.",
        ),
        (
            change("works", *FALL, **MINUTES, receivers=WENT),
            f"It works so far: {EFFECT}, compared with Pharmacy; Aisle (+20% to +40%) took people up.",
        ),
        (
            change("works", *FALL, **MINUTES, people=LEFT),
            f"It works so far: {EFFECT}, compared with Pharmacy; where the people went is not known.",
        ),
        (
            change("works", *NONE, usual_min=1868.3, avoided_min=1868.3),
            "It works so far: nobody there is too close any more, instead of 1,900 person-minutes a week (none, at "
            "most 3% of the time before), compared with Pharmacy; no other area clearly took people up.",
        ),
        (
            change("moved", *FALL, **MINUTES, receivers=WENT),
            f"{EFFECT}, compared with Pharmacy, but the rest of the floor took up 90% of it; Aisle (+20% to +40%) "
            "took people up.",
        ),
        (
            change("fell", *FALL, **MINUTES, not_yet=Reason("logged_change.not_yet_gone")),
            f"{EFFECT}, compared with Pharmacy; no other area clearly took people up. Whether it moved elsewhere is "
            "not known yet.",
        ),
        (
            change("fell", *NONE, not_yet=Reason("logged_change.not_yet_long", least=8)),
            "Nobody there is too close any more (none, at most 3% of the time before), compared with Pharmacy; no "
            "other area clearly took people up. Too early to say that it works: that takes 8 weeks.",
        ),
        (
            change("doubtful", *NONE),
            "Nobody there is too close any more (none, at most 3% of the time before), but something else may have "
            "done it.",
        ),
        (
            change("about_same", "about_same", -0.1, 0.05),
            "About as much time too close there as before (likely −10% to +5%).",
        ),
        (
            change("rose", "clear_rise", 0.2, 0.9, usual_min=100.0, avoided_min=-55.0),
            "55% more time too close there, about 55 person-minutes a week on top of 100 (likely +20% to +90%), "
            "compared with Pharmacy.",
        ),
        (
            change("cannot_tell", "cannot_tell", -0.3, 0.5, usual_min=669.0),
            "Cannot tell yet: anything between 30% less and 50% more time too close there is possible, of 670 "
            "person-minutes a week.",
        ),
        (change("alone", *FALL, running=None), "Cannot tell: no other area was left alone in these weeks."),
        (change("too_early", *FALL, running=None), "Cannot tell yet."),
        (
            change("too_early", *FALL, running=None, reason=Reason("logged_change.nobody_there")),
            "Cannot tell yet: nobody was seen there.",
        ),
    ],
)
def test_what_became_of_a_change_is_one_sentence_on_page_log_and_planner(made: m.LoggedChangeEffect, says: str) -> None:
    """Its verdict, its effect with its range and its minutes a week, and who took people up."""
    assert came_of(made) == says
    door = Area("door", "Door", "ground", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    logged = PlannerChange(number=3, at=AT, text="Moved", area=door, answers=None, result=made, before=None, after=None)
    assert change_words(logged).verdict == says
    shared = {f.name: getattr(made, f.name) for f in fields(JudgedChange)}
    assert result_words(LoggedChangeResult(**shared, area_id="door")) == says


@pytest.mark.parametrize(
    ("foreseen", "day", "says"),
    [
        (SOON, date(2026, 11, 15), "If it fell by 30%, we shall know by week 50, with a chance of 80%."),
        (
            replace(SOON, change=0.2),
            date(2026, 11, 15),
            "If it rose by 20%, we shall know by week 50, with a chance of 80%.",
        ),
        (
            SOON,
            date(2026, 12, 13),
            "A fall of 30% would have shown by week 50, with a chance of 80%; a smaller one takes longer.",
        ),
        (
            replace(SOON, weeks=None, clear_by=None, power=0.44),
            date(2026, 11, 15),
            "A fall of 30% will not show within 26 weeks (chance 44%), as weeks there differ too much. Days with and "
            "without the change in turn would tell sooner.",
        ),
        (
            replace(SOON, weeks=None, clear_by=None, power=0.0, n_areas=1),
            date(2026, 11, 15),
            "With only 1 area to compare with, a fall of 30% will not show within 26 weeks (chance 0%). Four, or days "
            "with and without it in turn, would tell.",
        ),
    ],
)
def test_a_change_that_is_not_clear_says_by_when_it_will_be(foreseen: m.Foreseen, day: date, says: str) -> None:
    made = change("cannot_tell", "cannot_tell", -0.3, 0.5, foreseen=foreseen)
    assert came_of(made, day=day).endswith(f"is possible. {says}")
    early = change("too_early", *FALL, running=None, foreseen=foreseen)
    assert came_of(early, day=day) == f"Cannot tell yet. {says}"
    for decided in ("works", "moved", "fell", "doubtful", "rose", "about_same"):
        assert "chance" not in came_of(change(decided, *FALL, foreseen=foreseen), day=day)


def test_a_place_that_cannot_be_tested_says_why_and_what_would_help() -> None:
    near = Reason("logged_change.left_out", area="Aisle", why=Reason("logged_change.near", apart_m=3.2, least_m=5.0))
    nothing = replace(SOON, weeks=None, clear_by=None, left_out=(near,), reason=Reason("logged_change.no_comparison"))
    assert came_of(change("alone", *FALL, running=None, foreseen=nothing)) == (
        "This place cannot be tested here, because no area is left to compare with (Aisle: 3.2 m away, and 5 m are "
        "needed), unless an area farther away is named and left alone, or days with and without the change take turns."
    )
    few = replace(nothing, left_out=(), reason=Reason("logged_change.reference_weeks", least=4, has=1))
    assert came_of(change("too_early", *FALL, running=None, foreseen=few)) == (
        "This change cannot be tested here, because it needs at least 4 weeks before the change, has 1, unless days "
        "with and without it take turns."
    )


def test_a_line_of_the_log_says_what_became_of_the_whole_floor_and_how_long_it_is_watched() -> None:
    whole = m.Estimate(value=None, change=-0.1, change_lo=-0.2, change_hi=0.05, verdict="cannot_tell")
    running = change("works", *FALL).running
    said: dict[str, Any] = {"running": running, "net": whole, "watched_until": date(2027, 5, 4)}
    assert result_words(line(outcome="fell", **said)).endswith(
        "Whole floor: not clear (likely −20% to +5%). Watched until Tue 4 May."
    )
    clear = replace(whole, change_hi=-0.02)
    assert "Whole floor: less (likely −20% to −2%)" in result_words(line(outcome="fell", **said | {"net": clear}))


def test_a_change_that_cannot_be_told_speaks_of_the_floor_only_where_that_is_clear() -> None:
    whole = m.Estimate(value=None, change=-0.3, change_lo=-0.5, change_hi=-0.1, verdict="clear_fall")
    open_ = change("cannot_tell", "cannot_tell", -0.3, 0.5).running
    assert "Whole floor" in result_words(line(outcome="cannot_tell", running=open_, net=whole))
    either = replace(whole, change_hi=0.02)
    assert "Whole floor" not in result_words(line(outcome="cannot_tell", running=open_, net=either))


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
