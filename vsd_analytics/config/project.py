"""Finding and loading a project: `vsd.toml` and the files it names."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from vsd_analytics.config.broker_and_alarms import read_alarms, read_broker, read_delivery
from vsd_analytics.config.calendar import read_calendar
from vsd_analytics.config.floors import read_areas, read_cameras, read_fixtures, read_floors, read_lines
from vsd_analytics.config.opening_hours import read_opening, read_opening_changes
from vsd_analytics.config.reader import DATE, Form, Mistakes, TableReader
from vsd_analytics.config.reading_rules import read_sources
from vsd_analytics.config.routes import read_base_url, read_chromium, read_exchange, read_mail
from vsd_analytics.config.site_settings import OF_ENVIRONMENT, read_engine, read_settings
from vsd_analytics.config.toml_lines import TomlText, read_toml
from vsd_analytics.config.values import parse_dates, parse_day_start, parse_empty_hour, zone
from vsd_analytics.errors import ConfigError, UsageError, VsdError, Where
from vsd_analytics.owners import is_there
from vsd_analytics.resources import LANGUAGES
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Site

FILE = "vsd.toml"
DAY_STARTS_MIN = 240

_DATES: Form = {"type": "array", "items": DATE}
_NAMES: Form = {"additionalProperties": {"type": "string", "minLength": 1}}


def find_project(start: Path) -> Path:
    """Return the nearest folder at or above `start` that has a `vsd.toml`.

    Raises:
        UsageError: There is none (E102).

    Example:
        >>> vsd.find_project(site.site.root / "plans").name
        'vsd-demo'
    """
    start = start.absolute()
    for folder in (start, *start.parents):
        if is_there(folder / FILE):
            return folder
    raise UsageError(
        f"there is no {FILE} in {start} or above it",
        code="E102",
        why=f"{FILE} says which site, cameras and opening hours the records belong to",
        fix="go to your project folder, pass it with -C DIR, or make one: vsd init",
        in_python='vsd.open("FOLDER") with the folder of a vsd.toml',
    )


def load_site(folder: str | Path, *, environ: Mapping[str, str] | None = None) -> Site:
    """Read `vsd.toml` and the files it names.

    Args:
        folder: Project folder. Paths in the file start here; absolute ones are allowed, since plans often live
            elsewhere.
        environ: Environment in which `VSD_<SETTING>` overrides a setting, such as `VSD_DISTANCE_M`; None = none does.

    Returns:
        The site, with every setting, floor, camera and area checked.

    Raises:
        UsageError: There is no vsd.toml in `folder` (E102).
        ConfigError: It has mistakes (E103); `problems` lists all of them, by line.

    Example:
        >>> vsd.load_site(site.site.root).timezone
        'Europe/Rome'
    """
    folder = Path(folder).absolute()
    path = folder / FILE
    if not is_there(path):
        raise UsageError(
            f"there is no {FILE} in {folder}",
            code="E102",
            fix="pass the project folder with -C DIR, or make one: vsd init",
            in_python='give the folder of a vsd.toml; vsd.open("FOLDER") looks above it, too',
        )
    text, problem = read_toml(path, name=FILE)
    if problem is not None:
        raise refused(FILE, (problem,))
    return site_of(text, folder=folder, environ=environ)


def site_of(text: TomlText, *, folder: Path, environ: Mapping[str, str] | None = None) -> Site:
    """Return the site that the valid TOML `text` describes, as `load_site` does for a file.

    Raises:
        ConfigError: It has mistakes (E103).
    """
    mistakes = Mistakes(text)
    root = TableReader(tomllib.loads(text.text), path=(), label=FILE, mistakes=mistakes, folder=folder)
    site = read_site(root, environ=environ or {})
    if site is None:
        raise refused(FILE, mistakes.all)
    return site


def refused(name: str, problems: tuple[VsdError, ...]) -> ConfigError:
    """Return the error of a file of this name with all its mistakes."""
    count, first = len(problems), problems[0].where
    is_outside = all(p.where is not None and p.where.file.startswith(OF_ENVIRONMENT) for p in problems)
    return ConfigError(
        f"{'the environment' if is_outside else name} has {count} mistake{'s' if count != 1 else ''}",
        problems=problems,
        where=Where(first.file, first.line) if first else Where(name),
        fix=f"fix {'them' if count != 1 else 'it'} and run the command again",
    )


def read_site(root: TableReader, *, environ: Mapping[str, str]) -> Site | None:
    """Return the site that a whole `vsd.toml` describes, or None after noting what is wrong.

    Args:
        root: Reader of the file.
        environ: Environment that overrides settings.
    """
    values, mistakes = root.values, root.mistakes
    if "site" not in values:
        example = '[site] with id = "shop", name = "My shop", timezone = "Europe/Rome"'
        mistakes.add((), f"{FILE} has no table [site]", code="E123", fix=f"add: {example}")
    has_site = isinstance(values.get("site"), dict)
    site = root.inner("site")
    site_id = site.id("id", example='"shop"') if has_site else None
    name = site.text("name", example='"Riverside Store"', required=has_site)
    timezone = zone(site, "timezone", required=has_site) or "UTC"
    opening, opening_changes = read_opening(site), read_opening_changes(root)
    closed = site.parsed("closed", example='["2026-12-25"]', parse=parse_dates, form=_DATES)
    language = site.word("language", LANGUAGES, example="it") or LANGUAGES[0]
    day_starts = site.parsed("day_starts", example='"04:00"', parse=parse_day_start, form=DATE)
    tables = {
        "site": site,
        **{key: root.inner(key) for key in ("rule", "report", "analysis", "ingest", "alarms", "staff", "privacy")},
    }
    settings = read_settings(tables, environ=environ, mistakes=mistakes)
    ingest_map = _ingest_map(tables["ingest"], mistakes)
    delivery = read_delivery(tables["alarms"], has_broker="mqtt" in values)
    base_url, chromium = read_base_url(tables["report"]), read_chromium(tables["report"])
    for table in tables.values():
        table.close()
    floors = read_floors(root)
    cameras = read_cameras(root, floors=floors, timezone=timezone)
    areas = read_areas(root, floors=floors, timezone=timezone)
    fixtures = read_fixtures(root, floors=floors, timezone=timezone)
    doors = root.inner("doors")
    empty_min = doors.parsed("empty_at", example='"04:00"', parse=parse_empty_hour, form=DATE)
    doors.close()
    lines = read_lines(root, floors=floors, timezone=timezone)
    broker = read_broker(root)
    engine = read_engine(root)
    exchange = read_exchange(root)
    mail = read_mail(root)
    alarms = read_alarms(root, areas=areas, cameras=cameras)
    sources = read_sources(root, cameras=cameras)
    calendar = read_calendar(root, language)
    root.close()
    if mistakes.all or site_id is None or name is None:
        return None
    return Site(
        site_id=site_id,
        name=name,
        timezone=timezone,
        root=root.folder,
        opening=opening,
        opening_changes=opening_changes,
        closed=closed or frozenset(),
        calendar=calendar,
        day_starts_min=DAY_STARTS_MIN if day_starts is None else day_starts,
        doors_empty_min=empty_min,
        floors=tuple(floors.values()),
        cameras=cameras,
        areas=areas,
        fixtures=fixtures,
        lines=lines,
        broker=broker,
        exchange=exchange,
        alarms=alarms,
        alarm_delivery=delivery,
        engine=engine,
        mail=mail,
        base_url=base_url,
        chromium=chromium,
        language=language,
        settings=Settings().with_values(settings.values),
        own_settings=Settings().with_values(settings.own) if settings.own != settings.values else None,
        ingest_map=ingest_map,
        sources=sources,
        setting_sources=settings.sources,
    )


def _ingest_map(ingest: TableReader, mistakes: Mistakes) -> dict[str, str]:
    names: dict[str, str] = {}
    for key, value in ingest.table("map", example='{ x_m = "X" }', form=_NAMES).items():
        if isinstance(value, str) and value:
            names[key] = value
        else:
            path = ("ingest", "map", key)
            what = f"[ingest.map] {key} must be a column name in quotes"
            mistakes.add(path, what, code="E124", fix=f'{key} = "their name"')
    return names
