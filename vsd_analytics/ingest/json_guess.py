"""Guessing the mapping of an unknown JSON message from its names, to be shown to the user and never used unasked."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.adapter import IngestOptions, Source
from vsd_analytics.ingest.json_map import leaves
from vsd_analytics.ingest.json_messages import messages
from vsd_analytics.ingest.telling_names import ids_like, named_like, place_like, time_like

_DEPTH: Final = 4
_PLAIN: Final = re.compile(r"[\w.\-]+")
"""Names that mean themselves to a shell, to which the proposal is copied."""


def guessed_mapping(source: Source) -> str | None:
    """Return the options by which a file of JSON messages can probably be read, or None when its names say too little.

    Args:
        source: A file that begins like JSON.
    """
    try:
        first = next((m for _, m, _, _ in messages(source, IngestOptions()) if m is not None), None)
    except (VsdError, OSError):
        return None
    if first is None:
        return None
    lists = [(path, person) for path, person in _lists(first) if _PLAIN.fullmatch(path)]
    for path, person in [*lists, (None, first)]:
        theirs = _mapping(first, person)
        if theirs is not None:
            joined = ",".join(f"{ours}={name}" for ours, name in theirs.items())
            return f"{'--format json' if path is None else f'--persons {path}'} --map {joined}"
    return None


def _mapping(message: Mapping[str, Any], person: Mapping[str, Any]) -> dict[str, str] | None:
    of_message, of_person = ([path for path, _ in leaves(thing)] for thing in (message, person))
    time = time_like(of_message)
    place = place_like(of_person) or _by_last_part(of_person)
    if time is None or not place or not all(_PLAIN.fullmatch(path) for path in (time, *place.values())):
        return None
    cameras = [path for path in named_like(of_message, "camera") if _PLAIN.fullmatch(path)]
    ids = [path for path in ids_like(of_person) if _PLAIN.fullmatch(path)]
    more = {**({"camera_id": cameras[0]} if cameras else {}), **({"track_id": ids[0]} if ids else {})}
    return {"ts": time, **more, **place}


def _by_last_part(paths: list[str]) -> dict[str, str]:
    by_name = {path.rpartition(".")[2]: path for path in reversed(paths)}
    return {ours: by_name[name] for ours, name in place_like(by_name).items()}


def _lists(message: Mapping[str, Any], front: str = "", depth: int = 0) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the path of each list of objects, and its first object."""
    for name, value in message.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            yield f"{front}{name}", value[0]
        elif isinstance(value, dict) and depth < _DEPTH:
            yield from _lists(value, f"{front}{name}.", depth + 1)
