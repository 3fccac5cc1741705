"""From marts to the week's report: every number of the page is made here, once."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from typing import Any

import pandas as pd
import shapely

from vsd_analytics.changelog import read_log
from vsd_analytics.report import estimates, headline, recorded
from vsd_analytics.report.mapping import floor_maps
from vsd_analytics.report.model import (
    AreaRow,
    BusiestHour,
    BusiestSpot,
    Coverage,
    DayMean,
    Estimate,
    Figure,
    HourCell,
    HourMean,
    Level,
    LogLine,
    Provenance,
    Rules,
    SettingsChange,
    SiteRef,
    WeekRef,
    WeekReport,
    WeekState,
    When,
)
from vsd_analytics.report.weekdata import WEEK, WeekData
from vsd_analytics.site import Floor, Site
from vsd_analytics.version import VERSION
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse, stored_extent

HISTORY_WEEKS = 5
MADE_UP_ENGINE = "vsd-demo "
"""What the simulator of `vsd demo` calls itself: its reports say that the data are made up."""


def week_report(
    site: Site,
    monday: date,
    *,
    floor_id: str | None = None,
    now: datetime | None = None,
    on_plan: Callable[[int], None] | None = None,
    on_hours: Callable[[int], None] | None = None,
) -> WeekReport:
    """Return the report of one floor and ISO week.

    Args:
        site: The project.
        monday: First day of the week.
        floor_id: Floor; None = the first.
        now: Instant to print as the time of making; None = the last record's.
        on_plan, on_hours: Progress of facts that must be made first; see `build`.

    Returns:
        The report with its story told; a week without data is a report too.

    Raises:
        StoreError: E301, nothing was ever stored.
    """
    extent = stored_extent(site)
    earliest = monday - HISTORY_WEEKS * WEEK
    first = (
        earliest
        if extent is None
        else max(earliest, min(extent.first_day - timedelta(days=extent.first_day.weekday()), monday - WEEK))
    )
    floor = next(f for f in site.floors if floor_id is None or f.floor_id == floor_id)
    with open_warehouse(site, first, monday + timedelta(days=6), on_plan=on_plan, on_hours=on_hours) as warehouse:
        warehouse.keep("episodes", "violations", "camera_hours", "area_hours")
        data = WeekData(warehouse, floor=floor, monday=monday)
        return headline.finish(_report(data, floor, warehouse, now))


def _report(data: WeekData, floor: Floor, warehouse: Warehouse, now: datetime | None) -> WeekReport:
    site, settings = data.site, data.site.settings
    engines, engines_before = recorded.engines(data, data.monday), recorded.engines(data, data.monday - WEEK)
    coverage = recorded.coverage(data)
    has_before = bool((data.before["recorded_open_s"] > 0).any())
    change = _settings_change(data, engines, engines_before) if has_before else None
    n_violations = float(data.current["n"].sum())
    state = _state(data, coverage, change, has_before, n_violations)
    is_compared = state == "normal"
    level = _level(data, is_compared)
    is_ranked = state not in ("no_data", "too_incomplete")
    areas = _areas(data, is_compared, n_violations) if state != "no_data" else ()
    if change is not None and change.at is not None:
        change = replace(
            change, often_after=estimates.often(data, is_compared=False, since=round(change.at.timestamp() * 1000))
        )
    return WeekReport(
        site=SiteRef(
            site_id=site.site_id,
            name=site.name,
            floor_id=floor.floor_id,
            floor_name=floor.name,
            floors=tuple(f.floor_id for f in site.floors),
        ),
        week=_week(site, data.monday),
        previous=_week(site, data.monday - WEEK) if has_before else None,
        generated_at=_made_at(data, now),
        provenance=Provenance(
            version=VERSION,
            engines=engines,
            settings_id=settings.settings_id(),
            settings_non_default=tuple((k, str(v)) for k, v in settings.non_default().items()),
            inputs_digest=_inputs(warehouse),
            is_made_up=any(e.startswith(MADE_UP_ENGINE) for e in engines),
        ),
        rules=Rules(**{f: settings.values[f] for f in Rules.__dataclass_fields__}),
        state=state,
        coverage=coverage,
        level=level,
        busiest_spot=_busiest_spot(data, areas) if is_ranked and n_violations else None,
        busiest_hour=_busiest_hour(data) if is_ranked and n_violations else None,
        areas=areas,
        when=_when(data),
        maps=floor_maps(data, areas=areas, is_ranked=is_ranked) if state != "no_data" else (),
        log=_log(data, coverage, is_compared),
        settings_change=change,
        figures=_figures(data, coverage, level, areas, n_violations),
    )


def _state(
    data: WeekData, coverage: Coverage, change: SettingsChange | None, has_before: bool, n_violations: float
) -> WeekState:
    if coverage.recorded_h == 0:
        return "no_data"
    if coverage.share < data.site.settings.min_coverage:
        return "too_incomplete"
    if n_violations == 0 and estimates.why_no_violations(data) is None:
        return "empty"
    if change is not None:
        return "settings_changed"
    return "normal" if has_before else "first_week"


def _level(data: WeekData, is_compared: bool) -> Level:
    counted = data.current[data.current["is_counted"]]
    why = estimates.why_no_violations(data)
    n = int(data.current["n"].sum())
    unknown = why is not None or counted.empty
    return Level(
        often=estimates.often(data, is_compared=is_compared),
        risky=estimates.risky(data, is_compared=is_compared),
        people=estimates.people(data, is_compared=is_compared),
        exposure_h=None
        if estimates.why_no_exposure(data) or counted.empty
        else float(data.current["exposure_h"].sum()),
        violations=None if unknown or _is_masked(data, n) else n,
    )


def _areas(data: WeekData, is_compared: bool, n_violations: float) -> tuple[AreaRow, ...]:
    """Return the areas, busiest first by violations per open hour, the rest of the floor last."""
    if estimates.why_no_violations(data) is not None:
        return ()
    named = [(a.area_id, a.name) for a in data.site.areas if a.floor_id == data.floor.floor_id]
    rows = [_area(data, area_id, name, is_compared, n_violations) for area_id, name in named]
    rows.sort(key=lambda r: -(r.often.value or 0.0))
    if named:
        rows.append(_area(data, None, "Rest of the floor", is_compared, n_violations))
    return tuple(rows)


def _area(data: WeekData, area_id: str | None, name: str, is_compared: bool, n_violations: float) -> AreaRow:
    hours = data.of_area(data.current, area_id)
    n = int(hours["n"].sum())
    masked = _is_masked(data, n)
    often = estimates.often(data, area_id=area_id, is_floor=False, is_compared=is_compared)
    risky = estimates.risky(data, area_id=area_id, is_floor=False, is_compared=is_compared)
    if masked:
        why = f"fewer than {data.site.settings.mask_below} violations were counted"
        often, risky = (
            Estimate(
                value=None, state="not_enough_data", reason=why, verdict="too_little_data" if is_compared else None
            )
            for _ in "12"
        )
    scheduled = float(hours["open_s"].sum())
    return AreaRow(
        area_id=area_id,
        name=name,
        counted=None if masked else n,
        is_masked=masked,
        often=often,
        risky=risky,
        exposure_h=None if estimates.why_no_exposure(data) else float(hours["exposure_h"].sum()),
        share=n / n_violations if n_violations and not masked else None,
        recorded_share=float(hours["recorded_open_s"].sum()) / scheduled if scheduled else None,
        cameras=tuple(c for c in data.ids if c in set(hours["camera_id"])),
    )


def _busiest_spot(data: WeekData, areas: tuple[AreaRow, ...]) -> BusiestSpot | None:
    best = next((a for a in areas if a.area_id is not None and a.often.value), None)
    if best is None:
        return None
    polygon = next(a.polygon for a in data.site.areas if a.area_id == best.area_id)
    seen = recorded.seen_area_m2(data)
    return BusiestSpot(
        area_id=best.area_id,
        name=best.name,
        share=best.share or 0.0,
        floor_share=shapely.Polygon(polygon).area / seen if seen else None,
    )


def _site_hours(data: WeekData) -> pd.DataFrame:
    """Return one row per local hour of the week, the floor's cameras together, with the hour's state."""
    settings = data.site.settings
    keys = ["hour_start_ms", "local_date", "local_hour", "fold"]
    share = (data.current["recorded_open_s"] / data.current["open_s"]).where(data.current["open_s"] > 0)
    hours = (
        data.current.assign(is_down=share < settings.partial_hour_share)
        .groupby(keys, as_index=False)
        .agg(
            open_s=("open_s", "sum"),
            recorded_s=("recorded_open_s", "sum"),
            n=("n", "sum"),
            cameras_down=("is_down", "sum"),
        )
    )
    hours["share"] = (hours["recorded_s"] / hours["open_s"]).where(hours["open_s"] > 0)
    hours["state"] = "no_data"
    hours.loc[hours["share"] > 0, "state"] = "low_data"
    hours.loc[hours["share"] >= settings.partial_hour_share, "state"] = "partial"
    hours.loc[hours["share"] >= settings.full_hour_share, "state"] = "full"
    hours.loc[hours["open_s"] == 0, "state"] = "closed"
    return hours


def _busiest_hour(data: WeekData) -> BusiestHour | None:
    hours = _site_hours(data)
    full = hours[hours["state"] == "full"]
    if full.empty or full["n"].max() == 0:
        return None
    best = full.loc[full["n"].idxmax()]
    masked = _is_masked(data, int(best["n"]))
    return BusiestHour(
        start=recorded.local(data, int(best["hour_start_ms"])),
        violations=None if masked else float(best["n"]),
        is_masked=masked,
        ratio_to_mean=None if masked else float(best["n"] / full["n"].mean()),
    )


def _when(data: WeekData) -> When:
    hours = _site_hours(data)
    is_known = estimates.why_no_violations(data) is None
    open_hours = set(hours.loc[hours["state"] != "closed", "local_hour"])
    shown = hours[hours["local_hour"].isin(open_hours)]
    cells = []
    for row in shown.to_dict(orient="records"):
        counted = is_known and row["state"] not in ("no_data", "closed")
        masked = counted and _is_masked(data, int(row["n"]))
        low = row["state"] == "low_data" and not masked
        cells.append(
            HourCell(
                day=row["local_date"],
                hour=int(row["local_hour"]),
                fold=int(row["fold"]),
                start=recorded.local(data, int(row["hour_start_ms"])),
                state=row["state"],
                violations=int(row["n"]) if counted and not masked else None,
                is_masked=masked,
                scaled=float(row["n"] / row["share"]) if low and counted else None,
                share=None if pd.isna(row["share"]) else float(row["share"]),
                cameras_down=int(row["cameras_down"]),
            )
        )
    full = shown[shown["state"] == "full"] if is_known else shown.iloc[:0]
    by_day, by_hour = full.groupby("local_date")["n"], full.groupby("local_hour")["n"]
    means, counts = by_day.mean(), by_day.size()
    hour_means, hour_counts = by_hour.mean(), by_hour.size()
    return When(
        cells=tuple(cells),
        day_means=tuple(DayMean(day=d, value=_get(means, d), hours=int(counts.get(d, 0))) for d in data.week_days),
        hour_means=tuple(
            HourMean(hour=h, value=_get(hour_means, h), hours=int(hour_counts.get(h, 0))) for h in sorted(open_hours)
        ),
    )


def _log(data: WeekData, coverage: Coverage, is_compared: bool) -> tuple[LogLine, ...]:
    zone = data.site.zone
    start = datetime(data.monday.year, data.monday.month, data.monday.day, tzinfo=zone)
    names = {a.area_id: a.name for a in data.site.areas}
    lines = []
    for entry in read_log(data.site):
        at = entry.at.astimezone(zone)
        if not start - WEEK <= at < start + WEEK:
            continue
        since = moved = None
        if at >= start and entry.area_id in names and is_compared:
            ms = round(at.timestamp() * 1000)
            since = estimates.often(data, area_id=entry.area_id, is_floor=False, since=ms)
            moved = _moved_after(data, entry.area_id, ms)
        lines.append(
            LogLine(
                at=at,
                text=entry.text,
                area_id=entry.area_id,
                area_name=names.get(entry.area_id or ""),
                since=since,
                moved_after=moved,
            )
        )
    lines += recorded.detected(data, coverage)
    return tuple(sorted(lines, key=lambda line: line.at))


def _moved_after(data: WeekData, area_id: str | None, since: int) -> float | None:
    """Return the share of an area's change over the week that came after an instant, 0 to 1."""
    whole, after = (data.compared(area_id, is_floor=False, since=ms) for ms in (None, since))
    total, late = (float(now.n.sum() - before.n.sum()) for before, now in (whole, after))
    return None if total == 0 else min(1.0, max(0.0, late / total))


def _settings_change(data: WeekData, engines: tuple[str, ...], before: tuple[str, ...]) -> SettingsChange | None:
    """Return the change inside the two weeks that forbids a comparison: a calibration or the engine."""
    zone = data.site.zone
    start = datetime(data.monday.year, data.monday.month, data.monday.day, tzinfo=zone) - WEEK
    for camera in data.cameras:
        for old, new in zip(camera.calibrations, camera.calibrations[1:], strict=False):
            if new.valid_from is not None and start <= new.valid_from < start + 2 * WEEK:
                at = new.valid_from.astimezone(zone)
                return SettingsChange(
                    name="calibration",
                    before=old.calibration_id,
                    after=new.calibration_id,
                    at=at if at >= start + WEEK else None,
                )
    if engines and before and engines != before:
        return SettingsChange(name="engine", before=", ".join(before), after=", ".join(engines), at=None)
    return None


def _figures(
    data: WeekData, coverage: Coverage, level: Level, areas: tuple[AreaRow, ...], n_violations: float
) -> Mapping[str, Figure]:
    counted = data.current[data.current["is_counted"]]
    recorded_h = float(counted["x_h"].sum())
    exposure_h = level.exposure_h
    violation_h = float(counted["violation_s"].sum()) / 3600
    unknown_time = exposure_h is None or exposure_h == 0
    distance = data.site.settings.distance_m
    return {
        "M0": _figure(level.often, "violations per open hour", recorded_h),
        "M1": Figure(unit="share of open camera-hours", value=coverage.share, denominator=coverage.scheduled_h),
        "M2": Figure(
            unit="outages of 10 minutes or more",
            rows=tuple(
                {
                    "cameras": list(o.camera_ids),
                    "start": o.start.isoformat(),
                    "end": o.end.isoformat(),
                    "open_h": o.open_h,
                    "is_inferred": o.is_inferred,
                }
                for o in coverage.outages
            ),
        ),
        "M3": _missing("person-hours", level.people)
        if exposure_h is None
        else Figure(unit="person-hours", value=exposure_h, denominator=recorded_h),
        "M5": _figure(level.people, "people in view, mean over recorded open hours", recorded_h),
        "M6": Figure(
            unit=f"share of person-time closer than {distance:g} m to somebody",
            value=None if unknown_time or exposure_h is None else violation_h / exposure_h,
            denominator=exposure_h,
            state="ok"
            if not unknown_time
            else "not_measurable"
            if level.people.state == "not_measurable"
            else "not_enough_data",
            reason=None if not unknown_time else level.people.reason or "nobody was seen in recorded open hours",
        ),
        "M7": _figure(level.risky, "violations per person-hour", exposure_h),
        "M8": _m8(data, level),
        "M15": Figure(
            unit="violations per open hour and per person-hour, by area",
            rows=tuple(
                {
                    "area": a.area_id,
                    "name": a.name,
                    "often": a.often.value,
                    "risky": None if a.risky is None else a.risky.value,
                    "exposure_h": a.exposure_h,
                    "state": a.often.state,
                }
                for a in areas
            ),
            state="ok" if areas else "not_enough_data",
            reason=None if areas else "no areas are drawn in vsd.toml, or nothing was recorded",
        ),
    }


def _m8(data: WeekData, level: Level) -> Figure:
    unit = "violations counted in open hours"
    if level.violations is not None:
        return Figure(unit=unit, value=level.violations, denominator=float(data.current["x_h"].sum()))
    if level.often.state == "not_measurable":
        return _missing(unit, level.often)
    is_none = not bool((data.current["recorded_open_s"] > 0).any())
    reason = "nothing was recorded" if is_none else f"fewer than {data.site.settings.mask_below}, held back for privacy"
    return Figure(unit=unit, state="not_enough_data", reason=reason)


def _figure(estimate: Estimate, unit: str, denominator: float | None) -> Figure:
    return Figure(
        unit=unit,
        value=estimate.value,
        lo=estimate.lo,
        hi=estimate.hi,
        verdict=estimate.verdict,
        denominator=denominator,
        state=estimate.state,
        reason=estimate.reason,
    )


def _missing(unit: str, estimate: Estimate) -> Figure:
    return Figure(
        unit=unit, state=estimate.state if estimate.state != "ok" else "not_enough_data", reason=estimate.reason
    )


def _week(site: Site, monday: date) -> WeekRef:
    year, number, _ = monday.isocalendar()
    return WeekRef(
        iso=f"{year}-W{number:02d}",
        year=year,
        number=number,
        monday=monday,
        sunday=monday + timedelta(days=6),
        zone=site.timezone,
    )


def _made_at(data: WeekData, now: datetime | None) -> datetime:
    if now is not None:
        return now.astimezone(data.site.zone)
    last = data.warehouse.rows("select max(ended_ms) as ms from recorded_spans")[0]["ms"]
    if last is None:
        midnight = datetime(data.sunday.year, data.sunday.month, data.sunday.day, tzinfo=data.site.zone)
        return midnight + timedelta(days=1)
    return datetime.fromtimestamp(last // 1000, tz=UTC).astimezone(data.site.zone)


def _inputs(warehouse: Warehouse) -> str:
    h = hashlib.blake2b(digest_size=8)
    for hour, fingerprint in sorted(warehouse.built.fingerprints.items()):
        h.update(f"{hour}:{fingerprint};".encode())
    return h.hexdigest()


def _is_masked(data: WeekData, n: int) -> bool:
    return 0 < n < data.site.settings.mask_below


def _get(series: pd.Series[float], key: Any) -> float | None:
    value = series.get(key)
    return None if value is None else float(value)
