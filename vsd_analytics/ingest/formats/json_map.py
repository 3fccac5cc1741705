"""JSON messages of any engine, by a mapping that says where the persons are, and where each value is.

A path is names with dots between, such as `meta.time`; a number is a place in a list, as in `box.2`. `persons` leads to
the list of persons of a message (the values of an object count as a list; `@key` is then each one's key). `ts` and
`camera_id` are paths of the message, all other columns paths of a person. Without `persons` a message is one person.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import islice
from typing import Any, ClassVar, Final

from vsd_analytics.config.file_columns import METRES, PLACES
from vsd_analytics.config.row_filter import RowCondition
from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.column_hints import Role, named_like
from vsd_analytics.ingest.reading.columns import ColumnPlan
from vsd_analytics.ingest.reading.frame_rows import FrameRows, SeenPerson, finite, id_of, instant_of, size_of
from vsd_analytics.ingest.reading.instants import ms_of_unix
from vsd_analytics.ingest.reading.json_messages import JsonMessages, messages
from vsd_analytics.ingest.reading.json_values import KEY, leaves, value_at
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.table_head import VALUES_MAX, TableHead
from vsd_analytics.ingest.reading.table_rows import LEFT_OUT
from vsd_analytics.ingest.reading.units import LENGTHS, unit_in_name
from vsd_analytics.ingest.reading.where import OPERATORS, parse_where

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_HEAD_MESSAGES: Final = 500
_KEYS_MAX: Final = 10
_KEY_CHARS: Final = 40
_TELLING: Final[tuple[Role, ...]] = ("camera", "id", "class", "confidence", "absent", "state", "storey", "file")


class JsonMap(JsonMessages):
    """Adapter of JSON messages that are read by a mapping."""

    name: ClassVar = "json"
    coordinates: ClassVar = "floor metres or image pixels, as the mapping says"
    engine: ClassVar = "json"
    marks: ClassVar = ()

    def detects(self, source: Source) -> bool:
        """Return False: no file says by itself where its values are."""
        return False

    def check(self, options: IngestOptions) -> None:
        """Raise UsageError (E101) when the mapping lacks the time or the place."""
        message_paths(options)

    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add one frame: the persons that the mapping finds in a message."""
        paths = message_paths(options)
        camera = id_of(paths.of(message, "camera_id"))
        at = _instant(paths.of(message, "ts"), options.time_format)
        persons = _persons(message, paths.persons)
        chosen = [(key, person) for key, person in persons if all(_holds(c, person) for c in paths.where)]
        seen = [frames.person(partial(_seen, paths, key, person, options, camera)) for key, person in chosen]
        frames.add(camera, at, seen, line=number)
        if len(persons) > len(chosen):
            frames.dropped[LEFT_OUT] += len(persons) - len(chosen)

    def head(self, source: Source, options: IngestOptions) -> TableHead:
        """Return how the paths are read, and what the values that nobody mapped hold in the first messages."""
        paths = message_paths(options)
        read = {*paths.theirs.values(), *(c.column for c in paths.where)}
        values: dict[str, Counter[str]] = {}
        passed_over: set[str] = set()
        for _, message, _, _ in islice(messages(source, options), _HEAD_MESSAGES):
            if message is None:
                continue
            if paths.persons is not None:
                passed_over.update(_passed_over(message, paths.persons))
            try:
                people = [person for _, person in _persons(message, paths.persons)]
            except BadRowError:
                continue
            of_message = [] if paths.persons is None else [message]
            for path, value in (leaf for thing in (*of_message, *people) for leaf in leaves(thing)):
                if path not in read and not path.startswith(f"{paths.persons}."):
                    counter = values.setdefault(path, Counter())
                    if len(counter) < VALUES_MAX:
                        counter[str(value)[:80]] += 1
        plan = ColumnPlan(
            "observations",
            {ours: i for i, ours in enumerate(paths.theirs)},
            paths.theirs,
            dict(paths.units),
            paths.where,
            {c.column: 0 for c in paths.where},
            options.time_format,
        )
        telling = {n: c for n, c in values.items() if any(named_like([n], role) for role in _TELLING)}
        return TableHead(plan, list(values), telling, passed_over=sorted(passed_over))


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

    def of(self, thing: Any, ours: str) -> Any:
        """Return the value of one of our columns, or None where it is missing or not mapped."""
        return value_at(thing, self.theirs[ours]) if ours in self.theirs else None


def message_paths(options: IngestOptions) -> MessagePaths:
    """Return where values are, as the user states it.

    Raises:
        UsageError: E101, the mapping lacks the time or the place, or names a unit that the user contradicts.
    """
    theirs = {ours: path for ours, path in options.map.items() if ours not in ("track_a", "track_b", "frame")}
    if "ts" not in theirs or not any(set(place) <= set(theirs) for place in PLACES):
        lacking = "ts" if "ts" not in theirs else "a place"
        raise UsageError(
            f"the mapping of JSON messages does not say where {lacking} is",
            why=f"it names {', '.join(theirs) or 'nothing'}",
            fix="--persons data.people --map ts=time,track_id=id,x_m=pos.x,y_m=pos.y",
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


def _persons(message: Mapping[str, Any], path: str | None) -> list[tuple[str | None, Any]]:
    """Return the key and the values of each person; a list has no keys.

    Raises:
        BadRowError: There is no list: that nobody was seen is an empty one.
    """
    if path is None:
        return [(None, message)]
    persons = value_at(message, path)
    if isinstance(persons, dict):
        people: list[tuple[str | None, Any]] = list(persons.items())
    elif isinstance(persons, list):
        people = [(None, person) for person in persons]
    else:
        raise BadRowError("bad-message", _no_list(message, path, persons))
    if any(not isinstance(person, dict | list) for _, person in people):
        raise BadRowError("bad-message", f"a person at {path[:80]!r} is neither an object nor a list")
    return people


def _passed_over(message: Mapping[str, Any], path: str) -> Iterator[str]:
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


def _seen(paths: MessagePaths, key: str | None, person: Any, options: IngestOptions, camera: str | None) -> SeenPerson:
    track = key if paths.theirs.get("track_id") == KEY else paths.of(person, "track_id")
    floor = None
    if "x_m" in paths.theirs:
        x, y = (finite(paths.of(person, c)) * METRES[paths.units.get(c, "m")] for c in ("x_m", "y_m"))
        floor = x, y
    return SeenPerson(id_of(track), floor, _foot_px(paths, person, options, camera))


def _foot_px(
    paths: MessagePaths, person: Any, options: IngestOptions, camera: str | None
) -> tuple[float, float] | None:
    """Return the foot point in the picture: as it is sent, or the middle of the lower edge of the box."""
    place = next((p for p in PLACES[1:] if set(p) <= set(paths.theirs)), None)
    if place is None:
        return None
    box = {name: finite(paths.of(person, name)) for name in place}
    if "u_px" in box:
        u, v = box["u_px"], box["v_px"]
    elif "center_x" in box:
        u, v = box["center_x"], box["center_y"] + abs(box["height"]) / 2
    else:
        right = box["right"] if "right" in box else box["left"] + box["width"]
        bottom = box["bottom"] if "bottom" in box else box["top"] + box["height"]
        across, down = right - box["left"], bottom - box["top"]
        if across < 0 or (across == 0 and down == 0):  # as in tables: sizes mapped as sides, or no box at all
            raise BadRowError("bad-box", f"the box {tuple(box.values())} is no box with a size"[:120])
        u, v = (box["left"] + right) / 2, max(box["top"], bottom)
    if options.size_px is not None:
        width, height = size_of(options, camera)
        return u * width, v * height
    return u, v


def _instant(value: Any, time_format: str | None) -> datetime:
    """Return a time: unix seconds to nanoseconds, also as text, ISO 8601, or as `time_format` says."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise BadRowError("no-time" if value is None else "not-a-time", f"{str(value)[:40]!r} is no time")
    if isinstance(value, str) and time_format is not None:
        try:
            return datetime.strptime(value.strip(), time_format)
        except ValueError:
            raise BadRowError("not-a-time", f"{value[:40]!r} is not written as {time_format}") from None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return instant_of(value)
    try:
        return _EPOCH + timedelta(milliseconds=ms_of_unix(number))
    except (ValueError, OverflowError):
        raise BadRowError("not-a-time", f"{str(value)[:40]!r} is no unix time") from None


def _holds(condition: RowCondition, person: Any) -> bool:
    """Return whether a comparison holds; for a missing value, and a text compared with a number, it does not."""
    value = value_at(person, condition.column)
    compare = OPERATORS[condition.sign]
    if isinstance(condition.value, float):
        try:
            return bool(compare(finite(value), condition.value))
        except BadRowError:
            return False
    if value is None or isinstance(value, dict | list):
        return False
    text = str(value).lower() if isinstance(value, bool) else str(value).strip()
    return bool(text) and bool(compare(text, condition.value))
