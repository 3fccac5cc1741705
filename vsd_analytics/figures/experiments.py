"""Experiments: how long a change of an area must be watched, what it is compared with, and how a plan came out.

The arithmetic is `vsd_analytics.stats.experiment`, on person-time in violation per open hour of an area beside
its comparison areas, as the running verdict of `vsd compare --change` reads it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely

from vsd_analytics.answer import Reason, State
from vsd_analytics.config.plans import Plan, read_plans
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.change_verdicts import history_of, log_rates
from vsd_analytics.figures.change_weeks import (
    REFERENCE_WEEKS,
    WATCHED_WEEKS,
    changed_areas,
    days_stored,
    left_out_around,
    local_day,
    log_entry,
)
from vsd_analytics.figures.comparison_areas import areas_that_serve
from vsd_analytics.figures.panels import WEEK, FloorHours
from vsd_analytics.site.model import Area, LogEntry, Site
from vsd_analytics.site.places import known_area, known_floor
from vsd_analytics.stats.comparison_weights import weekly_log_ratios
from vsd_analytics.stats.experiment import Variation, WeeksNeeded, choices, variation_of
from vsd_analytics.stats.running_verdict import MIN_REFERENCE_WEEKS
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse

if TYPE_CHECKING:
    from vsd_analytics.figures.before_after import BeforeAfterFigure

Days = tuple[date, date]
MIN_WEEKS_ALIKE: Final = 4
"""Weeks a correlation of areas needs."""

EFFECTS: Final = (-0.99, 1.0)
"""Effects that can be planned for, shares."""
POWERS: Final = (0.5, 0.99)
USUAL_EFFECT: Final = -0.3
"""Effect that a change without a plan is judged by: what a redesign that is worth its trouble does."""
USUAL_POWER: Final = 0.8


@dataclass(frozen=True, slots=True)
class ComparisonArea:
    """An area that serves for comparison, and how well.

    Attributes:
        area_id, name: The area.
        apart_m: Distance to the changed area.
        correlation: Of its weekly log rates with those of the changed area; None with fewer than four weeks in common.
        sd_apart: Standard deviation of the weekly log ratio to it alone: the smaller, the better it serves.
    """

    area_id: str
    name: str
    apart_m: float
    correlation: float | None
    sd_apart: float | None


@dataclass(frozen=True, slots=True)
class ExperimentPlan:
    """How long a change of an area must be watched until its effect is clear.

    Attributes:
        area_id, area_name: The area to be changed.
        effect: Effect looked for, relative: -0.15 = 15 % less time too close per open hour.
        power: Chance of a clear verdict asked for.
        weeks_max: Weeks after the change one is ready to wait.
        known: First and last day of the weeks that the variation was taken from; None without a whole week.
        variation: How the area's weeks differ beside the comparison areas.
        choices: Weeks after the change, for the reference weeks known and for waiting longer before it.
        comparison: Areas that serve, the best first.
        areas_left_out: Why other areas of the floor do not serve, by id.
        state, reason: Why there is no plan.
    """

    area_id: str
    area_name: str
    effect: float
    power: float
    weeks_max: int
    known: Days | None = None
    variation: Variation | None = None
    choices: tuple[WeeksNeeded, ...] = ()
    comparison: tuple[ComparisonArea, ...] = ()
    areas_left_out: tuple[tuple[str, Reason], ...] = ()
    state: State = "not_enough_data"
    reason: Reason | None = None


@dataclass(frozen=True, slots=True)
class PlanScore:
    """How a plan came out.

    Attributes:
        plan: The plan.
        theta: Ratio measured so far by the running verdict; None without.
        is_inside: The ratio lies where the plan said it would if the effect is as planned.
        n_weeks: Weeks read so far.
        is_due: The weeks planned are over.
        is_clear: The verdict is clear in the direction planned.
    """

    plan: Plan
    theta: float | None
    is_inside: bool | None
    n_weeks: int
    is_due: bool
    is_clear: bool


def plan_days(site: Site) -> Days:
    """Return the local days a warehouse must hold for a plan: the last twelve weeks with records.

    Without records: one day, on which nothing is found.
    """
    extent = stored_extent(site)
    if extent is None:
        return date(2000, 1, 1), date(2000, 1, 1)
    return max(extent.first_day, extent.last_day - REFERENCE_WEEKS * WEEK + timedelta(days=1)), extent.last_day


def check_plan(*, effect: float, power: float) -> None:
    """Refuse an effect or a power that is no share, as where percent were meant.

    Args:
        effect: Effect looked for, a share: -0.15 = 15 % less.
        power: Chance of a clear verdict, a share.

    Raises:
        UsageError: E101, the effect is not between -0.99 and 1, or 0; or the power is not between 0.5 and 0.99.
    """
    if not EFFECTS[0] <= effect <= EFFECTS[1] or effect == 0:
        raise UsageError(
            f"effect {effect:g} is not between -0.99 and 1, or is 0",
            why="it is a share",
            fix="effect -0.15 is 15 % less",
        )
    if not POWERS[0] <= power <= POWERS[1]:
        raise UsageError(
            f"power {power:g} is not between 0.5 and 0.99", why="it is a share", fix="power 0.8 is a chance of 80 %"
        )


def plan_experiment(
    warehouse: Warehouse, area_id: str, *, effect: float, power: float = 0.8, weeks_max: int = 26
) -> ExperimentPlan:
    """Return how many weeks a change of an area needs until an effect is clear, and which areas serve for comparison.

    Args:
        warehouse: Opened over `plan_days`.
        area_id: The area to be changed.
        effect: Effect looked for, a share: -0.15 = 15 % less. Not 0.
        power: Chance of a clear verdict, a share.
        weeks_max: Weeks after the change one is ready to wait.

    Raises:
        UsageError: E101, the site has no such area, or effect or power is no share (`check_plan`).

    Example:
        >>> vsd.plan_experiment(warehouse, "checkout-queue", effect=-0.2).state  # needs four weeks before the change
        'not_enough_data'
    """
    check_plan(effect=effect, power=power)
    area = known_area(warehouse.site, area_id)
    data = FloorHours(warehouse, floor=known_floor(warehouse.site, None, [area]))
    unknown = ExperimentPlan(area.area_id, area.name, effect, power, weeks_max)
    return _planned(data, area, unknown, (warehouse.first, warehouse.last), beside_until=warehouse.last)


def foreseen(data: FloorHours, area: Area, entry: LogEntry) -> ExperimentPlan:
    """Return how long a change that was made must be watched: the plan from the weeks before it.

    The effect and the power are those of the latest plan for the area made by then; without one, `USUAL_EFFECT` and
    `USUAL_POWER`.

    Args:
        data: The floor; its warehouse reaches back to the weeks before the change.
        area: The changed area.
        entry: The change.
    """
    day = local_day(data.site, entry)
    plans = [p for p in read_plans(data.site) if p.area == area.area_id and p.made <= day and p.in_turn is None]
    effect, power = (plans[-1].effect, plans[-1].power) if plans else (USUAL_EFFECT, USUAL_POWER)
    (since, last), (until, _) = (
        days_stored(data.site, day, data.warehouse.first, data.warehouse.last), left_out_around(data.site, entry)
    )  # fmt: skip
    unknown = ExperimentPlan(area.area_id, area.name, effect, power, WATCHED_WEEKS)
    return _planned(data, area, unknown, (since, until), beside_until=last)


def clear_by(figure: BeforeAfterFigure, site: Site) -> date | None:
    """Return the last day of the weeks after which a change will be clear; None where none will tell."""
    weeks = figure.foreseen.choices[0].weeks_after if figure.foreseen is not None and figure.foreseen.choices else None
    if weeks is None:
        return None
    return left_out_around(site, log_entry(site, figure.number))[1] + weeks * WEEK - timedelta(days=1)


def _planned(
    data: FloorHours, area: Area, unknown: ExperimentPlan, before: Days, *, beside_until: date
) -> ExperimentPlan:
    """Return a plan from the weeks known before a change.

    Args:
        data: The floor.
        area: The area to be changed.
        unknown: The plan without what the weeks tell.
        before: First and last day before the change.
        beside_until: Last day up to which areas with an entry of their own are no comparison.
    """
    site, (first, until) = data.site, before
    n_weeks = min(REFERENCE_WEEKS, max(0, (until - first).days + 1) // WEEK.days)
    if n_weeks == 0 or not np.isfinite(data.violation_h).all():
        why = Reason("logged_change.week_before", days=max(0, (until - first).days + 1))
        return replace(unknown, reason=why if n_weeks == 0 else Reason("engine.no_positions"))

    def weeks(n: int) -> Days:
        return until - n * WEEK + timedelta(days=1), until

    known = weeks(n_weeks)
    chosen, left_out = areas_that_serve(data, area, (known[0], beside_until))
    changed = changed_areas(site, *known)
    if area.area_id in changed:  # its own weeks before an earlier change are those of another area
        n_weeks = min(n_weeks, (until - changed[area.area_id]).days // WEEK.days)
        known = weeks(n_weeks)
    unknown = replace(unknown, known=known, areas_left_out=tuple(left_out.items()))
    few = Reason("logged_change.reference_weeks", least=MIN_REFERENCE_WEEKS, has=n_weeks)
    if not chosen or n_weeks == 0:
        return replace(unknown, reason=few if chosen else Reason("logged_change.no_comparison"))
    history = history_of(data, area, chosen, known)
    variation = variation_of(history, None)
    if variation is None:
        counted = np.isfinite(weekly_log_ratios(history, None)[1])
        why = Reason("logged_change.counted_weeks", least=MIN_REFERENCE_WEEKS, has=int(counted.sum()))
        return replace(unknown, reason=few if n_weeks < MIN_REFERENCE_WEEKS else why)
    ways = choices(
        variation, 1 + unknown.effect, power=unknown.power, weeks_max=unknown.weeks_max,
        confidence=site.settings.confidence,
    )  # fmt: skip
    serve = [_served(data, area, other, known) for other in chosen]
    serve.sort(key=lambda c: np.inf if c.sd_apart is None else c.sd_apart)
    return replace(unknown, variation=variation, choices=ways, comparison=tuple(serve), state="ok")


def stored_plan(plan: ExperimentPlan, *, made: date) -> Plan | None:
    """Return what of a plan is stored: that of the reference weeks known. None where there is no plan."""
    if plan.state != "ok" or plan.known is None:
        return None
    way = plan.choices[0]
    return Plan(
        made=made, area=plan.area_id, effect=plan.effect, power=plan.power, first=plan.known[0],
        last=plan.known[1], weeks_before=way.weeks_before, weeks_after=way.weeks_after,
        power_then=round(way.power, 6), theta_lo=round(way.theta_lo, 6), theta_hi=round(way.theta_hi, 6),
        compared_with=tuple(c.area_id for c in plan.comparison),
    )  # fmt: skip


def score(figure: BeforeAfterFigure, plans: tuple[Plan, ...], *, zone_day: date) -> PlanScore | None:
    """Return how the latest plan for the area came out; None without one made by the day of the change.

    Args:
        figure: The change.
        plans: All plans of the site.
        zone_day: Local day of the change.
    """
    area_plans = [p for p in plans if p.area == figure.area_id and p.made <= zone_day and p.in_turn is None]
    if not area_plans or figure.running is None:
        return None
    plan, so_far = area_plans[-1], figure.running
    theta = so_far.value
    direction = "clear_fall" if plan.effect < 0 else "clear_rise"
    return PlanScore(
        plan=plan,
        theta=theta,
        is_inside=None if theta is None else plan.theta_lo <= theta <= plan.theta_hi,
        n_weeks=so_far.n_weeks,
        is_due=plan.weeks_after is not None and so_far.n_weeks >= plan.weeks_after,
        is_clear=so_far.verdict == direction,
    )


def _served(data: FloorHours, area: Area, other: Area, known: Days) -> ComparisonArea:
    """Return how well one area serves: its weeks beside those of the area to be changed."""
    own, its = (log_rates(data, [a], known) for a in (area, other))
    both = np.isfinite(own) & np.isfinite(its)
    is_enough = both.sum() >= MIN_WEEKS_ALIKE
    is_known = is_enough and own[both].std() > 0 and its[both].std() > 0
    return ComparisonArea(
        other.area_id,
        other.name,
        apart_m=float(shapely.Polygon(area.polygon).distance(shapely.Polygon(other.polygon))),
        correlation=float(np.corrcoef(own[both], its[both])[0, 1]) if is_known else None,
        sd_apart=float((own - its)[both].std(ddof=1)) if is_enough else None,
    )
