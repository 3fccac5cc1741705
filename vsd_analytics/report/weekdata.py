"""What the marts say about one floor around one week, as arrays: cameras x hours, and panels of cameras x days.

A camera-hour enters rates when it was recorded for at least `partial_hour_share` of its opening time; it enters a
comparison when that holds in both weeks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.report.comparable import Recalibration, has_other_owners, recalibrations
from vsd_analytics.report.words import NO_FLOOR, NO_IDS, NO_POSITIONS
from vsd_analytics.site import Area, Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
WEEK = timedelta(days=7)
HOUR_MS = 3_600_000
DAY_MS = 24 * HOUR_MS


@dataclass(frozen=True, slots=True, eq=False)
class Hours:
    """The local hours of a range and what each camera recorded in them.

    Attributes:
        start_ms: UTC instant each starts, milliseconds, shape (n_hours,), rising.
        day: Local date as days since year 1 (`date.toordinal`), same shape.
        hour: Local hour, 0 to 23, same shape.
        fold: 1 for the second of two equal local hours, same shape.
        open_s: Opening time, same shape.
        recorded_s: Recorded opening time, shape (n_cameras, n_hours).
        is_counted: Camera-hours that enter rates, same shape.
        is_inferred: Recorded time is concluded from silences, same shape.
        knows_people: Exposure is known, same shape.
    """

    start_ms: Ints
    day: Ints
    hour: Ints
    fold: Ints
    open_s: Array
    recorded_s: Array
    is_counted: Flags
    is_inferred: Flags
    knows_people: Flags

    @property
    def weekday(self) -> Ints:
        """Return the weekday of each hour, 0 Monday to 6 Sunday."""
        return (self.day - 1) % 7


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """What was counted in a place: the whole floor, an area, or the rest of the floor.

    Attributes:
        n: Violations that started in opening hours, shape (n_cameras, n_hours); 0 where nothing was recorded.
        exposure_h: Person-hours in opening hours, same shape.
        cameras: Which cameras count anybody there, shape (n_cameras,).
    """

    n: Array
    exposure_h: Array
    cameras: Flags


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


class WeekData:
    """The marts of a floor around one week.

    Args:
        warehouse: Opened over the week and the weeks before it that are to be used.
        floor: The floor.
        monday: First day of the week.
    """

    def __init__(self, warehouse: Warehouse, *, floor: Floor, monday: date) -> None:
        self.warehouse, self.floor, self.monday = warehouse, floor, monday
        self.site: Site = warehouse.site
        self.cameras: Sequence[Camera] = [c for c in self.site.cameras if c.floor_id == floor.floor_id]
        self.areas: Sequence[Area] = [a for a in self.site.areas if a.floor_id == floor.floor_id]
        self.ids = [c.camera_id for c in self.cameras]
        self.hours, self.everyone = self._hours()

    @property
    def sunday(self) -> date:
        """Return the last day of the week."""
        return self.monday + timedelta(days=6)

    @cached_property
    def whole(self) -> Place:
        """Return the whole floor, as far as its cameras' violations can be counted; `everyone` is all cameras."""
        able = np.array([c not in self.not_counted for c in self.ids], dtype=np.bool_)
        return Place(self.everyone.n * able[:, None], self.everyone.exposure_h, able)

    @cached_property
    def week_days(self) -> list[date]:
        """Return Monday to Sunday."""
        return [self.monday + timedelta(days=i) for i in range(7)]

    @cached_property
    def history_days(self) -> list[date]:
        """Return the loaded days before the week with counted hours, but for weekdays on which the week is closed."""
        past = (self.hours.day < self.monday.toordinal()) & self.hours.is_counted.any(axis=0)
        open_days = set(self.hours.weekday[self.week() & (self.hours.open_s > 0)].tolist())
        days = np.unique(self.hours.day[past])
        return [date.fromordinal(d) for d in days.tolist() if (d - 1) % 7 in open_days]

    def week(self, monday: date | None = None) -> Flags:
        """Return which hours lie in the week that starts on `monday`; None = this week."""
        first = (monday or self.monday).toordinal()
        return np.asarray((self.hours.day >= first) & (self.hours.day < first + 7))

    def local(self, ms: int) -> datetime:
        """Return an instant (UTC milliseconds) in the site's zone, to the second."""
        return datetime.fromtimestamp(ms // 1000, tz=UTC).astimezone(self.site.zone)

    def midnight(self, day: date) -> datetime:
        """Return the start of a local day."""
        return datetime(day.year, day.month, day.day, tzinfo=self.site.zone)

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
        return self._sums(place, chosen, self.hours.is_counted[:, chosen], days)

    def compared(self, place: Place, *, since: int | None = None) -> tuple[Panel, Panel]:
        """Return the panels of the week before and of this week over the comparable camera-hours that count in both.

        Hours are matched by weekday, local hour and fold, so weeks with a change of the clocks match too.

        Args:
            place: What to compare.
            since: Only hours from this instant on (UTC milliseconds, in this week), and the same of the week before.
        """
        now, then = self._matched
        late = self.hours.start_ms[now] >= (since if since is not None else -np.inf)
        now, then = now[late], then[late]
        both = self.hours.is_counted[:, now] & self.hours.is_counted[:, then] & self.is_comparable[:, None]
        before_days = [d - WEEK for d in self.week_days]
        return self._sums(place, then, both, before_days), self._sums(place, now, both, self.week_days)

    def area(self, area_id: str | None) -> Place:
        """Return what was counted in an area; None is the rest of the floor."""
        k = len(self.areas) if area_id is None else [a.area_id for a in self.areas].index(area_id)
        n, exposure_h, _ = self._by_area
        counts = np.asarray((n[k] + exposure_h[k]).any(axis=1))
        return Place(n[k], exposure_h[k], counts & self.whole.cameras)

    @cached_property
    def violation_h(self) -> Array:
        """Return person-hours in violation in opening hours, shape (n_cameras, n_hours)."""
        return np.asarray(self._by_area[2].sum(axis=0))

    @cached_property
    def not_counted(self) -> Mapping[str, str]:
        """Return the cameras whose violations cannot be counted this week, and why in words."""
        first, last = self._span_ms
        rows = self.warehouse.rows(
            "with people as (select camera_id, sum(person_records + n_doubled)::bigint as n, "
            "sum(n_unlocated)::bigint as n_unlocated from exposure "
            "where quarter * 900000 >= $first and quarter * 900000 < $last group by camera_id), "
            "records as (select camera_id, sum(violation_records)::bigint as n from violation_time "
            "where quarter * 900000 >= $first and quarter * 900000 < $last group by camera_id), "
            "joined as (select camera_id, sum(n_records)::bigint as n from episode_segments "
            "where started_ms >= $first and started_ms < $last group by camera_id) "
            "select cameras.camera_id, coalesce(people.n, 0) as n_persons, "
            "coalesce(people.n_unlocated, 0) as n_unlocated, coalesce(records.n, 0) as n_records, "
            "coalesce(joined.n, 0) as n_joined from cameras left join people using (camera_id) "
            "left join records using (camera_id) left join joined using (camera_id)",
            {"first": first, "last": last},
        )
        found: dict[str, str] = {}
        for row in rows:
            if row["n_joined"] * 2 < row["n_records"]:
                found[row["camera_id"]] = NO_IDS
            elif row["n_unlocated"] * 2 > row["n_persons"] > 0 and not self._sends_pairs(row["camera_id"]):
                found[row["camera_id"]] = NO_FLOOR
        return {c: found[c] for c in self.ids if c in found}

    @cached_property
    def why_no_violations(self) -> str | None:
        """Return why violations cannot be counted on this floor, or None if they can."""
        recorded = np.asarray(self.hours.recorded_s[:, self.week()].any(axis=1))
        able = [c for i, c in enumerate(self.ids) if recorded[i] and c not in self.not_counted]
        return None if able or not self.not_counted else next(iter(self.not_counted.values()))

    @cached_property
    def why_no_exposure(self) -> str | None:
        """Return why person-time is unknown on this floor, or None if it is known."""
        now = self.week()
        is_unknown = self.hours.is_counted[:, now] & ~self.hours.knows_people[:, now]
        return NO_POSITIONS if is_unknown.any() else None

    @cached_property
    def why_no_places(self) -> str | None:
        """Return why violations cannot be placed on the floor, or None if they can."""
        first, last = self._span_ms
        row = self.warehouse.rows(
            "select count(*) as n, count(*) filter (where x_m is null) as n_unplaced from violations "
            "where camera_id in (select unnest($ids)) and started_ms >= $first and started_ms < $last",
            {"ids": self.ids, "first": first, "last": last},
        )[0]
        return NO_POSITIONS if row["n_unplaced"] * 2 > row["n"] else None

    @cached_property
    def recalibrated(self) -> Sequence[Recalibration]:
        """Return the cameras whose facts of this week and the week before were computed under several calibrations."""
        first, end = self.both_weeks_ms
        return recalibrations(self.warehouse, cameras=self.cameras, first_ms=first, end_ms=end)

    @cached_property
    def is_comparable(self) -> Flags:
        """Return which cameras may be compared with the week before, shape (n_cameras,), one at least as of `hours`.

        A new calibration that gives cells of the floor to other cameras changes the counts of all.
        """
        first, end = self.both_weeks_ms
        out = {r.camera_id for r in self.recalibrated}
        if out and has_other_owners(self.warehouse, self.floor, first_ms=first, end_ms=end):
            out = set(self.ids)
        return np.array([c not in out for c in self.ids] or [True], dtype=np.bool_)

    @cached_property
    def both_weeks_ms(self) -> tuple[int, int]:
        """Return the start of the week before and the end of this one, UTC milliseconds."""
        ends = (self.midnight(self.monday - WEEK), self.midnight(self.monday + WEEK))
        return round(ends[0].timestamp() * 1000), round(ends[1].timestamp() * 1000)

    @cached_property
    def _span_ms(self) -> tuple[int, int]:
        ends = (self.midnight(self.monday), self.midnight(self.monday + WEEK))
        return round(ends[0].timestamp() * 1000), round(ends[1].timestamp() * 1000)

    def _sends_pairs(self, camera_id: str) -> bool:
        first, last = self._span_ms
        query = "select 1 from camera_days where camera_id = $id and sends_pairs and utc_day between $first and $last"
        days = {"first": first // DAY_MS, "last": (last - 1) // DAY_MS}
        return bool(self.warehouse.rows(query, {"id": camera_id, **days}))

    def _sums(self, place: Place, chosen: Ints, counted: Flags, days: Sequence[date]) -> Panel:
        """Return sums by day over hours `chosen`, of camera-hours `counted`, shape (n_cameras, n_chosen)."""
        ordinals = np.array([d.toordinal() for d in days], dtype=np.int64)
        of_day = (self.hours.day[chosen, None] == ordinals).astype(np.float64)
        used = counted & place.cameras[:, None]
        return Panel(
            *(
                np.where(used, values[:, chosen], 0.0) @ of_day
                for values in (place.n, self.hours.recorded_s / 3600, place.exposure_h)
            )
        )

    @cached_property
    def _matched(self) -> tuple[Ints, Ints]:
        """Return hours of this week and the same hours of the week before, those that both weeks have."""
        keys = list(zip(self.hours.weekday.tolist(), self.hours.hour.tolist(), self.hours.fold.tolist(), strict=True))
        then = {keys[i]: i for i in np.flatnonzero(self.week(self.monday - WEEK))}
        both = [(i, then[keys[i]]) for i in np.flatnonzero(self.week()) if keys[i] in then]
        now, before = zip(*both, strict=True) if both else ((), ())
        return np.array(now, dtype=np.int64), np.array(before, dtype=np.int64)

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
        camera = positions(rows["camera_id"], self.ids, otherwise=-1)
        hour = np.searchsorted(self.hours.start_ms, rows["hour_start_ms"].to_numpy())

        def cube(name: str) -> Array:
            made = np.zeros((len(self.areas) + 1, *self.everyone.n.shape))
            made[area, camera, hour] = rows[name].to_numpy()
            return made

        return cube("n"), cube("exposure_h"), cube("violation_h")

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

        first = [grid(name)[0] for name in ("hour_start_ms", "local_date", "local_hour", "fold", "open_s")]
        start_ms, day, hour, fold, open_s = first
        recorded_s = grid("recorded_s")
        is_counted = (open_s > 0) & (recorded_s > 0) & (recorded_s >= self.site.settings.partial_hour_share * open_s)
        epoch = date(1970, 1, 1).toordinal()
        hours = Hours(
            start_ms=start_ms.astype(np.int64),
            day=day.astype("datetime64[D]").astype(np.int64) + epoch,
            hour=hour.astype(np.int64),
            fold=fold.astype(np.int64),
            open_s=open_s,
            recorded_s=recorded_s,
            is_counted=is_counted,
            is_inferred=grid("is_inferred"),
            knows_people=grid("knows_people"),
        )
        return hours, Place(grid("n"), grid("exposure_h"), np.ones(len(self.ids), dtype=np.bool_))


def positions(values: pa.ChunkedArray, names: Sequence[str], *, otherwise: int) -> Ints:
    """Return the place of each value in `names`; `otherwise` for what is missing."""
    import pyarrow.compute as pc

    found = pc.index_in(values, value_set=pa.array(names, pa.string()))
    return np.asarray(pc.fill_null(found, otherwise).to_numpy(), dtype=np.int64)
