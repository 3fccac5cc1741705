"""Fills the sections of the report beyond the week and its map from the answers of the analysis room."""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.figures.week import outlook, readings, redesigns, spots, trend_weeks
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.findings import Findings
from vsd_analytics.report.model.spot_words import with_words
from vsd_analytics.report.model.week import WeekReport


def with_more(report: WeekReport, data: WeekData, found: Findings) -> WeekReport:
    """Return the report with its spots, readings, redesigns, causes, weeks, outlook and unusual hours.

    What a week cannot tell stays None: nothing is ranked or judged in a week without data, too incomplete, or empty.
    """
    made = replace(
        report,
        trend=trend_weeks.trend(data, found.trend, level=report.level),
        outlook=outlook.outlook(found.outlook),
    )
    if report.state in ("no_data", "too_incomplete") or report.level.often.state == "not_measurable":
        return made
    made = replace(
        made,
        redesigns=redesigns.redesigns(data, found.redesigns),
        causes=redesigns.causes(found.mixing, people_moved_by=redesigns.moved_people(data, found.redesigns))
        if report.state == "normal"
        else None,
        unusual=outlook.unusual(found.unusual, when=report.when),
    )
    if not report.level.often.value:
        return made
    numbers = spots.spots(
        data,
        found.hotspots,
        telling=found.telling_spots,
        areas=report.areas,
        maps=report.maps,
        coverage=report.coverage,
    )
    chosen = with_words(numbers, data, found.hotspots)
    return replace(
        made,
        readings=readings.readings(data, found.groups, level=report.level, areas=report.areas),
        spots=chosen,
        maps=spots.numbered(report.maps, chosen),
    )
