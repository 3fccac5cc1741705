"""What each logged change of the floor did to its area (M27)."""

from __future__ import annotations

from typing import Final

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.values import known, lack, measured
from vsd_analytics.figures.week.change_effects import is_held_back

CHANGES: Final = (
    Column("entry", "key"),
    Column("at", "instant"),
    Column("area_id", "fact"),
    Column("name", "fact"),
    Column("design", "fact"),
    Column("outcome", "fact", "outcome"),
    Column("encounter_rate_ratio", "rate", "ratio", "M27"),
    Column("violation_rate_ratio", "rate", "ratio", "M27"),
    Column("placebo_lo", "rate", "ratio"),
    Column("placebo_hi", "rate", "ratio"),
    Column("shrunken_ratio", "rate", "ratio", "M27"),
    Column("n_comparison_areas", "fact"),
    Column("is_credible", "fact"),
)
"""Columns of `changes`."""


@answers("M27")
def changes(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return what each logged change of the floor did to its area, beside areas that were left alone (M27).

    Columns: what may be said of it, the one verdict; violations per person-hour after over before, relative to the
    comparison areas where there are any; the same of violations per open hour; the range of ratios without a change;
    the ratio shrunken towards 1. Notes of a row: what speaks against it, and what it takes for granted.
    """
    found = inputs.found.change_effects
    if not found:
        none = Value.missing(Reason("logged_change.none"))
        return (inputs.list_answer("changes", CHANGES, (), nothing=none),)
    notes = [
        (k, Reason("joined", reasons=reasons))
        for k, one in enumerate(found)
        for reasons in (one.doubts, one.assumptions)
        if reasons
    ]
    return (inputs.list_answer("changes", CHANGES, [_change(inputs, one) for one in found], *notes),)


def _change(inputs: FigureInputs, found: BeforeAfterFigure) -> Row:
    ratio = found.effect or found.alone
    why = _why_not(inputs, found)
    effect = found.effect
    shrunken = None if effect is None else effect.shrunken
    violation_rate = found.violation_rate
    alone = Reason("logged_change.alone")
    return {
        "entry": found.number,
        "at": found.at,
        "area_id": found.area_id,
        "name": found.area_name,
        "design": found.design,
        "outcome": None if why else found.outcome,
        "encounter_rate_ratio": why or measured(ratio),
        "violation_rate_ratio": why or measured(violation_rate),
        "placebo_lo": why or known(None if effect is None else effect.placebo_lo, alone),
        "placebo_hi": why or known(None if effect is None else effect.placebo_hi, alone),
        "shrunken_ratio": why or known(None if shrunken is None else shrunken.value, alone),
        "n_comparison_areas": len(found.comparison_areas),
        "is_credible": None if why else found.is_credible,
    }


def _why_not(inputs: FigureInputs, found: BeforeAfterFigure) -> Value | None:
    """Return why a change has no figures, as a value; None where it has."""
    ratio = found.effect or found.alone
    if found.state != "ok":
        return lack(found.state, found.reason)
    if is_held_back(inputs.data, found):
        return Value.missing(inputs.data.mask.why)
    if ratio is None or ratio.value is None:
        return lack("not_enough_data", None if ratio is None else ratio.reason)
    return None
