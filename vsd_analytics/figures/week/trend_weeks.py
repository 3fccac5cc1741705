"""The last ten weeks of a floor (M28), each over all hours it recorded, and what was changed when."""

from __future__ import annotations

from string import ascii_uppercase
from typing import Final

from vsd_analytics.figures import trend as analysis
from vsd_analytics.figures.week import estimates, page_estimates
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_sections import Trend, TrendMark, TrendWeek
from vsd_analytics.figures.week.results import Level
from vsd_analytics.result import Reason
from vsd_analytics.stats.trend import WeekRates

WEEKS: Final = 10
"""Points of the chart: what its width shows legibly."""


def trend(data: WeekData, found: analysis.FloorTrend, *, level: Level) -> Trend:
    """Return the last ten weeks.

    The last of them is the week of the report itself, so that the page never has two values for one figure. A
    week whose own report holds the floor's figures back has none here either.

    Args:
        data: The week.
        found: The weeks of the analysis room.
        level: The headline numbers, without what must be held back.
    """
    shown = found.weeks[-WEEKS:]
    below = int(data.site.settings.mask_below)
    names = {a.area_id: a.name for a in data.areas}
    first = shown[0].monday if shown else data.monday
    marks = [m for m in found.marks if m.at.astimezone(data.site.zone).date() >= first]
    return Trend(
        weeks=tuple(
            _week(
                w,
                below=below,
                own=level if w.monday == data.monday else None,
                why_hidden=data.hidden_in(w.monday).why_floor,
            )
            for w in shown
        ),
        marks=tuple(
            TrendMark(
                label=ascii_uppercase[i % 26],
                at=m.at.astimezone(data.site.zone),
                text=m.text,
                area_name=names.get(m.area_id or ""),
            )
            for i, m in enumerate(marks)
        ),
        state=found.state,
        reason=found.reason,
        risky_reason=found.risky_reason,
    )


def _week(week: WeekRates, *, below: int, own: Level | None, why_hidden: Reason | None) -> TrendWeek:
    _, number, _ = week.monday.isocalendar()
    often, risky = (page_estimates.level(rate, below=below) for rate in (week.often, week.risky))
    if own is not None and week.often is not None:
        often, risky = own.often, own.risky if week.risky is not None else None
    elif why_hidden is not None:
        often, risky = (None if e is None else estimates.without_figures(e, why_hidden) for e in (often, risky))
    return TrendWeek(
        iso=week.week,
        number=number,
        monday=week.monday,
        often=often,
        risky=risky,
        coverage=week.coverage,
        reason=week.reason,
    )
