"""The filter of rows: what it understands, what it refuses, and that it never runs anything."""

from __future__ import annotations

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.reading.where import parse_where, rows_where

CELLS = {
    "kind": pa.array(["person", " person ", "car", "", None]),
    "conf": pa.array(["0.5", "0,3", "x", "0.9", "1"]),
    "n": pa.array([1.0, 2.0, float("nan"), None, 5.0]),
}


@pytest.mark.parametrize(
    ("text", "chosen"),
    [
        ("kind = 'person'", [1, 1, 0, 0, 0]),
        ("kind == 'person' AND conf >= 0.5", [1, 0, 0, 0, 0]),
        ("kind != 'person'", [0, 0, 1, 0, 0]),
        ("\"kind\" <> 'car' and n<2", [1, 0, 0, 0, 0]),
        ("conf > .4", [1, 0, 0, 1, 1]),
        ("n = 5", [0, 0, 0, 0, 1]),
        ("n = '5'", [0, 0, 0, 0, 1]),
        ("kind = 'it''s'", [0, 0, 0, 0, 0]),
    ],
)
def test_rows_are_chosen(text: str, chosen: list[int]) -> None:
    assert rows_where(parse_where(text), CELLS).astype(int).tolist() == chosen


def test_decimal_commas_are_numbers_where_the_file_has_them() -> None:
    assert rows_where(parse_where("conf < 0.4"), CELLS, decimal_comma=True).astype(int).tolist() == [0, 1, 0, 0, 0]


@pytest.mark.parametrize(
    "text",
    [
        *("", "  ", "kind", "kind =", "kind = person", "kind = 'a' or kind = 'b'", "kind = 'a' and", "1 = 1"),
        *(
            "kind = 'a",
            "(kind = 'a')",
            "and = and",
            "kind = 'a' and and n = 1",
            "n = 1 2",
            "x" * 2000,
            "kind like 'a%'",
        ),
        "kind = 'a'; x",
        "x" * 2000,
    ],
)
def test_anything_else_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_where(text)
    assert "--where" in str(caught.value.fix)


@given(st.text(max_size=60))
def test_any_text_is_comparisons_or_a_refusal(text: str) -> None:
    try:
        found = parse_where(text)
    except UsageError:
        return
    assert all(c.sign in ("=", "==", "!=", "<>", "<", "<=", ">", ">=") for c in found)
