"""What the marts say about one floor as arrays: cameras x hours, and panels of cameras x days.

A camera-hour enters rates when it was recorded for at least `partial_hour_share` of its opening time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from functools import cached_property
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.people import people_by_hour
from vsd_analytics.figures.share.together import evened
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
WEEK: Final = timedelta(days=7)
MIN_CAMERA_SHARE: Final = 0.01
"""A camera that counts less of a place than this is not one that sees it."""


@dataclass(frozen=True, slots=True, eq=False)
class Hours:
    """The local hours of a range and what each camera recorded in them.

    Attributes:
        start_ms: UTC instant each starts, milliseconds, shape (n_hours,), rising.
        day: Local date as days since year 1 (`date.toordinal`), same shape.
        hour: Local hour, 0 to 23, same shape.
        fold: 1 for the second of two equal local hours, same shape.
        open_s: Opening time, same shape.
        scheduled_s: Opening time while each camera is there, shape (n_cameras, n_hours).
        recorded_s: Recorded opening time, same shape.
        is_counted: Camera-hours that enter rates, same shape.
        is_inferred: Recorded time is concluded from silences, same shape.
        knows_people: Exposure is known, same shape.
    """

    start_ms: Ints
    day: Ints
    hour: Ints
    fold: Ints
    open_s: Array
    scheduled_s: Array
    recorded_s: Array
    is_counted: Flags
    is_inferred: Flags
    knows_people: Flags

    @property
    def weekday(self) -> Ints:
        """Return the weekday of each hour, 0 Monday to 6 Sunday."""
        return (self.day - 1) % 7

    def all_counted(self, cameras: Flags) -> Flags:
        """Return the hours in which each of some cameras that is there counts, and one at least, shape (n_hours,)."""
        counts, is_there = self.is_counted[cameras], self.scheduled_s[cameras] > 0
        return np.asarray((counts | ~is_there).all(axis=0) & counts.any(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """What was counted in a place: the whole floor, an area, or the rest of the floor.

    Attributes:
        n: Violations that started in opening hours, shape (n_cameras, n_hours); 0 where nothing was recorded.
        exposure_h: Person-hours in opening hours, same shape.
        cameras: Which cameras count anybody there, shape (n_cameras,).
        is_there: Which hours count for it, shape (n_hours,); None = all.
    """

    n: Array
    exposure_h: Array
    cameras: Flags
    is_there: Flags | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Counts and what they are divided by, one row per camera, one column per day.

    Attributes:
        n: Violations, shape (n_cameras, n_days).
        x_h: Recorded open hours, same shape.
        exposure_h: Person-hours, same shape.
    """

    n: Array
    x_h: Array
    exposure_h: Array


class FloorHours:
    """The marts of a floor over the range of a warehouse.

    Args:
        warehouse: Opened over all days that are to be used.
        floor: The floor.
        clock: The present; None = all hours are over.
    """

    def __init__(self, warehouse: Warehouse, *, floor: Floor, clock: datetime | None = None) -> None:
        self.warehouse, self.floor, self.clock = warehouse, floor, clock
        self.site: Site = warehouse.site
        self.mask = Mask(int(self.site.settings.mask_below))
        self.cameras: Sequence[Camera] = [c for c in self.site.cameras if c.floor_id == floor.floor_id]
        self.areas: Sequence[Area] = [a for a in self.site.areas if a.floor_id == floor.floor_id]
        self.ids = [c.camera_id for c in self.cameras]
        self.hours, self.everyone = self._hours()

    @property
    def untimed(self) -> frozenset[str | None]:
        """Return the areas whose person-time does not leave yet; none, of days that are over."""
        return frozenset()

    @cached_property
    def people_by_hour(self) -> Ints:
        """Return how many people were on the floor in each hour, at least, shape (n_hours,)."""
        return people_by_hour(self)

    def inside(self, first: date, last: date) -> Flags:
        """Return which hours lie in local days from `first` to `last`."""
        return np.asarray((self.hours.day >= first.toordinal()) & (self.hours.day <= last.toordinal()))

    def local(self, ms: int) -> datetime:
        """Return an instant (UTC milliseconds) in the site's zone, to the second."""
        return datetime.fromtimestamp(ms // 1000, tz=UTC).astimezone(self.site.zone)

    def midnight(self, day: date) -> datetime:
        """Return the start of a local day."""
        return datetime(day.year, day.month, day.day, tzinfo=self.site.zone)

    def span_ms(self, first: date, last: date) -> tuple[int, int]:
        """Return the start of a local day and the end of another, UTC milliseconds."""
        ends = (self.midnight(first), self.midnight(last + timedelta(days=1)))
        return round(ends[0].timestamp() * 1000), round(ends[1].timestamp() * 1000)

    def panel(self, place: Place, days: Sequence[date], *, since: int | None = None, until: int | None = None) -> Panel:
        """Return sums by camera and day over the camera-hours that enter rates; what was not recorded is 0 hours.

        Args:
            place: What to sum.
            days: The columns.
            since: Only hours that start at this instant or later (UTC milliseconds).
            until: Only hours that start before it.
        """
        low = self.hours.start_ms >= (since if since is not None else -np.inf)
        high = self.hours.start_ms < (until if until is not None else np.inf)
        chosen = np.flatnonzero(low & high)
        return self.sums(place, chosen, self.hours.is_counted[:, chosen], days)

    def sums(self, place: Place, chosen: Ints, counted: Flags, days: Sequence[date]) -> Panel:
        """Return sums by day over hours `chosen`, of camera-hours `counted`, shape (n_cameras, n_chosen).

        For readers, hours that they know together have equal parts (`given`).
        """
        place = self.given(place)
        ordinals = np.array([d.toordinal() for d in days], dtype=np.int64)
        of_day = (self.hours.day[chosen, None] == ordinals).astype(np.float64)
        used = counted & place.cameras[:, None]
        if place.is_there is not None:
            used = used & place.is_there[chosen]
        return Panel(
            *(
                np.where(used, values[:, chosen], 0.0) @ of_day
                for values in (place.n, self.hours.recorded_s / 3600, place.exposure_h)
            )
        )

    def given(self, place: Place) -> Place:
        """Return a place as what it is made for may know it: hours known together have equal parts of their sum."""
        warehouse, floor_id = self.warehouse, self.floor.floor_id
        n, exposure_h = (
            evened(values, self.hours.is_counted, [np.flatnonzero(np.isin(self.hours.start_ms, [*g])) for g in groups])
            for values, groups in (
                (place.n, warehouse.counted_together.get(floor_id, ())),
                (place.exposure_h, warehouse.timed_together.get(floor_id, ())),
            )
        )
        return Place(n, exposure_h, place.cameras, place.is_there)

    def counted_in(self, area_id: str | None) -> tuple[Array, Array]:
        """Return violations and person-hours in an area, each (n_cameras, n_hours); None is the rest of the floor."""
        k = len(self.areas) if area_id is None else [a.area_id for a in self.areas].index(area_id)
        n, exposure_h, _ = self._by_area
        return n[k], exposure_h[k]

    def violation_in(self, area_id: str | None) -> Array:
        """Return person-hours in violation in an area, (n_cameras, n_hours); None is the rest of the floor."""
        k = len(self.areas) if area_id is None else [a.area_id for a in self.areas].index(area_id)
        return np.asarray(self._by_area[2][k])

    def is_there(self, area_id: str | None) -> Flags | None:
        """Return which hours count for an area, shape (n_hours,); None = all, as for the rest of the floor."""
        area = next((a for a in self.areas if a.area_id == area_id), None)
        if area is None or (area.first_day, area.end_day) == (None, None):
            return None
        first, end = (d.toordinal() for d in (area.first_day or date.min, area.end_day or date.max))
        return np.asarray((self.hours.day >= first) & (self.hours.day < end))

    @cached_property
    def violation_h(self) -> Array:
        """Return person-hours in violation in opening hours, shape (n_cameras, n_hours)."""
        return np.asarray(self._by_area[2].sum(axis=0))

    @cached_property
    def _by_area(self) -> tuple[Array, Array, Array]:
        """Return violations, person-hours, those in violation, (n_areas + 1, n_cameras, n_hours); last is the rest."""
        rows = self.warehouse.table(
            "select area_id, camera_id, hour_start_ms, n_violations_open::double as n, "
            "exposure_open_s::double / 3600 as exposure_h, violation_open_s::double / 3600 as violation_h "
            "from area_hours where floor_id = $floor",
            {"floor": self.floor.floor_id},
        )
        area = positions(rows["area_id"], [a.area_id for a in self.areas], otherwise=len(self.areas))
        at = area, *self._at(rows)

        def cube(name: str) -> Array:
            sums = np.zeros((len(self.areas) + 1, *self.everyone.n.shape))
            np.add.at(sums, at, rows[name].to_numpy())  # areas of other weeks are part of the rest
            return sums

        return cube("n"), cube("exposure_h"), cube("violation_h")

    def records_in(self, first: date, last: date) -> Ints:
        """Return what each camera sent of local days from `first` to `last`, shape (n_cameras, 4).

        Columns: person records, those without a floor position, violation records, those of pairs with track ids.
        """
        camera, day, n = self._records
        chosen = (day >= first.toordinal()) & (day <= last.toordinal())
        sums = np.zeros((len(self.ids), n.shape[1]), dtype=np.int64)
        np.add.at(sums, camera[chosen], n[chosen])
        return sums

    @cached_property
    def _records(self) -> tuple[Ints, Ints, Ints]:
        """Return rows of camera (its position), day (`date.toordinal`) and the counts of `records_in`.

        One query for all weeks: a report asks for each of twelve.
        """
        rows = self.warehouse.table(
            "with sent as ("
            "select camera_id, local_date, person_records + n_doubled as n_persons, n_unlocated, 0 as n_records, "
            "0 as n_joined from exposure inner join calendar using (quarter) "
            "union all select camera_id, local_date, 0, 0, violation_records, 0 "
            "from violation_time inner join calendar using (quarter) "
            "union all select camera_id, local_date, 0, 0, 0, n_records from joined_days) "
            "select camera_id, local_date, sum(n_persons)::bigint as n_persons, "
            "sum(n_unlocated)::bigint as n_unlocated, sum(n_records)::bigint as n_records, "
            "sum(n_joined)::bigint as n_joined from sent where list_contains($ids::varchar[], camera_id) "
            "group by camera_id, local_date",
            {"ids": self.ids},
        )
        day = rows["local_date"].to_numpy().astype("datetime64[D]").astype(np.int64) + date(1970, 1, 1).toordinal()
        counts = [rows[name].to_numpy() for name in ("n_persons", "n_unlocated", "n_records", "n_joined")]
        return positions(rows["camera_id"], self.ids, otherwise=-1), day, np.stack(counts, axis=1)

    def by_hour(self, rows: pa.Table, *names: str) -> tuple[Array, ...]:
        """Return columns of rows by camera and hour as arrays of shape (n_cameras, n_hours), 0 where no row is."""
        arrays = tuple(np.zeros_like(self.everyone.n) for _ in names)
        at = self._at(rows)
        for sums, name in zip(arrays, names, strict=True):
            np.add.at(sums, at, rows[name].to_numpy())
        return arrays

    def _at(self, rows: pa.Table) -> tuple[Ints, Ints]:
        """Return the camera and the hour of each row."""
        hour = np.searchsorted(self.hours.start_ms, rows["hour_start_ms"].to_numpy())
        return positions(rows["camera_id"], self.ids, otherwise=-1), hour

    def camera_weights(self, place: Place) -> Array:
        """Return how much of a place each camera counts, shape (n_cameras,): person-time per recorded hour, sum 1.

        All loaded days are used, so that a camera that was down in a period keeps its weight; violations are used where
        person-time is unknown. All 0 where nobody was ever counted.
        """
        recorded_h = self.hours.recorded_s.sum(axis=1) / 3600
        exposure, violations = place.exposure_h.sum(axis=1), place.n.sum(axis=1)
        seen: Array = exposure if exposure.any() else violations
        weights = np.divide(seen, recorded_h, out=np.zeros_like(seen), where=(recorded_h > 0) & place.cameras)
        total = float(weights.sum())
        return np.asarray(weights / total if total else weights)

    def _hours(self) -> tuple[Hours, Place]:
        rows = self.warehouse.table(
            "select hour_start_ms, local_date, local_hour, fold, open_s::double as open_s, "
            "recorded_open_s::double as recorded_s, coalesce(is_inferred, false) as is_inferred, "
            "coalesce(n_violations_open, 0)::double as n, exposure_open_s is not null as knows_people, "
            "coalesce(exposure_open_s, 0)::double / 3600 as exposure_h "
            "from camera_hours where floor_id = $floor order by hour_start_ms, camera_no",
            {"floor": self.floor.floor_id},
        )
        n_cameras = max(1, len(self.ids))

        def grid(name: str) -> NDArray[Any]:
            values: NDArray[Any] = rows[name].to_numpy()
            return values.reshape(-1, n_cameras).T

        first = [grid(name)[0] for name in ("hour_start_ms", "local_date", "local_hour", "fold")]
        start_ms, day, hour, fold = first
        recorded_s, scheduled_s = grid("recorded_s"), grid("open_s")
        least_s = self.site.settings.partial_hour_share * scheduled_s
        is_counted = (scheduled_s > 0) & (recorded_s > 0) & (recorded_s >= least_s)
        epoch = date(1970, 1, 1).toordinal()
        hours = Hours(
            start_ms=start_ms.astype(np.int64),
            day=day.astype("datetime64[D]").astype(np.int64) + epoch,
            hour=hour.astype(np.int64),
            fold=fold.astype(np.int64),
            open_s=scheduled_s.max(axis=0),
            scheduled_s=scheduled_s,
            recorded_s=recorded_s,
            is_counted=is_counted,
            is_inferred=grid("is_inferred"),
            knows_people=grid("knows_people"),
        )
        return hours, Place(grid("n"), grid("exposure_h"), np.ones(len(self.ids), dtype=np.bool_))


def positions(values: pa.ChunkedArray, names: Sequence[str], *, otherwise: int) -> Ints:
    """Return the place of each value in `names`; `otherwise` for what is missing."""
    import pyarrow.compute as pc

    places = pc.index_in(values, value_set=pa.array(names, pa.string()))
    return np.asarray(pc.fill_null(places, otherwise).to_numpy(), dtype=np.int64)
