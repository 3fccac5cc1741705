"""The catalogue of a report: its answers, and its figures by id, M0 onwards, as the JSON report gives them.

Every file of this folder is part of it: a function with `@answers("M30")` before it returns the answers whose columns
hold that figure. Those of how a space is used are imported where a place of the floor asks for them. docs/figures.md
defines all figures; it is made from the headers of the SQL files. Their words are in `reports/wording/figures.toml`.

Nothing in an answer tells of one person: no track ids, no count under `mask_below` (`figures.share`), no ranking of a
week recorded too little for one.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from datetime import timedelta
from typing import Final, Protocol

from vsd_analytics.answer import Answers, Reason
from vsd_analytics.figures.catalogue.form import ANSWER_MAKERS, FigureInputs
from vsd_analytics.figures.catalogue.view import MAPS, map_figure
from vsd_analytics.figures.share.answers import audience_answers
from vsd_analytics.figures.share.places import hidden_floor
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.warehouse.stored_days import has_records

OF_WEEKS: Final = frozenset({"M13", "M14", "M20", "M24", "M25", "M27", "M28", "M60"})
"""Figures of hours and places of several weeks, and of weeks beside each other."""
SO_FAR: Final = frozenset({"M0", "M1", "M3", "M6", "M15"})
"""Figures of a week that goes on which leave: those of the floor, its areas and recording."""
OF_VISITS: Final = frozenset({"M35", "M36", "M37", "M38", "M42"})
"""Figures of areas with `visits = true`."""
OF_QUEUES: Final = frozenset({"M39", "M40"})
"""Figures of areas with `queue = true`."""
OF_CAPACITIES: Final = frozenset({"M41"})
"""Figures of places with a capacity."""

OF_SPACE: Final = OF_VISITS | OF_QUEUES | OF_CAPACITIES
"""Figures of how a space is used, which places of the floor ask for."""
OF_LINES: Final = frozenset({"M57", "M58", "M59", "M60"})
"""Figures of counting lines, and of those that are doors."""
OF_CONTEXT: Final = frozenset({"M50", "M51", "M52"})
"""Figures that use series of what else happened; of weeks only."""
FILES_OF_SPACE: Final = frozenset({"space_answers"})
FILES_OF_CONTEXT: Final = frozenset({"context_answers"})
YEAR: Final = timedelta(weeks=52)
OF_YEAR: Final = frozenset({"M53"})
"""Figures of the same week a year before."""
FILES_OF_YEAR: Final = frozenset({"year_answers"})
"""The files of this folder that make these."""


class UnitRules(Protocol):
    """Settings that units of figures name."""

    @property
    def distance_m(self) -> float:
        """Return the legal distance."""

    @property
    def outage_min_s(self) -> float:
        """Return the shortest outage."""

    @property
    def contact_s(self) -> float:
        """Return the length of a close contact."""


def _import(names: AbstractSet[str]) -> None:
    for name in sorted(names):
        importlib.import_module(f"{__name__}.{name}")


_import({file.name for file in pkgutil.iter_modules(__path__)} - FILES_OF_SPACE - FILES_OF_CONTEXT - FILES_OF_YEAR)


def shared_answers(
    inputs: FigureInputs, *, metrics: AbstractSet[str] | None = None, has_context: bool = False
) -> Answers:
    """Return the answers of a week as they may leave the operator's hands, all of them together.

    Those of visits, queues, capacities, lines and doors are absent where the floor has none, and of days that are no
    week those that need weeks.

    Args:
        inputs: The week.
        metrics: Only the answers that hold these figures; None = all.
        has_context: With those that use what else happened.
    """
    asked = asks_for(inputs.data) | lines_ask_for(inputs.data)
    if asked:
        _import(FILES_OF_SPACE)
    if has_context:
        _import(FILES_OF_CONTEXT)
    has_year = inputs.data.is_week and has_records(
        inputs.data.site, inputs.data.monday - YEAR, inputs.data.sunday - YEAR
    )
    if has_year:
        _import(FILES_OF_YEAR)
    left_out = ((OF_SPACE | OF_LINES) - asked) | (frozenset() if has_context else OF_CONTEXT)
    left_out |= frozenset() if has_year else OF_YEAR
    left_out |= frozenset() if inputs.data.is_week else OF_WEEKS | OF_CONTEXT
    wanted = (ANSWER_MAKERS.keys() if metrics is None else metrics) - left_out
    makers = dict.fromkeys(maker for metric, maker in ANSWER_MAKERS.items() if metric in wanted)
    return audience_answers((answer for maker in makers for answer in maker(inputs)), inputs.data.site)


def map_figures(inputs: FigureInputs) -> Mapping[str, Figure]:
    """Return the figures that are maps, which no rows of an answer hold, by catalogue id."""
    data, rules = inputs.data, inputs.data.site.settings
    hidden = hidden_floor(data, data.this)
    why = data.hidden.why_floor if data.mask.is_on else None
    return {
        metric: map_figure(inputs.results.maps, metric, unit=figure_unit(metric, rules), hidden=hidden, why_hidden=why)
        for metric in MAPS
    }


def asks_for(data: WeekData) -> frozenset[str]:
    """Return which figures of how the space is used some place of the floor asks for."""
    floor, areas = data.floor, data.areas
    figures = frozenset[str]()
    if any(area.has_visits for area in areas):
        figures |= OF_VISITS
    if any(area.is_queue for area in areas):
        figures |= OF_QUEUES
    if floor.capacity is not None or any(area.capacity is not None for area in areas):
        figures |= OF_CAPACITIES
    return figures


def lines_ask_for(data: WeekData) -> frozenset[str]:
    """Return which figures of counting lines the floor has lines for in these days."""
    lines = [n for n in data.site.lines if n.floor_id == data.floor.floor_id]
    is_any = any(n.is_there(data.monday, data.sunday) for n in lines)
    return (frozenset({"M57", "M59", "M60"}) if is_any else frozenset()) | (
        {"M58"} if any(n.inside for n in lines) else set()
    )


def figure_unit(metric: str, rules: UnitRules) -> Reason:
    """Return the unit of a figure, as the wording catalogue names it.

    Args:
        metric: Id in the catalogue.
        rules: The settings that units name.
    """
    return Reason(
        f"unit.{metric}",
        distance_m=rules.distance_m,
        outage_min=rules.outage_min_s / 60,
        contact_min=rules.contact_s / 60,
    )
