"""The target of a floor, `target_per_open_h` in `vsd.toml`: set by a command or at the desk, with who and when.

`vsd.toml` is the owner's file: one line of it changes, all others and their comments stay. It is replaced as a whole,
under a lock, and only by a file that says the same but for this key. Each change is a line of `targets.jsonl`, written
before it: a program that dies in between leaves a line that does not hold, and `vsd.toml` as it was.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from vsd_analytics.config.config_edits import Tables, rewrite, with_key
from vsd_analytics.config.log_records import NAME_MAX_CHARS, is_name
from vsd_analytics.config.project import FILE as CONFIG
from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import ConfigError, InputError, UsageError, Where
from vsd_analytics.site.model import Site
from vsd_analytics.site.places import known_floor

FILE: Final = "targets.jsonl"
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
    from vsd_analytics.store.durable import publish

    known_floor(site, floor_id)
    if value is not None and not RANGE[0] <= value <= RANGE[1]:
        raise UsageError(f"a target of {value:g} violations per open hour is out of range", fix="vsd target 120")
    if by is not None and not is_name(by):
        raise UsageError(f"--by must be 1 to {NAME_MAX_CHARS} printable characters", fix='--by "Anna"')
    changes: list[TargetChange] = []

    def edit(text: str, tables: Tables) -> str | None:
        number, floor = _table_of(tables, floor_id)
        earlier = floor.pop(KEY, None)
        if earlier == value:
            return None
        if value is not None:
            floor[KEY] = value
        changes.append(TargetChange(at, floor_id, earlier, value, by))
        return with_key(text, "floor", number, KEY, value)

    def note() -> None:
        journal = (site.root / FILE).resolve()
        lines = journal.read_bytes() if journal.exists() else b""
        added = json.dumps(_line(changes[0]), ensure_ascii=False).encode() + b"\n"
        publish(journal, lines + added, is_private=True)

    is_changed = rewrite(site, edit, refusal=lambda: _no_table(floor_id), before=note)
    return changes[0] if is_changed else None


def _table_of(tables: Tables, floor_id: str) -> tuple[int, dict[str, Any]]:
    """Return number and values of the table of a floor."""
    for number, table in enumerate(tables.get("floor", [])):
        if table.get("id") == floor_id:
            return number, table
    raise _no_table(floor_id)


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
