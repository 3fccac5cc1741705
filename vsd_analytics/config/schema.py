"""The JSON Schema of `vsd.toml`, by which editors complete it: made from the readers and the table of settings.

The readers remember every key that they look at and what it may be. They are run here on a file in which each table is
there and empty, so that the schema knows a key as soon as a reader does. `make docs` writes it to `vsd.schema.json`.
"""

from __future__ import annotations

import tomllib
from datetime import date, time
from pathlib import Path
from typing import Any, Final

from vsd_analytics.config.project import FILE, read_site
from vsd_analytics.config.reader import EXAMPLE, Form, Mistakes, TableReader
from vsd_analytics.config.toml_lines import TomlText
from vsd_analytics.settings import SETTINGS

SCHEMA_FILE: Final = Path(__file__).parent / "vsd.schema.json"

_EVERY_TABLE: Final[dict[str, Any]] = {
    **{name: {} for name in ("site", "mqtt", "mail", "engine", "exchange")},
    **{name: [{}] for name in ("floor", "camera", "area", "fixture", "line", "alarm", "source", "event", "opening")},
}
"""The tables that readers pass over when they are absent. Those of settings are always read."""

_NEEDED: Final = ("site", "camera")


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of `vsd.toml`.

    It knows keys, types, ranges, needed keys and defaults. What takes several keys, a file or a date to judge, it
    accepts.
    """
    root = TableReader(_EVERY_TABLE, path=(), label=FILE, mistakes=Mistakes(TomlText(FILE, "")), folder=Path())
    read_site(root, environ={})
    schema = _of_table(root)
    for setting in SETTINGS:
        unit = f" Unit: {setting.unit}." if setting.unit else ""
        default = list(setting.default) if isinstance(setting.default, tuple) else setting.default
        known = schema["properties"][setting.section]["properties"][setting.name]
        known |= {"description": setting.help + unit, "default": default}
        known.pop("examples", None)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"{FILE} of vsd-analytics"}
    return {**head, **schema, "required": list(_NEEDED)}


def _of_table(table: TableReader) -> Form:
    """Return the schema of a table that was read while it was empty."""
    schema: Form = {
        "type": "object",
        "properties": {key: _of_value(form) for key, form in table.asked.items()},
        "additionalProperties": False,
    }
    if required := [keys[0] for keys in table.needed if len(keys) == 1]:
        schema["required"] = required
    if one_of := [keys for keys in table.needed if len(keys) > 1]:
        schema["allOf"] = [{"anyOf": [{"required": [key]} for key in keys]} for keys in one_of]
    return schema


def _of_value(form: Form | TableReader | list[TableReader]) -> Form:
    match form:
        case TableReader():
            return _of_table(form)
        case [reader]:
            return {"type": "array", "items": _of_table(reader)}
        case dict() if form:
            known = {key: value for key, value in form.items() if key != EXAMPLE}
            example = {"examples": [as_json(tomllib.loads(f"v = {form[EXAMPLE]}")["v"])]} if EXAMPLE in form else {}
            return known | example
    raise ValueError("a reader asks for a key without saying what it may be")


def as_json(value: Any) -> Any:
    """Return a value of TOML as a JSON Schema knows it: dates and times are texts."""
    match value:
        case dict():
            return {key: as_json(v) for key, v in value.items()}
        case list():
            return [as_json(v) for v in value]
        case date() | time():
            return value.isoformat()
    return value
