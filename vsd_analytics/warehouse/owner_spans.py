"""Lives of cameras and calibrations, and which camera counts where and when."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, datetime
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

from vsd_analytics.settings import OWNER_CELL_M
from vsd_analytics.site.model import Calibration, Camera, Floor, Site

if TYPE_CHECKING:
    from vsd_analytics.geometry.ownership import OwnerCell

FOREVER_MS = 2**53
"""An instant after all others that float64 still holds exactly."""


@dataclass(frozen=True, slots=True)
class OwnerSpan:
    """A span of time in which the owners of a floor's cells do not change.

    Attributes:
        floor_id: The floor.
        from_ms: Start, UTC milliseconds; -FOREVER_MS = no start.
        to_ms: End, exclusive; FOREVER_MS = no end.
        cells: Which camera counts where the views of several overlap.
    """

    floor_id: str
    from_ms: int
    to_ms: int
    cells: tuple[OwnerCell, ...]


def owner_spans(site: Site) -> list[OwnerSpan]:
    """Return the owner cells of each floor by time.

    A new span starts when a calibration of one of its cameras does, and when a camera comes or goes. Within a span each
    camera that is there has the one calibration in force (`ownership.owner_cells`).
    """
    spans = []
    for floor in site.floors:
        cameras = [c for c in site.cameras if c.floor_id == floor.floor_id]
        lives = {c: camera_life(site, c) for c in cameras}
        changes = {ms for life in lives.values() for ms in life} - {FOREVER_MS}
        starts = sorted(changes | {from_ms for c in cameras for from_ms, _, _ in calibration_spans(c)} | {-FOREVER_MS})
        for from_ms, to_ms in pairwise([*starts, FOREVER_MS]):
            there = [c for c, (first_ms, end_ms) in lives.items() if first_ms <= from_ms < end_ms]
            now = tuple(replace(c, calibrations=in_force(c, from_ms)) for c in there)
            cells = _owner_cells(now, OWNER_CELL_M, floor)
            spans.append(OwnerSpan(floor.floor_id, from_ms, to_ms, cells))
    return spans


@lru_cache(maxsize=64)
def _owner_cells(cameras: tuple[Camera, ...], cell_m: float, floor: Floor) -> tuple[OwnerCell, ...]:
    from vsd_analytics.geometry import ownership

    return tuple(ownership.owner_cells(cameras, cell_m=cell_m, floor=floor))


def calibration_spans(camera: Camera) -> list[tuple[int, int, Calibration]]:
    """Return a camera's calibrations, each with its start and end (UTC milliseconds, end exclusive).

    The first has no start: it also holds for records before its date. A calibration equal to the one before it does not
    start a new span, so that entering it twice makes no fact stale.
    """
    starts: list[tuple[int, Calibration]] = []
    for c in camera.calibrations:
        if starts and c.homography == starts[-1][1].homography:
            continue
        is_first = not starts or c.valid_from is None
        starts.append((-FOREVER_MS if is_first else round(c.valid_from.timestamp() * 1000), c))  # type: ignore[union-attr]
    ends = [*(from_ms for from_ms, _ in starts[1:]), FOREVER_MS]
    return [(from_ms, to_ms, c) for (from_ms, c), to_ms in zip(starts, ends, strict=False)]


def in_force(camera: Camera, ms: int) -> tuple[Calibration, ...]:
    """Return the calibration of a camera in force at an instant (UTC milliseconds), as a tuple of one, or empty."""
    return tuple(c for from_ms, to_ms, c in calibration_spans(camera) if from_ms <= ms < to_ms)


def day_start_ms(site: Site, day: date) -> int:
    """Return the UTC instant in milliseconds at which a local day begins."""
    midnight = datetime(day.year, day.month, day.day, tzinfo=site.zone)
    return int(midnight.timestamp()) // 900 * 900_000


def camera_life(site: Site, camera: Camera) -> tuple[int, int]:
    """Return the instants from which a camera is there and from which it no longer is, UTC milliseconds."""
    first, end = camera.first_day, camera.end_day
    return (
        -FOREVER_MS if first is None else day_start_ms(site, first),
        FOREVER_MS if end is None else day_start_ms(site, end),
    )
