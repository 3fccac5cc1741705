"""How areas that ask for it are used in the planner's week, as texts: visits, stays, where people go next, waiting.

The figures are the report's (M35 to M37, M39 to M41), of all days and hours of the week: medians, shares and their
intervals are no sums, so that the page cannot compute them again for the days that somebody chooses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from vsd_analytics.figures.week.results import Figure
from vsd_analytics.report.pages.map_figures import Rows, doubts, rows_of
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
    often: UseCell
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


def space_use_view(figures: Mapping[str, Figure]) -> SpaceUseView | None:
    """Return the section; None where no place of the floor asks for it.

    Args:
        figures: Figures of how the space is used, by catalogue id, with texts for reasons in their rows.
    """
    if not figures:
        return None
    often, stays, between = (rows_of(figures, metric) for metric in ("M35", "M36", "M37"))
    names = {str(r["area"]): str(r["place"]) for r in between}
    to = [area for area in names if any(r["to_areas"] == area for r in between)]
    has_others = any(" " in (r["to_areas"] or "") for r in between)
    limits = {float(r["longer_than_s"]) for r in stays if r.get("longer_than_s")}
    limit = _limit(limits.pop()) if len(limits) == 1 else ""
    return SpaceUseView(
        visits=tuple(
            _visits(row, [r for r in stays if r["area"] == row["area"]], says_limit=not limit) for row in often
        ),
        long_limit=limit,
        why_no_visits=_why(figures.get("M35")),
        to=(*(names[area] for area in to), *([say("planner.use.others")] if has_others else [])),
        leaving=tuple(
            _leaving(name, [r for r in between if r["area"] == area], [*to, *([OTHERS] if has_others else [])])
            for area, name in names.items()
        ),
        why_no_flow=_why(figures.get("M37")),
        doubts=tuple(doubts([r for r in between if r["value"] is not None])),
        waiting=waiting(figures),
    )


def _why(figure: Figure | None) -> str:
    return "" if figure is None or figure.rows else reason_text(figure.reason)


def _limit(value_s: float) -> str:
    """Write a limit: over 90 seconds; over 5 minutes."""
    is_minutes = value_s >= 2 * MINUTE_S and value_s % MINUTE_S == 0
    text = say("waiting.minutes", n=fmt.count(value_s / MINUTE_S)) if is_minutes else time_text(value_s)
    return say("planner.use.over", limit=text)


def _visits(often: Mapping[str, Any], stays: Rows, *, says_limit: bool) -> VisitsRow:
    """Return an area's row; of its stays (M36) the share of long ones has a limit, and the means may disagree."""
    long = next((r for r in stays if "longer_than_s" in r), {})
    none: Mapping[str, Any] = {}
    tracks, little, *_ = (*(r for r in stays if "agrees" in r), none, none)
    median, p90, *_ = (*(r for r in stays if not {"longer_than_s", "agrees"} & r.keys()), none, none)
    reason = ""
    if often["value"] is not None and median.get("value") is None:
        reason = str(median.get("reason") or "")
    elif tracks.get("agrees") is False and None not in (tracks["value"], little["value"]):
        reason = say("waiting.disagree", tracks=time_text(tracks["value"]), little=time_text(little["value"]))
    share = _cell(long, fmt.percent, why=str(long.get("reason") or ""))
    if says_limit and long:
        share = UseCell(value=share.value, note=" ".join((_limit(float(long["longer_than_s"])), share.note)).strip())
    unreached = say("planner.use.unreached") if p90 and p90["value"] is None else ""
    return VisitsRow(
        name=str(often["place"]),
        often=_cell(often, fmt.number, why=str(often["reason"] or "")),
        median=_cell(median, time_text),
        p90=_cell(p90, time_text, why=unreached),
        long=share,
        recorded=fmt.percent(often["recorded_share"]),
        reason=reason,
    )


def _cell(row: Mapping[str, Any], write: Callable[[float], str], *, why: str = "") -> UseCell:
    value, lo, hi = row.get("value"), row.get("lo"), row.get("hi")
    if value is None:
        return UseCell(value=fmt.MISSING, note=why)
    return UseCell(value=write(value), note="" if lo is None or hi is None else _range(write(lo), write(hi)))


def _range(low: str, high: str) -> str:
    """Write a likely range, its unit once: 20\u201334 seconds, 42\u201352%."""
    if low == high:
        return say("planner.use.about", n=low)
    (a, *unit), (b, *other) = low.split(" "), high.split(" ")
    is_same = unit == other and a.endswith("%") == b.endswith("%")
    return f"{a.removesuffix('%')}\u2013{high}" if is_same and a[:1].isdigit() else f"{low}\u2013{high}"


def _leaving(name: str, rows: Rows, to: list[str]) -> LeavingRow:
    if all(r["value"] is None for r in rows):
        return LeavingRow(name=name, cells=(), lost="", reason=str(rows[0]["reason"] or ""))
    pooled: list[str] = next((r["to_areas"].split() for r in rows if " " in r["to_areas"]), [])
    cells = []
    for area in to:
        row = next((r for r in rows if r["to_areas"] == area or (area == OTHERS and " " in r["to_areas"])), None)
        if row is not None:
            cells.append(_cell(row, fmt.percent))
        elif area in pooled:
            cells.append(UseCell(value="", note=say("planner.use.few")))
        else:
            cells.append(UseCell(value="", note="" if area == OTHERS else say("planner.use.nobody")))
    lost = rows[0]["not_followed_share"]
    return LeavingRow(name=name, cells=tuple(cells), lost=fmt.MISSING if lost is None else fmt.percent(lost), reason="")
