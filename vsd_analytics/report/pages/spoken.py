"""In which words a report is written: its language, and for days that are no week the sentences of a range.

A sentence that speaks of a week has a second one under `range.` in the catalogue, with the places `{span}` and
`{span_before}`: the days of the report, and those it is compared with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import date, timedelta
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import DaysText, SpokenDays, about_days, say
from vsd_analytics.wording.languages import speaking

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def spoken_of(report: WeekReport) -> Iterator[None]:
    """Write everything inside the block in the words of a report."""
    week = report.week
    if week.is_week:
        with about_days(None):
            yield
        return
    span = timedelta(days=week.days)
    own, before = (_text(week.monday - by, week.sunday - by) for by in (timedelta(), span))
    names = {"span": own, "span_before": before, "span_days": fmt.n_days(week.days)}
    weeks = {week.number: own}
    if report.previous is not None:
        weeks[report.previous.number] = before
    with about_days(SpokenDays(names, weeks)):
        yield


def _text(first: date, last: date) -> DaysText:
    return DaysText(fmt.days_span(first, last), fmt.days_span_short(first, last))


def in_its_words(make: Callable[Concatenate[WeekReport, P], T]) -> Callable[Concatenate[WeekReport, P], T]:
    """Return a function of a report that writes in the language and the words of the report."""

    @wraps(make)
    def made(report: WeekReport, /, *args: P.args, **options: P.kwargs) -> T:
        with speaking(report.language), spoken_of(report):
            return make(report, *args, **options)

    return made


def week_before(report: WeekReport) -> str:
    """Return how a sentence speaks of the week before: week 45."""
    return say("words.week", number=report.previous.number) if report.previous else say("words.last_week")
