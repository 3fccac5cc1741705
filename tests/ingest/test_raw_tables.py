"""Raw tables and lines: the shape every adapter hands over."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.ingest.reading.adapter import EXCERPT_CHARS
from vsd_analytics.ingest.reading.raw import bounded_lines, raw_table, rejected
from vsd_analytics.schema import RAW_SCHEMAS, TABLES


def test_absent_columns_are_null_and_single_values_repeat() -> None:
    table = raw_table(
        "pairs", camera="hall", ts_ms=np.arange(3), person_a=[0, 0, 1], person_b=2, quality="body", line=[1, 2, 3]
    )
    assert table.schema == RAW_SCHEMAS["pairs"]
    assert table["distance_m"].null_count == table["track_a"].null_count == 3
    assert table["camera"].to_pylist() == ["hall"] * 3
    assert table["person_b"].to_pylist() == [2, 2, 2]


def test_missing_is_null_and_a_wrong_number_stays_one() -> None:
    table = raw_table("observations", ts_ms=[1, 2], person=[0, 1], x_m=[None, math.nan], quality="metric", line=0)
    assert table["x_m"].null_count == 1
    assert math.isnan(table["x_m"][1].as_py())


def test_empty_lists_make_empty_tables() -> None:
    for name in TABLES:
        empty: dict[str, list[object]] = {f.name: [] for f in RAW_SCHEMAS[name]}
        assert raw_table(name, **empty).equals(RAW_SCHEMAS[name].empty_table())


@pytest.mark.parametrize(
    ("columns", "error"),
    [
        ({"ts_ms": [1], "line": [1, 2]}, ValueError),
        ({"ts_ms": 1, "line": 1}, ValueError),
        ({"ts_ms": [1]}, ValueError),
        ({"ts": [1], "line": [1]}, KeyError),
    ],
)
def test_columns_that_do_not_fit_are_refused(columns: dict[str, object], error: type[Exception]) -> None:
    with pytest.raises(error):
        raw_table("frames", **columns)


@given(
    lines=st.lists(
        st.binary(max_size=12).map(lambda b: b.replace(b"\n", b"").replace(b"\r", b"").replace(b"\xef", b""))
    ),
    end=st.sampled_from([b"\n", b"\r\n"]),
    is_ended=st.booleans(),
)
def test_lines_are_those_of_a_split_with_long_ones_left_out(lines: list[bytes], end: bytes, is_ended: bool) -> None:
    text = end.join(lines) + (end if is_ended else b"")
    expected = text.split(end)
    expected = expected[:-1] if expected[-1] == b"" else expected
    found = list(bounded_lines(io.BytesIO(text), max_bytes=5))
    assert found == [(n, line if len(line) <= 5 else None) for n, line in enumerate(expected, 1)]


def test_a_byte_order_mark_is_no_part_of_the_first_line() -> None:
    assert list(bounded_lines(io.BytesIO(b"\xef\xbb\xbfa\nb"), max_bytes=9)) == [(1, b"a"), (2, b"b")]


def test_rejected_text_is_shortened_and_readable() -> None:
    record = rejected(3, reason="bad-json", detail="no", record=b"\xff" + b"a" * 10_000)
    assert len(record.text) == EXCERPT_CHARS
    assert record.text.startswith("\ufffda")
