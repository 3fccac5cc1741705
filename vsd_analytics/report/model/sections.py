"""Fills the sections of the report beyond the week and its map: further figures, then further maps."""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.figures.week import outlook, readings, redesigns, self_check, spots, trend_weeks
from vsd_analytics.figures.week.change_maps import change_maps
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.findings import Findings
from vsd_analytics.figures.week.footsteps_and_views import footsteps, views
from vsd_analytics.report.draw.spot_pictures import spot_pictures
from vsd_analytics.report.model.agenda import agenda
from vsd_analytics.report.model.ledger import ledger
from vsd_analytics.report.model.site_changes import same_engine_since
from vsd_analytics.report.model.spot_names import with_words
from vsd_analytics.report.model.week import WeekReport


def with_more(report: WeekReport, data: WeekData, found: Findings) -> WeekReport:
    """Return the report with its spots, readings, redesigns, causes, weeks, outlook, self-check and unusual hours.

    What a week cannot tell stays None: nothing is ranked or judged in a week without data, too incomplete, or empty.
    """
    made = replace(
        report,
        trend=trend_weeks.trend(
            data, found.trend, level=report.level, same_engine_since=same_engine_since(data, found)
        ),
        outlook=outlook.outlook(found.outlook),
        selfcheck=self_check.section(found.self_check),
    )
    made = replace(made, agenda=agenda(made, data, None))
    made = replace(made, ledger=ledger(data, found))
    if report.state in ("no_data", "too_incomplete") or report.level.violation_rate.state == "not_measurable":
        return made
    made = replace(
        made,
        redesigns=redesigns.redesigns(data, found.redesigns),
        causes=redesigns.causes(found.mixing, people_moved_by=redesigns.moved_people(data, found.redesigns))
        if report.state == "normal"
        else None,
        unusual=outlook.unusual(found.unusual, when=report.when),
    )
    if not report.level.violation_rate.value:
        return made
    numbers = spots.spots(
        data,
        found.hotspots,
        revealing=found.revealing_spots,
        areas=report.areas,
        maps=report.maps,
        coverage=report.coverage,
    )
    chosen = with_words(numbers, data, found.hotspots)
    made = replace(made, spots=chosen)
    return replace(
        made,
        agenda=agenda(made, data, found.hotspots),
        readings=readings.readings(data, found.groups, level=report.level, areas=report.areas),
        maps=spots.numbered(report.maps, chosen),
    )


def with_more_of_days(report: WeekReport, data: WeekData, found: Findings) -> WeekReport:
    """Return the report of days that are no week with what such days can tell: readings and causes."""
    if report.state in ("no_data", "too_incomplete") or not report.level.violation_rate.value:
        return report
    return replace(
        report,
        causes=redesigns.causes(found.mixing, people_moved_by=()) if report.state == "normal" else None,
        readings=readings.readings(data, found.groups, level=report.level, areas=report.areas),
    )


def with_more_maps(report: WeekReport, data: WeekData) -> WeekReport:
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
