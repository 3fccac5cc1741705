"""The target of a floor, `target_per_open_h` in `vsd.toml`: set by a command or at the desk, with who and when.

`vsd.toml` is the owner's file: one line of it changes, all others and their comments stay. It is replaced as a whole,
under a lock, and only by a file that says the same but for this key. Each change is a line of `targets.jsonl`, written
before it: a program that dies in between leaves a line that does not hold, and `vsd.toml` as it was.
"""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from vsd_analytics.config.log_records import NAME_MAX_CHARS, is_name
from vsd_analytics.config.project import FILE as CONFIG
from vsd_analytics.config.project import site_of
from vsd_analytics.config.toml_lines import TomlText
from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import ConfigError, InputError, UsageError, Where
from vsd_analytics.site.model import Site
from vsd_analytics.site.places import known_floor

FILE: Final = "targets.jsonl"
LOCK: Final = Path("status") / "config.lock"
KEY: Final = "target_per_open_h"
RANGE: Final = (0.01, 1e6)
"""Violations per open hour."""


@dataclass(frozen=True, slots=True)
class TargetChange:
    """A target that was set or taken away.

    Attributes:
        at: When.
        floor_id: The floor.
        before: Violations per open hour until then; None = no target.
        after: Since then.
        by: Who; None = not stated.
    """

    at: datetime
    floor_id: str
    before: float | None
    after: float | None
    by: str | None = None


def read_target_changes(site: Site) -> tuple[TargetChange, ...]:
    """Return the changes in the order in which they were made.

    Raises:
        InputError: A line is no change (E110).
    """
    path = site.root / FILE
    lines = path.read_bytes().split(b"\n") if path.exists() else []
    return tuple(_change(line, number=n, site=site) for n, line in enumerate(lines, 1) if line.strip())


def set_target(
    site: Site, floor_id: str, value: float | None, *, at: datetime, by: str | None = None
) -> TargetChange | None:
    """Set the target of a floor, or take it away, durably. Returns None where it is so already.

    Args:
        site: The site.
        floor_id: The floor.
        value: Violations per open hour to stay below; None = no target.
        at: When.
        by: Who; None = not stated.

    Raises:
        UsageError: E101, no such floor, a number that is no target, or a name that is no name.
        ConfigError: E103, the floor has no table [[floor]] of its own in vsd.toml to write into.
        DiskError: E304 to E306, the disk refused; vsd.toml is as before.
    """
    from vsd_analytics.store.durable import exclusive, publish, sweep_temporaries

    known_floor(site, floor_id)
    if value is not None and not RANGE[0] <= value <= RANGE[1]:
        raise UsageError(f"a target of {value:g} violations per open hour is out of range", fix="vsd target 120")
    if by is not None and not is_name(by):
        raise UsageError(f"--by must be 1 to {NAME_MAX_CHARS} printable characters", fix='--by "Anna"')
    path, journal = (site.root / CONFIG).resolve(), (site.root / FILE).resolve()
    with exclusive(site.root / LOCK):
        sweep_temporaries(path.parent, file_name=path.name)
        text = path.read_bytes().decode("utf-8")
        number, before = _stored(text, floor_id)
        if before == value:
            return None
        new = _edited(text, number, value)
        _must_differ_in_target_alone(text, new, number=number, value=value)
        site_of(TomlText(CONFIG, new.removeprefix("\ufeff").replace("\r\n", "\n")), folder=site.root)
        change = TargetChange(at, floor_id, before, value, by)
        earlier = journal.read_bytes() if journal.exists() else b""
        publish(journal, earlier + json.dumps(_line(change), ensure_ascii=False).encode() + b"\n", is_private=True)
        publish(path, new.encode(), is_private=not path.stat().st_mode & 0o077)
    return change


def _stored(text: str, floor_id: str) -> tuple[int, float | None]:
    """Return the number of a floor's table in the file as it is now, and its target."""
    for number, table in enumerate(tomllib.loads(text.removeprefix("\ufeff")).get("floor", [])):
        if table.get("id") == floor_id:
            return number, table.get(KEY)
    raise _no_table(floor_id)


def _edited(text: str, number: int, value: float | None) -> str:
    """Return the text with the target in the line of its key, or in a new line below the head of the table."""
    known = TomlText(CONFIG, text.removeprefix("\ufeff").replace("\r\n", "\n"))
    lines, end = text.split("\n"), "\r" if "\r\n" in text else ""
    table = known.where(("floor", number)).line
    at = known.where(("floor", number, KEY)).line
    if table is None or at is None or not re.match(r"\s*\[\[\s*floor\s*\]\]", known.lines[table - 1]):
        raise _no_table(f"number {number + 1}")
    is_there = re.match(rf'\s*["\']?{KEY}["\']?\s*=', known.lines[at - 1]) is not None
    new = None if value is None else f"{KEY} = {value!r}".removesuffix(".0")
    if is_there:
        comment = re.search(r"\s*#.*$", known.lines[at - 1])
        lines[at - 1 : at] = [] if new is None else [f"{new}{comment[0] if comment else ''}{end}"]
    elif new is not None:
        lines[table:table] = [f"{new}{end}"]
    return "\n".join(lines)


def _must_differ_in_target_alone(text: str, new: str, *, number: int, value: float | None) -> None:
    """Refuse what would change anything else: then the file is written in a way this program does not edit."""
    wanted: dict[str, Any] = tomllib.loads(text.removeprefix("\ufeff"))
    floor = wanted["floor"][number]
    floor.pop(KEY, None)
    if value is not None:
        floor[KEY] = value
    try:
        is_so = tomllib.loads(new.removeprefix("\ufeff")) == wanted
    except tomllib.TOMLDecodeError:
        is_so = False
    if not is_so:
        raise _no_table(f"number {number + 1}")


def _no_table(floor: str) -> ConfigError:
    return ConfigError(
        f"the target of floor {floor} cannot be written into {CONFIG}",
        why="the floor has no table [[floor]] there with a line for each key",
        where=Where(CONFIG),
        fix=f"write the floor as [[floor]] with id and name, and {KEY} = 120 on a line of its own",
    )


def _line(change: TargetChange) -> dict[str, Any]:
    named = {} if change.by is None else {"by": change.by}
    return {
        "at": change.at.isoformat(),
        "floor": change.floor_id,
        "before": change.before,
        "after": change.after,
    } | named


def _change(line: bytes, *, number: int, site: Site) -> TargetChange:
    try:
        value: Any = json.loads(line)
        ends = [value[key] for key in ("before", "after")]
        by = value.get("by")
        is_right = all(end is None or isinstance(end, int | float) for end in ends) and isinstance(value["floor"], str)
        if is_right and (by is None or (isinstance(by, str) and is_name(by))):
            at = parse_instant(value["at"], timezone=site.timezone).astimezone(site.zone)
            return TargetChange(at, value["floor"], ends[0], ends[1], by)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        pass
    raise InputError(
        f"line {number} of {FILE} is no change of a target",
        code="E110",
        where=Where(FILE, number, line.decode(errors="replace")[:200]),
        fix="delete the line; the target itself is in vsd.toml",
    )
