"""What each logged change of the floor did to its area (M27)."""

from __future__ import annotations

from typing import Final

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.values import known, lack, measured, relative
from vsd_analytics.figures.week.change_effects import change_effect, is_held_back

CHANGES: Final = (
    Column("entry", "key"),
    Column("at", "instant"),
    Column("area_id", "fact"),
    Column("name", "fact"),
    Column("design", "fact"),
    Column("outcome", "fact", "outcome"),
    Column("so_far_change", "rate", "change", "M27"),
    Column("n_weeks_after", "fact"),
    Column("clear_by", "fact"),
    Column("encounter_rate_ratio", "rate", "ratio", "M27"),
    Column("violation_rate_ratio", "rate", "ratio", "M27"),
    Column("placebo_lo", "rate", "ratio"),
    Column("placebo_hi", "rate", "ratio"),
    Column("shrunken_ratio", "rate", "ratio", "M27"),
    Column("n_comparison_areas", "fact"),
    Column("is_credible", "fact"),
)
"""Columns of `changes`."""


ANY: Final = Reason("logged_change.any_effect")


@answers("M27")
def changes(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return what each logged change of the floor did to its area, beside areas that were left alone (M27).

    Columns: what may be said of it, the one verdict; its effect, the change of the time too close per open hour over
    all weeks since; the day by which a change that is not clear yet will be. Other figures have ranges only:
    violations per person-hour after over before, relative to the comparison areas where there are any; the same of
    violations per open hour; the range of ratios without a change; the ratio shrunken towards 1. Notes of a row: what
    speaks against it, and what it takes for granted.
    """
    effects = inputs.results.change_effects
    if not effects:
        none = Value.missing(Reason("logged_change.none"))
        return (inputs.list_answer("changes", CHANGES, (), nothing=none),)
    notes = [
        (k, Reason("joined", reasons=reasons))
        for k, one in enumerate(effects)
        for reasons in (one.doubts, one.assumptions)
        if reasons
    ]
    return (inputs.list_answer("changes", CHANGES, [_change(inputs, one) for one in effects], *notes),)


def _change(inputs: FigureInputs, figure: BeforeAfterFigure) -> Row:
    ratio = figure.effect or figure.alone
    hidden, few = _why_hidden(inputs, figure), Value.missing(None if ratio is None else ratio.reason)
    why = hidden or (few if ratio is None or ratio.value is None else None)
    effect = figure.effect
    alone = Reason("logged_change.alone")
    so_far, foreseen = figure.running, change_effect(inputs.data, figure).foreseen
    shrunken = None if effect is None else effect.shrunken
    violation_rate = figure.violation_rate
    return {
        "entry": figure.number,
        "at": figure.at,
        "area_id": figure.area_id,
        "name": figure.area_name,
        "design": figure.design,
        "outcome": None if hidden else figure.outcome,
        "so_far_change": hidden
        or (Value.missing(alone) if so_far is None else relative(so_far, reason=so_far.reason or ANY)),
        "n_weeks_after": None if hidden or so_far is None else so_far.n_weeks,
        "clear_by": None if foreseen is None else foreseen.clear_by,
        "encounter_rate_ratio": why or measured(ratio),
        "violation_rate_ratio": why or measured(violation_rate),
        "placebo_lo": why or known(None if effect is None else effect.placebo_lo, alone),
        "placebo_hi": why or known(None if effect is None else effect.placebo_hi, alone),
        "shrunken_ratio": why or known(None if shrunken is None else shrunken.value, alone),
        "n_comparison_areas": len(figure.comparison_areas),
        "is_credible": None if hidden else figure.is_credible,
    }


def _why_hidden(inputs: FigureInputs, figure: BeforeAfterFigure) -> Value | None:
    """Return why nothing is said of a change, as a value; None where something is."""
    if figure.state != "ok":
        return lack(figure.state, figure.reason)
    return Value.missing(inputs.data.mask.why) if is_held_back(inputs.data, figure) else None
