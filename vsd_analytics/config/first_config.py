"""The first `vsd.toml` of a site, written from a few answers and checked before it is written."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from vsd_analytics.config.opening import OpeningError, parse_opening
from vsd_analytics.config.project import FILE, site_of
from vsd_analytics.config.reader import suggest_id
from vsd_analytics.config.toml_lines import TomlText
from vsd_analytics.errors import UsageError, VsdError
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.site.model import Site

ALWAYS = "always"


@dataclass(frozen=True, slots=True)
class FirstAnswers:
    """What a first `vsd.toml` says.

    Attributes:
        name: Display name of the site.
        timezone: IANA zone.
        site_id: Id; None = made from the name.
        opening: Such as "mon-sat 08:00-21:00, sun 10:00-18:00", or "always".
        cameras: Such as "cam-1" or "cam-1=Entrance".
        plan: Picture of the floor plan, relative to the project folder or absolute.
        plan_m_per_px: Metres per pixel of the plan.
        plan_origin_m: Floor metres of the plan's lower left corner.
        distance_m: Legal distance.
        language: Of its pages; None = not said, which is English.
        floor_name: Display name of its floor.
    """

    name: str
    timezone: str
    site_id: str | None = None
    opening: str = ALWAYS
    cameras: tuple[str, ...] = ("cam-1",)
    plan: str | None = None
    plan_m_per_px: float | None = None
    plan_origin_m: tuple[float, float] = (0.0, 0.0)
    distance_m: float = DEFAULTS.distance_m
    language: str | None = None
    floor_name: str = "Ground floor"


def write_first_config(folder: Path, *, answers: FirstAnswers) -> Site:
    """Write `vsd.toml` into `folder` and return the site it describes.

    Raises:
        UsageError: There is one already (E104), or an answer cannot be read or printed (E101).
        ConfigError: An answer cannot be written to it; nothing is written.
    """
    path = folder / FILE
    if path.exists():
        raise UsageError(f"{path} is already there", code="E104", fix="edit it, or pick a folder: vsd -C DIR init")
    text = render(answers)
    is_new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)  # first: from a folder that is not there, `../plan.svg` leads nowhere
    try:
        site = site_of(TomlText(FILE, text), folder=folder.absolute())
    except VsdError:
        if is_new:
            folder.rmdir()
        raise
    from vsd_analytics.store.durable import publish

    publish(path, text.encode())
    return site


def check_zone(name: str) -> None:
    """Raise UsageError (E101) unless `name` is an IANA time zone."""
    from vsd_analytics.config.values import is_zone, nearest_zone

    if not is_zone(name):
        raise UsageError(f"there is no time zone {name!r}", fix=f"such as {nearest_zone(name) or 'Europe/Rome'}")


def check_unit(name: str) -> None:
    """Raise UsageError (E101) unless `name` is a unit of length, or px."""
    from vsd_analytics.config.file_columns import METRES

    if name not in (*METRES, "px"):
        raise UsageError(f"{name!r} is no unit of positions", fix=f"one of {', '.join((*METRES, 'px'))}")


def check_opening(words: str) -> None:
    """Raise UsageError (E101) unless `words` are opening hours or "always"."""
    if words.strip().lower() != ALWAYS:
        parse_opening_words(words)


def parse_opening_words(words: str) -> dict[str, str | list[str]]:
    """Return the table `opening` of words such as "mon-sat 08:00-21:00, sun 10:00-13:00 15:00-18:00".

    Hours alone, such as "09:00-11:00", are those of every day; behind days they are more hours of these.

    Raises:
        UsageError: They are not days followed by spans (E101).
    """
    spans_of: dict[str, list[str]] = {}
    days = "mon-sun"
    for part in re.split(r"[,;]", words):
        first, *spans = part.split() or [""]
        if ":" in first:  # hours without days belong to the days before them
            spans_of.setdefault(days, []).extend([first, *spans])
            continue
        days = first
        if days in spans_of:
            raise _unreadable(f"{days!r} stands twice", "name each day once: mon-sat 08:00-21:00, sun 10:00-18:00")
        if not spans:
            raise _unreadable(f"{part.strip()!r} is no day with its hours", "mon-sat 08:00-21:00, sun 10:00-18:00")
        spans_of[days] = spans
    table: dict[str, str | list[str]] = {d: spans[0] if len(spans) == 1 else spans for d, spans in spans_of.items()}
    _, mistakes = parse_opening(table)
    if mistakes:
        error: OpeningError = mistakes[0][1]
        raise _unreadable(str(error), error.fix)
    return table


def _unreadable(why: str, fix: str) -> UsageError:
    return UsageError("the opening hours cannot be read", why=why, fix=fix)


def render(answers: FirstAnswers) -> str:
    """Return the text of `vsd.toml`, with the lines a site may want later as comments."""
    opening = '# opening = { mon-sat = "08:00-21:00", sun = "10:00-18:00" }   # absent = always open'
    if answers.opening.strip().lower() != ALWAYS:
        opening = f"opening = {_inline(parse_opening_words(answers.opening))}"
    lines = [
        "# What this site is. Every key: docs/keys.md; editors: docs/settings.md; after a change: vsd doctor",
        "[site]",
        f"id = {_quoted(answers.site_id or suggest_id(answers.name))}",
        f"name = {_quoted(answers.name)}",
        f"timezone = {_quoted(answers.timezone)}",
        *([] if answers.language is None else [f"language = {_quoted(answers.language)}"]),
        opening,
        '# closed = ["2026-12-25"]',
        f"distance_m = {answers.distance_m!r}",
        "",
        "[[floor]]",
        'id = "ground"',
        f"name = {_quoted(answers.floor_name)}",
        *_plan(answers),
    ]
    for camera in answers.cameras:
        stated_id, _, name = (part.strip() for part in camera.partition("="))
        # an engine's "Cam 2" becomes cam-2 and stays known by its own name; a path or markup is refused as an id
        camera_id = suggest_id(stated_id) if re.fullmatch(r"[\w .-]+", stated_id) else stated_id
        known = '# engine_ids = ["what the engine calls it"]'
        lines += [
            "",
            "[[camera]]",
            f"id = {_quoted(camera_id)}",
            f"name = {_quoted(name or stated_id)}",
            f'# picture = "pictures/{camera_id}.png"   # of the empty scene; then: vsd calibrate',
            known if stated_id == camera_id else f"engine_ids = [{_quoted(stated_id)}]",
        ]
    lines += [
        "",
        "# [[area]]   # a named part of the floor, corners in metres",
        '# id = "checkout-queue"',
        '# name = "Checkout queue"',
        "# polygon = [[12, 4.2], [20, 4.2], [20, 7.2], [12, 7.2]]",
        "",
        "# [[alarm]]   # a situation that raises an alarm while it lasts: docs/alarms.md",
        '# id = "queue-too-full"',
        '# kind = "gathering"         # or contact, silence',
        "# people = 4                 # at least, closer than distance_m from one to the next",
        "# for_s = 60",
        '# area = "checkout-queue"',
    ]
    if answers.distance_m > DEFAULTS.pair_max_m:  # pairs a little beyond the distance must be stored, too
        lines += ["", "[rule]", f"pair_max_m = {answers.distance_m + 0.5:g}"]
    text = "\n".join(lines) + "\n"
    tomllib.loads(text)  # every answer is quoted: this cannot fail
    return text


def _plan(answers: FirstAnswers) -> list[str]:
    if answers.plan is None:
        return [
            '# plan = "plans/ground.png"         # svg, png or jpg',
            "# plan_m_per_px = 0.05              # a length in metres / the same length in plan pixels",
            "# plan_origin_m = [0.0, 0.0]        # floor metres of the plan's lower left corner",
        ]
    scale = [] if answers.plan_m_per_px is None else [f"plan_m_per_px = {float(answers.plan_m_per_px)!r}"]
    return [
        f"plan = {_quoted(answers.plan)}",
        *scale,
        f"plan_origin_m = {list(answers.plan_origin_m)}          # floor metres of the plan's lower left corner",
    ]


def _inline(table: Mapping[str, str | list[str]]) -> str:
    return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in table.items()) + " }"


def _quoted(text: str) -> str:
    """Return a TOML basic string, which is a JSON string where nothing but quotes and backslashes is escaped."""
    if not text.isprintable():
        raise UsageError(f"{text!r} has characters that cannot be printed", fix="write it without them")
    return json.dumps(text, ensure_ascii=False)
