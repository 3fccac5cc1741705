"""Whole numbers as text for a page: variable-length bytes or planes, gzip, base 85; equal numbers give equal text."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

OF_PYTHON = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;<=>?@^_`{|}~"
"""Signs of base 85 as Python writes them."""
OF_PAGE = bytes(code for code in range(ord("!"), ord("~") + 1) if chr(code) not in "\"&'<>\\`{}")
"""Those of a page, in the order of their codes: none that means something in HTML or in a script."""
TO_PAGE = bytes.maketrans(OF_PYTHON, OF_PAGE)
GZIP_BITS = 31
"""The largest window, and a gzip header, whose time is 0."""
MEMORY_LEVEL = 6
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


def planes(numbers: ArrayLike) -> bytes:
    """Return numbers from 0 to `LARGEST` as how many planes follow, all lowest bytes, all next ones, and so on.

    Times of many units pack a tenth smaller so than as `varints`: low bytes are nearly random, and gzip codes them
    apart from high ones, which are not.

    Args:
        numbers: Whole numbers, any shape, in C order.

    Raises:
        ValueError: A number is negative or too large.
    """
    rest = np.ascontiguousarray(numbers, dtype=np.int64).ravel()
    if rest.size and (rest.min() < 0 or rest.max() > LARGEST):
        raise ValueError("only numbers from 0 to 2^53 - 1 can be packed")
    n_planes = -(-int(rest.max()).bit_length() // 8) if rest.size else 0
    return bytes([n_planes]) + b"".join((rest >> 8 * k & 255).astype(np.uint8).tobytes() for k in range(n_planes))


def sparse(key: NDArray[np.int64], *values: NDArray[np.int64]) -> list[bytes]:
    """Return rows of a sparse table as columns: how many rows, gaps between rising keys, then each column of values.

    Args:
        key: Rising, not negative.
        values: Columns as long as `key`.
    """
    return [varints([key.size]), varints(np.diff(key, prepend=0)), *(varints(v) for v in values)]


def packed(parts: Iterable[bytes]) -> str:
    """Return byte strings, one after the other, as base 85 of gzip without a time stamp.

    Base 85 is 6 % shorter than base 64. Gzip makes a new code every few thousand bytes. It prefers that to repetitions
    (`Z_FILTERED`): columns differ and hardly repeat. This is 4 % shorter.
    """
    coder = zlib.compressobj(9, zlib.DEFLATED, GZIP_BITS, MEMORY_LEVEL, zlib.Z_FILTERED)
    return base64.b85encode(coder.compress(b"".join(parts)) + coder.flush()).translate(TO_PAGE).decode()
