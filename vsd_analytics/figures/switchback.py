"""Days with and without a change in turn: how they are laid out, what they will show, and what they showed.

The arithmetic is `vsd_analytics.stats.switchback`, on person-time in violation per open hour of an area by day, over
that of its comparison areas taken together; by itself where it has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason, State
from vsd_analytics.config.change_log import read_log
from vsd_analytics.config.plans import DaysInTurn, Plan, read_plans
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.change_verdicts import Days, days_of, history_of
from vsd_analytics.figures.change_weeks import DAY, REFERENCE_WEEKS, changed_areas, local_day
from vsd_analytics.figures.comparison_areas import areas_that_serve
from vsd_analytics.figures.experiments import check_plan
from vsd_analytics.figures.panels import WEEK, Array, FloorHours
from vsd_analytics.site.model import Area, Site
from vsd_analytics.site.places import known_area, known_floor
from vsd_analytics.stats.running_verdict import MIN_REFERENCE_WEEKS
from vsd_analytics.stats.switchback import (
    SwitchbackEffect,
    SwitchbackPower,
    coins,
    pairs_needed,
    switchback_effect,
    switchback_power,
)
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse

SEED: Final = 1
"""Of the coins, where none is given."""
BLOCK: Final = 2 * WEEK
MOST_WEEKS: Final = 26


@dataclass(frozen=True, slots=True)
class SwitchbackPlan:
    """Days with and without a change in turn, and what they will show.

    Attributes:
        area_id, area_name: The area to be changed.
        effect: Effect looked for, relative: -0.3 = 30 % less time too close per open hour.
        power_asked: Chance of a clear verdict asked for.
        weeks_max: Weeks one is ready to wait.
        in_turn: The days; None where there is no plan.
        foreseen: Power, and where the effect will be measured.
        known: First and last day of the weeks from which the power was taken.
        comparison: Ids of the areas to compare with.
        areas_left_out: Why other areas of the floor do not serve, by id.
        state, reason: Why there is no plan.
    """

    area_id: str
    area_name: str
    effect: float
    power_asked: float
    weeks_max: int
    in_turn: DaysInTurn | None = None
    foreseen: SwitchbackPower | None = None
    known: Days | None = None
    comparison: tuple[str, ...] = ()
    areas_left_out: tuple[tuple[str, Reason], ...] = ()
    state: State = "not_enough_data"
    reason: Reason | None = None

    @property
    def weeks(self) -> int | None:
        """Return the weeks of the calendar, an even number."""
        if self.in_turn is None:
            return None
        days = [day for pair in self.in_turn.pairs for day in pair]
        return 2 * ((max(days) - min(days)) // BLOCK + 1)


@dataclass(frozen=True, slots=True)
class SwitchbackFigure:
    """What days in turn showed.

    Attributes:
        number: Of the plan, from 1.
        plan, in_turn: The plan and its days.
        area_name: The area.
        effect: The effect and its test.
        comparison: Ids of the areas compared with; empty = the area by itself.
        cautions: What the effect rests on, and what speaks against it.
        state, reason: Why there is no effect.
    """

    number: int
    plan: Plan
    in_turn: DaysInTurn
    area_name: str
    effect: SwitchbackEffect | None = None
    comparison: tuple[str, ...] = ()
    cautions: tuple[Reason, ...] = ()
    state: State = "not_enough_data"
    reason: Reason | None = None


def check_weeks(weeks: int) -> None:
    """Refuse weeks that make no pairs: UsageError E101, they are not even, or not 2 to `MOST_WEEKS`."""
    if weeks not in range(2, MOST_WEEKS + 1, 2):
        raise UsageError(
            f"{weeks} weeks of days in turn are not an even number from 2 to {MOST_WEEKS}",
            why="a day with the change has its partner in the next week",
            fix="--weeks 8",
        )


def plan_switchback(
    warehouse: Warehouse,
    area_id: str,
    *,
    effect: float,
    start: date,
    power: float = 0.8,
    weeks: int | None = None,
    weeks_max: int = 26,
    seed: int = SEED,
) -> SwitchbackPlan:
    """Return days with and without a change of an area in turn, and the power of their test.

    A coin decides for each weekday of two successive weeks in which of them the change is there. Days on which the site
    is closed have no partner and are left out, with the day that would have been theirs.

    Args:
        warehouse: Opened over `vsd_analytics.figures.experiments.plan_days`.
        area_id: The area to be changed.
        effect: Effect looked for, a share: -0.3 = 30 % less. Not 0.
        start: The calendar begins on the first Monday from this day on.
        power: Chance of a clear verdict, a share.
        weeks: Weeks of the calendar, even; None = the fewest that have this power.
        weeks_max: Weeks one is ready to wait, where `weeks` is None.
        seed: Of the coins.

    Raises:
        UsageError: E101, the site has no such area, or effect, power or weeks are out of range.

    Example:
        >>> vsd.plan_switchback(warehouse, "checkout-queue", effect=-0.3, start=date(2026, 11, 30)).state
        'not_enough_data'
    """
    check_plan(effect=effect, power=power)
    if weeks is not None:
        check_weeks(weeks)
    area = known_area(warehouse.site, area_id)
    data = FloorHours(warehouse, floor=known_floor(warehouse.site, area.floor_id))
    none = SwitchbackPlan(area.area_id, area.name, effect, power, weeks_max if weeks is None else weeks)
    last = warehouse.last
    n_weeks = min(REFERENCE_WEEKS, ((last - warehouse.first).days + 1) // WEEK.days)
    changed = changed_areas(data.site, last - n_weeks * WEEK + DAY, last)
    if area.area_id in changed:  # its own weeks before an earlier change are those of another area
        n_weeks = min(n_weeks, (last - changed[area.area_id]).days // WEEK.days)
    if not np.isfinite(data.violation_h).all():
        return replace(none, state="not_measurable", reason=Reason("engine.no_positions"))
    if n_weeks < MIN_REFERENCE_WEEKS:
        return replace(
            none, reason=Reason("logged_change.reference_weeks", least=MIN_REFERENCE_WEEKS, has=max(0, n_weeks))
        )
    known = last - n_weeks * WEEK + DAY, last
    chosen, left_out = areas_that_serve(data, area, known)
    past, _, chosen = _compared(data, area, chosen, [(d, d + WEEK) for d in days_of((known[0], last - WEEK))])
    none = replace(
        none, known=known, comparison=tuple(a.area_id for a in chosen), areas_left_out=tuple(left_out.items())
    )
    least = pairs_needed(data.site.settings.confidence)
    if len(past) < least or not past.any():
        return replace(none, reason=Reason("switchback.few_days", least=2 * least, has=2 * len(past)))
    monday = start + timedelta(days=-start.weekday() % WEEK.days)
    plan = none
    for n in range(2, none.weeks_max + 1, 2) if weeks is None else (weeks,):
        days = pairs_of(data.site, area, monday, n)
        if len(days) < least:
            plan = replace(none, reason=Reason("switchback.few_days", least=2 * least, has=2 * len(days)))
            continue
        foreseen = switchback_power(past, 1 + effect, n_pairs=len(days), confidence=data.site.settings.confidence)
        if weeks is not None or foreseen.power >= power:
            is_first = coins(len(days), seed=seed).tolist()
            pairs = tuple((a, b) if first else (b, a) for (a, b), first in zip(days, is_first, strict=True))
            return replace(none, in_turn=DaysInTurn(seed, pairs), foreseen=foreseen, state="ok")
        never = Reason("switchback.never", change=effect, weeks=n, power=foreseen.power)
        plan = replace(none, foreseen=foreseen, reason=never)
    return plan


def pairs_of(site: Site, area: Area, monday: date, weeks: int) -> list[tuple[date, date]]:
    """Return the days of one weekday in two successive weeks on which the site is open and the area is there."""

    def is_on(day: date) -> bool:
        opening = site.hours.on(day)
        is_open = day not in site.closed and (opening is None or bool(opening[day.weekday()]))
        return is_open and (area.first_day or date.min) <= day < (area.end_day or date.max)

    firsts = [monday + block * BLOCK + d * DAY for block in range(weeks // 2) for d in range(WEEK.days)]
    return [(day, day + WEEK) for day in firsts if is_on(day) and is_on(day + WEEK)]


def stored_switchback(plan: SwitchbackPlan, *, made: date) -> Plan | None:
    """Return what of a plan is stored; None where there is no plan."""
    if plan.in_turn is None or plan.foreseen is None or plan.known is None:
        return None
    seen, (first, last) = plan.foreseen, plan.known
    return Plan(
        made=made, area=plan.area_id, effect=plan.effect, power=plan.power_asked, first=first, last=last,
        weeks_before=((last - first).days + 1) // WEEK.days, weeks_after=plan.weeks, power_then=round(seen.power, 6),
        theta_lo=round(seen.theta_lo, 6), theta_hi=round(seen.theta_hi, 6), compared_with=plan.comparison,
        in_turn=plan.in_turn,
    )  # fmt: skip


def planned_days(site: Site, number: int) -> tuple[Plan, DaysInTurn]:
    """Return a stored plan of days in turn by its number in `vsd plan`, from 1; UsageError E101 where it is none."""
    plans = read_plans(site)
    if not 1 <= number <= len(plans):
        raise UsageError(
            f"there is no plan {number}", why=f"plans.jsonl has {len(plans)}", fix="vsd plan lists the plans"
        )
    plan = plans[number - 1]
    if plan.in_turn is None:
        raise UsageError(
            f"plan {number} has no days in turn",
            why="its change is there for good once it is made",
            fix="vsd compare --change N, where N is its entry in vsd log list",
        )
    return plan, plan.in_turn


def switchback_days(site: Site, number: int) -> Days:
    """Return the first and last day of a plan of days in turn; UsageError E101 where there is none."""
    days = [day for pair in planned_days(site, number)[1].pairs for day in pair]
    return min(days), max(days)


def switchback(warehouse: Warehouse, number: int) -> SwitchbackFigure:
    """Return what days with and without a change in turn showed: ratio of time too close, interval and test.

    It is read once, when the records reach the last day of the plan: a test that is read again and again would find
    something by chance. The days are taken as planned, whether the plan was followed or not.

    Args:
        warehouse: Opened over `switchback_days`.
        number: Of the plan in `vsd plan`, from 1.

    Raises:
        UsageError: E101, there is no such plan, it has no days in turn, or its area is gone.

    Example:
        >>> vsd.switchback(warehouse, 2).effect.verdict  # doctest: +SKIP
        'clear_fall'
    """
    site = warehouse.site
    plan, in_turn = planned_days(site, number)
    area = known_area(site, plan.area)
    first, last = switchback_days(site, number)
    unknown = SwitchbackFigure(number, plan, in_turn, area.name)
    extent = stored_extent(site)
    until = min(warehouse.last, last if extent is None else extent.last_day)
    if until < last:
        return replace(unknown, reason=Reason("switchback.running", last=last, until=until))
    data = FloorHours(warehouse, floor=known_floor(site, area.floor_id))
    if not np.isfinite(data.violation_h).all():
        return replace(unknown, state="not_measurable", reason=Reason("engine.no_positions"))
    serve, _ = areas_that_serve(data, area, (first, last))
    others = [a for a in serve if a.area_id in plan.compared_with]
    y, recorded, others = _compared(data, area, others, in_turn.pairs)
    settings = site.settings
    effect = switchback_effect(y, confidence=settings.confidence, about_same_share=settings.about_same_share)
    n_lost = 2 * (len(in_turn.pairs) - len(recorded))
    cautions = [
        Reason("switchback.holds_if"),
        *([] if others else [Reason("switchback.alone")]),
        *([Reason("switchback.not_recorded", n=n_lost)] if n_lost else []),
        *([Reason("switchback.by_totals")] if effect.is_by_totals else []),
        *_events(site, recorded),
        *_logged(site, area, (first, last)),
    ]
    return replace(
        unknown,
        effect=effect,
        comparison=tuple(a.area_id for a in others),
        cautions=tuple(cautions),
        state=effect.state,
        reason=effect.reason,
    )


def _compared(
    data: FloorHours, area: Area, others: list[Area], pairs: Sequence[tuple[date, date]]
) -> tuple[Array, list[tuple[date, date]], list[Area]]:
    """Return what `_paired` does, and the areas compared with: none where they had a day without violation."""
    y, recorded = _paired(data, area, others, pairs)
    if np.isfinite(y).all():
        return y, recorded, others
    return *_paired(data, area, [], pairs), []


def _paired(
    data: FloorHours, area: Area, others: Sequence[Area], pairs: Sequence[tuple[date, date]]
) -> tuple[Array, list[tuple[date, date]]]:
    """Return time too close per open hour by pair of days, shape (n_pairs, 2), and the pairs that were recorded.

    A day that recorded less than `min_coverage` of the fullest day of its weekday is left out, with its partner. With
    others, it is divided by theirs taken together: infinite or NaN where they had no violation.
    """
    if not pairs:
        return np.empty((0, 2)), []
    days = days_of((min(min(p) for p in pairs), max(max(p) for p in pairs)))
    history = history_of(data, area, others, (days[0], days[-1]))
    x_h, n = np.vstack([history.x_h, history.comparison_x_h]), np.vstack([history.n, history.comparison_n])
    full_h = np.array([x_h[:, history.weekday == w].max(axis=1, initial=0.0) for w in history.weekday]).T
    is_enough = ((x_h > 0) & (x_h >= data.site.settings.min_coverage * full_h)).all(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        y = n[0] / x_h[0]
        if others:
            y = y / (n[1:].sum(axis=0) / x_h[1:].sum(axis=0))
    at = np.array([[(d - days[0]).days for d in pair] for pair in pairs])
    recorded = np.asarray(is_enough)[at].all(axis=1)
    return y[at[recorded]], [pair for pair, is_in in zip(pairs, recorded.tolist(), strict=True) if is_in]


def _events(site: Site, pairs: Sequence[tuple[date, date]]) -> list[Reason]:
    """Return the events and public holidays of the days read, as cautions: their pairs are not alike."""
    days = sorted(day for pair in pairs for day in pair)
    names = [(day, event.name if (event := site.calendar.event(day)) else site.calendar.holiday(day)) for day in days]
    first: dict[str, list[date]] = {}
    for day, name in names:
        if name is not None:
            first.setdefault(name, []).append(day)
    return [Reason("switchback.event", name=name, first=on[0], n=len(on)) for name, on in first.items()]


def _logged(site: Site, area: Area, days: Days) -> list[Reason]:
    """Return the entries of the log in these days that concern the area or the whole site, as cautions."""
    entries = [(e, local_day(site, e)) for e in read_log(site)]
    return [
        Reason("logged_change.other_change" if entry.area_id else "logged_change.site_wide", day=str(day))
        for entry, day in entries
        if days[0] <= day <= days[1] and entry.area_id in (None, area.area_id)
    ]
