"""When: hours of the week (M13), the highest (M14), unusual ones (M24), next week (M25), the weeks so far (M28)."""

from __future__ import annotations

from typing import Final

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import DAYS, FigureInputs, Row, figure, joined, limits, row
from vsd_analytics.figures.forecast import SeriesForecast
from vsd_analytics.figures.hour_of_week import PROFILE_WEEKS
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.week.estimates import without_figures
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.stats.hour_of_week import PeakHours

_LIMITS: Final = ("risk", "risk_lo", "risk_hi", "burden", "burden_lo", "burden_hi")


@figure("M13")
def profile(inputs: FigureInputs) -> Figure:
    """Return rates and people in view by hour of the week."""
    found = inputs.found.profile
    is_printed = any(h.state == "ok" for h in found.rows)
    if not is_printed:
        return inputs.missing(found.state, found.reason)
    hidden = _hidden_slots(inputs)
    rows = []
    for hour in found.rows:
        same = row(hour, *_LIMITS, "people", "recorded_h", "n_weeks", "state")
        if inputs.small(hour.violations) or (hour.weekday, hour.hour) in hidden:
            same = {**same, **dict.fromkeys(_LIMITS), "state": "masked"}
        rows.append({"weekday": DAYS[hour.weekday], "hour": hour.hour, **same})
    denominator = sum(h.recorded_h for h in found.rows)
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=denominator, reason=found.reason)


def _hidden_slots(inputs: FigureInputs) -> set[tuple[int, int]]:
    """Return the hours of the week that the report of one of the profile's four weeks hides."""
    hours, weeks = inputs.data.hours, range(PROFILE_WEEKS)
    held = (inputs.data.hidden_in(inputs.data.monday - k * WEEK).hours for k in weeks)
    return {(int(hours.weekday[i]), int(hours.hour[i])) for week in held for i in (*week.small, *week.others)}


@figure("M14")
def peaks(inputs: FigureInputs) -> Figure:
    """Return the highest hours of the week, and those that cannot be distinguished from the first."""
    if not inputs.is_ranked:
        return inputs.not_ranked()
    found = inputs.found.profile
    rows: list[Row] = []
    for by, peaks in (("per_open_hour", found.by_burden), ("per_person_hour", found.by_risk)):
        rows += _ranked(inputs, Reason(f"unit.{by}"), peaks)
    if not rows:
        return inputs.missing(found.by_burden.state, found.by_burden.reason)
    by_unit = ("violations_per_open_hour", found.by_burden), ("M7", found.by_risk)
    reasons = joined([(Reason(f"unit.{unit}"), peaks.reason) for unit, peaks in by_unit if peaks.state != "ok"])
    return Figure(unit=inputs.unit, rows=tuple(rows), reason=reasons)


def _ranked(inputs: FigureInputs, by: Reason, peaks: PeakHours) -> list[Row]:
    rows: list[Row] = []
    hidden = _hidden_slots(inputs)
    top = [p for p in peaks.top if not inputs.small(p.n) and (p.weekday, p.hour) not in hidden]
    for rank, hour in enumerate(top, 1):
        at: Row = {"by": by, "rank": rank, "weekday": DAYS[hour.weekday], "hour": hour.hour, "is_tied": False}
        rows.append({**at, **row(hour, "value", "lo", "hi", "n_weeks")})
    if top:
        none = dict.fromkeys(("value", "lo", "hi", "n_weeks"))
        for weekday, of_day in peaks.tied:
            rows.append({"by": by, "rank": None, "weekday": DAYS[weekday], "hour": of_day, "is_tied": True, **none})
    return rows


@figure("M24")
def unusual(inputs: FigureInputs) -> Figure:
    """Return the hours with far more or fewer violations than usual."""
    found = inputs.found.unusual
    if not inputs.is_ranked:
        return inputs.not_ranked()
    if found.state != "ok":
        return inputs.missing(found.state, found.reason)
    hidden = {(c.day, c.hour) for c in inputs.when.cells if c.is_masked or c.is_held_back}
    rows = []
    for hour in found.rows:
        values = row(hour, "day", "hour", "violations", "recorded_h", "usual", "lo", "hi", "ratio", "q", "n_weeks")
        if inputs.small(hour.violations) or (hour.day, hour.hour) in hidden:
            values = {**values, "violations": None, "ratio": None, "q": None}
        rows.append({"weekday": DAYS[hour.weekday], **values})
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=found.n_tested)


@figure("M25")
def outlook(inputs: FigureInputs) -> Figure:
    """Return the forecast of next week by hour."""
    found = inputs.found.outlook
    series = {"people": found.people, "violations": found.violations, "gathering": found.gatherings}
    if not found.has_forecast:
        worst = found.people if found.people.state != "not_measurable" else found.violations
        return inputs.missing(worst.state, worst.reason)
    rows: list[Row] = []
    for name, one in series.items():
        rows += _hours(name, one)
    reasons = joined([(Reason(f"series.{name}"), one.reason) for name, one in series.items() if one.state != "ok"])
    return Figure(unit=inputs.unit, rows=tuple(rows), reason=reasons, note=_score(found.people))


def _hours(name: str, one: SeriesForecast) -> list[Row]:
    return [{"series": name, **row(h, "day", "hour", "open_h", "value", "lo", "hi", "n_weeks")} for h in one.rows]


def _score(one: SeriesForecast) -> Reason | None:
    """Return how good the forecast for the week just over was."""
    score = one.score
    if score is None or score.wape is None or score.hit_rate is None:
        return None
    known = {"error": score.wape, "hit_rate": score.hit_rate, "share": score.share}
    if score.wape_naive is None:
        return Reason("note.score", **known)
    return Reason("note.score_naive", **known, naive=score.wape_naive)


@figure("M28")
def trend(inputs: FigureInputs) -> Figure:
    """Return both rates of each of the last weeks."""
    found = inputs.found.trend
    if not found.weeks or found.state != "ok":
        return inputs.missing(found.state, found.reason)
    rows: list[Row] = []
    zone = inputs.data.site.zone
    for week in found.weeks:
        is_this = week.monday == inputs.data.monday
        violation_rate, close, encounter_rate = (
            inputs.rate(week.violation_rate),
            inputs.rate(week.close),
            inputs.rate(week.encounter_rate),
        )
        if is_this and not inputs.is_counted:
            violation_rate, close, encounter_rate = (
                inputs.level.violation_rate,
                inputs.level.close_time_share or close,
                inputs.level.encounter_rate,
            )
        elif (why := inputs.data.hidden_in(week.monday).why_floor) is not None:
            violation_rate, close, encounter_rate = (
                without_figures(e, why) for e in (violation_rate, close, encounter_rate)
            )
        reason = week.reason if week.state != "ok" else violation_rate.reason if violation_rate.value is None else None
        rows.append(
            {
                "week": week.week,
                **limits("violation_rate", violation_rate),
                **limits("close_time_share", close),
                **limits("encounter_rate", encounter_rate),
                "cameras_missing": ", ".join(found.cameras[i] for i in week.missing),
                "coverage": week.coverage,
                "n_changes": sum(f"{m.at.astimezone(zone):%G-W%V}" == week.week for m in found.marks),
                "state": week.state if violation_rate.value is not None or week.state != "ok" else "not_enough_data",
                "reason": reason,
            }
        )
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=len(rows), reason=found.encounter_rate_reason)
