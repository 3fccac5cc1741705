"""Guessing the mapping of an unknown JSON message from its names, to be shown to the user and never used unasked."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any, Final

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.column_guess import note_on_place
from vsd_analytics.ingest.reading.column_hints import (
    OBJECTS,
    PERSON,
    POINTS,
    ids_like,
    is_whole_box,
    letters,
    named_like,
    place_like,
    time_like,
)
from vsd_analytics.ingest.reading.envelopes import body_of
from vsd_analytics.ingest.reading.json_messages import messages
from vsd_analytics.ingest.reading.json_values import KEY, leaves, value_at

_DEPTH: Final = 4
_PLAIN: Final = re.compile(r"[\w.$\-]+")
"""Names that can be in an option, which is quoted where a shell would take them for something else."""
_MESSAGES: Final = 50
"""Messages that are looked at: the first ones may have nobody in view."""
_SIDES: Final = ("left", "top", "right", "bottom")
_SIZES: Final = ("left", "top", "width", "height")
_CENTRED: Final = ("center_x", "center_y", "width", "height")
_BOXES: Final[tuple[tuple[str, tuple[str, ...]], ...]] = (
    ("cxcywh", _CENTRED),
    *((name, _SIDES) for name in ("xyxy", "tlbr", "ltrb")),
    *((name, _SIZES) for name in ("xywh", "tlwh", "ltwh")),
)
"""What lists of four numbers hold whose names end so."""
_FRAMES: Final = frozenset(("frame", "frameid", "framenumber", "frameno", "frameindex", "frameidx", "framenum"))
_NAMES_MAX: Final = 12
_TIME_KEY: Final = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
_UNIX_DIGITS: Final = 9
"""Keys with so many digits are seconds since 1970, and no numbers of frames."""
_DOCUMENT: Final = "_id"
"""Name of a database for one of its documents, and of nobody."""


def guessed_mapping(source: Source) -> str | None:
    """Return the options by which a file of JSON messages can probably be read, or None when its names say too little.

    Args:
        source: A file that begins like JSON.
    """
    try:
        first = [m for _, m, _, _ in islice(messages(source, IngestOptions()), _MESSAGES) if m is not None]
    except (VsdError, OSError):
        return None
    return next((guess for message in first if (guess := _guess(message, first)) is not None), None)


def paths_of(source: Source) -> str | None:
    """Return where the first message has its values; None where there is no message."""
    try:
        first = next((m for _, m, _, _ in messages(source, IngestOptions()) if m), None)
    except (VsdError, OSError):
        return None
    if first is None:
        return None
    paths = [path for path, _ in _paths(first)]
    return ", ".join([path[:60] for path in paths[:_NAMES_MAX]] + ["..."] * (len(paths) > _NAMES_MAX))


def _paths(thing: Any, front: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield the path of each value, of the first entry of each list."""
    if isinstance(thing, dict) and depth <= _DEPTH:
        for name, value in thing.items():
            yield from _paths(value, f"{front}.{name}".lstrip("."), depth + 1)
    elif isinstance(thing, list) and thing and isinstance(thing[0], dict | list) and depth <= _DEPTH:
        yield from _paths(thing[0], f"{front}.0", depth + 1)
    elif isinstance(thing, list) and thing:
        yield f"{front}.0 to .{len(thing) - 1}", thing
    else:
        yield front, thing


def _guess(message: dict[str, Any], others: list[dict[str, Any]]) -> str | None:
    if (keyed_frames := _guess_of_keys(message, others)) is not None:
        return keyed_frames
    lists = [(path, person, frame, False) for path, person, frame in _lists(message, message) if _is_plain(path)]
    keyed = [(path, person, message, True) for path, person in _keyed(message) if _is_plain(path)]
    # the innermost lists hold the people, those around them their frames
    lists.sort(key=lambda entry: -entry[0].count("*"))
    for path, person, frame, is_keyed in [*lists, *keyed, (None, message, message, False)]:
        fronts = tuple(f"{p}." for p, _, _, _ in keyed if path in (None, p))
        theirs = _mapping(frame, person, others, fronts) or _mapping(message, person, others, fronts)
        theirs = theirs or (None if path is None or is_keyed else _of_track(frame, person, others))
        if theirs is not None:
            if is_keyed:
                theirs.setdefault("track_id", KEY)
            joined = ",".join(f"{ours}={name}" for ours, name in theirs.items())
            where = "--format json" if path is None else f"--persons {shlex.quote(path)}"
            if "track_id" not in theirs and path is not None and (told := _told_apart(path, others)) is not None:
                joined = joined.replace(",", f",track_id={told},", 1)
            note = "" if "ts" in theirs else " --fps 25 --start 2026-11-09T08:00"
            note += note_on_place(theirs) if {"left", "x_m"} & theirs.keys() else ""
            if "right" in theirs and "xyxy" not in theirs["left"] and theirs["left"].endswith(".0"):
                note = f"   (corners; if the last two are sizes: width={theirs['right']},height={theirs['bottom']})"
            return f"{where} --map {shlex.quote(joined) if '$' in joined else joined}{note}"
    return None


def _guess_of_keys(message: Mapping[str, Any], others: list[dict[str, Any]]) -> str | None:
    """Return the options for frames whose keys are their times or numbers: an object of them, or one inside."""
    inside = ((name, value) for name, value in message.items() if isinstance(value, dict) and _PLAIN.fullmatch(name))
    for front, frames in (("", message), *inside):
        keys, entry = list(frames), next(iter(frames.values()), None)
        is_number = all(key.isdecimal() and len(key) < 20 for key in keys)
        if len(keys) < 2 or not (is_number or all(map(_TIME_KEY.match, keys))):
            continue
        people: Any = entry
        path, more = f"{front}.*".lstrip("."), {}
        if isinstance(entry, dict) and (inner := next(_lists(entry, entry), None)) is not None:
            path, people = f"{path}.{inner[0]}", [inner[1]]
        elif isinstance(entry, dict) and all(isinstance(p, dict) for p in entry.values()):
            people, more = list(entry.values()), {"track_id": KEY}
        person = next((p for p in people if isinstance(p, dict)), None) if isinstance(people, list) else None
        time = {"frame" if is_number and len(keys[0]) < _UNIX_DIGITS else "ts": KEY}
        if person is not None and (theirs := _of_person(person, others)) is not None:
            note = " --fps 25 --start 2026-11-09T08:00" if "frame" in time else ""
            joined = ",".join(f"{ours}={name}" for ours, name in {**time, **more, **theirs}.items())
            return f"--persons {shlex.quote(path)} --map {joined}{note}{note_on_place(theirs)}"
    return None


def _of_track(
    frame: Mapping[str, Any], point: Mapping[str, Any], others: list[dict[str, Any]]
) -> dict[str, str] | None:
    """Return the mapping of timed points: the time is in each of them, and the id in what holds the list."""
    time = time_like([path for path, _ in leaves(point) if _PLAIN.fullmatch(path)])
    theirs = None if time is None else _of_person({k: v for k, v in point.items() if k != time}, others)
    if time is None or theirs is None:
        return None
    ids = [path for path in ids_like([p for p, _ in leaves(frame)]) if _PLAIN.fullmatch(path)]
    return {"ts": time, **({"track_id": ids[0]} if ids else {}), **theirs}


def _of_person(person: Mapping[str, Any], others: list[dict[str, Any]]) -> dict[str, str] | None:
    """Return the id and the place of a person; None where names say no place."""
    paths = [path for path, _ in leaves(person)]
    place = place_like(paths) or _by_last_part(paths) or _point(person) or _box(person, others)
    if not place or not all(map(_PLAIN.fullmatch, place.values())):
        return None
    ids = [path for path in ids_like(paths) if _PLAIN.fullmatch(path) and not _is_class(value_at(person, path))]
    return {**({"track_id": ids[0]} if ids else {}), **_from_upper_left(place, person)}


def _mapping(
    message: Mapping[str, Any], person: Mapping[str, Any], others: list[dict[str, Any]], fronts: tuple[str, ...]
) -> dict[str, str] | None:
    of_message, of_person = (
        [path for path, _ in leaves(thing) if not path.startswith((*fronts, _DOCUMENT))] for thing in (message, person)
    )
    if body := body_of(message):  # what a recorder notes around a message is neither its time nor its camera
        of_message = [p for p in of_message if p.startswith(f"{body}.")]
    time = time_like(of_message)
    place = place_like(of_person) or _by_last_part(of_person) or _point(person) or _box(person, others)
    frame = next((path for path in of_message if letters(path.rpartition(".")[2]) in _FRAMES), None)
    of_time = {"ts": time} if time is not None else {"frame": frame} if frame is not None else {}
    if not of_time or not place or not all(_PLAIN.fullmatch(path) for path in (*of_time.values(), *place.values())):
        return None
    cameras = [path for path in named_like(of_message, "camera") if _PLAIN.fullmatch(path)]
    ids = [path for path in ids_like(of_person) if _PLAIN.fullmatch(path) and not _is_class(value_at(person, path))]
    more = {**({"camera_id": cameras[0]} if cameras else {}), **({"track_id": ids[0]} if ids else {})}
    return {**of_time, **more, **_from_upper_left(place, person)}


def _is_class(value: Any) -> bool:
    return isinstance(value, str) and letters(value) in PERSON | OBJECTS


def _is_plain(path: str) -> bool:
    return _PLAIN.fullmatch(path.replace(".*", "")) is not None


def _told_apart(path: str, messages: list[dict[str, Any]]) -> str | None:
    """Return the whole number by which the people of each frame differ, where its name says nothing: as "n" may be."""
    frames = [people for message in messages if isinstance(people := value_at(message, path), list)]
    frames = [[p for p in people if isinstance(p, dict)] for people in frames]
    names = [n for n, v in frames[0][0].items() if type(v) is int] if frames and frames[0] else []
    several = [people for people in frames if len(people) > 1]
    fits = (n for n in names if several and all(len({str(p.get(n)) for p in f}) == len(f) for f in several))
    return next((n for n in fits if letters(n) not in _SIDES + _SIZES and _PLAIN.fullmatch(n)), None)


def _from_upper_left(place: dict[str, str], person: Mapping[str, Any]) -> dict[str, str]:
    """Return the sides of a box in their order, where the writer names the lower right corner first."""
    sides = [value_at(person, place[side]) for side in _SIDES if side in place]
    if len(sides) == len(_SIDES) and _are_numbers(sides, 4) and sides[0] > sides[2] and sides[1] > sides[3]:
        return dict(zip(_SIDES, (place[side] for side in ("right", "bottom", "left", "top")), strict=True))
    return place


def _by_last_part(paths: list[str]) -> dict[str, str]:
    by_name = {path.rpartition(".")[2]: path for path in reversed(paths)}
    return {ours: by_name[name] for ours, name in place_like(by_name).items()}


def _point(person: Mapping[str, Any]) -> dict[str, str]:
    """Return the place that a list of two or three numbers holds, such as `"pos": [1.2, 3.4]`."""
    for name, value in person.items():
        is_numbers = isinstance(value, list) and all(isinstance(v, int | float) for v in value)
        if is_numbers and len(value) in (2, 3) and letters(name) in POINTS:
            return {"x_m": f"{name}.0", "y_m": f"{name}.1"}
    return {}


def _box(person: Mapping[str, Any], others: list[dict[str, Any]]) -> dict[str, str]:
    """Return the box that a list of four numbers holds, or of two corners, such as `"bbox": [10, 20, 60, 180]`.

    Where its name does not say whether the last two numbers are a corner or sizes, all lists of that name decide: a
    corner is below and right of the other one in each of them.
    """
    for path, value in _listed(person):
        name = letters(path.rpartition(".")[2])
        each = [f"{path}.{i}" for i in range(4)]
        if _are_numbers(value, 4):
            ours = next((what for end, what in _BOXES if name.endswith(end)), None)
            if ours is None and is_whole_box(name):
                alike = [v for m in others for p, v in _listed(m) if p.rpartition(".")[2] == path.rpartition(".")[2]]
                fours = [v for v in alike if _are_numbers(v, 4)]
                ours = _SIDES if all(v[2] > v[0] and v[3] > v[1] for v in fours) else _SIZES
            if ours is not None:
                return dict(zip(ours, each, strict=True))
        elif is_whole_box(name) and len(value) == 2 and all(_are_numbers(corner, 2) for corner in value):
            return dict(zip(_SIDES, (f"{path}.{i}.{j}" for i in (0, 1) for j in (0, 1)), strict=True))
    return {}


def _are_numbers(value: Any, n: int) -> bool:
    return isinstance(value, list) and len(value) == n and all(type(v) in (int, float) for v in value)


def _listed(thing: Any, front: str = "", depth: int = 0) -> Iterator[tuple[str, list[Any]]]:
    """Yield path and value of each list that holds no objects, also inside objects and lists of objects."""
    if isinstance(thing, dict) and depth <= _DEPTH:
        for name, value in thing.items():
            yield from _listed(value, f"{front}.{name}".lstrip("."), depth + 1)
    elif isinstance(thing, list) and any(isinstance(v, dict) for v in thing):
        for value in thing:
            yield from _listed(value, front, depth + 1)
    elif isinstance(thing, list):
        yield front, thing


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


def _lists(
    thing: Mapping[str, Any], frame: Mapping[str, Any], front: str = "", depth: int = 0
) -> Iterator[tuple[str, dict[str, Any], Mapping[str, Any]]]:
    """Yield the path of each list of objects, its first object, and the frame that it is of; lists of frames too."""
    for name, value in thing.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            yield f"{front}{name}", value[0], frame
            if depth < _DEPTH:
                yield from _lists(value[0], value[0], f"{front}{name}.*.", depth + 1)
        elif isinstance(value, dict) and depth < _DEPTH:
            yield from _lists(value, frame, f"{front}{name}.", depth + 1)
