"""What else happened as the page shows it: the days of each series, and what its figures say in a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date
from typing import Final

from markupsafe import Markup

from vsd_analytics.answer import Answers, Row, Value, value_of
from vsd_analytics.report.draw.context_chart import SeriesDay, context_chart
from vsd_analytics.report.draw.trend_chart import NARROW, WIDE
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

SERIES_MAX: Final = 4
"""Series that a page shows; all are in the JSON file."""
_PER: Final = (
    ("context_conversion", "value_per_visit", "per_visit"),
    ("context_value", "value_per_person_h", "per_person_h"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesView:
    """A series: its name with its unit, its days drawn, and sentences."""

    name: str
    wide: Markup
    narrow: Markup
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextView:
    """The section.

    Attributes:
        series: The first series by name.
        rest: How many more there are, in a sentence; empty for none.
    """

    series: tuple[SeriesView, ...]
    rest: str


def context(report: WeekReport) -> ContextView | None:
    """Return what else happened; None where the report has no series."""
    days = report.answers.get("context_days")
    if days is None or not days.rows:
        return None
    names = list(dict.fromkeys(str(row["series"]) for row in days.rows))
    known = {name: [row for row in days.rows if row["series"] == name] for name in names}
    shown = [name for name in names if any(value_of(row, "series_value").value is not None for row in known[name])]
    rest = len(shown) - SERIES_MAX
    return ContextView(
        series=tuple(_series(report, name, known[name]) for name in shown[:SERIES_MAX]),
        rest=say("context.rest", plural=rest, n=fmt.count(rest)) if rest > 0 else "",
    )


def _series(report: WeekReport, name: str, rows: list[Row]) -> SeriesView:
    days = [SeriesDay(_date(row), value_of(row, "series_value").value) for row in rows]
    words = name.replace("_", " ")
    unit, title = str(rows[0]["value_unit"]), words[:1].upper() + words[1:]
    title = title if unit.lower() == words else say("context.name", name=title, unit=unit)
    label, is_sum = say("context.label", name=title), rows[0]["adds"] == "sum"
    wide, narrow = (
        context_chart(days, is_sum=is_sum, since=report.week.monday, width=width, label=label)
        for width in (WIDE, NARROW)
    )
    return SeriesView(name=title, wide=wide, narrow=narrow, lines=tuple(_lines(report.answers, name)))


def _date(row: Row) -> date:
    day = row["local_date"]
    return day if isinstance(day, date) else date.fromisoformat(str(day))


def _lines(answers: Answers, series: str) -> Iterator[str]:
    changes = answers.get("context_change")
    row = next(iter(() if changes is None else changes.where(series=series)), None)
    if row is not None:
        equal, plain, moved = (value_of(row, f"{n}_change") for n in ("equal_value", "violation_rate", "series"))
        difference = value_of(row, "series_difference").value
        if moved.value is not None:
            yield say("context.moved", change=fmt.signed(moved.value))
        elif difference is not None:
            yield say("context.moved", change=f"{fmt.signed_fixed(difference, 1)} {row['value_unit']}")
        if equal.value is None:
            yield say("context.no_equal", reason=_why(equal))
        else:
            verdict = terms.said_verdict(row["equal_value_verdict"])  # type: ignore[arg-type]
            likely = fmt.likely_between(equal.lo, equal.hi)
            yield say(
                "context.equal", change=fmt.signed(equal.value), likely=likely, verdict=verdict,
                plain=fmt.signed(plain.value),
            )  # fmt: skip
    for name, column, key in _PER:
        answer = answers.get(name)
        for each in () if answer is None else answer.where(series=series):
            value = value_of(each, column)
            if value.value is not None:
                low, high = (fmt.number(end) for end in (value.lo, value.hi))
                likely = "" if value.lo is None else say("context.likely", low=low, high=high)
                place, unit = str(each["name"]), str(each["value_unit"])
                yield say(f"context.{key}", value=fmt.number(value.value), likely=likely, place=place, unit=unit)


def _why(value: Value) -> str:
    return reason_text(value.reason) or say("words.too_little_data")
