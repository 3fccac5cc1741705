"""The site's change log: what was moved, when and where, one JSON object a line in `log.jsonl`."""

from __future__ import annotations

import json
import os
from datetime import datetime
from pathlib import Path
from typing import Any

from vsd_analytics.config.reader import nearest
from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import CONTROL, InputError, UsageError, Where
from vsd_analytics.site import LogEntry, Site

FILE = "log.jsonl"
TEXT_MAX_CHARS = 500


def read_log(site: Site) -> tuple[LogEntry, ...]:
    """Return the entries of the change log by time, those of one instant in the order in which they were added.

    Raises:
        InputError: A line is not an entry (E110).
    """
    path = site.root / FILE
    if not path.exists():
        return ()
    try:
        text = path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise _refused(path, text="", number=1, why=f"it is not UTF-8 text ({error.reason})") from None
    lines = text.split("\n")
    entries = [_entry(line, number=n, path=path, site=site) for n, line in enumerate(lines, start=1) if line.strip()]
    return tuple(sorted(entries, key=lambda entry: entry.at))


def add_entry(site: Site, *, text: str, at: str | datetime, area: str | None = None) -> LogEntry:
    """Append one entry, durably: it is on disk when this returns.

    Args:
        site: The site.
        text: What was changed, one line.
        at: When: ISO text or datetime; without an offset in the site's zone, a date is its midnight.
        area: Id of the area it concerns; None = the whole site.

    Returns:
        The entry as stored.

    Raises:
        UsageError: No text, no time, or an area the site does not have (E101).
    """
    entry = LogEntry(_instant(at, site), _one_line(text), _known_area(area, site))
    line = json.dumps(entry_dict(entry), ensure_ascii=False)
    path = site.root / FILE
    is_new = not path.exists()
    with path.open("ab+") as f:
        if f.tell() and not _ends_with_newline(f.fileno(), f.tell()):  # a torn last line must not swallow this one
            line = "\n" + line
        f.write(line.encode() + b"\n")
        f.flush()
        os.fsync(f.fileno())
    if is_new:
        from vsd_analytics.store.durable import fsync_dir

        fsync_dir(site.root)
    return entry


def entry_dict(entry: LogEntry) -> dict[str, str | None]:
    """Return an entry as it stands in the file."""
    return {"at": entry.at.isoformat(), "text": entry.text, "area": entry.area_id}


def _instant(at: str | datetime, site: Site) -> datetime:
    try:
        return parse_instant(at, timezone=site.timezone).astimezone(site.zone)
    except ValueError as error:
        mend = "--at 2026-11-11T12:00 (in the site's zone) or with an offset, 2026-11-11T12:00+01:00"
        raise UsageError(f"--at: {error}", mend=mend) from None


def _one_line(text: str) -> str:
    text = " ".join(text.split())
    if not text or len(text) > TEXT_MAX_CHARS or CONTROL.search(text):
        raise UsageError(
            f"the text of a log entry must be 1 to {TEXT_MAX_CHARS} printable characters",
            mend='vsd log add "moved the exhibit away from the entrance" --at 2026-11-11T12:00',
        )
    return text


def _known_area(area: str | None, site: Site) -> str | None:
    known = [each.area_id for each in site.areas]
    if area is None or area in known:
        return area
    close = nearest(area, known)
    raise UsageError(
        f"the site has no area {area!r}",
        why=f"its areas are: {', '.join(known)}" if known else "vsd.toml describes no [[area]]",
        mend=f"--area {close}" if close else "leave --area out, or describe the area in vsd.toml",
    )


def _entry(line: str, *, number: int, path: Path, site: Site) -> LogEntry:
    try:
        value: Any = json.loads(line)
    except (ValueError, RecursionError):
        raise _refused(path, text=line, number=number, why="it is not a JSON object") from None
    if not isinstance(value, dict):
        raise _refused(path, text=line, number=number, why="it is not a JSON object")
    text, area = value.get("text"), value.get("area")
    if not isinstance(text, str) or not text.strip():
        raise _refused(path, text=line, number=number, why='"text" is missing')
    if len(text) > TEXT_MAX_CHARS or CONTROL.search(text):
        why = f'"text" is longer than {TEXT_MAX_CHARS} characters or has control characters'
        raise _refused(path, text=line, number=number, why=why)
    if area is not None and not isinstance(area, str):
        raise _refused(path, text=line, number=number, why='"area" is neither an area id nor null')
    try:
        at = parse_instant(value.get("at"), timezone=site.timezone)
    except ValueError as error:
        raise _refused(path, text=line, number=number, why=f'"at": {error}') from None
    return LogEntry(at.astimezone(site.zone), text, area)


def _refused(path: Path, *, text: str, number: int, why: str) -> InputError:
    return InputError(
        f"line {number} of {path.name} is not a log entry",
        code="E110",
        where=Where(path.name, number, text[:200]),
        why=why,
        mend='mend or delete the line; an entry is {"at":"2026-11-11T12:00:00+01:00","text":"…","area":null}',
    )


def _ends_with_newline(file_descriptor: int, size: int) -> bool:
    return os.pread(file_descriptor, 1, size - 1) == b"\n"
