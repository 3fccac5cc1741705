"""Queues and capacities of places that ask for them: people waiting (M39), waiting time (M40), capacity used (M41)."""

from __future__ import annotations

from collections.abc import Iterator

from vsd_analytics.answer import Reason
from vsd_analytics.figures.capacities import CapacityUse
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, mean_name
from vsd_analytics.figures.queues import AreaQueue
from vsd_analytics.figures.suppression import GIVES_AWAY
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.site.model import Area
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.waiting import WaitTimes

_Found = tuple[float | None, float | None, float | None, Reason | None]
"""A value, its interval, and why there is none."""


@figure("M39")
def people_waiting(inputs: FigureInputs) -> Figure:
    """Return the number of people in each queue over recorded open time: mean and 90 % quantile, and mean by hour."""
    found = inputs.found.queues
    rows: list[Row] = []
    for of in found:
        more = _recorded(of)
        hidden = _hidden(inputs, None if of.waiting is None else of.waiting.waits)
        rows.append({**_row(of.area, "mean", None, _of_rate(of.people), hidden), **more})
        rows.append(_row(of.area, "p90_people", None, (of.busy.value, of.busy.lo, of.busy.hi, None), hidden))
        if hidden is None:
            of_hours = [(h.hour, _of_rate(h.people), _hidden(inputs, h.waits)) for h in of.by_hour]
            rows += [_row(of.area, "mean", *of_hour) for of_hour in of_hours]
    return inputs.of_rows(rows, inputs.recorded_h, Reason("note.queues"))


@figure("M40")
def waiting_time(inputs: FigureInputs) -> Figure:
    """Return how long people of each queue wait, and the share who leave before the end; for the days and by hour.

    A share hides its complement, and one hidden hour of several could be worked out from the days: none is given then.
    """
    found = inputs.found.queues
    rows: list[Row] = []
    n_entered = 0
    for of in found:
        if of.waiting is None:
            rows.append(_row(of.area, "median", None, (None, None, None, of.why_no_waits)))
            continue
        whole = of.waiting.waits
        hidden = _hidden(inputs, whole)
        n_entered += 0 if hidden else whole.n_entered
        rows += [*_times(of, None, whole, hidden), _left(inputs, of, None, whole, hidden)]
        rows += _means(of, hidden)
        if hidden or whole.median.value is None:
            continue
        hours = [(h.hour, h.waits, _hidden(inputs, h.waits)) for h in of.by_hour if h.waits is not None]
        for hour, waits, why in hours:
            rows += _times(of, hour, waits, why)
        shares = [_left(inputs, of, hour, waits, why) for hour, waits, why in hours]
        held_back = [row["reason"] for row in shares if row["value"] is None]
        rows += (
            [{**row, "value": None, "lo": None, "hi": None, "reason": GIVES_AWAY} for row in shares]
            if len(held_back) == 1
            else shares
        )
    return inputs.of_rows(rows, n_entered, Reason("note.waits"))


@figure("M41")
def capacity_used(inputs: FigureInputs) -> Figure:
    """Return for how much of the open time each place with a capacity was full, and by how many people too full."""
    rows = [row for of in inputs.found.capacities for row in _use(of)]
    return inputs.of_rows(rows, inputs.recorded_h, Reason("note.queues"))


def _use(of: CapacityUse) -> Iterator[Row]:
    area = of.place.area_id if isinstance(of.place, Area) else None
    place: Row = {"area": area, "place": of.place.name, "capacity": of.capacity}
    for key, rate, unit in (
        ("people", of.people, "people"),
        ("busy", of.busy, "share"),
        ("full", of.full, "share"),
        ("over", of.over, "share"),
        ("surplus", of.surplus, "people"),
    ):
        row: Row = {**place, "key": key, "what": Reason(f"row.{key}"), "unit": unit, **_limits(rate)}
        if rate is of.people:
            row = {**row, **_recorded(of)}
        yield row
    for level in of.room:
        key = f"room_{level.level.lower()}"
        what = Reason("row.room", level=level.level)
        yield {**place, "key": key, "what": what, "unit": "share", **_limits(level.share)}


def _recorded(of: AreaQueue | CapacityUse) -> Row:
    """Return what was recorded of a place, and the cameras and hours of the day that lack it."""
    return {
        "recorded_share": of.recorded_share,
        "silent_cameras": ", ".join(of.silent_cameras),
        "unrecorded_hours": ", ".join(f"{h:02d}:00" for h in of.unrecorded_hours),
    }


def _limits(rate: RateEstimate) -> Row:
    return {"value": rate.value, "lo": rate.lo, "hi": rate.hi, "reason": rate.reason}


def _row(
    area: Area, key: str, hour: int | None, found: _Found, hidden: Reason | None = None, **more: str | bool | None
) -> Row:
    """Return a row of a queue; nothing but the reason where it is hidden."""
    value, lo, hi, reason = found if hidden is None else (None, None, None, hidden)
    if value is None:
        lo = hi = None
    where: Row = {"area": area.area_id, "place": area.name, "key": key, "what": Reason(f"row.{key}"), "hour": hour}
    return {**where, "value": value, "lo": lo, "hi": hi, "reason": reason, **more}


def _of_rate(rate: RateEstimate) -> _Found:
    return rate.value, rate.lo, rate.hi, rate.reason


def _times(of: AreaQueue, hour: int | None, waits: WaitTimes, hidden: Reason | None) -> Iterator[Row]:
    for key, q in (("median", waits.median), ("p90", waits.p90)):
        yield _row(of.area, key, hour, (q.value, q.lo, q.hi, waits.reason), hidden)


def _left(inputs: FigureInputs, of: AreaQueue, hour: int | None, waits: WaitTimes, hidden: Reason | None) -> Row:
    share, n = waits.left_share, waits.n_entered
    part = None if share.value is None else round(share.value * n)
    if hidden is None and part is not None and inputs.small(part, n - part):
        hidden = _few(inputs)
    return _row(of.area, "left", hour, (share.value, share.lo, share.hi, share.reason), hidden, unit="share")


def _means(of: AreaQueue, hidden: Reason | None) -> Iterator[Row]:
    if of.waiting is None or hidden is not None:
        return
    little = of.waiting.stays.little
    for key, mean in (("mean_tracks", little.by_tracks), ("mean_little", little.by_little)):
        found = mean.value, mean.lo, mean.hi, mean.reason
        row = _row(of.area, key, None, found, agrees=little.agrees)
        yield {**row, "what": mean_name(f"stay_{key}", agrees=little.agrees)}


def _hidden(inputs: FigureInputs, waits: WaitTimes | None) -> Reason | None:
    return _few(inputs) if waits is not None and inputs.small(waits.n_entered) else None


def _few(inputs: FigureInputs) -> Reason:
    return Reason("hidden.entries", least=inputs.below)
