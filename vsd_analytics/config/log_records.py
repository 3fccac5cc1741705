"""The lines of `log.jsonl`, one JSON object each, in the order in which they were added.

A line is an entry, an answer to a question of the report, or the correction or withdrawal of an entry. No line is ever
changed: a later line supersedes an earlier one by naming its time, text and area.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final, get_args

from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import CONTROL, InputError, VsdError, Where
from vsd_analytics.site.model import LogEntry, Site
from vsd_analytics.site.questions import AnswerKind, QuestionAnswer

FILE: Final = "log.jsonl"
LOCK: Final = Path("status") / "log.lock"
TEXT_MAX_CHARS: Final = 500
NAME_MAX_CHARS: Final = 100
ANSWERS: Final[tuple[AnswerKind, ...]] = get_args(AnswerKind)

_BEGIN = b'{"at": "'
"""What every line begins with that this program writes."""


@dataclass(frozen=True, slots=True)
class LogRecord:
    """One line of the file.

    Attributes:
        line: Its number, from 1.
        entry: The change it logs; None for an answer that changed nothing, and for a withdrawal.
        answer: The answer it gives; None = none.
        supersedes: The entry that it corrects or takes back; None = none.
        withdrawn_at: When it took that back; None for a correction, and before version 2.
        withdrawn_by: Who did; None = not stated.
    """

    line: int
    entry: LogEntry | None = None
    answer: QuestionAnswer | None = None
    supersedes: LogEntry | None = None
    withdrawn_at: datetime | None = None
    withdrawn_by: str | None = None


def read_records(site: Site) -> tuple[LogRecord, ...]:
    """Return what the lines say, in the order of the file. Lines that broke off say nothing; `torn_lines` names them.

    Raises:
        InputError: A line is not one of those above (E110).
    """
    return tuple(_record(line, number=n, site=site) for n, line in whole_lines(site))


def torn_lines(site: Site) -> tuple[VsdError, ...]:
    """Return a warning (W110) for each line that broke off: version 0.1 left one behind when the disk was full."""
    return tuple(_torn(n, line) for n, line in _lines(site) if _is_torn(line))


def add_line(site: Site, make: Callable[[tuple[LogRecord, ...]], dict[str, Any] | None]) -> tuple[str, ...]:
    """Add one line, durably: it is on disk when this returns.

    The file is replaced as a whole, under a lock, so that it holds all of the line or nothing, and two who add at once
    lose neither. Lines that broke off are left out of it.

    Args:
        site: The site.
        make: Called under the lock with the records that can be read; returns the new line, or None for none.

    Returns:
        The lines that broke off and were removed.

    Raises:
        DiskError: E304 to E306, the disk refused; the file is as before.
    """
    from vsd_analytics.store.durable import exclusive, publish, sweep_temporaries

    path = (site.root / FILE).resolve()  # what a link points to
    with exclusive(site.root / LOCK):
        sweep_temporaries(path.parent, file_name=path.name)
        before = path.read_bytes() if path.exists() else None
        is_private = before is None or not path.stat().st_mode & 0o077  # it may name people; an owner may share it
        lines = list(whole_lines(site))
        removed = tuple(line.decode(errors="replace") for _, line in _lines(site) if _is_torn(line))
        new = make(tuple(_readable(lines, site)))
        added = [] if new is None else [json.dumps(new, ensure_ascii=False).encode()]
        after = b"".join(line + b"\n" for line in [*(line for _, line in lines), *added])
        try:
            publish(path, after, is_private=is_private)
        except OSError:
            with contextlib.suppress(OSError):  # the sync of the folder failed, but the new file is in place already
                if before is not None and path.read_bytes() == after:
                    publish(path, before, is_synced=False, is_private=is_private)
            raise
    return removed


def entry_dict(entry: LogEntry) -> dict[str, str | None]:
    """Return an entry as one line of the file, without what it answers."""
    return {"at": entry.at.isoformat(), "text": entry.text, "area": entry.area_id}


def whole_lines(site: Site) -> Iterator[tuple[int, bytes]]:
    """Yield the lines that did not break off, with their numbers."""
    return ((n, line) for n, line in _lines(site) if not _is_torn(line))


def _lines(site: Site) -> Iterator[tuple[int, bytes]]:
    path = site.root / FILE
    if path.exists():
        for number, line in enumerate(path.read_bytes().split(b"\n"), start=1):
            if line.strip():
                yield number, line


def _readable(lines: list[tuple[int, bytes]], site: Site) -> Iterator[LogRecord]:
    """Yield the records of good lines: a bad one hinders nobody from adding another."""
    for number, line in lines:
        with contextlib.suppress(InputError):
            yield _record(line, number=number, site=site)


def _is_torn(line: bytes) -> bool:
    """Tell whether a line is the beginning of one that this program writes, and no more."""
    return not line.rstrip().endswith(b"}") and (line.startswith(_BEGIN) or _BEGIN.startswith(line))


def _record(line_bytes: bytes, *, number: int, site: Site) -> LogRecord:
    name = FILE
    try:
        line = line_bytes.decode()
    except UnicodeDecodeError as error:
        shown = line_bytes.decode(errors="replace")
        raise _refused(name, text=shown, number=number, why=f"it is not UTF-8 text ({error.reason})") from None
    try:
        value: Any = json.loads(line)
        if not isinstance(value, dict):
            raise ValueError("it is not a JSON object")
    except (ValueError, RecursionError):
        raise _refused(name, text=line, number=number, why="it is not a JSON object") from None
    try:
        return _read(value, number=number, site=site)
    except ValueError as error:
        raise _refused(name, text=line, number=number, why=str(error)) from None


def _read(value: dict[str, Any], *, number: int, site: Site) -> LogRecord:
    """Return what an object says; ValueError says what is wrong with it."""
    if "removes" in value:
        gone, by = _named(value["removes"], key="removes", site=site), value.get("by")
        at = None
        with contextlib.suppress(ValueError):
            at = parse_instant(value.get("at"), timezone=site.timezone).astimezone(site.zone)
        signed = by if isinstance(by, str) and is_name(by) else None
        return LogRecord(number, supersedes=gone, withdrawn_at=at, withdrawn_by=signed)
    entry = _entry(value, site=site)
    supersedes = _named(value["replaces"], key="replaces", site=site) if value.get("replaces") is not None else None
    kind = value.get("answer")
    if kind is None:
        return LogRecord(number, entry=entry, supersedes=supersedes)
    if kind not in ANSWERS:
        raise ValueError(f'"answer" is none of {", ".join(ANSWERS)}')
    if entry.question is None:
        raise ValueError('"question" is missing')
    answer = QuestionAnswer(entry.at, entry.question, kind, entry.text, entry.area_id, entry.by)
    is_change = kind == "tried" and value.get("change", True) is True
    return LogRecord(number, entry=entry if is_change else None, answer=answer, supersedes=supersedes)


def _named(value: Any, *, key: str, site: Site) -> LogEntry:
    """Return the entry that a correction or withdrawal names."""
    try:
        if isinstance(value, dict):
            return _entry(value, site=site)
    except ValueError as error:
        raise ValueError(f'"{key}": {error}') from None
    raise ValueError(f'"{key}" is not an entry')


def _entry(value: dict[str, Any], *, site: Site) -> LogEntry:
    text, area = value.get("text"), value.get("area")
    if not isinstance(text, str) or not text.strip():
        raise ValueError('"text" is missing')
    if len(text) > TEXT_MAX_CHARS or CONTROL.search(text):
        raise ValueError(f'"text" is longer than {TEXT_MAX_CHARS} characters or has control characters')
    if area is not None and not isinstance(area, str):
        raise ValueError('"area" is neither an area id nor null')
    for key in ("question", "by"):
        name = value.get(key)
        if name is not None and not (isinstance(name, str) and is_name(name)):
            raise ValueError(f'"{key}" is not 1 to {NAME_MAX_CHARS} printable characters')
    prediction = value.get("prediction")
    if prediction is not None and (type(prediction) is not int or prediction < 1):
        raise ValueError('"prediction" is not the number of a receipt')
    try:
        at = parse_instant(value.get("at"), timezone=site.timezone)
    except ValueError as error:
        raise ValueError(f'"at": {error}') from None
    return LogEntry(at.astimezone(site.zone), text, area, value.get("question"), value.get("by"), prediction)


def is_name(text: str) -> bool:
    """Tell whether a text can stand for who wrote a line, or for a question."""
    return len(text.strip()) > 0 and len(text) <= NAME_MAX_CHARS and not CONTROL.search(text)


def _refused(name: str, *, text: str, number: int, why: str) -> InputError:
    return InputError(
        f"line {number} of {name} is not a log entry",
        code="E110",
        where=Where(name, number, text[:200]),
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
