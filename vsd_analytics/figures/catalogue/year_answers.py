"""The week beside the same week a year before, where that was recorded: M53."""

from __future__ import annotations

from vsd_analytics.answer import Answer
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.year_before import year_before


@answers("M53")
def year_on_year(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return violations, time too close and people of the week 52 weeks before, and the change since (M53)."""
    return (year_before(inputs),)
