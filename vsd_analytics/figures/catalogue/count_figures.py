"""What is counted: how often, risky, many, and between whom (M0, M7 to M9); how long, how close (M10 to M12, M26)."""

from __future__ import annotations

import math

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, limits, row
from vsd_analytics.figures.sensitivity import ThresholdSensitivity
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.results import Figure


@figure("M0")
def violation_rate(inputs: FigureInputs) -> Figure:
    """Return violations per open hour."""
    return inputs.of_estimate(inputs.level.violation_rate, inputs.recorded_h)


@figure("M7")
def encounter_rate(inputs: FigureInputs) -> Figure:
    """Return violations per person-hour."""
    return inputs.of_estimate(inputs.level.encounter_rate, inputs.level.exposure_h)


@figure("M8")
def count(inputs: FigureInputs) -> Figure:
    """Return the violations counted in the hours that enter rates."""
    n = inputs.level.violations
    if n is None:
        return inputs.not_printed()
    data = inputs.data
    n_all = data.warehouse.rows(
        "select count(*) as n from episodes inner join cameras using (camera_id) "
        "where floor_id = $floor and is_open and is_owned and local_date between $first and $last",
        {"floor": data.floor.floor_id, "first": data.monday, "last": data.sunday},
    )[0]["n"]
    least = Reason("row.violations", least_s=data.site.settings.episode_min_s)
    rows: list[Row] = [{"what": least, "n": n}]
    if not inputs.small(n_all):
        rows.append({"what": Reason("row.episodes"), "n": n_all})
    note = Reason("note.recorded", share=inputs.coverage.share)
    return Figure(unit=inputs.unit, value=n, denominator=inputs.recorded_h, rows=tuple(rows), note=note)


@figure("M9")
def between(inputs: FigureInputs) -> Figure:
    """Return the share of violations that are between groups, and both readings as rows."""
    found, data = inputs.found.groups, inputs.data
    if not inputs.is_counted:
        return inputs.not_printed()
    own = next((r for r in found.readings if r.floor_id == data.floor.floor_id), None)
    if found.state != "ok" or own is None:
        here = {c.camera_id: c.lives for c in found.cameras if c.camera_id in data.ids}
        why = next((lives for lives in here.values() if lives.state != "ok"), None)
        state, reason = (found.state, found.reason) if why is None else (why.state, why.reason)
        return inputs.missing(state, reason)
    n, n_between = own.violation_rate.n_events or 0, own.violation_rate_between.n_events or 0
    if inputs.small(n, n_between, n - n_between):
        return inputs.held_back()
    rows: list[Row] = []
    for reading, violation_rate, encounter_rate in (
        ("all", own.violation_rate, own.encounter_rate),
        ("between_groups", own.violation_rate_between, own.encounter_rate_between),
    ):
        rates = {
            **limits("violation_rate", inputs.rate(violation_rate)),
            **limits("encounter_rate", inputs.rate(encounter_rate)),
        }
        rows.append({"reading": Reason(f"row.{reading}"), **rates, "n": violation_rate.n_events})
    if not n:
        return inputs.missing("not_enough_data", Reason("violations.none"))
    known = found.accuracy
    lo, hi = known.time_recall
    note = Reason("note.groups", scenes=known.scenes, lo=lo, hi=hi, weakness=known.weakness)
    share = found.between
    is_whole_site = len(data.site.floors) == 1
    return Figure(
        unit=inputs.unit,
        value=share.value if is_whole_site else n_between / n,
        lo=share.lo if is_whole_site else None,
        hi=share.hi if is_whole_site else None,
        denominator=n,
        rows=tuple(rows),
        reason=share.reason if is_whole_site else Reason("violations.one_floor"),
        note=note,
    )


@figure("M10")
def durations(inputs: FigureInputs) -> Figure:
    """Return how long violations last: median, 90th percentile, share of 30 s and longer."""
    found = inputs.found.episodes.durations
    if not inputs.is_counted:
        return inputs.not_printed()
    if found.median.value is None:
        return inputs.missing(found.state, found.reason)
    rows: list[Row] = [
        {"what": Reason(f"row.{what}"), "unit": "s", "value": q.value, "lo": q.lo, "hi": q.hi}
        for what, q in (("median", found.median), ("p90_lasts", found.p90))
    ]
    share = found.long_share
    is_printed = not inputs.small(share.n, share.of - share.n)
    rows.append(
        {
            "what": Reason("row.longer", least_s=inputs.data.site.settings.sustained_s),
            "unit": "share",
            "value": share.value if is_printed else None,
            "lo": share.lo if is_printed else None,
            "hi": share.hi if is_printed else None,
        }
    )
    note = None
    if found.is_at_least and found.cut_share is not None:
        note = Reason("note.at_least", share=found.cut_share)
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=found.n, reason=found.reason, note=note)


@figure("M11")
def distances(inputs: FigureInputs) -> Figure:
    """Return the shares of person-time in violation by distance to the nearest person."""
    found = inputs.found.episodes.distances
    if found.state != "ok":
        return inputs.missing(found.state, found.reason)
    rows = tuple(row(s, "from_m", "to_m", "share") for s in found.shares)
    return Figure(unit=inputs.unit, rows=rows, denominator=found.person_s / 3600)


@figure("M12")
def contacts(inputs: FigureInputs) -> Figure:
    """Return the pairs of people too close for 15 minutes within 24 hours."""
    found = inputs.found.episodes.contacts
    if found.n is None or found.state != "ok":
        return inputs.missing(found.state, found.reason)
    if inputs.small(found.n):
        return inputs.missing("not_enough_data", Reason("hidden.pairs", least=inputs.below))
    note = Reason("note.contacts")
    return Figure(unit=inputs.unit, value=found.n, denominator=found.n_pairs, note=note)


@figure("M26")
def sensitivity(inputs: FigureInputs) -> Figure:
    """Return the share of person-time too close under each of several distances."""
    found: ThresholdSensitivity = inputs.found.sensitivity
    legal = next((p for p in found.points if math.isclose(p.distance_m, found.distance_m)), None)
    if legal is None or legal.share is None:
        return inputs.missing(found.state, found.reason or NOTHING_OPEN)
    note = None if found.engine is None else found.engine.note
    if found.engine is not None and inputs.small(found.engine.violation_records):
        note = None
    rows = [row(p, "distance_m", "share", "state", "reason") for p in found.points]
    if found.calibration is not None:
        ends = {"calibration_lo": found.calibration.lo, "calibration_hi": found.calibration.hi}
        rows = [{**each, **ends} if each["distance_m"] == legal.distance_m else each for each in rows]
    return Figure(unit=inputs.unit, value=legal.share, rows=tuple(rows), denominator=found.exposure_h, note=note)
