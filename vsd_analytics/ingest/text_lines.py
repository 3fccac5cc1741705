"""Whole lines of a stream with their numbers, block by block, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import IO

from vsd_analytics.errors import InputError

BLOCK_BYTES = 4 << 20
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def line_blocks(
    stream: IO[bytes], *, max_bytes: int, block_bytes: int = BLOCK_BYTES
) -> Iterator[tuple[int, list[bytes | None]]]:
    """Yield the lines of a stream, many at a time.

    Args:
        stream: Buffered bytes with `read1`, such as `Source.open` gives; a UTF-8 byte order mark is left out.
        max_bytes: Longest line yielded, its end not counted.
        block_bytes: How much is read at once.

    Yields:
        The 1-based number of the first line, and the lines without their ends (LF or CR LF). None replaces a line that
        is too long; no more than about `max_bytes + block_bytes` of it is ever in memory.

    Raises:
        InputError: The stream is damaged (E205); every whole line before the damage was yielded.
    """
    number, rest, is_skipping = 1, b"", False
    while True:
        try:
            data: bytes = stream.read1(block_bytes)  # type: ignore[attr-defined]
        except InputError:
            if is_skipping:
                yield number, [None]
            raise
        if not data:
            break
        if is_skipping:
            _, newline, data = data.partition(b"\n")
            if not newline:
                continue
            yield number, [None]
            number, is_skipping = number + 1, False
        if number == 1 and not rest:
            data = data.removeprefix(_BYTE_ORDER_MARK)
        whole, newline, rest = (rest + data).rpartition(b"\n")
        if newline:
            lines = _split(whole, max_bytes)
            yield number, lines
            number += len(lines)
        if len(rest) > max_bytes + 1:
            rest, is_skipping = b"", True
    if is_skipping:
        yield number, [None]
    elif rest:
        yield number, _split(rest.removesuffix(b"\r"), max_bytes)


def _split(whole: bytes, max_bytes: int) -> list[bytes | None]:
    if b"\r" in whole:  # most files have none, which takes a tenth of the time to see
        whole = whole.removesuffix(b"\r").replace(b"\r\n", b"\n")
    lines: list[bytes] = whole.split(b"\n")
    if len(whole) <= max_bytes:
        return list(lines)
    return [line if len(line) <= max_bytes else None for line in lines]
