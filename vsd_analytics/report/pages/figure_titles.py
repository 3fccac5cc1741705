"""Figure titles that state the finding, made by rule; each is one sentence without a full stop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from vsd_analytics.figures.week.model_map import ChangedPlace, ChangeMaps
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.no_data import nothing
from vsd_analytics.report.pages.things_to_know import weakest_camera
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say

NAMED_SHARE: Final = 0.2
"""A place is named beside the greatest when it changed by at least this share of it."""
NAMED_MAX: Final = 2


def where(report: WeekReport) -> str:
    """Return the map's title."""
    spot = report.busiest_spot
    if report.state == "empty":
        return say("titles.where_empty")
    if spot is None and report.state == "too_incomplete":
        return say("titles.where_so_far" if report.is_so_far else "titles.where_incomplete")
    if spot is None:
        return say("titles.where_unranked")
    return say("titles.where_recorded" if report.silent_cameras else "titles.where", area=spot.name)


def when(report: WeekReport) -> str:
    """Return the timetable's title."""
    busiest = report.busiest_hour
    if report.state == "empty":
        return say("titles.when_empty")
    if report.is_so_far:
        return say("titles.when_so_far")
    if busiest is None or report.state == "too_incomplete":
        return say("titles.when_incomplete")
    day, hour = report.when.busiest_day, terms.moment(busiest.start)
    if day is None:
        return say("titles.when_hour", hour=hour)
    if day == busiest.start.date():
        return say("titles.when_day", day=terms.day(day), clock=fmt.clock(busiest.start))
    return say("titles.when_both", day=terms.day(day), hour=hour)


def changed(report: WeekReport) -> str:
    """Return the title of the areas table."""
    moved = [a for a in report.areas if a.violation_rate.verdict in ("clear_fall", "clear_rise")]
    moved.sort(key=lambda a: -abs(a.violation_rate.change or 0.0))
    clear = [say("words.the_rest") if a.area_id is None else a.name for a in moved]
    if report.state != "normal":
        return say("titles.changed_plain")
    if not report.areas:
        return say("titles.changed_floor", verdict=terms.verdict_words(report.level.violation_rate).lower())
    if not clear:
        return say("titles.changed_none")
    if len(clear) == 1:
        return say("titles.changed_one", area=clear[0])
    if len(clear) > 3:
        return say("titles.changed_many", n=len(clear))
    names = terms.joined(clear)
    return say("titles.changed", areas=f"{names[:1].upper()}{names[1:]}")


def data(report: WeekReport) -> str:
    """Return the title of the table of recorded hours."""
    coverage, camera = report.coverage, weakest_camera(report)
    if report.state == "no_data":
        return nothing(report).data_title
    if camera is None and coverage.not_over_from is None:
        return say("titles.data_complete")
    if camera is None:
        return say("titles.data", share=fmt.percent(coverage.share))
    rest = [c for c in coverage.cameras if c is not camera]
    if rest and all((c.share or 0.0) >= report.rules.full_hour_share for c in rest):
        return say("titles.data_one", camera=terms.camera_name(camera.name))
    return say("titles.data", share=fmt.percent(coverage.share))


def changed_places(shown: ChangeMaps) -> str:
    """Return the finding of the three maps, such as "Fewer at Main entrance, more at Checkout queue"."""
    fewer = _named([(p.fewer, p) for p in shown.places])
    more = _named([(p.more, p) for p in shown.places])
    if fewer and more:
        return say("maps.change_both", fewer=fewer, more=more)
    if fewer:
        return say("maps.change_fewer", fewer=fewer)
    return say("maps.change_more", more=more) if more else say("maps.change_none")


def _named(amounts: Sequence[tuple[float, ChangedPlace]]) -> str:
    """Return the places that changed most, in words; "" when none did."""
    ranked = sorted((item for item in amounts if item[0] > 0), key=lambda item: (-item[0], item[1].name))
    kept = [p for n, p in ranked if n >= NAMED_SHARE * ranked[0][0]][:NAMED_MAX]
    return terms.joined(say("maps.rest") if p.area_id is None else p.name for p in kept)
