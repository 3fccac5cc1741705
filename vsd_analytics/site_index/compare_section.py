"""The section of the index that says which floors really differ: one sentence, the funnel, and a table by name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.report.draw.funnel_chart import NARROW, WIDE, FunnelPoint, PointKind, funnel_chart
from vsd_analytics.site_index.site_comparison import ComparedFloor, FloorStatus, SiteComparison
from vsd_analytics.site_index.summary import in_words, some
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text
from vsd_analytics.wording.terms import capital

GROUPS: Final[tuple[FloorStatus, ...]] = ("gaps", "absent", "older", "distance", "few", "nobody", "alone", "reason")
"""Why floors are not compared, in the order in which the page says it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareRow:
    """One floor in the table.

    Attributes:
        name: The floor.
        difference: From a usual floor, pulled towards the mean unless it differs; a dash where it is not compared.
        likely: Its likely range.
        person_hours: Person-hours behind it.
        weeks: Weeks used.
        unrecorded: Share of open hours not recorded.
        note: That it differs, or why it is not compared.
        differs: It really differs.
    """

    name: str
    difference: str
    likely: str
    person_hours: str
    weeks: str
    unrecorded: str
    note: str
    differs: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareSection:
    """What the template shows of the comparison.

    Attributes:
        sentence: Which floors really differ, and by how much.
        notes: How much floors usually differ; who is not compared and why.
        wide, narrow: The funnel, for wide and narrow windows; empty with fewer than four floors compared.
        rows: By name.
        read: How to read the funnel.
    """

    sentence: str
    notes: tuple[str, ...]
    wide: Markup
    narrow: Markup
    rows: tuple[CompareRow, ...]
    read: str


def compare_section(comparison: SiteComparison | None) -> CompareSection | None:
    """Return the section; None where there is one floor only."""
    if comparison is None:
        return None
    sentence = _sentence(comparison)
    drawn = [p for f in comparison.floors if (p := _point(f)) is not None]
    wide = narrow = Markup("")
    if comparison.usual_sd is not None:
        wide, narrow = (
            funnel_chart(
                drawn,
                usual_sd=comparison.usual_sd,
                title=say(f"index.compare.axis_{size}"),
                width=width,
                label=sentence,
            )
            for size, width in (("wide", WIDE), ("narrow", NARROW))
        )
    return CompareSection(
        sentence=sentence,
        notes=tuple(_notes(comparison)),
        wide=wide,
        narrow=narrow,
        rows=tuple(_row(f) for f in comparison.floors),
        read=say("index.compare.read", distance=fmt.metres_unbroken(comparison.distance_m)),
    )


def _sentence(comparison: SiteComparison) -> str:
    """Return which floors really differ; at most one page in twenty names one that does not."""
    if comparison.usual_sd is None:
        return say("index.compare.too_few")
    named = [f for f in comparison.floors if f.differs]
    if not named:
        return say("index.compare.none")
    names = some([_named(f) for f in named])
    return capital(say("index.compare.differ", plural=len(named), n=in_words(len(named)), named=names))


def _named(floor: ComparedFloor) -> str:
    change = _change(floor)
    likely = fmt.likely_change(change, is_counted=False)
    return say("index.compare.named", floor=floor.name, change=fmt.less_more(change.change), likely=likely)


def _change(floor: ComparedFloor) -> Estimate:
    """Return what is said of a floor as a change from the usual one."""
    p = floor.said
    if p is None:
        return Estimate(value=None)
    return Estimate(value=p.value, change=p.value - 1, change_lo=p.lo - 1, change_hi=p.hi - 1)


def _notes(comparison: SiteComparison) -> Iterable[str]:
    if (reach := comparison.usual_reach) is not None:
        yield say("index.compare.usual", low=fmt.signed(1 / reach - 1), high=fmt.signed(reach - 1))
    for status in GROUPS:
        floors = [f for f in comparison.floors if f.status == status]
        if floors:
            yield say(f"index.compare.left_out.{status}", floors=some([_with_reason(f) for f in floors]))


def _with_reason(floor: ComparedFloor) -> str:
    """Return the name of a floor, with what was not recorded or why."""
    if floor.status == "gaps":
        return say("index.compare.with_reason", floor=floor.name, reason=_unrecorded(floor))
    if floor.reason is not None:
        return say("index.compare.with_reason", floor=floor.name, reason=reason_text(floor.reason))
    return floor.name


def _unrecorded(floor: ComparedFloor) -> str:
    return say("index.compare.unrecorded", share=fmt.percent(floor.unrecorded))


def _point(floor: ComparedFloor) -> FunnelPoint | None:
    if floor.ratio is None or floor.hi is None:
        return None
    kind: PointKind = "gaps" if floor.status == "gaps" else "differs" if floor.differs else "usual"
    text = {"gaps": _unrecorded(floor), "differs": floor.name, "usual": ""}[kind]
    return FunnelPoint(name=floor.name, text=text, ratio=floor.ratio, reach=floor.hi / floor.ratio, kind=kind)


def _row(floor: ComparedFloor) -> CompareRow:
    change = _change(floor)
    note = say("index.compare.differs") if floor.differs else ""
    if floor.status != "compared":
        note = say(f"index.compare.status.{floor.status}")
    if floor.reason is not None:
        note = reason_text(floor.reason)
    return CompareRow(
        name=floor.name,
        difference=fmt.signed(change.change),
        likely=fmt.range_signed(change) or fmt.MISSING,
        person_hours=fmt.count(floor.person_h) if floor.n_weeks else fmt.MISSING,
        weeks=fmt.count(floor.n_weeks),
        unrecorded=fmt.percent(floor.unrecorded),
        note=note,
        differs=floor.differs,
    )
