"""Plans of experiments as answers: how long to watch a change, which areas to compare with, and what was planned."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.config.plans import Plan
from vsd_analytics.figures.experiments import ExperimentPlan
from vsd_analytics.figures.values import known, lack
from vsd_analytics.site.model import Site

_WAY: Final = (
    Column("weeks_after", "number", "weeks"),
    Column("power_then", "share", "share"),
    Column("measured_then", "rate", "change"),
)
"""Weeks to watch after the change, the power by then, and where the effect will be measured."""
PLAN: Final = (
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("planned_change", "rate", "change"),
    Column("power_asked", "share", "share"),
    Column("weeks_max", "fact"),
    Column("first_date", "fact"),
    Column("last_date", "fact"),
    Column("n_known_weeks", "fact"),
    Column("week_sd", "share", "share"),
    Column("week_sd_days", "share", "share"),
    Column("week_sd_beyond", "share", "share"),
)
"""Columns of `plan`."""
CHOICES: Final = (Column("weeks_before", "key"), Column("weeks_to_wait", "fact"), *_WAY)
"""Columns of `plan_choices`."""
COMPARISON: Final = (
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("apart_m", "fact", "m"),
    Column("correlation", "rate", "correlation", digits=2),
    Column("week_sd_apart", "share", "share"),
)
"""Columns of `comparison_areas`, the best first."""
PLANS: Final = (
    Column("number", "key"),
    Column("made", "fact"),
    Column("area_id", "fact"),
    Column("planned_change", "rate", "change"),
    Column("power_asked", "share", "share"),
    Column("weeks_before", "fact"),
    *_WAY,
    Column("first_date", "fact"),
    Column("last_date", "fact"),
    Column("comparison_area_ids", "fact"),
    Column("n_days_in_turn", "fact"),
)
"""Columns of `plans`."""


def plan_answers(plan: ExperimentPlan, site: Site, *, days: tuple[date, date], inputs: str) -> tuple[Answer, ...]:
    """Return how long a change of an area must be watched as tables.

    `plan`: what was asked, and how the area's weeks differ beside its comparison areas (standard deviation of the
    weekly log ratio: `week_sd`, of which days explain `week_sd_days`). `plan_choices`: weeks to watch for the reference
    weeks known, and for waiting longer. `comparison_areas`: areas that serve, and how alike they move.

    Args:
        plan: The plan.
        site: The site.
        days: First and last local day that it rests on.
        inputs: Hash of the facts.
    """
    floor_id = next(a.floor_id for a in site.areas if a.area_id == plan.area_id)
    holds = HoldsFor(site.site_id, floor_id, *days, settings=site.settings.settings_id(), inputs=inputs)
    why = None if plan.state == "ok" else lack(plan.state, plan.reason)
    notes = tuple((None, Reason("logged_change.cannot_serve", area=a, why=reason)) for a, reason in plan.areas_left_out)
    choices: list[Row] = [
        {
            "weeks_before": way.weeks_before,
            "weeks_to_wait": way.weeks_to_wait,
            "weeks_after": known(way.weeks_after, Reason("logged_change.more_weeks", most=plan.weeks_max)),
            "power_then": Value(way.power),
            "measured_then": Value(plan.effect, way.theta_lo - 1, way.theta_hi - 1),
        }
        for way in plan.choices
    ]
    few = Reason("logged_change.few_weeks_alike")
    serve: list[Row] = [
        {
            "area_id": area.area_id,
            "name": area.name,
            "apart_m": area.apart_m,
            "correlation": known(area.correlation, few),
            "week_sd_apart": known(area.sd_apart, few),
        }
        for area in plan.comparison
    ]
    nothing = None if why is None else why.reason
    state = "ok" if why is None else why.state
    return (
        Answer("plan", PLAN, (_plan(plan, why),), holds, notes=notes),
        Answer("plan_choices", CHOICES, tuple(choices), holds, nothing=nothing, state=state),
        Answer("comparison_areas", COMPARISON, tuple(serve), holds, nothing=nothing, state=state),
    )


def plans_answer(plans: Sequence[Plan], site: Site, *, today: date) -> Answer:
    """Return the stored plans as a table, in the order in which they were made; without any, it holds for today."""
    rows: list[Row] = [
        {
            "number": number,
            "made": plan.made,
            "area_id": plan.area,
            "planned_change": Value(plan.effect),
            "power_asked": Value(plan.power),
            "weeks_before": plan.weeks_before,
            "weeks_after": known(plan.weeks_after, Reason("logged_change.never_clear")),
            "power_then": Value(plan.power_then),
            "measured_then": Value(plan.effect, plan.theta_lo - 1, plan.theta_hi - 1),
            "first_date": plan.first,
            "last_date": plan.last,
            "comparison_area_ids": plan.compared_with,
            "n_days_in_turn": None if plan.in_turn is None else 2 * len(plan.in_turn.pairs),
        }
        for number, plan in enumerate(plans, 1)
    ]
    first, last = min((p.first for p in plans), default=today), max((p.last for p in plans), default=today)
    return Answer("plans", PLANS, tuple(rows), HoldsFor(site.site_id, None, first, last))


def _plan(plan: ExperimentPlan, why: Value | None) -> Row:
    varied, (first, last) = plan.variation, plan.known or (None, None)
    none = why or Value.missing(None)
    return {
        "area_id": plan.area_id,
        "name": plan.area_name,
        "planned_change": Value(plan.effect),
        "power_asked": Value(plan.power),
        "weeks_max": plan.weeks_max,
        "first_date": first,
        "last_date": last,
        "n_known_weeks": None if varied is None else len(varied.log_ratios),
        "week_sd": none if varied is None else Value(varied.sd),
        "week_sd_days": none if varied is None else Value(varied.sd_days),
        "week_sd_beyond": none if varied is None else Value(varied.sd_weeks),
    }
