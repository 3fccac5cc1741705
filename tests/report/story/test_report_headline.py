"""The words of the page: every verdict pair, every abnormal week, and what may never be said."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import datetime
from itertools import product
from typing import get_args

import pytest
from forbidden_words import forbidden_in
from report import sample_weeks as weeks
from report.sample_sections import change_effects, trend
from report.story.golden_cases import CASES, CLOSE, OFTEN, after_a_gap, beside_usual, silent, unusual_hour

from vsd_analytics.answer import Reason, Verdict
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import LoggedChangeEffect, Usual
from vsd_analytics.report.model.week import Story, WeekReport
from vsd_analytics.report.model.week_agenda import Agenda
from vsd_analytics.report.pages import figure_titles
from vsd_analytics.report.pages.change_story import came_of
from vsd_analytics.report.pages.headline import MAX_WORDS, change_to_name
from vsd_analytics.report.pages.story import finish, story_of
from vsd_analytics.report.pages.things_to_know import things
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import has
from vsd_analytics.wording.reasons import read_reason

VERDICTS = get_args(Verdict)
CHANGE = {"clear_fall": -0.14, "clear_rise": 0.12, "about_same": 0.02, "cannot_tell": 0.02, "too_little_data": None}

GOLDEN = {
    ("clear_fall", "clear_fall"): "Violations fell by about a seventh, and people spend less time too close",
    ("clear_fall", "clear_rise"): "Violations fell by about a seventh, but people spend more of their time too close",
    ("clear_fall", "about_same"): "Violations fell by about a seventh",
    ("clear_fall", "cannot_tell"): "Violations fell by about a seventh",
    ("clear_fall", "too_little_data"): "Violations fell by about a seventh",
    ("clear_fall", "not_measurable"): "Violations fell by about a seventh",
    ("clear_rise", "clear_fall"): "Violations rose by about an eighth, but people spend less of their time too close",
    ("clear_rise", "clear_rise"): "Violations rose by about an eighth, and people spend more time too close",
    ("clear_rise", "about_same"): "Violations rose by about an eighth",
    ("clear_rise", "cannot_tell"): "Violations rose by about an eighth",
    ("clear_rise", "too_little_data"): "Violations rose by about an eighth",
    ("clear_rise", "not_measurable"): "Violations rose by about an eighth",
    ("about_same", "clear_fall"): "About as many violations as last week, but people spend less time too close",
    ("about_same", "clear_rise"): "About as many violations as last week, but people spend more time too close",
    ("about_same", "about_same"): "Violations about the same as last week",
    ("about_same", "cannot_tell"): "Violations about the same as last week",
    ("about_same", "too_little_data"): "Violations about the same as last week",
    ("about_same", "not_measurable"): "Violations about the same as last week",
    ("cannot_tell", "clear_fall"): "No clear change in violations, but people spend less of their time too close",
    ("cannot_tell", "clear_rise"): "No clear change in violations, but people spend more of their time too close",
    ("cannot_tell", "about_same"): "No clear change in violations since last week",
    ("cannot_tell", "cannot_tell"): "No clear change in violations since last week",
    ("cannot_tell", "too_little_data"): "No clear change in violations since last week",
    ("cannot_tell", "not_measurable"): "No clear change in violations since last week",
    ("too_little_data", "clear_fall"): "People spend less of their time too close; too little data on violations",
    ("too_little_data", "clear_rise"): "People spend more of their time too close; too little data on violations",
    ("too_little_data", "about_same"): "Too little data to say whether violations changed",
    ("too_little_data", "cannot_tell"): "Too little data to say whether violations changed",
    ("too_little_data", "too_little_data"): "Too little data to say whether violations changed",
    ("too_little_data", "not_measurable"): "Too little data to say whether violations changed",
}


def with_verdicts(violation_rate: str, close: str) -> WeekReport:
    report = weeks.normal()

    def made(verdict: str, value: float) -> Estimate:
        if verdict == "not_measurable":
            return Estimate(value=None, state="not_measurable", reason=read_reason("the engine sends no positions"))
        change = CHANGE[verdict]
        if change is None:
            return Estimate(value=value, verdict="too_little_data", reason=read_reason("3 days"))
        return Estimate(
            value=value,
            previous=value / (1 + change),
            change=change,
            change_lo=change - 0.03,
            change_hi=change + 0.03,
            verdict=verdict,
        )  # type: ignore[arg-type]

    people = Estimate(value=300.0, change=0.15, change_lo=0.1, change_hi=0.2, verdict="clear_rise")
    level = replace(
        report.level, violation_rate=made(violation_rate, 121.0), close_time_share=made(close, 0.41), people=people
    )
    areas = tuple(replace(a, difference=None) for a in report.areas)  # its headline says nothing of places
    return replace(report, level=level, areas=areas, log=())


def all_words(story: Story) -> str:
    lead = "".join(s.text for s in story.lead)
    return " ".join(
        [story.headline, lead, *(f"{t.title}. {t.text}" for t in story.things), story.question, *story.notes]
    )


@pytest.mark.parametrize("keys", list(product(VERDICTS, (*VERDICTS, "not_measurable"))), ids="/".join)
def test_each_pair_of_verdicts_has_its_sentence(keys: tuple[str, str]) -> None:
    story = story_of(with_verdicts(*keys))
    assert story.headline == GOLDEN[keys]
    assert terms.n_words(story.headline) <= MAX_WORDS
    assert story.rule == "/".join(k.removeprefix("clear_") for k in keys)


def test_the_table_is_complete() -> None:
    assert set(product(OFTEN, CLOSE)) == set(product(VERDICTS, (*VERDICTS, "not_measurable"))) == set(GOLDEN)
    for keys in GOLDEN:
        assert has(f"headline.pair.{keys[0]}.{keys[1]}")


@pytest.mark.parametrize("keys", list(GOLDEN), ids="/".join)
def test_a_change_that_is_not_clear_is_never_called_one(keys: tuple[str, str]) -> None:
    lead = "".join(s.text for s in story_of(with_verdicts(*keys)).lead)
    first = lead.split(". ")[0]
    assert ("fewer than in" in first or "more than in" in first) == keys[0].startswith("clear")


@pytest.mark.parametrize("position", ["below", "within", "above"])
@pytest.mark.parametrize("violation_rate", VERDICTS)
def test_with_a_usual_range_the_headline_says_where_the_week_lies(violation_rate: Verdict, position: str) -> None:
    headline = story_of(beside_usual(violation_rate, position)).headline
    assert {"below": "below their", "within": "their usual", "above": "above their"}[position] in headline
    assert terms.n_words(headline) <= MAX_WORDS
    is_news = violation_rate.startswith("clear") and position != "within"
    assert (" fell" in headline or " rose" in headline) == is_news


def test_a_clear_change_of_time_too_close_within_its_usual_range_is_no_headline() -> None:
    report = with_verdicts("cannot_tell", "clear_fall")
    within = Usual(lo=0.3, hi=0.5, n_weeks=8, position="within")
    story = story_of(replace(report, trend=replace(trend(report), usual_violation_rate=None, usual_close=within)))
    assert story.headline == "No clear change in violations since last week"
    assert "14% less than in week 45" in "".join(s.text for s in story.lead)
    below = replace(within, lo=0.45, position="below")
    story = story_of(replace(report, trend=replace(trend(report), usual_violation_rate=None, usual_close=below)))
    assert "less of their time too close" in story.headline


def test_a_camera_that_recorded_nothing_is_missing_in_the_headline_and_the_lead() -> None:
    one, three = story_of(silent(1)), story_of(silent(3))
    assert one.headline == "No clear change in violations since last week, without camera “Entrance”"
    assert "Camera “Entrance” recorded nothing" in "".join(s.text for s in one.lead)
    assert three.headline.endswith("without 3 of 4 cameras")


@pytest.mark.parametrize("case", [name for name in CASES if "silent" not in name and CASES[name]().state != "no_data"])
def test_every_kind_of_headline_and_lead_names_a_camera_that_recorded_nothing(case: str) -> None:
    story = story_of(silent(1, CASES[case]()))
    assert story.headline.endswith(("without camera “Entrance”", "; camera “Entrance” recorded nothing"))
    assert terms.n_words(story.headline) <= MAX_WORDS + terms.n_words("without camera “Entrance”")
    lead = "".join(s.text for s in story.lead)
    assert "Camera “Entrance” recorded nothing" in lead
    assert re.search(r"[^ ] Camera “Entrance” recorded nothing[^.]*\.$", lead)


def test_a_camera_that_recorded_minutes_is_not_said_to_have_recorded_nothing() -> None:
    nothing = silent(1, weeks.first_week())
    cameras = (replace(nothing.coverage.cameras[0], recorded_h=0.03), *nothing.coverage.cameras[1:])
    story = story_of(replace(nothing, coverage=replace(nothing.coverage, cameras=cameras)))
    assert story.headline.endswith("; camera “Entrance” recorded too little to count")
    lead = "".join(s.text for s in story.lead)
    assert "Camera “Entrance” recorded too little to count" in lead
    assert "nothing" not in lead


def test_a_headline_of_a_week_compared_with_nothing_counts_many_silent_cameras() -> None:
    assert story_of(silent(3, weeks.first_week())).headline.endswith("; 3 of 4 cameras recorded nothing")
    assert story_of(silent(4, weeks.no_data())).headline == "We have no data for week 46"


@pytest.mark.parametrize("people", ["visitors", "staff"])
@pytest.mark.parametrize("language", ["en", "it"])
def test_the_page_says_whom_its_figures_count(people: str, language: str) -> None:
    def page(*settings: tuple[str, str]) -> str:
        week = weeks.first_week()
        return render_html(
            replace(week, provenance=replace(week.provenance, language=language, settings_non_default=settings))
        )

    said = {"en": {"visitors": "count visitors", "staff": "count staff only"}}
    said["it"] = {"visitors": "contano i visitatori", "staff": "contano solo il personale"}
    assert said[language][people] in page(("people", people))
    assert said[language][people] not in page()


def test_a_week_after_a_gap_is_not_called_the_first() -> None:
    story = story_of(after_a_gap(is_usual=False))
    said = all_words(story)
    assert story.headline == "121 violations per open hour; last week has no figures to compare with"
    assert "first week" not in said
    assert "no earlier week" not in said
    assert "Comparisons start again next week." in story.notes
    usual = story_of(after_a_gap(is_usual=True))
    assert usual.headline == "Violations are in their usual range"
    assert "The usual range is 110 to 150." in "".join(s.text for s in usual.lead)
    assert "no earlier week" not in render_html(after_a_gap(is_usual=True))


def test_with_a_silent_camera_the_busiest_spot_is_that_of_what_was_recorded() -> None:
    report = silent(1, weeks.first_week())
    said = all_words(story_of(report))
    assert "Checkout queue is the busiest spot that was recorded. 36% of the violations that were recorded." in said
    assert "the level of this week where cameras recorded" in said
    assert "of all violations" not in said
    assert "busiest spot that was recorded" in figure_titles.where(report)
    assert "busiest spot that was recorded" not in all_words(story_of(weeks.first_week()))


def test_an_outage_nobody_logged_is_no_change_at_the_site_that_does_not_show() -> None:
    report = weeks.normal()
    areas = tuple(replace(a, violation_rate=replace(a.violation_rate, verdict="cannot_tell")) for a in report.areas)
    report = replace(report, areas=areas)
    outage = replace(report.log[1], kind="detected", area_id=None, area_name=None)
    agenda = Agenda(places=(), asked=(), busiest_before=())
    quiet = things(replace(report, log=(outage,), change_effects=(), agenda=agenda))
    assert quiet[0].text == "Nothing was logged at the site in these weeks."
    logged = things(replace(report, log=(report.log[1],), change_effects=(), agenda=agenda))
    assert logged[0].text.startswith("Changes at the site do not show")
    moved = replace(report.log[1], area_id=areas[0].area_id, area_name=areas[0].name)
    dark = (replace(areas[0], recorded_share=0.0), *areas[1:])
    unseen = things(replace(report, areas=dark, log=(moved,), change_effects=(), agenda=agenda))
    assert unseen[0].text == f"What the change at {areas[0].name} did is not known: nothing was recorded there."


def test_the_least_likely_hour_is_named_beside_its_usual_count() -> None:
    lead = "".join(s.text for s in story_of(unusual_hour()).lead)
    assert "Unusual: Monday 10:00, with 283 violations (usually 72)." in lead


@pytest.mark.parametrize(
    ("week", "headline"),
    [
        (weeks.no_data, "We have no data for week 46"),
        (weeks.too_incomplete, "Week 46 is too incomplete to compare"),
        (weeks.not_over, "Week 46 is not over yet"),
        (weeks.empty, "No violations were recorded in week 46"),
        (weeks.first_week, "121 violations per open hour in the first week"),
        (weeks.settings_changed, "A new distance limit was set on Wednesday"),
    ],
)
def test_abnormal_weeks_say_first_what_is_known(week, headline: str) -> None:  # type: ignore[no-untyped-def]
    assert story_of(week()).headline == headline


@pytest.mark.parametrize(("n", "more"), [(2, ""), (3, "; and 1 more time."), (4, "; and 2 more times.")])
def test_missing_times_that_are_not_listed_are_counted(n: int, more: str) -> None:
    week = weeks.too_incomplete()
    outages = tuple(week.coverage.outages[:1] * n)
    (note,) = story_of(replace(week, coverage=replace(week.coverage, outages=outages))).notes
    assert note.endswith(more)
    assert ("more" in note) == bool(more)


@pytest.mark.parametrize(
    "week",
    [weeks.no_data, weeks.too_incomplete, weeks.not_over, weeks.empty, weeks.first_week, weeks.settings_changed],
)
def test_abnormal_weeks_name_no_change(week) -> None:  # type: ignore[no-untyped-def]
    said = all_words(story_of(week()))
    assert not any(w in said for w in ("% fewer", "% more", "clearly fell", "clearly rose", " fell by", " rose by"))


def test_after_needs_an_entry_in_the_area_that_moved_before_most_of_it() -> None:
    report = weeks.normal()
    entry = report.log[1]
    assert story_of(report).headline == "Violations fell by about a seventh after the change at Main entrance"
    for other in (
        replace(entry, moved_after=0.5),
        replace(entry, moved_after=None),
        replace(entry, area_id="a0"),
        replace(entry, area_id=None),
        replace(entry, kind="detected"),
        replace(entry, floor_share=0.79),
        replace(entry, floor_share=None),
        replace(entry, rest_verdict="clear_fall"),
        replace(entry, rest_verdict=None),
    ):
        changed = replace(report, log=(other,))
        assert change_to_name(changed) is None
        assert " after " not in story_of(changed).headline


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (1.2, "; all of it at Main entrance"),
        (0.7, "; most of it at Main entrance"),
        (0.5, "; half of it at Main entrance"),
        (0.35, "; a third of it at Main entrance"),
        (0.3, ""),
    ],
)
def test_a_headline_without_a_change_to_name_says_where_the_difference_lies(share: float, said: str) -> None:
    report = replace(weeks.normal(), log=())
    violation_rate = report.level.violation_rate
    assert violation_rate.previous is not None
    assert violation_rate.change is not None
    whole = violation_rate.previous * violation_rate.change
    parts = (0.0, share * whole, None, 0.1 * whole, (1 - share) * whole)
    areas = tuple(replace(a, difference=d) for a, d in zip(report.areas, parts, strict=True))
    assert story_of(replace(report, areas=areas)).headline == f"Violations fell by about a seventh{said}"


GONE = Reason("logged_change.not_yet_gone")


def planted_redesign(**other: object) -> LoggedChangeEffect:
    """A change that its running verdict, seen beside other areas, shows to work."""
    effect = Estimate(value=None, change=-0.48, change_lo=-0.6, change_hi=-0.33, verdict="clear_fall")
    return replace(
        change_effects()[0],
        is_credible=True,
        doubts=(),
        running=effect,
        e_value=400.0,
        n_watched=6,
        net=replace(effect, change=-0.1, change_lo=-0.15, change_hi=-0.05),
        contribution=-0.1,
        outcome="works",
        **other,  # type: ignore[arg-type]
    )


def test_only_a_controlled_comparison_may_say_that_a_change_works() -> None:
    report = weeks.normal()
    worked = story_of(replace(report, change_effects=(planted_redesign(),))).things[0]
    assert worked.title == "The change at Checkout queue works so far"
    assert worked.text.startswith("In the 6 weeks since Wed 7 Oct: 48% less time too close there (likely")
    assert "compared with End of aisle 2 and Pharmacy counter" in worked.text
    for said in ("moved", "fell", "doubtful", "rose", "about_same", "cannot_tell", "too_early", "alone"):
        other = replace(planted_redesign(), outcome=said)
        titles = [t.title for t in story_of(replace(report, change_effects=(other,))).things]
        assert not any("work" in title for title in titles), said


def test_a_fall_that_may_have_moved_elsewhere_is_no_success() -> None:
    report = replace(weeks.normal(), change_effects=(replace(planted_redesign(), outcome="fell", not_yet=GONE),))
    fell = story_of(report).things[0]
    assert fell.title == "Less time too close at Checkout queue since the change"
    assert fell.text.endswith("Whether it moved elsewhere is not known yet.")


def test_a_fall_that_something_else_may_have_made_is_not_hidden() -> None:
    report = weeks.normal()
    areas = tuple(replace(a, violation_rate=replace(a.violation_rate, verdict="cannot_tell")) for a in report.areas)
    doubtful = replace(planted_redesign(), outcome="doubtful")
    told = story_of(replace(report, areas=areas, log=(), change_effects=(doubtful,))).things[0]
    assert (
        told.text
        == "At Checkout queue there is less time too close since Wed 7 Oct, but something else may have done it."
    )


def test_a_fall_that_moved_elsewhere_is_called_a_move() -> None:
    moved = replace(planted_redesign(), moved_elsewhere=1.2, outcome="moved")
    first = story_of(replace(weeks.normal(), change_effects=(moved,))).things[0]
    assert first.title == "Less time too close at Checkout queue, more elsewhere"
    assert "but the rest of the floor took up 100% of it" in first.text


@pytest.mark.parametrize("outcome", ["too_early", "cannot_tell", "alone", "about_same", "doubtful", "rose"])
def test_a_fall_since_last_week_in_a_changed_area_is_said_beside_what_the_log_says_of_the_change(outcome: str) -> None:
    change = replace(planted_redesign(), area_name="Main entrance", outcome=outcome)
    report = replace(weeks.normal(), change_effects=(change,))
    thing = story_of(report).things[0]
    assert thing.title == "Fewer violations at Main entrance than last week"
    assert thing.text.startswith("43% fewer than in week 45 (")
    assert thing.text.endswith(f"It was changed on Wed 7 Oct. {came_of(change)}")
    assert "lear fall" not in thing.title + thing.text


def test_a_fall_in_a_small_area_is_not_said_to_be_invisible() -> None:
    report = weeks.normal()
    areas = tuple(
        replace(a, violation_rate=replace(a.violation_rate, verdict="cannot_tell"), is_material=False)
        for a in report.areas
    )
    small = replace(planted_redesign(), is_credible=False, contribution=-0.01)
    told = story_of(replace(report, areas=areas, log=(), change_effects=(small,))).things[0]
    assert told.text == "What was changed at the site shows in small parts of the floor only."


def test_a_short_log_entry_is_quoted() -> None:
    report = weeks.normal()
    entry = replace(report.log[1], text="Display moved.")
    assert (
        story_of(replace(report, log=(entry,))).headline == "Violations fell by about a seventh after “Display moved”"
    )


def test_after_is_not_said_of_the_other_direction() -> None:
    report = with_verdicts("clear_rise", "not_measurable")
    assert " after " not in story_of(replace(report, log=weeks.normal().log)).headline


def test_the_legal_distance_comes_from_the_setting() -> None:
    for week in (weeks.normal, weeks.empty):
        report = week()
        six_feet = replace(report, rules=replace(report.rules, distance_m=1.83))
        said = all_words(story_of(six_feet))
        assert "1.83 m" in said
        assert "2 m" not in said


def test_all_cameras_at_once_points_to_the_network() -> None:
    report = weeks.no_data()
    assert "network or the engine" in story_of(report).notes[0]
    first, *rest = report.coverage.cameras
    apart = replace(first, last_record=datetime(2026, 11, 6, 9, tzinfo=weeks.ROME))
    apart_report = replace(report, coverage=replace(report.coverage, cameras=(apart, *rest)))
    assert "different times" in story_of(apart_report).notes[0]


def test_a_week_closed_throughout_is_not_called_an_outage() -> None:
    report = weeks.no_data()
    closed = replace(report, coverage=replace(report.coverage, scheduled_h=0.0, open_h=0.0, outages=()))
    story = story_of(closed)
    assert (story.rule, story.headline) == ("closed", "The site was closed in week 46")
    said = all_words(story)
    assert not any(w in said for w in ("network", "stopped", "No camera", "no data"))
    figures = render_html(closed).partition('<dl class="kpis')[2].partition("</dl>")[0]
    assert "No recording due" in figures
    assert "0%" not in figures


def test_records_at_closed_hours_only_point_to_the_opening_hours_not_to_the_network() -> None:
    report = weeks.no_data()
    cameras = tuple(
        replace(c, last_record=datetime(2026, 11, 10, 3, tzinfo=weeks.ROME)) for c in report.coverage.cameras
    )
    notes = story_of(replace(report, coverage=replace(report.coverage, cameras=cameras))).notes
    assert "opening hours" in notes[0]
    assert "network" not in notes[0]


def test_a_floor_without_a_camera_says_so() -> None:
    report = weeks.no_data()
    bare = replace(report, coverage=replace(report.coverage, cameras=(), scheduled_h=0.0, outages=()))
    assert story_of(bare).headline == "No camera covers this floor"


def test_a_normal_week_has_one_that_worked_one_to_watch_one_not_to_trust() -> None:
    assert [t.kind for t in story_of(weeks.normal()).things] == ["worked", "watch", "distrust"]


def test_a_weak_camera_is_named_as_not_to_trust_and_its_own_spot_is_not_asked_about() -> None:
    report = weeks.normal()
    assert story_of(report).things[2].title == "Camera “Aisles” recorded 85% of its open hours"
    spot = replace(report.busiest_spot, area_id="a2", name="End of aisle 2")
    assert story_of(replace(report, busiest_spot=spot)).question == "How can Camera “Aisles” record all week?"


def test_an_area_of_a_weak_camera_is_not_to_be_trusted_unless_its_change_is_clear() -> None:
    report = weeks.normal()
    assert story_of(report).things[2].text.endswith("It sees End of aisle 2: do not read a trend there.")
    clear = tuple(
        replace(a, violation_rate=replace(a.violation_rate, verdict="clear_fall")) if a.name == "End of aisle 2" else a
        for a in report.areas
    )
    text = story_of(replace(report, areas=clear)).things[2].text
    assert text.endswith("It sees End of aisle 2: the change there uses only hours recorded in both weeks.")


@pytest.mark.parametrize("name", list(weeks.ALL))
def test_every_week_that_is_over_asks_one_question_and_uses_no_forbidden_word(name: str) -> None:
    report = weeks.ALL[name]()
    story = story_of(report)
    is_over = report.coverage.not_over_from is None
    assert story.question.endswith("?") is is_over
    assert story.question.count("?") == is_over
    if name != "hostile":
        assert forbidden_in(all_words(story)) == []
    assert finish(finish(report)) == finish(report)


def test_forbidden_words_are_found_as_whole_words_only() -> None:
    assert forbidden_in("An incident happened, and NaN.") == ["incident", "NaN"]
    assert forbidden_in("coincidental annulled proven familiar") == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (-0.14, "fell by about a seventh"),
        (-0.5, "fell by about half"),
        (0.34, "rose by about a third"),
        (0.01, "rose slightly"),
    ],
)
def test_a_change_is_named_by_the_nearest_fraction(change: float, said: str) -> None:
    assert terms.moved(change) == said


def test_large_rises_are_multiples_and_large_falls_end() -> None:
    assert terms.moved(1.0) == "about doubled"
    assert terms.moved(1.6) == "rose to about 2.6 times last week’s"
    assert terms.moved(-0.99) == "almost stopped"


def test_a_week_that_clearly_differs_but_is_usual_is_no_headline_and_the_lead_has_the_change() -> None:
    """One of twenty weeks in which nothing changed clearly differs from the week before."""
    story = story_of(beside_usual("clear_fall", "within"))
    assert story.headline == "Violations are in their usual range"
    assert "14% fewer than in week 45" in "".join(s.text for s in story.lead)
    assert story_of(beside_usual("clear_fall", "below")).headline.startswith("Violations fell by about a seventh")


def test_chance_alone_is_a_thing_to_know_of_first_weeks_only() -> None:
    """A site that reads its page every week knows it: the same third thing in ten of eleven weeks is no news."""
    report = weeks.normal()
    whole = tuple(replace(c, share=1.0, not_counted=None, not_compared=None) for c in report.coverage.cameras)
    report = replace(report, coverage=replace(report.coverage, cameras=whole))
    assert [t.kind for t in things(report)] == ["worked", "watch", "distrust"]
    assert things(report)[2].title == "Likely ranges cover chance only"
    known = replace(report, agenda=Agenda(places=(), asked=(), busiest_before=()), trend=trend(report))
    assert [t.kind for t in things(known)] == ["worked", "watch"]
    weak = replace(known, coverage=replace(known.coverage, cameras=(replace(whole[0], share=0.5), *whole[1:])))
    assert [t.kind for t in things(weak)] == ["worked", "watch", "distrust"]
