"""The hours of a week and what was counted in them, without what the report holds back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from types import MappingProxyType
from typing import Final

import numpy as np

from vsd_analytics.analysis.panels import Flags, Ints, Period, Place, TwoPeriods
from vsd_analytics.planner.fives import in_fives
from vsd_analytics.report.privacy import GIVES_AWAY, held_back, is_small, too_few
from vsd_analytics.report.weekdata import WeekData
from vsd_analytics.site import Floor
from vsd_analytics.warehouse.warehouse import Warehouse

EMPTY: Final[Mapping[int, str]] = MappingProxyType({})


class TwoWeeks(WeekData):
    """A week of a floor and any earlier (or later) one it is compared with.

    Args:
        warehouse: Opened over both weeks and the five before this one.
        floor: The floor.
        monday: First day of the week.
        before: First day of the other.
    """

    def __init__(self, warehouse: Warehouse, *, floor: Floor, monday: date, before: date) -> None:
        super().__init__(warehouse, floor=floor, monday=monday)
        self.pair = TwoPeriods(Period(self, before, before + timedelta(days=6)), self.this)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Panel:
    """Hours of some days, and what was counted in them.

    Attributes:
        day: Days since the first day of the period, shape (n_slots,), rising.
        weekday: 0 Monday to 6 Sunday, same shape.
        hour: Local hour, 0 to 23, same shape.
        fold: 1 for the second of two equal local hours, same shape.
        recorded_ms: Recorded opening time, shape (n_cameras, n_slots).
        is_counted: Camera-hours that enter rates, same shape.
        n: Violations, shape (n_places, n_cameras, n_slots); no count is from 1 to under `mask_below`.
        exposure_ms: Person-milliseconds, same shape.
    """

    day: Ints
    weekday: Ints
    hour: Ints
    fold: Ints
    recorded_ms: Ints
    is_counted: Flags
    n: Ints
    exposure_ms: Ints


def open_slots(data: TwoWeeks, days: Sequence[date]) -> Ints:
    """Return which hours of the floor are open, in some days."""
    ordinals = [d.toordinal() for d in days]
    return np.flatnonzero(np.isin(data.hours.day, ordinals) & (data.hours.open_s > 0))


def panel_of(
    data: TwoWeeks,
    days: Sequence[date],
    places: Sequence[Place],
    *,
    first: date,
    hidden: Mapping[int, str] = EMPTY,
    held: Sequence[int] = (),
    shared: Flags | None = None,
) -> Panel:
    """Return the open hours of some days; counts of hours that the report holds back stand together in one of them.

    A camera that counts fewer in a place than may be given is told with the camera that counts most there.
    """
    slots, hours = open_slots(data, days), data.hours
    counted = hours.is_counted[:, slots]
    day = hours.day[slots] - first.toordinal()
    below = int(data.site.settings.mask_below)
    shape = (len(places), len(data.ids), len(slots))
    n, exposure_ms = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    for k, place in enumerate(places):
        used = counted & place.cameras[:, None]
        if data.why_no_exposure is None:
            exposure_ms[k] = np.where(used, np.rint(place.exposure_h[:, slots] * 3_600_000), 0)
        if k in hidden:
            continue
        counts = np.where(used, place.n[:, slots], 0).astype(np.int64)
        if k == 0 and len(held):
            together = np.isin(slots, held)
            to = int(np.flatnonzero(together)[np.argmax(counts[:, together].sum(axis=0))])
            sums = counts[:, together].sum(axis=1)
            counts[:, together] = 0
            counts[:, to] = sums
        left = 0
        for c, row_n in enumerate(counts):
            side = np.zeros_like(day) if shared is None else shared[c, slots].astype(np.int64)
            order = np.lexsort((side, day))
            groups = (2 * day[order] + side[order], day[order])
            given = in_fives(row_n[order][None], groups=groups, below=below)
            n[k, c, order] = given.values[0]
            left += int(given.n_dropped[0])
        if n[k].any():
            n[k].flat[int(n[k].argmax())] += left
    return Panel(
        day=day,
        weekday=hours.weekday[slots],
        hour=hours.hour[slots],
        fold=hours.fold[slots],
        recorded_ms=np.rint(hours.recorded_s[:, slots] * 1000).astype(np.int64),
        is_counted=counted,
        n=n,
        exposure_ms=exposure_ms,
    )


def _counted(data: TwoWeeks, place: Place, period: Period) -> int:
    return int(data.panel(place, period.days).n.sum())


def hidden_places(
    data: TwoWeeks, period: Period, places: Sequence[Place], *, are_hours_safe: bool
) -> Mapping[int, str]:
    """Return why places are not told: their own count is too small, or it would tell such a count of another.

    The rules are those of the report (`report.areas`, `report.assemble`).
    """
    below = int(data.site.settings.mask_below)
    counts = {k: _counted(data, place, period) for k, place in enumerate(places)}
    parts = {k: n for k, n in counts.items() if k > 0}
    held = held_back(parts, below=below, give=sorted(parts, reverse=True))
    found = {k: too_few(below) if k in held.small else GIVES_AWAY for k in parts if k in held}
    if is_small(counts[0], below=below):
        found[0] = too_few(below)
    elif not (held.is_total_safe and are_hours_safe):
        found[0] = GIVES_AWAY
    return found


def held_hours(data: TwoWeeks, period: Period) -> tuple[int, ...] | None:
    """Return the hours whose counts the report's timetable holds back; None where even their sum tells too much."""
    below = int(data.site.settings.mask_below)
    chosen = open_slots(data, period.days).tolist()
    counts = {i: int(data.whole.n[:, i].sum()) for i in chosen}
    first = min((i for i in chosen if is_small(counts[i], below=below)), default=0)
    n_off = sum(counts.values()) - _counted(data, data.whole, period)
    give = sorted(chosen, key=lambda i: (abs(i - first), i))
    held = held_back(counts, below=below, give=give, n_others=int(is_small(n_off, below=below)))
    return tuple(i for i in chosen if i in held) if held.is_total_safe else None
