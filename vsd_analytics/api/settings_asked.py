"""A site with other settings of its figures, as `Days.at` asks for."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Final

from vsd_analytics.errors import UsageError, nearest
from vsd_analytics.settings import BY_NAME, SETTINGS, Setting
from vsd_analytics.site.model import Site

ASKED: Final = tuple(s.name for s in SETTINGS if s.is_in_sql)
"""Settings that tables depend on: numbers, and words with choices."""


def site_with(site: Site, settings: Mapping[str, float | str]) -> Site:
    """Return the site with settings of figures, in their units.

    Raises:
        UsageError: E101, there is no such setting, its value is out of range, or `distance_m` is over `pair_max_m`.
    """
    other = site.with_settings(**{name: _value(name, value) for name, value in settings.items()})
    if other.settings.pair_max_m < other.settings.distance_m:
        raise UsageError(
            f"distance_m = {other.settings.distance_m:g} is more than pair_max_m = {other.settings.pair_max_m:g}",
            why="pairs farther apart than pair_max_m are not stored, so violations would be lost",
            fix=f"give pair_max_m={other.settings.distance_m + 0.5:g} too",
        )
    return other


def _value(name: str, value: object) -> float | str:
    """Return the value as the setting has it: 1, 1.0 and a number of numpy are one setting.

    Raises:
        UsageError: E101, there is no such setting of figures, or it cannot have this value.
    """
    if name not in ASKED:
        near = nearest(name, ASKED)
        what = "is set in vsd.toml alone" if name in BY_NAME else "is no setting"
        fix = f"did you mean {near}=...?" if near and name not in BY_NAME else None
        raise UsageError(f"{name} {what}", why=f"settings to try here are {', '.join(ASKED)}", fix=fix)
    setting = BY_NAME[name]
    if setting.choices:
        if not isinstance(value, str) or value not in setting.choices:
            fix = f'{name}="{nearest(str(value), setting.choices) or setting.choices[0]}"'
            raise UsageError(f"{name} = {value!r} is not one of {', '.join(setting.choices)}", fix=fix)
        return value
    return _number(setting, value)


def _number(setting: Setting, value: object) -> float:
    default = setting.default
    assert isinstance(default, int | float)
    assert setting.minimum is not None
    assert setting.maximum is not None
    fix = f"{setting.name}={default:g} is the default"
    if isinstance(value, bool) or not isinstance(value, Real):
        raise UsageError(f"{setting.name} = {value!r} is no number", fix=fix)
    number = float(value)
    if not setting.minimum <= number <= setting.maximum:
        allowed = f"{setting.minimum:g} and {setting.maximum:g} {setting.unit}".strip()
        raise UsageError(f"{setting.name} = {number:g} is not between {allowed}", fix=fix)
    if not isinstance(default, int):
        return number
    if not number.is_integer():
        raise UsageError(f"{setting.name} = {number:g} is no whole number", fix=fix)
    return int(number)
