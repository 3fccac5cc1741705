"""What a week may ask, what earlier weeks asked, and what is being watched: the memory of the report's questions."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime

from vsd_analytics.figures.week.model_estimate import described as _f
from vsd_analytics.figures.week.model_estimate import optional as _o
from vsd_analytics.site.questions import AnswerKind


@dataclass(frozen=True, slots=True, kw_only=True)
class Remedy:
    """One thing to ask about a place."""

    key: str = _f("What it proposes, such as wait or move-display; part of the question's id.")
    text: str = _f("The question, with the hours it is about.")
    again: str = _f("The same in other words, for a week that asks it again.")
    short: str = _f("The question without hours, as on the card of a spot.")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceToAsk:
    """A place that a question may be about, and what may be asked there."""

    place: str = _f("Id of the area, or rest.")
    area_id: str | None = _o("Area it is; None for the rest of the floor.")
    name: str = _f("What the page calls it; free text.")
    remedies: tuple[Remedy, ...] = _f("First what fits best.", default=())
    is_testable: bool = _f(
        "Another area serves for comparison, so that later weeks can tell what a change did (vsd plan).", default=True
    )
    changed_on: date | None = _o(
        "Local day of a logged change of the last four weeks: it is watched, and nothing else is asked there.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PastQuestion:
    """A question of an earlier week's report, and what became of it."""

    question_id: str = _f("Its id.")
    monday: date = _f("First day of the week that asked.")
    number: int = _f("That week's number in the year.")
    text: str = _f("Its words.")
    place: str = _f("What it was about: the id of an area or camera, rest or floor.")
    remedy: str = _f("What it proposed.")
    answer: AnswerKind | None = _o("The last answer up to the end of this report's week; None: none.")
    answered_at: datetime | None = _o("When that was; for tried, when the change was made.")
    answer_text: str = _f("What was done, or why not; free text.", default="")
    by: str | None = _o("Who answered; free text.")
    change: int | None = _o("Number in the log of the change that was tried.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Agenda:
    """What this week may ask and what earlier weeks did."""

    places: tuple[PlaceToAsk, ...] = _f("The busiest first; only places that hold a material share.", default=())
    asked: tuple[PastQuestion, ...] = _f(
        "What the reports of the year before asked, oldest first, and this week's own once it is answered.", default=()
    )
    busiest_before: tuple[str, ...] = _f(
        "Ids of the areas with most violations in each of the eight weeks before, the latest first; weeks without "
        "figures are left out.",
        default=(),
    )
