"""Figures by catalogue id, as the JSON file has them under `figures`: a view of the answers that computes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import date, datetime
from typing import Any

from vsd_analytics.answer import VALUES, Answer, Cell, Column, Reason, Row, value_of
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.results import Figure


def figure_of(metric: str, answers: Iterable[Answer], *, unit: Reason) -> Figure:
    """Return the columns of one figure over all answers.

    Returns:
        A row for each row and column of the figure, with the keys and facts of the row, `column`, `what` (its name in
        words), `unit`, `value`, `lo`, `hi`, `state`, `reason` and `denominator`. Where no row has a value, the figure
        has the first reason that one of them gives.

    Args:
        metric: Id in the catalogue.
        answers: The answers of a week.
        unit: Unit of the figure in words.
    """
    chosen = [a for a in answers if any(c.figure == metric for c in a.columns)]
    rows = tuple(row for answer in chosen for row in _rows(answer, metric))
    if all(row["value"] is None for row in rows):
        reasons = [*(row["reason"] for row in rows), *(a.nothing for a in chosen)]
        states = [row["state"] for row in rows if row["reason"] is not None]
        why = next((r for r in reasons if r is not None), NOTHING_OPEN)
        return Figure(unit=unit, state=states[0] if states else "not_enough_data", reason=why)
    note = next((reason for a in chosen for k, reason in a.notes if k is None), None)
    return Figure(unit=unit, rows=rows, note=note)


def _rows(answer: Answer, metric: str) -> Iterator[dict[str, Any]]:
    columns = [c for c in answer.columns if c.figure == metric]
    about = [c.name for c in answer.columns if c.kind not in VALUES]
    for row in answer.rows:
        keys = {name: _plain(row[name]) for name in about}
        for column in columns:
            yield {**keys, **_value(row, column)}


def _value(row: Row, column: Column) -> dict[str, Any]:
    value = value_of(row, column.name)
    return {
        "column": column.name,
        "what": Reason(f"column.{column.name}"),
        "unit": column.unit,
        "value": value.value,
        "lo": value.lo,
        "hi": value.hi,
        "state": value.state,
        "reason": value.reason,
        "denominator": _denominator(row, column.per),
    }


def _denominator(row: Row, name: str) -> Any:
    if not name:
        return None
    cell = row.get(name)
    return cell if isinstance(cell, int | float) or cell is None else value_of(row, name).value


def _plain(cell: Cell) -> Any:
    if isinstance(cell, tuple):
        return list(cell)
    return cell.isoformat() if isinstance(cell, date | datetime) else cell
