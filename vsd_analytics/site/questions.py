"""Questions that weekly reports ask, and their answers, which the site's log holds."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from typing import Literal

AnswerKind = Literal["tried", "not-possible", "later"]


@dataclass(frozen=True, slots=True)
class QuestionAnswer:
    """What became of a question of the report.

    Attributes:
        at: Instant of the answer; of the change, where it was tried.
        question: Id of the question.
        kind: "tried", "not-possible" (never asked again) or "later" (asked again after four weeks).
        text: Free text, always escaped.
        area_id: Area the question was about; None = none.
        by: Who answered; None = not stated.
    """

    at: datetime
    question: str
    kind: AnswerKind
    text: str
    area_id: str | None = None
    by: str | None = None


@dataclass(frozen=True, slots=True)
class AskedQuestion:
    """A question that a weekly report asked.

    Attributes:
        monday: First day of the report's week.
        floor_id: Floor of the report.
        question_id: Its id, such as "Q46-entrance-clear".
        place: What it was about: the id of an area or camera, "rest" or "floor".
        remedy: What it proposed, such as "wait" or "move-display".
        text: Its words.
        area_id: Area it was about; None = none.
        is_change: To try it is to change the site, so that "tried" is an entry of the change log.
    """

    monday: date
    floor_id: str
    question_id: str
    place: str
    remedy: str
    text: str
    area_id: str | None = None
    is_change: bool = True
