"""What each area adds to the floor's change: rows that lead from the week before to this one, as a waterfall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from vsd_analytics.report.draw.svg import step_bar
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.words import format as fmt
from vsd_analytics.report.words.catalogue import say

MAX_PARTS: Final = 6
"""More areas than rows: the smallest differences share one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContributionRow:
    """One row of the waterfall: texts and its bar."""

    name: str
    bar: Markup
    value: str
    is_total: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Contributions:
    """The waterfall and its finding."""

    title: str
    sub: str
    rows: tuple[ContributionRow, ...]


def contributions(report: WeekReport) -> Contributions | None:
    """Return what the areas add to the floor's change; None where nothing is compared or a part is held back.

    The parts add up: violations per open hour of the week before, plus the difference of every area and of the rest of
    the floor, are those of this week over the hours compared.
    """
    before = report.level.often.previous
    if report.state != "normal" or before is None or report.previous is None or len(report.areas) < 2:
        return None
    known = [(a.name, a.difference) for a in report.areas if a.difference is not None]
    if len(known) < len(report.areas):
        return None
    parts = sorted(known, key=lambda p: (-abs(p[1]), p[0]))
    if len(parts) > MAX_PARTS:
        others = sum(d for _, d in parts[MAX_PARTS - 1 :])
        parts = [*parts[: MAX_PARTS - 1], (say("contributions.others"), others)]
    after = before + sum(d for _, d in parts)
    steps, level = [before, after], before
    for _, difference in parts:
        level += difference
        steps.append(level)
    top = max(steps)
    rows = [_total(say("contributions.week", week=report.previous.number), before, top)]
    level = before
    for name, difference in parts:
        bar = step_bar(level, level + difference, top=top, is_total=False)
        rows.append(ContributionRow(name=name, bar=bar, value=fmt.signed_number(difference)))
        level += difference
    rows.append(_total(say("contributions.week_now", week=report.week.number), after, top))
    return Contributions(title=_title(report), sub=say("contributions.sub"), rows=tuple(rows))


def _total(name: str, value: float, top: float) -> ContributionRow:
    return ContributionRow(
        name=name, bar=step_bar(0.0, value, top=top, is_total=True), value=fmt.number(value), is_total=True
    )


def _title(report: WeekReport) -> str:
    """Return where most of the change lies, or that it may be none."""
    if report.level.often.verdict not in ("clear_fall", "clear_rise"):
        return say("contributions.title_unclear")
    return say("contributions.title")
