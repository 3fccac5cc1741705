"""What the planner's page knows of a floor: two weeks by hour, camera, place and cell, the log, the report's figures.

The page computes every rate again in the browser, from sums that are additive over hours, cameras and cells; nothing
here is a rate but the table that a page without script shows. A page for readers has hours of the whole floor only: of
other places it has the report's figures of the whole week, and of cells the sums of the week.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime, timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Answers, Reason
from vsd_analytics.figures import hotspots as spots
from vsd_analytics.figures.catalogue import OF_SPACE, asks_for, shared_answers
from vsd_analytics.figures.catalogue.form import FigureInputs
from vsd_analytics.figures.close_time import change_close_time_share, close_time
from vsd_analytics.figures.compare import why_not
from vsd_analytics.figures.panels import WEEK, Flags, Ints, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.share.periods import check_days
from vsd_analytics.figures.share.places import hidden_floor
from vsd_analytics.figures.share.weeks import revealing_spots, shared_spots
from vsd_analytics.figures.week import areas as report_areas
from vsd_analytics.figures.week import lazy_answers, recording, timetable
from vsd_analytics.figures.week.density import FloorGrid
from vsd_analytics.figures.week.estimates import with_change
from vsd_analytics.figures.week.floor_maps import floor_maps
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.figures.week.results import AreaRow, WeekRef
from vsd_analytics.planner import cell_counts
from vsd_analytics.planner.cell_counts import WeekCells, seen_cells
from vsd_analytics.planner.hour_counts import (
    Counted,
    HourPanel,
    TwoWeeks,
    floor_panel,
    hidden_places,
    open_slots,
    panel_of,
)
from vsd_analytics.planner.layouts import Layout, layouts
from vsd_analytics.planner.lines_layer import crossings
from vsd_analytics.planner.logged_changes import MOST_WEEKS, PlannerChange, entries_of, logged_changes
from vsd_analytics.planner.replay import Replay, replay
from vsd_analytics.report.model.assemble import floor_level
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.stats.rates import HISTORY_WEEKS
from vsd_analytics.warehouse.provenance import are_made_up, engines
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse
from vsd_analytics.wording.catalogue import say

HISTORY: Final = HISTORY_WEEKS * WEEK
"""How far back the usual rates of weekdays are taken from."""
LEAST_WEEKS: Final = 2
"""The week and the one before."""
_MARTS: Final = (
    *("violations", "camera_hours", "area_hours", "crowding_hours", "joined_days"),
    *("cell_days", "cell_hours", "planner_cells", "square_hours", "footsteps", "track_days"),
    "track_hours",
)
"""Marts that the page of a floor with enough data reads."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlannerWeek:
    """One week.

    Attributes:
        ref: Which.
        panel: Its open hours.
        recorded_ms: For readers: recorded opening time of each camera in the hours drawn, those that are not compared
            with the other week and those that are, shape (2, n_cameras); None on the operator's page.
        cells: What lies where; None where violations have no place on the floor.
        is_ranked: Enough was recorded to rank places and compare.
        hidden: Why the figures of a place are not given, by place; the others are.
    """

    ref: WeekRef
    panel: HourPanel
    recorded_ms: Ints | None
    cells: WeekCells | None
    is_ranked: bool
    hidden: Mapping[int, Reason]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WalkableFloor:
    """Where people can walk, by fine cell of the page's grid, shape (n_y, n_x) (`report.walkable`).

    Attributes:
        is_free: Cells without a fixture.
        to_right: Whether one can step from the cell to the one on its right.
        upwards: The same to the one above.
    """

    is_free: Flags
    to_right: Flags
    upwards: Flags


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceRow:
    """A place and the report's figures of it.

    Attributes:
        place_id: "floor" for the whole floor, "rest" for the rest of it, else "area:" and the area's id.
        name: Display name; free text.
        area: The area; None for floor and rest.
        cameras: Which cameras count anybody there.
        has_history: Its usual rates of weekdays are given; not where an earlier week holds its count back.
        violation_rate: Violations per open hour (M0), with the change from the other week.
        encounter_rate: Violations per person-hour (M7), likewise.
        close_time_share: Share of person-time too close (M6), likewise; None where it is hidden or unknown.
        close_cameras: Which cameras' person-time makes the share (M6), in this week and the other, as in the report:
            those with somebody there whose distances are known in every hour.
    """

    place_id: str
    name: str
    area: Area | None
    cameras: tuple[bool, ...]
    has_history: bool
    violation_rate: Estimate
    encounter_rate: Estimate
    close_time_share: Estimate
    close_cameras: tuple[tuple[bool, ...], ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlannerData:
    """Everything the page knows.

    Attributes:
        site: The project.
        floor: The floor.
        cameras: The floor's cameras; all arrays have their order.
        week: This week.
        before: The other week; None when nothing of it is stored.
        history: Days of the five weeks before this one, for intervals of the whole floor and its areas.
        places: The whole floor, its areas, the rest.
        comparable: Which cameras may be compared between the weeks.
        why_not_compared: Why the weeks cannot be compared; None if they can.
        why_no_map: Why there is no map; None with one.
        why_no_violations: Why violations cannot be counted; None if they can.
        why_no_exposure: Why person-time is unknown; None if it is known.
        shown: The report's map: extent, plan, floor no camera sees, bands; None without one.
        walkable: Where people can walk, cells of the report's map; None = everywhere.
        seen: What each camera sees of the page's grid, shape (n_cameras, n_y, n_x); None where it is unknown.
        hotspots: Hotspots of the 28 days up to this week's end (M20).
        is_made_up: The data are those of `vsd demo`.
        weeks: Weeks of the log that the page holds.
        changes: The log's entries of these weeks, in order of time.
        layouts: Fixtures by selection (`layouts.layouts`); empty where they are always those of `shown`.
        space: Answers on how the space is used in the week (M35 to M42); empty where no place of the floor asks.
        lines: Answers on who crossed the floor's counting lines in the week (M57); empty without a line.
        is_shared: The page is for readers; otherwise it is the operator's, by hour in all places.
        replay: The week's hours by square, and typical ones; None where they cannot be given.
    """

    site: Site
    floor: Floor
    cameras: tuple[Camera, ...]
    week: PlannerWeek
    before: PlannerWeek | None
    history: HourPanel
    places: tuple[PlaceRow, ...]
    comparable: tuple[bool, ...]
    why_not_compared: Reason | None
    why_no_map: Reason | None
    why_no_violations: Reason | None
    why_no_exposure: Reason | None
    shown: FloorMap | None
    walkable: WalkableFloor | None
    seen: Flags | None
    hotspots: spots.FloorHotspots
    is_made_up: bool
    weeks: int
    changes: tuple[PlannerChange, ...]
    layouts: tuple[Layout, ...] = ()
    space: Answers = field(default_factory=Answers)
    lines: Answers = field(default_factory=Answers)
    is_shared: bool = False
    replay: Replay | None = None


def weeks_needed(site: Site, monday: date, *, floor_id: str | None = None) -> int:
    """Return how many weeks of the log a page holds by default: twelve if they have a logged change, else two."""
    return MOST_WEEKS if entries_of(site, monday, weeks=MOST_WEEKS, floor_id=floor_id) else LEAST_WEEKS


def first_day(site: Site, monday: date, before: date, *, weeks: int = 2) -> date:
    """Return the first day the page needs: of either week's history, or of the hotspots' earlier windows.

    With a logged change in its weeks it is the report's, so that verdicts on changes rest on the same weeks.
    """
    window = timedelta(days=int(site.settings.hotspot_days) - 7)  # the other week's map of excess
    first = min(monday - HISTORY, before - window, spots.days_needed(site, monday + timedelta(days=6))[0])
    return min(first, lazy_answers.first_day(site, monday)) if entries_of(site, monday, weeks=weeks) else first


def planner_pages(
    site: Site,
    monday: date,
    *,
    before: date | None = None,
    floor_id: str | None = None,
    weeks: int | None = None,
    clock: datetime | None = None,
    on_plan: Callable[[int], None] | None = None,
    on_hours: Callable[[int], None] | None = None,
) -> list[PlannerData]:
    """Return what the pages of a week know, one for each floor.

    Args:
        site: The project.
        monday: First day of the week.
        before: First day of the week it is compared with; None = the one before.
        floor_id: Only this floor.
        weeks: Weeks of the log, up to this one, from 2 to 12; None = `weeks_needed`.
        clock: The present: the page has no hours that are not over at it; None = all are over.
        on_plan: Called with the number of fact hours to compute first; see `build`.
        on_hours: Called after computed hours.

    Raises:
        UsageError: E105, a week is not over, and the site hides small counts.
        StoreError: E301, nothing was ever stored.
        KeyError: The site has no floor of this id.
        DiskError: E304 to E306, what leaves cannot be remembered.
    """
    other = monday - WEEK if before is None else before
    floors = [f for f in site.floors if floor_id in (None, f.floor_id)]
    if not floors:
        raise KeyError(floor_id)
    for week in (monday, other):
        check_days(site, week, week + timedelta(days=6), clock=clock)
    last = max(monday, other) + timedelta(days=6)
    n_weeks = weeks_needed(site, monday) if weeks is None else weeks
    first = first_day(site, monday, other, weeks=n_weeks)
    with open_warehouse(site, first, last, on_plan=on_plan, on_hours=on_hours) as warehouse:
        warehouse.prefetch(*_MARTS)
        warehouse.materialise("violations", "camera_hours", "area_hours")
        return [
            planner_data(warehouse, floor=f, monday=monday, before=other, weeks=n_weeks, clock=clock) for f in floors
        ]


def planner_data(
    warehouse: Warehouse,
    *,
    floor: Floor,
    monday: date,
    before: date,
    weeks: int = LEAST_WEEKS,
    clock: datetime | None = None,
) -> PlannerData:
    """Return what the page of a floor knows of a week and another.

    Args:
        warehouse: Opened from `first_day` to the week's Sunday.
        floor: The floor.
        monday: First day of the week.
        before: First day of the other week.
        weeks: Weeks of the log, up to this one.
        clock: The present, as for `planner_pages`.
    """
    data = TwoWeeks(warehouse, floor=floor, monday=monday, before=before, clock=clock)
    has_before = bool(data.hours.recorded_s[:, data.week(before)].any())
    why = why_not(data.pair)[1] if has_before else Reason("compare.no_other_week")
    if why is None and data.is_revealed_by_comparing:
        why = GIVES_AWAY
    is_compared = why is None
    is_ranked = _share(data.this) >= data.site.settings.min_coverage
    past = [monday - k * WEEK for k in range(1, HISTORY // WEEK + 1)]
    places = _places(data, is_compared=is_compared, past=past)
    maps = floor_maps(
        data, areas=report_areas.areas(data, is_compared=False, rest=say("words.rest")).rows, is_ranked=is_ranked
    )
    shown = next((m for m in maps if m.kind != "picture"), None)
    hotspots = spots.hotspots(warehouse, floor_id=floor.floor_id, until=data.sunday)
    ids = [None if p.area is None else p.area.area_id for p in places[1:]]
    counted = Counted(
        places=[data.whole, *(data.area(area_id) for area_id in ids)],
        areas=[p.area for p in places[1:]],
        close_h=[data.violation_h, *(data.violation_in(area_id) for area_id in ids)],
        extent=None if shown is None else shown.extent,
    )
    by_monday = {monday: _week(data, Period(data, monday, data.sunday), counted, excess=hotspots)}
    if has_before:
        last = before + timedelta(days=6)
        then = spots.hotspots(warehouse, floor_id=floor.floor_id, until=last)
        by_monday[before] = _week(data, Period(data, before, last), counted, excess=then)
    changes = logged_changes(data, counted, weeks=weeks)
    no_history = {k for k, p in enumerate(places) if not p.has_history}
    of_hours = replay(data, counted, before=past)
    if data.mask.is_on:
        data.remember_shared()
    return PlannerData(
        site=data.site,
        floor=floor,
        cameras=tuple(data.cameras),
        week=by_monday[monday],
        before=by_monday.get(before),
        history=floor_panel(data, data.this.history_days, counted, past, is_hidden=0 in no_history)
        if data.mask.is_on
        else panel_of(data, data.this.history_days, counted, past, hidden=no_history),
        places=places,
        comparable=tuple(bool(c) for c in data.pair.is_comparable[: len(data.ids)]),
        why_not_compared=why,
        why_no_map=None if shown else data.why_no_violations or data.why_no_places or Reason("map.no_floor"),
        why_no_violations=data.why_no_violations,
        why_no_exposure=data.why_no_exposure,
        shown=shown,
        walkable=_walkable(data, shown),
        seen=_seen(data, shown),
        hotspots=shared_spots(hotspots, data.mask, revealing=revealing_spots(data, hotspots)),
        is_made_up=are_made_up(engines(data.site, monday, data.sunday)),
        weeks=weeks,
        changes=changes,
        layouts=layouts(data, before=before, changes=changes),
        space=_space(data, is_ranked=is_ranked),
        lines=crossings(data.this),
        is_shared=data.mask.is_on,
        replay=of_hours,
    )


def _space(data: TwoWeeks, *, is_ranked: bool) -> Answers:
    """Return the report's answers on how the space is used."""
    if not asks_for(data):
        return Answers()
    areas = report_areas.areas(data, is_compared=False, rest=say("words.rest"))
    level = floor_level(data, is_compared=False, areas=areas)
    answers, coverage = lazy_answers.LazyAnswers(data), recording.coverage(data)
    asked = FigureInputs(data, answers, coverage, level, areas.rows, timetable.timetable(data).when, is_ranked)
    return shared_answers(asked, metrics=OF_SPACE)


def _seen(data: TwoWeeks, shown: FloorMap | None) -> Flags | None:
    grid = None if shown is None else cell_counts.grid_of(shown.extent)
    return None if shown is None or grid is None else seen_cells(data.cameras, extent=shown.extent, grid=grid)


def _walkable(data: TwoWeeks, shown: FloorMap | None) -> WalkableFloor | None:
    """Return where people can walk on the page's grid; what lies beyond the report's is closed, as there."""
    grid = None if shown is None else cell_counts.grid_of(shown.extent)
    if shown is None or grid is None:
        return None
    walkable = FloorGrid(data, shown.extent).walkable
    if walkable is None:
        return None
    fine = round(cell_counts.SQUARE_M / cell_counts.FINE_M)
    left, low = (math.floor(shown.extent[k] / cell_counts.FINE_M) - (grid.x0, grid.y0)[k] * fine for k in (0, 1))
    shape = (grid.n_y * fine, grid.n_x * fine)
    rest = shape[0] - low - walkable.shape[0], shape[1] - left - walkable.shape[1]
    pad = ((low, rest[0]), (left, rest[1]))
    right, up = walkable.steps
    return WalkableFloor(
        is_free=np.pad(walkable.is_free, pad),
        to_right=np.pad(right, (pad[0], (pad[1][0], pad[1][1] + 1))),
        upwards=np.pad(up, ((pad[0][0], pad[0][1] + 1), pad[1])),
    )


def _places(data: TwoWeeks, *, is_compared: bool, past: Sequence[date]) -> tuple[PlaceRow, ...]:
    """Return the whole floor, its areas, and the rest of it, with the figures the report gives them."""
    measured_areas = report_areas.areas(data, is_compared=is_compared, rest=say("words.rest"))
    level = floor_level(data, is_compared=is_compared, areas=measured_areas)
    rows: dict[str | None, AreaRow] = {row.area_id: row for row in measured_areas.rows}
    areas: list[Area | None] = [*data.areas, None] if rows else []
    unknown = hidden_places(data, past, areas)
    names = [say("planner.whole_floor"), *(say("words.rest") if a is None else a.name for a in areas)]
    ids = ["floor", *("rest" if a is None else f"area:{a.area_id}" for a in areas)]
    of_areas = [rows[None if a is None else a.area_id] for a in areas]
    unknown_share = Estimate(value=None, state="not_measurable")
    figures = [
        (level.violation_rate, level.encounter_rate, level.close_time_share or unknown_share),
        *(
            (row.violation_rate, row.encounter_rate or unknown_share, row.close_time_share or unknown_share)
            for row in of_areas
        ),
    ]
    places = [data.whole, *(data.area(None if a is None else a.area_id) for a in areas)]
    timed = [[close_time(period, where) for period in (data.this, data.pair.before)] for where in (data.floor, *areas)]
    return tuple(
        PlaceRow(
            place_id=place_id,
            name=name,
            area=area,
            cameras=tuple(bool(c) for c in place.cameras),
            has_history=k not in unknown,
            violation_rate=violation_rate,
            encounter_rate=encounter_rate,
            close_time_share=_with_change(data, close_time_share, of_time[0]) if is_compared else close_time_share,
            close_cameras=tuple(tuple(bool(c) for c in each.cameras) for each in of_time),
        )
        for k, (place_id, name, area, place, of_time, (violation_rate, encounter_rate, close_time_share)) in enumerate(
            zip(ids, names, [None, *areas], places, timed, figures, strict=True)
        )
    )


def _with_change(data: TwoWeeks, share: Estimate, of_time: Place) -> Estimate:
    """Return a share of time too close with its change from the other week, as `vsd compare` gives it."""
    change = change_close_time_share(data.pair, of_time)
    return share if change.value is None or share.value is None else with_change(share, change)


def _week(data: TwoWeeks, period: Period, counted: Counted, *, excess: spots.FloorHotspots) -> PlannerWeek:
    """Return one of the weeks; what may not be printed of it is hidden and empty."""
    shared = data.pair.used(0 if period.first == data.pair.before.first else 1)
    hidden = hidden_places(data, [period.first], counted.areas)
    slots, is_ranked = open_slots(data, period.days), _share(period) >= data.site.settings.min_coverage
    used = (data.hours.is_counted if is_ranked else data.hours.recorded_s > 0)[:, slots]
    is_shared, compared = data.mask.is_on, shared[:, slots]
    asked = counted.cells_asked(
        data,
        slots,
        used=used,
        shared=compared,
        hidden=hidden,
        is_by_hour=not is_shared,
        untimed=hidden_floor(data, period),
    )
    recorded_ms = np.rint(data.hours.recorded_s[:, slots] * 1000).astype(np.int64)
    return PlannerWeek(
        ref=WeekRef.of(period.first, zone=data.site.timezone),
        panel=floor_panel(data, period.days, counted, [period.first], is_hidden=0 in hidden)
        if is_shared
        else panel_of(data, period.days, counted, [period.first], hidden=hidden, shared=shared),
        recorded_ms=np.stack([(recorded_ms * (used & side)).sum(axis=1) for side in (~compared, compared)])
        if is_shared
        else None,
        cells=None if asked is None else cell_counts.week_cells(data, asked, excess=excess),
        is_ranked=is_ranked,
        hidden=hidden,
    )


def _share(period: Period) -> float:
    return period.recorded_h / period.scheduled_h if period.scheduled_h else 0.0
