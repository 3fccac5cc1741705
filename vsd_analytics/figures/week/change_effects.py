"""What logged changes did to their areas (M27), and what moved the time people spend close (M23)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

from vsd_analytics.answer import Answer, Answers, Outcome, Reason, Row, Value
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.change_answers import NO_RECEIVER, change_answers
from vsd_analytics.figures.change_verdicts import Receiver
from vsd_analytics.figures.compare import Days
from vsd_analytics.figures.experiments import clear_by
from vsd_analytics.figures.share.counts import GIVES_AWAY, Mask
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import Estimate, change_estimate, same_fields
from vsd_analytics.figures.week.model_sections import Causes, Foreseen, LoggedChangeEffect, ReceivingArea
from vsd_analytics.site.model import Site
from vsd_analytics.stats.before_after import BeforeAfter
from vsd_analytics.stats.decomposition import MixingChange
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.running_verdict import RunningVerdict

SHOWN_DAYS: Final = 84
"""A change is on the page for twelve weeks: eight after it may say that it works, washout and holidays move these."""
_RATES: Final = ("change_effects", "change_so_far", "change_parts", "change_receivers", "change_foreseen")
"""Tables of a logged change that are held back as a whole."""
NEW_DAYS: Final = 14
"""A change of the week or the one before lies between the two weeks that M23 compares."""


OVER_WEEKS: Final = (
    "violation_rate", "burden", "close", "running", "e_value", "n_watched", "through_people", "through_closeness",
    "usual_min", "avoided_min", "net", "contribution", "moved_elsewhere", "not_yet", "foreseen",
)  # fmt: skip
"""Fields that a hidden count takes with it."""


def change_effects(
    data: WeekData, figures: Sequence[BeforeAfterFigure], *, shown_days: int = SHOWN_DAYS
) -> tuple[LoggedChangeEffect, ...]:
    """Return the logged changes whose weeks before and after reach into the report's week or are still to come.

    A change is reported as long as its weeks after include a day of this week, or it lies in the last twelve weeks. In
    the second case the report says what is still missing.

    Args:
        data: The week.
        figures: What the changes did.
        shown_days: Days back from the week's end from which changes are given.
    """
    return tuple(
        change_effect(data, f)
        for f in figures
        if (data.sunday - f.at.astimezone(data.site.zone).date()).days < shown_days
    )


def causes(change: MixingChange, *, people_moved_by: tuple[int, ...] = ()) -> Causes:
    """Return crowding, layout and behaviour as relative changes, whose product is the whole, and parts, whose sum is.

    Args:
        change: The change from the week before.
        people_moved_by: The logged changes whose doing the part of people is: `moved_people`.
    """
    behaviour = change.behaviour
    if change.state != "ok" or change.close is None or behaviour is None or behaviour.value is None:
        state = change.state if change.state != "ok" else "not_enough_data"
        return Causes(state=state, reason=change.reason)
    return Causes(
        close=change.close - 1,
        people=None if change.crowding is None else change.crowding - 1,
        layout=None if change.layout is None else change.layout - 1,
        behaviour=behaviour.value - 1,
        behaviour_lo=behaviour.change_lo,
        behaviour_hi=behaviour.change_hi,
        people_part=change.crowding_part,
        layout_part=change.layout_part,
        behaviour_part=change.behaviour_part,
        people_moved_by=people_moved_by,
    )


def moved_people(data: WeekData, figures: Sequence[BeforeAfterFigure]) -> tuple[int, ...]:
    """Return the numbers of the changes of the last two weeks that clearly left fewer people in their areas."""
    new = [f for f in figures if 0 <= (data.sunday - f.at.astimezone(data.site.zone).date()).days < NEW_DAYS]
    fewer = [f for f in new if f.people is not None and f.people.verdict == "clear_fall"]
    return tuple(f.number for f in fewer if f.state == "ok" and f.is_credible and not is_held_back(data, f))


def change_effect(data: WeekData, figure: BeforeAfterFigure) -> LoggedChangeEffect:
    """Return what a logged change did, without what would tell a small count."""
    change = exact_effect(data.site, figure)
    known = None if figure.foreseen is None else figure.foreseen.known
    if known is not None and data.is_held_back(figure.area_id, *known):
        change = replace(change, foreseen=None)
    if figure.state != "ok":
        return change
    if not is_held_back(data, figure):
        return replace(change, receivers=_receiving(_shown_receivers(data, figure)))
    hidden = Estimate(value=None, state="not_enough_data", reason=_why_held_back(data, figure))
    none: dict[str, Any] = dict.fromkeys(OVER_WEEKS)
    return replace(
        change, effect=hidden, people=None if _hides_people(data, figure) else change.people, receivers=(),
        outcome=_outcome_held_back(figure), **none,
    )  # fmt: skip


def exact_effect(site: Site, figure: BeforeAfterFigure) -> LoggedChangeEffect:
    """Return what a logged change did, exact: for the operator, or to hide what would tell a small count."""
    names, windows = {a.area_id: a.name for a in site.areas}, figure.windows
    measured: dict[str, Any] = dict.fromkeys(("effect", "violation_rate", "people", "burden", "close", "running"))
    if figure.state == "ok":
        is_known = figure.violation_rate is not None and figure.violation_rate.value is not None
        measured |= {
            "effect": _change(figure.effect or figure.alone),
            "people": _change(figure.people),
            "violation_rate": _change(figure.violation_rate) if is_known else None,
            **_over_weeks(figure),
        }
    return same_fields(
        LoggedChangeEffect,
        figure,
        at=figure.at.astimezone(site.zone),
        outcome=figure.outcome if figure.state == "ok" else "too_early",
        not_yet=figure.not_yet if figure.state == "ok" else None,
        is_credible=figure.is_credible and figure.state == "ok",
        n_weeks=None if windows is None else windows.n_weeks,
        before=None if windows is None else windows.before,
        after=None if windows is None else windows.after,
        compared_with=tuple(names.get(a, a) for a in figure.comparison_areas),
        receivers=_receiving(figure.receivers),
        foreseen=_foreseen(site, figure),
        **measured,
    )


def shared_change_answers(data: WeekData, figure: BeforeAfterFigure) -> Answers:
    """Return the answers on a logged change (`change_answers`) without what would tell a small count.

    Where the change is held back, the tables of rates are empty and say why, and `change_places` has no more than the
    people of the area. Areas that took people up are left out where a week of theirs hides a count.

    Args:
        data: A week; its mask and its hidden counts decide.
        figure: The change.
    """
    told = Answers(change_answers(figure, None, data.site, inputs=data.warehouse.inputs_digest))
    if figure.state != "ok":
        return told
    if not is_held_back(data, figure):
        shown, received = {r.area_id for r in _shown_receivers(data, figure)}, told["change_receivers"]
        rows = tuple(row for row in received.rows if row["area_id"] in shown)
        return Answers((*told, replace(received, rows=rows) if rows else _empty(received, NO_RECEIVER)))
    why = _why_held_back(data, figure)
    [entry] = told["logged_change"].rows
    return Answers(
        (
            _entry_held_back(told["logged_change"], {**entry, "outcome": _outcome_held_back(figure)}),
            *(_empty(told[name], why) for name in _RATES if name in told),
            _people_only(data, figure, told["change_places"], why),
        )
    )


def _foreseen(site: Site, figure: BeforeAfterFigure) -> Foreseen | None:
    """Return when a change will be clear; None where nothing more is to come."""
    plan = figure.foreseen
    if plan is None:
        return None
    names = {a.area_id: a.name for a in site.areas}
    foreseen = Foreseen(
        change=plan.effect,
        power=plan.power,
        weeks_max=plan.weeks_max,
        n_areas=len(plan.comparison),
        left_out=tuple(
            Reason("logged_change.left_out", area=names.get(area_id, area_id), why=why)
            for area_id, why in plan.areas_left_out
        ),
        reason=None if plan.state == "ok" else plan.reason,
    )
    if plan.state != "ok":
        return foreseen
    way = plan.choices[0]
    if way.weeks_after is None:
        return replace(foreseen, power=way.power)
    return replace(foreseen, weeks=way.weeks_after, clear_by=clear_by(figure, site))


def _receiving(receivers: Iterable[Receiver]) -> tuple[ReceivingArea, ...]:
    return tuple(ReceivingArea(area_name=r.name, change=r.more, change_lo=r.lo, change_hi=r.hi) for r in receivers)


def _entry_held_back(answer: Answer, entry: Row) -> Answer:
    notes = tuple(note for note in answer.notes if note[1].code != "logged_change.not_yet")
    return replace(answer, rows=(entry,), notes=notes)


def _empty(answer: Answer, why: Reason) -> Answer:
    return replace(answer, rows=(), nothing=why, state="not_enough_data")


def _people_only(data: WeekData, figure: BeforeAfterFigure, places: Answer, why: Reason) -> Answer:
    rates = dict.fromkeys(("place_rate_change", "relative_change"), Value.missing(why))
    people = {"place_people_change": Value.missing(why)} if _hides_people(data, figure) else {}
    return replace(places, rows=tuple({**row, **rates, **people} for row in places.where(place="area")))


def _why_held_back(data: WeekData, figure: BeforeAfterFigure) -> Reason:
    return data.mask.why if _is_few(figure, data.mask) else GIVES_AWAY


def _outcome_held_back(figure: BeforeAfterFigure) -> Outcome:
    return "alone" if figure.outcome == "alone" else "too_early"


def _hides_people(data: WeekData, figure: BeforeAfterFigure) -> bool:
    return any(data.hides_time(figure.area_id, *span) for span in _spans(figure))


def _shown_receivers(data: WeekData, figure: BeforeAfterFigure) -> Iterator[Receiver]:
    """Yield the areas that took people up, but for those whose weeks hide a count."""
    for area in figure.receivers:
        if not any(data.is_held_back(area.area_id, *span) for span in _spans(figure)):
            yield area


def _change(estimate: ChangeEstimate | BeforeAfter | RunningVerdict | None) -> Estimate | None:
    return None if estimate is None else change_estimate(estimate)


def _over_weeks(figure: BeforeAfterFigure) -> dict[str, Any]:
    """Return what is known of the time too close: in the area, over all weeks watched, and on the whole floor."""
    known: dict[str, Any] = {name: _change(getattr(figure, name)) for name in ("burden", "close", "running")}
    if figure.running is not None:
        known |= {"e_value": figure.running.e_value, "n_watched": figure.running.n_weeks}
    if figure.routes is not None:
        known |= {"through_people": figure.routes.people, "through_closeness": figure.routes.closeness}
    floor, running = figure.floor, known["running"]
    if floor is not None:
        known["usual_min"] = floor.area_min
        if floor.area_min is not None and running is not None and running.change is not None:
            known["avoided_min"] = -running.change * floor.area_min
    if floor is not None and floor.net.value is not None:
        known["net"] = change_estimate(floor.net)
        known["contribution"] = floor.net.contributions[floor.places.index(figure.area_id)]
        known["moved_elsewhere"] = None if figure.taken_up is None else figure.taken_up.share
    return known


def is_held_back(data: WeekData, figure: BeforeAfterFigure) -> bool:
    """Tell whether a change would tell a small count: its own, or one of the area in any of its weeks."""
    if _is_few(figure, data.mask):
        return True
    return any(data.is_held_back(figure.area_id, *span) for span in _spans(figure))


def _spans(figure: BeforeAfterFigure) -> tuple[Days, ...]:
    """Return first and last day of the weeks before and of those after; nothing where there are none yet."""
    return () if figure.windows is None else (figure.windows.before, figure.windows.after)


def _is_few(figure: BeforeAfterFigure, mask: Mask) -> bool:
    counts = [] if figure.alone is None else [figure.alone.n_a, figure.alone.n_b]
    counts += [] if figure.effect is None else [figure.effect.n_before, figure.effect.n_after]
    return mask.hides(*counts)
