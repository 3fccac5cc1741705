"""The headers of Parquet pages: what a page unpacks to, read before it is unpacked.

The footer of a file may state anything about its columns. A page, however, can unpack to no more than its own header
states, because the decompressor gets a buffer of that size. pyarrow gives no access to page headers, so this module
reads them: structs of Thrift's compact protocol (doc/specs/thrift-compact-protocol.md of Apache Thrift), with the field
numbers of parquet.thrift.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Any

HEADER_MAX_BYTES = 1 << 20
_FIRST_READ = 4096
_MAX_DEPTH = 8
_DICTIONARY_PAGE, _DATA_PAGE_V2 = 2, 3
_DELTA_BYTE_ARRAY = 7
_OF_DICTIONARIES = (0, 2, 8)  # PLAIN, PLAIN_DICTIONARY, RLE_DICTIONARY


class PageError(ValueError):
    """The bytes are no page header."""


@dataclass(frozen=True, slots=True)
class ParquetPage:
    """One page.

    Attributes:
        n_values: Values in it.
        unpacked_bytes: Its size after decompression.
        is_dictionary: It holds the values that the indices of other pages mean.
        encoding: Number of the encoding of its values, as in parquet.thrift; None = unknown.
    """

    n_values: int
    unpacked_bytes: int
    is_dictionary: bool
    encoding: int | None

    @property
    def can_be_dictionary(self) -> bool:
        """Tell whether pyarrow can read its texts as a dictionary."""
        return self.encoding in _OF_DICTIONARIES

    @property
    def text_bytes(self) -> float:
        """Return what a text of this page takes.

        On average for texts one behind the other; at most for those that repeat the beginning of the one before, or
        that are in a dictionary: the whole page.
        """
        if self.is_dictionary or self.encoding == _DELTA_BYTE_ARRAY:
            return self.unpacked_bytes
        return self.unpacked_bytes / max(1, self.n_values)


def pages(stream: IO[bytes], *, start: int, end: int) -> Iterator[ParquetPage]:
    """Yield the pages of one column of one row group.

    Args:
        stream: The file.
        start: Where its first page begins.
        end: Where its last page ends.

    Raises:
        PageError: There is no page where one should be.
    """
    at = start
    while at < end:
        header, n_bytes = _header(stream, at)
        kind, unpacked, packed = (header.get(i) for i in (1, 2, 3))
        body = header.get(8 if kind == _DATA_PAGE_V2 else 7 if kind == _DICTIONARY_PAGE else 5, {})
        if not (isinstance(unpacked, int) and isinstance(packed, int) and unpacked >= 0 and packed >= 0):
            raise PageError("a page without a size")
        body = body if isinstance(body, dict) else {}
        n_values, encoding = body.get(1, 0), body.get(4 if kind == _DATA_PAGE_V2 else 2)
        yield ParquetPage(
            n_values if isinstance(n_values, int) else 0,
            unpacked,
            kind == _DICTIONARY_PAGE,
            encoding if isinstance(encoding, int) else None,
        )
        at += n_bytes + packed


def _header(stream: IO[bytes], at: int) -> tuple[dict[int, Any], int]:
    """Return the fields of the page header at an offset, and its length."""
    size = _FIRST_READ
    while True:
        stream.seek(at)
        data = stream.read(size)
        try:
            return _struct(data, 0, depth=0)
        except IndexError:
            if len(data) < size or size >= HEADER_MAX_BYTES:
                raise PageError("a page header that does not end") from None
            size = HEADER_MAX_BYTES


def _struct(data: bytes, at: int, *, depth: int) -> tuple[dict[int, Any], int]:
    if depth > _MAX_DEPTH:
        raise PageError("a page header nested too deeply")
    fields: dict[int, Any] = {}
    number = 0
    while kind := data[at] & 15:
        step, at = data[at] >> 4, at + 1
        if step:
            number += step
        else:
            value, at = _varint(data, at)
            number = _signed(value)
        fields[number], at = _value(data, at, kind, depth=depth)
    return fields, at + 1


def _value(data: bytes, at: int, kind: int, *, depth: int) -> tuple[Any, int]:
    """Return a value and where it ends: booleans, whole numbers, structs; of others only where they end."""
    if kind in (1, 2):
        return kind == 1, at
    if kind == 3:
        return data[at], at + 1
    if kind in (4, 5, 6):
        value, at = _varint(data, at)
        return _signed(value), at
    if kind == 7:
        return None, at + 8
    if kind == 8:
        length, at = _varint(data, at)
        if at + length > len(data):
            raise IndexError
        return None, at + length
    if kind == 12:
        return _struct(data, at, depth=depth + 1)
    raise PageError(f"a page header with a value of kind {kind}")


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte, at = data[at], at + 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return value, at
        if shift > 63:
            raise PageError("a number of more than 64 bits")


def _signed(value: int) -> int:
    return (value >> 1) ^ -(value & 1)
