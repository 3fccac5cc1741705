"""What every family of figures is made from, and the few words they share."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any, Final

from vsd_analytics.answer import Answer, Reason, State
from vsd_analytics.figures.share.counts import is_small, too_few
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week import page_estimates
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.lazy_answers import LazyAnswers
from vsd_analytics.figures.week.model_estimate import Estimate, same_fields
from vsd_analytics.figures.week.model_recording import Coverage
from vsd_analytics.figures.week.results import AreaRow, Figure, Level, Timetable
from vsd_analytics.stats.estimates import RateEstimate

Plain = str | float | int | bool | Reason | None
Row = Mapping[str, Plain]
DAYS: Final = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")


@dataclass(frozen=True, slots=True)
class FigureInputs:
    """One week of one floor, with everything its figures need.

    Attributes:
        data: The week.
        found: The results of `figures.week`, each computed when it is first read.
        coverage: Recorded hours.
        level: Headline numbers, already without what must be held back.
        areas: Areas, likewise.
        when: The timetable, likewise.
        is_ranked: The week was recorded well enough to say what is highest.
        metric: The figure that is made, by catalogue id.
    """

    data: WeekData
    found: LazyAnswers
    coverage: Coverage
    level: Level
    areas: Sequence[AreaRow]
    when: Timetable
    is_ranked: bool
    metric: str = ""

    @property
    def unit(self) -> Reason:
        """Return the unit of the figure that is made, as the wording catalogue names it."""
        settings = self.data.site.settings
        return Reason(
            f"unit.{self.metric}",
            distance_m=settings.distance_m,
            outage_min=settings.outage_min_s / 60,
            contact_min=settings.contact_s / 60,
        )

    @property
    def below(self) -> int:
        """Return the smallest count that is printed."""
        return int(self.data.site.settings.mask_below)

    @property
    def recorded_h(self) -> float:
        """Return the recorded open camera-hours that enter rates."""
        return float(self.data.panel(self.data.everyone, self.data.week_days).x_h.sum())

    @property
    def is_counted(self) -> bool:
        """Return whether the week's violations may be printed at all."""
        return self.level.violations is not None

    @property
    def why_no_person_time(self) -> tuple[State, Reason] | None:
        """Return why shares of person-time are not printed."""
        if (why := self.data.why_no_exposure) is not None:
            return "not_measurable", why
        if (why := self.data.hidden.why_floor) is not None:
            return "not_enough_data", why
        return None

    def small(self, *counts: float | None) -> bool:
        """Return whether any of the counts is too small to print."""
        return any(n is not None and is_small(n, below=self.below) for n in counts)

    def missing(self, state: State, reason: Reason | None) -> Figure:
        """Return the figure without a value, and why."""
        state = "not_enough_data" if state == "ok" else state
        return Figure(unit=self.unit, state=state, reason=reason or NOTHING_OPEN)

    def held_back(self) -> Figure:
        """Return the figure without a value: its count is too small to print."""
        return self.missing("not_enough_data", too_few(self.below))

    def not_printed(self) -> Figure:
        """Return a figure of violations for a week whose violations may not be printed."""
        return self.missing(self.level.violation_rate.state, self.level.violation_rate.reason)

    def not_ranked(self) -> Figure:
        """Return a ranking in a week that was recorded too little for one."""
        least = self.data.site.settings.min_coverage
        why = Reason("ranking.nothing", least=least)
        if self.coverage.recorded_h:
            why = Reason("ranking.coverage", share=self.coverage.share, least=least)
        return self.missing("not_enough_data", why)

    def rate(self, rate: RateEstimate | None) -> Estimate:
        """Return a rate as an estimate without values that are too small to print."""
        none = Estimate(value=None, state="not_enough_data", reason=NOTHING_OPEN)
        return page_estimates.level(rate, below=self.below) or none

    def of_rows(self, rows: Sequence[Row], denominator: float | None, note: Reason) -> Figure:
        """Return rows as a figure; where none has a value, the first reason that one of them gives."""
        if all(row["value"] is None for row in rows):
            reason = next((why for row in rows if isinstance(why := row["reason"], Reason)), None)
            return self.missing("not_enough_data", reason)
        return Figure(unit=self.unit, rows=tuple(rows), denominator=denominator, note=note)

    def of_estimate(
        self, estimate: Estimate, denominator: float | None, *, rows: Sequence[Row] | None = None
    ) -> Figure:
        """Return an estimate as a figure."""
        if estimate.value is None:
            return self.missing(estimate.state, estimate.reason)
        of_rows = None if rows is None else tuple(rows)
        return same_fields(Figure, estimate, unit=self.unit, denominator=denominator, rows=of_rows)


Maker = Callable[[FigureInputs], Figure]
MAKERS: Final[dict[str, Maker]] = {}
"""The functions that make the figures, by catalogue id: what `figure` was put before."""


def figure(metric: str) -> Callable[[Maker], Maker]:
    """Return a decorator that puts a function into the catalogue as the one that makes a figure.

    Args:
        metric: Id of the figure, that of its SQL header.

    Raises:
        ValueError: Another function makes this figure already.
    """

    def added(maker: Maker) -> Maker:
        if metric in MAKERS:
            raise ValueError(f"{metric} is made by {MAKERS[metric].__module__} already")
        MAKERS[metric] = maker
        return maker

    return added


AnswerMaker = Callable[[FigureInputs], tuple[Answer, ...]]
ANSWER_MAKERS: Final[dict[str, AnswerMaker]] = {}
"""The functions that make the answers in which a figure is, by catalogue id: what `answers` was put before."""


def answers(*metrics: str) -> Callable[[AnswerMaker], AnswerMaker]:
    """Return a decorator that puts a function into the catalogue as the one that makes the answers of some figures.

    Args:
        metrics: Ids of the figures, those of their SQL headers.

    Raises:
        ValueError: Another function makes one of these figures already.
    """

    def added(maker: AnswerMaker) -> AnswerMaker:
        for metric in metrics:
            if metric in MAKERS or metric in ANSWER_MAKERS:
                raise ValueError(f"{metric} is made by {(MAKERS | ANSWER_MAKERS)[metric].__module__} already")
            ANSWER_MAKERS[metric] = maker
        return maker

    return added


def row(found: object, *names: str, **more: Plain) -> Row:
    """Return some attributes of a dataclass as a row; dates and instants as ISO text."""
    assert dataclasses.is_dataclass(found)
    return {name: plain(getattr(found, name)) for name in names} | more


def limits(name: str, estimate: Estimate | None) -> Row:
    """Return an estimate as three columns of a row: its value under a name, and both ends of its interval."""
    e = estimate or Estimate(value=None)
    return {name: e.value, f"{name}_lo": e.lo, f"{name}_hi": e.hi}


def plain(value: Any) -> Plain:
    """Return a value as JSON can hold it."""
    return value.isoformat() if isinstance(value, date | datetime) else value


def joined(reasons: Sequence[tuple[Reason, Reason | None]]) -> Reason | None:
    """Return reasons of several things as one, each after the name of its thing; None for none."""
    found = tuple(Reason("of", name=name, reason=reason) for name, reason in reasons if reason is not None)
    return Reason("joined", reasons=found) if found else None


def mean_name(key: str, *, agrees: bool | None) -> Reason:
    """Return the name of a row with a mean of dwell times, which says where the means by two ways disagree."""
    name = Reason(f"row.{key}")
    return Reason("row.disagree", name=name) if agrees is False else name
