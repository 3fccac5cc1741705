"""How often, how risky and how many (M0, M7, M8), time too close (M6, M30, M32), people in view (M3, M5)."""

from __future__ import annotations

import math
from typing import Final

from vsd_analytics.answer import Answer, Column, Estimated, Reason, Row, Value
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.neighbours import room_around, three_or_more
from vsd_analytics.figures.person_time import PeakQuarter
from vsd_analytics.figures.share.people import people_in_quarter
from vsd_analytics.figures.values import known, lack, measured

VIOLATIONS: Final = (
    Column("violation_rate", "rate", "per_open_hour", "M0", tells=("n_violations",), per="recorded_h"),
    Column("violation_rate_verdict", "fact"),
    Column("encounter_rate", "rate", "per_person_hour", "M7", tells=("n_violations",), per="exposure_h"),
    Column("encounter_rate_verdict", "fact"),
    Column("n_violations", "count", "violations", "M8", per="recorded_h"),
    Column("n_episodes", "count", "violations", "M8"),
    Column("recorded_h", "fact", "h"),
    Column("exposure_h", "fact", "h"),
)
"""Columns of `violations`."""
CLOSE_TIME: Final = (
    Column("close_time_share", "share", "share", "M6", per="exposure_h"),
    Column("crowded_share", "share", "share", "M32", per="crowded_exposure_h"),
    Column("close_person_min", "rate", "minutes", "M30", per="between_exposure_h"),
    Column("close_min_per_stay", "rate", "minutes", "M30", tells=("n_stays",)),
    Column("n_stays", "count", "tracks", audience="operator"),
    Column("exposure_h", "fact", "h"),
    Column("crowded_exposure_h", "fact", "h"),
    Column("between_exposure_h", "fact", "h"),
)
"""Columns of `close_time`."""
THRESHOLDS: Final = (
    Column("distance_m", "key", "m"),
    Column("close_time_share", "share", "share", "M26", per="exposure_h"),
    Column("is_legal_distance", "fact"),
    Column("calibration_lo", "fact", "share"),
    Column("calibration_hi", "fact", "share"),
    Column("exposure_h", "fact", "h"),
)
"""Columns of `threshold_sensitivity`."""
ROOM: Final = (
    Column("level", "key"),
    Column("density_from", "fact", "per_m2"),
    Column("density_to", "fact", "per_m2"),
    Column("person_time_share", "share", "share", "M33", per="exposure_h"),
    Column("exposure_h", "fact", "h"),
)
"""Columns of `room`."""
PEOPLE: Final = (
    Column("person_h", "rate", "person_h", "M3", per="recorded_h"),
    Column("person_h_verdict", "fact"),
    Column("people", "people", "people", "M5", per="recorded_h"),
    Column("people_verdict", "fact"),
    Column("fullest_people", "people", "people"),
    Column("fullest_start", "instant"),
    Column("fullest_recorded_share", "share", "share"),
    Column("recorded_h", "fact", "h"),
)
"""Columns of `people`."""
_EPISODES: Final = """
select count(*) as n from episodes inner join cameras using (camera_id)
where floor_id = $floor and is_open and is_owned and local_date between $first and $last
"""


@answers("M0", "M7", "M8")
def violations(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return violations per open hour (M0) and per person-hour (M7), and their number (M8).

    `n_violations` are those of the hours that enter rates, `n_episodes` episodes of any length in all recorded open
    hours.
    """
    data, level = inputs.data, inputs.level
    why = inputs.why_no_violations
    days = {"floor": data.floor.floor_id, "first": data.monday, "last": data.sunday}
    cells: Row = {
        "violation_rate": Value.of(level.violation_rate),
        "violation_rate_verdict": level.violation_rate.verdict,
        "encounter_rate": Value.of(level.encounter_rate),
        "encounter_rate_verdict": level.encounter_rate.verdict,
        "n_violations": why or Value(level.violations),
        "n_episodes": why or Value(data.warehouse.rows(_EPISODES, days)[0]["n"]),
        "recorded_h": inputs.recorded_h,
        "exposure_h": level.exposure_h,
    }
    note = Reason("note.recorded", share=inputs.coverage.share)
    return (inputs.floor_answer("violations", VIOLATIONS, cells, note),)


@answers("M30", "M32")
def close_time(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return time too close.

    Columns: the share of person-time too close to anybody (M6), and to three or more others (M32); person-minutes too
    close to people of other groups, in all and per stay, with the interval of their share (M30).
    """
    person_time, why = inputs.results.person_time, inputs.why_no_person_time
    between = person_time.close_between
    share = why or measured(between)
    lives = [c for c in inputs.results.groups.cameras if c.camera_id in inputs.data.ids and c.lives.state == "ok"]
    n_stays = sum(c.lives.n_tracks for c in lives)
    stay_min = 60 * sum(c.exposure_h for c in lives) / n_stays if n_stays else None
    is_few = inputs.why_few_people is not None
    crowded = None if why else three_or_more(inputs.data.this)
    cells: Row = {
        "close_time_share": why or measured(person_time.close),
        "crowded_share": why or measured(crowded),
        "close_person_min": _scaled(share, 60 * between.exposure_h),
        "close_min_per_stay": _scaled(share, stay_min),
        "n_stays": Value(n_stays),
        "exposure_h": None if is_few else person_time.close.exposure_h,
        "crowded_exposure_h": None if crowded is None else crowded.exposure_h,
        "between_exposure_h": None if is_few else between.exposure_h,
    }
    return (inputs.floor_answer("close_time", CLOSE_TIME, cells, Reason("note.stay")),)


def _scaled(share: Value, by: float | None) -> Value:
    if share.value is None or by is None:
        return Value.missing(share.reason, "not_enough_data" if share.state == "ok" else share.state)
    lo, hi = (None if limit is None else limit * by for limit in (share.lo, share.hi))
    return Value(by * share.value, lo, hi, reason=share.reason)


@answers("M26")
def threshold_sensitivity(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the share of person-time too close under each of several distances (M26).

    `calibration_lo` and `calibration_hi`: the share at the legal distance if all distances are off by what the
    calibrations state.
    """
    sensitivity = inputs.results.sensitivity
    if (why := inputs.why_no_time_too_close) is not None:
        return (inputs.list_answer("threshold_sensitivity", THRESHOLDS, (), nothing=why),)
    rows: list[Row] = []
    for point in sensitivity.points:
        is_legal = math.isclose(point.distance_m, sensitivity.distance_m)
        ends = sensitivity.calibration if is_legal else None
        rows.append(
            {
                "distance_m": point.distance_m,
                "close_time_share": known(point.share, point.reason or sensitivity.reason, point.state),
                "is_legal_distance": is_legal,
                "calibration_lo": None if ends is None else ends.lo,
                "calibration_hi": None if ends is None else ends.hi,
                "exposure_h": sensitivity.exposure_h,
            }
        )
    engine = sensitivity.engine
    is_told = engine is not None and not inputs.data.mask.hides(engine.violation_records)
    notes = [(None, engine.note)] if engine is not None and is_told else []
    nothing = None if rows else lack(sensitivity.state, sensitivity.reason)
    return (inputs.list_answer("threshold_sensitivity", THRESHOLDS, rows, *notes, nothing=nothing),)


@answers("M33")
def room(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the shares of person-time at each of Fruin's levels of service (M33)."""
    if (why := inputs.why_no_person_time) is not None:
        return (inputs.list_answer("room", ROOM, (), nothing=why),)
    rows: list[Row] = [
        {
            "level": level.level,
            "density_from": round(level.density_from, 2),
            "density_to": None if level.density_to is None else round(level.density_to, 2),
            "person_time_share": measured(level.share),
            "exposure_h": level.share.exposure_h,
        }
        for level in room_around(inputs.data.this)
    ]
    return (inputs.list_answer("room", ROOM, rows, (None, Reason("note.room"))),)


@answers("M3", "M5")
def people(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return person-hours (M3), the mean number of people in view (M5), and the fullest quarter-hour.

    The interval of person-hours is that of the mean number of people, over the same hours.
    """
    level, person_time = inputs.level.people, inputs.results.person_time
    mean, peak = person_time.people, None if level.value is None else person_time.peak
    why_none = why_no_peak = lack(level.state, level.reason)
    if peak is not None and inputs.data.mask.hides(_n_people(inputs, peak)):
        peak, why_no_peak = None, Value.missing(Reason("hidden.few_people", least=inputs.data.mask.below))
    ratio = person_time.exposure_h / mean.value if person_time.exposure_h is not None and mean.value else None
    person_h = (
        why_none
        if level.value is None or person_time.exposure_h is None
        else _with_limits(person_time.exposure_h, mean, ratio)
    )
    cells: Row = {
        "person_h": person_h,
        "person_h_verdict": level.verdict,
        "people": why_none if level.value is None else _with_limits(level.value, mean, 1.0),
        "people_verdict": level.verdict,
        "fullest_people": why_no_peak if peak is None else Value(peak.people),
        "fullest_start": None if peak is None else peak.start,
        "fullest_recorded_share": why_no_peak if peak is None else Value(peak.recorded_share),
        "recorded_h": inputs.recorded_h,
    }
    return (inputs.floor_answer("people", PEOPLE, cells),)


def _n_people(inputs: FigureInputs, peak: PeakQuarter) -> int:
    return people_in_quarter(inputs.data, round(peak.start.timestamp() * 1000), at_once=peak.people)


def _with_limits(value: float, mean: Estimated, ratio: float | None) -> Value:
    """Return a number that is proportional to a mean, with the limits of that mean."""
    lo, hi = (None if limit is None or ratio is None else limit * ratio for limit in (mean.lo, mean.hi))
    return Value(value, lo, hi, reason=measured(mean).reason if lo is None else None)
