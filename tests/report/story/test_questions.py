"""Which question a week asks: what earlier weeks asked and what was answered decide, beside the figures."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Any

import pytest
from report import model_classes as m
from report import sample_weeks as weeks

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import Agenda, PastQuestion, PlaceToAsk
from vsd_analytics.report.pages import questions
from vsd_analytics.report.pages.logged_changes import asked_lines
from vsd_analytics.report.pages.questions import Candidate, choose, wording
from vsd_analytics.report.pages.story import story_of
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.questions import AskedQuestion

MONDAY = date(2026, 11, 9)
WAIT = Candidate(place="queue", remedy="wait", text="Could they wait?", again="Is there room?")


def past(week: int, answer: Any = None, days: int = 2, **more: Any) -> PastQuestion:
    """Return the question of so many weeks before, answered so many days after its Monday."""
    monday = MONDAY - timedelta(weeks=week)
    at = None if answer is None else datetime(monday.year, monday.month, monday.day, 12, tzinfo=weeks.ROME)
    said = {"answer": answer, "answered_at": None if at is None else at + timedelta(days=days)}
    named = {"place": "queue", "remedy": "wait", "text": "Could they wait?", "question_id": f"Q{46 - week}-queue-wait"}
    return PastQuestion(monday=monday, number=46 - week, **(named | said | more))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ([], "Could they wait?"),
        ([past(1)], "Still open from week 45: Is there room?"),
        ([past(2), past(1)], None),
        ([past(7), past(6)], None),
        ([past(30)], "Asked before, in week 16: Is there room?"),
        ([past(9, "not-possible")], None),
        ([past(40, "not-possible")], None),
        ([past(9, "tried")], None),
        ([past(3, "later")], None),
        ([past(4, "later", days=1)], None),
        ([past(5, "later")], "Put off after week 41: Is there room?"),
        ([past(6, "later"), past(1)], "Still open from week 45: Is there room?"),
        ([past(6, "later"), past(2), past(1)], None),
    ],
)
def test_a_question_comes_again_only_in_other_words_and_once(asked: list[PastQuestion], said: str | None) -> None:
    assert wording(WAIT, asked, monday=MONDAY) == said


def with_agenda(**more: Any) -> WeekReport:
    """Return the normal week with two places to ask about."""
    made = {n: questions.remedies(n, None, area=None, fixtures=()) for n in ("Checkout queue", "Main entrance")}
    places = tuple(
        PlaceToAsk(place=name.split()[-1].lower(), area_id=name.split()[-1].lower(), name=name, remedies=remedies)
        for name, remedies in made.items()
    )
    return replace(weeks.normal(), agenda=Agenda(**({"places": places} | more)))


def year_of_questions(answer: Any = None) -> list[AskedQuestion]:
    """Return what 40 weeks ask when each knows the weeks before, and each question is answered, or none."""
    known: list[PastQuestion] = []
    asked = []
    for k in range(40):
        monday = MONDAY + timedelta(weeks=k)
        report = with_agenda(asked=tuple(known))
        number = monday.isocalendar().week
        report = replace(report, week=replace(report.week, number=number, monday=monday))
        one = choose(report)
        asked.append(one)
        at = datetime(monday.year, monday.month, monday.day, tzinfo=weeks.ROME) + timedelta(days=3)
        known.append(
            PastQuestion(
                question_id=one.question_id, monday=monday, number=number, text=one.text, place=one.place,
                remedy=one.remedy, answer=answer, answered_at=None if answer is None else at,
            )
        )  # fmt: skip
    return asked


@pytest.mark.parametrize("answer", [None, "not-possible", "later"])
def test_no_week_of_a_year_asks_in_the_words_of_another(answer: str | None) -> None:
    asked = [one.text for one in year_of_questions(answer) if one.remedy != "idea"]
    assert len(set(asked)) == len(asked)


def test_what_nobody_answers_is_asked_twice_and_then_the_next_place_is() -> None:
    asked = year_of_questions()
    assert [one.question_id for one in asked[:4]] == [
        "Q46-queue-wait", "Q47-queue-wait", "Q48-entrance-clear", "Q49-entrance-clear",
    ]  # fmt: skip
    assert [one.question_id for one in asked] == [one.question_id for one in year_of_questions()]


def test_what_is_not_possible_is_never_asked_again() -> None:
    asked = [(one.place, one.remedy) for one in year_of_questions("not-possible") if one.remedy != "idea"]
    assert len(set(asked)) == len(asked) > 3


def test_a_place_that_was_just_changed_is_watched_and_not_asked_about() -> None:
    report = with_agenda()
    assert report.agenda is not None
    first, second = report.agenda.places
    watched = replace(report.agenda, places=(replace(first, changed_on=MONDAY), second))
    assert choose(replace(report, agenda=watched)).question_id == "Q46-entrance-clear"


def test_a_rise_at_a_place_without_weight_is_not_the_question() -> None:
    report = with_agenda()
    risen = replace(report.areas[1], violation_rate=weeks.estimate(9.0, 0.8, 0.1))
    rows = (report.areas[0], risen, *report.areas[2:])
    assert choose(replace(report, areas=rows)).remedy == "why"
    rows = (report.areas[0], replace(risen, is_material=False), *report.areas[2:])
    report = replace(report, areas=rows)
    assert choose(report).question_id == "Q46-queue-wait"
    story = story_of(report)
    assert risen.name not in story.headline
    assert not any(risen.name in t.title for t in story.things)


def test_two_floors_have_different_ids() -> None:
    report = with_agenda()
    report = replace(report, site=replace(report.site, floors=(report.site.floor_id, "upper")))
    assert choose(report).question_id == f"Q46-{report.site.floor_id}-queue-wait"


def test_the_page_opens_with_the_answer_and_says_what_came_of_it() -> None:
    tried = past(1, "tried", change=7, by="Anna", answer_text="Rope moved")
    report = with_agenda(asked=(past(2), tried))
    (line,) = asked_lines(report)
    assert line.asked == "Week 45 asked: “Could they wait?”"
    assert line.answer == "Tried on Wed 4 Nov by Anna. Rope moved."
    assert line.result == "Cannot tell yet."
    running = m.Estimate(value=None, change=-0.1, change_lo=-0.3, change_hi=0.5, verdict="cannot_tell")
    change = m.LoggedChangeEffect(
        number=7, at=weeks.normal().log[0].at, text="Rope moved", area_name="Queue", design="beside", is_credible=True,
        running=running, outcome="cannot_tell",
    )  # fmt: skip
    report = replace(report, change_effects=(change,))
    assert asked_lines(report)[0].result.startswith("Cannot tell yet: anything between 30% less and 50% more")
    page = render_html(report)
    assert "Tried on Wed 4 Nov by Anna." in page
    assert "vsd log" not in page  # who reads it needs no shell
    for kind in ("tried", "later", "not-possible"):
        assert f"mailto:?subject={choose(report).question_id}%3A%20{kind}&amp;body=" in page
    assert "mailto:" not in render_html(report, is_at_desk=True)


def test_what_was_so_in_most_weeks_before_is_said_in_a_shorter_line() -> None:
    spot = weeks.normal().busiest_spot
    assert spot is not None
    assert spot.area_id is not None
    report = with_agenda(busiest_before=(spot.area_id,) * 7 + ("other",))
    watch = next(t for t in story_of(report).things if t.kind == "watch")
    assert "still the busiest" in watch.title or "unusual" in watch.title
    fresh = next(t for t in story_of(with_agenda()).things if t.kind == "watch")
    assert "is the busiest spot" in fresh.title
