"""Whole numbers as text for a page: variable-length bytes, gzip, base64; equal numbers give equal text."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST = 2**53 - 1
"""Largest number a browser holds exactly."""


def varints(numbers: ArrayLike) -> bytes:
    """Return numbers from 0 to `LARGEST` as bytes of seven bits, the lowest first; the high bit says that more follow.

    Args:
        numbers: Whole numbers, any shape, in C order.

    Raises:
        ValueError: A number is negative or too large.
    """
    rest = np.ascontiguousarray(numbers, dtype=np.int64).ravel()
    if rest.size == 0:
        return b""
    if rest.min() < 0 or rest.max() > LARGEST:
        raise ValueError("only numbers from 0 to 2^53 - 1 can be packed")
    n_bytes = np.ones(rest.size, dtype=np.int64)
    for bits in range(7, 54, 7):
        n_bytes += rest >> bits > 0
    ends = np.cumsum(n_bytes)
    out = np.zeros(int(ends[-1]), dtype=np.uint8)
    for k in range(int(n_bytes.max())):
        has = n_bytes > k
        at = (ends - n_bytes)[has] + k
        out[at] = (rest[has] >> 7 * k & 127) | np.where(n_bytes[has] > k + 1, 128, 0)
    return out.tobytes()


def sparse(key: NDArray[np.int64], *values: NDArray[np.int64]) -> list[bytes]:
    """Return rows of a sparse table as columns: how many rows, gaps between rising keys, then each column of values.

    Args:
        key: Rising, not negative.
        values: Columns as long as `key`.
    """
    return [varints([key.size]), varints(np.diff(key, prepend=0)), *(varints(v) for v in values)]


def packed(parts: Iterable[bytes]) -> str:
    """Return byte strings, one after the other, as base64 of gzip without a time stamp."""
    return base64.b64encode(gzip.compress(b"".join(parts), compresslevel=9, mtime=0)).decode()
