"""What logged changes did to their areas (M27), and what moved the time people spend close (M23)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.suppression import GIVES_AWAY, is_small, too_few
from vsd_analytics.figures.week import page_estimates
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import Causes, Redesign
from vsd_analytics.stats.decomposition import MixingChange

SHOWN_DAYS: Final = 63
"""A change is on the page for nine weeks: four after it are compared, and washout and holidays may move these."""
NEW_DAYS: Final = 14
"""A change of the week or the one before lies between the two weeks that M23 compares."""


def redesigns(
    data: WeekData, found: Sequence[BeforeAfterFigure], *, shown_days: int = SHOWN_DAYS
) -> tuple[Redesign, ...]:
    """Return the logged changes whose weeks before and after reach into the report's week or are still to come.

    A change is reported as long as its weeks after include a day of this week, or it lies in the last nine weeks. In
    the second case the report says what is still missing.

    Args:
        data: The week.
        found: What the changes did.
        shown_days: Days back from the week's end from which changes are given.
    """
    return tuple(
        redesign(data, f) for f in found if (data.sunday - f.at.astimezone(data.site.zone).date()).days < shown_days
    )


def causes(found: MixingChange, *, people_moved_by: tuple[int, ...] = ()) -> Causes:
    """Return crowding, layout and behaviour as relative changes, whose product is the whole, and parts, whose sum is.

    Args:
        found: The change from the week before.
        people_moved_by: The logged changes whose doing the part of people is: `moved_people`.
    """
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
        people_part=found.crowding_part,
        layout_part=found.layout_part,
        behaviour_part=found.behaviour_part,
        people_moved_by=people_moved_by,
    )


def moved_people(data: WeekData, found: Sequence[BeforeAfterFigure]) -> tuple[int, ...]:
    """Return the numbers of the changes of the last two weeks that clearly left fewer people in their areas."""
    return tuple(f.number for f in found if _moved_people(data, f))


def _moved_people(data: WeekData, found: BeforeAfterFigure) -> bool:
    """Tell whether a change of the last two weeks clearly left fewer people in its area."""
    is_new = 0 <= (data.sunday - found.at.astimezone(data.site.zone).date()).days < NEW_DAYS
    is_shown = found.state == "ok" and found.is_credible and not is_held_back(data, found)
    return is_new and is_shown and found.people is not None and found.people.verdict == "clear_fall"


def redesign(data: WeekData, found: BeforeAfterFigure) -> Redesign:
    """Return what a logged change did, without what would tell a small count."""
    names = {a.area_id: a.name for a in data.areas}
    effect = page_estimates.change(found.effect) if found.effect is not None else None
    if effect is None and found.alone is not None:
        effect = page_estimates.change(found.alone)
    often = page_estimates.change(found.often) if found.often is not None and found.often.theta is not None else None
    below = int(data.site.settings.mask_below)
    if is_held_back(data, found):
        why = too_few(below) if _is_few(found, below=below) else GIVES_AWAY
        effect = Estimate(value=None, verdict="too_little_data", state="not_enough_data", reason=why)
        often = None
    more = {} if found.state != "ok" or is_held_back(data, found) else _over_weeks(found)
    windows = found.windows
    return Redesign(
        number=found.number,
        at=found.at.astimezone(data.site.zone),
        text=found.text,
        area_name=found.area_name,
        design=found.design,
        is_credible=found.is_credible and found.state == "ok",
        n_weeks=None if windows is None else windows.n_weeks,
        before=None if windows is None else windows.before,
        after=None if windows is None else windows.after,
        effect=effect if found.state == "ok" else None,
        often=often if found.state == "ok" else None,
        people=page_estimates.change(found.people) if found.people is not None and found.state == "ok" else None,
        compared_with=tuple(names.get(a, a) for a in found.comparison_areas),
        doubts=found.doubts,
        cautions=found.cautions,
        **more,
        assumptions=found.assumptions,
        state=found.state,
        reason=found.reason,
    )


def _over_weeks(found: BeforeAfterFigure) -> dict[str, Any]:
    """Return what is known of the time too close: in the area, over all weeks watched, and on the whole floor."""
    known: dict[str, Any] = {}
    for name, effect in (("burden", found.burden), ("close", found.close), ("running", found.running)):
        if effect is not None:
            known[name] = page_estimates.change(effect)
    if found.running is not None:
        known |= {"e_value": found.running.e_value, "n_watched": found.running.n_weeks}
    if found.routes is not None:
        known |= {"through_people": found.routes.people, "through_closeness": found.routes.closeness}
    if found.floor is not None and found.floor.net.theta is not None:
        known["net"] = page_estimates.change(found.floor.net)
        known["contribution"] = found.floor.net.contributions[found.floor.places.index(found.area_id)]
        known["moved_elsewhere"] = found.floor.moved_elsewhere
    return known


def is_held_back(data: WeekData, found: BeforeAfterFigure) -> bool:
    """Tell whether a change would tell a small count: its own, or one of the area in any of its weeks."""
    if _is_few(found, below=int(data.site.settings.mask_below)):
        return True
    spans = () if found.windows is None else (found.windows.before, found.windows.after)
    return any(data.is_held_back(found.area_id, *span) for span in spans)


def _is_few(found: BeforeAfterFigure, *, below: int) -> bool:
    counts = [] if found.alone is None else [found.alone.n_a, found.alone.n_b]
    counts += [] if found.effect is None else [found.effect.n_before, found.effect.n_after]
    return any(is_small(n or 0, below=below) for n in counts)
