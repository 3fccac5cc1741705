"""Answers as Arrow tables, from which frames, CSV files and tables of a DuckDB file are made."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from datetime import date, datetime
from typing import Any, Final

import pyarrow as pa

from vsd_analytics.answer import INTERVALS, VALUES, Answer, Cell, Column, Value
from vsd_analytics.render.significant import significant
from vsd_analytics.store.spreadsheet import safe_cell
from vsd_analytics.wording.reasons import text_or_none

PARTS: Final = ("lo", "hi", "state", "reason")


def arrow(answer: Answer) -> pa.Table:
    """Return an answer as a table: a column for each key and fact, and several for each value.

    A value column `x` becomes `x`, `x_lo` and `x_hi` (where its kind may have an interval), `x_state` and `x_reason`.
    What is missing is null, never 0. The description of a column is in its field's metadata.
    """
    arrays, fields = [], []
    for column in answer.columns:
        for name, kind, cells in _flat(answer, column):
            fields.append(pa.field(name, kind, metadata={"unit": column.unit, "figure": column.figure}))
            arrays.append(pa.array(cells, type=kind))
    return pa.table(arrays, schema=pa.schema(fields))


def csv_text(answer: Answer) -> str:
    """Return an answer as CSV: the columns of `arrow`, floats with 6 significant digits, lists joined by spaces.

    Names that a spreadsheet would take for a formula get an apostrophe before them.
    """
    table = arrow(answer)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(table.column_names)
    writer.writerows([_csv_cell(cell) for cell in row.values()] for row in table.to_pylist())
    return out.getvalue()


def _csv_cell(cell: Any) -> Any:
    match cell:
        case None:
            return ""
        case bool():
            return "yes" if cell else "no"
        case float():
            return significant(cell)
        case list():
            return safe_cell(" ".join(map(str, cell)))
        case str():
            return safe_cell(cell)
        case datetime() | date():
            return cell.isoformat()
        case _:
            return cell


def _flat(answer: Answer, column: Column) -> Iterator[tuple[str, pa.DataType, list[Any]]]:
    cells = [row[column.name] for row in answer.rows]
    if column.kind not in VALUES:
        yield column.name, _type(cells, column), [list(c) if isinstance(c, tuple) else c for c in cells]
        return
    values = [c for c in cells if isinstance(c, Value)]
    is_whole = column.kind in ("count", "number")
    yield column.name, pa.int64() if is_whole else pa.float64(), [_number(v, is_whole) for v in values]
    if column.kind in INTERVALS:
        yield f"{column.name}_lo", pa.float64(), [v.lo for v in values]
        yield f"{column.name}_hi", pa.float64(), [v.hi for v in values]
    yield f"{column.name}_state", pa.string(), [v.state for v in values]
    yield f"{column.name}_reason", pa.string(), [text_or_none(v.reason) for v in values]


def _number(value: Value, is_whole: bool) -> float | int | None:
    return None if value.value is None else round(value.value) if is_whole else float(value.value)


def _type(cells: Sequence[Cell], column: Column) -> pa.DataType:
    """Return the type of a column without values, from its cells; text where all are missing."""
    if column.kind == "instant":
        zoned = next((c for c in cells if isinstance(c, datetime)), None)
        return pa.timestamp("ms", tz=None if zoned is None else str(zoned.tzinfo))
    for cell in cells:
        match cell:
            case tuple():
                return pa.list_(pa.string())
            case bool():
                return pa.bool_()
            case int():
                return pa.int64()
            case float():
                return pa.float64()
            case date():
                return pa.date32()
            case str():
                return pa.string()
            case _:
                continue
    return pa.string()
