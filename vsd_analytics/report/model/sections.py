"""Fills the sections of the report beyond the week and its map: further figures, then further maps."""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.figures.self_check import FloorSelfCheck
from vsd_analytics.figures.week import change_effects, outlook, readings, spots, trend_weeks
from vsd_analytics.figures.week.change_maps import change_maps
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.footsteps_and_views import footsteps, views
from vsd_analytics.figures.week.lazy_answers import LazyAnswers
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.model_sections import FalseAlarmShare, SelfCheck
from vsd_analytics.report.draw.spot_pictures import spot_pictures
from vsd_analytics.report.model.agenda import agenda
from vsd_analytics.report.model.logged_changes import logged_changes
from vsd_analytics.report.model.spot_names import with_words
from vsd_analytics.report.model.week import WeekReport


def add_week_sections(report: WeekReport, data: WeekData, answers: LazyAnswers) -> WeekReport:
    """Return the report with its spots, readings, logged changes, causes, weeks, outlook, self-check and unusual hours.

    What a week cannot tell stays None: nothing is ranked or judged in a week without data, too incomplete, or empty.
    """
    extended = replace(
        report,
        trend=trend_weeks.trend(
            data,
            answers.trend,
            level=report.level,
            same_engine_since=trend_weeks.same_engine_since(data, answers.trend.weeks),
        ),
        outlook=outlook.outlook(answers.outlook),
        selfcheck=_self_check(answers.self_check),
    )
    extended = replace(extended, agenda=agenda(extended, data, None))
    extended = replace(extended, logged_changes=logged_changes(data, answers))
    if report.state in ("no_data", "too_incomplete") or report.level.violation_rate.state == "not_measurable":
        return extended
    extended = replace(
        extended,
        change_effects=change_effects.change_effects(data, answers.change_effects),
        causes=change_effects.causes(
            answers.mixing, people_moved_by=change_effects.moved_people(data, answers.change_effects)
        )
        if report.state == "normal"
        else None,
        unusual=outlook.unusual(answers.unusual, when=report.when),
    )
    if not report.level.violation_rate.value:
        return extended
    numbers = spots.spots(
        data,
        answers.hotspots,
        revealing=answers.revealing_spots,
        areas=report.areas,
        maps=report.maps,
        coverage=report.coverage,
    )
    chosen = with_words(numbers, data, answers.hotspots)
    extended = replace(extended, spots=chosen)
    return replace(
        extended,
        agenda=agenda(extended, data, answers.hotspots),
        readings=readings.readings(data, answers.groups, level=report.level, areas=report.areas),
        maps=spots.numbered(report.maps, chosen),
    )


def add_days_sections(report: WeekReport, data: WeekData, answers: LazyAnswers) -> WeekReport:
    """Return the report of days that are no week with what such days can tell: readings and causes."""
    if report.state in ("no_data", "too_incomplete") or not report.level.violation_rate.value:
        return report
    return replace(
        report,
        causes=change_effects.causes(answers.mixing, people_moved_by=()) if report.state == "normal" else None,
        readings=readings.readings(data, answers.groups, level=report.level, areas=report.areas),
    )


def add_maps(report: WeekReport, data: WeekData) -> WeekReport:
    """Return the report with every map that its own map, the floor's first, can carry.

    Args:
        report: The report with its map and its numbered spots.
        data: The week.
    """
    floor = next((m for m in report.maps if m.kind != "picture"), None)
    if floor is None:
        return report
    return replace(
        report,
        change_maps=change_maps(data, areas=report.areas) if report.state == "normal" else None,
        footsteps=footsteps(data, extent=floor.extent),
        views=views(data, extent=floor.extent, labels={c.camera_id: c.label for c in report.coverage.cameras}),
        spot_pictures=spot_pictures(data, floor, spots=[(s.number, s.at) for s in floor.spots]),
    )


def _self_check(check: FloorSelfCheck) -> SelfCheck:
    """Return how often the report's verdicts are false alarms here."""
    measured = {"both": check.both, "violation_rate": check.violation_rate, "encounter_rate": check.encounter_rate}
    shares = {
        name: None if alarms is None else same_fields(FalseAlarmShare, alarms, share=alarms.value)
        for name, alarms in measured.items()
    }
    expected, lo, hi = check.false_a_year or (None, None, None)
    return same_fields(SelfCheck, check, **shares, false_a_year=expected, false_a_year_lo=lo, false_a_year_hi=hi)
