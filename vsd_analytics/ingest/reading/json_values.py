"""JSON values of a file one after the other, however many lines each spans, and the values at paths into them.

A path is names with dots between, such as `meta.time`; a number is a place in a list, as in `box.2`.
"""

from __future__ import annotations

import codecs
import json
from collections.abc import Callable, Iterator
from typing import Any, Final

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.reading.adapter import Source, bytes_read

READ_BYTES = 1 << 20
_BETWEEN = " \t\r\n,"


def json_values(
    source: Source,
    *,
    value_max_bytes: int,
    damaged: Callable[[int, str, Exception], InputError],
    array_at: int | None = None,
) -> Iterator[tuple[int, Any, str, int]]:
    """Yield number (from 1), value, its text, and how far the file has been read; the file is never in memory.

    Args:
        source: The file.
        value_max_bytes: Longest text of a value; a longer one counts as damage.
        damaged: Makes the error of what is no JSON, from the number of values before it, its first text and why.
        array_at: Where an array begins whose entries alone are wanted, in unpacked bytes; None = all of the file.
    """
    decode = json.JSONDecoder().raw_decode
    as_text = codecs.getincrementaldecoder("utf-8-sig")("backslashreplace")
    text, at, number, is_end, is_array = "", 0, 0, False, False
    with source.open() as stream:
        stream.read(array_at or 0)
        while True:
            while at < len(text) and (text[at] in _BETWEEN or text[at] == ("]" if is_array else "[")):
                is_array = text[at] == "[" or (is_array and text[at] != "]")
                at += 1
                if array_at is not None and not is_array:
                    return
            try:
                if at == len(text):
                    raise json.JSONDecodeError("nothing", text, at)
                value, end = decode(text, at)
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
            yield number, value, text[at:end], bytes_read(stream)
            at = end


KEY: Final = "@key"
"""Path of a person's key, where the persons of a message are the values of an object."""
_LEAF_DEPTH: Final = 4


def value_at(thing: Any, path: str) -> Any:
    """Return the value at a path, or None where there is none. A key that has the dots in it counts as well."""
    while path:
        if isinstance(thing, dict):
            if path in thing:
                return thing[path]
            name, _, path = path.partition(".")
            thing = thing.get(name)
        elif isinstance(thing, list):
            name, _, path = path.partition(".")
            thing = thing[int(name)] if name.isdecimal() and len(name) < 10 and int(name) < len(thing) else None
        else:
            return None
    return thing


def leaves(thing: Any, front: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield path and value of what is neither object nor list, also inside objects."""
    for name, value in thing.items() if isinstance(thing, dict) else ():
        path = f"{front}{name}"
        if isinstance(value, dict) and depth < _LEAF_DEPTH:
            yield from leaves(value, f"{path}.", depth + 1)
        elif not isinstance(value, dict | list):
            yield path, value
