"""How much the share of time in violation hangs on the distance (M26), and what the engine's stated error does."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import Final

from vsd_analytics.answer import Reason, State
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.calibration_range import CalibrationRange, calibration_range
from vsd_analytics.figures.floor_days import NO_FLOOR
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.site.model import EngineError
from vsd_analytics.stats.sensitivity import Crossings, ThresholdPoint, crossings, true_records
from vsd_analytics.warehouse.warehouse import Warehouse

WHOLE_FROM: Final = 100
"""Three significant digits of a number this large have none behind the point."""
FACTORS: Final = (0.9, 1.0, 1.1)
"""A calibration that is off by 10 % counts at one of these times the legal distance."""

NOTHING: Final = Reason("recorded.nothing")
NOBODY: Final = Reason("nobody.seen")
PURGED: Final = Reason("purged.distances")
NOT_SENT: Final = Reason("engine.no_far_distances")


@dataclass(frozen=True, slots=True)
class EngineEffect:
    """What the engine's error, as stated in vsd.toml, does to the count of violation records.

    Attributes:
        error: What was stated.
        violation_records: Records counted.
        expected: Expected true records, n precision / recall; None when one of the two is not stated.
        crossings: Records that an error of the distance moves over the threshold; None when no sd is stated.
        note: What a reader must know beside every count.
    """

    error: EngineError
    violation_records: int
    expected: float | None
    crossings: Crossings | None
    note: Reason


@dataclass(frozen=True, slots=True)
class ThresholdSensitivity:
    """The share of time in violation at 0.9, 1.0 and 1.1 times the legal distance (M26).

    Attributes:
        floor_id: Floor; None = the whole site.
        distance_m: The legal distance.
        exposure_h: Person-hours in view, the denominator; None when unknown.
        points: In order of distance.
        left_out: Cameras that recorded without giving both people and distances, throughout the range.
        engine: What the engine's stated error does; None when none is stated or nothing is counted.
        state: "ok" when the point of the legal distance has a value.
        reason: Why not.
        calibration: The share at the legal distance if the calibrations are off by what they state; None where one
            states nothing.
    """

    floor_id: str | None
    distance_m: float
    exposure_h: float | None
    points: tuple[ThresholdPoint, ...]
    left_out: tuple[str, ...]
    engine: EngineEffect | None
    state: State
    reason: Reason | None
    calibration: CalibrationRange | None = None


def threshold_sensitivity(
    warehouse: Warehouse, *, floor_id: str | None = None, first: date | None = None, last: date | None = None
) -> ThresholdSensitivity:
    """Return M26: violation person-hours / person-hours at 0.9, 1.0 and 1.1 times the legal distance.

    Sums over the mart `distances` of the range, all recorded hours, of cameras that give both people and
    distances; each point is the figure for that distance as the legal one.

    Args:
        warehouse: Its days.
        floor_id: Only cameras of this floor; None = all.
        first: First local day; None = the warehouse's.
        last: Last local day; None = the warehouse's.

    Raises:
        UsageError: E101, there is no such floor.

    Example:
        >>> [point.distance_m for point in vsd.threshold_sensitivity(warehouse).points]
        [1.8, 2.0, 2.2]
    """
    site = warehouse.site
    if floor_id is not None and floor_id not in {floor.floor_id for floor in site.floors}:
        raise UsageError(f"there is no floor {floor_id!r}", fix=", ".join(f.floor_id for f in site.floors))
    settings = site.settings
    threshold_mm, reach_mm = round(settings.distance_m * 1000), round(settings.pair_max_m * 1000)
    days = {"first": first or warehouse.first, "last": last or warehouse.last}
    inputs = warehouse.rows(_INPUTS, {"floor": floor_id, **days})
    used = [t for t in inputs if t["knows_people"] and t["knows_distances"]]
    left_out = tuple(t["camera_id"] for t in inputs if t not in used)
    n_records = sum(t["violation_records"] for t in used)

    def refused(state: State, reason: Reason) -> ThresholdSensitivity:
        points = tuple(_unknown(factor * settings.distance_m, state, reason) for factor in FACTORS)
        return ThresholdSensitivity(floor_id, settings.distance_m, None, points, left_out, None, state, reason)

    if not inputs:
        return refused("not_enough_data", NOTHING)
    if not used:
        return refused("not_measurable", NO_FLOOR if any(t["knows_people"] for t in inputs) else NO_POSITIONS)
    exposure_h = sum(t["exposure_s"] for t in used) / 3600
    rows = warehouse.table(_DISTANCES, {"cameras": [t["camera_id"] for t in used], **days})
    mm, n, n_sent, nearest_s = (rows[name].to_numpy() for name in ("distance_mm", "n_pairs", "n_sent", "nearest_s"))
    is_cut = bool(n_sent.sum() > 0 and not n_sent[mm >= threshold_mm].any())
    known_mm = threshold_mm if is_cut else reach_mm
    points = []
    for factor in FACTORS:
        limit_mm = round(factor * threshold_mm)
        if limit_mm > known_mm:
            reason = NOT_SENT if is_cut else Reason("distances.limit", limit_m=settings.pair_max_m)
            points.append(_unknown(limit_mm / 1000, "not_measurable", reason))
            continue
        inside = mm < limit_mm
        counted = int(n[inside].sum()), float(nearest_s[inside].sum()) / 3600
        if exposure_h > 0:
            points.append(ThresholdPoint(limit_mm / 1000, *counted, counted[1] / exposure_h, "ok", None))
        else:
            points.append(ThresholdPoint(limit_mm / 1000, *counted, None, "not_enough_data", NOBODY))
    if points[1].violation_records != n_records:
        return refused("not_measurable", PURGED)
    effect = None
    if site.engine is not None:
        spread = site.engine.distance_sd_m
        moved = None
        if spread is not None:
            moved = crossings(mm, n, threshold_mm=threshold_mm, distance_sd_m=spread, reach_mm=known_mm)
        effect = engine_effect(site.engine, violation_records=n_records, moved=moved)
    legal = points[1]
    stated = calibration_range(
        warehouse,
        cameras=[t["camera_id"] for t in used],
        exposure_h=exposure_h,
        threshold_mm=threshold_mm,
        known_mm=known_mm,
        **days,
    )
    return ThresholdSensitivity(
        floor_id, settings.distance_m, exposure_h, tuple(points), left_out, effect, legal.state, legal.reason, stated
    )


def engine_effect(error: EngineError, *, violation_records: int, moved: Crossings | None) -> EngineEffect:
    """Return how an engine's stated error changes a count of violation records, and the note to print with it.

    Args:
        error: What vsd.toml states.
        violation_records: Records counted.
        moved: Result of `stats.sensitivity.crossings`; None without a stated sd.
    """
    parts: list[Reason] = []
    expected = None
    if error.precision is not None:
        parts.append(Reason("accuracy.precision", share=error.precision))
    if error.recall is not None:
        parts.append(Reason("accuracy.recall", share=error.recall))
    if error.precision is not None and error.recall is not None:
        expected = true_records(violation_records, precision=error.precision, recall=error.recall)
        parts.append(Reason("accuracy.expected", expected=_short(expected), n=violation_records))
    if moved is not None:
        parts.append(
            Reason(
                "accuracy.moved" if moved.is_reach_full else "accuracy.moved_at_least",
                sd_m=moved.distance_sd_m,
                leaving=_short(moved.leaving),
                n=violation_records,
                entering=_short(moved.entering),
            )
        )
    note = Reason("accuracy.note", parts=tuple(parts))
    return EngineEffect(error, violation_records, expected, moved, note)


def _short(n: float) -> str:
    """Return a count with three significant digits."""
    return f"{float(f'{n:.3g}'):,.0f}" if n >= WHOLE_FROM else f"{n:.3g}"


def _unknown(distance_m: float, state: State, reason: Reason) -> ThresholdPoint:
    return ThresholdPoint(round(distance_m, 6), None, None, None, state, reason)


_INPUTS = """
select
    camera_id,
    bool_and(exposure_s is not null) as knows_people,
    bool_and(violation_records is not null) as knows_distances,
    sum(exposure_s)::double as exposure_s,
    sum(violation_records)::bigint as violation_records
from camera_hours
where recorded_s > 0 and ($floor::varchar is null or floor_id = $floor) and local_date between $first and $last
group by camera_id
order by camera_id
"""
_DISTANCES = """
select
    distance_mm::bigint as distance_mm,
    sum(n_pairs)::bigint as n_pairs,
    sum(n_sent)::bigint as n_sent,
    sum(nearest_s)::double as nearest_s
from distances
where list_contains($cameras, camera_id) and local_date between $first and $last
group by distance_mm
order by distance_mm
"""
