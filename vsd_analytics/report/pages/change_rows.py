"""The table of what changed: areas and the whole floor as rows of texts, each with the bar of its interval."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from markupsafe import Markup

from vsd_analytics.answer import Reason
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.report.draw import svg
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

UNSEEN: Final = Reason("recorded.nothing")
CLEAR: Final = ("clear_fall", "clear_rise")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeRow:
    """One row of the table of changes: texts and the interval bar."""

    name: str
    previous: str
    value: str
    bar: Markup
    words: str
    detail: str
    direction: str
    is_total: bool


def change_rows(report: WeekReport, *, limit: float) -> tuple[ChangeRow, ...]:
    """Return a row for each area and one for the floor.

    Where no area clearly changed, the title and the row of the floor say so: areas have their ranges alone.

    Args:
        report: The report.
        limit: Greatest change that the bars show.
    """
    pairs = [
        (a, replace(a.violation_rate, reason=UNSEEN) if a.recorded_share == 0 else a.violation_rate)
        for a in report.areas
    ]
    is_brief = not any(violation_rate.verdict in CLEAR for _, violation_rate in pairs)
    rows = [
        _row(a.name, violation_rate, limit=limit, is_masked=a.is_masked, is_brief=is_brief)
        for a, violation_rate in pairs
    ]
    return (*rows, _row(say("changed.whole"), report.level.violation_rate, limit=limit, is_total=True))


def _row(
    name: str,
    estimate: Estimate,
    *,
    limit: float,
    is_masked: bool = False,
    is_brief: bool = False,
    is_total: bool = False,
) -> ChangeRow:
    if is_masked:
        estimate = Estimate(value=None, verdict="too_little_data", reason=Reason("hidden.area"))
    clear = estimate.verdict in CLEAR
    words = say("changed.not_measurable") if estimate.state == "not_measurable" else terms.verdict_words(estimate)
    unknown = estimate.change is None
    span = fmt.range_signed(estimate)
    detail = span or reason_text(estimate.reason)
    if estimate.reason == GIVES_AWAY:
        words, detail = say("changed.held"), say("changed.held_text")
    elif is_brief and span and estimate.verdict == "cannot_tell":
        words, detail = span, ""
    return ChangeRow(
        name=name,
        previous=fmt.number(estimate.previous),
        value=fmt.number(estimate.value),
        bar=svg.change_bar(estimate, limit=limit),
        words=say("changed.clear", verdict=words, change=fmt.signed(estimate.change))
        if clear and not unknown
        else words,
        detail=detail,
        direction=terms.direction(estimate.verdict),
        is_total=is_total,
    )
