"""The catalogue of a report: its figures by id, M0 onwards, as the JSON report gives them.

Every file of this folder is part of it: a function with `@figure("M30")` before it makes that figure. Those of how a
space is used are imported where a place of the floor asks for them. docs/figures.md defines them all; it is made from
the headers of the SQL files. Their words are in `reports/wording/figures.toml`.

Nothing in a figure tells of one person: no track ids, no count under `mask_below`, no ranking of a week recorded too
little for one.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import Final

from vsd_analytics.answer import Answers
from vsd_analytics.figures.catalogue.form import ANSWER_MAKERS, MAKERS, FigureInputs
from vsd_analytics.figures.catalogue.view import figure_of
from vsd_analytics.figures.share.answers import share
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.results import Figure

OF_WEEKS: Final = frozenset({"M13", "M14", "M20", "M24", "M25", "M27", "M28"})
"""Figures of hours and places of several weeks, and of weeks beside each other."""
OF_VISITS: Final = frozenset({"M35", "M36", "M37", "M38", "M42"})
"""Figures of areas with `visits = true`."""
OF_QUEUES: Final = frozenset({"M39", "M40"})
"""Figures of areas with `queue = true`."""
OF_CAPACITIES: Final = frozenset({"M41"})
"""Figures of places with a capacity."""

OF_SPACE: Final = OF_VISITS | OF_QUEUES | OF_CAPACITIES
"""Figures of how a space is used, which places of the floor ask for."""
FILES_OF_SPACE: Final = frozenset({"space_answers"})
"""The files of this folder that make these."""


def _import(names: AbstractSet[str]) -> None:
    for name in sorted(names):
        importlib.import_module(f"{__name__}.{name}")


_import({file.name for file in pkgutil.iter_modules(__path__)} - FILES_OF_SPACE)


def figures(inputs: FigureInputs, shared: Answers) -> Mapping[str, Figure]:
    """Return all figures of a week by catalogue id, in its order; of other days, those that need no weeks.

    Figures of visits, queues and capacities are absent where no place of the floor asks for them.

    Args:
        inputs: The week.
        shared: What `shared_answers` returned for it.
    """
    left_out = set[str]() if inputs.data.is_week else set(OF_WEEKS)
    return _made(inputs, (MAKERS.keys() | OF_SPACE) - left_out, shared)


def space_figures(inputs: FigureInputs, shared: Answers) -> Mapping[str, Figure]:
    """Return the figures of how the space is used, as `figures` has them; empty where no place of the floor asks."""
    return _made(inputs, OF_SPACE, shared)


def shared_answers(inputs: FigureInputs) -> Answers:
    """Return the answers of a week as they may leave the operator's hands, all of them together."""
    asked = asks_for(inputs.data)
    if asked:
        _import(FILES_OF_SPACE)
    makers = dict.fromkeys(maker for metric, maker in ANSWER_MAKERS.items() if metric not in OF_SPACE - asked)
    return share((answer for maker in makers for answer in maker(inputs)), below=inputs.below)


def asks_for(data: WeekData) -> frozenset[str]:
    """Return which figures of how the space is used some place of the floor asks for."""
    floor, areas = data.floor, data.areas
    found = frozenset[str]()
    if any(area.has_visits for area in areas):
        found |= OF_VISITS
    if any(area.is_queue for area in areas):
        found |= OF_QUEUES
    if floor.capacity is not None or any(area.capacity is not None for area in areas):
        found |= OF_CAPACITIES
    return found


def _made(inputs: FigureInputs, metrics: AbstractSet[str], shared: Answers) -> Mapping[str, Figure]:
    asked = asks_for(inputs.data)
    if asked:
        _import(FILES_OF_SPACE)
    wanted = metrics - (OF_SPACE - asked)
    return {metric: _figure(replace(inputs, metric=metric), shared) for metric in sorted(wanted, key=_number)}


def _figure(inputs: FigureInputs, shared: Answers) -> Figure:
    maker = MAKERS.get(inputs.metric)
    return figure_of(inputs.metric, shared, unit=inputs.unit) if maker is None else maker(inputs)


def _number(metric: str) -> int:
    return int(metric[1:])
