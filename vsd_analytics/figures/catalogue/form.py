"""What the answers of a week are made from, and the few words that several of them share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.lazy_answers import LazyAnswers
from vsd_analytics.figures.week.model_recording import Coverage
from vsd_analytics.figures.week.results import AreaRow, Level, Timetable

DAYS: Final = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")


@dataclass(frozen=True, slots=True)
class FigureInputs:
    """One week of one floor, with everything its figures need.

    Attributes:
        data: The week.
        results: Those of `figures.week`, each computed when it is first read.
        coverage: Recorded hours.
        level: Headline numbers, already without what must be held back.
        areas: Areas, likewise.
        when: The timetable, likewise.
        is_ranked: The week was recorded well enough to say what is highest.
    """

    data: WeekData
    results: LazyAnswers
    coverage: Coverage
    level: Level
    areas: Sequence[AreaRow]
    when: Timetable
    is_ranked: bool

    @property
    def floor_id(self) -> str:
        """Return the floor."""
        return self.data.floor.floor_id

    @property
    def holds_for(self) -> HoldsFor:
        """Return what the answers are about."""
        return self.data.this.holds_for

    @property
    def recorded_h(self) -> float:
        """Return the recorded open camera-hours that enter rates."""
        return float(self.data.panel(self.data.everyone, self.data.week_days).x_h.sum())

    @property
    def why_no_person_time(self) -> Value | None:
        """Return why shares of person-time are not printed, as a value; None where they are."""
        if (why := self.data.this.why_no_exposure) is not None:
            return Value.missing(why, "not_measurable")
        if (why := self.data.hidden.why_floor) is not None:
            return Value.missing(why)
        return None

    @property
    def why_few_people(self) -> Value | None:
        """Return why nothing is printed of the few people who were on the floor, as a value; None where it is."""
        return None if self.data.hidden.why_untimed is None else Value.missing(self.data.hidden.why_untimed)

    @property
    def why_no_time_too_close(self) -> Value | None:
        """Return why nothing is printed of the time that people spent too close, as a value; None where it is.

        Where few violations are hidden, or few people, each of the figures made of that time would tell of them.
        """
        why = self.data.hidden.why_floor
        return self.why_few_people if why is None else Value.missing(why)

    @property
    def why_no_violations(self) -> Value | None:
        """Return why figures of violations are not printed, as a value; None where they are."""
        if self.level.violations is not None:
            return None
        return Value.missing(self.level.violation_rate.reason or NOTHING_OPEN, self.level.violation_rate.state)

    @property
    def why_not_ranked(self) -> Reason:
        """Return why a week that was recorded too little ranks nothing."""
        least = self.data.site.settings.min_coverage
        if self.coverage.recorded_h:
            return Reason("ranking.coverage", share=self.coverage.share, least=least)
        return Reason("ranking.nothing", least=least)

    def floor_answer(self, name: str, columns: Sequence[Column], cells: Row, *notes: Reason) -> Answer:
        """Return an answer with one row, that of the floor.

        Args:
            name: Its name.
            columns: Its columns but for `floor_id`, which comes first.
            cells: Its row but for `floor_id`.
            notes: Notes on all of it.
        """
        row: Row = {"floor_id": self.floor_id, **cells}
        every = (Column("floor_id", "key"), *columns)
        return Answer(name, every, (row,), self.holds_for, notes=tuple((None, note) for note in notes))

    def list_answer(
        self,
        name: str,
        columns: Sequence[Column],
        rows: Sequence[Row],
        *notes: tuple[int | None, Reason],
        nothing: Value | None = None,
    ) -> Answer:
        """Return an answer with a row for each of several things of the floor.

        Args:
            name: Its name.
            columns: Its columns but for `floor_id`, which comes first.
            rows: Its rows but for `floor_id`.
            notes: Notes on a row by its number, or on all.
            nothing: Why there are no rows, as `Value.missing`.
        """
        every = (Column("floor_id", "key"), *columns)
        full: tuple[Row, ...] = tuple({"floor_id": self.floor_id, **row} for row in rows)
        if nothing is None:
            return Answer(name, every, full, self.holds_for, notes=notes)
        reason, state = nothing.reason or NOTHING_OPEN, nothing.state
        return Answer(name, every, (), self.holds_for, notes=notes, nothing=reason, state=state)


AnswerMaker = Callable[[FigureInputs], tuple[Answer, ...]]
ANSWER_MAKERS: Final[dict[str, AnswerMaker]] = {}
"""The functions whose answers hold the figures, by catalogue id: what `answers` was put before."""


def answers(*metrics: str) -> Callable[[AnswerMaker], AnswerMaker]:
    """Return a decorator that puts a function into the catalogue as the one whose answers hold some figures.

    Args:
        metrics: Ids of the figures, each that of a SQL header; columns of the answers name them.

    Raises:
        ValueError: Another function makes one of them already.
    """

    def added(maker: AnswerMaker) -> AnswerMaker:
        for metric in metrics:
            if metric in ANSWER_MAKERS:
                raise ValueError(f"{metric} is made by {ANSWER_MAKERS[metric].__module__} already")
        ANSWER_MAKERS.update(dict.fromkeys(metrics, maker))
        return maker

    return added
