"""The next week (M25) and hours of this one far from usual (M24)."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import Final

from vsd_analytics.figures import forecast
from vsd_analytics.figures.unusual import UnusualWeek
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.model_sections import Outlook, OutlookHour, OutlookScore, UnusualHour, UnusualHours
from vsd_analytics.figures.week.results import HourCell, Timetable
from vsd_analytics.stats.forecast import ForecastScore

HIGHEST: Final = 3
"""Hours named beside the chart; all are in the JSON file."""


def outlook(floor_forecast: forecast.FloorForecast) -> Outlook:
    """Return what next week will be like, and how good the last forecast was."""
    series = floor_forecast.violations
    hours = [same_fields(OutlookHour, r) for r in series.rows if r.value is not None]
    _, number, _ = floor_forecast.monday.isocalendar()
    return same_fields(
        Outlook,
        series,
        iso=floor_forecast.week,
        number=number,
        monday=floor_forecast.monday,
        mean=sum(h.value for h in hours) / len(hours) if hours else None,
        highest=tuple(sorted(hours, key=lambda h: (-h.value, h.day, h.hour))[:HIGHEST]),
        score=_score(series.score),
    )


def unusual(week: UnusualWeek, *, when: Timetable) -> UnusualHours:
    """Return the hours far from usual; a count the timetable holds back is held back here, too."""
    cells = {(c.day, c.hour): c for c in when.cells if c.fold == 0}
    rows = (
        same_fields(UnusualHour, r, violations=r.violations if _is_printed(cells, r.day, r.hour) else None)
        for r in week.rows
    )
    return same_fields(UnusualHours, week, rows=tuple(rows))


def _is_printed(cells: Mapping[tuple[date, int], HourCell], day: date, hour: int) -> bool:
    cell = cells.get((day, hour))
    return cell is not None and cell.violations is not None


def _score(score: ForecastScore | None) -> OutlookScore | None:
    if score is None or score.state != "ok" or score.wape is None or score.wape_naive is None:
        return None
    return OutlookScore(error=score.wape, error_naive=score.wape_naive, hit_rate=score.hit_rate, n_hours=score.n_hours)
