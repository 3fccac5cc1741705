"""The figures of a week by catalogue id, as the page and HTTP give them: a view of its answers, and its maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue import figure_unit
from vsd_analytics.figures.catalogue.view import figure_of
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording.catalogue import has
from vsd_analytics.wording.reasons import reason_text


def figures_by_id(report: WeekReport) -> Mapping[str, Figure]:
    """Return all figures of a week in the order of the catalogue.

    Args:
        report: The week; of version 1 its file has the figures and no answers.

    Returns:
        By id, such as M7, what `figure_of` makes of the answers, and the maps of `report.figures`. Rows are plain
        values: sentences instead of reasons.
    """
    held = {column.figure for answer in report.answers for column in answer.columns} - {""}
    units = {metric: figure_unit(metric, report.rules) for metric in held}
    figures = {metric: _with_texts(figure_of(metric, report.answers, unit=unit)) for metric, unit in units.items()}
    return dict(sorted({**report.figures, **figures}.items(), key=lambda entry: int(entry[0][1:])))


def _with_texts(figure: Figure) -> Figure:
    if figure.rows is None:
        return figure

    def text(row: Mapping[str, Any]) -> Mapping[str, Any]:
        return {name: _text(value) if isinstance(value, Reason) else value for name, value in row.items()}

    return replace(figure, rows=tuple(text(row) for row in figure.rows))


def _text(reason: Reason) -> str:
    """Return a reason as its sentence; the name of a column that has no heading in words."""
    if has(f"reason.{reason.code}"):
        return reason_text(reason)
    return reason.code.rpartition(".")[2].replace("_", " ")
