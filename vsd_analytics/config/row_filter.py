"""The grammar of row filters, such as `class_name = 'person' and confidence >= 0.4`.

A filter is comparisons joined by `and`. It is never run as code or as SQL. `ingest.where` applies it to tables.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

EXAMPLE: Final = "class_name = 'person' and confidence >= 0.4"
MAX_CHARS: Final = 1_000

_TOKEN: Final = re.compile(
    r"""\s*(?:(?P<text>'(?:[^']|'')*')|(?P<quoted>"[^"]+")|(?P<sign>==|!=|<>|<=|>=|=|<|>)"""
    r"""|(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.]))|(?P<name>[^\W\d][\w.\-/]*))"""
)


@dataclass(frozen=True, slots=True)
class RowCondition:
    """One comparison of a column with a value.

    Attributes:
        column: The file's column.
        sign: One of = == != <> < <= > >=.
        value: A number is compared with numbers, a text with texts (blanks around them do not count).
    """

    column: str
    sign: str
    value: str | float


class FilterError(ValueError):
    """A filter that cannot be understood.

    Attributes:
        fix: What to write instead; None = an example shows it.
    """

    def __init__(self, why: str, *, fix: str | None = None) -> None:
        super().__init__(why)
        self.fix = fix


def parse_filter(text: str) -> tuple[RowCondition, ...]:
    """Return the comparisons of a filter.

    Raises:
        FilterError: It is not comparisons joined by `and`.
    """
    tokens = _tokens(text)
    conditions = []
    for at in range(0, len(tokens), 4):
        part = tokens[at : at + 4]
        if len(part) < 3 or (len(part) == 4 and (part[3][0], part[3][1].lower()) != ("name", "and")):
            is_joined = len(part) == 4
            raise FilterError("comparisons are joined by 'and'" if is_joined else "a comparison is not complete")
        (kind, column), (sign_kind, sign), (value_kind, value), *_ = part
        if kind not in ("name", "quoted") or sign_kind != "sign":
            raise FilterError("a comparison is COLUMN SIGN VALUE, with one of = != < <= > >=")
        if value_kind not in ("text", "number"):
            raise FilterError(f"{value} is neither a number nor a text in single quotes", fix=f"'{value}'")
        is_number = value_kind == "number"
        name = column.strip('"') if kind == "quoted" else column
        conditions.append(
            RowCondition(name, sign, float(value) if is_number else value[1:-1].replace("''", "'").strip())
        )
    if not conditions or len(tokens) % 4 == 0:
        raise FilterError("a comparison is missing")
    return tuple(conditions)


def _tokens(text: str) -> list[tuple[str, str]]:
    if len(text) > MAX_CHARS:
        raise FilterError(f"it is longer than {MAX_CHARS:,} characters")
    tokens, at, end = [], 0, len(text.rstrip())
    while at < end:
        token = _TOKEN.match(text, at)
        if token is None or token.lastgroup is None:
            raise FilterError(f"this cannot be read: {text[at:].strip()[:40]}")
        tokens.append((token.lastgroup, token[token.lastgroup]))
        at = token.end()
    return tokens
