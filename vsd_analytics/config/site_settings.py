"""The settings of `vsd.toml` and of the environment, checked against `vsd_analytics.settings`; and `[engine]`."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from vsd_analytics.config.reader import Form, Mistakes, TableReader
from vsd_analytics.config.toml_lines import TomlText
from vsd_analytics.errors import ConfigError, Where
from vsd_analytics.settings import FORMER, SETTINGS, Setting
from vsd_analytics.site.model import EngineError

ENVIRONMENT_PREFIX = "VSD_"
OF_ENVIRONMENT = "environment variable"
"""What the place of a mistake begins with where it is not in the file."""
_ALIKE = 0.85
"""Share of equal letters from which a variable is a misspelt setting; other programs may have `VSD_` variables too."""


@dataclass
class Overrides:
    """What differs from the defaults.

    Attributes:
        values: New value by setting name.
        own: Those of the file alone, without the environment.
        sources: "vsd.toml line 7" or the environment variable, by setting name.
    """

    values: dict[str, Any] = field(default_factory=dict)
    own: dict[str, Any] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)


def read_settings(tables: Mapping[str, TableReader], *, environ: Mapping[str, str], mistakes: Mistakes) -> Overrides:
    """Return the settings given in the file, and those of the environment, which win.

    Args:
        tables: Reader of each section named in the settings table.
        environ: Environment in which `VSD_<SETTING>` overrides a setting.
        mistakes: Where to note.
    """
    overrides = Overrides()
    for setting in SETTINGS:
        table = tables[setting.section]
        value = _read(table, setting)
        if value is not None:
            overrides.values[setting.name] = overrides.own[setting.name] = value
            line = mistakes.text.where((setting.section, setting.name)).line
            overrides.sources[setting.name] = f"{mistakes.text.file} line {line}"
        variable = ENVIRONMENT_PREFIX + setting.name.upper()
        if variable in environ:
            value = _from_environment(setting, variable, environ[variable], mistakes)
            if value is not None:
                overrides.values[setting.name], overrides.sources[setting.name] = value, variable
    _check_former(tables["rule"], environ=environ, mistakes=mistakes)
    _check_misspelt(environ, mistakes)
    _check_together(overrides.values, tables)
    return overrides


def _check_former(rule: TableReader, *, environ: Mapping[str, str], mistakes: Mistakes) -> None:
    """Note a former setting that does not have the value that its constant has now."""
    for name, constant in FORMER.items():
        _constant(rule, name, constant)
        variable = ENVIRONMENT_PREFIX + name.upper()
        if variable in environ:
            reader, apart = _variable(name, variable, environ[variable])
            _constant(reader, name, constant)
            mistakes.take(apart.all)


def _check_misspelt(environ: Mapping[str, str], mistakes: Mistakes) -> None:
    """Note variables that are nearly the name of a setting: ignored, they would change nothing without a word."""
    known = [*(s.name for s in SETTINGS), *FORMER]
    names = {v: v.removeprefix(ENVIRONMENT_PREFIX).lower() for v in sorted(environ) if v.startswith(ENVIRONMENT_PREFIX)}
    for variable, name in names.items():
        near = difflib.get_close_matches(name, known, n=1, cutoff=_ALIKE)
        if near and name not in known:
            meant = ENVIRONMENT_PREFIX + near[0].upper()
            what = f"no setting is called {variable}"
            place = Where(f"{OF_ENVIRONMENT} {variable}")
            mistakes.take([ConfigError(what, code="E124", where=place, fix=f"rename it to {meant}, or unset it")])


def _constant(table: TableReader, name: str, constant: float) -> None:
    value = table.raw(name, {"const": constant, "deprecated": True})
    if value is not None and (isinstance(value, bool) or value != constant):
        table.fault(
            name,
            f"{table.label} {name} = {value} cannot be set: it is always {constant:g} metres",
            why="stored facts of every age lie in the same cells, so that weeks can be compared",
            fix=f"take the line {name} out",
        )


def _read(table: TableReader, setting: Setting) -> Any:
    default = setting.default
    if isinstance(default, bool):
        return table.flag(setting.name)
    if isinstance(default, str):
        return table.parsed(
            setting.name,
            example=f'"{default}"',
            parse=lambda value: _choice(value, setting),
            form={"enum": list(setting.choices)},
        )
    if default == ():
        return table.parsed(setting.name, example='["staff", "employee"]', parse=_classes, form=_CLASSES)
    assert setting.minimum is not None
    assert setting.maximum is not None
    if isinstance(default, tuple):
        return table.parsed(
            setting.name,
            example=str(list(default)),
            parse=lambda value: _steps(value, setting),
            form=_form_of_steps(setting),
        )
    value = table.number(
        setting.name,
        minimum=setting.minimum,
        maximum=setting.maximum,
        unit=setting.unit,
        example=str(default),
        whole=isinstance(default, int),
    )
    return None if value is None else type(default)(value)


def _from_environment(setting: Setting, variable: str, text: str, mistakes: Mistakes) -> Any:
    reader, apart = _variable(setting.name, variable, text)
    value = _read(reader, setting)
    for mistake in apart.all:  # written as a variable is, not as a line of the file
        mistake.what = mistake.what.replace(f"{variable} {setting.name} ", f"{variable} ", 1)
        mistake.fix = mistake.fix and mistake.fix.replace(f"{setting.name} = ", f"{variable}=", 1)
    mistakes.take(apart.all)
    return value


def _variable(name: str, variable: str, text: str) -> tuple[TableReader, Mistakes]:
    """Return a reader of an environment variable as a table with one key, and the mistakes it will note."""
    try:
        values = tomllib.loads(f"{name} = {text}")
    except tomllib.TOMLDecodeError:
        values = {name: text}
    apart = Mistakes(TomlText(f"{OF_ENVIRONMENT} {variable}", ""))
    return TableReader(values, path=(), label=variable, mistakes=apart, folder=Path()), apart


def _choice(value: Any, setting: Setting) -> str:
    """Return one of the words a setting may be."""
    if value not in setting.choices:
        raise ValueError(f"must be {' or '.join(setting.choices)}")
    return str(value)


_CLASSES: Final[Form] = {"type": "array", "items": {"type": "string", "minLength": 1}}


def _classes(value: Any) -> tuple[str, ...]:
    """Return names of classes in lower case, each once."""
    if not (isinstance(value, list) and all(isinstance(name, str) and name.strip() for name in value)):
        raise ValueError("must be a list of texts")
    return tuple(sorted({name.strip().lower() for name in value}))


def _form_of_steps(setting: Setting) -> Form:
    """Return the schema of a setting that is a list of numbers; that they must rise, no schema can say."""
    assert isinstance(setting.default, tuple)
    number, count = {"type": "number", "minimum": setting.minimum, "maximum": setting.maximum}, len(setting.default)
    return {"type": "array", "items": number, "minItems": count, "maxItems": count}


def _steps(value: Any, setting: Setting) -> tuple[float, ...]:
    """Return rising numbers within the setting's range, as many as its default has."""
    assert isinstance(setting.default, tuple)
    count, low, high = len(setting.default), setting.minimum or 0.0, setting.maximum or 0.0
    if not (isinstance(value, list) and len(value) == count and all(type(v) in (int, float) for v in value)):
        raise ValueError(f"must be a list of {count} numbers")
    if not all(low <= v <= high for v in value) or any(a >= b for a, b in pairwise(value)):
        raise ValueError(f"the numbers must rise and stay between {low:g} and {high:g}")
    return tuple(float(v) for v in value)


def _check_together(overrides: Mapping[str, Any], tables: Mapping[str, TableReader]) -> None:
    """Note settings that are fine alone and impossible together."""
    value = {s.name: overrides.get(s.name, s.default) for s in SETTINGS}
    if value["pair_max_m"] < value["distance_m"]:
        in_rule = "pair_max_m" in tables["rule"].values
        tables["rule" if in_rule else "site"].fault(
            "pair_max_m" if in_rule else "distance_m",
            f"pair_max_m = {value['pair_max_m']:g} is less than distance_m = {value['distance_m']:g}",
            why="pairs farther apart than pair_max_m are not kept, so violations would be lost",
            fix=f"[rule] pair_max_m = {value['distance_m'] + 0.5:g}",
        )
    if value["partial_hour_share"] > value["full_hour_share"]:
        key = "partial_hour_share" if "partial_hour_share" in tables["rule"].values else "full_hour_share"
        tables["rule"].fault(
            key, "partial_hour_share is more than full_hour_share", fix="give the partial hour the smaller share"
        )


_SHARES = {"precision": "0.9", "recall": "0.85"}
_SHARE_MIN, _SD_MIN_M, _SD_MAX_M = 0.01, 0.001, 5.0


def read_engine(root: TableReader) -> EngineError | None:
    """Return what `[engine]` states, or None when there is no such table or nothing in it."""
    if root.raw("engine") is None:
        return None
    table = root.inner("engine")
    precision, recall = (
        table.number(key, minimum=_SHARE_MIN, maximum=1, unit="", example=example) for key, example in _SHARES.items()
    )
    sd_m = table.number("distance_sd_m", minimum=_SD_MIN_M, maximum=_SD_MAX_M, unit="metres", example="0.15")
    table.close()
    stated = EngineError(precision, recall, sd_m)
    return None if stated == EngineError() else stated
