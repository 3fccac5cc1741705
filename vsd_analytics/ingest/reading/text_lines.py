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
    """Yield the number of the first line and the `lines_of` each of the `text_blocks` of a stream."""
    for number, text in text_blocks(stream, max_bytes=max_bytes, block_bytes=block_bytes):
        yield number, lines_of(text, max_bytes=max_bytes)


def text_blocks(
    stream: IO[bytes], *, max_bytes: int, block_bytes: int = BLOCK_BYTES
) -> Iterator[tuple[int, bytes | None]]:
    """Yield the text of a stream, whole lines at a time.

    Args:
        stream: Buffered bytes with `read1`, such as `Source.open` gives; a UTF-8 byte order mark is left out.
        max_bytes: Longest line of interest, its end not counted.
        block_bytes: How much is read at once.

    Yields:
        The 1-based number of the first line, and the lines without the end of the last one. None is a line that is too
        long; no more than about `max_bytes + block_bytes` of it is ever in memory.

    Raises:
        InputError: The stream is damaged (E205); every whole line before the damage was yielded.
    """
    number, rest, is_skipping = 1, b"", False
    try:
        for piece, is_last in _pieces(stream, block_bytes):
            data = piece
            if is_skipping:
                _, newline, data = data.partition(b"\n")
                if not newline:
                    continue
                yield number, None
                number, is_skipping = number + 1, False
            if number == 1 and not rest:
                data = data.removeprefix(_BYTE_ORDER_MARK)
            text = rest + data
            whole, newline, rest = text.rpartition(b"\n")
            if is_last and rest:
                whole, newline, rest = text, b"\n", b""
            if newline:
                yield number, whole
                number += whole.count(b"\n") + 1
            if len(rest) > max_bytes + 1:
                rest, is_skipping = b"", True
    except InputError:
        if is_skipping:
            yield number, None
        raise
    if is_skipping:
        yield number, None


def lines_of(text: bytes | None, *, max_bytes: int) -> list[bytes | None]:
    """Return the lines of a block without their ends (LF or CR LF); None replaces a line that is too long."""
    if text is None:
        return [None]
    if b"\r" in text:  # most files have none, which takes a tenth of the time to see
        text = text.removesuffix(b"\r").replace(b"\r\n", b"\n")
    lines: list[bytes] = text.split(b"\n")
    if len(text) <= max_bytes:
        return list(lines)
    return [line if len(line) <= max_bytes else None for line in lines]


def _pieces(stream: IO[bytes], n_bytes: int) -> Iterator[tuple[bytes, bool]]:
    """Yield the bytes of a stream, at least so many at a time, and whether they are the last ones.

    A compressed stream hands out a little at a time. What comes before damage is yielded before the error is raised.
    """
    pieces: list[bytes] = []
    while True:
        try:
            data: bytes = stream.read1(n_bytes)  # type: ignore[attr-defined]
        except InputError:
            if pieces:
                yield b"".join(pieces), False
            raise
        pieces.append(data)
        if not data or sum(map(len, pieces)) >= n_bytes:
            yield b"".join(pieces), not data
            pieces = []
        if not data:
            return
