"""The site's change log: what was moved, when and where, one JSON object a line in `log.jsonl`.

Entries with the same instant, text and area count as one entry, even if the file repeats them.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from vsd_analytics.config.reader import nearest
from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import CONTROL, InputError, UsageError, VsdError, Where
from vsd_analytics.site.model import LogEntry, Site

FILE = "log.jsonl"
LOCK = Path("status") / "log.lock"
TEXT_MAX_CHARS = 500

_BEGIN = b'{"at": "'
"""What every line begins with that this program writes."""


@dataclass(frozen=True, slots=True)
class Added:
    """What became of an entry.

    Attributes:
        entry: The entry as stored.
        is_new: The log did not hold it before.
        removed: Lines that broke off and were removed.
    """

    entry: LogEntry
    is_new: bool
    removed: tuple[str, ...] = ()


def read_log(site: Site) -> tuple[LogEntry, ...]:
    """Return the entries of the change log by time, those of one instant in the order in which they were added.

    Lines that broke off are no entries; `torn_lines` names them.

    Raises:
        InputError: A line is not an entry (E110).
    """
    lines = [(n, line) for n, line in _lines(site) if not _is_torn(line)]
    entries = [_entry(line, number=n, site=site) for n, line in lines]
    return tuple(dict.fromkeys(sorted(entries, key=lambda entry: entry.at)))


def torn_lines(site: Site) -> tuple[VsdError, ...]:
    """Return a warning (W110) for each line that broke off: version 0.1 left one behind when the disk was full."""
    return tuple(_torn(n, line) for n, line in _lines(site) if _is_torn(line))


def add_entry(site: Site, *, text: str, at: str | datetime, area: str | None = None) -> Added:
    """Add one entry, durably: it is on disk when this returns. An entry that is there already is not added again.

    The file is replaced as a whole, under a lock, so that it holds all of the entry or nothing, and two who add at once
    lose neither. Lines that broke off are left out of it.

    Args:
        site: The site.
        text: What was changed, one line.
        at: When: ISO text or datetime; without an offset in the site's zone, a date is its midnight.
        area: Id of the area it concerns; None = the whole site.

    Raises:
        UsageError: No text, no time, or an area the site does not have (E101).
        DiskError: E304 to E306, the disk refused; the log is as before.
    """
    from vsd_analytics.store.durable import exclusive, publish, sweep_temporaries

    entry = LogEntry(_instant(at, site), _one_line(text), _known_area(area, site))
    path = (site.root / FILE).resolve()  # what a link points to
    with exclusive(site.root / LOCK):
        sweep_temporaries(path.parent, of=path.name)
        before = path.read_bytes() if path.exists() else None
        is_private = before is not None and not path.stat().st_mode & 0o077
        lines = [(n, line) for n, line in _lines(site) if not _is_torn(line)]
        removed = tuple(line.decode(errors="replace") for _, line in _lines(site) if _is_torn(line))
        is_new = not any(_is_entry(line, entry, number=n, site=site) for n, line in lines)
        new = [json.dumps(entry_dict(entry), ensure_ascii=False).encode()] if is_new else []
        after = b"".join(line + b"\n" for line in [*(line for _, line in lines), *new])
        try:
            publish(path, after, is_private=is_private)
        except OSError:
            with contextlib.suppress(OSError):  # the sync of the folder failed, but the new file is in place already
                if before is not None and path.read_bytes() == after:
                    publish(path, before, is_synced=False, is_private=is_private)
            raise
    return Added(entry, is_new, removed)


def entry_dict(entry: LogEntry) -> dict[str, str | None]:
    """Return an entry as one line of the file, without its newline."""
    return {"at": entry.at.isoformat(), "text": entry.text, "area": entry.area_id}


def _instant(at: str | datetime, site: Site) -> datetime:
    try:
        return parse_instant(at, timezone=site.timezone).astimezone(site.zone)
    except ValueError as error:
        fix = "--at 2026-11-11T12:00 (in the site's zone) or with an offset, 2026-11-11T12:00+01:00"
        raise UsageError(f"--at: {error}", fix=fix) from None


def _one_line(text: str) -> str:
    text = " ".join(text.split())
    if not text or len(text) > TEXT_MAX_CHARS or CONTROL.search(text):
        raise UsageError(
            f"the text of a log entry must be 1 to {TEXT_MAX_CHARS} printable characters",
            fix='vsd log add "moved the exhibit away from the entrance" --at 2026-11-11T12:00',
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
        fix=f"--area {close}" if close else "leave --area out, or describe the area in vsd.toml",
    )


def _lines(site: Site) -> Iterator[tuple[int, bytes]]:
    path = site.root / FILE
    if path.exists():
        for number, line in enumerate(path.read_bytes().split(b"\n"), start=1):
            if line.strip():
                yield number, line


def _is_torn(line: bytes) -> bool:
    """Tell whether a line is the beginning of one that this program writes, and no more."""
    return not line.rstrip().endswith(b"}") and (line.startswith(_BEGIN) or _BEGIN.startswith(line))


def _is_entry(line: bytes, entry: LogEntry, *, number: int, site: Site) -> bool:
    try:
        return _entry(line, number=number, site=site) == entry
    except InputError:
        return False


def _entry(line_bytes: bytes, *, number: int, site: Site) -> LogEntry:
    path = site.root / FILE
    try:
        line = line_bytes.decode()
    except UnicodeDecodeError as error:
        shown = line_bytes.decode(errors="replace")
        raise _refused(path, text=shown, number=number, why=f"it is not UTF-8 text ({error.reason})") from None
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
        fix='correct or delete the line; an entry is {"at":"2026-11-11T12:00:00+01:00","text":"…","area":null}',
    )


def _torn(number: int, line: bytes) -> VsdError:
    return VsdError(
        f"line {number} of {FILE} breaks off and is not read",
        code="W110",
        where=Where(FILE, number, line.decode(errors="replace")[:200]),
        why="the disk was full or the computer stopped while the line was written; it was never acknowledged",
        fix='vsd log add "…" --at …   adds the entry again and removes the line',
    )
