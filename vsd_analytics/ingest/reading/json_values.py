"""JSON values of a file one after the other, or of arrays one after the other, however many lines each spans."""

from __future__ import annotations

import codecs
import json
from collections.abc import Callable, Iterator
from typing import Any

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.reading.adapter import Source, bytes_read

READ_BYTES = 1 << 20
_BETWEEN = " \t\r\n,"


def json_values(
    source: Source, *, value_max_bytes: int, damaged: Callable[[int, str, Exception], InputError]
) -> Iterator[tuple[int, Any, str, int]]:
    """Yield number (from 1), value, its text, and how far the file has been read; the file is never in memory.

    Args:
        source: The file.
        value_max_bytes: Longest text of a value; a longer one counts as damage.
        damaged: Makes the error of what is no JSON, from the number of values before it, its first text and why.
    """
    decode = json.JSONDecoder().raw_decode
    as_text = codecs.getincrementaldecoder("utf-8-sig")("backslashreplace")
    text, at, number, is_end, is_array = "", 0, 0, False, False
    with source.open() as stream:
        while True:
            while at < len(text) and (text[at] in _BETWEEN or text[at] == ("]" if is_array else "[")):
                is_array = text[at] == "[" or (is_array and text[at] != "]")
                at += 1
            try:
                if at == len(text):
                    raise json.JSONDecodeError("nothing", text, at)
                found, end = decode(text, at)
            except (ValueError, RecursionError) as error:
                if is_end and at == len(text):
                    return
                if is_end or len(text) - at > value_max_bytes:
                    raise damaged(number, text[at : at + 80], error) from None
                more = stream.read(READ_BYTES)
                is_end = not more
                text, at = text[at:] + as_text.decode(more, final=is_end), 0
                continue
            number += 1
            yield number, found, text[at:end], bytes_read(stream)
            at = end
