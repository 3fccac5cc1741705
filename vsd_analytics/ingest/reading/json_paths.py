"""Paths into JSON messages: names with dots between, such as `meta.time`; a number is a place in a list (`box.2`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

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
