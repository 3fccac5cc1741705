"""Did it change, and what made it change: two periods of a floor over the same hours (M0, M7, M3, M23).

Only camera-hours recorded in both periods are compared, days paired by weekday (`vsd_analytics.figures.periods`); the
arithmetic is `vsd_analytics.stats.changes`. The log change of how often splits into people and risk per person-hour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from types import MappingProxyType
from typing import Literal

from vsd_analytics.answer import Reason, State
from vsd_analytics.errors import UsageError
from vsd_analytics.figures import close_time, rates
from vsd_analytics.figures.area_verdicts import AreaChanges, area_changes
from vsd_analytics.figures.comparable import other_intervals, rules_used
from vsd_analytics.figures.mixing import mixing_change
from vsd_analytics.figures.panels import WEEK, FloorHours
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.site.instants import parse_range
from vsd_analytics.site.model import Area, Floor, Site
from vsd_analytics.site.places import known_area, known_floor
from vsd_analytics.stats.changes import split_change
from vsd_analytics.stats.decomposition import MixingChange
from vsd_analytics.stats.estimates import ChangeEstimate, ChangeSplit, RateEstimate
from vsd_analytics.stats.weekly_steps import MAX_STEPS
from vsd_analytics.warehouse.provenance import engines
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse

PlaceKind = Literal["floor", "area", "rest"]
Days = tuple[date, date]
"""First and last local day."""


@dataclass(frozen=True, slots=True)
class PeriodSeen:
    """One of the two periods.

    Attributes:
        first, last: Local days.
        coverage: Recorded share of the cameras' opening hours; None when it is closed all the time.
        recorded_h: Recorded camera-hours of them.
        scheduled_h: Opening hours of its cameras.
    """

    first: date
    last: date
    coverage: float | None
    recorded_h: float
    scheduled_h: float


@dataclass(frozen=True, slots=True)
class PlaceChange:
    """One place in both periods.

    Attributes:
        kind: The whole floor, an area, or the rest of the floor.
        area_id: The area's id.
        name: Its name.
        violation_rate_a, violation_rate_b: How often in each period (M0), over all hours that enter rates.
        encounter_rate_a, encounter_rate_b: Encounters per person-hour (M7), likewise.
        close_time_share_a, close_time_share_b: Share of person-time too close (M6), of anybody.
        close_time_share: Its change over the hours compared.
        burden_a, burden_b: Person-minutes too close per open hour.
        burden: Its change over the hours compared.
        split: The changes of how often, people and how risky over the hours compared, and what people explain.
    """

    kind: PlaceKind
    area_id: str | None
    name: str | Reason
    violation_rate_a: RateEstimate
    violation_rate_b: RateEstimate
    encounter_rate_a: RateEstimate
    encounter_rate_b: RateEstimate
    close_time_share_a: RateEstimate
    close_time_share_b: RateEstimate
    close_time_share: ChangeEstimate
    burden_a: RateEstimate
    burden_b: RateEstimate
    burden: ChangeEstimate
    split: ChangeSplit


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two periods of a floor side by side.

    Attributes:
        floor_id, floor_name: The floor.
        a, b: The periods, A before and B after.
        state: "ok" when they could be compared.
        reason: Why not.
        n_pairs: Days paired by weekday.
        days_left_out: Days of either without a partner.
        hours_compared: Recorded open camera-hours of B that are compared.
        cameras_left_out: Why a camera is not compared, by id.
        places: The whole floor first, then the areas asked for (all of the floor, and its rest, when none were).
        mixing: Whether crowding, layout or behaviour moved the time that pairs spend close on the floor (M23); None
            when the periods are not compared.
        notes: What a reader must know beside.
    """

    floor_id: str
    floor_name: str
    a: PeriodSeen
    b: PeriodSeen
    state: State
    reason: Reason | None
    n_pairs: int
    days_left_out: tuple[date, ...]
    hours_compared: float
    cameras_left_out: Mapping[str, Reason]
    places: tuple[PlaceChange, ...]
    mixing: MixingChange | None
    notes: tuple[Reason, ...]


def days_needed(site: Site, *periods: Days) -> Days:
    """Return the local days a warehouse must hold to compare periods: these, and the weeks before the first."""
    first, last = min(p[0] for p in periods), max(p[1] for p in periods)
    earliest = first - MAX_STEPS * WEEK
    extent = stored_extent(site, near=first)
    if extent is not None:
        earliest = max(earliest, min(first, extent.first_day - timedelta(days=extent.first_day.weekday())))
    return earliest, last


def compare(
    warehouse: Warehouse,
    a: Days | str,
    b: Days | str,
    *,
    floor_id: str | None = None,
    area_ids: Sequence[str] = (),
) -> Comparison:
    """Return how a floor and its areas changed from period A to period B.

    Args:
        warehouse: Opened over `days_needed`.
        a: First and last local day of period A, or text such as "2026-W45" or "2026-11-02..2026-11-08".
        b: The same of period B; it may be earlier than A, but not overlap it.
        floor_id: The floor; None where there is only one, or the areas tell.
        area_ids: Areas to tell of; none = all, and the rest of the floor.

    Returns:
        The comparison; where the periods cannot be compared, each with its coverage, and why not.

    Raises:
        UsageError: E101, a floor or area is unknown, or the periods overlap.

    Example:
        >>> two_days, next_two = (date(2026, 11, 9), date(2026, 11, 10)), (date(2026, 11, 11), date(2026, 11, 12))
        >>> found = vsd.compare(warehouse, two_days, next_two)
        >>> found.state, found.n_pairs  # no weekday is in both periods
        ('ok', 0)
    """
    site = warehouse.site
    a, b = (parse_range(days) if isinstance(days, str) else days for days in (a, b))
    if a[0] <= b[1] and b[0] <= a[1]:
        raise UsageError(
            f"{a[0]} to {a[1]} and {b[0]} to {b[1]} have days in common",
            why="what happened on a day cannot be compared with itself",
            fix="vsd compare 2026-W45 2026-W46",
            in_python='site.compare("2026-W45", "2026-W46")',
        )
    areas = [known_area(site, area_id) for area_id in ([area_ids] if isinstance(area_ids, str) else area_ids)]
    floor = known_floor(site, floor_id, areas)
    data = FloorHours(warehouse, floor=floor)
    pair = TwoPeriods(Period(data, *a), Period(data, *b))
    state, reason = why_not(pair)
    is_compared = state == "ok"
    places: tuple[PlaceChange, ...] = ()
    if is_compared:
        chosen: list[Area | None] = [*areas] if areas or not data.areas else [*data.areas, None]
        whole = place_change(pair, floor)
        family = area_changes(pair) if _is_placed(pair) and chosen else {}
        places = (whole, *(place_change(pair, area, family=family) for area in chosen if _is_placed(pair)))
    paired = {day for days in pair.pairs for day in days}
    return Comparison(
        floor_id=floor.floor_id,
        floor_name=floor.name,
        a=_seen(pair.before),
        b=_seen(pair.now),
        state=state,
        reason=reason,
        n_pairs=len(pair.pairs),
        days_left_out=tuple(sorted(d for p in (pair.before, pair.now) for d in p.days if d not in paired)),
        hours_compared=float(pair.compared(pair.now.whole)[1].x_h.sum()) if is_compared else 0.0,
        cameras_left_out=_left_out(pair) if is_compared else {},
        places=places,
        mixing=mixing_change(pair) if is_compared else None,
        notes=_notes(pair, has_areas=bool(data.areas)),
    )


def why_not(pair: TwoPeriods) -> tuple[State, Reason | None]:
    """Return "ok" and None, or why two periods of a floor must not be compared."""
    least = pair.data.site.settings.min_coverage
    for period in (pair.before, pair.now):
        days = span((period.first, period.last))
        if period.scheduled_h == 0:
            return "not_enough_data", Reason("compare.closed", days=days)
        share = period.recorded_h / period.scheduled_h
        if share < least:
            return "not_enough_data", Reason("compare.coverage", share=share, days=days, least=least)
    for period in (pair.before, pair.now):
        if (why := period.why_no_violations) is not None:
            return "not_measurable", Reason("during", reason=why, days=span((period.first, period.last)))
    if not (pair.is_comparable & pair.now.whole.cameras).any():
        names = ", ".join(r.camera_id for r in pair.recalibrated)
        return "not_measurable", Reason("compare.calibrated", cameras=names) if names else Reason("compare.no_camera")
    return _other_means(pair)


def _other_means(pair: TwoPeriods) -> tuple[State, Reason | None]:
    warehouse = pair.data.warehouse
    before, now = (engines(pair.data.site, p.first, p.last) for p in (pair.before, pair.now))
    if before and now and before != now:
        return "not_measurable", Reason("compare.engine", before=", ".join(before), after=", ".join(now))
    rules = [rules_used(warehouse, first_ms=p.span_ms[0], end_ms=p.span_ms[1]) for p in (pair.before, pair.now)]
    if len(frozenset().union(*rules)) > 1:
        return "not_measurable", Reason("compare.rules")
    return "ok", None


def place_change(
    pair: TwoPeriods, where: Floor | Area | None, *, family: Mapping[str | None, AreaChanges] = MappingProxyType({})
) -> PlaceChange:
    """Return the change of the whole floor, an area, or (None) the rest of the floor."""
    area_id = where.area_id if isinstance(where, Area) else None
    periods = (pair.before, pair.now)
    before, now = (p.whole if isinstance(where, Floor) else p.area(area_id) for p in periods)
    close = close_time.close_time(pair.now, where)
    if isinstance(where, Floor) or area_id not in family:
        violation_rate, encounter_rate = rates.violation_rate_change(pair, now), rates.encounter_rate_change(pair, now)
        close_time_share, burden = (
            close_time.change_close_time_share(pair, close),
            close_time.change_burden(pair, close),
        )
    else:
        changes = family[area_id]
        violation_rate, encounter_rate, close_time_share, burden = (
            changes.violation_rate,
            changes.encounter_rate,
            changes.close,
            changes.burden,
        )
    return PlaceChange(
        kind="floor" if isinstance(where, Floor) else "rest" if where is None else "area",
        area_id=area_id,
        name=Reason("row.rest") if where is None else where.name,
        violation_rate_a=rates.violation_rate_level(pair.before, before),
        violation_rate_b=rates.violation_rate_level(pair.now, now),
        encounter_rate_a=rates.encounter_rate_level(pair.before, before),
        encounter_rate_b=rates.encounter_rate_level(pair.now, now),
        close_time_share_a=close_time.close_time_share(pair.before, close_time.close_time(pair.before, where)),
        close_time_share_b=close_time.close_time_share(pair.now, close),
        close_time_share=close_time_share,
        burden_a=close_time.burden(pair.before, close_time.close_time(pair.before, where)),
        burden_b=close_time.burden(pair.now, close),
        burden=burden,
        split=split_change(
            violation_rate=violation_rate, people=rates.change_people(pair, now), encounter_rate=encounter_rate
        ),
    )


def _is_placed(pair: TwoPeriods) -> bool:
    return pair.before.why_no_places is None and pair.now.why_no_places is None


def _left_out(pair: TwoPeriods) -> dict[str, Reason]:
    """Return why a camera is not compared though others are."""
    reasons = {c: why for p in (pair.now, pair.before) for c, why in p.not_counted.items()}
    anew = {r.camera_id: f"{pair.data.local(r.at_ms):%Y-%m-%d}" for r in pair.recalibrated}
    return reasons | {camera_id: Reason("compare.calibrated_on", day=day) for camera_id, day in anew.items()}


def _notes(pair: TwoPeriods, *, has_areas: bool) -> tuple[Reason, ...]:
    data, (first_ms, end_ms) = pair.data, pair.span_ms
    notes = [
        Reason(
            "compare.frames",
            camera=o.camera_id,
            after_s=o.after_ms / 1000,
            before_s=o.before_ms / 1000,
            day=f"{data.local(o.since_ms):%Y-%m-%d}",
        )
        for o in other_intervals(data.warehouse, cameras=data.cameras, first_ms=first_ms, end_ms=end_ms)
    ]
    if (cut := pair.cut_shares) is not None:
        notes.append(Reason("compare.cut_ids", before=cut.before, now=cut.now))
    if has_areas and not _is_placed(pair):
        notes.append(Reason("compare.no_places"))
    return tuple(notes)


def _seen(period: Period) -> PeriodSeen:
    share = period.recorded_h / period.scheduled_h if period.scheduled_h else None
    return PeriodSeen(period.first, period.last, share, period.recorded_h, period.scheduled_h)


def span(days: Days) -> Reason:
    """Return some days as part of a reason: "2026-11-02 to 2026-11-08"."""
    if days[0] == days[1]:
        return Reason("day", day=str(days[0]))
    return Reason("days", first=str(days[0]), last=str(days[1]))
