"""What each area adds to the floor's change: rows that lead from the week before to this one, as a waterfall.

The printed parts add up to the printed difference of the floor. All numbers of the waterfall have the same decimals,
those of the smaller total, and the largest remainders decide which parts are rounded up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup, escape

from vsd_analytics.figures.week.results import AreaRow
from vsd_analytics.report.draw.svg import step_bar
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say

MAX_PARTS: Final = 6
"""More areas than rows: the smallest differences share one."""
UNKNOWN_MIN: Final = 2
"""Fewest areas whose sum may be printed where each of them is too small to print."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContributionRow:
    """One row of the waterfall: texts and its bar.

    Attributes:
        name: The week, or the place.
        bar: Its bar, or words where nothing was recorded.
        value: The level, or what the place adds.
        area_id: The area; None for the weeks, the rest of the floor, and rows of several areas.
        is_total: True for the weeks.
    """

    name: str
    bar: Markup
    value: str
    area_id: str | None = None
    is_total: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Contributions:
    """The waterfall and its finding.

    Attributes:
        title: Where most of the change lies, or that the difference may be none.
        sub: Its unit.
        is_clear: The floor's change is clear; otherwise the page folds the waterfall.
        rows: Both weeks, and between them what each place adds.
    """

    title: str
    sub: str
    is_clear: bool
    rows: tuple[ContributionRow, ...]

    @property
    def parts(self) -> tuple[ContributionRow, ...]:
        """Return the rows between both weeks."""
        return tuple(row for row in self.rows if not row.is_total)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    name: str
    difference: float
    area_id: str | None = None


def contributions(report: WeekReport) -> Contributions | None:
    """Return what the areas add to the floor's change; None where nothing is compared.

    The parts add up: violations per open hour of the week before, plus the difference of every area and of the rest of
    the floor, are those of this week over the hours compared. Areas whose own difference is too small to print share a
    row; areas that were not recorded in both weeks are named without a number.
    """
    violation_rate = report.level.violation_rate
    if report.state != "normal" or violation_rate.previous is None or report.previous is None or len(report.areas) < 2:
        return None
    unseen = [a for a in report.areas if a.difference is None and _is_unseen(a)]
    parts = _parts(report, unseen)
    if parts is None or not parts:
        return None
    before, after = violation_rate.previous, violation_rate.previous + sum(p.difference for p in parts)
    decimals = max(fmt.decimals(v) for v in (before, after))
    printed = adding_up([p.difference for p in parts], before=before, after=after, decimals=decimals)
    levels = [before]
    for part in parts:
        levels.append(levels[-1] + part.difference)
    top = max(levels)
    rows = [_total(say("contributions.week", week=report.previous.number), before, decimals, top)]
    for part, value, start, end in zip(parts, printed, levels, levels[1:], strict=False):
        bar = step_bar(start, end, top=top, is_total=False)
        rows.append(
            ContributionRow(name=part.name, bar=bar, value=fmt.signed_fixed(value, decimals), area_id=part.area_id)
        )
    rows += [ContributionRow(name=a.name, bar=escape(say("contributions.unseen")), value=fmt.MISSING) for a in unseen]
    is_same = violation_rate.value is not None and fmt.fixed(violation_rate.value, decimals) == fmt.fixed(
        after, decimals
    )
    name = say("contributions.week" if is_same else "contributions.week_now", week=report.week.number)
    rows.append(_total(name, after, decimals, top))
    is_clear = violation_rate.verdict in ("clear_fall", "clear_rise")
    title = say("contributions.title" if is_clear else "contributions.title_unclear")
    return Contributions(title=title, sub=say("contributions.sub"), is_clear=is_clear, rows=tuple(rows))


def adding_up(differences: Sequence[float], *, before: float, after: float, decimals: int) -> list[float]:
    """Return differences rounded so that they add up to the difference of both rounded totals.

    Each is rounded to one of its two neighbours; those with the largest remainders go up.

    Args:
        differences: Parts of after - before.
        before: The total they start from.
        after: The total they lead to.
        decimals: Decimals of all numbers.

    Example:
        >>> adding_up([-27.75, -22.76, -3.57, -1.52, -0.71], before=252.98, after=196.67, decimals=0)
        [-28.0, -23.0, -3.0, -1.0, -1.0]
    """
    unit = 10**decimals
    scaled = [d * unit for d in differences]
    lower = [math.floor(s) for s in scaled]
    missing = round(after * unit) - round(before * unit) - sum(lower)
    order = sorted(range(len(scaled)), key=lambda k: (lower[k] - scaled[k], k))
    for k in order[: max(0, missing)]:
        lower[k] += 1
    return [value / unit for value in lower]


def _parts(report: WeekReport, unseen: Sequence[AreaRow]) -> list[_Part] | None:
    """Return the parts with a number, the largest first; None where one that is held back would show.

    What is held back shares a row: with another such area, or with the little that neighbours saw of an unseen one.
    """
    known = [
        _Part(name=a.name, difference=a.difference, area_id=a.area_id) for a in report.areas if a.difference is not None
    ]
    parts = sorted(known, key=lambda p: (-abs(p.difference), p.name))
    hidden = [a for a in report.areas if a.difference is None and a not in unseen]
    n_max = MAX_PARTS - 1 if hidden else MAX_PARTS
    if len(parts) > n_max:
        others = sum(p.difference for p in parts[n_max - 1 :])
        parts = [*parts[: n_max - 1], _Part(name=say("contributions.others"), difference=others)]
    if not hidden:
        return parts
    violation_rate = report.level.violation_rate
    if len(hidden) + len(unseen) < UNKNOWN_MIN or violation_rate.previous is None or violation_rate.change is None:
        return None
    name = terms.joined(a.name for a in hidden)
    if len(hidden) >= UNKNOWN_MIN:
        name = say("contributions.hidden", areas=name)
    return [
        *parts,
        _Part(name=name, difference=violation_rate.previous * violation_rate.change - sum(p.difference for p in parts)),
    ]


def _is_unseen(area: AreaRow) -> bool:
    """Tell whether no camera recorded an area in both weeks."""
    is_counted = area.counted is not None or area.is_masked or area.is_held_back
    return not is_counted or (
        area.violation_rate.reason is not None and area.violation_rate.reason.code == "recorded.nothing"
    )


def _total(name: str, value: float, decimals: int, top: float) -> ContributionRow:
    bar = step_bar(0.0, value, top=top, is_total=True)
    return ContributionRow(name=name, bar=bar, value=fmt.fixed(value, decimals), is_total=True)
