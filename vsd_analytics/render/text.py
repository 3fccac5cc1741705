"""Answers as aligned text for a terminal: tables of chosen columns, one column as a grid, why values are missing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from vsd_analytics.answer import INTERVALS, VALUES, Answer, Cell, Column, Reason, Row, Scalar, Value, value_of
from vsd_analytics.errors import CONTROL
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import has, say
from vsd_analytics.wording.reasons import reason_text

_MINUTE_S = 60
_SHOWN_BELOW_S = 90
_LEAST_PERCENT = 0.1
_PERCENT_WITH_DIGIT = 9.95
"""Smaller shares have a digit behind the point."""
_LEAST = 0.001
"""Smaller numbers are written as being smaller than this."""


@dataclass(frozen=True, slots=True)
class TableLayout:
    """Some columns of an answer, a line for each row.

    Attributes:
        columns: Names of columns, in order; those the answer lacks are left out.
        only: Column without whose cell or number a row is left out; empty for all rows.
        some: Columns of which one is above 0 in each row that is shown; empty for all rows.
    """

    columns: tuple[str, ...]
    only: str = ""
    some: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class GridLayout:
    """One column of an answer, a line for each cell of the column `down`, a column for each of `over`.

    Rows of different `name` are grids of their own.
    """

    column: str
    down: str
    over: str

    @property
    def columns(self) -> tuple[str, ...]:
        """Return the columns that are shown."""
        return (self.column,)


Layout = Sequence[TableLayout | GridLayout]


def title(answer: Answer) -> str:
    """Return the name of an answer in words."""
    return say(f"reason.answer.{answer.name}")


def text(answer: Answer, layout: Layout) -> list[str]:
    """Return the tables of an answer as lines, an empty line between two; a table without any value is left out."""
    lines: list[str] = []
    for shown in layout:
        for table in _grids(answer, shown) if isinstance(shown, GridLayout) else _tables(answer, shown):
            lines += ["", *table] if lines else table
    return lines


def remarks(answer: Answer, layout: Layout) -> list[str]:
    """Return why there are no rows, or why shown values lack a number or an interval, and the notes.

    A line begins with the `name` of its row. Of several lines that differ in their numbers alone, the first is there.
    """
    if answer.nothing is not None:
        return [reason_text(answer.nothing)]
    sentences: dict[tuple[str, str], dict[str, None]] = {}
    for number, row in enumerate(answer.rows):
        shown = {name for part in layout if _has_row(part, row) for name in part.columns}
        columns = [column for column in answer.columns if column.name in shown]
        for reason in (*_reasons(row, columns), *(reason for k, reason in answer.notes if k == number)):
            sentences.setdefault((_name(row), reason.code), {})[reason_text(reason)] = None
    general = [reason_text(reason) for k, reason in answer.notes if k is None]
    return [*(_remark(name, list(several)) for (name, _), several in sentences.items()), *general]


def head(column: Column) -> str:
    """Return the heading of a column: the catalogue's entry, else its name in words."""
    return reason_text(Reason(f"column.{column.name}"))


def cell_text(cell: Cell, column: Column) -> str:
    """Return a cell as text: a value with its limits where it has both, a dash where it is missing."""
    if isinstance(cell, tuple):
        return ", ".join(_plain(one, column) for one in cell) or fmt.MISSING
    if not isinstance(cell, Value):
        return _plain(cell, column)
    if cell.value is None:
        return fmt.MISSING
    number = number_text(cell.value, column)
    if column.kind not in INTERVALS or cell.lo is None:
        return number
    if cell.hi is None:
        return f"{number} (at least {number_text(cell.lo, column)})"
    return f"{number} ({number_text(cell.lo, column)} to {number_text(cell.hi, column)})"


def number_text(value: float, column: Column) -> str:
    """Return a number as its unit is written: 12%, 0.6%, -14%, 45 s, 2.5 min, 08:00, 1,234, 0.095, <0.001."""
    if not math.isfinite(value):
        return fmt.MISSING
    match column.unit:
        case "share":
            return _percent(100 * value)
        case "change":
            return f"{value:+.0%}"
        case "s":
            return f"{value:.0f} s" if abs(value) < _SHOWN_BELOW_S else f"{value / _MINUTE_S:.1f} min"
        case "hour_of_day":
            return f"{value:02.0f}:00"
    if column.kind in ("count", "number") or abs(value) >= 10**column.digits:
        return f"{value:,.0f}"
    return f"<{_LEAST}" if 0 < value < _LEAST else f"{value:.{column.digits}g}"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of texts as lines with aligned columns; control characters in a text are replaced."""
    clean = [[CONTROL.sub("\ufffd", cell) for cell in row] for row in rows]
    widths = [max(len(row[k]) for row in clean) for k in range(len(clean[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in clean]


def _tables(answer: Answer, shown: TableLayout) -> Iterator[list[str]]:
    known = {column.name for column in answer.columns}
    columns = [answer.column(name) for name in shown.columns if name in known]
    rows = [row for row in answer.rows if _has_row(shown, row)]
    if _has_value(rows, columns):
        yield aligned([[head(c) for c in columns], *([cell_text(row[c.name], c) for c in columns] for row in rows)])


def _has_row(shown: TableLayout | GridLayout, row: Row) -> bool:
    """Tell whether a layout shows a row."""
    if isinstance(shown, GridLayout):
        return True
    if shown.some and not any(row[name] for name in shown.some):
        return False
    if not shown.only:
        return True
    cell = row.get(shown.only)
    return cell.value is not None if isinstance(cell, Value) else cell is not None


def _grids(answer: Answer, shown: GridLayout) -> Iterator[list[str]]:
    column, down, over = (answer.column(name) for name in (shown.column, shown.down, shown.over))
    for name in dict.fromkeys(map(_name, answer.rows)):
        rows = [row for row in answer.rows if _name(row) == name]
        if not _has_value(rows, [column]):
            continue
        cells = {(row[down.name], row[over.name]): cell_text(row[column.name], column) for row in rows}
        days, hours = (list(dict.fromkeys(row[c.name] for row in rows)) for c in (over, down))
        lines = [[head(down), *(cell_text(day, over) for day in days)]]
        lines += [[cell_text(h, down), *(cells.get((h, day), "") for day in days)] for h in hours]
        yield [*aligned([[f"{name}: {head(column)}" if name else head(column)]]), *aligned(lines)]


def _has_value(rows: Sequence[Row], columns: Sequence[Column]) -> bool:
    names = [column.name for column in columns if column.kind in VALUES]
    return bool(rows) if not names else any(value_of(row, name).value is not None for row in rows for name in names)


def _reasons(row: Row, columns: Sequence[Column]) -> Iterator[Reason]:
    for column in columns:
        value = row[column.name]
        if isinstance(value, Value) and value.reason is not None and value.is_uncertain:
            yield value.reason


def _remark(name: str, sentences: Sequence[str]) -> str:
    first, n_others = sentences[0], len(sentences) - 1
    line = say("reason.likewise", first=first, n=n_others) if n_others else first
    return aligned([[f"{name}: {line}" if name else line]])[0]


def _name(row: Row) -> str:
    name = row.get("name")
    return name if isinstance(name, str) else ""


def _percent(value: float) -> str:
    if 0 < value < _LEAST_PERCENT:
        return f"<{_LEAST_PERCENT}%"
    return f"{value:.1f}%" if 0 < value < _PERCENT_WITH_DIGIT else f"{value:.0f}%"


def _plain(cell: Scalar, column: Column) -> str:
    match cell:
        case None:
            return fmt.MISSING
        case bool():
            return "yes" if cell else "no"
        case int() if not column.unit:
            return str(cell)  # a year or the number of a message has no separators
        case int() | float():
            return number_text(cell, column)
        case _ if has(entry := f"reason.cell.{column.unit}.{cell}"):
            return say(entry)
        case _:
            return str(cell)
