"""Synthetic weekly reports: a normal week, each abnormal state, each verdict, and a site full of hostile names."""

from __future__ import annotations

import base64
from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
from report import model_classes as m

from vsd_analytics.figures.week.bands import heat_bands
from vsd_analytics.figures.week.timetable import busiest_day
from vsd_analytics.report.model import week as page_model
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.wording.reasons import read_reason

UNIT = read_reason("its unit")

ROME = ZoneInfo("Europe/Rome")
MONDAY = date(2026, 11, 9)
WEEK = m.WeekRef(iso="2026-W46", year=2026, number=46, monday=MONDAY, sunday=date(2026, 11, 15), zone="Europe/Rome")
BEFORE = m.WeekRef(
    iso="2026-W45", year=2026, number=45, monday=date(2026, 11, 2), sunday=date(2026, 11, 8), zone="Europe/Rome"
)
PROFILE = {8: 50, 9: 88, 10: 112, 11: 128, 12: 150, 13: 118, 14: 121, 15: 91, 16: 115, 17: 150, 18: 126, 19: 92, 20: 55}
HOSTILE = ("<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "</style><b>&amp;", "='{{ 7*7 }}'\\")


def estimate(value: float | None, change: float | None = None, half: float = 0.04, **more: Any) -> m.Estimate:
    """Return an estimate whose verdict follows from its interval."""
    if value is None:
        return m.Estimate(
            value=None, **{"state": "not_enough_data", "reason": read_reason("needs 5 days, has 2"), **more}
        )
    if change is None:
        return m.Estimate(value=value, lo=value * 0.96, hi=value * 1.04, **more)
    lo, hi = change - half, change + half
    verdict = verdict_of(1 + lo, 1 + hi)
    said: dict[str, Any] = {"verdict": verdict, "hours_compared": 301.0, "change_lo": lo, "change_hi": hi}
    return m.Estimate(
        value=value, lo=value * 0.96, hi=value * 1.04, previous=value / (1 + change), change=change, **(said | more)
    )


def is_open(day: int, hour: int) -> bool:
    return 10 <= hour < 18 if day == 6 else 8 <= hour < 21


def cells(*, outage: bool = True) -> tuple[m.HourCell, ...]:
    out = []
    for d in range(7):
        for h in range(24):
            day = MONDAY + timedelta(days=d)
            start = datetime(day.year, day.month, day.day, h, tzinfo=ROME)
            base: dict[str, Any] = {"day": day, "hour": h, "start": start}
            if not is_open(d, h):
                out.append(m.HourCell(**base, state="closed"))
                continue
            n = round(PROFILE[h] * (1.45 if d == 5 else 1.2 if d == 6 else 0.9 + 0.05 * (d * 7 % 4)))
            if outage and (d, h) in ((1, 20), (2, 8)):
                out.append(m.HourCell(**base, state="no_data", share=0.0, cameras_down=4))
            elif outage and (d, h) == (6, 10):
                out.append(m.HourCell(**base, state="low_data", violations=21, scaled=82.0, share=0.256))
            elif outage and ((d == 3 and h >= 13) or (d == 4 and h < 10)):
                out.append(m.HourCell(**base, state="partial", violations=round(n * 0.8), share=0.75, cameras_down=1))
            elif (d, h) == (0, 8):
                out.append(m.HourCell(**base, state="full", is_masked=True, share=1.0))
            elif (d, h) == (0, 20):
                out.append(m.HourCell(**base, state="full", violations=0, share=0.99))
            else:
                out.append(m.HourCell(**base, state="full", violations=n, share=0.98))
    return tuple(out)


def when(hours: tuple[m.HourCell, ...]) -> m.Timetable:
    full = [c for c in hours if c.state == "full" and c.cameras_down == 0 and c.violations is not None]

    def mean(chosen: list[m.HourCell]) -> tuple[float | None, int]:
        return (sum(c.violations or 0 for c in chosen) / len(chosen) if chosen else None), len(chosen)

    days = []
    for d in range(7):
        value, n = mean([c for c in full if c.day == MONDAY + timedelta(days=d)])
        days.append(m.DayMean(day=MONDAY + timedelta(days=d), value=value, hours=n))
    by_hour = []
    for h in range(24):
        value, n = mean([c for c in full if c.hour == h])
        by_hour.append(m.HourMean(hour=h, value=value, hours=n))
    top = busiest_day({(c.day, c.hour): float(c.violations or 0) for c in full})
    return m.Timetable(cells=hours, day_means=tuple(days), hour_means=tuple(by_hour), busiest_day=top)


def camera(k: int, name: str, hours: tuple[m.HourCell, ...], *, is_weak: bool) -> m.CameraRecord:
    days = []
    for d in range(7):
        shares: list[float | None] = [None] * 24
        for c in hours:
            if c.day == MONDAY + timedelta(days=d) and c.state != "closed":
                down = c.state == "no_data" or (is_weak and c.cameras_down > 0)
                shares[c.hour] = 0.0 if down else 0.256 if c.state == "low_data" else 1.0
        known = [s for s in shares if s is not None]
        days.append(
            m.CameraDay(
                day=MONDAY + timedelta(days=d),
                scheduled_h=float(len(known)),
                recorded_h=sum(known),
                share=sum(known) / len(known) if known else None,
                hourly_share=tuple(shares),
            )
        )
    scheduled, recorded = sum(d.scheduled_h for d in days), sum(d.recorded_h for d in days)
    return m.CameraRecord(
        camera_id=f"cam-{k}",
        name=name,
        label=f"C{k}",
        days=tuple(days),
        scheduled_h=scheduled,
        recorded_h=recorded,
        share=recorded / scheduled,
        last_record=datetime(2026, 11, 15, 17, 59, tzinfo=ROME),
    )


def coverage(hours: tuple[m.HourCell, ...], *, names: tuple[str, ...], outages: bool = True) -> m.Coverage:
    cameras = tuple(camera(k + 1, n, hours, is_weak=outages and k == 2) for k, n in enumerate(names))
    recorded, scheduled = sum(c.recorded_h for c in cameras), sum(c.scheduled_h for c in cameras)
    everyone = tuple(c.camera_id for c in cameras)
    lost = (
        m.Outage(
            camera_ids=everyone,
            start=datetime(2026, 11, 10, 20, tzinfo=ROME),
            end=datetime(2026, 11, 11, 9, tzinfo=ROME),
            open_h=2.0,
        ),
        m.Outage(
            camera_ids=everyone[2:3],
            start=datetime(2026, 11, 12, 13, tzinfo=ROME),
            end=datetime(2026, 11, 13, 10, tzinfo=ROME),
            open_h=10.0,
        ),
    )
    return m.Coverage(
        share=recorded / scheduled,
        recorded_h=recorded,
        scheduled_h=scheduled,
        open_h=86.0,
        seen_h=71.0,
        cameras=cameras,
        outages=lost if outages else (),
    )


def plan() -> m.MapImage:
    """A plan as a small transparent SVG: walls and shelves."""
    walls = "<path fill='none' stroke='#4a4f57' stroke-width='6' d='M96 637H3V3H957V637H224M0 176H208V0M836 0V40'/>"
    boxes = [(280, 284, 400, 36), (280, 188, 400, 36), (280, 92, 400, 36), (280, 0, 400, 24), (504, 476, 32, 104)]
    boxes += [(584, 476, 32, 104), (664, 476, 32, 104), (744, 476, 32, 104), (808, 40, 28, 200), (848, 440, 88, 40)]
    shelves = "".join(
        f"<rect fill='#dcd7cc' stroke='#a39d90' x='{x}' y='{y}' width='{w}' height='{h}'/>" for x, y, w, h in boxes
    )
    text = f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 960 640'>{shelves}{walls}</svg>"
    uri = "data:image/svg+xml;base64," + base64.b64encode(text.encode()).decode()
    return m.MapImage(data_uri=uri, extent=(0.0, 0.0, 24.0, 16.0))


def density() -> np.ndarray[Any, Any]:
    x, y = np.meshgrid(np.arange(96) * 0.25 + 0.125, np.arange(64) * 0.25 + 0.125)
    spots = [
        (16.6, 5.4, 5.0, 1.3, 0.8),
        (18.2, 5.0, 2.6, 1.4, 0.6),
        (4.1, 5.4, 3.0, 0.8, 0.5),
        (6.1, 9.7, 2.8, 0.6, 1.0),
    ]
    spots += [(20.6, 8.4, 2.4, 0.5, 0.8), (3.9, 2.4, 1.5, 0.7, 0.6), (9.0, 5.0, 1.4, 0.6, 0.4)]
    total = np.zeros_like(x)
    for cx, cy, peak, sx, sy in spots:
        total += peak * np.exp(-((x - cx) ** 2) / (2 * sx**2) - (y - cy) ** 2 / (2 * sy**2))
    return total


def floor_map(names: tuple[str, ...]) -> m.FloorMap:
    steps = m.Rules(distance_m=2.0).heat_steps
    rings = [
        ((13.0, 3.4), (21.5, 3.4), (21.5, 7.2), (13.0, 7.2)),
        ((1.2, 3.6), (6.5, 3.6), (6.5, 7.2), (1.2, 7.2)),
        ((4.6, 7.8), (7.4, 7.8), (7.4, 11.6), (4.6, 11.6)),
        ((18.6, 8.6), (20.1, 8.6), (20.1, 15.4), (18.6, 15.4)),
    ]
    return m.FloorMap(
        kind="plan",
        title="Ground floor",
        extent=(0.0, 0.0, 24.0, 16.0),
        image=plan(),
        bands=heat_bands(density(), cell_m=0.25, origin_m=(0.0, 0.0), steps=steps),
        unseen=(
            (((0.0, 11.6), (5.2, 11.6), (5.2, 16.0), (0.0, 16.0)),),
            (((20.9, 10.0), (24.0, 10.0), (24.0, 16.0), (20.9, 16.0)),),
            (((21.6, 0.0), (24.0, 0.0), (24.0, 3.2), (21.6, 3.2)),),
        ),
        areas=tuple(
            m.MapArea(area_id=f"a{k}", name=n, ring=r) for k, (n, r) in enumerate(zip(names[:4], rings, strict=True))
        ),
        cameras=tuple(
            m.MapCamera(label=f"C{k + 1}", at=p)
            for k, p in enumerate([(10.8, 7.6), (21.5, 9.4), (0.7, 10.9), (13.6, 15.0)])
        ),
        spots=(
            m.MapSpot(number=1, name=names[0], at=(17.4, 5.3), peak=8.1),
            m.MapSpot(number=2, name=names[1], at=(4.1, 5.4), peak=3.1),
            m.MapSpot(number=3, name=names[2], at=(6.1, 9.7), peak=2.8),
        ),
        scale_bar_m=5.0,
    )


AREA_NAMES = ("Checkout queue", "Main entrance", "End of aisle 2", "Pharmacy counter", "Rest of the floor")
CAMERA_NAMES = ("Entrance", "Checkouts", "Aisles", "Pharmacy")


def areas(names: tuple[str, ...] = AREA_NAMES) -> tuple[m.AreaRow, ...]:
    rows = [
        (3586, estimate(43.6, 0.08, 0.09), 0.36, 0.96, ("cam-2",)),
        (2256, estimate(27.4, -0.43, 0.06), 0.23, 0.96, ("cam-1",)),
        (
            1259,
            estimate(
                17.4, None, verdict="too_little_data", reason=read_reason("85% of hours comparable"), previous=17.1
            ),
            0.14,
            0.84,
            ("cam-3",),
        ),
        (939, estimate(11.4, 0.004, 0.115), 0.09, 0.96, ("cam-4",)),
        (1707, estimate(21.4, -0.07, 0.11), 0.18, 0.93, ("cam-1", "cam-3")),
    ]
    return tuple(
        m.AreaRow(
            area_id=None if k == 4 else f"a{k}",
            name=names[k],
            counted=n,
            violation_rate=e,
            encounter_rate=estimate((e.value or 0) / 31.0),
            exposure_h=(e.value or 0) * 2.4,
            share=s,
            difference=None if e.change is None or e.previous is None else e.previous * e.change,
            recorded_share=r,
            cameras=c,
        )
        for k, (n, e, s, r, c) in enumerate(rows)
    )


def normal(names: tuple[str, ...] = AREA_NAMES, camera_names: tuple[str, ...] = CAMERA_NAMES) -> page_model.WeekReport:
    """Four cameras, five areas, an outage, a low-data hour, a logged change with a clear fall."""
    hours = cells()
    violation_rate, encounter_rate, people = (
        estimate(121.3, -0.14),
        estimate(0.415, -0.12, 0.05),
        estimate(292.0, -0.02, 0.03),
    )
    close = estimate(0.23, -0.04, 0.05)
    return page_model.WeekReport(
        site=m.SiteRef(
            site_id="shop", name="Riverside Store", floor_id="ground", floor_name="Ground floor", floors=("ground",)
        ),
        week=WEEK,
        previous=BEFORE,
        generated_at=datetime(2026, 11, 16, 6, 0, tzinfo=ROME),
        provenance=m.Provenance(
            version="1.0.0",
            engines=("demo 1.2",),
            settings_id="9f3ac201",
            settings_non_default=(("retention_days", "14"),),
            inputs_digest="b2c41d7a",
            is_made_up=True,
        ),
        rules=m.Rules(distance_m=2.0, retention_days=14),
        state="normal",
        coverage=coverage(hours, names=camera_names),
        level=m.Level(
            violation_rate=violation_rate,
            encounter_rate=encounter_rate,
            close_time_share=close,
            people=people,
            exposure_h=23486.0,
            violations=9747,
        ),
        busiest_spot=m.BusiestSpot(area_id="a0", name=names[0], share=0.36, floor_share=0.06),
        busiest_hour=m.BusiestHour(start=datetime(2026, 11, 14, 17, tzinfo=ROME), violations=242, ratio_to_mean=2.01),
        areas=areas(names),
        when=when(hours),
        maps=(floor_map(names),),
        log=(
            m.LogLine(at=datetime(2026, 11, 10, 20, tzinfo=ROME), text="Planned network work until Wed 09:00."),
            m.LogLine(
                at=datetime(2026, 11, 11, 12, tzinfo=ROME),
                text="Seasonal display moved from inside the main door to 5 m east of it.",
                area_id="a1",
                area_name=names[1],
                moved_after=0.92,
                floor_share=1.04,
                rest_verdict="cannot_tell",
            ),
            m.LogLine(at=datetime(2026, 11, 12, 13, tzinfo=ROME), text="Camera 3 stopped sending.", kind="detected"),
        ),
        figures={
            "M0": m.Figure(
                value=121.3,
                lo=116.4,
                hi=126.2,
                unit=UNIT,
                denominator=319.0,
                verdict="clear_fall",
            ),
            "M12": m.Figure(unit=UNIT, state="not_measurable", reason=read_reason("track ids do not live 24 hours")),
        },
    )


def hostile() -> page_model.WeekReport:
    """Hostile names wherever a name can stand."""
    bad = [f"{h} {k}" for k, h in enumerate((*HOSTILE, HOSTILE[0]))]
    report = normal(tuple(bad), tuple(bad[:4]))
    return replace(
        report,
        site=replace(report.site, name=HOSTILE[2], floor_name=HOSTILE[1]),
        provenance=replace(report.provenance, engines=HOSTILE, settings_non_default=((HOSTILE[0], HOSTILE[1]),)),
        log=tuple(replace(line, text=HOSTILE[k], area_name=HOSTILE[1]) for k, line in enumerate(report.log)),
        maps=tuple(replace(x, title=HOSTILE[0]) for x in report.maps),
    )


def no_data() -> page_model.WeekReport:
    report = normal()
    hours = tuple(
        m.HourCell(
            day=c.day, hour=c.hour, start=c.start, state="closed" if c.state == "closed" else "no_data", share=0.0
        )
        for c in report.when.cells
    )
    cameras = tuple(
        replace(
            c,
            recorded_h=0.0,
            share=0.0,
            last_record=datetime(2026, 11, 8, 17, 59, k, tzinfo=ROME),
            days=tuple(
                replace(
                    d, recorded_h=0.0, share=0.0, hourly_share=tuple(None if s is None else 0.0 for s in d.hourly_share)
                )
                for d in c.days
            ),
        )
        for k, c in enumerate(report.coverage.cameras)
    )
    nothing = m.Estimate(value=None, state="not_enough_data", reason=read_reason("no data"))
    whole = m.Outage(
        camera_ids=tuple(c.camera_id for c in cameras),
        start=datetime(2026, 11, 9, 8, tzinfo=ROME),
        end=datetime(2026, 11, 15, 18, tzinfo=ROME),
        open_h=86.0,
    )
    return replace(
        report,
        state="no_data",
        coverage=replace(report.coverage, share=0.0, recorded_h=0.0, seen_h=None, cameras=cameras, outages=(whole,)),
        level=m.Level(violation_rate=nothing, encounter_rate=nothing, people=nothing),
        busiest_spot=None,
        busiest_hour=None,
        areas=(),
        when=m.Timetable(cells=hours),
        maps=(),
        log=(),
    )


def too_incomplete() -> page_model.WeekReport:
    report = normal()
    rough = m.Estimate(
        value=118.2, state="not_enough_data", reason=read_reason("rough: 38% of open hours were recorded")
    )
    return replace(
        report,
        state="too_incomplete",
        coverage=replace(report.coverage, share=0.381, recorded_h=131.0),
        level=m.Level(violation_rate=rough, encounter_rate=estimate(None), people=estimate(None)),
        busiest_spot=None,
        busiest_hour=None,
    )


def not_over() -> page_model.WeekReport:
    report = too_incomplete()
    rough = m.Estimate(
        value=118.2,
        state="not_enough_data",
        reason=read_reason("an interval needs at least 5 recorded days, has 4"),
    )
    return replace(
        report,
        coverage=replace(report.coverage, share=0.98, not_over_from=datetime(2026, 11, 12, 12, tzinfo=ROME)),
        level=replace(report.level, violation_rate=rough),
    )


def first_week() -> page_model.WeekReport:
    report = normal()

    def alone(e: m.Estimate) -> m.Estimate:
        return m.Estimate(value=e.value, lo=e.lo, hi=e.hi)

    level = replace(
        report.level,
        violation_rate=alone(report.level.violation_rate),
        encounter_rate=alone(report.level.encounter_rate),
        close_time_share=alone(report.level.close_time_share or estimate(None)),
        people=alone(report.level.people),
    )
    rows = tuple(replace(a, violation_rate=alone(a.violation_rate)) for a in report.areas)
    return replace(report, state="first_week", previous=None, level=level, areas=rows, log=())


def empty() -> page_model.WeekReport:
    report = normal()
    hours = tuple(
        replace(c, state="full", violations=0, is_masked=False, scaled=None, share=1.0, cameras_down=0)
        if c.state != "closed"
        else c
        for c in report.when.cells
    )
    zero = m.Estimate(value=0.0, lo=0.0, hi=3 / 86, previous=0.0)
    return replace(
        report,
        state="empty",
        coverage=coverage(hours, names=CAMERA_NAMES, outages=False),
        level=m.Level(
            violation_rate=zero,
            encounter_rate=m.Estimate(value=0.0, lo=0.0, hi=3 / 9120),
            people=estimate(106.0),
            exposure_h=9120.0,
            violations=0,
        ),
        busiest_spot=None,
        busiest_hour=None,
        areas=(),
        when=when(hours),
        maps=tuple(replace(x, bands=(), spots=()) for x in report.maps),
        log=(),
    )


def settings_changed() -> page_model.WeekReport:
    report = first_week()
    return replace(
        report,
        state="settings_changed",
        previous=BEFORE,
        settings_change=m.SettingsChange(
            name="distance_m",
            before="1.5 m",
            after="2 m",
            at=datetime(2026, 11, 11, 0, 0, tzinfo=ROME),
            violation_rate_before=estimate(74.2),
            violation_rate_after=estimate(126.1),
            command="vsd report --week 2026-W46 --set distance_m=2.0",
        ),
    )


def exposure_unknown() -> page_model.WeekReport:
    report = normal()
    unknown = m.Estimate(value=None, state="not_measurable", reason=read_reason("the engine sends no positions"))
    level = replace(report.level, encounter_rate=unknown, close_time_share=unknown, people=unknown, exposure_h=None)
    rows = tuple(replace(a, encounter_rate=unknown, exposure_h=None) for a in report.areas)
    return replace(report, level=level, areas=rows)


def six_feet() -> page_model.WeekReport:
    report = normal()
    return replace(report, rules=replace(report.rules, distance_m=1.83))


def always_open_picture() -> page_model.WeekReport:
    """A site that never closes, clocks set back on Sunday, two camera pictures instead of a plan."""
    report = normal()
    monday = date(2026, 10, 19)
    start = datetime(2026, 10, 19, tzinfo=ROME).timestamp()
    hours = []
    for k in range(169):
        at = datetime.fromtimestamp(start + 3600 * k, tz=ROME)
        hours.append(
            m.HourCell(
                day=at.date(), hour=at.hour, fold=at.fold, start=at, state="full", violations=20 + k % 7, share=1.0
            )
        )
    pixel = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNoAAAAggCBd81ytgAAAABJ"
    pixel += "RU5ErkJggg=="
    scene = m.FloorMap(
        kind="picture",
        title="Entrance",
        extent=(0.0, 0.0, 1280.0, 720.0),
        image=m.MapImage(data_uri=pixel, extent=(0.0, 0.0, 1280.0, 720.0)),
        bands=(m.MapBand(lower=0.5, polygons=((((300.0, 300.0), (900.0, 320.0), (800.0, 600.0), (350.0, 560.0)),),)),),
        spots=(m.MapSpot(number=1, name="Checkout queue", at=(600.0, 450.0)),),
    )
    week = m.WeekRef(iso="2026-W43", year=2026, number=43, monday=monday, sunday=date(2026, 10, 25), zone="Europe/Rome")
    quiet = replace(report.coverage, is_inferred=True, outages=())
    return replace(
        report,
        week=week,
        when=m.Timetable(cells=tuple(hours)),
        maps=(scene, replace(scene, title="Checkouts")),
        coverage=quiet,
    )


def masked() -> page_model.WeekReport:
    report = normal()
    row = replace(
        report.areas[3],
        counted=None,
        is_masked=True,
        share=None,
        violation_rate=m.Estimate(value=None),
        encounter_rate=None,
        exposure_h=None,
    )
    return replace(report, areas=(*report.areas[:3], row, report.areas[4]))


ALL = {
    f.__name__: f
    for f in (
        *(normal, hostile, no_data, too_incomplete, not_over, first_week, empty, settings_changed),
        *(exposure_unknown, six_feet, always_open_picture, masked),
    )
}
