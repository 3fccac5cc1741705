"""`--where`: which rows of a table are read, such as `class_name = 'person' and confidence >= 0.4`.

The text is taken into comparisons joined by `and`. It is never run as code or as SQL.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
import pyarrow as pa

from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.cell_values import ids, numbers

EXAMPLE: Final = "--where \"class_name = 'person' and confidence >= 0.4\""
MAX_CHARS: Final = 1_000

_OPERATORS: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "=": operator.eq, "==": operator.eq, "!=": operator.ne, "<>": operator.ne,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_TOKEN: Final = re.compile(
    r"""\s*(?:(?P<text>'(?:[^']|'')*')|(?P<quoted>"[^"]+")|(?P<sign>==|!=|<>|<=|>=|=|<|>)"""
    r"""|(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.]))|(?P<name>[^\W\d][\w.\-/]*))"""
)


@dataclass(frozen=True, slots=True)
class Condition:
    """One comparison of a column with a value.

    Attributes:
        column: The file's column.
        sign: Key of the operator, such as ">=".
        value: A number is compared with numbers, a text with texts (blanks around them do not count).
    """

    column: str
    sign: str
    value: str | float

    def holds(self, cells: pa.Array, *, decimal_comma: bool) -> np.ndarray:
        """Return for which cells it holds; for a missing cell, and a text compared with a number, it does not."""
        compare = _OPERATORS[self.sign]
        if isinstance(self.value, float):
            values, _ = numbers(cells, decimal_comma=decimal_comma)
            return np.asarray(~np.isnan(values) & compare(values, self.value))
        texts = ids(cells, default=None, length=len(cells)).to_pylist()
        return np.array([bool(text) and compare(text, self.value) for text in texts], dtype=bool)


@cache
def parse_where(text: str) -> tuple[Condition, ...]:
    """Return the comparisons of a filter.

    Raises:
        UsageError: E101, it is not comparisons joined by `and`.
    """
    tokens = _tokens(text)
    found = []
    for at in range(0, len(tokens), 4):
        part = tokens[at : at + 4]
        if len(part) < 3 or (len(part) == 4 and (part[3][0], part[3][1].lower()) != ("name", "and")):
            raise _unclear(
                text, "comparisons are joined by 'and'" if len(part) == 4 else "a comparison is not complete"
            )
        (kind, column), (sign_kind, sign), (value_kind, value), *_ = part
        if kind not in ("name", "quoted") or sign_kind != "sign":
            raise _unclear(text, "a comparison is COLUMN SIGN VALUE, with one of = != < <= > >=")
        if value_kind not in ("text", "number"):
            raise _unclear(text, f"{value} is neither a number nor a text in single quotes", fix=f"'{value}'")
        found.append(
            Condition(
                column.strip('"') if kind == "quoted" else column,
                sign,
                float(value) if value_kind == "number" else value[1:-1].replace("''", "'").strip(),
            )
        )
    if not found or len(tokens) % 4 == 0:
        raise _unclear(text, "a comparison is missing")
    return tuple(found)


def rows_where(
    comparisons: Sequence[Condition], cells: Mapping[str, pa.Array], *, decimal_comma: bool = False
) -> np.ndarray:
    """Return for which rows all comparisons hold; `cells` are the columns by the names of the comparisons."""
    first, *others = comparisons
    holds = first.holds(cells[first.column], decimal_comma=decimal_comma)
    for comparison in others:
        holds = holds & comparison.holds(cells[comparison.column], decimal_comma=decimal_comma)
    return holds


def _tokens(text: str) -> list[tuple[str, str]]:
    if len(text) > MAX_CHARS:
        raise _unclear(text[:40], f"it is longer than {MAX_CHARS:,} characters")
    found, at, end = [], 0, len(text.rstrip())
    while at < end:
        token = _TOKEN.match(text, at)
        if token is None or token.lastgroup is None:
            raise _unclear(text, f"this cannot be read: {text[at:].strip()[:40]}")
        found.append((token.lastgroup, token[token.lastgroup]))
        at = token.end()
    return found


def _unclear(text: str, why: str, *, fix: str | None = None) -> UsageError:
    return UsageError(
        f"--where {text[:200]!r} is not understood",
        why=why,
        fix=EXAMPLE if fix is None else f"write {fix}, as in {EXAMPLE}",
    )
