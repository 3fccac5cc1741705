"""From marts to the week's report: every number of the page is made here, once."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date, datetime, timedelta

from vsd_analytics.errors import ReportError
from vsd_analytics.figures.catalogue import SO_FAR, map_figures, shared_answers
from vsd_analytics.figures.catalogue.form import FigureInputs
from vsd_analytics.figures.close_by_crowding import close_by_crowding
from vsd_analytics.figures.operator_counts import last_recorded_ms
from vsd_analytics.figures.panels import WEEK, FloorHours
from vsd_analytics.figures.share.counts import GIVES_AWAY, in_week_before, mask_of
from vsd_analytics.figures.share.periods import check_days, is_over, last_closed_day, not_yet
from vsd_analytics.figures.share.running import Release, release
from vsd_analytics.figures.share.weeks import NOT_AGAIN
from vsd_analytics.figures.week import areas as report_areas
from vsd_analytics.figures.week import estimates, lazy_answers, recording, timetable
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.floor_maps import floor_maps
from vsd_analytics.figures.week.lazy_answers import LazyAnswers
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.model_recording import Coverage
from vsd_analytics.figures.week.results import (
    Level,
    Provenance,
    Rules,
    SettingsChange,
    SiteRef,
    WeekRef,
    WeekState,
)
from vsd_analytics.figures.week.stored_records import stored_records
from vsd_analytics.report.model import site_changes
from vsd_analytics.report.model.sections import add_days_sections, add_maps, add_week_sections
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.site.model import Floor, Site
from vsd_analytics.version import VERSION
from vsd_analytics.warehouse.provenance import are_made_up, engines
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import chosen, language, speaking

DAY = timedelta(days=1)
THREADS = 1
"""Threads of a page's queries: to read small files, two take half as much processor time again."""
_MARTS = (
    *("violations", "camera_hours", "area_hours", "crowding_hours", "joined_days", "cell_hours", "cell_days"),
    *("track_days", "together_days", "track_groups", "company_hours", "episodes", "distances", "gatherings"),
    *("cluster_sizes", "met_days", "neighbour_hours", "footsteps"),
    *("track_hours", "square_hours"),
)
"""Marts that the report of a site with enough data reads."""
_WHOM = {"all": "everybody", "visitors": "visitors", "staff": "staff"}


def measured(
    site: Site,
    first: date,
    last: date | None,
    *,
    floor_id: str | None,
    now: datetime | None,
    clock: datetime | None,
    on_plan: Callable[[int], None] | None,
    on_hours: Callable[[int], None] | None,
    has_context: bool = False,
) -> WeekReport:
    """Return the figures of the ISO week from `first`, or of other days up to `last`, without a story.

    Arguments and errors are those of `report.pages.story.week_report` and `days_report`.
    """
    floor = next((f for f in site.floors if floor_id in (None, f.floor_id)), None)
    if floor is None:
        raise KeyError(floor_id)
    released = None
    is_running = clock is not None and not is_over(site, first + WEEK - DAY, clock=clock)
    if last is None and clock is not None and is_running and mask_of(site).is_on:
        released = _released(site, floor, first, clock)
        last = released.through
    end = first + WEEK if last is None else last + timedelta(days=1)
    if released is None:
        check_days(site, first, end - timedelta(days=1), clock=clock)
    loaded = min(first - (end - first), _first_day(site, first)), end - timedelta(days=1)
    opened = open_warehouse(site, *loaded, on_plan=on_plan, on_hours=on_hours, threads=THREADS)
    with speaking(chosen() or site.language), opened as warehouse:
        data = WeekData(_made(warehouse), floor=floor, monday=first, last=last, clock=clock, released=released)
        if data.is_shared_otherwise:
            raise _shared_otherwise(first, site.settings.people, data.people_shared)
        answers = LazyAnswers(data)
        report = _report(data, floor, answers, now, has_context=has_context or site.settings.show_context)
        if not data.is_released:
            report = (add_week_sections if data.is_week else add_days_sections)(report, data, answers)
        report = add_maps(report, data)
        data.remember_shared()
        return report


def _released(site: Site, floor: Floor, monday: date, clock: datetime) -> Release:
    """Return what may leave of a week that is not over.

    Raises:
        UsageError: E105, nothing yet.
    """
    closed = min(last_closed_day(site, clock), monday + WEEK - DAY)
    released = None
    if closed >= monday:
        with open_warehouse(site, monday, closed, threads=THREADS) as warehouse:
            released = release(FloorHours(warehouse, floor=floor), monday, closed)
    if released is None:
        raise not_yet(monday)
    return released


def _shared_otherwise(monday: date, people: str, people_then: str) -> ReportError:
    """Return the error of a week that may not leave again, given whom it counts now and counted then."""
    week = f"{monday:%G-W%V}"
    if people != people_then:
        return ReportError(
            f"the week {week} was shared before and counted {_WHOM[people_then]}; now it would count {_WHOM[people]}",
            code="E503",
            why="who has both versions would have the figures of the few who work there",
            fix=f'[staff] people = "{people_then}", or once VSD_PEOPLE={people_then} vsd report --week {week}; '
            "or add --exact, for your own eyes",
        )
    return ReportError(
        f"the week {week} was shared before, and too little changed since",
        code="E503",
        why="who has both versions would have the difference, which tells of a few people",
        fix="share what was made then; or add --exact, for your own eyes; has nobody seen it yet: vsd explain E503",
    )


def _made(warehouse: Warehouse) -> Warehouse:
    """Return a warehouse with the marts that every report reads, most of them several times."""
    warehouse.prefetch(*_MARTS)
    of_space = ("violations", "camera_hours", "area_hours", "crowding_hours")
    warehouse.materialise(*of_space, "hours", "camera_slots", "joined_days")
    return warehouse


def _first_day(site: Site, monday: date) -> date:
    """Return the first day to load: the history that exists, and the week before in any case."""
    extent = stored_extent(site, near=monday)
    earliest = lazy_answers.first_day(site, monday)
    if extent is None:
        return earliest
    stored = extent.first_day - timedelta(days=extent.first_day.weekday())
    return max(earliest, min(stored, monday - WEEK))


def _report(
    data: WeekData, floor: Floor, answers: LazyAnswers, now: datetime | None, *, has_context: bool
) -> WeekReport:
    site, settings = data.site, data.site.settings
    sent = engines(site, data.monday, data.sunday)
    coverage = recording.coverage(data, answers.camera_watch)
    is_alike = data.is_week or data.span % WEEK == timedelta()
    has_before = is_alike and bool(data.hours.recorded_s[:, data.week(data.monday - data.span)].any())
    has_before = has_before and data.hidden_before.why_floor not in NOT_AGAIN  # its people and times would tell
    sent_before = engines(site, data.monday - data.span, data.monday - timedelta(days=1)) if has_before else ()
    change = site_changes.settings_change(data, sent, sent_before) if has_before else None
    state = _state(data, coverage, change, has_before)
    is_compared = state == "normal"
    is_ranked = state not in ("no_data", "too_incomplete")
    areas = report_areas.Areas(rows=())
    if state != "no_data":
        areas = report_areas.areas(data, is_compared=is_compared, rest=say("words.rest"))
    hours = timetable.timetable(data)
    level = floor_level(data, is_compared=is_compared, areas=areas)
    has_ranking = is_ranked and level.violation_rate.value != 0
    made_at = _made_at(data, now)
    inputs = FigureInputs(data, answers, coverage, level, areas.rows, hours.when, is_ranked)
    shared = shared_answers(inputs, metrics=SO_FAR if data.is_released else None, has_context=has_context)
    return WeekReport(
        site=SiteRef(
            site_id=site.site_id,
            name=site.name,
            floor_id=floor.floor_id,
            floor_name=floor.name,
            floors=tuple(f.floor_id for f in site.floors),
        ),
        week=_ref(data, data.monday),
        previous=_ref(data, data.monday - data.span) if has_before else None,
        generated_at=made_at,
        provenance=Provenance(
            version=VERSION,
            engines=sent,
            settings_id=settings.settings_id(),
            settings_non_default=tuple((k, _plain(v)) for k, v in settings.non_default().items()),
            inputs_digest=data.warehouse.inputs_digest,
            language=language(),
            is_made_up=are_made_up(sent),
            notes=tuple(run.warning(site) for run in data.warehouse.other_rules()),
        ),
        rules=same_fields(Rules, settings),
        state=state,
        coverage=coverage,
        level=level,
        busiest_spot=report_areas.busiest_spot(data, areas.rows) if has_ranking else None,
        busiest_hour=hours.busiest if has_ranking and hours.busiest and not hours.busiest.is_masked else None,
        areas=areas.rows,
        when=hours.when,
        maps=floor_maps(data, areas=areas.rows, is_ranked=is_ranked) if state != "no_data" else (),
        log=site_changes.log_lines(data, coverage, is_compared=is_compared),
        stored=stored_records(site, at=made_at.date()),
        settings_change=change if state == "settings_changed" else None,
        close_by_crowding=None
        if data.is_released
        else close_by_crowding(data.this, why_hidden=data.hidden.why_floor, is_by_day=not data.hidden.hides_hours),
        answers=shared,
        figures=map_figures(inputs),
    )


def _ref(data: WeekData, first: date) -> WeekRef:
    zone = data.site.timezone
    if data.is_week:
        return WeekRef.of(first, zone=zone)
    return WeekRef.of_days(first, first + data.span - timedelta(days=1), zone=zone)


def _state(data: WeekData, coverage: Coverage, change: SettingsChange | None, has_before: bool) -> WeekState:
    if coverage.recorded_h == 0:
        return "no_data"
    whole_h = float(data.hours.scheduled_s[:, data.week()].sum()) / 3600  # hours to come among them
    if coverage.recorded_h < data.site.settings.min_coverage * whole_h:
        return "too_incomplete"
    if not data.whole.n[:, data.week()].any() and data.why_no_violations is None:
        return "empty"
    if change is not None:
        return "settings_changed"
    return "normal" if has_before else "first_week"


def floor_level(data: WeekData, *, is_compared: bool, areas: report_areas.Areas) -> Level:
    """Return the figures of the whole floor, without those that are too small or would tell a small one."""
    measured = estimates.measure(data, data.whole, is_compared=is_compared)
    violation_rate, encounter_rate = measured.violation_rate, measured.encounter_rate
    close = estimates.floor_close_time_share(data, is_compared=is_compared)
    is_printed = True
    if (why := data.hidden.why_floor) is not None:
        violation_rate, encounter_rate, close = (
            estimates.without_figures(e, why) for e in (violation_rate, encounter_rate, close)
        )
        is_printed = False
    elif is_compared and (
        data.mask.hides(measured.n_before)
        or not areas.is_before_safe
        or data.hidden_before.why_floor
        or data.is_revealed_by_comparing
    ):
        is_few = data.mask.hides(measured.n_before)
        why = in_week_before(data.mask.why) if is_few else GIVES_AWAY
        violation_rate, close, encounter_rate = (
            estimates.without_change(e, why) for e in (violation_rate, close, encounter_rate)
        )
    panel = data.panel(data.whole, data.week_days)
    is_known = bool(panel.x_h.any())
    return Level(
        violation_rate=violation_rate,
        encounter_rate=encounter_rate,
        close_time_share=close,
        people=estimates.people(data, is_compared=is_compared),
        exposure_h=float(panel.exposure_h.sum()) if is_known and data.why_no_exposure is None else None,
        violations=measured.n if is_printed and is_known and data.why_no_violations is None else None,
    )


def _made_at(data: WeekData, now: datetime | None) -> datetime:
    """Return the instant to print as the time of making: `now`, else the week's last record, else its end."""
    if now is not None:
        return now.astimezone(data.site.zone)
    end = data.midnight(data.monday + data.span)
    last = last_recorded_ms(data.warehouse)
    if last is None or data.local(last) < data.midnight(data.monday):
        return end
    return min(end, data.local(last))


def _plain(value: object) -> str:
    """Return a setting as a person would write it: 0, 100, 200."""
    return ", ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else str(value)
