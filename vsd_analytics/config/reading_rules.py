"""The part of `vsd.toml` that says how files are read: `[[source]]`, and writing one more of them."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any

from vsd_analytics.config import camera_in_name
from vsd_analytics.config.broker_and_alarms import read_topics
from vsd_analytics.config.file_columns import MAP_COLUMNS, METRES, PLACES
from vsd_analytics.config.reader import Form, TableReader
from vsd_analytics.config.row_filter import EXAMPLE, FilterError, parse_filter
from vsd_analytics.config.values import parse_picture_px, zone
from vsd_analytics.errors import nearest
from vsd_analytics.site.model import Camera, ReadingRule

_FILES: Form = {
    "anyOf": [
        {"type": "string", "minLength": 1},
        {"type": "array", "items": {"type": "string", "minLength": 1}, "minItems": 1},
    ]
}
_MAP: Form = {
    "properties": {name: {"type": "string", "minLength": 1} for name in MAP_COLUMNS},
    "additionalProperties": False,
}
_SIZE: Form = {"type": "array", "items": {"type": "integer", "minimum": 1}, "minItems": 2, "maxItems": 2}
_DIRECTIVES = frozenset("aAbBcdDeFfgGHIjklmMnpPrRsSTtuUVwWxXyYzZ%")
_DAYS = frozenset("djxcsDFe")


def read_sources(root: TableReader, *, cameras: Collection[Camera]) -> tuple[ReadingRule, ...]:
    """Return the profiles of `[[source]]`, in the order of the file."""
    names = {name for c in cameras for name in (c.camera_id, *c.engine_ids)}
    rules: dict[str, ReadingRule] = {}
    for table in root.each("source"):
        rule_id = table.id("id", example='"tills"')
        if rule_id in rules:
            table.fault("id", f"two sources have the id {rule_id!r}", code="E125", fix="give one of them another id")
        _check_mapping(table)
        size = table.parsed("size", example="[1280, 720]", parse=parse_picture_px, form=_SIZE)
        profile = ReadingRule(
            rule_id=rule_id or "",
            files=_files(table),
            format=table.text("format", example='"table"'),
            camera=_camera(table, names),
            camera_from_name=_camera_from_name(table),
            columns=table.texts("columns", example='["ts", "track_id", "x_m", "y_m"]') or None,
            map=_map(table),
            unit=table.word("unit", tuple(METRES), example="mm"),
            zone=zone(table, "zone"),
            time_format=_time_format(table),
            where=_where(table),
            size_px=size,
            period_s=table.number("period_s", minimum=0.001, maximum=86_400, unit="seconds", example="1.0"),
            fps=table.number("fps", minimum=0.001, maximum=10_000, unit="frames per second", example="25"),
            engine=table.text("engine", example='"acme 2.1"'),
            persons=table.text("persons", example='"data.people"'),
            no_list_is_nobody=table.flag("no_list_is_nobody"),
            topics=read_topics(table, example='["acme/+/people"]'),
        )
        table.close()
        if rule_id is not None:
            rules[rule_id] = profile
    return tuple(rules.values())


def reading_rule_of(name: str, profiles: Collection[ReadingRule]) -> ReadingRule | None:
    """Return the first profile whose patterns fit a path, or None.

    Args:
        name: Path as given. A pattern without a slash is compared with its last part.
        profiles: In the order of `vsd.toml`.
    """
    path = PurePosixPath(name)
    return next((p for p in profiles if any(path.match(pattern) for pattern in p.files)), None)


@dataclass(frozen=True, slots=True)
class NewReadingRule:
    """A `[[source]]` to be written.

    Attributes:
        rule_id: Its id.
        file_name: Name of a file of its kind; runs of digits in it become `*`.
        values: Further keys; None = left out.
        files: Patterns of file names, where they are not made of `file_name`.
    """

    rule_id: str
    file_name: str
    values: dict[str, Any] = field(default_factory=dict)
    files: tuple[str, ...] = ()

    @property
    def pattern(self) -> str:
        """Return the pattern of files of its kind: `till-2026-11-09.csv` gives `till-*.csv`."""
        literal = re.sub(r"([\[*?])", r"[\1]", self.file_name)
        return re.sub(r"\d+(?:[-_.:T ]\d+)*", "*", literal)

    @property
    def wider_pattern(self) -> str | None:
        """Return the pattern that also fits `shop-2.csv` where `shop.csv` has no number; None = `pattern` fits it."""
        if re.search(r"\d", self.file_name):
            return None
        front, dot, back = self.pattern.partition(".")
        return f"{front}*{dot}{back}"

    def text(self) -> str:
        """Return the lines of `vsd.toml`."""
        files = (self.files[0] if len(self.files) == 1 else self.files) or self.pattern
        keys = {"id": self.rule_id, "files": files, **self.values}
        return "\n".join(["[[source]]", *(f"{k} = {_toml(v)}" for k, v in keys.items() if v is not None)]) + "\n"


def _toml(value: Any) -> str:
    match value:
        case dict():
            return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
        case tuple() | list():
            return "[" + ", ".join(map(_toml, value)) + "]"
        case str():
            return json.dumps(value, ensure_ascii=False)
    return repr(value)


def _files(table: TableReader) -> tuple[str, ...]:
    example = '"till-*.csv"'
    value = table.raw("files", _FILES, example=example)
    if value is None and {"topics", "persons"} & set(table.values):
        return ()  # messages have no file names
    if value is None:
        why = "a source says by file names which files it is for, or by topics or persons that it reads messages"
        table.missing("files", example, why=why, instead=("topics", "persons"))
        return ()
    patterns = [value] if isinstance(value, str) else value
    if not (isinstance(patterns, list) and patterns and all(isinstance(p, str) and p.strip() for p in patterns)):
        table.wrong_type("files", "a pattern of file names, or a list of them", example)
        return ()
    for pattern in patterns:
        if not PurePosixPath(pattern).parts or "**" in pattern:
            fix = f"write it as: files = {example}"
            table.fault("files", f"{table.label} files: {pattern!r} is no pattern of file names", fix=fix)
    return tuple(p for p in patterns if PurePosixPath(p).parts)


def _camera(table: TableReader, names: Collection[str]) -> str | None:
    value = table.text("camera", example='"cam-1"')
    if value is None or value in names:
        return value
    close = next(iter(difflib.get_close_matches(value, sorted(names), n=1)), None)
    what, instead = f"camera: there is no [[camera]] {value!r}", "name a camera of this file, or add a [[camera]]"
    table.unknown("camera", what, close, instead=instead)
    return None


def _camera_from_name(table: TableReader) -> str | None:
    example = f'"{camera_in_name.EXAMPLE}"'
    value = table.text("camera_from_name", example=example)
    if value is None:
        return None
    why = camera_in_name.fault_of(value)
    if why is None and "camera" in table.values:
        why = "camera says it already"
    if why is None and "files" not in table.values:
        why = "messages have no file names: say files, or map camera_id"
    if why is None:
        return value
    what = f"{table.label} camera_from_name {value!r} cannot be used"
    table.fault("camera_from_name", what, why=why, fix=f"write it as: camera_from_name = {example}")
    return None


def _map(table: TableReader) -> dict[str, str]:
    columns = {}
    for ours, theirs in table.table("map", example='{ ts = "time", x_m = "X" }', form=_MAP).items():
        if ours not in MAP_COLUMNS:
            close = nearest(ours, MAP_COLUMNS)
            table.fault(
                "map",
                f"{table.label} map: no column of ours is called {ours!r}",
                code="E122",
                note=f"did you mean {close}?" if close else None,
                fix=f"ours are {', '.join(MAP_COLUMNS)}",
            )
        elif not isinstance(theirs, str) or not theirs.strip():
            fix = f'{ours} = "their name"'
            table.fault("map", f"{table.label} map: {ours} must be a column name in quotes", fix=fix)
        else:
            columns[ours] = theirs
    return columns


def _check_mapping(table: TableReader) -> None:
    """Report a JSON mapping that lacks the time or the place: no message could be read by it."""
    if "persons" not in table.values and table.values.get("format") != "json":
        return
    named = table.values.get("map")
    ours = set(named) if isinstance(named, dict) else set()
    if not {"ts", "frame"} & ours or not any(set(place) <= ours for place in PLACES):
        table.missing(
            "map",
            '{ ts = "time", track_id = "id", x_m = "pos.x", y_m = "pos.y" }',
            why="JSON messages are read by paths: one of ts, and those of a place",
        )


def _time_format(table: TableReader) -> str | None:
    example = '"%d/%m/%Y %H:%M:%S"'
    value = table.text("time_format", example=example)
    if value is None:
        return None
    if value in ("s", "ms", "us", "ns"):  # times counted from --start
        return value
    directives = re.findall(r"%(.?)", value)
    if not set(directives) <= _DIRECTIVES or not _DAYS & set(directives):
        table.refuse("time_format", f"{value!r} is no format of a date and time", example)
        return None
    return value


def _where(table: TableReader) -> str | None:
    value = table.text("where", example=json.dumps(EXAMPLE))
    if value is None:
        return None
    try:
        parse_filter(value)
    except FilterError as error:
        fix = f"write it as: where = {json.dumps(EXAMPLE)}" if error.fix is None else f"write {error.fix}"
        table.fault("where", f"{table.label} where {value!r} is not understood", why=str(error), fix=fix)
        return None
    return value
