"""JSON messages of any engine, by a mapping that says where the persons are, and where each value is.

A path is names with dots between, such as `meta.time`; a number is a place in a list, as in `box.2`. `persons` leads to
the list of persons of a frame (the values of an object count as a list; `@key` is then each one's key). A `*` in it
means every entry of a list or object of frames: `frames.*.people`; `@key` is then also the key of a frame. Without
`persons` a message is one person.

`ts`, `frame` and `camera_id` are looked for in the frame, then in the message, then in the person: one object for each
track, with a list of timed points, has them there. All other columns are looked for in the person, then in the frame
and the message.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime, timedelta, timezone
from functools import partial
from itertools import islice
from typing import Any, ClassVar, Final

import numpy as np

from vsd_analytics.config.file_columns import METRES, PLACES
from vsd_analytics.config.row_filter import RowCondition
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Source
from vsd_analytics.ingest.reading.column_hints import Role, named_like
from vsd_analytics.ingest.reading.columns import ColumnPlan, no_compared_column
from vsd_analytics.ingest.reading.elapsed import elapsed_ms, unit_ms
from vsd_analytics.ingest.reading.frame_rows import FrameRows, SeenPerson, finite, id_of, instant_of, size_of
from vsd_analytics.ingest.reading.instants import formatted_instant, frame_ms, ms_of_unix
from vsd_analytics.ingest.reading.json_frames import JsonFrame, MessagePaths, json_frames, message_paths, passed_over
from vsd_analytics.ingest.reading.json_messages import JsonMessages, messages
from vsd_analytics.ingest.reading.json_values import KEY, leaves, value_at
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.table_file import Header
from vsd_analytics.ingest.reading.table_head import BOX_SIDES, VALUES_MAX, BoxCounts, TableHead
from vsd_analytics.ingest.reading.table_rows import LEFT_OUT
from vsd_analytics.ingest.reading.where import OPERATORS

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_HEAD_MESSAGES: Final = 500
_TELLING: Final[tuple[Role, ...]] = ("camera", "id", "class", "confidence", "absent", "state", "storey", "file")
_LAST_NUMBER: Final = re.compile(r"(\d+)(?:\.[A-Za-z]\w*)?$")
"""The number of a frame in its key, such as `hall/000123.jpg`."""


class JsonMap(JsonMessages):
    """Adapter of JSON messages that are read by a mapping."""

    name: ClassVar = "json"
    coordinates: ClassVar = "floor metres or image pixels, as the mapping says"
    engine: ClassVar = "json"
    marks: ClassVar = ()
    uses: ClassVar = JsonMessages.uses | {
        *("map", "persons", "where", "unit", "time_format", "fps", "start", "first_frame", "size_px"),
        "no_list_is_nobody",
    }

    def detects(self, source: Source) -> bool:
        """Return False: no file says by itself where its values are."""
        return False

    def check(self, options: IngestOptions) -> None:
        """Raise UsageError (E101) when the mapping lacks the time or the place."""
        message_paths(options)

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the messages; see `JsonMessages.read`.

        Raises:
            InputError: E203, the filter compares a value that no person of the first messages has.
        """
        _check_filter(source, message_paths(options), options)
        yield from super().read(source, options)

    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add the frames of one message: the persons that the mapping finds in it."""
        paths = message_paths(options)
        bad: BadRowError | None = None
        for frame in json_frames(message, paths, options):
            try:
                _take_frame(frame, paths, frames, options, number)
            except BadRowError as error:  # the other frames of a message count
                bad = bad or error
        if bad is not None:
            raise bad

    def head(self, source: Source, options: IngestOptions) -> TableHead:
        """Return how the paths are read, and what the values that nobody mapped hold in the first messages."""
        paths = message_paths(options)
        read = {*paths.theirs.values(), *(c.column for c in paths.where)}
        values: dict[str, Counter[str]] = {}
        filtered: dict[str, Counter[str]] = {c.column: Counter() for c in paths.where}
        entered: set[str] = set()
        boxes = BoxCounts()
        for message in _first(source, options):
            if paths.persons is not None:
                entered.update(passed_over(message, paths.persons))
            try:
                seen = list(json_frames(message, paths, options))
            except BadRowError:
                continue
            things = [message, *(f.entry for f in seen if f.entry is not message)] if paths.persons is not None else []
            people = [
                p for f in seen for _, p in f.persons if all(_holds(c, f.value(p, c.column)) for c in paths.where)
            ]
            for path, value in (leaf for thing in (*things, *people) for leaf in leaves(thing)):
                if path not in read and not path.startswith(f"{paths.persons}."):
                    _count(values.setdefault(path, Counter()), value)
            for frame in seen:
                boxes.add(_sides(paths, frame))
                for _, person in frame.persons:
                    for name, counter in filtered.items():
                        if (value := frame.value(person, name)) is not None:
                            _count(counter, value)
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
        return TableHead(plan, list(values), telling, filtered=filtered, boxes=boxes, passed_over=sorted(entered))


def _sides(paths: MessagePaths, frame: JsonFrame) -> dict[str, np.ndarray]:
    """Return the sides of the boxes of a frame, by our names; what is no number is NaN."""

    def side(person: Any, ours: str) -> float:
        try:
            return finite(frame.value(person, paths.theirs[ours]))
        except BadRowError:
            return math.nan

    return {o: np.array([side(p, o) for _, p in frame.persons]) for o in BOX_SIDES if o in paths.theirs}


def _count(counter: Counter[str], value: Any) -> None:
    if len(counter) < VALUES_MAX:
        counter[str(value)[:80]] += 1


def _first(source: Source, options: IngestOptions) -> Iterator[dict[str, Any]]:
    return (m for _, m, _, _ in islice(messages(source, options), _HEAD_MESSAGES) if m is not None)


def _check_filter(source: Source, paths: MessagePaths, options: IngestOptions) -> None:
    """Raise InputError (E203) where the filter compares a value that the first messages have nowhere."""
    lacking, names = {c.column for c in paths.where}, dict[str, None]()
    n_people = 0
    for message in _first(source, options) if lacking else ():
        try:
            seen = list(json_frames(message, paths, options))
        except BadRowError:
            continue
        for frame in seen:
            for _, person in frame.persons:
                n_people += 1
                lacking = {name for name in lacking if frame.value(person, name) is None}
                names.update(dict.fromkeys(path for path, _ in leaves(person)))
        names.update(dict.fromkeys(path for path, _ in leaves(message)))
        if not lacking:
            return
    if lacking and n_people:
        raise no_compared_column(source, min(lacking), Header(list(names)))


def _take_frame(frame: JsonFrame, paths: MessagePaths, frames: FrameRows, options: IngestOptions, number: int) -> None:
    chosen = [(k, p) for k, p in frame.persons if all(_holds(c, frame.value(p, c.column)) for c in paths.where)]
    if n_out := len(frame.persons) - len(chosen):
        frames.dropped[LEFT_OUT] += n_out
    lacking = next((c.column for c in paths.where if frame.persons and _is_nowhere(frame, c.column)), None)
    if lacking is not None:
        detail = f"no person of the frame has {lacking[:80]!r}, which where compares: it is not known who is a person"
        raise BadRowError("bad-message", detail)
    camera_path, time_path = paths.theirs.get("camera_id"), paths.theirs.get("ts", paths.theirs.get("frame", ""))
    is_one_each = paths.persons is None or (bool(frame.persons) and frame.outer(time_path) is None)
    if not is_one_each and frame.persons and not chosen and _is_of_message(frame, paths):
        return  # the whole message is of another kind, and says nothing of people
    if not is_one_each:
        camera = None if camera_path is None else id_of(frame.outer(camera_path))
        seen = [frames.person(partial(_seen, paths, frame, k, p, options, camera)) for k, p in chosen]
        frames.add(camera, _instant(frame.outer(time_path), paths, options), seen, line=number)
        return
    for key, person in chosen:  # each person has a time, and nobody says when nobody was seen
        camera = None if camera_path is None else id_of(frame.value(person, camera_path))
        seen_person = frames.person(partial(_seen, paths, frame, key, person, options, camera))
        at = _instant(frame.value(person, time_path), paths, options)
        frames.add(camera, at, [seen_person], line=number, is_frame=False)


def _is_nowhere(frame: JsonFrame, path: str) -> bool:
    return all(frame.value(person, path) is None for _, person in frame.persons)


def _is_of_message(frame: JsonFrame, paths: MessagePaths) -> bool:
    """Return whether a comparison that fails looks at the message or the frame, and not at persons."""
    return any(
        all(value_at(p, c.column) is None for _, p in frame.persons) and not _holds(c, frame.outer(c.column))
        for c in paths.where
    )


def _seen(
    paths: MessagePaths, frame: JsonFrame, key: str | None, person: Any, options: IngestOptions, camera: str | None
) -> SeenPerson:
    def number(ours: str) -> float:
        return finite(frame.value(person, paths.theirs[ours]))

    track_path = paths.theirs.get("track_id")
    track = key if track_path == KEY else None if track_path is None else frame.value(person, track_path)
    floor = None
    if "x_m" in paths.theirs:
        x, y = (number(c) * METRES[paths.units.get(c, "m")] for c in ("x_m", "y_m"))
        floor = x, y
    tag_path = paths.theirs.get("tag")
    tag = None if tag_path is None else frame.value(person, tag_path)
    return SeenPerson(id_of(track), floor, _foot_px(paths, number, options, camera), options.is_staff(tag))


def _foot_px(
    paths: MessagePaths, number: Callable[[str], float], options: IngestOptions, camera: str | None
) -> tuple[float, float] | None:
    """Return the foot point in the picture: as it is sent, or the middle of the lower edge of the box."""
    place = next((p for p in PLACES[1:] if set(p) <= set(paths.theirs)), None)
    if place is None:
        return None
    box = {name: number(name) for name in place}
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


def _instant(value: Any, paths: MessagePaths, options: IngestOptions) -> datetime:
    """Return a time: unix seconds to nanoseconds, also as text, ISO 8601, as the user says, or from a frame number."""
    if "ts" not in paths.theirs:
        return _of_frame_number(value, options)
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise BadRowError("no-time" if value is None else "not-a-time", f"{str(value)[:40]!r} is no time")
    if options.start is not None:
        ms = elapsed_ms(value, unit_ms(options.time_format, paths.theirs["ts"]))
        if ms is None:
            raise BadRowError("not-a-time", f"{str(value)[:40]!r} is no time since --start")
        return _at(options.start + ms)
    at = _absolute(value, options.time_format)
    if at.tzinfo is None and paths.offset_ms is not None:
        return at.replace(tzinfo=timezone(timedelta(milliseconds=paths.offset_ms)))
    return at


def _of_frame_number(value: Any, options: IngestOptions) -> datetime:
    if isinstance(value, str) and (last := _LAST_NUMBER.search(value.strip())) is not None:
        value = last[1]
    ms = frame_ms(finite(value), first=options.first_frame or 0.0, fps=options.fps or 1.0, start_ms=options.start or 0)
    if ms is None:
        raise BadRowError("not-a-time", f"{str(value)[:40]!r} is no number of a frame")
    return _at(ms)


def _at(ms: float) -> datetime:
    try:
        return _EPOCH + timedelta(milliseconds=round(ms))
    except (ValueError, OverflowError):
        raise BadRowError("not-a-time", f"{ms:.0f} ms is beyond any calendar") from None


def _absolute(value: str | int | float, time_format: str | None) -> datetime:
    if isinstance(value, str) and time_format is not None:
        try:
            return formatted_instant(value, time_format)
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


def _holds(condition: RowCondition, value: Any) -> bool:
    """Return whether a comparison holds; for a missing value, and a text compared with a number, it does not."""
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
