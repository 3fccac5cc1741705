"""Days with and without a change in turn as answers: the days and their power, and what they showed."""

from __future__ import annotations

from datetime import date, timedelta
from typing import Final

from vsd_analytics.answer import Answer, Cell, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.switchback import SwitchbackFigure, SwitchbackPlan
from vsd_analytics.figures.values import known, lack
from vsd_analytics.site.model import Site

PLAN: Final = (
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("planned_change", "rate", "change"),
    Column("power_asked", "share", "share"),
    Column("n_weeks_in_turn", "fact"),
    Column("n_days_in_turn", "fact"),
    Column("power_then", "share", "share"),
    Column("measured_then", "rate", "change"),
    Column("first_date", "fact"),
    Column("last_date", "fact"),
    Column("seed", "fact"),
    Column("comparison_area_ids", "fact"),
)
"""Columns of `switchback_plan`; `first_date` and `last_date` are those of the days in turn."""
WEEKDAYS: Final = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
WEEKS: Final = (Column("week_first", "key"), *(Column(day, "fact", "turn") for day in WEEKDAYS))
"""Columns of `switchback_weeks`: whether each day of a week is with the change or without; None = it does not count."""
EFFECT: Final = (
    Column("number", "key"),
    Column("area_id", "fact"),
    Column("name", "fact"),
    Column("planned_change", "rate", "change"),
    Column("in_turn_change", "rate", "change"),
    Column("in_turn_verdict", "fact", "verdict"),
    Column("p_value", "rate", "ratio"),
    Column("n_days_with", "fact"),
    Column("n_days_without", "fact"),
    Column("first_date", "fact"),
    Column("last_date", "fact"),
    Column("comparison_area_ids", "fact"),
    Column("is_exact", "fact"),
)
"""Columns of `switchback`; `is_exact`: all ways in which the coins could have fallen were tried."""


def switchback_plan_answers(
    plan: SwitchbackPlan, site: Site, *, days: tuple[date, date], inputs: str
) -> tuple[Answer, Answer]:
    """Return days in turn as tables: what they will show, and a row for each week with its days.

    Args:
        plan: The plan.
        site: The site.
        days: First and last local day that the power rests on.
        inputs: Hash of the facts.
    """
    floor_id = next(a.floor_id for a in site.areas if a.area_id == plan.area_id)
    holds = HoldsFor(site.site_id, floor_id, *days, settings=site.settings.settings_id(), inputs=inputs)
    turn = _turns(plan)
    seen, weeks = plan.foreseen, plan.weeks
    why = None if plan.state == "ok" else lack(plan.state, plan.reason)
    row: Row = {
        "area_id": plan.area_id,
        "name": plan.area_name,
        "planned_change": Value(plan.effect),
        "power_asked": Value(plan.power_asked),
        "n_weeks_in_turn": weeks,
        "n_days_in_turn": len(turn) or None,
        "power_then": known(None if seen is None else seen.power, plan.reason),
        "measured_then": why
        or (Value(plan.effect) if seen is None else Value(plan.effect, seen.theta_lo - 1, seen.theta_hi - 1)),
        "first_date": min(turn, default=None),
        "last_date": max(turn, default=None),
        "seed": None if plan.in_turn is None else plan.in_turn.seed,
        "comparison_area_ids": plan.comparison,
    }
    notes = [Reason("logged_change.cannot_serve", area=a, why=reason) for a, reason in plan.areas_left_out]
    if seen is not None and weeks is not None:
        notes = [
            Reason("switchback.power", change=plan.effect, weeks=weeks, power=seen.power),
            Reason("switchback.holds_if"),
            *([] if plan.comparison else [Reason("switchback.alone")]),
            *notes,
        ]
    mondays = sorted({day - timedelta(days=day.weekday()) for day in turn})
    rows = tuple(_week(monday, turn) for monday in mondays)
    state = "ok" if why is None else why.state
    return (
        Answer("switchback_plan", PLAN, (row,), holds, notes=tuple((None, note) for note in notes)),
        Answer("switchback_weeks", WEEKS, rows, holds, nothing=None if why is None else why.reason, state=state),
    )


def switchback_answer(figure: SwitchbackFigure, site: Site, *, inputs: str) -> Answer:
    """Return what days in turn showed as a table of one row: effect with its range, verdict and test.

    Args:
        figure: What they showed.
        site: The site.
        inputs: Hash of the facts.
    """
    floor_id = next(a.floor_id for a in site.areas if a.area_id == figure.plan.area)
    days = [day for pair in figure.in_turn.pairs for day in pair]
    holds = HoldsFor(site.site_id, floor_id, min(days), max(days), settings=site.settings.settings_id(), inputs=inputs)
    effect = figure.effect
    n_pairs = None if effect is None else effect.n_pairs
    change = lack(figure.state, figure.reason)
    if effect is not None and effect.value is not None:
        lo, hi = (None if end is None else end - 1 for end in (effect.lo, effect.hi))
        change = Value(effect.value - 1, lo, hi)
    row: Row = {
        "number": figure.number,
        "area_id": figure.plan.area,
        "name": figure.area_name,
        "planned_change": Value(figure.plan.effect),
        "in_turn_change": change,
        "in_turn_verdict": "too_little_data" if effect is None else effect.verdict,
        "p_value": known(None if effect is None else effect.p_value, figure.reason),
        "n_days_with": n_pairs,
        "n_days_without": n_pairs,
        "first_date": min(days),
        "last_date": max(days),
        "comparison_area_ids": figure.comparison,
        "is_exact": None if effect is None else effect.is_exact,
    }
    return Answer("switchback", EFFECT, (row,), holds, notes=tuple((None, caution) for caution in figure.cautions))


def _turns(plan: SwitchbackPlan) -> dict[date, str]:
    """Return for each day that counts whether it is with the change or without."""
    pairs = () if plan.in_turn is None else plan.in_turn.pairs
    return {day: turn for pair in pairs for day, turn in zip(pair, ("with", "without"), strict=True)}


def _week(monday: date, turn: dict[date, str]) -> Row:
    days: dict[str, Cell] = {name: turn.get(monday + timedelta(days=d)) for d, name in enumerate(WEEKDAYS)}
    return {"week_first": monday, **days}
