"""A digest that a Parquet file has of itself in its metadata, for files whose name is no hash of their bytes.

The digest is BLAKE2b over the whole file with zeros in the digest's place. So it covers rows, statistics and footer: a
flipped bit in a statistic could make a reader skip rows that are in the file.
"""

from __future__ import annotations

import hashlib
from typing import Final

DIGEST: Final = b"vsd.digest"
"""Metadata key of the digest."""
_BYTES: Final = 16
NO_DIGEST: Final = b"0" * 2 * _BYTES
"""Value of the key until the bytes of the file are known."""


def with_digest(blank: bytes) -> bytes:
    """Return the bytes of a file whose metadata has `NO_DIGEST`, with its digest."""
    place = _place(blank)
    return blank[:place] + _digest(blank) + blank[place + len(NO_DIGEST) :]


def is_undamaged(data: bytes) -> bool:
    """Return whether all bytes of a file match its digest; False for a file without one."""
    place = _place(data)
    noted = data[place : place + len(NO_DIGEST)]
    return _digest(data[:place] + NO_DIGEST + data[place + len(NO_DIGEST) :]) == noted


def _place(data: bytes) -> int:
    """Return the offset of the digest.

    Parquet's footer stores metadata as Thrift strings: after the key come two bytes (field type and length), then the
    value. `rfind`, because column data before the footer may hold the same bytes by chance.
    """
    return data.rfind(DIGEST) + len(DIGEST) + 2


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_BYTES).hexdigest().encode()
