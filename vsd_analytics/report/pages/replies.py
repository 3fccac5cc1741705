"""How the question of a week is answered where it is read: at the desk, or by a mail that `vsd inbox` reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from urllib.parse import quote, urlencode

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.site.questions import AnswerKind
from vsd_analytics.wording.catalogue import say

KINDS: Final[tuple[AnswerKind, ...]] = ("tried", "later", "not-possible")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplyButton:
    """One answer to the question of the week.

    Attributes:
        name: Its words.
        address: Where it leads: a form of the desk, or a mail to be sent.
    """

    name: str
    address: str


def reply_buttons(report: WeekReport, *, is_at_desk: bool) -> tuple[ReplyButton, ...]:
    """Return a button for each answer; none where nothing is asked.

    Args:
        report: The finished report.
        is_at_desk: The page is served by the desk; else the buttons write a mail, whose subject `vsd inbox` reads.
    """
    if report.story is None or not report.story.question_id:
        return ()
    question_id, question = report.story.question_id, report.story.question
    return tuple(
        ReplyButton(
            name=say(f"desk.answer.{kind.replace('-', '_')}"),
            address=_form(question_id, kind) if is_at_desk else _mail(question_id, question, kind),
        )
        for kind in KINDS
    )


def _form(question_id: str, kind: AnswerKind) -> str:
    return f"/desk?{urlencode({'question': question_id, 'answer': kind})}"


def _mail(question_id: str, question: str, kind: AnswerKind) -> str:
    """Return the address of a mail: the subject has the answer, the first line is for what was done."""
    subject = say("asked.mail_subject", id=question_id, answer=kind)
    lines = [f"{say('desk.field.what_done')}: ", "", *([f"{say('desk.field.when')}: "] if kind == "tried" else [])]
    body = "\r\n".join([*lines, "", "--", question])
    return f"mailto:?subject={quote(subject, safe='')}&body={quote(body, safe='')}"
