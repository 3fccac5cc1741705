"""Cells of tables, whatever type a file gives them: finite numbers, ids, texts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

# 7.0 and the 7.0000000e+00 of numpy.savetxt are the id 7; "12e4" is a hexadecimal id and stays one
_WHOLE = re.compile(r"^(-?\d+)\.0*$")
NO_ID = frozenset(
    {"", "-1", "18446744073709551615", "na", "n/a", "nan", "nil", "none", "null", "undefined", "<na>", "#n/a", "\\n"}
    | {"unknown", "untracked", "unassigned"}
)
"""What programs write for a person whom no tracker follows (in lower case); -1 is that of MOTChallenge and others,
the largest number of 64 bits that of DeepStream."""
_THOUSANDS = re.compile("(?<=\\d)[\u00a0\u2009\u202f\u2019'](?=\\d{3}(?!\\d))")
_SCIENTIFIC = re.compile(r"^-?\d\.\d+[eE][+-]\d{2,3}$")


def numbers(values: pa.Array, *, decimal_comma: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return a column as numbers.

    Args:
        values: Texts or numbers; null and blank are missing.
        decimal_comma: Texts may have a comma for the point.

    Returns:
        float64, NaN where missing or wrong, and which rows hold something that is no finite number.

    Raises:
        pyarrow.ArrowException: The column is of a type that cannot hold numbers, such as a list.
    """
    if not _is_text(values.type):
        floats = values.cast(pa.float64(), safe=False)
        is_known = values.is_valid().to_numpy(zero_copy_only=False)
    else:
        texts = trimmed(values)
        texts = pc.if_else(pc.equal(texts, ""), pa.scalar(None, pa.string()), texts)
        is_known = texts.is_valid().to_numpy(zero_copy_only=False)
        if decimal_comma:
            texts = pc.replace_substring(texts, ",", ".")
        try:
            floats = texts.cast(pa.float64())
        except pa.ArrowInvalid:
            written = pd.Series([None if t is None else _plain_number(t) for t in texts.to_pylist()], dtype="object")
            floats = pa.array(pd.to_numeric(written, errors="coerce"), pa.float64())
    values_f = np.array(floats.to_numpy(zero_copy_only=False), dtype=np.float64)
    is_wrong = is_known & ~np.isfinite(values_f)
    values_f[is_wrong] = np.nan
    return values_f, is_wrong


def _plain_number(text: str) -> str:
    """Return a number with a plain minus sign, and without the blanks or apostrophes that part its thousands."""
    return _THOUSANDS.sub("", text.replace("\u2212", "-")) if not text.isascii() or "'" in text else text


def floats_or_null(values: np.ndarray) -> pa.Array:
    """Return float64 with nulls where `values` is NaN; infinities stay, for validation to see."""
    return pa.array(values, type=pa.float64(), mask=np.isnan(values))


def tracks(values: pa.Array | None, *, length: int) -> pa.Array:
    """Return a column of track ids as strings, as `ids` does it; a value that means "no id" is missing."""
    track = ids(values, default=None, length=length)
    is_none = pc.is_in(pc.utf8_lower(track), pa.array(sorted(NO_ID)))
    return pc.if_else(pc.fill_null(is_none, True), pa.scalar(None, pa.string()), track)


def ids(values: pa.Array | None, *, default: str | None, length: int) -> pa.Array:
    """Return a column of ids as strings.

    Args:
        values: Texts or numbers, or None when the file has no such column. An id is the same whether it is written as
            7, "7", 7.0 or 7.0000000e+00.
        default: Id of rows that have none.
        length: Number of rows.
    """
    if values is None:
        return pa.repeat(pa.scalar(default, pa.string()), length)
    is_number = pa.types.is_integer(values.type) or pa.types.is_floating(values.type)
    coded = (values if is_number else trimmed(values)).dictionary_encode()
    names = pa.array([_plain_id(v) or default for v in coded.dictionary.to_pylist()], pa.string())
    texts = names.take(coded.indices)
    return texts if default is None else pc.fill_null(texts, default)


def trimmed(values: pa.Array) -> pa.Array:
    """Return a column as strings without blanks around them; null is "", bytes that are not UTF-8 stay as escapes."""
    if pa.types.is_binary(values.type) or pa.types.is_large_binary(values.type):
        decoded = [None if v is None else v.decode("utf-8", "backslashreplace") for v in values.to_pylist()]
        values = pa.array(decoded, pa.string())
    return pc.utf8_trim_whitespace(pc.fill_null(values.cast(pa.string()), ""))


def is_number(text: str) -> bool:
    """Return whether a cell is a number, and so no column name."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def full_score(cells: Iterable[str]) -> float | None:
    """Return the full score of cells that hold shares (1) or percents (100); None where they hold something else."""
    scores = [float(cell) for cell in cells if is_number(cell)]
    return None if not scores or min(scores) < 0 or max(scores) > 100 else 100.0 if max(scores) > 1.5 else 1.0


def _is_text(kind: pa.DataType) -> bool:
    return any(
        check(kind)
        for check in (
            pa.types.is_string,
            pa.types.is_large_string,
            pa.types.is_string_view,
            pa.types.is_binary,
            pa.types.is_large_binary,
        )
    )


def _plain_id(value: object) -> str | None:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 2**63 else f"{value:.15g}"
    text = str(value)
    if whole := _WHOLE.match(text):
        return whole[1]
    if _SCIENTIFIC.match(text) and (number := float(text)).is_integer() and abs(number) < 2**63:
        return str(int(number))
    return text
