"""Synthetic sections beyond the week and its map: weeks with a gap, spots, readings, redesigns, causes, outlook."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Any

from report import model_classes as m
from report import sample_weeks as weeks

from vsd_analytics.report.draw.spot_pictures import floor_picture
from vsd_analytics.report.model import week as page_model
from vsd_analytics.stats.usual import usual_range
from vsd_analytics.wording.reasons import read_reason

UNIT = read_reason("its unit")

ROME = weeks.ROME
LEVELS = (139.0, 135.0, 143.0, None, 138.0, 151.0, 146.0, 143.0, 141.0)


def trend(report: page_model.WeekReport, *, n: int = 10) -> m.Trend:
    """Ten weeks of which one is a gap; the last is the report's own."""
    made = []
    for k, level in enumerate(LEVELS):
        monday = weeks.MONDAY - timedelta(weeks=9 - k)
        made.append(
            m.TrendWeek(
                iso=f"2026-W{37 + k}",
                number=37 + k,
                monday=monday,
                violation_rate=None if level is None else weeks.estimate(level),
                close=None if level is None else weeks.estimate(level / 584.0),
                encounter_rate=None if level is None else weeks.estimate(level / 292.0),
                coverage=0.41 if level is None else 0.98,
                reason=read_reason("41% of open hours were recorded, and a week needs 60%") if level is None else None,
            )
        )
    own = m.TrendWeek(
        iso="2026-W46",
        number=46,
        monday=weeks.MONDAY,
        violation_rate=report.level.violation_rate,
        close=report.level.close_time_share,
        encounter_rate=report.level.encounter_rate,
        coverage=report.coverage.share,
    )
    marks = (
        m.TrendMark(label="A", at=datetime(2026, 10, 7, 9, tzinfo=ROME), text="Fourth till opened"),
        m.TrendMark(
            label="B",
            at=datetime(2026, 11, 11, 12, tzinfo=ROME),
            text="Seasonal display moved from inside the main door to 5 m east of it.",
            area_name="Main entrance",
        ),
    )
    kept = (*made, own)[-n:]
    is_short = n < 3
    return m.Trend(
        weeks=kept,
        usual_violation_rate=_usual([w.violation_rate for w in kept]),
        usual_close=_usual([w.close for w in kept]),
        marks=() if is_short else marks,
        state="not_enough_data" if is_short else "ok",
        reason=read_reason(f"a trend needs 3 recorded weeks, has {n}") if is_short else None,
    )


def _usual(weeks: Sequence[m.Estimate | None]) -> m.Usual | None:
    *before, now = [e.value if e is not None else None for e in weeks]
    found = usual_range([v for v in before if v is not None])
    if found is None or now is None:
        return None
    return m.Usual(lo=found.lo, hi=found.hi, n_weeks=found.n_weeks, position=found.position(now))


def evidence(**more: Any) -> m.Evidence:
    said: dict[str, Any] = {
        "sureness": "high",
        "recorded_share": 0.96,
        "days_present": 7,
        "error_m": 0.31,
        "camera_id": "cam-2",
        "camera_name": "Checkouts",
    }
    return m.Evidence(**(said | more))


def busiest(report: page_model.WeekReport) -> m.Spots:
    """The three busiest areas: one sure, one changed, one whose camera was down."""
    areas = report.areas
    late = m.UsualHours(weekday=5, first_hour=11, last_hour=17, share=0.56)
    noon = m.UsualHours(first_hour=10, last_hour=12, share=0.51)
    down = evidence(
        sureness="low", recorded_share=0.84, days_present=4, camera_name="Aisles", lost_h=10.0, is_camera_down=True
    )
    some = evidence(sureness="medium", days_present=1, error_m=None)
    return m.Spots(
        kind="busiest",
        reason=read_reason("fewer than 300 violations were counted in the 28 days"),
        cards=(
            m.SpotCard(
                number=1,
                name=areas[0].name,
                at=(17.4, 5.3),
                area_id="a0",
                violation_rate=areas[0].violation_rate,
                usual=late,
                evidence=evidence(),
                ask="Could the queue end at the other wall?",
                question="Could the queue end at the other wall, above all on Saturday from 11:00 to 18:00?",
            ),
            m.SpotCard(
                number=2,
                name=areas[1].name,
                at=(4.1, 5.4),
                area_id="a1",
                violation_rate=areas[1].violation_rate,
                usual=noon,
                evidence=some,
                ask="Could Main entrance be kept free of things that make people stop?",
            ),
            m.SpotCard(
                number=3,
                name=areas[2].name,
                at=(6.1, 9.7),
                area_id="a2",
                violation_rate=areas[2].violation_rate,
                evidence=down,
                ask="Nothing yet. Fix Camera “Aisles” first, and look again next week.",
            ),
        ),
    )


def tested(report: page_model.WeekReport) -> m.Spots:
    """Two tested hotspots, one new and outside every area."""
    return m.Spots(
        kind="tested",
        first=date(2026, 10, 19),
        last=date(2026, 11, 15),
        cards=(
            m.SpotCard(
                number=1,
                name=report.areas[0].name,
                at=(17.4, 5.3),
                area_id="a0",
                violation_rate=report.areas[0].violation_rate,
                ratio=m.Estimate(value=2.67, lo=2.41, hi=2.93),
                excess_min_per_week=1204.0,
                is_new=False,
                since=date(2026, 10, 25),
                is_since_first=True,
                usual=m.UsualHours(first_hour=8, last_hour=20, share=1.0),
                evidence=evidence(),
                ask="Could the queue end at the other wall?",
            ),
            m.SpotCard(
                number=2,
                name="Near Main entrance",
                at=(4.1, 5.4),
                ratio=m.Estimate(value=3.9, lo=3.3, hi=4.6),
                excess_min_per_week=927.0,
                is_new=True,
                since=date(2026, 11, 15),
                evidence=evidence(sureness="medium", error_m=None),
                ask="Could “Display” be moved away from Main entrance?",
            ),
        ),
    )


def readings(report: page_model.WeekReport) -> m.Readings:
    between = m.Reading(violation_rate=weeks.estimate(98.2), encounter_rate=weeks.estimate(0.336))
    return m.Readings(
        all=m.Reading(violation_rate=report.level.violation_rate, encounter_rate=report.level.encounter_rate),
        between=between,
        between_share=0.81,
        between_lo=0.78,
        between_hi=0.84,
        areas=(
            m.AreaReading(area_id="a0", violation_rate=weeks.estimate(37.6)),
            m.AreaReading(area_id=None, violation_rate=weeks.estimate(16.2)),
        ),
        precision_lo=0.84,
        recall_lo=0.79,
    )


def redesigns() -> tuple[m.Redesign, ...]:
    said: dict[str, Any] = {"at": datetime(2026, 10, 7, 9, tzinfo=ROME), "text": "Fourth till opened"}
    effect = m.Estimate(value=None, change=-0.31, change_lo=-0.42, change_hi=-0.18, verdict="clear_fall")
    people = m.Estimate(value=None, change=0.04, change_lo=-0.02, change_hi=0.1, verdict="about_same")
    return (
        m.Redesign(
            number=1,
            **said,
            area_name="Checkout queue",
            design="beside",
            is_credible=False,
            n_weeks=4,
            before=(date(2026, 9, 7), date(2026, 10, 4)),
            after=(date(2026, 10, 12), date(2026, 11, 8)),
            effect=effect,
            violation_rate=m.Estimate(value=None, change=-0.27, change_lo=-0.39, change_hi=-0.12, verdict="clear_fall"),
            close=m.Estimate(value=None, change=-0.31, change_lo=-0.42, change_hi=-0.18, verdict="clear_fall"),
            people=people,
            compared_with=("End of aisle 2", "Pharmacy counter"),
            doubts=(read_reason("another entry of the log lies in the weeks after"),),
            assumptions=(
                read_reason("without the change, the areas would have moved alike"),
                read_reason("nobody was moved there by it"),
            ),
        ),
        m.Redesign(
            number=2,
            at=datetime(2026, 11, 11, 12, tzinfo=ROME),
            text="Seasonal display moved",
            area_name="Main entrance",
            design="beside",
            is_credible=False,
            state="not_enough_data",
            reason=read_reason("needs a whole week after the change, and 1 day is stored"),
        ),
    )


CAUSES = m.Causes(close=-0.18, people=-0.04, layout=-0.17, behaviour=0.03, behaviour_lo=-0.04, behaviour_hi=0.11)


def outlook() -> m.Outlook:
    monday = date(2026, 11, 16)
    saturday, sunday = monday + timedelta(days=5), monday + timedelta(days=6)
    hours = (
        (saturday, 17, 214.0, 171.0, 262.0),
        (sunday, 12, 198.4, 152.0, 249.0),
        (saturday, 12, 190.2, 149.0, 236.0),
    )
    return m.Outlook(
        iso="2026-W47",
        number=47,
        monday=monday,
        mean=123.4,
        highest=tuple(m.OutlookHour(day=d, hour=h, value=v, lo=lo, hi=hi) for d, h, v, lo, hi in hours),
        range_share=0.8,
        n_weeks=9,
        score=m.OutlookScore(error=0.21, error_naive=0.29, hit_rate=0.78, n_hours=81),
    )


def unusual() -> m.UnusualHours:
    return m.UnusualHours(
        rows=(
            m.UnusualHour(day=date(2026, 11, 14), hour=17, violations=242, usual=151.0, lo=118.0, hi=189.0),
            m.UnusualHour(day=date(2026, 11, 9), hour=8, violations=None, usual=48.5, lo=31.0, hi=68.0),
        ),
        n_unusual=2,
        n_tested=81,
    )


def complete() -> page_model.WeekReport:
    """A normal week with every section filled."""
    report = weeks.normal()
    return replace(
        report,
        spots=busiest(report),
        readings=readings(report),
        redesigns=redesigns(),
        causes=CAUSES,
        trend=trend(report),
        outlook=outlook(),
        unusual=unusual(),
        figures={
            **report.figures,
            "M10": m.Figure(
                unit=UNIT,
                rows=(
                    {"what": "median", "unit": "s", "value": 12.0, "lo": 9.9, "hi": 14.5},
                    {"what": "30 s or longer", "unit": "share", "value": 0.33, "lo": 0.29, "hi": 0.36},
                ),
            ),
            "M11": m.Figure(unit=UNIT, rows=({"from_m": 0.0, "to_m": 0.5, "share": 0.044},)),
            "M21": m.Figure(
                unit=UNIT,
                rows=({"least": 2, "most": 2, "share": 0.45}, {"least": 8, "most": None, "share": 0.047}),
            ),
            "M26": m.Figure(
                unit=UNIT,
                rows=(
                    {"distance_m": 1.8, "share": 0.46, "state": "ok"},
                    {"distance_m": 2.0, "share": 0.43, "state": "ok", "calibration_lo": 0.38, "calibration_hi": 0.47},
                ),
            ),
            "M22": m.Figure(
                unit=UNIT,
                state="not_measurable",
                reason=read_reason("the engine sends no track ids"),
            ),
        },
    )


def with_tested_spots() -> page_model.WeekReport:
    """The same with tested hotspots, fewer people, and one camera that takes no part in the second reading."""
    report = complete()
    shown = tested(report)
    maps = tuple(
        replace(x, spots=tuple(m.MapSpot(number=c.number, name=c.name, at=c.at) for c in shown.cards if c.at))
        for x in report.maps
    )
    assert report.readings is not None
    apart = replace(
        report.readings,
        all=m.Reading(violation_rate=weeks.estimate(101.0), encounter_rate=weeks.estimate(0.4)),
        left_out=("Aisles",),
        between_share=None,
        between_lo=None,
        between_hi=None,
    )
    return replace(report, spots=shown, maps=maps, readings=apart)


def twelve_weeks(*, n_more_areas: int = 0) -> page_model.WeekReport:
    """As long a report as there is: three spots with pictures, maps of the change, five marks, two redesigns.

    Args:
        n_more_areas: Areas beyond those of the other weeks.
    """
    report = with_tested_spots()
    assert report.spots is not None
    assert report.trend is not None
    first, second = report.spots.cards
    third = replace(first, number=3, name="End of aisle 2", at=(3.0, 10.0), is_new=True)
    spots = replace(report.spots, cards=(first, second, third))
    floor = replace(
        report.maps[0],
        spots=tuple(m.MapSpot(number=c.number, name=c.name, at=c.at) for c in spots.cards if c.at),
    )
    told, _ = redesigns()
    marks = tuple(
        m.TrendMark(
            label="ABCDE"[k],
            at=datetime(2026, 9, 15 + 2 * k, 9, tzinfo=ROME),
            text="Floor stickers and a rope for the queue",
            area_name="Checkout queue",
        )
        for k in range(5)
    )
    more = tuple(
        replace(report.areas[1], area_id=f"more{k}", name=f"Lift lobby of the car park {k}")
        for k in range(n_more_areas)
    )
    change = m.ChangeMaps(
        before=floor.bands,
        now=floor.bands,
        fewer=floor.bands[-1:],
        more=(),
        steps=(floor.bands[-1].lower, 2 * floor.bands[-1].lower),
        hours_compared=326.0,
        places=(m.ChangedPlace(area_id="a0", name="Checkout queue", fewer=12.0, more=0.0),),
    )
    return replace(
        report,
        areas=(*report.areas[:-1], *more, report.areas[-1]),
        maps=(floor,),
        spots=spots,
        spot_pictures=tuple(floor_picture(floor, number=s.number, at=s.at) for s in floor.spots),
        change_maps=change,
        redesigns=(told, replace(told, number=2, text="New floor stickers at the end of aisle 2")),
        trend=replace(report.trend, marks=marks),
    )


def refused() -> page_model.WeekReport:
    """A second week: hardly anything of the sections can be shown, and each says why."""
    report = complete()
    none = m.Readings(state="not_measurable", reason=read_reason("track ids are cut: 38% end where another begins"))
    return replace(
        report,
        spots=None,
        readings=none,
        redesigns=redesigns()[1:],
        causes=m.Causes(state="not_enough_data", reason=read_reason("needs at least 20 person-hours, has 4.2")),
        trend=trend(report, n=2),
        outlook=m.Outlook(
            iso="2026-W47",
            number=47,
            monday=date(2026, 11, 16),
            state="not_enough_data",
            reason=read_reason("a forecast needs 4 recorded weeks, has 2"),
        ),
        unusual=m.UnusualHours(
            state="not_enough_data", reason=read_reason("a usual value needs 4 earlier recorded weeks, has 1")
        ),
    )


def cameras_changed() -> page_model.WeekReport:
    """Other cameras than the week before: none recorded both."""
    report = weeks.settings_changed()
    change = m.SettingsChange(name="cameras", before="Door, Hall", after="Entrance, Checkouts, Aisles, Pharmacy")
    return replace(report, settings_change=change)


def recalibrated() -> page_model.WeekReport:
    """All cameras were calibrated anew within the week, too late to give two figures."""
    report = weeks.settings_changed()
    change = m.SettingsChange(
        name="calibration", before="3f1c2a77", after="90be11d4", at=datetime(2026, 11, 11, 9, tzinfo=ROME)
    )
    return replace(report, settings_change=change)


def very_few() -> page_model.WeekReport:
    """A week whose count is too small to print."""
    report = weeks.normal()
    few = m.Estimate(
        value=None,
        state="not_enough_data",
        reason=read_reason("fewer than 5 violations were counted"),
        verdict="too_little_data",
    )
    level = replace(report.level, violation_rate=few, encounter_rate=few, violations=None)
    return replace(report, level=level, areas=(), busiest_spot=None, busiest_hour=None, log=())


def not_measurable() -> page_model.WeekReport:
    """A floor whose engine sends no ids."""
    report = weeks.normal()
    why = m.Estimate(value=None, state="not_measurable", reason=read_reason("the engine sends no track ids"))
    level = replace(report.level, violation_rate=why, encounter_rate=why, violations=None)
    return replace(report, level=level, areas=(), busiest_spot=None, busiest_hour=None, log=(), maps=())


MORE = {
    f.__name__: f
    for f in (
        *(complete, with_tested_spots, twelve_weeks, refused),
        *(cameras_changed, recalibrated, very_few, not_measurable),
    )
}
