"""What was written into the site's log, newest first, by whom, and what of it can be taken back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

from vsd_analytics.config.change_log import entry_ids, read_answers
from vsd_analytics.config.log_records import LogRecord, read_records
from vsd_analytics.site.model import Site

LineKind = Literal["logged", "corrected", "tried", "not-possible", "later", "undone"]


@dataclass(frozen=True, slots=True)
class HistoryLine:
    """One line of the log.

    Attributes:
        line: Its number in the file.
        kind: What was done.
        at: When the change was made, the question answered, or a line taken back; None = not stated.
        text: What it says.
        area_id: Area it concerns; None = the whole site.
        by: Who wrote it; None = not stated.
        undo: Id by which it is taken back; None = it does not hold any more, or takes something back itself.
        is_gone: It was taken back, or corrected by a later line.
        question: Id of the question it answers; None = none.
    """

    line: int
    kind: LineKind
    at: datetime | None
    text: str
    area_id: str | None
    by: str | None
    undo: str | None
    is_gone: bool
    question: str | None = None


def desk_history(site: Site) -> tuple[HistoryLine, ...]:
    """Return the lines of the log, the last one first.

    Raises:
        InputError: A line is not an entry (E110).
    """
    records, ids = read_records(site), entry_ids(site)
    last = {answer.question: answer for answer in read_answers(site)}
    lines, seen = [], set[str]()
    for record in reversed(records):
        line = _line(record)
        undo = None
        if record.entry is not None:
            undo = ids.get(record.entry)
        elif record.answer is not None and last.get(record.answer.question) == record.answer:
            undo = record.answer.question
        if undo in seen:  # the same entry twice: the last line represents both
            undo = None
        if undo is not None:
            seen.add(undo)
        is_gone = undo is None and line.kind != "undone"
        lines.append(replace(line, undo=undo, is_gone=is_gone))
    return tuple(lines)


def _line(record: LogRecord) -> HistoryLine:
    statement = record.entry or record.answer or record.supersedes
    if statement is None:
        raise AssertionError("a line says something")
    kind: LineKind = "corrected" if record.supersedes is not None else "logged"
    at, by = statement.at, statement.by
    if record.answer is not None:
        kind = record.answer.kind
    elif record.entry is None:
        kind, at, by = "undone", record.withdrawn_at or statement.at, record.withdrawn_by
    question = None if record.answer is None else record.answer.question
    return HistoryLine(
        record.line, kind, at, statement.text, statement.area_id, by, None, is_gone=False, question=question
    )
