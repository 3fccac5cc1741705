"""Which cameras may be compared over a range: those whose facts were measured alike all the time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from statistics import median

from vsd_analytics.site.model import Camera, Floor
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.warehouse.camera_days import hourly_inputs
from vsd_analytics.warehouse.owner_spans import calibration_spans, owner_spans
from vsd_analytics.warehouse.warehouse import Warehouse

DAY_MS = 24 * HOUR_MS
INTERVAL_TOLERANCE = 0.1
"""Frame intervals that differ by more than this share are reported: they change how well short events are seen."""


@dataclass(frozen=True, slots=True)
class Recalibration:
    """A camera whose records of a range were placed through more than one calibration.

    Attributes:
        camera_id: The camera.
        before, after: Ids of the last two calibrations used.
        at_ms: Instant from which the latter holds, UTC milliseconds: as vsd.toml says, else its first record.
    """

    camera_id: str
    before: str
    after: str
    at_ms: int


@dataclass(frozen=True, slots=True)
class OtherInterval:
    """A camera whose frames come at another interval since a day of a range.

    Attributes:
        camera_id: The camera.
        before_ms: Median interval of the days before, milliseconds.
        after_ms: Interval from that day on.
        since_ms: Start of that UTC day, UTC milliseconds.
    """

    camera_id: str
    before_ms: int
    after_ms: int
    since_ms: int


def recalibrations(
    warehouse: Warehouse, *, cameras: Sequence[Camera], first_ms: int, end_ms: int
) -> list[Recalibration]:
    """Return the cameras whose opening hours in [first_ms, end_ms) were computed with several calibrations.

    The facts tell, not vsd.toml: hours whose records were purged keep the calibration they were computed with, and
    records with floor metres of their own go through none.
    """
    rows = warehouse.rows(
        "select camera_id, calibration_id, min(first_ms) as first_ms from calibrations_used "
        "where hour * 3600000 >= $first and hour * 3600000 < $end "
        "and hour in (select floor(quarter / 4)::bigint from calendar where is_open) "
        "group by camera_id, calibration_id order by first_ms, calibration_id",
        {"first": first_ms, "end": end_ms},
    )
    recalibrated = []
    for camera in cameras:
        used = [row for row in rows if row["camera_id"] == camera.camera_id]
        if len(used) > 1:
            old, new = used[-2:]
            starts_ms = [ms for ms, _, c in calibration_spans(camera) if c.calibration_id == new["calibration_id"]]
            inside = [ms for ms in starts_ms if first_ms < ms < end_ms]
            at_ms = inside[-1] if inside else new["first_ms"]
            recalibrated.append(Recalibration(camera.camera_id, old["calibration_id"], new["calibration_id"], at_ms))
    return recalibrated


def has_other_owners(warehouse: Warehouse, floor: Floor, *, first_ms: int, end_ms: int) -> bool:
    """Tell whether other cameras come to own cells of a floor in [first_ms, end_ms): then all its counts move."""
    spans = [s for s in owner_spans(warehouse.site) if s.floor_id == floor.floor_id]
    return len({frozenset(s.cells) for s in spans if s.from_ms < end_ms and s.to_ms > first_ms}) > 1


def has_other_rules(warehouse: Warehouse, *, first_ms: int, end_ms: int) -> bool:
    """Tell whether hours of [first_ms, end_ms) were computed by different SQL or settings."""
    return len(rules_used(warehouse, first_ms=first_ms, end_ms=end_ms)) > 1


def rules_used(warehouse: Warehouse, *, first_ms: int, end_ms: int) -> frozenset[tuple[str | None, str | None]]:
    """Return the hashes of SQL and settings by which hours of [first_ms, end_ms) were computed.

    Only hours whose records were purged can have others than today's: their facts stay as they are.
    """
    hours = [h for h in warehouse.built.fingerprints if first_ms <= h * HOUR_MS < end_ms]
    sealed = warehouse.built.sealed.hours
    today = hourly_inputs(warehouse.site)
    return frozenset(
        (sealed[h].causes.get("sql"), sealed[h].causes.get("settings")) if h in sealed else (today.sql, today.settings)
        for h in hours
    )


def other_intervals(
    warehouse: Warehouse, *, cameras: Sequence[Camera], first_ms: int, end_ms: int
) -> list[OtherInterval]:
    """Return the cameras whose frame interval changes for good by more than a tenth in [first_ms, end_ms)."""
    rows = warehouse.rows(
        "select camera_id, utc_day, interval_ms from camera_days "
        "where utc_day between $first and $last order by utc_day",
        {"first": first_ms // DAY_MS, "last": (end_ms - 1) // DAY_MS},
    )
    intervals = []
    for camera in cameras:
        days = [(r["utc_day"], r["interval_ms"]) for r in rows if r["camera_id"] == camera.camera_id]
        for i in range(1, len(days)):
            before = median(ms for _, ms in days[:i])
            if all(abs(ms - before) > INTERVAL_TOLERANCE * before for _, ms in days[i:]):
                after = median(ms for _, ms in days[i:])
                intervals.append(OtherInterval(camera.camera_id, round(before), round(after), days[i][0] * DAY_MS))
                break
    return intervals


def pair_days(before: Sequence[date], now: Sequence[date]) -> list[tuple[date, date]]:
    """Return days of equal weekday in pairs: the first Monday of one with the first of the other, and so on.

    Args:
        before: Days of period A, in order.
        now: Days of period B, in order.

    Returns:
        Pairs (A, B) by the day of B; days without a partner are left out.
    """
    pairs = []
    for weekday in range(7):
        left, right = ([d for d in days if d.weekday() == weekday] for days in (before, now))
        pairs += list(zip(left, right, strict=False))
    return sorted(pairs, key=lambda pair: pair[1])
