"""Columns of pandas frames whose sum over nothing known is unknown.

pandas leaves out what is missing, so its sum of a week without records is 0. These are its own nullable columns,
`Int64` and `Float64`, but a sum, also by group, needs one known value (`min_count=1`).
"""

from __future__ import annotations

from typing import Any

import pandas as pd
import pyarrow as pa
from pandas.arrays import FloatingArray, IntegerArray


class _SumsKnown:
    """Sums that are missing where no value is known."""

    def _reduce(self, name: str, *, skipna: bool = True, keepdims: bool = False, **options: Any) -> Any:
        if name == "sum":
            options["min_count"] = max(1, options.get("min_count", 0))
        return super()._reduce(name, skipna=skipna, keepdims=keepdims, **options)  # type: ignore[misc]

    def _groupby_op(self, *, how: str, min_count: int, **options: Any) -> Any:
        least = max(1, min_count) if how == "sum" else min_count
        return super()._groupby_op(how=how, min_count=least, **options)  # type: ignore[misc]


class UnknownIntegers(_SumsKnown, IntegerArray):
    """Whole numbers, some unknown."""

    @property
    def dtype(self) -> Any:
        """Return `Int64`."""
        kind = super().dtype
        return _UnknownInt64() if isinstance(kind, pd.Int64Dtype) else kind


class UnknownFloats(_SumsKnown, FloatingArray):
    """Numbers, some unknown."""

    @property
    def dtype(self) -> Any:
        """Return `Float64`."""
        kind = super().dtype
        return _UnknownFloat64() if isinstance(kind, pd.Float64Dtype) else kind


class _UnknownInt64(pd.Int64Dtype):
    @classmethod
    def construct_array_type(cls) -> Any:
        return UnknownIntegers


class _UnknownFloat64(pd.Float64Dtype):
    @classmethod
    def construct_array_type(cls) -> Any:
        return UnknownFloats


def unknown_integers(values: pa.ChunkedArray) -> UnknownIntegers:
    """Return an Arrow column of whole numbers as a column of a frame."""
    known = values.is_valid().to_numpy()
    return UnknownIntegers(values.fill_null(0).cast(pa.int64()).to_numpy().copy(), ~known)


def unknown_floats(values: pa.ChunkedArray) -> UnknownFloats:
    """Return an Arrow column of numbers as a column of a frame."""
    known = values.is_valid().to_numpy()
    return UnknownFloats(values.fill_null(0.0).cast(pa.float64()).to_numpy().copy(), ~known)
