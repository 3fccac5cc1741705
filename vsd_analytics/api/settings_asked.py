"""A site with other settings of its figures, as `Days.at` asks for."""

from __future__ import annotations

from collections.abc import Mapping

from vsd_analytics.errors import UsageError
from vsd_analytics.settings import BY_NAME
from vsd_analytics.site.model import Site


def site_with(site: Site, settings: Mapping[str, float | str]) -> Site:
    """Return the site with settings of figures, in their units.

    Raises:
        UsageError: E101, there is no such setting, its value is out of range, or `distance_m` is over `pair_max_m`.
    """
    for name, value in settings.items():
        _check_setting(name, value)
    other = site.with_settings(**settings)
    if other.settings.pair_max_m < other.settings.distance_m:
        raise UsageError(
            f"distance_m = {other.settings.distance_m:g} is more than pair_max_m = {other.settings.pair_max_m:g}",
            why="pairs farther apart than pair_max_m are not stored, so violations would be lost",
            fix=f"give pair_max_m={other.settings.distance_m + 0.5:g} too",
        )
    return other


def _check_setting(name: str, value: float | str) -> None:
    setting = BY_NAME.get(name)
    if setting is not None and setting.is_in_sql and setting.choices:
        if value not in setting.choices:
            raise UsageError(f"{name} = {value!r} is not one of {', '.join(setting.choices)}")
        return
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"{name} = {value!r} is no number", fix=f"{name}=1.0")
    if setting is None or setting.minimum is None or setting.maximum is None or not setting.is_in_sql:
        known = ", ".join(s.name for s in BY_NAME.values() if s.is_in_sql and s.minimum is not None)
        raise UsageError(f"{name} is no setting of figures", why=f"these are {known}")
    if not setting.minimum <= value <= setting.maximum:
        allowed = f"{setting.minimum:g} and {setting.maximum:g} {setting.unit}".strip()
        raise UsageError(f"{name} = {value:g} is not between {allowed}")
