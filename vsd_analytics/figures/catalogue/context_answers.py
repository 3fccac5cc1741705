"""Figures that use what else happened, where the site shows it: M50 to M52."""

from __future__ import annotations

from vsd_analytics.answer import Answer
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.context_figures import change_answer, conversion_answer, value_answer


@answers("M50")
def context_conversion(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return sales, tickets or the like per visit of an area (M50)."""
    return (conversion_answer(inputs),)


@answers("M51")
def context_value(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return sales, tickets or the like per person-hour (M51)."""
    return (value_answer(inputs),)


@answers("M52")
def context_change(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the week's change of violations at an equal value of a series (M52)."""
    return (change_answer(inputs),)
