"""Changes the opening hours from a day on, by a command or at the desk, with who.

Past weeks keep the hours they had: a change begins in a week that is not over. It is a table `[[opening]]` at the end
of the owner's file, written under the lock of that file, and taken back by deleting these very lines.
"""

from __future__ import annotations

from datetime import date, timedelta
from typing import Any, Final

from vsd_analytics.config.config_edits import Tables, drop_table, rewrite, with_table, without_table
from vsd_analytics.config.log_records import NAME_MAX_CHARS, is_name
from vsd_analytics.config.opening import WEEKDAYS, show_clock
from vsd_analytics.config.project import FILE
from vsd_analytics.errors import ConfigError, UsageError, Where
from vsd_analytics.site.calendar import Opening, OpeningChange
from vsd_analytics.site.model import Site

KEY: Final = "opening"


def change_opening(
    site: Site, opening: Opening, *, first: date, today: date, by: str | None = None
) -> OpeningChange | None:
    """Write opening hours that hold from a day on, durably. Returns None where these hold on that day already.

    Args:
        site: The site.
        opening: The week from then on.
        first: First local day: of the running week or later.
        today: The local day on which this is done.
        by: Who; None = not stated.

    Raises:
        UsageError: E101, the day lies in a week that is over, another change begins on it, or `by` is no name.
        ConfigError: E103, the file cannot be written to in this way.
        DiskError: E304 to E306, the disk refused; vsd.toml is as before.
    """
    monday = today - timedelta(days=today.weekday())
    if first < monday:
        why = f"the week of {first} is over, and its figures keep the hours they were made with"
        raise UsageError("opening hours cannot change in the past", why=why, fix=f"a day from {monday} on")
    if by is not None and not is_name(by):
        raise UsageError(f"--by must be 1 to {NAME_MAX_CHARS} printable characters", fix='--by "Anna"')
    if site.hours.on(first) == opening:
        return None
    if any(c.first == first for c in site.opening_changes):
        fix = f"vsd opening --take-back {first}, then change them"
        raise UsageError(f"opening hours change on {first} already", fix=fix)
    change = OpeningChange(first, opening, by)
    new = _table(change)

    def with_change(text: str, tables: Tables) -> str:
        tables.setdefault(KEY, []).append(new)
        return with_table(text, KEY, new)

    rewrite(site, with_change, refusal=_other_way)
    return change


def take_opening_back(site: Site, first: date, *, today: date) -> OpeningChange | None:
    """Delete the opening hours that hold from a day on. Returns None where there are none.

    Args:
        site: The site.
        first: First local day of the change: of the running week or later.
        today: The local day on which this is done.

    Raises:
        UsageError: E101, weeks of it are over.
        ConfigError: E103, the lines in vsd.toml are not those that this program writes.
        DiskError: E304 to E306, the disk refused; vsd.toml is as before.
    """
    change = next((c for c in site.opening_changes if c.first == first), None)
    if change is None:
        return None
    if first < today - timedelta(days=today.weekday()):
        why = "weeks with these hours are over, and their figures keep them"
        raise UsageError(
            f"the opening hours from {first} cannot be taken back", why=why, fix="change them from a later day"
        )
    gone = _table(change)

    def without_change(text: str, tables: Tables) -> str:
        drop_table(tables, KEY, gone)
        return without_table(text, KEY, gone)

    rewrite(site, without_change, refusal=_other_way)
    return change


def in_words(opening: Opening) -> dict[str, str]:
    """Return the spans of each weekday as `vsd.toml` writes them: "08:00-13:00 15:00-19:00"; empty = closed."""
    return {
        day: " ".join(f"{show_clock(start)}-{show_clock(end)}" for start, end in spans)
        for day, spans in zip(WEEKDAYS, opening, strict=True)
    }


def _table(change: OpeningChange) -> dict[str, Any]:
    hours = {
        day: spans.split(" ") if " " in spans else spans for day, spans in in_words(change.opening).items() if spans
    }
    return {"from": change.first.isoformat(), "hours": hours} | ({} if change.by is None else {"by": change.by})


def _other_way() -> ConfigError:
    return ConfigError(
        f"the opening hours cannot be written into {FILE}",
        why="the file writes [[opening]] in another way than this program",
        where=Where(FILE),
        fix="edit the [[opening]] of that day there",
    )
