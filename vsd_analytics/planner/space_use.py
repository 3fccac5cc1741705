"""How areas that ask for it are used in the planner's week, as texts: visits, stays, where people go next, waiting.

The figures are the report's (M35 to M37, M39 to M41), of all days and hours of the week: medians, shares and their
intervals are no sums, so that the page cannot compute them again for the days that somebody chooses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from vsd_analytics.answer import Answers, Row, Value, value_of
from vsd_analytics.report.pages.map_figures import doubts, is_known, is_pooled, number, rows_of
from vsd_analytics.report.pages.waiting import WaitingView, time_text, waiting
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

MINUTE_S: Final = 60
OTHERS: Final = "others"
"""Column of the areas that too few people go to for a column of their own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UseCell:
    """A figure as texts: its value, and its likely range or another remark."""

    value: str
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class VisitsRow:
    """Visits of an area; where `reason` is not empty, it says why there are no stays."""

    name: str
    visits_per_open_h: UseCell
    median: UseCell
    p90: UseCell
    long: UseCell
    recorded: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LeavingRow:
    """Where people who leave an area go next, a cell for each column; `reason` replaces them where it is unknown."""

    name: str
    cells: tuple[UseCell, ...]
    lost: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SpaceUseView:
    """The section.

    Attributes:
        visits: A row for each area that asks for visits.
        long_limit: From when on a visit counts as long, where that is the same for all; else empty, and in the rows.
        why_no_visits: Why there are no rows, as a sentence; empty with some.
        to: Names of the areas people go to.
        leaving: A row for each area they leave.
        why_no_flow: Why there are no rows; empty with some.
        doubts: Sentences on what is not known of flow.
        waiting: Queues and capacities; None where no place asks for them.
    """

    visits: tuple[VisitsRow, ...]
    long_limit: str
    why_no_visits: str
    to: tuple[str, ...]
    leaving: tuple[LeavingRow, ...]
    why_no_flow: str
    doubts: tuple[str, ...]
    waiting: WaitingView | None


def space_use_view(answers: Answers) -> SpaceUseView | None:
    """Return the section; None where no place of the floor asks for it.

    Args:
        answers: Answers on how the space is used.
    """
    if not len(answers):
        return None
    visits, between = rows_of(answers, "visits"), rows_of(answers, "flow")
    areas = {str(r["area_id"]): str(r["name"]) for r in between}
    lost = {r["area_id"]: value_of(r, "not_followed_share") for r in rows_of(answers, "flow_areas")}
    known = [r for r in between if is_known(r)]
    to = [area for area in areas if any(r["to_area_ids"] == area for r in known)]
    has_others = any(is_pooled(r) for r in known)
    limits = {number(r, "long_visit_s") for r in visits}
    limit = _limit(limits.pop()) if len(limits) == 1 else ""
    columns = [*to, *([OTHERS] if has_others else [])]
    return SpaceUseView(
        visits=tuple(_visits(row, says_limit=not limit) for row in visits),
        long_limit=limit,
        why_no_visits=_why(answers, "visits"),
        to=(*(areas[area] for area in to), *([say("planner.use.others")] if has_others else [])),
        leaving=tuple(
            _leaving(name, [r for r in between if r["area_id"] == area], columns, lost[area])
            for area, name in areas.items()
        ),
        why_no_flow=_why(answers, "flow"),
        doubts=tuple(doubts(known)),
        waiting=waiting(answers),
    )


def _why(answers: Answers, name: str) -> str:
    answer = answers.get(name)
    return "" if answer is None else reason_text(answer.nothing)


def _limit(value_s: float) -> str:
    """Write a limit: over 90 seconds; over 5 minutes."""
    is_minutes = value_s >= 2 * MINUTE_S and value_s % MINUTE_S == 0
    text = say("waiting.minutes", n=fmt.count(value_s / MINUTE_S)) if is_minutes else time_text(value_s)
    return say("planner.use.over", limit=text)


def _visits(row: Row, *, says_limit: bool) -> VisitsRow:
    """Return an area's row; the share of long visits has a limit, and the means may disagree."""
    visits_per_open_h, median, p90, long = (
        value_of(row, name) for name in ("visits_per_open_h", "dwell_median_s", "dwell_p90_s", "long_share")
    )
    tracks, little = value_of(row, "dwell_mean_s").value, value_of(row, "dwell_mean_little_s").value
    reason = ""
    if visits_per_open_h.value is not None and median.value is None:
        reason = reason_text(median.reason)
    elif row["means_agree"] is False and tracks is not None and little is not None:
        reason = say("waiting.disagree", tracks=time_text(tracks), little=time_text(little))
    share = _cell(long, fmt.percent, why="" if median.value is None else reason_text(long.reason))
    if says_limit and median.value is not None:
        share = UseCell(value=share.value, note=" ".join((_limit(number(row, "long_visit_s")), share.note)).strip())
    is_unreached = median.value is not None and p90.value is None
    return VisitsRow(
        name=str(row["name"]),
        visits_per_open_h=_cell(visits_per_open_h, fmt.number, why=reason_text(visits_per_open_h.reason)),
        median=_cell(median, time_text),
        p90=_cell(p90, time_text, why=say("planner.use.unreached") if is_unreached else ""),
        long=share,
        recorded=fmt.percent(value_of(row, "recorded_share").value),
        reason=reason,
    )


def _cell(value: Value, write: Callable[[float], str], *, why: str = "") -> UseCell:
    if value.value is None:
        return UseCell(value=fmt.MISSING, note=why)
    has_range = value.lo is not None and value.hi is not None
    return UseCell(value=write(value.value), note=_range(write(value.lo), write(value.hi)) if has_range else "")  # type: ignore[arg-type]


def _range(low: str, high: str) -> str:
    """Write a likely range, its unit once: 20\u201334 seconds, 42\u201352%."""
    if low == high:
        return say("planner.use.about", n=low)
    (a, *unit), (b, *other) = low.split(" "), high.split(" ")
    is_same = unit == other and a.endswith("%") == b.endswith("%")
    return f"{a.removesuffix('%')}\u2013{high}" if is_same and a[:1].isdigit() else f"{low}\u2013{high}"


def _leaving(name: str, rows: Sequence[Row], to: list[str], lost: Value) -> LeavingRow:
    if not any(is_known(r) for r in rows):
        return LeavingRow(name=name, cells=(), lost="", reason=reason_text(value_of(rows[0], "next_area_share").reason))
    pooled: list[str] = next((str(r["to_area_ids"]).split() for r in rows if is_pooled(r)), [])
    cells = []
    for area in to:
        row = next((r for r in rows if r["to_area_ids"] == area or (area == OTHERS and is_pooled(r))), None)
        if row is not None:
            cells.append(_cell(value_of(row, "next_area_share"), fmt.percent))
        elif area in pooled:
            cells.append(UseCell(value="", note=say("planner.use.few")))
        else:
            cells.append(UseCell(value="", note="" if area == OTHERS else say("planner.use.nobody")))
    return LeavingRow(name=name, cells=tuple(cells), lost=fmt.percent(lost.value), reason="")
