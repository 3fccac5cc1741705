"""Answers as aligned text for a terminal: a chosen set of columns, or one column across a second key."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from vsd_analytics.answer import INTERVALS, Answer, Cell, Column, Reason, Row, Scalar, Value, value_of
from vsd_analytics.errors import CONTROL
from vsd_analytics.wording.catalogue import has, say
from vsd_analytics.wording.reasons import reason_text

MISSING: Final = "\u2013"
_MINUTE_S: Final = 60
_SHOWN_BELOW_S: Final = 90


def text(answer: Answer, column_sets: Sequence[Sequence[str]]) -> list[str]:
    """Return some columns as lines, a line for each row, and below them why values are missing.

    Args:
        answer: The answer.
        column_sets: Names of columns, in order, for one table after the other; those the answer lacks are left out. A
            reason is printed only for what is shown.
    """
    if answer.nothing is not None:
        return [reason_text(answer.nothing)]
    known = {c.name for c in answer.columns}
    lines: list[str] = []
    for names in column_sets if answer.rows else ():
        columns = [answer.column(name) for name in names if name in known]
        rows = [[head(c) for c in columns], *([cell_text(row[c.name], c) for c in columns] for row in answer.rows)]
        lines += ["", *aligned(rows)] if lines else aligned(rows)
    shown = {name for names in column_sets for name in names if name in known}
    reasons = _reasons(answer, [c for c in answer.columns if c.name in shown])
    return [*lines, "", *reasons] if lines and reasons else [*lines, *reasons]


def across(answer: Answer, column: str, *, down: str, over: str) -> list[str]:
    """Return one column as a grid: a line for each value of the key `down`, a column for each of the key `over`."""
    shown = answer.column(column)
    heads = list(dict.fromkeys(row[over] for row in answer.rows))
    lines = list(dict.fromkeys(row[down] for row in answer.rows))
    cells = {(row[down], row[over]): cell_text(row[column], shown) for row in answer.rows}
    rows = [["", *map(str, heads)], *([str(at), *(cells.get((at, h), MISSING) for h in heads)] for at in lines)]
    return aligned(rows)


def head(column: Column) -> str:
    """Return the heading of a column: the catalogue's entry, else its name in words."""
    key = f"reason.column.{column.name}"
    return say(key) if has(key) else column.name.replace("_", " ")


def cell_text(cell: Cell, column: Column) -> str:
    """Return a cell as text: a value with its limits where it has both, a dash where it is missing."""
    if isinstance(cell, tuple):
        return ", ".join(_plain(one) for one in cell) or MISSING
    if not isinstance(cell, Value):
        return _plain(cell)
    if cell.value is None:
        return MISSING
    number = number_text(cell.value, column)
    if column.kind not in INTERVALS or cell.lo is None:
        return number
    if cell.hi is None:
        return f"{number} (at least {number_text(cell.lo, column)})"
    return f"{number} ({number_text(cell.lo, column)} to {number_text(cell.hi, column)})"


def number_text(value: float, column: Column) -> str:
    """Return a number as its kind is written: 12%, 45 s, 2.5 min, 1,234, 0.095."""
    match column.kind:
        case "share":
            return f"{value:.0%}"
        case "seconds":
            return f"{value:.0f} s" if abs(value) < _SHOWN_BELOW_S else f"{value / _MINUTE_S:.1f} min"
        case "count" | "number":
            return f"{value:,.0f}"
        case _:
            return f"{value:,.0f}" if abs(value) >= 10**column.digits else f"{value:.{column.digits}g}"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of texts as lines with aligned columns; control characters and line ends in a text are replaced."""
    clean = [[CONTROL.sub("\ufffd", cell).replace("\n", " ") for cell in row] for row in rows]
    widths = [max(len(row[k]) for row in clean) for k in range(len(clean[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in clean]


def _reasons(answer: Answer, columns: Sequence[Column]) -> list[str]:
    """Return why shown values lack a number or an interval, and the notes, each once, after the name of its row."""
    lines: dict[str, None] = {}
    for number, row in enumerate(answer.rows):
        for column in (c for c in columns if isinstance(row[c.name], Value)):
            value = value_of(row, column.name)
            if value.reason is not None and value.state != "ok":
                lines[_line(row, value.reason)] = None
        for of_row, reason in answer.notes:
            if of_row == number:
                lines[_line(row, reason)] = None
    for of_row, reason in answer.notes:
        if of_row is None:
            lines[reason_text(reason)] = None
    return list(lines)


def _line(row: Row, reason: Reason) -> str:
    name = row.get("name")
    return f"{name}: {reason_text(reason)}" if isinstance(name, str) else reason_text(reason)


def _plain(cell: Scalar) -> str:
    if cell is None:
        return MISSING
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, float):
        return f"{cell:g}" if math.isfinite(cell) else MISSING
    return str(cell)
