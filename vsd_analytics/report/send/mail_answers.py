"""Answers to the question of the week that came by mail: from a button of the page, or as a reply to the weekly mail.

Anybody can send a mail under any name, so nothing is stored before the operator has seen what it says.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from email import message_from_bytes
from email.errors import MessageError
from email.message import EmailMessage
from email.policy import default
from email.utils import parseaddr, parsedate_to_datetime
from typing import Final

from vsd_analytics.config.asked_questions import read_asked
from vsd_analytics.config.log_records import NAME_MAX_CHARS, TEXT_MAX_CHARS
from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import CONTROL
from vsd_analytics.report.pages.replies import KINDS
from vsd_analytics.resources import LANGUAGES
from vsd_analytics.site.model import Site
from vsd_analytics.site.questions import AnswerKind
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import speaking

MAIL_MAX_BYTES: Final = 2_000_000
BODY_MAX_CHARS: Final = 20_000
_QUOTED: Final = re.compile(r"^(>|--\s*$|-{5}|_{5}|on .* wrote:|il .* ha scritto:)", re.IGNORECASE)
"""Lines with which what was answered begins."""


class NoAnswerError(Exception):
    """A mail is no answer; the argument says why, in words."""


@dataclass(frozen=True, slots=True)
class MailAnswer:
    """What a mail answers.

    Attributes:
        question_id: Id of the question.
        kind: What became of it.
        at: When it was tried, as the mail says; else when the mail was sent.
        text: What was done, or why not; empty where the mail does not say.
        by: Who sent it, as the mail says.
    """

    question_id: str
    kind: AnswerKind
    at: datetime
    text: str
    by: str | None


def mail_answer(data: bytes, site: Site) -> MailAnswer:
    """Return the answer that a mail gives.

    Args:
        data: The mail as a file, such as an `.eml`.
        site: The site whose reports asked.

    Raises:
        NoAnswerError: It names no question of this site, or gives none of the answers.
    """
    if len(data) > MAIL_MAX_BYTES:
        raise NoAnswerError(f"it is larger than {MAIL_MAX_BYTES // 1_000_000} MB")
    try:
        mail = message_from_bytes(data, policy=default)
        subject, body = str(mail["Subject"] or ""), _body(mail)
        sender, sent = str(mail["From"] or ""), _sent(mail)
    except (MessageError, LookupError, ValueError, TypeError) as error:
        raise NoAnswerError(f"it cannot be read as a mail ({type(error).__name__})") from None
    own = list(_own_lines(body))
    question_id = _question(f"{subject}\n{body}", site)
    kind = _kind(subject.casefold().rpartition(question_id.casefold())[2]) or _kind(own[0] if own else "")
    if kind is None:
        raise NoAnswerError("it begins with none of the answers: tried, later, not possible")
    at, text = _at(own, site), _text(own)
    name, address = parseaddr(sender)
    by = " ".join((name or address.partition("@")[0]).split())[:NAME_MAX_CHARS]
    return MailAnswer(
        question_id, kind, (at or sent).astimezone(site.zone), text, None if not by or CONTROL.search(by) else by
    )


def _body(mail: EmailMessage) -> str:
    part = mail.get_body(("plain",))
    return "" if part is None else str(part.get_content())[:BODY_MAX_CHARS]


def _sent(mail: EmailMessage) -> datetime:
    try:
        sent = parsedate_to_datetime(str(mail["Date"]))
    except (ValueError, TypeError):
        raise NoAnswerError("it does not say when it was sent") from None
    return sent if sent.tzinfo is not None else sent.replace(tzinfo=UTC)


def _own_lines(body: str) -> Iterator[str]:
    """Yield the lines that the sender wrote: those before what was answered."""
    for line in body.splitlines():
        if _QUOTED.match(line.strip()):
            return
        if line.strip():
            yield " ".join(line.split())


def _question(text: str, site: Site) -> str:
    """Return the id of the question that a text names; of two that begin alike, the longer one."""
    known = sorted({one.question_id for one in read_asked(site)}, key=len, reverse=True)
    for question_id in known:
        if re.search(rf"(?<![\w-]){re.escape(question_id)}(?![\w-])", text, re.IGNORECASE):
            return question_id
    raise NoAnswerError("it names no question that a report of this site asked")


def _kind(text: str) -> AnswerKind | None:
    """Return the answer with which a text begins, in any language of pages."""
    folded = text.strip(" :.,!*").casefold()
    for word, kind in sorted(_words().items(), key=lambda item: -len(item[0])):
        if re.match(rf"{re.escape(word)}(?!\w)", folded):
            return kind
    return None


def _words() -> dict[str, AnswerKind]:
    kinds: dict[str, AnswerKind] = {kind: kind for kind in KINDS}
    for language in LANGUAGES:
        with speaking(language):
            for kind in KINDS:
                for table in ("kind", "answer"):
                    kinds[say(f"desk.{table}.{kind.replace('-', '_')}").casefold()] = kind
    return kinds


def _labelled(own: list[str], key: str) -> str | None:
    """Return what follows a label of the mail that a button writes; None where it has none."""
    for language in LANGUAGES:
        with speaking(language):
            label = f"{say(key)}:"
        for line in own:
            if line.startswith(label):
                return line.removeprefix(label).strip()
    return None


def _at(own: list[str], site: Site) -> datetime | None:
    given = _labelled(own, "desk.field.when")
    if not given:
        return None
    try:
        return parse_instant(given.replace(" ", "T", 1), timezone=site.timezone)
    except ValueError:
        raise NoAnswerError(f"the time {given[:40]!r} cannot be read: write it as 2026-11-18 07:00") from None


def _text(own: list[str]) -> str:
    """Return what was done or why not: after its label, or after the answer's word in a reply."""
    text = _labelled(own, "desk.field.what_done")
    if text is None:
        first = own[0] if own else ""
        word = max((w for w in _words() if first.casefold().startswith(w)), key=len, default="")
        text = " ".join([first[len(word) :].strip(" :.,!*"), *own[1:]]).strip() if word else ""
    text = " ".join(text.split())
    if len(text) > TEXT_MAX_CHARS or CONTROL.search(text):
        raise NoAnswerError(f"its text is longer than {TEXT_MAX_CHARS} characters, or has control characters")
    return text
