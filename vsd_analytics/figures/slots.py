"""What the cameras of a site, or of one floor, counted in each hour of each week: arrays of cameras x weeks x 168."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.answer import Reason
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.share.together import Flags, Ints, evened
from vsd_analytics.site.model import Site
from vsd_analytics.site.places import named_floors
from vsd_analytics.stats.hour_of_week import SLOTS, Weeks, recorded_hours
from vsd_analytics.warehouse.dimensions import calendar
from vsd_analytics.warehouse.warehouse import Warehouse

Floats = NDArray[np.float64]

NO_IDS: Final = Reason("engine.no_ids_or_distances")
Span = tuple[date, date]
NO_POSITIONS: Final = Reason("engine.no_positions")
NOTHING_OPEN: Final = Reason("recorded.nothing_open")


@dataclass(frozen=True, slots=True, eq=False)
class Slots:
    """Opening hours of some weeks; slot = 24 weekday + hour, 0 Monday 00 to 167 Sunday 23.

    Attributes:
        monday: First day of the last week.
        camera_ids: The cameras.
        open_h: Open hours, shape (n_weeks, 168), oldest week first.
        scheduled_h: Open hours while a camera is there, shape (n_cameras, n_weeks, 168).
        recorded_h: Recorded open hours, same shape.
        person_h: Person-hours, same shape; NaN where they are not known.
        violation_h: Person-hours in violation, same shape; NaN where they are not known.
        n_violations: Violations, same shape; NaN where they are not known.
        min_share: Share of its open hours a camera's slot must be recorded for, to enter rates.
        hidden: Slots whose violations are not those counted, as a report hides them (`share.hours`), shape
            (n_weeks, 168); None = no number is hidden.
    """

    monday: date
    camera_ids: tuple[str, ...]
    open_h: Floats
    scheduled_h: Floats
    recorded_h: Floats
    person_h: Floats
    violation_h: Floats
    n_violations: Floats
    min_share: float
    hidden: NDArray[np.bool_] | None = None

    @property
    def is_recorded(self) -> NDArray[np.bool_]:
        """Return the slots of cameras that enter rates, shape (n_cameras, n_weeks, 168)."""
        return np.asarray((self.recorded_h > 0) & (self.recorded_h >= self.min_share * self.open_h))

    @property
    def left_out(self) -> tuple[str, ...]:
        """Return the cameras without one recorded hour."""
        return tuple(c for c, recorded in zip(self.camera_ids, self.is_recorded, strict=True) if not recorded.any())

    @property
    def people(self) -> Weeks:
        """Return person-hours of all cameras, and the open hours they were recorded in."""
        return self._together(self.person_h)

    @property
    def violations(self) -> Weeks:
        """Return violations of all cameras, and the open hours they were recorded in."""
        return self._together(self.n_violations)

    @property
    def counted(self) -> Floats:
        """Return the violations counted in each hour of the last week, shape (168,); NaN where nothing was recorded."""
        n = self.n_violations[:, -1]
        is_known = (self.recorded_h[:, -1] > 0) & ~np.isnan(n)
        return np.where(is_known.any(axis=0), np.where(is_known, n, 0.0).sum(axis=0), np.nan)

    @property
    def why_no_people(self) -> Reason | None:
        """Return why people cannot be counted, or None where they can or nothing was recorded."""
        return NO_POSITIONS if self.hidden is None and self._is_unknown(self.person_h) else None

    @property
    def why_no_violations(self) -> Reason | None:
        """Return why violations cannot be counted, or None where they can or nothing was recorded."""
        return NO_IDS if self.hidden is None and self._is_unknown(self.n_violations) else None

    @property
    def counted_h(self) -> Floats:
        """Return the hours that the violations of the last week were counted in, 0 where they are hidden, (168,)."""
        x_h = self.violations.x_h[-1]
        return x_h if self.hidden is None else np.where(self.hidden[-1], 0.0, x_h)

    def _together(self, counts: Floats) -> Weeks:
        return recorded_hours(counts, self.recorded_h, self.open_h, min_share=self.min_share)

    def _is_unknown(self, counts: Floats) -> bool:
        recorded = self.is_recorded
        return bool(recorded.any()) and bool(np.isnan(counts[recorded]).all())


def load_slots(
    warehouse: Warehouse, monday: date, *, n_weeks: int, floor_id: str | None = None, there: Span | None = None
) -> Slots:
    """Return the hours of the week from `monday` and the weeks before it; days that are not loaded are not recorded.

    Args:
        warehouse: Its range should hold the weeks.
        monday: First day of the last week.
        n_weeks: Weeks, this one included.
        floor_id: Only the cameras of this floor; None = all.
        there: First and last of some days: a camera that is there on none of them is left out, with its past, unless
            all are; None = all cameras. What is expected of a week is expected of the cameras that are there.

    Raises:
        UsageError: E101, `monday` is no Monday, or the site has no such floor.
    """
    site = warehouse.site
    _check(site, monday, floor_id)
    of_floor = [c for c in site.cameras if floor_id in (None, c.floor_id)]
    present = of_floor if there is None else [c for c in of_floor if c.is_there(*there)]
    cameras = tuple(c.camera_id for c in present or of_floor)
    first = monday - timedelta(weeks=n_weeks - 1)
    rows = warehouse.table(
        "select camera_id, date_diff('day', $first, local_date)::bigint as day, local_hour::bigint as hour, "
        "open_h::double as open_h, recorded_h::double as recorded_h, person_h::double as person_h, "
        "violation_h::double as violation_h, n_violations::double as n_violations from camera_slots "
        "where local_date between $first and $last and list_contains($cameras::varchar[], camera_id)",
        {"first": first, "last": monday + timedelta(days=6), "cameras": list(cameras)},
    )
    camera = pc.index_in(rows["camera_id"], value_set=pa.array(cameras, pa.string())).to_numpy()
    slot = rows["day"].to_numpy() * 24 + rows["hour"].to_numpy()

    def grid(name: str, missing: float) -> Floats:
        values = np.full((len(cameras), n_weeks * SLOTS), missing)
        values[camera, slot] = rows[name].to_numpy()
        return values.reshape(len(cameras), n_weeks, SLOTS)

    scheduled_h, recorded_h = grid("open_h", 0.0), grid("recorded_h", 0.0)
    open_h, least = scheduled_h.max(axis=0, initial=0.0), float(site.settings.partial_hour_share)
    counted = (recorded_h > 0) & (recorded_h >= least * open_h)

    def given(name: str, groups: Mapping[str, Sequence[frozenset[int]]]) -> Floats:
        slots = [_slots_of(starts, site, first, n_weeks) for starts in groups.get(floor_id or "", ())]
        return _given(grid(name, np.nan), counted, slots)

    return Slots(
        monday=monday,
        camera_ids=cameras,
        open_h=open_h,
        scheduled_h=scheduled_h,
        recorded_h=recorded_h,
        person_h=given("person_h", warehouse.timed_together),
        violation_h=given("violation_h", warehouse.counted_together),
        n_violations=given("n_violations", warehouse.counted_together),
        min_share=least,
    )


def _slots_of(starts: Iterable[int], site: Site, first: date, n_weeks: int) -> Ints:
    """Return the hours that start at UTC instants as positions in the slots of some weeks from a Monday on."""
    local = (datetime.fromtimestamp(ms / 1000, site.zone) for ms in starts)
    slots = np.unique([24 * (at.date() - first).days + at.hour for at in local]).astype(np.int64)
    return slots[(slots >= 0) & (slots < n_weeks * SLOTS)]


def _given(values: Floats, counted: Flags, groups: Sequence[Ints]) -> Floats:
    """Return values of slots, with equal parts in the slots that readers know together (`share.together`)."""
    shape = len(values), -1
    return evened(values.reshape(shape), counted.reshape(shape), groups).reshape(values.shape)


def open_hours(site: Site, monday: date) -> Floats:
    """Return the open hours of each slot of the week from `monday`, shape (168,), by opening hours and closed days."""
    quarters = calendar(site, monday, monday + timedelta(days=6))
    slot = (quarters["weekday"].to_numpy() - 1) * 24 + quarters["local_hour"].to_numpy()
    is_open = quarters["is_open"].to_numpy(zero_copy_only=False).astype(np.float64)
    return np.bincount(slot, weights=is_open, minlength=SLOTS) / 4


def known(value: float) -> float | None:
    """Return a number; None for NaN."""
    return None if np.isnan(value) else float(value)


def iso_week(monday: date) -> str:
    """Return the name of a week: 2026-W46."""
    return f"{monday:%G-W%V}"


def _check(site: Site, monday: date, floor_id: str | None) -> None:
    if monday.weekday() != 0:
        raise UsageError(f"{monday} is not a Monday", why="weeks start on Monday")
    named_floors(site, floor_id)
