"""Answers on how a space is used, of places that ask for it: M35 to M42, lines and doors: M57 to M60."""

from __future__ import annotations

from vsd_analytics.answer import Answer
from vsd_analytics.figures.capacities import capacity
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.doors import door_answers
from vsd_analytics.figures.flow_answers import direction_answer, flow_answers
from vsd_analytics.figures.footfall import footfall_answers
from vsd_analytics.figures.line_peaks import line_peaks
from vsd_analytics.figures.lines import line_answers
from vsd_analytics.figures.queues import queues
from vsd_analytics.figures.visits import visits


@answers("M35", "M36")
def visit_answers(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return visits of each area per open hour, and how long they last."""
    return (visits(inputs.data.this),)


@answers("M37", "M38", "M42")
def flow_between_areas(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return where people go next from each area, routes from door to door, and walking directions by cell."""
    return (*flow_answers(inputs.data.this), direction_answer(inputs.data.this))


@answers("M39", "M40")
def queue_answers(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return how many people wait in each queue, how long, and how many leave: over the days, and by hour."""
    return queues(inputs.data.this)


@answers("M41")
def capacity_answers(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return for how much of the open time each place with a capacity was full, and by how many people too full."""
    return (capacity(inputs.data.this),)


@answers("M57")
def crossings_of_lines(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return how many people crossed each counting line in either direction: over the days, by day and by hour."""
    return line_answers(inputs.data.this)


@answers("M59")
def busiest_quarter_hours(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the busiest quarter-hour of each counting line, and how near it is to what its width lets through."""
    return (line_peaks(inputs.data.this),)


@answers("M58")
def people_inside_by_doors(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return how many people were inside by the doors of a floor, and the drift of its doors: over the days, by day."""
    return door_answers(inputs.data.this)


@answers("M60")
def footfall_of_lines(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the footfall of each counting line: the week beside its usual range and a year before, and next week."""
    return footfall_answers(inputs.data.this)
