"""Did a change at the site work: its area before and after, beside areas that were left alone (M27).

The arithmetic is `vsd_analytics.stats.before_after`, the weeks are those of `change_weeks`. This file finds the areas
to compare with and refuses what would be no comparison: another calibration, engine or rule, too little recorded. Days
are paired by weekday over the camera-hours recorded in both (`vsd_analytics.figures.periods`). The leading rate is
person-time in violation per open hour; its share of person-time says how much of it is not people who left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from typing import Final, Literal

import numpy as np
import shapely

from vsd_analytics.answer import Design, Outcome, Reason, State
from vsd_analytics.errors import UsageError
from vsd_analytics.figures import rates
from vsd_analytics.figures.change_doubts import cut_doubts, doubts_and_cautions
from vsd_analytics.figures.change_outcome import MOSTLY_MOVED, outcome
from vsd_analytics.figures.change_verdicts import (
    FloorEffect,
    Receiver,
    by_day,
    floor_effect,
    left_alone,
    moved,
    peopled,
    receivers,
    rests_on,
    running,
    timed,
)
from vsd_analytics.figures.change_weeks import (
    WEEKS,
    Windows,
    log_entry,
    windows_of,
)
from vsd_analytics.figures.compare import span, why_not
from vsd_analytics.figures.comparison_areas import comparison_areas
from vsd_analytics.figures.experiments import ExperimentPlan, foreseen
from vsd_analytics.figures.panels import FloorHours, Ints, Place
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.settings import FLOOR_CELL_M, Settings
from vsd_analytics.site.model import Area, LogEntry
from vsd_analytics.site.places import known_area, known_floor
from vsd_analytics.stats import before_after as test
from vsd_analytics.stats.decomposition import additive_parts
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.logged_change import TakenUp
from vsd_analytics.stats.running_verdict import RunningVerdict
from vsd_analytics.warehouse.warehouse import Warehouse

RING_M: Final = (2.0, 5.0)
"""How far around the changed area people are looked for who only moved on."""

UNDECIDED: Final = ("too_early", "cannot_tell", "alone")
"""Outcomes of which more weeks, or another design, may make one that is clear."""

Per = Literal["exposure_h", "x_h"]

ASSUMPTIONS: Final = tuple(
    Reason(f"logged_change.assumes_{name}") for name in ("parallel", "left_alone", "nothing_else", "no_bad_spell")
)
ASSUMPTIONS_ALONE: Final = (Reason("logged_change.assumes_as_it_was"), Reason("logged_change.assumes_no_chance"))


@dataclass(frozen=True, slots=True)
class Neighbours:
    """What happened around the changed area: violations that only moved on.

    Attributes:
        encounter_rate: Change of violations per person-hour, 2 to 5 m around it.
        people: Change of people there.
        effect: Its change relative to the comparison areas; None without any.
    """

    encounter_rate: ChangeEstimate
    people: ChangeEstimate
    effect: test.BeforeAfter | None


@dataclass(frozen=True, slots=True)
class EffectRoutes:
    """The two ways in which a change lowered or raised the time too close in its area; both are its own doing.

    Attributes:
        people: Part of fewer or more people in the area, relative to the comparison areas.
        closeness: Part of people who spend another share of their time too close. Both add up to the effect on the
            burden, theta - 1.
    """

    people: float
    closeness: float


@dataclass(frozen=True, slots=True)
class BeforeAfterFigure:
    """What a change of the site's log did to an area (M27).

    Attributes:
        number: The entry's place in the log, from 1.
        at, text: When and what was changed.
        area_id, area_name: The area looked at.
        state: "ok" when a change can be given, whatever its design.
        reason: Why not.
        design: "beside" comparison areas, or "alone" when there are none: then only `alone` is given.
        is_credible: False when something speaks against the comparison: `doubts`.
        doubts: What.
        cautions: What the data could not rule out: a slow trend, few comparison areas, other entries of the log, that
            it only moved elsewhere.
        windows: The days; None when there are none.
        burden: The effect on person-time in violation per open hour relative to the comparison areas: what leads. None
            without them, or where violation time is unknown.
        close: The effect on the share of person-time in violation, likewise.
        routes: How people and their closeness made up the effect on the burden; None without both.
        running: The verdict that may be read every week; None without comparison areas.
        floor: What became of the whole floor; None where violation time is unknown.
        taken_up: What the other areas of the floor, in its order, and its rest took up of the area's time too close.
        risers: Areas that clearly have more time too close since, beside those left alone.
        receivers: Areas that clearly have more people since, likewise.
        outcome: What may be said of the change: the one verdict on it.
        not_yet: Why a fall that is credible is not said to work.
        foreseen: When it will be clear, by the plan from the weeks before it; None where nothing more is to come.
        effect: The effect on violations per person-hour relative to the comparison areas; None without them.
        violation_rate: The effect on violations per open hour, likewise: what moved people away lowers this alone.
        alone: Violations per person-hour in the area, after / before.
        comparison: The same in the comparison areas together; None without them.
        people: People in the area, after / before: fewer people is not a safer layout.
        neighbours: 2 to 5 m around the area; None when nobody was seen there.
        comparison_areas: Ids of the areas compared with.
        areas_left_out: Why the other areas of the floor are not, by id.
        assumptions: What must hold for the effect to be that of the change.
        notes: What a reader must know beside.
    """

    number: int
    at: datetime
    text: str
    area_id: str
    area_name: str
    state: State
    reason: Reason | None
    design: Design
    is_credible: bool = True
    doubts: tuple[Reason, ...] = ()
    cautions: tuple[Reason, ...] = ()
    windows: Windows | None = None
    burden: test.BeforeAfter | None = None
    close: test.BeforeAfter | None = None
    routes: EffectRoutes | None = None
    running: RunningVerdict | None = None
    floor: FloorEffect | None = None
    taken_up: TakenUp | None = None
    risers: tuple[Receiver, ...] = ()
    receivers: tuple[Receiver, ...] = ()
    outcome: Outcome = "too_early"
    not_yet: Reason | None = None
    foreseen: ExperimentPlan | None = None
    effect: test.BeforeAfter | None = None
    violation_rate: test.BeforeAfter | None = None
    alone: ChangeEstimate | None = None
    comparison: ChangeEstimate | None = None
    people: ChangeEstimate | None = None
    neighbours: Neighbours | None = None
    comparison_areas: tuple[str, ...] = ()
    areas_left_out: tuple[tuple[str, Reason], ...] = ()
    assumptions: tuple[Reason, ...] = ()
    notes: tuple[Reason, ...] = ()


def before_after(
    warehouse: Warehouse, number: int, *, area_id: str | None = None, weeks: int = WEEKS
) -> BeforeAfterFigure:
    """Return what a change of the log did to an area.

    Args:
        warehouse: Opened over `days_needed`.
        number: The entry's place in the log (`vsd log list`), from 1.
        area_id: The area to look at; None = the entry's.
        weeks: Whole weeks to look at on either side, at most.

    Raises:
        UsageError: E101, there is no such entry or area, or the entry names none.

    Example:
        >>> vsd.before_after(warehouse, 1).state  # one week is too little
        'not_enough_data'
    """
    site = warehouse.site
    entry = log_entry(site, number)
    if (area_id or entry.area_id) is None:
        raise UsageError(
            f"entry {number} of the log concerns the whole site, so there is nothing to compare it with",
            fix=f"vsd compare --change {number} --area ID",
            in_python=f'site.change({number}, area_id="ID")',
        )
    area = known_area(site, area_id or str(entry.area_id))
    data = FloorHours(warehouse, floor=known_floor(site, None, [area]))
    figure = _compared(data, entry, area, number=number, weeks=weeks)
    is_open = figure.outcome in UNDECIDED and figure.state != "not_measurable"
    return replace(figure, foreseen=foreseen(data, area, entry)) if is_open else figure


def _compared(data: FloorHours, entry: LogEntry, area: Area, *, number: int, weeks: int) -> BeforeAfterFigure:
    """Return what a change did, by the weeks stored so far."""
    site = data.site
    windows, why = windows_of(data.warehouse, entry, area_id=area.area_id, weeks=weeks)
    base = BeforeAfterFigure(
        number, entry.at, entry.text, area.area_id, area.name, "not_enough_data", why, "beside", is_credible=False
    )
    if windows is None:
        return base
    base = replace(base, windows=windows)
    pair = TwoPeriods(Period(data, *windows.before), Period(data, *windows.after))
    state, why = _guard(pair, area)
    if state != "ok":
        return replace(base, state=state, reason=why)
    since_trend = windows.trend[0], windows.after[1]
    chosen, left_out = comparison_areas(data, area, since_trend, why_not=partial(_why_no_comparison, pair))
    doubts, elsewhere = doubts_and_cautions(data, entry, area, windows, cameras=_cameras(pair, area))
    place = pair.now.area(area.area_id)
    alone, people = rates.encounter_rate_change(pair, place), rates.change_people(pair, place)
    few = Reason("logged_change.stored", n=windows.n_weeks, weeks=weeks)
    notes = (few,) if windows.n_weeks < weeks else ()
    if not chosen:
        if (why := _too_few(alone, site.settings)) is not None:
            return replace(base, reason=why)
        return replace(
            base, state="ok", reason=None, design="alone", outcome="alone", alone=alone, people=people,
            doubts=(Reason("logged_change.weak"), *doubts), floor=floor_effect(data, area, windows),
            cautions=tuple(elsewhere),
            neighbours=_neighbours(pair, area, []),
            areas_left_out=tuple(left_out.items()), assumptions=ASSUMPTIONS_ALONE, notes=notes,
        )  # fmt: skip
    others = [pair.now.area(a.area_id) for a in chosen]
    effect = _effect(pair, place, others, windows=windows)
    violation_rate = _effect(pair, place, others, windows=windows, per="x_h")
    burden = close = None
    if np.isfinite(data.violation_h).all():
        times = [timed(data, a.area_id) for a in (area, *chosen)]
        burden = _effect(pair, place, others, windows=windows, per="x_h", times=times)
        close = _effect(pair, place, others, windows=windows, times=times)
    whole, so_far = floor_effect(data, area, windows), running(data, area, chosen, windows)
    if effect.value is None and violation_rate.value is None:
        return replace(base, reason=effect.reason, areas_left_out=tuple(left_out.items()))
    trend = effect.trend or violation_rate.trend
    if trend is not None and not trend.is_flat:
        doubts = [Reason("logged_change.trend", per_week=trend.value, lo=trend.lo, hi=trend.hi), *doubts]
    if trend is None:
        notes = (*notes, Reason("logged_change.no_trend"))
    doubt, unsteady = rests_on(so_far, left_alone(data, chosen, windows))
    doubts = [*doubts, doubt] if doubt is not None else doubts
    if so_far is not None and so_far.is_counted:
        doubts = [*doubts, *cut_doubts(data, windows, cameras=_cameras(pair, area))]
    figure = replace(
        base, state="ok", reason=None, is_credible=not doubts, doubts=tuple(doubts),
        cautions=_cautions(burden or effect, whole, windows, [*unsteady, *elsewhere]),
        burden=burden, close=close, routes=_routes(burden, close), running=so_far,
        floor=whole, effect=effect, violation_rate=violation_rate, alone=alone,
        comparison=rates.encounter_rate_change(pair, _together(others)), people=people,
        neighbours=_neighbours(pair, area, others), comparison_areas=tuple(a.area_id for a in chosen),
        areas_left_out=tuple(left_out.items()), assumptions=ASSUMPTIONS, notes=notes,
        taken_up=moved(data, area, chosen, windows), risers=receivers(data, area, chosen, windows, of=timed),
        receivers=receivers(data, area, chosen, windows, of=peopled),
    )  # fmt: skip
    area_outcome, not_yet = outcome(figure)
    return replace(figure, outcome=area_outcome, not_yet=not_yet)


def _guard(pair: TwoPeriods, area: Area) -> tuple[State, Reason | None]:
    """Return "ok", or why before and after were not measured alike or not enough."""
    state, why = why_not(pair)
    if state != "ok":
        return state, why
    for period in (pair.before, pair.now):
        if (why := period.why_no_exposure or period.why_no_places) is not None:
            return "not_measurable", Reason("during", reason=why, days=span((period.first, period.last)))
    cameras = _cameras(pair, area)
    anew = [r for r in pair.recalibrated if r.camera_id in cameras]
    if anew or not pair.is_comparable[_at(pair, cameras)].all():
        cameras_on = tuple(
            Reason("logged_change.camera_on", camera=r.camera_id, day=f"{pair.data.local(r.at_ms):%Y-%m-%d}")
            for r in anew or pair.recalibrated
        )
        why = Reason("logged_change.calibrated", cameras=cameras_on)
        return "not_measurable", why if cameras_on else Reason("logged_change.not_alike")
    least, at = pair.data.site.settings.min_coverage, _at(pair, cameras)
    for period in (pair.before, pair.now):
        hours = pair.data.hours
        recorded_s, open_s = (s[at][:, period.is_inside].sum() for s in (hours.recorded_s, hours.scheduled_s))
        share = float(recorded_s / open_s) if open_s else 1.0
        if share < least:
            days = span((period.first, period.last))
            return "not_enough_data", Reason("logged_change.coverage", share=share, days=days, least=least)
    return "ok", None


def _why_no_comparison(pair: TwoPeriods, other: Area) -> Reason | None:
    """Return why an area cannot be compared with another one: its cameras changed, or nobody was there."""
    at = _at(pair, _cameras(pair, other))
    if not pair.is_comparable[at].all():
        return Reason("logged_change.calibrated_there")
    return None if len(at) else Reason("logged_change.nobody_there")


def _effect(
    pair: TwoPeriods,
    place: Place,
    others: Sequence[Place],
    *,
    windows: Windows | None = None,
    per: Per = "exposure_h",
    times: Sequence[Place] | None = None,
) -> test.BeforeAfter:
    """Return the effect on a place relative to others, per person-hour or recorded open hour.

    Args:
        pair: Before and after.
        place: The changed place.
        others: Places left alone.
        windows: The weeks, whose history gives trend and weights; None = those before alone.
        per: What violations are divided by.
        times: The same places with person-hours in violation, where these are looked at; None = violations are.
    """
    settings, data, counted = pair.data.site.settings, pair.data, (place, *others)
    before, after = (
        by_day(
            [pair.compared(p)[k] for p in (times or counted)],
            [days[k] for days in pair.pairs],
            per=per,
            counts=None if times is None else [pair.compared(p)[k] for p in counted],
        )
        for k in (0, 1)
    )
    history = None
    if windows is not None:
        days = Period(data, *windows.trend).days
        history = by_day([data.panel(p, days) for p in (times or counted)], days, per=per)
    left_out = 0 if windows is None else (windows.after[0] - windows.before[1]).days - 1
    least = settings.min_exposure_h if per == "exposure_h" else 0.0
    return test.before_after(
        before, after, history=history, weeks_left_out=left_out / 7, confidence=settings.confidence,
        min_days=settings.change_min_days, min_events=settings.change_min_violations, min_exposure_h=least,
    )  # fmt: skip


def _routes(burden: test.BeforeAfter | None, close: test.BeforeAfter | None) -> EffectRoutes | None:
    """Return the parts of people and of closeness in the effect on the burden: its ratio is the product of theirs."""
    if burden is None or close is None or not burden.value or not close.value:
        return None
    return EffectRoutes(*additive_parts((burden.value / close.value, close.value)))


def _cautions(
    effect: test.BeforeAfter, floor: FloorEffect | None, windows: Windows, elsewhere: Sequence[Reason]
) -> tuple[Reason, ...]:
    """Return what the data could not rule out."""
    cautions = list(elsewhere)
    trend = effect.trend
    if trend is not None and trend.detectable_per_week is not None and effect.value:
        apart_weeks = (windows.after[0] - windows.before[0]).days / 7
        if abs(np.log(effect.value)) < apart_weeks * np.log1p(trend.detectable_per_week):
            slope = trend.detectable_per_week
            cautions.append(Reason("logged_change.unseen_trend", per_week=slope, n=trend.n_weeks))
    if effect.value is not None and 1 < effect.n_areas < test.MIN_PLACEBO_AREAS:
        cautions.append(Reason("logged_change.few_areas", n=effect.n_areas, least=test.MIN_PLACEBO_AREAS))
    if floor is not None and effect.verdict == "clear_fall" and (floor.moved_elsewhere or 0.0) >= MOSTLY_MOVED:
        cautions.append(Reason("logged_change.moved_elsewhere", share=min(1.0, floor.moved_elsewhere or 0.0)))
    return tuple(cautions)


def _neighbours(pair: TwoPeriods, area: Area, others: Sequence[Place]) -> Neighbours | None:
    """Return what happened 2 to 5 m around an area, or None where nobody was seen there."""
    place = _ring(pair.data, area)
    if not place.exposure_h.any():
        return None
    return Neighbours(
        encounter_rate=rates.encounter_rate_change(pair, place),
        people=rates.change_people(pair, place),
        effect=_effect(pair, place, others) if others else None,
    )


def _ring(data: FloorHours, area: Area) -> Place:
    """Return what was counted in the cells whose middle lies 2 to 5 m outside an area."""
    cell_m, shape = FLOOR_CELL_M, shapely.Polygon(area.polygon)
    x0, y0, x1, y1 = shape.buffer(RING_M[1]).bounds
    cx, cy = np.meshgrid(
        np.arange(np.floor(x0 / cell_m), np.ceil(x1 / cell_m)), np.arange(np.floor(y0 / cell_m), np.ceil(y1 / cell_m))
    )
    apart_m = shapely.distance(shape, shapely.points((cx + 0.5) * cell_m, (cy + 0.5) * cell_m))
    inside = (apart_m >= RING_M[0]) & (apart_m <= RING_M[1])
    rows = data.warehouse.table(
        "with ring as (select unnest($cx::int[]) as cx, unnest($cy::int[]) as cy) "
        "select camera_id, hour_start_ms, sum(n_violations_open)::double as n, "
        "sum(exposure_open_s)::double / 3600 as exposure_h from cell_hours semi join ring using (cx, cy) "
        "where floor_id = $floor group by all",
        {"cx": cx[inside].astype(int).tolist(), "cy": cy[inside].astype(int).tolist(), "floor": data.floor.floor_id},
    )
    n, exposure_h = data.by_hour(rows, "n", "exposure_h")
    return Place(n, exposure_h, np.asarray((n + exposure_h).any(axis=1)))


def _together(places: Sequence[Place]) -> Place:
    n, exposure_h = (np.sum([getattr(p, name) for p in places], axis=0) for name in ("n", "exposure_h"))
    return Place(n, exposure_h, np.any([p.cameras for p in places], axis=0))


def _cameras(pair: TwoPeriods, area: Area) -> set[str]:
    """Return the cameras that count anybody in an area, in either period."""
    n, exposure_h = pair.data.counted_in(area.area_id)
    inside = pair.before.is_inside | pair.now.is_inside
    counts = np.flatnonzero((n + exposure_h)[:, inside].any(axis=1))
    return {pair.data.ids[i] for i in counts.tolist()}


def _at(pair: TwoPeriods, cameras: set[str]) -> Ints:
    """Return the places of some cameras among the floor's."""
    return np.array([i for i, c in enumerate(pair.data.ids) if c in cameras], dtype=np.int64)


def _too_few(alone: ChangeEstimate, settings: Settings) -> Reason | None:
    """Return why an area by itself has too little for before and after, or None."""
    if alone.n_b and alone.n_days < settings.change_min_days:
        return Reason("logged_change.pairs", least=settings.change_min_days, has=alone.n_days)
    least, has = settings.change_min_violations, alone.n_a or 0.0
    if has < least:  # after the change none at all is a result
        return Reason("logged_change.events_before", least=least, has=has)
    return None if alone.state == "ok" or alone.n_b == 0 else alone.reason
