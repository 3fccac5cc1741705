"""Guessing the mapping of an unknown JSON message from its names, to be shown to the user and never used unasked."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any, Final

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.adapter import IngestOptions, Source
from vsd_analytics.ingest.column_guess import note_on_place
from vsd_analytics.ingest.json_map import KEY, leaves
from vsd_analytics.ingest.json_messages import messages
from vsd_analytics.ingest.telling_names import ids_like, letters, named_like, place_like, time_like

_DEPTH: Final = 4
_PLAIN: Final = re.compile(r"[\w.\-]+")
"""Names that mean themselves to a shell, to which the proposal is copied."""
_MESSAGES: Final = 50
"""Messages that are looked at: the first ones may have nobody in view."""
_POINTS: Final = frozenset(
    ("p", "pos", "position", "xy", "xyz", "point", "location", "loc", "coord", "coords", "coordinates", "centroid")
)
"""Names of lists that hold x and y."""


def guessed_mapping(source: Source) -> str | None:
    """Return the options by which a file of JSON messages can probably be read, or None when its names say too little.

    Args:
        source: A file that begins like JSON.
    """
    try:
        first = [m for _, m, _, _ in islice(messages(source, IngestOptions()), _MESSAGES) if m is not None]
    except (VsdError, OSError):
        return None
    return next((guess for message in first if (guess := _guess(message)) is not None), None)


def _guess(message: dict[str, Any]) -> str | None:
    lists = [(path, person, False) for path, person in _lists(message) if _PLAIN.fullmatch(path)]
    keyed = [(path, person, True) for path, person in _keyed(message) if _PLAIN.fullmatch(path)]
    for path, person, is_keyed in [*lists, *keyed, (None, message, False)]:
        theirs = _mapping(message, person)
        if theirs is not None:
            if is_keyed:
                theirs.setdefault("track_id", KEY)
            joined = ",".join(f"{ours}={name}" for ours, name in theirs.items())
            where = "--format json" if path is None else f"--persons {path}"
            note = note_on_place(theirs) if "left" in theirs else ""
            return f"{where} --map {joined}{note}"
    return None


def _mapping(message: Mapping[str, Any], person: Mapping[str, Any]) -> dict[str, str] | None:
    of_message, of_person = ([path for path, _ in leaves(thing)] for thing in (message, person))
    time = time_like(of_message)
    place = place_like(of_person) or _by_last_part(of_person) or _point(person)
    if time is None or not place or not all(_PLAIN.fullmatch(path) for path in (time, *place.values())):
        return None
    cameras = [path for path in named_like(of_message, "camera") if _PLAIN.fullmatch(path)]
    ids = [path for path in ids_like(of_person) if _PLAIN.fullmatch(path)]
    more = {**({"camera_id": cameras[0]} if cameras else {}), **({"track_id": ids[0]} if ids else {})}
    return {"ts": time, **more, **place}


def _by_last_part(paths: list[str]) -> dict[str, str]:
    by_name = {path.rpartition(".")[2]: path for path in reversed(paths)}
    return {ours: by_name[name] for ours, name in place_like(by_name).items()}


def _point(person: Mapping[str, Any]) -> dict[str, str]:
    """Return the place that a list of two or three numbers holds, such as `"pos": [1.2, 3.4]`."""
    for name, value in person.items():
        is_numbers = isinstance(value, list) and all(isinstance(v, int | float) for v in value)
        if is_numbers and len(value) in (2, 3) and letters(name) in _POINTS:
            return {"x_m": f"{name}.0", "y_m": f"{name}.1"}
    return {}


def _keyed(message: Mapping[str, Any], front: str = "", depth: int = 0) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the path of each object whose values are alike, and its first value: people by their ids."""
    for name, value in message.items():
        if not isinstance(value, dict) or not value:
            continue
        people = list(value.values())
        is_ids = len(people) > 1 or not next(iter(value)).isalpha()
        if is_ids and all(isinstance(p, dict) and p.keys() == people[0].keys() for p in people):
            yield f"{front}{name}", people[0]
        elif depth < _DEPTH:
            yield from _keyed(value, f"{front}{name}.", depth + 1)


def _lists(message: Mapping[str, Any], front: str = "", depth: int = 0) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the path of each list of objects, and its first object."""
    for name, value in message.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            yield f"{front}{name}", value[0]
        elif isinstance(value, dict) and depth < _DEPTH:
            yield from _lists(value, f"{front}{name}.", depth + 1)
