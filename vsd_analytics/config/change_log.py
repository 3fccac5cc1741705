"""The site's change log: what was moved, when and where, and how the report's questions were answered.

`log.jsonl` only grows (`log_records`): a correction is a new line. Entries with the same instant, text and area count
as one entry, even if the file repeats them. An entry has an id that stays when it is corrected, and no other entry ever
gets; its number in the list changes with the entries before it.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import count
from typing import Any, Final

from vsd_analytics.config.asked_questions import asked_question
from vsd_analytics.config.log_records import (
    FILE,
    NAME_MAX_CHARS,
    TEXT_MAX_CHARS,
    LogRecord,
    add_line,
    entry_dict,
    is_name,
    read_records,
    torn_lines,
)
from vsd_analytics.config.predictions import read_predictions
from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import CONTROL, UsageError, nearest
from vsd_analytics.site.model import LogEntry, Site
from vsd_analytics.site.questions import AnswerKind, QuestionAnswer
from vsd_analytics.store.durable import digest

__all__ = ["FILE", "add_answer", "add_entry", "edit_entry", "entry_dict", "entry_ids", "read_answers", "read_log",
           "remove_entry", "torn_lines"]  # fmt: skip

_ID: Final = re.compile(r"e[0-9a-f]{8}")
AS_IT_IS: Final = "*"
"""For `edit_entry`: the area of the entry stays."""


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


@dataclass(frozen=True, slots=True)
class Superseded:
    """What became of an entry that was corrected or taken back.

    Attributes:
        before: The entry as it was; of an answer that changed nothing, its time, text and area.
        after: As it is now; None = taken back.
        is_new: This call did it; False = it was taken back before.
    """

    before: LogEntry
    after: LogEntry | None = None
    is_new: bool = True


def read_log(site: Site) -> tuple[LogEntry, ...]:
    """Return the changes of the log by time, as corrected; those of one instant in the order in which they were added.

    Lines that broke off are no entries; `torn_lines` names them.

    Raises:
        InputError: A line is not an entry (E110).
    """
    return _entries(read_records(site))


def entry_ids(site: Site) -> dict[LogEntry, str]:
    """Return the id of each entry in force.

    Raises:
        InputError: A line is not an entry (E110).
    """
    return _Ids(read_records(site)).current


def read_answers(site: Site) -> tuple[QuestionAnswer, ...]:
    """Return the answers to the report's questions in the order in which they were given, without those taken back.

    Raises:
        InputError: A line is not an entry (E110).
    """
    return tuple(dict.fromkeys(_answers(read_records(site))))


def add_entry(
    site: Site, *, text: str, at: str | datetime, area: str | None = None, by: str | None = None,
    prediction: int | None = None,
) -> Added:  # fmt: skip
    """Add one entry, durably: it is on disk when this returns. An entry that is there already is not added again.

    Args:
        site: The site.
        text: What was changed, one line.
        at: When: ISO text or datetime; without an offset in the site's zone, a date is its midnight.
        area: Id of the area it concerns; None = the whole site.
        by: Who logs it; None = not stated.
        prediction: Number of the receipt of `vsd whatif` that foresaw it; None = none.

    Raises:
        UsageError: No text, no time, too long a name, or an area or receipt the site does not have (E101).
        DiskError: E304 to E306, the disk refused; the log is as before.
    """
    n_receipts = 0 if prediction is None else len(read_predictions(site))
    if prediction is not None and not 1 <= prediction <= n_receipts:
        raise UsageError(
            f"there is no prediction {prediction}", why=f"predictions.jsonl has {n_receipts}",
            fix="vsd whatif --scores lists them",
        )  # fmt: skip
    entry = LogEntry(_instant(at, site), _one_line(text), _known_area(area, site), by=_name(by), prediction=prediction)
    is_new = True

    def line(records: tuple[LogRecord, ...]) -> dict[str, Any] | None:
        nonlocal is_new
        is_new = entry not in _entries(records)
        return entry_dict(entry) | _signed(by) | _foreseen(entry) if is_new else None

    removed = add_line(site, line)
    return Added(entry, is_new, removed)


def add_answer(
    site: Site,
    question_id: str,
    kind: AnswerKind,
    *,
    at: str | datetime,
    text: str | None = None,
    by: str | None = None,
) -> QuestionAnswer:
    """Add the answer to a question of the report, durably.

    "tried" is a change of the question's area at that time, so the reports compare before and after it. "not-possible"
    is never asked again; "later" is asked again after four weeks. A later answer supersedes an earlier one.

    Args:
        site: The site.
        question_id: Id of the question, as on the page.
        kind: What became of it.
        at: When; for "tried", when the change was made.
        text: What was done, or why not; None = the words of the question.
        by: Who answers.

    Raises:
        UsageError: E101, no such question was asked, no time, or too long a text.
        DiskError: E304 to E306, the disk refused; the log is as before.
    """
    asked = asked_question(site, question_id)
    answer_text = _one_line(asked.text if text is None else text)
    answer = QuestionAnswer(_instant(at, site), asked.question_id, kind, answer_text, asked.area_id, _name(by))
    line: dict[str, Any] = {"at": answer.at.isoformat(), "text": answer_text, "area": asked.area_id}
    line |= {"question": asked.question_id, "answer": kind} | _signed(by)
    if kind == "tried" and not asked.is_change:
        line["change"] = False
    add_line(site, lambda records: None if any(r.answer == answer for r in records) else line)
    return answer


def edit_entry(
    site: Site, which: str, *, text: str | None = None, at: str | datetime | None = None, area: str | None = AS_IT_IS
) -> Superseded:
    """Correct an entry: a new line supersedes it, the old one stays in the file.

    Args:
        site: The site.
        which: The entry's id. Or its number in the list, unless the correction moves it to another one.
        text: What it says now; None = as before.
        at: When; None = as before.
        area: Id of the area, None for the whole site; `AS_IT_IS` = as before.

    Raises:
        UsageError: E101, no such entry, or nothing to correct.
        InputError: A line is not an entry (E110).
        DiskError: E304 to E306, the disk refused; the log is as before.
    """
    entry = _chosen(site, which)
    new = replace(
        entry,
        text=entry.text if text is None else _one_line(text),
        at=entry.at if at is None else _instant(at, site),
        area_id=entry.area_id if area == AS_IT_IS else _known_area(area, site),
    )
    if new == entry:
        raise UsageError("the entry says this already", fix=f'vsd log edit {which} --text "…" --at … --area ID')
    if which.isdecimal() and _moves(read_log(site), entry, new):
        raise _by_id(site, entry, which, f"edit ID --at {new.at.isoformat(timespec='minutes')}", done="corrected")

    def line(records: tuple[LogRecord, ...]) -> dict[str, Any]:
        _still_there(records, entry)
        if new in _entries(records):
            raise UsageError(
                "the log has another entry with this time, area and text",
                fix=f"vsd log remove {_Ids(records).current[new]}",
            )
        more: dict[str, Any] = {} if new.question is None else {"question": new.question, "answer": "tried"}
        more |= _signed(new.by) | _foreseen(new)
        return {**entry_dict(new), **more, "replaces": entry_dict(entry)}

    add_line(site, line)
    return Superseded(entry, new)


def remove_entry(site: Site, which: str, *, at: str | datetime, by: str | None = None) -> Superseded:
    """Take an entry or an answer back: a new line says so, the old one stays in the file.

    An entry that is taken back a second time changes nothing.

    Args:
        site: The site.
        which: The entry's id; or the id of a question, whose last answer is taken back.
        at: When it is taken back.
        by: Who takes it back; None = not stated.

    Raises:
        UsageError: E101, no such entry, or a number, which is that of another entry as soon as this one is taken back.
        InputError: A line is not an entry (E110).
        DiskError: E304 to E306, the disk refused; the log is as before.
    """
    records, when, signed = read_records(site), _instant(at, site), _signed(_name(by))
    if (gone := _Ids(records).gone.get(which)) is not None:
        return Superseded(gone, is_new=False)
    if (answer := _last_answer(records, which)) is not None:
        entry = LogEntry(answer.at, answer.text, answer.area_id, answer.question)
    else:
        entry = _chosen(site, which)
    if which.isdecimal():
        raise _by_id(site, entry, which, "remove ID", done="taken back")

    def line(records: tuple[LogRecord, ...]) -> dict[str, Any]:
        if answer is None or answer not in _answers(records):
            _still_there(records, entry)
        named = {} if answer is None else {"question": answer.question}
        return {"at": when.isoformat(), "removes": entry_dict(entry) | named, **signed}

    add_line(site, line)
    return Superseded(entry)


def _answers(records: tuple[LogRecord, ...]) -> list[QuestionAnswer]:
    """Return the answers in force, in the order in which they were given."""
    current, answers = set(_entries(records)), list[QuestionAnswer]()
    for record in records:
        if (gone := record.supersedes) is not None and record.entry is None and gone.question is not None:
            named = (gone.question, gone.at, gone.text, gone.area_id)
            answers = [a for a in answers if (a.question, a.at, a.text, a.area_id) != named]
        if record.answer is not None and (record.entry is None or record.entry in current):
            answers.append(record.answer)
    return answers


def _last_answer(records: tuple[LogRecord, ...], question_id: str) -> QuestionAnswer | None:
    given = [a for a in _answers(records) if a.question == question_id]
    return given[-1] if given else None


def _name(by: str | None) -> str | None:
    if by is not None and not is_name(by):
        raise UsageError(f"--by must be 1 to {NAME_MAX_CHARS} printable characters", fix='--by "Anna"')
    return by


def _foreseen(entry: LogEntry) -> dict[str, Any]:
    return {} if entry.prediction is None else {"prediction": entry.prediction}


def _signed(by: str | None) -> dict[str, str]:
    return {} if by is None else {"by": by}


def _entries(records: tuple[LogRecord, ...]) -> tuple[LogEntry, ...]:
    """Return the entries in force, by time."""
    current: dict[LogEntry, None] = {}
    for record in records:
        if record.supersedes is not None:
            current.pop(record.supersedes, None)
        if record.entry is not None:
            current.setdefault(record.entry)
    return tuple(sorted(current, key=lambda entry: entry.at))


class _Ids:
    """The ids of the entries of a log.

    Args:
        records: What the lines say, in order.

    Attributes:
        current: Id of each entry in force.
        gone: Entries that were taken back, by id.
    """

    def __init__(self, records: tuple[LogRecord, ...]) -> None:
        self.current: dict[LogEntry, str] = {}
        self.gone: dict[str, LogEntry] = {}
        for record in records:
            before = None if record.supersedes is None else self.current.pop(record.supersedes, None)
            if record.entry is not None and record.entry not in self.current:
                self.current[record.entry] = before or self._new(record.entry)
            elif before is not None and record.supersedes is not None:
                self.gone[before] = record.supersedes

    def _new(self, entry: LogEntry) -> str:
        content = [entry.at.astimezone(UTC).isoformat(), entry.text, entry.area_id]
        for n_same in count():
            name = "e" + digest(json.dumps([*content, *([n_same] if n_same else [])]).encode())[:8]
            if name not in self.gone and name not in self.current.values():
                return name
        raise AssertionError("count never ends")


def _chosen(site: Site, which: str) -> LogEntry:
    """Return the entry in force with an id, or with a number in the list."""
    entries = read_log(site)
    if not which.isdecimal():
        named = {name: entry for entry, name in entry_ids(site).items()}
        if which in named:
            return named[which]
        if not _ID.fullmatch(which):
            raise UsageError(f"{which!r} is neither an id nor a number of an entry", fix="vsd log list")
    elif 1 <= int(which) <= len(entries):
        return entries[int(which) - 1]
    why = f"it has {len(entries)}" if entries else "it is empty"
    raise UsageError(f"the change log has no entry {which}", why=why, fix="vsd log list")


def _moves(entries: tuple[LogEntry, ...], entry: LogEntry, new: LogEntry) -> bool:
    """Tell whether an entry has another number once it is corrected."""
    others = [each for each in entries if each != entry]
    return sorted([*others, new], key=lambda e: e.at).index(new) != entries.index(entry)


def _by_id(site: Site, entry: LogEntry, which: str, command: str, *, done: str) -> UsageError:
    name = entry_ids(site)[entry]
    return UsageError(
        f"entry {which} is {done} by its id, {name}",
        why=f"the same command again would mean another entry; {which} is now: {entry.at.date()} {entry.text[:60]}",
        fix=f"vsd log {command.replace('ID', name, 1)}",
    )


def _still_there(records: tuple[LogRecord, ...], entry: LogEntry) -> None:
    if entry not in _entries(records):
        raise UsageError("somebody else corrected or removed this entry just now", fix="vsd log list")


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
