"""Some days of a project: their hours, areas, cells, violations, hotspots, coverage, maps and own queries."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import date
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import pandas as pd
import pyarrow as pa

from vsd_analytics.api.heatmap import Heatmap, as_heatmap
from vsd_analytics.api.table import Table
from vsd_analytics.errors import UsageError
from vsd_analytics.settings import BY_NAME
from vsd_analytics.site.model import Area, Floor, Site
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.answer import Answer
    from vsd_analytics.api.trajectories import TrackTable
    from vsd_analytics.figures.periods import Period

MapKind = Literal["exposure", "burden", "risk", "excess"]
T = TypeVar("T")

_HOURS = (
    "select make_timestamptz(hour_start_ms * 1000) as start, local_date, weekday, local_hour, state, open_s, "
    "recorded_s, recorded_share, cameras_down, person_records, exposure_s, violation_s, n_violations from hours "
    "order by hour_start_ms"
)
_CELLS = (
    "select floor_id, (cx + 0.5)::double as x_m, (cy + 0.5)::double as y_m, exposure_s, violation_s from heatmap "
    "order by floor_id, cy, cx"
)
_VIOLATIONS = (
    "select make_timestamptz(started_ms * 1000) as started, duration_s, camera_id, area_id, x_m, y_m, min_distance_m, "
    "track_a, track_b, is_open from violations order by started_ms, camera_id, track_a, track_b"
)
_COVERAGE = (
    "select camera_id, local_date, sum(open_s) / 3600 as open_h, sum(recorded_open_s) / 3600 as recorded_h "
    "from camera_hours group by all order by camera_id, local_date"
)
_HOTSPOTS = pa.schema(
    [("floor_id", pa.string()), ("number", pa.int64()), ("area_id", pa.string())]
    + [(name, pa.float64()) for name in ("x_m", "y_m", "ratio", "ratio_lo", "ratio_hi", "excess_min_per_week")]
    + [("n_violations", pa.int64()), ("state", pa.string()), ("since", pa.date32())]
)
"""Columns of `hotspots`, which a table without rows has too."""


class Days:
    """A week or a range of local days. Each table is computed when it is first asked for, and then held.

    No file of the store is locked between two questions: an open notebook makes nobody wait.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        name: For printing.
    """

    def __init__(self, site: Site, first: date, last: date, *, name: str) -> None:
        self.site = site
        self.first = first
        self.last = last
        self.name = name

    def __repr__(self) -> str:
        return f"{self.site.name}, {self.name}: {self.first} to {self.last}"

    def at(self, **settings: float) -> Days:
        """Return the same days with other settings, such as `distance_m=1.0`; what is stored of others stays.

        Args:
            **settings: Settings of `docs/settings.md`, in their units.

        Raises:
            UsageError: E101, there is no such setting, its value is out of range, or `distance_m` is over `pair_max_m`.

        Example:
            >>> site.week("2026-W46").at(distance_m=1.0).hours.df()  # doctest: +SKIP
        """
        for name, value in settings.items():
            _check_setting(name, value)
        site = self.site.with_settings(**settings)
        if site.settings.pair_max_m < site.settings.distance_m:
            raise UsageError(
                f"distance_m = {site.settings.distance_m:g} is more than pair_max_m = {site.settings.pair_max_m:g}",
                why="pairs farther apart than pair_max_m are not stored, so violations would be lost",
                fix=f"give pair_max_m={site.settings.distance_m + 0.5:g} too",
            )
        shown = ", ".join(f"{name} = {value:g}" for name, value in settings.items())
        return Days(site, self.first, self.last, name=f"{self.name} at {shown}")

    def _repr_html_(self) -> str:
        """Return what was recorded, for a notebook: a strip of hours for each camera and day, as in the report."""
        from vsd_analytics.api.recorded_strips import recorded_html

        with self._warehouse() as warehouse:
            return recorded_html(warehouse, title=repr(self))

    @cached_property
    def hours(self) -> Table:
        """Return one row for each local hour: `start`, `state`, counts, person-seconds; null without data.

        Columns as in `sql/marts/hours.sql`; `start` is an instant in the site's time zone.

        Example:
            >>> week.hours.df()["state"].iloc[10]
            'full'
        """
        return self._query(_HOURS, "Hours")

    @cached_property
    def violations(self) -> Table:
        """Return one row for each violation: `started`, `duration_s`, place, area, closest distance, both tracks.

        Example:
            >>> bool((week.violations.df()["duration_s"] >= 3).all())
            True
        """
        return self._query(_VIOLATIONS, "Violations")

    @cached_property
    def cells(self) -> Table:
        """Return one row for each cell of 1 m in which anybody was: its middle, person-seconds, those too close.

        Example:
            >>> week.cells.columns
            ['floor_id', 'x_m', 'y_m', 'exposure_s', 'violation_s']
        """
        return self._query(_CELLS, "Cells of 1 m")

    @cached_property
    def coverage(self) -> Table:
        """Return one row for each camera and day: open hours, and how many of them it recorded.

        Example:
            >>> len(week.coverage)  # four cameras on seven days
            28
        """
        return self._query(_COVERAGE, "Coverage")

    @cached_property
    def areas(self) -> Table:
        """Return one row for each floor, area and rest of a floor, with intervals.

        Columns: `floor_id`, `kind` (floor, area or rest), `area_id`, `name`; violations per open hour (M0) and share of
        person-time too close (M6) as `violations_per_open_h`, `close_time_share`, each with `_lo`, `_hi`, `_state` and
        `_reason`.

        Example:
            >>> week.areas.df()["kind"].tolist()
            ['floor', 'area', 'area', 'area', 'area', 'rest']
        """
        from vsd_analytics.figures import close_time, compare, rates
        from vsd_analytics.figures.panels import FloorHours
        from vsd_analytics.figures.periods import Period

        rows: list[dict[str, Any]] = []
        with self._warehouse(*compare.days_needed(self.site, (self.first, self.last))) as warehouse:
            for floor in self.site.floors:
                data = FloorHours(warehouse, floor=floor)
                period = Period(data, self.first, self.last)
                places: list[Floor | Area | None] = [floor]
                if period.why_no_places is None and data.areas:
                    places += [*data.areas, None]
                for where in places:
                    is_floor = isinstance(where, Floor)
                    area_id = where.area_id if isinstance(where, Area) else None
                    violation_rate = rates.violation_rate_level(
                        period, period.whole if is_floor else period.area(area_id)
                    )
                    close = close_time.close_time_share(period, close_time.close_time(period, where))
                    rows.append(
                        {
                            "floor_id": floor.floor_id,
                            "kind": "floor" if is_floor else "area" if where is not None else "rest",
                            "area_id": area_id,
                            "name": "Rest of the floor" if where is None else where.name,
                            **_estimate("violations_per_open_h", violation_rate),
                            **_estimate("close_time_share", close),
                        }
                    )
        return Table(pa.Table.from_pylist(rows), title=f"Areas, {self.name}")

    @cached_property
    def visits(self) -> Table:
        """Return visits per open hour (M35) and dwell times (M36), a row for each area with `visits = true`.

        Example:
            >>> print(week.visits.note)
            no area has visits = true in vsd.toml
        """
        from vsd_analytics.figures.visits import visits

        return self._answer("visits", lambda period: (visits(period),))

    @cached_property
    def flow(self) -> Table:
        """Return where people go next (M37), a row for each area with `visits = true` and each next area.

        Example:
            >>> print(week.flow.note)
            no area has visits = true in vsd.toml
        """
        from vsd_analytics.figures.flow_answers import flow_answers

        return self._answer("flow", flow_answers)

    @cached_property
    def flow_links(self) -> Table:
        """Return estimated links over floor where nobody is followed; they are in no share of `flow`."""
        from vsd_analytics.figures.flow_answers import flow_answers

        return self._answer("flow_links", flow_answers)

    @cached_property
    def queues(self) -> Table:
        """Return people waiting (M39) and waiting times (M40), a row for each area with `queue = true`.

        Example:
            >>> print(week.queues.note)
            no area has queue = true in vsd.toml
        """
        from vsd_analytics.figures.queues import queues

        return self._answer("queues", queues)

    @cached_property
    def queue_hours(self) -> Table:
        """Return people waiting and waiting times by hour of the day, a row for each queue and hour."""
        from vsd_analytics.figures.queues import queues

        return self._answer("queue_hours", queues)

    @cached_property
    def capacity(self) -> Table:
        """Return how full areas and floors with a `capacity` were (M41), a row for each.

        Example:
            >>> print(week.capacity.note)
            no area or floor has a capacity in vsd.toml
        """
        from vsd_analytics.figures.capacities import capacity

        return self._answer("capacity", lambda period: (capacity(period),))

    @cached_property
    def hotspots(self) -> Table:
        """Return the hotspots of the 28 days that end with these days: where time too close exceeds the crowd's share.

        Columns: `floor_id`, `number`, `area_id`, `x_m`, `y_m`, `ratio` with `ratio_lo` and `ratio_hi`,
        `excess_min_per_week`, `n_violations`, `state`, `since`.

        Example:
            >>> print(week.hotspots.note)
            Ground floor: 7 of the 28 days were recorded ... hotspots need 14
        """
        from vsd_analytics.figures import hotspots as figures

        rows: list[dict[str, Any]] = []
        notes = []
        with self._warehouse(*figures.days_needed(self.site, self.last)) as warehouse:
            for floor in self.site.floors:
                found = figures.hotspots(warehouse, floor_id=floor.floor_id, until=self.last)
                if found.state != "ok":
                    notes.append(f"{floor.name}: {reason_text(found.reason)}")
                rows += [
                    {
                        "floor_id": floor.floor_id,
                        "number": spot.number,
                        "area_id": spot.place.area_id,
                        "x_m": spot.place.x_m,
                        "y_m": spot.place.y_m,
                        "ratio": spot.ratio,
                        "ratio_lo": spot.lo,
                        "ratio_hi": spot.hi,
                        "excess_min_per_week": spot.excess_min_per_week,
                        "n_violations": spot.n,
                        "state": spot.state,
                        "since": spot.since,
                    }
                    for spot in found.spots
                ]
        found_rows = pa.Table.from_pylist(rows, schema=_HOTSPOTS)
        return Table(found_rows, title=f"Hotspots until {self.last}", note="; ".join(notes))

    def heatmap(self, kind: MapKind = "burden", *, floor_id: str | None = None, cell_m: float = 0.5) -> Heatmap:
        """Return a map of a floor as an array.

        Args:
            kind: exposure (where people are, M16), burden (time too close, M17), risk (its share of the time people
                spend there, M18) or excess (that share over what the crowd explains, M19).
            floor_id: The floor; None where there is only one.
            cell_m: Side of a cell, a multiple of 0.25 m.

        Raises:
            UsageError: E101, there is no such map or floor.

        Example:
            >>> week.heatmap("exposure", cell_m=1.0).array.shape
            (16, 23)
        """
        from vsd_analytics.figures import maps
        from vsd_analytics.site.places import known_floor

        made: dict[str, Callable[..., maps.CellMap]] = {
            "exposure": maps.exposure_map,
            "burden": maps.burden_map,
            "risk": maps.risk_map,
            "excess": maps.excess_map,
        }
        if kind not in made:
            raise UsageError(f"there is no map of {kind!r}", why=f"the maps are {', '.join(made)}")
        floor = known_floor(self.site, floor_id)
        with self._warehouse() as warehouse:
            found = made[kind](warehouse, floor=floor, cell_m=cell_m)
        return as_heatmap(kind, found, floor=floor, site=self.site, until=self.last)

    def trajectories(self, camera_id: str | None = None) -> TrackTable:
        """Return the stored tracks of a camera in metres, in the columns that PedPy and movingpandas read.

        These are personal data: a path says more about a person than a count.

        Args:
            camera_id: The camera; None where there is only one.

        Raises:
            UsageError: E101, there is no such camera.

        Example:
            >>> walks = site.days("2026-11-09").trajectories("cam-1")
            >>> walks.frame_rate_hz == site.site.cameras[0].hz
            True
        """
        from vsd_analytics.api.trajectories import trajectories

        return trajectories(self.site, camera_id, first=self.first, last=self.last)

    def sql(self, query: str, **tables: pd.DataFrame | pa.Table | Table) -> Table:
        """Return the rows of one `select` over the relations of `sql/` and your own tables.

        Args:
            query: The query; nothing can be written.
            **tables: Your tables, by the name that the query uses.

        Raises:
            UsageError: E101, a table has the name of a relation.
            SqlError: E603, the query fails.

        Example:
            >>> tills = pd.DataFrame({"local_hour": [10, 11], "sales": [5, 7]})
            >>> len(week.sql("select local_date, sales from hours join tills using (local_hour)", tills=tills))
            14
        """
        from vsd_analytics.warehouse.analyst_query import run_query
        from vsd_analytics.warehouse.sqlfiles import relations

        taken = {*relations("facts"), *relations("marts"), *relations("staging")}
        for name in tables:
            if name in taken or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
                raise UsageError(f"{name!r} cannot be the name of a table of yours", why="a relation has this name")
        with self._warehouse() as warehouse:
            for name, rows in tables.items():
                warehouse.con.register(name, rows.arrow() if isinstance(rows, Table) else rows)
            frame = run_query(warehouse, query)
        return Table(pa.Table.from_pandas(frame, preserve_index=False), title="Query")

    def _answer(self, name: str, answers: Callable[[Period], Sequence[Answer]]) -> Table:
        from vsd_analytics.api.space_use import answer_table

        title = f"{name.replace('_', ' ').capitalize()}, {self.name}"
        return answer_table(self.site, (self.first, self.last), self._warehouse, answers, name=name, title=title)

    def _query(self, query: str, title: str) -> Table:
        with self._warehouse() as warehouse:
            rows = warehouse.table(query)
        return Table(_in_zone(rows, self.site.timezone), title=f"{title}, {self.name}")

    @contextmanager
    def _warehouse(self, first: date | None = None, last: date | None = None) -> Iterator[Warehouse]:
        with open_warehouse(self.site, first or self.first, last or self.last) as warehouse:
            yield warehouse


def _check_setting(name: str, value: float) -> None:
    setting = BY_NAME.get(name)
    if setting is None or setting.minimum is None or setting.maximum is None or not setting.is_in_sql:
        known = ", ".join(s.name for s in BY_NAME.values() if s.is_in_sql and s.minimum is not None)
        raise UsageError(f"{name} is no setting of figures", why=f"these are {known}")
    if not setting.minimum <= value <= setting.maximum:
        allowed = f"{setting.minimum:g} and {setting.maximum:g} {setting.unit}".strip()
        raise UsageError(f"{name} = {value:g} is not between {allowed}")


def _in_zone(rows: pa.Table, timezone: str) -> pa.Table:
    """Return the rows with their instants in the site's time zone."""
    for i, column in enumerate(rows.schema):
        if pa.types.is_timestamp(column.type) and column.type.tz is not None:
            rows = rows.set_column(i, column.name, rows[i].cast(pa.timestamp("ms", tz=timezone)))
    return rows


def _estimate(name: str, found: RateEstimate) -> dict[str, Any]:
    return {
        name: found.value,
        f"{name}_lo": found.lo,
        f"{name}_hi": found.hi,
        f"{name}_state": found.state,
        f"{name}_reason": reason_text(found.reason) or None,
    }
