"""Visits of areas that ask for them: how many an hour (M35), and how long they last (M36)."""

from __future__ import annotations

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, mean_name, row
from vsd_analytics.figures.visits import AreaVisits, visits
from vsd_analytics.figures.week.results import Figure


@figure("M35")
def visits_per_open_hour(inputs: FigureInputs) -> Figure:
    """Return the visits of each area per open hour, by entries that were seen; a small count has no value."""
    found = visits(inputs.data.this)
    rows: list[Row] = []
    for of in found:
        hidden = _why_hidden(inputs, of)
        value, lo, hi = (None, None, None) if hidden else (of.often.value, of.often.lo, of.often.hi)
        seen: Row = {"recorded_share": of.recorded_share, "silent_cameras": ", ".join(of.silent_cameras)}
        why = hidden or of.often.reason
        rows.append({**_place(of), "value": value, "lo": lo, "hi": hi, **seen, "reason": why})
    return inputs.of_rows(rows, inputs.recorded_h, Reason("note.visits"))


@figure("M36")
def dwell_times(inputs: FigureInputs) -> Figure:
    """Return how long visits of each area last: median, 90 % quantile, share of long ones, and the mean by two ways.

    A share hides its complement: it has no value where it means fewer than `mask_below` visits on either side.
    """
    found = visits(inputs.data.this)
    rows: list[Row] = []
    for of in found:
        is_unknown = of.often.value is None or of.dwell.median.value is None
        if (why := _why_hidden(inputs, of)) is not None or is_unknown:
            why = why or (of.often.reason if of.often.value is None else of.dwell.reason)
            rows.append({**_place(of), "what": Reason("row.median"), "value": None, "reason": why})
            continue
        for what, q in (("median", of.dwell.median), ("p90_leave", of.dwell.p90)):
            rows.append({**_place(of), "what": Reason(f"row.{what}"), "value": q.value, "lo": q.lo, "hi": q.hi})
        rows += [_long_share(inputs, of), *_means(of)]
    n_visits = sum(of.dwell.n_visits for of in found if not inputs.small(of.dwell.n_visits))
    return inputs.of_rows(rows, n_visits, Reason("note.visits"))


def _place(of: AreaVisits) -> Row:
    return {"area": of.area.area_id, "place": of.area.name}


def _long_share(inputs: FigureInputs, of: AreaVisits) -> Row:
    long, n = of.dwell.long_share, of.dwell.n_visits
    part = None if long.value is None else round(long.value * n)
    is_hidden = part is not None and inputs.small(part, n - part)
    value = dict.fromkeys(("value", "lo", "hi")) if is_hidden else row(long, "value", "lo", "hi")
    why = _hidden(inputs) if is_hidden else long.reason
    limit: Row = {"longer_than_s": of.long_visit_s, "unit": "share"}
    return {**_place(of), "what": Reason("row.long_visits"), **limit, **value, "reason": why}


def _means(of: AreaVisits) -> list[Row]:
    little = of.dwell.little
    rows: list[Row] = []
    for key, mean in (("mean_tracks", little.by_tracks), ("mean_little", little.by_little)):
        what: Row = {**_place(of), "what": mean_name(key, agrees=little.agrees)}
        value: Row = {"value": mean.value, "lo": mean.lo, "hi": mean.hi}
        rows.append({**what, **value, "agrees": little.agrees, "reason": mean.reason})
    return rows


def _why_hidden(inputs: FigureInputs, of: AreaVisits) -> Reason | None:
    return _hidden(inputs) if inputs.small(of.dwell.n_visits) else None


def _hidden(inputs: FigureInputs) -> Reason:
    return Reason("hidden.visits", least=inputs.below)
