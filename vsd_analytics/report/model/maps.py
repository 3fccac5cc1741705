"""Adds the maps beside the week's own to its report: changes, footsteps, views, pictures of the spots."""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.figures.week.change_maps import change_maps
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.footsteps_and_views import footsteps, views
from vsd_analytics.report.draw.spot_pictures import spot_pictures
from vsd_analytics.report.model.week import WeekReport


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
