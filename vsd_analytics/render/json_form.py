"""Answers as JSON, and back: every table of figures has one shape in every JSON output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from datetime import date, datetime
from typing import Any, Final

from vsd_analytics.answer import VALUES, Answer, Answers, Cell, Column, HoldsFor, Reason, Sum, Value
from vsd_analytics.render.significant import significant
from vsd_analytics.wording.reasons import read_reason, text_or_none

_TEXT: Final = {"type": ["string", "null"]}
ANSWERS_SCHEMA: Final[dict[str, Any]] = {
    "type": "object",
    "description": "Tables of figures by name: columns, rows, and the place and days they hold for.",
    "additionalProperties": {
        "type": "object",
        "required": ["name", "holds_for", "columns", "rows", "notes", "nothing", "state", "sums"],
        "properties": {
            "name": {"type": "string"},
            "holds_for": {"type": "object"},
            "columns": {"type": "array", "items": {"type": "object", "required": ["name", "kind", "unit", "figure"]}},
            "rows": {
                "type": "array",
                "items": {
                    "type": "object",
                    "description": "A cell by column. A value is an object of value, lo, hi, state and reason; null is "
                    "never 0.",
                },
            },
            "notes": {"type": "array", "items": {"type": "object", "required": ["row", "text"]}},
            "nothing": _TEXT,
            "state": {"enum": ["ok", "not_enough_data", "not_measurable"]},
            "sums": {"type": "array", "items": {"type": "object", "required": ["total", "parts"]}},
        },
    },
}
"""JSON Schema of the answers of a report."""


def as_json(answer: Answer) -> dict[str, Any]:
    """Return an answer as JSON can hold it.

    Returns:
        `name`; `holds_for` (site, floor, first and last day, until, settings, inputs); `columns` (name, kind, unit,
        figure, per); `rows`, in which a value is an object of value, lo, hi, state, reason, and everything else is
        itself; `notes` (row, text); `nothing`, why there are no rows, and its
        `state`. Days and instants are ISO 8601.
    """
    return {
        "name": answer.name,
        "holds_for": {name: _plain(cell) for name, cell in asdict(answer.holds_for).items()},
        "columns": [_column(c) for c in answer.columns],
        "rows": [{name: cell_json(cell) for name, cell in row.items()} for row in answer.rows],
        "notes": [{"row": row, "text": text_or_none(reason)} for row, reason in answer.notes],
        "nothing": text_or_none(answer.nothing),
        "state": answer.state,
        "sums": [{"total": s.total, "parts": list(s.parts)} for s in answer.sums],
    }


def cell_json(cell: Cell) -> Any:
    """Return a cell as JSON can hold it."""
    if isinstance(cell, Value):
        return {
            "value": cell.value,
            "lo": cell.lo,
            "hi": cell.hi,
            "state": cell.state,
            "reason": text_or_none(cell.reason),
        }
    return [_plain(one) for one in cell] if isinstance(cell, tuple) else _plain(cell)


def from_json(decoded: Mapping[str, Any]) -> Answer:
    """Return the answer that `as_json` was given; a reason is read as its sentence, without its code.

    Raises:
        KeyError: Something is missing in it.
        ValueError: It is no answer, or its sums do not hold.
    """
    columns = tuple(Column(**{**c, "tells": tuple(c["tells"])}) for c in decoded["columns"])
    kinds = {c.name: c.kind for c in columns}
    holds = decoded["holds_for"]
    until = holds["until"]
    return Answer(
        decoded["name"],
        columns,
        tuple({name: _cell(cell, kinds[name]) for name, cell in row.items()} for row in decoded["rows"]),
        HoldsFor(
            **{
                **holds,
                "first": date.fromisoformat(holds["first"]),
                "last": date.fromisoformat(holds["last"]),
                "until": None if until is None else datetime.fromisoformat(until),
            }
        ),
        tuple(Sum(s["total"], tuple(s["parts"])) for s in decoded["sums"]),
        tuple((note["row"], _reason(note["text"])) for note in decoded["notes"]),
        None if decoded["nothing"] is None else _reason(decoded["nothing"]),
        decoded["state"],
    )


def rounded_answers(answers: Answers) -> Answers:
    """Return answers with every float of 6 significant digits, as the JSON file has them."""

    def cell(value: Cell) -> Cell:
        if isinstance(value, float):
            return significant(value)
        if not isinstance(value, Value):
            return value
        number, lo, hi = (significant(n) if isinstance(n, float) else n for n in (value.value, value.lo, value.hi))
        return Value(number, lo, hi, value.state, value.reason)

    return Answers(
        replace(answer, rows=tuple({name: cell(value) for name, value in row.items()} for row in answer.rows))
        for answer in answers
    )


def _column(column: Column) -> dict[str, Any]:
    return {**asdict(column), "tells": list(column.tells)}


def _cell(cell: Any, kind: str) -> Cell:
    if kind in VALUES:
        return Value(**{**cell, "reason": None if cell["reason"] is None else _reason(cell["reason"])})
    if isinstance(cell, list):
        return tuple(cell)
    if kind == "instant" and cell is not None:
        return datetime.fromisoformat(cell)
    read: Cell = cell
    return read


def _plain(cell: Any) -> Any:
    return cell.isoformat() if isinstance(cell, date | datetime) else cell


def _reason(text: str) -> Reason:
    return read_reason(text)
