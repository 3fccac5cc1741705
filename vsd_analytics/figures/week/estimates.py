"""The two headline numbers, and people, of a place: level, interval, change, verdict (M0, M7, M3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vsd_analytics.answer import Reason, Verdict
from vsd_analytics.figures import close_time, rates
from vsd_analytics.figures.panels import Place
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.site.model import Area, Floor
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate

_ChangeOf = Callable[..., ChangeEstimate]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Both headline numbers of a place and the counts behind them, which decide what may be printed.

    Attributes:
        violation_rate: How often, M0.
        encounter_rate: How risky, M7.
        n: Violations in the hours that enter rates.
        n_before: Violations of the week before in the hours compared; 0 when nothing is compared.
    """

    violation_rate: Estimate
    encounter_rate: Estimate
    n: int
    n_before: int


def measure(
    data: WeekData, place: Place, *, is_compared: bool, since: int | None = None, until: int | None = None
) -> Measured:
    """Return the two headline numbers of a place.

    Args:
        data: The week.
        place: The whole floor, an area, or the rest.
        is_compared: Compare with the week before.
        since: Only hours that start at this instant or later (UTC milliseconds, in this week).
        until: Only hours that start before it; not for comparisons.
    """
    panel = data.panel(place, data.week_days, since=since, until=until)
    encounter_rate = rates.encounter_rate_level(data.this, place, since=since, until=until)
    return Measured(
        violation_rate=_violation_rate(data, place, is_compared=is_compared, since=since, until=until),
        encounter_rate=_judged(
            data, place, encounter_rate, rates.encounter_rate_change if is_compared else None, since
        ),
        n=int(panel.n.sum()),
        n_before=int(data.compared(place, since=since)[0].n.sum()) if is_compared else 0,
    )


def people(data: WeekData, *, is_compared: bool) -> Estimate:
    """Return the mean number of people in view of the floor: person-hours per recorded open hour, and its change."""
    if (why := data.this.why_no_exposure) is not None:
        return Estimate(value=None, state="not_measurable", reason=why)
    if (why := data.hidden.why_untimed) is not None:
        return Estimate(value=None, state="not_enough_data", reason=why)
    if (value := rates.mean_people(data.this, data.everyone)) is None:
        return Estimate(value=None, state="not_enough_data", reason=Reason("recorded.nothing_open"))
    if not is_compared or data.hidden_before.why_untimed is not None:
        return Estimate(value=value)
    level = RateEstimate(value, None, None, None, 0.0, 0, None, None, "ok", None, False)
    return _estimate(level, rates.change_people(data.pair, data.everyone), _hours(data, data.everyone, None))


def close_time_share(data: WeekData, where: Floor | Area | None, change: ChangeEstimate | None = None) -> Estimate:
    """Return the share of person-time too close (M6) of the floor, an area, or (None) the rest of it.

    Args:
        data: The week.
        where: The place.
        change: Its change; None = nothing is compared.
    """
    place = close_time.close_time(data.this, where)
    level = close_time.close_time_share(data.this, place)
    if change is None or level.state == "not_measurable":
        return _estimate(level)
    return _estimate(level, change, _hours(data, place, None))


def floor_close_time_share(data: WeekData, *, is_compared: bool) -> Estimate:
    """Return the share of person-time too close (M6) of the floor, compared with the week before where asked."""
    change = None
    if is_compared:
        change = close_time.change_close_time_share(data.pair, close_time.close_time(data.this, data.floor))
    return close_time_share(data, data.floor, change)


def without_figures(estimate: Estimate, reason: Reason) -> Estimate:
    """Return an estimate that has only a reason."""
    if estimate.state == "not_measurable":
        return estimate
    verdict: Verdict | None = None if estimate.verdict is None else "too_little_data"
    return Estimate(value=None, state="not_enough_data", reason=reason, verdict=verdict)


def without_change(estimate: Estimate, reason: Reason) -> Estimate:
    """Return an estimate that keeps its level and its verdict, but not the week before."""
    if estimate.verdict is None:
        return estimate
    return replace(estimate, previous=None, change=None, change_lo=None, change_hi=None, reason=reason)


def _violation_rate(
    data: WeekData, place: Place, *, is_compared: bool, since: int | None, until: int | None
) -> Estimate:
    level = rates.violation_rate_level(data.this, place, since=since, until=until)
    is_recorded = data.hours.recorded_s[place.cameras][:, data.week()].any()
    if level.value is None and level.state != "not_measurable" and is_recorded:
        why = Reason("level.hour_share", share=data.site.settings.partial_hour_share)
        return Estimate(value=None, state="not_enough_data", reason=why)
    return _judged(data, place, level, rates.violation_rate_change if is_compared else None, since)


def _judged(
    data: WeekData, place: Place, level: RateEstimate, change_of: _ChangeOf | None, since: int | None
) -> Estimate:
    """Return a rate with its change; None = it is not compared. No reason names a small count."""
    if level.state == "not_measurable" or change_of is None:
        return _estimate(level)
    change = change_of(data.pair, place, since=since)
    estimate = _estimate(level, change, _hours(data, place, since))
    is_few = data.mask.hides(change.n_a, change.n_b)
    return replace(estimate, reason=Reason("change.few")) if estimate.reason is not None and is_few else estimate


def _hours(data: WeekData, place: Place, since: int | None) -> float:
    """Return the recorded open camera-hours of this week that are compared."""
    return float(data.compared(place, since=since)[1].x_h.sum())


def _estimate(level: RateEstimate, change: ChangeEstimate | None = None, hours_compared: float = 0.0) -> Estimate:
    reason = level.reason if level.lo is None else None
    if reason is None and change is not None and change.state != "ok":
        reason = change.reason
    state = level.state if level.value is None else "ok"
    plain = Estimate(value=level.value, lo=level.lo, hi=level.hi, state=state, reason=reason)
    if change is None:
        return plain
    if level.value is None:  # without a level there is no change either
        return replace(plain, verdict="too_little_data")
    return with_change(replace(plain, hours_compared=hours_compared), change)


def with_change(estimate: Estimate, change: ChangeEstimate) -> Estimate:
    """Return an estimate with a change: the value before, its relative change with an interval, and the verdict."""
    names = ("change", "change_lo", "change_hi", "verdict")
    return replace(estimate, previous=change.rate_a, **{name: getattr(change, name) for name in names})
