"""The frames of a JSON message, by paths that say where the persons are, and where each value is."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final

from vsd_analytics.config.file_columns import METRES, PLACES
from vsd_analytics.config.row_filter import RowCondition
from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.ingest.reading.instants import offset_in_name
from vsd_analytics.ingest.reading.json_values import KEY, value_at
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.units import LENGTHS, unit_in_name
from vsd_analytics.ingest.reading.where import parse_where

_KEYS_MAX: Final = 10
_KEY_CHARS: Final = 40
_EVERY: Final = re.compile(r"(?:^|\.)\*(?:\.|$)")


@dataclass(frozen=True, slots=True)
class MessagePaths:
    """Where the values of a message are.

    Attributes:
        persons: Path of the list of persons; None = the message is one.
        theirs: Paths by our column names.
        units: Unit of each column in metres that is not in metres.
        where: Comparisons that a person must fulfil.
    """

    persons: str | None
    theirs: Mapping[str, str]
    units: Mapping[str, str]
    where: tuple[RowCondition, ...]

    @property
    def offset_ms(self) -> int | None:
        """Return how far ahead of UTC the name of the time says that it is; None = it says nothing."""
        return offset_in_name(self.theirs.get("ts", "").rpartition(".")[2])


def message_paths(options: IngestOptions) -> MessagePaths:
    """Return where values are, as the user states it.

    Raises:
        UsageError: E101, the mapping lacks the time or the place, or names a unit that the user contradicts.
    """
    theirs = {ours: path for ours, path in options.map.items() if ours not in ("track_a", "track_b")}
    if not {"ts", "frame"} & theirs.keys() or not any(set(place) <= set(theirs) for place in PLACES):
        lacking = "a place" if {"ts", "frame"} & theirs.keys() else "ts"
        raise UsageError(
            f"the mapping of JSON messages does not say where {lacking} is",
            why=f"it names {', '.join(theirs) or 'nothing'}",
            fix="--persons data.people --map ts=time,track_id=id,x_m=pos.x,y_m=pos.y",
        )
    if "ts" not in theirs and (options.fps is None or options.start is None):
        raise UsageError(
            "the mapping of JSON messages names frame numbers and no time",
            code="E207",
            why="a frame number becomes a time only with the frame rate and the time of the first frame",
            fix="add --fps 25 --start 2026-11-09T08:00:00+01:00",
        )
    units: dict[str, str] = {}
    for ours in (c for c in LENGTHS if c in theirs):
        stated = unit_in_name(theirs[ours].rpartition(".")[2]) if theirs[ours] != ours else None
        unit = stated if stated in METRES and stated != "m" else options.unit or "m"
        if options.unit not in (None, unit):
            raise UsageError(f"--unit {options.unit} contradicts {theirs[ours]!r}, which says {unit}")
        if unit != "m":
            units[ours] = unit
    where = () if options.where is None else parse_where(options.where)
    return MessagePaths(options.persons, theirs, units, where)


@dataclass(frozen=True, slots=True)
class JsonFrame:
    """One frame of a message.

    Attributes:
        message: The message.
        entry: The entry of its list of frames; the message itself where it is one frame.
        key: Key of the entry in an object of frames; None in a list.
        persons: Key and values of each person.
    """

    message: Mapping[str, Any]
    entry: Any
    key: str | None
    persons: Sequence[tuple[str | None, Any]]

    def value(self, person: Any, path: str) -> Any:
        """Return what a person has at a path, else what its frame or its message has there."""
        return next((v for t in (person, self.entry, self.message) if (v := value_at(t, path)) is not None), None)

    def outer(self, path: str) -> Any:
        """Return what the frame has at a path, else what the message has there; the key of the frame for `@key`."""
        if path == KEY:
            return self.key
        return next((v for t in (self.entry, self.message) if (v := value_at(t, path)) is not None), None)


def json_frames(message: Mapping[str, Any], paths: MessagePaths, options: IngestOptions) -> Iterator[JsonFrame]:
    """Yield the frames of a message.

    Raises:
        BadRowError: There is no list: that nobody was seen is an empty one.
    """
    if paths.persons is None:
        yield JsonFrame(message, message, None, [(None, message)])
        return
    *fronts, rest = _EVERY.split(paths.persons)
    entries: list[tuple[str | None, Any]] = [(None, message)]
    for front in fronts:
        entries = [inner for _, thing in entries for inner in _entries(thing, front, paths.persons)]
    bad: BadRowError | None = None
    for key, entry in entries:
        persons = value_at(entry, rest) if rest else entry
        if persons is None and options.no_list_is_nobody:
            yield JsonFrame(message, entry, key, [])
        elif not isinstance(persons, dict | list):
            bad = bad or BadRowError(
                "bad-message", _no_list(entry if rest else message, rest or paths.persons, persons)
            )
        elif any(not isinstance(p, dict | list) for p in (persons.values() if isinstance(persons, dict) else persons)):
            detail = f"a person at {paths.persons[:80]!r} is neither an object nor a list"
            bad = bad or BadRowError("bad-message", detail)
        else:
            people = list(persons.items()) if isinstance(persons, dict) else [(None, person) for person in persons]
            yield JsonFrame(message, entry, key, people)
    if bad is not None:
        raise bad


def _entries(thing: Any, front: str, path: str) -> list[tuple[str | None, Any]]:
    """Return key and value of each entry of a list or object of frames."""
    entries = value_at(thing, front) if front else thing
    if isinstance(entries, dict):
        return list(entries.items())
    if isinstance(entries, list):
        return [(None, entry) for entry in entries]
    raise BadRowError("bad-message", f"there is no list of frames at {front[:80]!r}, which {path[:80]!r} goes through")


def passed_over(message: Mapping[str, Any], path: str) -> Iterator[str]:
    """Yield the beginning of a path that takes one entry of a list that has more."""
    names = path.split(".")
    for i, name in enumerate(names):
        if name.isdecimal():
            entries = value_at(message, ".".join(names[:i])) if i else None
            if isinstance(entries, list) and len(entries) > 1:
                yield ".".join(names[: i + 1])


def _no_list(message: Mapping[str, Any], path: str, value: Any) -> str:
    """Return what is at the path of the persons, or which keys there are where it ends."""
    thing: Any = message
    front, rest = "", path
    while isinstance(thing, dict) and rest not in thing:
        name, _, after = rest.partition(".")
        if name not in thing:
            keys = [_shown(key) for key in islice(thing, _KEYS_MAX)] + ["..."] * (len(thing) > _KEYS_MAX)
            there = f"its keys: {', '.join(keys)}" if keys else "it is empty"
            return f"{_shown(front) or 'the message'} has no key {rest[:80]!r}; {there}"
        thing, front, rest = thing[name], f"{front}.{name}".lstrip("."), after
    what = "null" if value is None else repr(str(value)[:40])
    return f"there is no list of persons at {path[:80]!r}, but {what}"


def _shown(key: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in key[:_KEY_CHARS])
