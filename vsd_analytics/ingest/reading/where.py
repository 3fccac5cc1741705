"""`--where`: which rows of a table are read, such as `class_name = 'person' and confidence >= 0.4`."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Final

import numpy as np
import pyarrow as pa

from vsd_analytics.config.row_filter import EXAMPLE as FILTER
from vsd_analytics.config.row_filter import FilterError, RowCondition, parse_filter
from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.reading.cell_values import ids, numbers

EXAMPLE: Final = f'--where "{FILTER}"'

OPERATORS: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "=": operator.eq, "==": operator.eq, "!=": operator.ne, "<>": operator.ne,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip


@cache
def parse_where(text: str) -> tuple[RowCondition, ...]:
    """Return the comparisons of a filter.

    Raises:
        UsageError: E101, it is not comparisons joined by `and`.
    """
    try:
        return parse_filter(text)
    except FilterError as error:
        raise UsageError(
            f"--where {text[:200]!r} is not understood",
            why=str(error),
            fix=EXAMPLE if error.fix is None else f"write {error.fix}, as in {EXAMPLE}",
        ) from None


def rows_where(
    comparisons: Sequence[RowCondition], cells: Mapping[str, pa.Array], *, decimal_comma: bool = False
) -> np.ndarray:
    """Return for which rows all comparisons hold; `cells` are the columns by the names of the comparisons."""
    first, *others = comparisons
    holds = _holds(first, cells[first.column], decimal_comma=decimal_comma)
    for comparison in others:
        holds = holds & _holds(comparison, cells[comparison.column], decimal_comma=decimal_comma)
    return holds


def _holds(comparison: RowCondition, cells: pa.Array, *, decimal_comma: bool) -> np.ndarray:
    """Return for which cells it holds; for a missing cell, and a text compared with a number, it does not."""
    compare = OPERATORS[comparison.sign]
    if isinstance(comparison.value, float):
        values, _ = numbers(cells, decimal_comma=decimal_comma)
        return np.asarray(~np.isnan(values) & compare(values, comparison.value))
    texts = ids(cells, default=None, length=len(cells)).to_pylist()
    return np.array([bool(text) and compare(text, comparison.value) for text in texts], dtype=bool)
