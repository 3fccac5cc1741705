"""Some days of a project: its tables for analysts, maps and own queries."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Literal

import pandas as pd
import pyarrow as pa

from vsd_analytics.api.asked_days import AskedDays
from vsd_analytics.api.heatmap import Heatmap, heatmap_of
from vsd_analytics.api.settings_asked import site_with
from vsd_analytics.api.table import Table

if TYPE_CHECKING:
    from vsd_analytics.api.tracks import TrackTable

MapKind = Literal["exposure", "burden", "risk", "excess"]
ContextFigures = Literal["context_change", "context_conversion", "context_value"]


class Days(AskedDays):
    """A week or a range of local days. Each table is computed when it is first asked for, and then held.

    No file of the store is locked between two questions: an open notebook makes nobody wait.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        name: For printing.
    """

    def at(self, **settings: float | str) -> Days:
        """Return the same days with other settings, such as `distance_m=1.0`; what is stored of others stays.

        Numbers of violations at different distances do not compare: a short distance cuts one meeting into several.
        Compare `violation_s`, which falls with the distance as it must.

        Args:
            **settings: Settings of `docs/settings.md`, in their units.

        Raises:
            UsageError: E101, there is no such setting, its value is out of range, or `distance_m` is over `pair_max_m`.

        Example:
            >>> site.week("2026-W46").at(distance_m=1.0).hours.df()  # doctest: +SKIP
        """
        site = site_with(self.site, settings)
        shown = ", ".join(f"{k} = {v if isinstance(v, str) else f'{v:g}'}" for k, v in settings.items())
        return Days(site, self.first, self.last, name=f"{self.name} at {shown}")

    def _repr_html_(self) -> str:
        """Return what was recorded, for a notebook: a strip of hours for each camera and day, as in the report."""
        from vsd_analytics.api.notebook_html import recorded_html

        with self._warehouse() as warehouse:
            return recorded_html(warehouse, title=repr(self))

    @cached_property
    def hours(self) -> Table:
        """Return one row for each local hour, over all cameras, also without data; columns: `sql/tables/hours.sql`.

        Example:
            >>> week.hours["state"][10]
            'full'
        """
        return self._table("hours")

    @cached_property
    def quarter_hours(self) -> Table:
        """Return one row for each quarter-hour, over all cameras; columns as in `sql/tables/quarter_hours.sql`.

        Example:
            >>> week.quarter_hours.total("n_violations") == week.hours.total("n_violations")
            True
        """
        return self._table("quarter_hours")

    @cached_property
    def area_hours(self) -> Table:
        """Return one row for each area and local hour, and for the rest of each floor; quiet hours are 0, not missing.

        Columns as in `sql/tables/area_hours.sql`.

        Example:
            >>> week.area_hours.total("n_violations_open") == week.hours.total("n_violations_open")
            True
        """
        return self._table("area_hours")

    @cached_property
    def camera_hours(self) -> Table:
        """Return one row for each camera and local hour; columns as in `sql/tables/camera_hours.sql`.

        Violations of the weekly page are those of the camera-hours that enter rates:

        Example:
            >>> page = week.camera_hours.df().query("is_in_rates")["n_violations_open"].sum()
            >>> bool(page < week.hours.total("n_violations_open"))
            True
        """
        return self._table("camera_hours")

    @cached_property
    def days(self) -> Table:
        """Return one row for each local day, over all cameras; columns as in `sql/tables/days.sql`.

        Example:
            >>> week.days["state"][0]
            'full'
        """
        return self._table("days")

    @cached_property
    def violations(self) -> Table:
        """Return one row for each violation: `started`, `duration_s`, place, area, closest distance, both tracks.

        Columns as in `sql/tables/violations.sql`.

        Example:
            >>> min(week.violations["duration_s"]) >= 3
            True
        """
        return self._table("violations")

    @cached_property
    def episodes(self) -> Table:
        """Return one row for each time two people were closer than the legal distance, however short.

        Columns as in `sql/tables/episodes.sql`.

        Example:
            >>> len(week.episodes) > len(week.violations)
            True
        """
        return self._table("episodes")

    @cached_property
    def cells(self) -> Table:
        """Return one row for each cell of 1 m in which anybody was: its middle, person-seconds, those too close.

        Columns as in `sql/tables/cells.sql`.

        Example:
            >>> week.cells.columns
            ['floor_id', 'x_m', 'y_m', 'exposure_s', 'violation_s', 'recorded_s']
        """
        return self._table("cells")

    @cached_property
    def trajectories(self) -> Table:
        """Return one row for each person record with a place, where views overlap of the camera that counts the place.

        Columns as in `sql/tables/trajectories.sql`. These are personal data: a path says more about a person than a
        count.

        Example:
            >>> len(week.trajectories) == week.hours.total("person_records")
            True
        """
        return self._table("trajectories")

    @cached_property
    def changes(self) -> Table:
        """Return the entries of the change log of these days: `number` in the log, `at`, `text`, `area_id`.

        Example:
            >>> week.changes.columns
            ['number', 'at', 'text', 'area_id']
        """
        from vsd_analytics.api.figure_tables import change_table

        return change_table(self.site, self.first, self.last)

    @cached_property
    def context(self) -> Table:
        """Return what was added with `vsd context add`, by local hour: `name`, `start`, `value`; null is unknown.

        Example:
            >>> len(week.context)  # nothing was added
            0
        """
        from vsd_analytics.api.context_tables import context_table

        return context_table(self.site, self.first, self.last, per="hour")

    @cached_property
    def context_days(self) -> Table:
        """Return what was added with `vsd context add`, by local day: `name`, `local_date`, `value`.

        Example:
            >>> "value" in week.context_days
            True
        """
        from vsd_analytics.api.context_tables import context_table

        return context_table(self.site, self.first, self.last, per="day")

    def context_figures(self, name: ContextFigures = "context_change") -> Table:
        """Return figures of a week made with the series of `vsd context add`, a row for each floor and series.

        Args:
            name: context_change (violations at an equal value, M52), context_conversion or context_value (M50, M51).

        Example:
            >>> print(week.context_figures().note)
            no series was added that concerns this floor; vsd context add adds one
        """
        from vsd_analytics.api.figure_tables import context_figure_table

        return context_figure_table(self.site, self.first, self.last, name=name)

    @cached_property
    def coverage(self) -> Table:
        """Return one row for each camera and day: open hours, and how many of them it recorded.

        Example:
            >>> len(week.coverage)  # four cameras on seven days
            28
        """
        from vsd_analytics.figures.operator_counts import camera_days

        with self._warehouse() as warehouse:
            rows = camera_days(warehouse)
        return Table(rows, title=f"Coverage, {self.name}")

    @cached_property
    def areas(self) -> Table:
        """Return one row for each floor, area and rest of a floor, with intervals.

        Columns: `floor_id`, `kind` (floor, area, rest), `area_id` (rest for the rest), `name`;
        `violations_per_open_h` (M0), `close_time_share` (M6), `close_min_per_open_h`, `people` (M5); `floor_m2` to walk
        on, and by it (M54) `violations_per_open_h_100_m2`, `people_per_m2`. Numbers have `_lo`, `_hi`, `_state`,
        `_reason`.

        Example:
            >>> week.areas.df()["kind"].tolist()
            ['floor', 'area', 'area', 'area', 'area', 'rest']
        """
        from vsd_analytics.api.figure_tables import area_table

        return area_table(self.site, self.first, self.last, title=f"Areas, {self.name}")

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
        """Return estimated links over floor where nobody is followed; they are in no share of `flow`.

        Example:
            >>> print(week.flow_links.note)
            no area has visits = true in vsd.toml
        """
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
        """Return people waiting and waiting times by hour of the day, a row for each queue and hour.

        Example:
            >>> print(week.queue_hours.note)
            no area has queue = true in vsd.toml
        """
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
    def lines(self) -> Table:
        """Return who crossed counting lines in either direction (M57), a row for each `[[line]]`.

        Example:
            >>> print(week.lines.note)
            no [[line]] is drawn in vsd.toml
        """
        from vsd_analytics.figures.lines import line_answers

        return self._answer("lines", line_answers)

    @cached_property
    def line_counts(self) -> Table:
        """Return one row for each counting line and quarter-hour; columns as in `sql/tables/line_counts.sql`.

        Example:
            >>> len(week.line_counts)  # no [[line]] is drawn
            0
        """
        return self._table("line_counts")

    @cached_property
    def footfall(self) -> Table:
        """Return how many people crossed each `[[line]]` in a week, beside its usual range and a year before (M60).

        A row for each line, as in the JSON file of the report and on the page of `vsd lines --page`. Columns: `n_open`,
        `per_open_h`, `usual_lo`, `usual_hi`, `change_week`, `change_year` and others. Numbers have `_state`, `_reason`.

        Example:
            >>> print(week.footfall.note)
            no [[line]] is drawn in vsd.toml
        """
        return self._footfall("footfall")

    @cached_property
    def footfall_weeks(self) -> Table:
        """Return the footfall of each `[[line]]` in the week and up to twelve weeks before it, oldest first.

        Example:
            >>> len(week.footfall_weeks)  # no [[line]] is drawn
            0
        """
        return self._footfall("footfall_weeks")

    @cached_property
    def footfall_next(self) -> Table:
        """Return the crossings of each `[[line]]` that are expected on each day of the week after.

        Example:
            >>> len(week.footfall_next)  # no [[line]] is drawn
            0
        """
        return self._footfall("footfall_next")

    @cached_property
    def hotspots(self) -> Table:
        """Return the hotspots of the 28 days that end with these days: where time too close exceeds the crowd's share.

        Columns: `floor_id`, `spot_id`, `rank`, `change` (new or persisting), `since`, `area_id`, `x_m`, `y_m` (mean of
        its cells), `peak_x_m`, `peak_y_m` (the cell with the most), `excess_ratio` and `excess_min_per_week` with `_lo`
        and `_hi`, `n_violations`, and others of `vsd hotspots`.

        Example:
            >>> print(week.hotspots.note)
            Ground floor: 7 of the 28 days were recorded ... hotspots need 14
        """
        from vsd_analytics.api.figure_tables import hotspot_table

        return hotspot_table(self.site, self.last)

    def heatmap(self, kind: MapKind = "burden", *, floor_id: str | None = None, cell_m: float = 0.5) -> Heatmap:
        """Return a map of a floor as an array.

        Args:
            kind: exposure (where people are, M16), burden (time too close, M17), risk (its share of the time people
                spend there, M18) or excess (that share over what the crowd explains, M19).
            floor_id: The floor; None where there is only one.
            cell_m: Side of a cell, a multiple of 0.25 m.

        Raises:
            UsageError: E101, there is no such map, floor or side.

        Example:
            >>> week.heatmap("exposure", cell_m=1.0).array.shape
            (16, 23)
        """
        return heatmap_of(self.site, (self.first, self.last), kind, floor_id=floor_id, cell_m=cell_m)

    def tracks(self, camera_id: str | None = None) -> TrackTable:
        """Return all stored tracks of one camera in metres, in the columns that PedPy and movingpandas read.

        Tracks are whole, also where another camera counts: add no two cameras up, `trajectories` is for that. These are
        personal data: a path says more about a person than a count.

        Args:
            camera_id: The camera; None where there is only one.

        Raises:
            UsageError: E101, there is no such camera.

        Example:
            >>> walks = site.days("2026-11-09").tracks("cam-1")
            >>> walks.frame_rate_hz == site.site.cameras[0].hz
            True
        """
        from vsd_analytics.api.tracks import tracks

        return tracks(self.site, camera_id, first=self.first, last=self.last)

    def sql(self, query: str, **tables: pd.DataFrame | pa.Table | Table) -> Table:
        """Return the rows of one `select` over the tables of these days and your own.

        `hours`, `area_hours` and the others are called as here; what lies behind them is `internal.located` and so on.
        Instants without a zone are read in the site's zone where they meet one of a table.

        Args:
            query: The query; nothing can be written.
            **tables: Your tables, by the name that the query uses.

        Raises:
            UsageError: E101, a table of yours has the name of one of these, or is no table.
            SqlError: E603, the query fails.

        Example:
            >>> tills = pd.DataFrame({"local_hour": [10, 11], "sales": [5, 7]})
            >>> len(week.sql("select local_date, sales from hours join tills using (local_hour)", tills=tills))
            14
        """
        return self._query(query, tables)
