"""Which weeks were mailed to whom: `mail/sent.jsonl` in the project, so that a week reaches nobody twice.

One JSON object a line, on the disk before the mail is handed over and again afterwards. It holds addresses, so only its
owner may read it, and it never lies among the reports, which may be published.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Final, Literal

from vsd_analytics.errors import MailError, Where, disk_error
from vsd_analytics.store import file_locks

FOLDER: Final = "mail"
"""Below the project, not among the reports: these may be published, and mails hold addresses."""
FILE: Final = "sent.jsonl"
Step = Literal["begun", "sent", "not sent"]
Key = tuple[str, str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Week:
    """What a mail is about.

    Attributes:
        floor_id: Floor of the report.
        week: ISO week of a weekly page; for a card, its day.
    """

    floor_id: str
    week: str


class SentLog:
    """The file, held by one command at a time; use it as a context manager.

    Args:
        path: The file; made when the first mail is begun.

    Raises:
        MailError: E809, another command holds it (on entering).
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._fd = -1
        self._last: dict[Key, tuple[Step, str]] = {}

    def __enter__(self) -> SentLog:
        file_locks.require_locks(self._path)
        self._fd = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        try:
            file_locks.take(self._fd, is_waiting=False)
        except OSError:
            os.close(self._fd)
            raise MailError(
                "another command is sending mail of this project",
                code="E809",
                where=Where(str(self._path)),
                fix="wait until it ends, then run this one again: what was sent is not sent twice",
            ) from None
        for line in self._path.read_bytes().splitlines():
            self._note(line)
        return self

    def __exit__(self, _: type[BaseException] | None, __: BaseException | None, ___: TracebackType | None) -> None:
        os.close(self._fd)

    def step(self, week: Week, address: str) -> Step | None:
        """Return how far the mail of a week got for an address; None = it was never begun."""
        last = self._last.get(_key(week, address))
        return None if last is None else last[0]

    def message_id(self, week: Week, address: str) -> str | None:
        """Return the Message-ID of the last mail of a week to an address."""
        last = self._last.get(_key(week, address))
        return None if last is None else last[1]

    def note(self, week: Week, steps: Mapping[str, Step], *, message_id: str, at: datetime) -> None:
        """Write a step for each address, durably.

        Raises:
            DiskError: E304 to E306, the disk refuses.
        """
        lines = [
            json.dumps(
                {
                    "week": week.week,
                    "floor": week.floor_id,
                    "to": address,
                    "step": step,
                    "message_id": message_id,
                    "at": at.isoformat(timespec="seconds"),
                }
            ).encode()
            for address, step in steps.items()
        ]
        size = os.fstat(self._fd).st_size
        is_torn = size > 0 and os.pread(self._fd, 1, size - 1) != b"\n"  # a crash in the middle of a line
        data = b"\n" * is_torn + b"".join(line + b"\n" for line in lines)
        try:
            if os.write(self._fd, data) < len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self._path))
            os.fsync(self._fd)
        except OSError as error:
            raise disk_error(error, path=self._path) or error from None
        for line in lines:
            self._note(line)

    def _note(self, line: bytes) -> None:
        if (read := _read(line)) is not None:
            key, step, message_id = read
            self._last[key] = step, message_id


def last_steps(path: Path) -> dict[Key, Step]:
    """Return how far each mail got, by floor, week and address in small letters; nothing where there is no file."""
    lines = path.read_bytes().splitlines() if path.exists() else []
    return {key: step for key, step, _ in filter(None, map(_read, lines))}


def _read(line: bytes) -> tuple[Key, Step, str] | None:
    """Return what a line says; None = it is torn: a step that is not whole on the disk was never acted on."""
    try:
        record = json.loads(line)
        key = str(record["floor"]), str(record["week"]), str(record["to"]).casefold()
        return key, record["step"], str(record["message_id"])
    except (ValueError, KeyError, TypeError):
        return None


def to_send(
    log: SentLog, week: Week, addresses: Sequence[str], *, is_again: bool = False
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return who a week is to be sent to, and who has it already.

    Args:
        log: The file.
        week: What the mail is about.
        addresses: Everybody it is meant for.
        is_again: Send it whatever the file says.

    Raises:
        MailError: E807, it is not known whether an earlier mail of the week arrived.
    """
    if is_again:
        return tuple(addresses), ()
    unknown = [a for a in addresses if log.step(week, a) == "begun"]
    if unknown:
        raise MailError(
            f"it is not known whether {week.week} reached {', '.join(unknown)}",
            code="E807",
            why="an earlier command handed the mail over and broke off before it was answered",
            fix="ask a recipient; if it did not come: the same command with --again",
        )
    has = tuple(a for a in addresses if log.step(week, a) == "sent")
    return tuple(a for a in addresses if a not in has), has


def _key(week: Week, address: str) -> Key:
    return week.floor_id, week.week, address.casefold()
