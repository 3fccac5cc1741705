"""Figure titles that state the finding, made by rule; each is one sentence without a full stop."""

from __future__ import annotations

from vsd_analytics.report import format as fmt
from vsd_analytics.report import words
from vsd_analytics.report.model import WeekReport
from vsd_analytics.report.nothing import nothing
from vsd_analytics.report.things import weakest_camera


def where(report: WeekReport) -> str:
    """Return the map's title."""
    spot = report.busiest_spot
    if report.state == "empty":
        return "No floor reached the first colour"
    if spot is None and report.state == "too_incomplete":
        return "What was seen, where cameras recorded"
    if spot is None:
        return "Where violations happened"
    return f"{spot.name} is the busiest spot"


def when(report: WeekReport) -> str:
    """Return the timetable's title."""
    busiest = report.busiest_hour
    if report.state == "empty":
        return "Every recorded hour was empty"
    if busiest is None or report.state == "too_incomplete":
        return "The hours that were recorded"
    means = [m for m in report.when.day_means if m.value is not None]
    top = max(means, key=lambda m: m.value or 0.0, default=None)
    hour = f"{fmt.weekday(busiest.start.date())} {fmt.clock(busiest.start)}"
    if top is None or len(means) < 2:
        return f"{hour} is the busiest hour"
    if top.day == busiest.start.date():
        return f"{fmt.weekday(top.day)} is busiest, most of all at {fmt.clock(busiest.start)}"
    return f"{fmt.weekday(top.day)} is busiest on average, {hour} the busiest hour"


def changed(report: WeekReport) -> str:
    """Return the title of the areas table."""
    moved = [a for a in report.areas if a.often.verdict in ("clear_fall", "clear_rise")]
    moved.sort(key=lambda a: -abs(a.often.change or 0.0))
    clear = ["the rest of the floor" if a.area_id is None else a.name for a in moved]
    if report.state != "normal":
        return "Areas of this floor"
    if not report.areas:
        return f"Whole floor: {words.verdict_words(report.level.often).lower()}"
    if not clear:
        return "No area clearly changed"
    if len(clear) == 1:
        return f"Only {clear[0]} clearly changed"
    if len(clear) > 3:
        return f"{len(clear)} areas clearly changed"
    said = words.joined(clear)
    return f"{said[:1].upper()}{said[1:]} clearly changed"


def data(report: WeekReport) -> str:
    """Return the title of the table of recorded hours."""
    coverage, camera = report.coverage, weakest_camera(report)
    if report.state == "no_data":
        return nothing(report).data_title
    if camera is None:
        return "The week is nearly complete"
    rest = [c for c in coverage.cameras if c is not camera]
    if rest and all((c.share or 0.0) >= report.rules.full_hour_share for c in rest):
        return f"{words.camera_name(camera.name)} missed some of its hours; the rest is nearly complete"
    return f"Cameras recorded {fmt.percent(coverage.share)} of open hours"
