"""Changes the opening hours from a day on, by a command or at the desk, with who.

Past weeks keep the hours they had: a change begins in a week that is not over. It is a table `[[opening]]` at the end
of the owner's file, written under the lock of that file, and taken back by deleting these very lines.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping
from datetime import date, timedelta
from typing import Any

from vsd_analytics.config.floor_targets import LOCK
from vsd_analytics.config.log_records import NAME_MAX_CHARS, is_name
from vsd_analytics.config.opening import WEEKDAYS, show_clock
from vsd_analytics.config.project import FILE, site_of
from vsd_analytics.config.toml_lines import TomlText
from vsd_analytics.errors import ConfigError, UsageError, Where
from vsd_analytics.site.calendar import Opening, OpeningChange
from vsd_analytics.site.model import Site


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
    _rewrite(site, lambda text: _appended(text, change), lambda tables: [*tables, _table(change)])
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
    _rewrite(
        site,
        lambda text: text.replace(_block(change, end=_end_of_lines(text)), "", 1),
        lambda tables: [table for table in tables if table != gone],
    )
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


def _appended(text: str, change: OpeningChange) -> str:
    """Return the text with a change below it, in its own kind of line ends."""
    end = _end_of_lines(text)
    return text + ("" if not text or text.endswith("\n") else end) + _block(change, end=end)


def _end_of_lines(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _block(change: OpeningChange, *, end: str) -> str:
    """Return a change as it is written, an empty line before it."""
    table = _table(change)
    hours = ", ".join(f"{day} = {json.dumps(spans)}" for day, spans in table["hours"].items())
    lines = ["[[opening]]", f'from = "{table["from"]}"', f"hours = {{ {hours} }}" if hours else "hours = {}"]
    by = [] if change.by is None else [f"by = {json.dumps(change.by, ensure_ascii=False)}"]
    return "".join(f"{line}{end}" for line in ("", *lines, *by))


def _rewrite(
    site: Site, edited: Callable[[str], str], wanted: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]
) -> None:
    """Replace the file by one that says the same but for `[[opening]]`, or refuse."""
    from vsd_analytics.store.durable import exclusive, publish, sweep_temporaries

    path = (site.root / FILE).resolve()
    with exclusive(site.root / LOCK):
        sweep_temporaries(path.parent, file_name=path.name)
        text = path.read_bytes().decode("utf-8")
        new, before = edited(text), tomllib.loads(text.removeprefix("\ufeff"))
        tables = wanted(before.pop("opening", []))
        try:
            after: Mapping[str, Any] = tomllib.loads(new.removeprefix("\ufeff"))
        except tomllib.TOMLDecodeError:
            after = {}
        if new == text or after != before | ({"opening": tables} if tables else {}):
            raise ConfigError(
                f"the opening hours cannot be written into {FILE}",
                why="the file writes [[opening]] in another way than this program",
                where=Where(FILE),
                fix="edit the [[opening]] of that day there",
            )
        site_of(TomlText(FILE, new.removeprefix("\ufeff").replace("\r\n", "\n")), folder=site.root)
        publish(path, new.encode(), is_private=not path.stat().st_mode & 0o077)
