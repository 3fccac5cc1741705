"""What logged changes did to their areas (M27), and what moved the time people spend close (M23)."""

from __future__ import annotations

from collections.abc import Sequence

from vsd_analytics.analysis.before_after import BeforeAfterFigure
from vsd_analytics.report import converted
from vsd_analytics.report.model import Causes, Estimate, Redesign
from vsd_analytics.report.privacy import is_small, too_few
from vsd_analytics.report.weekdata import WeekData
from vsd_analytics.stats.decomposition import MixingChange
from vsd_analytics.stats.estimates import ChangeEstimate


def redesigns(data: WeekData, found: Sequence[BeforeAfterFigure]) -> tuple[Redesign, ...]:
    """Return the logged changes whose weeks before and after reach into the report's week or are still to come.

    A change is told as long as its weeks after hold a day of this week, or it lies in the last nine weeks: then it is
    said what is still missing.
    """
    return tuple(_redesign(data, f) for f in found if (data.sunday - f.at.astimezone(data.site.zone).date()).days < 63)


def causes(found: MixingChange) -> Causes:
    """Return crowding, layout and behaviour as relative changes; together, as factors, they make the whole."""
    behaviour = found.behaviour
    if found.state != "ok" or found.close is None or behaviour is None or behaviour.theta is None:
        state = found.state if found.state != "ok" else "not_enough_data"
        return Causes(state=state, reason=found.reason)
    return Causes(
        close=found.close - 1,
        people=None if found.crowding is None else found.crowding - 1,
        layout=None if found.layout is None else found.layout - 1,
        behaviour=behaviour.theta - 1,
        behaviour_lo=behaviour.change_lo,
        behaviour_hi=behaviour.change_hi,
    )


def _redesign(data: WeekData, found: BeforeAfterFigure) -> Redesign:
    names = {a.area_id: a.name for a in data.areas}
    effect = converted.change(found.effect) if found.effect is not None else None
    if effect is None and found.alone is not None:
        effect = converted.change(found.alone)
    often = converted.change(found.often) if found.often is not None and found.often.theta is not None else None
    below = int(data.site.settings.mask_below)
    if found.alone is not None and _is_small(found.alone, below=below):
        effect = Estimate(value=None, verdict="too_little_data", state="not_enough_data", reason=too_few(below))
        often = None
    windows = found.windows
    return Redesign(
        number=found.number,
        at=found.at.astimezone(data.site.zone),
        text=found.text,
        area_name=found.area_name,
        design="beside" if found.design == "comparison areas" else "alone",
        is_credible=found.is_credible and found.state == "ok",
        n_weeks=None if windows is None else windows.n_weeks,
        before=None if windows is None else windows.before,
        after=None if windows is None else windows.after,
        effect=effect if found.state == "ok" else None,
        often=often if found.state == "ok" else None,
        people=converted.change(found.people) if found.people is not None and found.state == "ok" else None,
        compared_with=tuple(names.get(a, a) for a in found.comparison_areas),
        doubts=found.doubts,
        assumptions=found.assumptions,
        state=found.state,
        reason=found.reason,
    )


def _is_small(alone: ChangeEstimate, *, below: int) -> bool:
    return any(is_small(n or 0, below=below) for n in (alone.n_a, alone.n_b))
