"""Figures that use what else happened: conversion (M50), value per person-hour (M51), violations at equal value (M52).

Only series of `vsd context add`. Values and people are of the same hours: those that were recorded in full by all
cameras that count the place, and of which the value is known. Statistics: `vsd_analytics.stats.covariate`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.config.context_series import ContextSeries
from vsd_analytics.figures.catalogue.form import FigureInputs
from vsd_analytics.figures.context_values import Spans, series_of, spans
from vsd_analytics.figures.panels import WEEK, Array, Flags, Panel, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import past_week_days
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.share.times import hidden_times
from vsd_analytics.figures.special_days import open_holidays
from vsd_analytics.figures.values import known, lack, measured, relative
from vsd_analytics.figures.visits import entries_by_hour, people_counted, sends_ids
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.trend_weeks import same_engine_since
from vsd_analytics.site.model import Area
from vsd_analytics.stats.covariate import CovariateEffect, change_at_equal_covariate, covariate_effect, usual_range_at
from vsd_analytics.stats.cut_share import widened
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.rates import HISTORY_WEEKS
from vsd_analytics.stats.usual import UsualRange, usual_range
from vsd_analytics.stats.value_per import value_per

EFFECT_WEEKS: Final = 16
"""Weeks before that tell what a series does to violations: part of the definition of M52 (docs/context.md)."""
MIN_VISITS: Final = 30
"""Visits that a conversion needs, as many as a dwell time."""
STEP_SHARE: Final = 0.1
"""What an effect is given for, of a series whose logarithm counts: 10 % more."""
CONVERSION: Final = (
    Column("series", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("value_unit", "fact"),
    Column("value_per_visit", "rate", "", "M50", tells=("n_visits", "n_visits_left_out")),
    Column("known_share", "share", "share"),
    Column("n_days", "fact", "days"),
    Column("n_visits", "count", "visits", audience="operator"),
    Column("n_visits_left_out", "count", "visits", audience="operator"),
)
"""Columns of `context_conversion`."""
VALUE: Final = (
    Column("series", "key"),
    Column("area_id", "fact"),
    Column("name", "fact"),
    Column("value_unit", "fact"),
    Column("value_per_person_h", "rate", "", "M51", tells=("n_people_left_out",)),
    Column("known_share", "share", "share"),
    Column("n_days", "fact", "days"),
    Column("n_people_left_out", "count", "people", audience="operator"),
)
"""Columns of `context_value`."""
CHANGE: Final = (
    Column("series", "key"),
    Column("area_id", "fact"),
    Column("name", "fact"),
    Column("value_unit", "fact"),
    Column("series_change", "rate", "change"),
    Column("series_difference", "rate"),
    Column("violation_rate_change", "rate", "change", "M0"),
    Column("violation_rate_verdict", "fact", "verdict"),
    Column("equal_value_change", "rate", "change", "M52"),
    Column("equal_value_verdict", "fact", "verdict"),
    Column("step_change", "rate", "change", "M52"),
    Column("series_step", "fact"),
    Column("violation_rate", "rate", "per_open_hour", "M0"),
    Column("usual_lo", "rate", "per_open_hour"),
    Column("usual_hi", "rate", "per_open_hour"),
    Column("equal_value_usual_lo", "rate", "per_open_hour", "M52"),
    Column("equal_value_usual_hi", "rate", "per_open_hour", "M52"),
    Column("n_days", "fact", "days"),
    Column("n_weeks", "fact", "weeks"),
)
"""Columns of `context_change`."""
NOT_ADDED: Final = Reason("context.none")


def conversion_answer(inputs: FigureInputs) -> Answer:
    """Return each summed series per visit of each area with `visits = true` that it concerns (M50).

    Columns: value over visits that were seen to enter, of the hours (or days) of which both are known; the share of
    open time that these are.
    """
    data, rows = inputs.data, []
    asked = [area for area in data.areas if area.has_visits]
    summed = [(s, a) for s, a in series_of(data.site, data.floor, data.areas) if s.adds == "sum"]
    for series, area in summed:
        known_values = _KnownValues(data, series)
        rows += [_conversion(data, known_values, each) for each in asked if area in (None, each)]
    nothing = None if rows else Value.missing(Reason("context.no_sum") if not summed else Reason("visits.not_asked"))
    return inputs.list_answer("context_conversion", CONVERSION, rows, nothing=nothing)


def value_answer(inputs: FigureInputs) -> Answer:
    """Return each summed series per person-hour of the floor, or of the area that it concerns (M51)."""
    data = inputs.data
    summed = [(s, a) for s, a in series_of(data.site, data.floor, data.areas) if s.adds == "sum"]
    rows = [_value(inputs, _KnownValues(data, series), area) for series, area in summed]
    nothing = None if rows else Value.missing(Reason("context.no_sum"))
    return inputs.list_answer("context_value", VALUE, rows, nothing=nothing)


def change_answer(inputs: FigureInputs) -> Answer:
    """Return the week's change of violations per open hour at an equal value of each series (M52).

    Columns: change of the series and of M0 over the days compared; the change at an equal value with its verdict; what
    a step of the series has with it, by days of the weeks before; M0, its usual range, and that at this week's value.
    """
    data = inputs.data
    concerned = list(series_of(data.site, data.floor, data.areas))
    if not concerned:
        return inputs.list_answer("context_change", CHANGE, (), nothing=Value.missing(NOT_ADDED))
    rows = [_change(inputs, series, area) for series, area in concerned]
    return inputs.list_answer("context_change", CHANGE, rows, (None, Reason("context.no_cause")))


class _KnownValues:
    """The values of a series in the hours and days of a week and of the five weeks before it.

    Args:
        data: The week.
        series: The series.

    Attributes:
        series: The series.
        days: The days, whole weeks; those of the week come last.
        by_hour: Its value in each hour of the data, shape (n_hours,); NaN = unknown.
        by_day: Its value in each of the days, shape (n_days,).
    """

    def __init__(self, data: WeekData, series: ContextSeries) -> None:
        self._data, self.series = data, series
        first = data.monday - HISTORY_WEEKS * WEEK
        self.days = [first + timedelta(days=k) for k in range(7 * (HISTORY_WEEKS + 1))]
        of_hours = spans(data.site, first, data.sunday, per="hour")
        values, _, _ = of_hours.values(series)
        starts_ms, hours_ms = of_hours.edges_ms[:-1], data.hours.start_ms
        self.by_hour = np.full(len(hours_ms), np.nan)
        self.by_hour[np.isin(hours_ms, starts_ms)] = values[np.isin(starts_ms, hours_ms)]
        self.by_day = _by_day(data, series, first, data.sunday)

    def used(self, is_full: Flags) -> tuple[Array, Flags]:
        """Return the value of each of the days over the hours that are used, and these hours.

        Hours of a day are used where their own value is known; a day without any is used whole, where its value is.

        Args:
            is_full: Hours that were recorded in full, shape (n_hours,).
        """
        hours = self._data.hours
        sums, used = np.zeros(len(self.days)), np.zeros_like(is_full)
        for k, day in enumerate(self.days):
            of_day = (hours.open_s > 0) & (hours.day == day.toordinal())
            with_value = of_day & np.isfinite(self.by_hour)
            if with_value.any():
                chosen = with_value & is_full
                sums[k] = self.by_hour[chosen].sum()
            elif np.isfinite(self.by_day[k]) and of_day.any() and is_full[of_day].all():
                chosen, sums[k] = of_day, self.by_day[k]
            else:
                continue
            used |= chosen
        return sums, used

    def per(self, sums: Array, by_hour: Array, used: Flags, *, least: float, why: Reason) -> RateEstimate:
        """Return the values of the week over what people made in the same hours, with an interval.

        Args:
            sums: Values of the days, of `used`.
            by_hour: Visits or person-hours, shape (n_hours,).
            used: The hours that are used.
            least: Sum of visits or person-hours that it needs.
            why: Reason where there is less.
        """
        data, chosen = self._data, np.where(used, by_hour, 0.0)
        withheld = data.warehouse.withheld_days.get(data.floor.floor_id, frozenset())
        people = np.array(
            [0.0 if day in withheld else chosen[data.hours.day == day.toordinal()].sum() for day in self.days]
        )
        values, people = sums.reshape(-1, 7), people.reshape(-1, 7)
        return value_per(
            values[-1], people[-1], history=(values[:-1], people[:-1]), least=least, why_few=why,
            **data.site.settings.for_intervals,
        )  # fmt: skip


def _by_day(data: WeekData, series: ContextSeries, first: date, last: date) -> Array:
    of_days: Spans = spans(data.site, first, last, per="day")
    values, _, _ = of_days.values(series)
    return values


def _full_hours(data: WeekData, cameras: Flags) -> Flags:
    """Return the hours that every camera of a place that is there recorded in full, one at least, shape (n_hours,)."""
    hours = data.hours
    least_s = float(data.site.settings.full_hour_share) * hours.scheduled_s[cameras]
    is_there = hours.scheduled_s[cameras] > 0
    is_full = (hours.recorded_s[cameras] >= least_s) & hours.is_counted[cameras]
    return np.asarray((is_full | ~is_there).all(axis=0) & (is_full & is_there).any(axis=0))


def _known_share(data: WeekData, used: Flags) -> Value:
    open_s, week = data.hours.open_s, data.week()
    total = float(open_s[week].sum())
    return known(float(open_s[week & used].sum()) / total if total else None, Reason("site.closed"))


def _conversion(data: WeekData, values: _KnownValues, area: Area) -> Row:
    long = Period(data, values.days[0], data.sunday)
    camera, hour = entries_by_hour(long, area)
    counted, why_none = people_counted(data.this.area(area.area_id), camera, hour, sends_ids(data.this))
    sums, used = values.used(_full_hours(data, counted.cameras))
    visits = (counted.n * data.hours.is_counted).sum(axis=0)
    why = Reason("context.visits", least=MIN_VISITS) if (data.week() & used).any() else Reason("context.hours")
    per_visit = values.per(sums, visits, used, least=MIN_VISITS, why=why) if counted.cameras.any() else None
    n_all, n_used = float(visits[data.week()].sum()), float(visits[data.week() & used].sum())
    return {
        "series": values.series.name,
        "area_id": area.area_id,
        "name": area.name,
        "value_unit": values.series.unit,
        "value_per_visit": Value.missing(why_none, "not_measurable") if per_visit is None else measured(per_visit),
        "known_share": _known_share(data, used),
        "n_days": 0 if per_visit is None else per_visit.n_days,
        "n_visits": Value(n_used),
        "n_visits_left_out": Value(n_all - n_used),
    }


def _value(inputs: FigureInputs, values: _KnownValues, area: Area | None) -> Row:
    data = inputs.data
    place = data.everyone if area is None else data.this.area(area.area_id)
    cameras = np.asarray(place.exposure_h.any(axis=1)) if area is not None else place.cameras
    sums, used = values.used(_full_hours(data, cameras))
    person_h = np.where(data.hours.is_counted, place.exposure_h, 0.0).sum(axis=0)
    least = float(data.site.settings.min_exposure_h)
    is_any = bool((data.week() & used).any())
    why = Reason("context.person_hours", least=least) if is_any else Reason("context.hours")
    rate = values.per(sums, person_h, used, least=least, why=why)
    value = measured(rate)
    left_out = data.week() & ~used & (person_h > 0)
    if (hidden := _why_untimed(inputs, area, left_out)) is not None:
        value = hidden
    few = data.people_by_hour[left_out].max(initial=0) if data.mask.is_on else 0
    return {
        "series": values.series.name,
        "area_id": None if area is None else area.area_id,
        "name": data.floor.name if area is None else area.name,
        "value_unit": values.series.unit,
        "value_per_person_h": value,
        "known_share": _known_share(data, used),
        "n_days": rate.n_days,
        "n_people_left_out": Value(float(few)),
    }


def _why_untimed(inputs: FigureInputs, area: Area | None, left_out: Flags) -> Value | None:
    """Return why no person-time of a place may be given, as a value: who knows sales would know it from the ratio."""
    if (why := inputs.why_no_person_time) is not None:
        return why
    if area is None or not inputs.data.mask.is_on:
        return None
    if (reason := hidden_times(inputs.data.this).get(area.area_id)) is not None:
        return Value.missing(reason)
    return Value.missing(GIVES_AWAY) if left_out.any() else None  # of its few people in these hours nothing is known


@dataclass(frozen=True, slots=True, eq=False)
class _Covariate:
    """A series by day as a covariate.

    Attributes:
        is_log: Its logarithm counts: of values that add up and are all above 0.
        z: By day from `first` on, shape (n_days,); NaN = unknown.
        first: The first day.
    """

    is_log: bool
    z: Array
    first: date

    def of(self, days: Sequence[date]) -> Array:
        """Return z of some days."""
        return self.z[[(day - self.first).days for day in days]]


def _covariate(data: WeekData, series: ContextSeries, is_recorded: Flags, first: date) -> _Covariate:
    values = _by_day(data, series, first, data.sunday)
    seen = values[is_recorded & np.isfinite(values)]
    is_log = series.adds == "sum" and len(seen) > 0 and bool((seen > 0).all())
    if not is_log:
        return _Covariate(False, values, first)
    with np.errstate(divide="ignore", invalid="ignore"):
        return _Covariate(True, np.where(values > 0, np.log(np.where(values > 0, values, 1.0)), np.nan), first)


def _change(inputs: FigureInputs, series: ContextSeries, area: Area | None) -> Row:
    data, pair = inputs.data, inputs.data.pair
    place = data.whole if area is None else data.area(area.area_id)
    first = data.monday - EFFECT_WEEKS * WEEK
    days = [first + timedelta(days=k) for k in range(7 * (EFFECT_WEEKS + 1))]
    panel = data.panel(place, days)
    covariate = _covariate(data, series, np.asarray((panel.x_h > 0).any(axis=0)), first)
    effect = _effect(data, place, panel, covariate, days)
    estimate = inputs.level.violation_rate
    if area is not None:
        estimate = next((a.violation_rate for a in inputs.areas if a.area_id == area.area_id), estimate)
    why = None
    if estimate.verdict is None or estimate.change is None:
        why = lack(estimate.state, estimate.reason or Reason("change.not_compared"))
    plain = equal = series_change = difference = why or Value.missing(Reason("change.not_compared"))
    verdict = plain_verdict = None
    if why is None:
        before, now = pair.compared(place)
        paired = [[days_of[k] for days_of in pair.pairs] for k in (0, 1)]
        history = [
            (week.n, week.x_h, covariate.of(of_week))
            for of_week, week in ((d, data.panel(place, d)) for d in past_week_days(pair) if d[0] >= first)
        ]
        settings = data.site.settings
        change = change_at_equal_covariate(
            (before.n, before.x_h), (now.n, now.x_h), covariate.of(paired[0]), covariate.of(paired[1]), effect,
            history=history, about_same_share=settings.about_same_share, **settings.for_intervals,
        )  # fmt: skip
        if pair.cut_shares is not None:
            change = widened(change, confidence=settings.confidence, about_same_share=settings.about_same_share)
        equal, verdict = relative(change, reason=effect.reason or Reason("change.not_compared")), change.verdict
        plain, plain_verdict = Value(estimate.change, estimate.change_lo, estimate.change_hi), estimate.verdict
        is_used = np.asarray(((before.x_h > 0) & (now.x_h > 0)).any(axis=0))
        series_change, difference = _series_moved(series, covariate, is_used, paired)
    step, per_step = _per_step(effect, covariate, series)
    usual = _usual(inputs, covariate, effect) if area is None else (None, None, Reason("context.floor_only"))
    is_told = why is None or estimate.value is not None
    return {
        "series": series.name,
        "area_id": None if area is None else area.area_id,
        "name": data.floor.name if area is None else area.name,
        "value_unit": series.unit,
        "series_change": series_change,
        "series_difference": difference,
        "violation_rate_change": plain,
        "violation_rate_verdict": plain_verdict,
        "equal_value_change": equal,
        "equal_value_verdict": verdict,
        "step_change": per_step if is_told else Value.missing(estimate.reason, "not_enough_data"),
        "series_step": step,
        "violation_rate": Value.of(estimate),
        **_usual_cells(*usual),
        "n_days": effect.n_days,
        "n_weeks": effect.n_weeks,
    }


def _effect(data: WeekData, place: Place, panel: Panel, covariate: _Covariate, days: Sequence[date]) -> CovariateEffect:
    """Return what a series does to the violations of a place, by days on which all of this week's cameras recorded."""
    able = np.asarray(panel.x_h[:, -7:].any(axis=1)) & place.cameras
    n, x_h = panel.n[able, :-7], panel.x_h[able, :-7]
    is_whole = np.asarray((x_h > 0).all(axis=0)) if able.any() else np.zeros(len(days) - 7, dtype=np.bool_)
    withheld = data.warehouse.withheld_days.get(data.floor.floor_id, frozenset())
    is_whole &= np.array([day not in withheld for day in days[:-7]])
    hours = np.where(is_whole, x_h.mean(axis=0), 0.0) if able.any() else np.zeros(len(days) - 7)
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.where(is_whole, (n / x_h).sum(axis=0), 0.0)
    shape = (EFFECT_WEEKS, 7)
    confidence = float(data.site.settings.confidence)
    return covariate_effect(
        (rate * hours).reshape(shape), hours.reshape(shape), covariate.z[:-7].reshape(shape), confidence=confidence
    )


def _series_moved(
    series: ContextSeries, covariate: _Covariate, is_used: Flags, paired: Sequence[Sequence[date]]
) -> tuple[Value, Value]:
    """Return by what share, and by how much, the mean value of a day changed; degrees have no share."""
    values = [covariate.of(days)[is_used] for days in paired]
    before, now = (float(np.mean(np.exp(z) if covariate.is_log else z)) if len(z) else np.nan for z in values)
    if not np.isfinite(now - before):
        return (unknown := Value.missing(Reason("context.unknown_days"))), unknown
    has_share = series.adds == "sum" and before > 0
    return Value(now / before - 1) if has_share else Value.missing(Reason("context.no_share")), Value(now - before)


def _per_step(effect: CovariateEffect, covariate: _Covariate, series: ContextSeries) -> tuple[str, Value]:
    """Return a step of a series in words, and by what share violations are higher with it."""
    step = float(np.log1p(STEP_SHARE)) if covariate.is_log else effect.z_step
    if effect.value is None or effect.lo is None or effect.hi is None or step is None:
        return "", lack(effect.state, effect.reason)
    value, lo, hi = (float(np.expm1(beta * step)) for beta in (effect.value, effect.lo, effect.hi))
    return f"{STEP_SHARE:+.0%}" if covariate.is_log else f"+{step:.3g} {series.unit}", Value(value, lo, hi)


def _usual(
    inputs: FigureInputs, covariate: _Covariate, effect: CovariateEffect
) -> tuple[UsualRange | None, UsualRange | None, Reason]:
    """Return the usual range of M0, that at this week's value of the series, and why there is none."""
    data, confidence = inputs.data, float(inputs.data.site.settings.confidence)
    if open_holidays(data.site, data.monday):
        return None, None, Reason("context.holiday")
    since = same_engine_since(data, inputs.results.trend.weeks) or date.min
    rates, values = [], []
    for week in inputs.results.trend.weeks[:-1]:
        rate = None if week.violation_rate is None else week.violation_rate.value
        is_hidden = data.hidden_in(week.monday).why_floor is not None
        if rate is None or week.missing or week.monday < since or is_hidden:
            continue
        if (z := _mean_z(data, covariate, week.monday)) is not None:
            rates.append(rate)
            values.append(z)
    z_now = _mean_z(data, covariate, data.monday)
    why = effect.reason or (Reason("context.outside") if z_now is not None else Reason("context.unknown_days"))
    if z_now is None:
        return None, None, why
    plain = usual_range(rates, confidence=confidence)
    at_value = usual_range_at(rates, values, z_now, effect, confidence=confidence)
    return plain, at_value, Reason("context.usual_weeks") if plain is None else why


def _mean_z(data: WeekData, covariate: _Covariate, monday: date) -> float | None:
    """Return the mean z of the recorded days of a week by recorded hours; None where one of them is unknown."""
    days = [monday + timedelta(days=k) for k in range(7)]
    hours = data.panel(data.whole, days).x_h.sum(axis=0)
    z = covariate.of(days)
    if not hours.any() or not np.isfinite(z[hours > 0]).all():
        return None
    return float(hours @ np.nan_to_num(z) / hours.sum())


def _usual_cells(plain: UsualRange | None, at_value: UsualRange | None, why: Reason) -> Row:
    ranges = {"usual": plain, "equal_value_usual": at_value}
    return {
        f"{name}_{end}": known(None if usual is None else getattr(usual, end), why)
        for name, usual in ranges.items()
        for end in ("lo", "hi")
    }
