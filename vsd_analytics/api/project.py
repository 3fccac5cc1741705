"""A project as an analyst opens it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, datetime, timedelta
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from vsd_analytics.api.days import Days
from vsd_analytics.api.table import Table
from vsd_analytics.config.project import find_project, load_site
from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.render.frame import arrow
from vsd_analytics.site.instants import parse_range, parse_week
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

    from vsd_analytics.api.layout_trial import LayoutTrial
    from vsd_analytics.figures.before_after import BeforeAfterFigure
    from vsd_analytics.figures.experiments import ExperimentPlan
    from vsd_analytics.ingest.intake.pipeline import IngestResult

DaysAsked = str | date | tuple[date, date]


def open_project(folder: str | Path = ".") -> OpenProject:
    """Open a project: the folder of a `vsd.toml`, or one below it.

    Args:
        folder: The folder.

    Raises:
        ConfigError: There is no `vsd.toml`, or it has mistakes; all are listed.

    Example:
        >>> import vsd_analytics as vsd
        >>> site = vsd.open("vsd-demo")
        >>> site
        Quayside Market: 4 cameras, 4 areas, stored 2026-11-09 to 2026-11-15
    """
    return OpenProject(load_site(find_project(Path(folder))))


class OpenProject:
    """A site and its stored days.

    Args:
        site: The site as `vsd.toml` describes it.
    """

    def __init__(self, site: Site) -> None:
        self.site = site

    def __repr__(self) -> str:
        extent = stored_extent(self.site)
        stored = "nothing stored yet" if extent is None else f"stored {extent.first_day} to {extent.last_day}"
        n_cameras, n_areas = len(self.site.cameras), len(self.site.areas)
        cameras, areas = (
            f"{n} {noun}{'' if n == 1 else 's'}" for n, noun in ((n_cameras, "camera"), (n_areas, "area"))
        )
        return f"{self.site.name}: {cameras}, {areas}, {stored}"

    def week(self, week: str = "last") -> Days:
        """Return an ISO week: "2026-W46", "last" (the last one with data) or "last-2".

        Raises:
            UsageError: E101, it is no week.
            StoreError: E301, nothing is stored yet.

        Example:
            >>> site.week("2026-W46")
            Quayside Market, 2026-W46: 2026-11-09 to 2026-11-15
        """
        extent = stored_extent(self.site)
        if extent is None:
            fix = "site.ingest(frame), or vsd ingest FILES... in a terminal"
            raise StoreError("nothing is stored yet", code="E301", fix=fix)
        last = extent.last_day - timedelta(days=extent.last_day.weekday())
        try:
            monday = parse_week(week if isinstance(week, str) else "", last=last)
        except UsageError as error:
            fix = f'week("{last:%G-W%V}"), week("last") or week("last-2")'
            raise UsageError(f"{week!r} is not a week", why=error.why, fix=fix) from None
        return Days(self.site, monday, monday + timedelta(days=6), name=f"{monday:%G-W%V}")

    def days(self, first: DaysAsked, last: str | date | None = None) -> Days:
        """Return a range of local days.

        Args:
            first: First day: a date, "2026-11-09", or a whole range "2026-11-09..2026-11-15".
            last: Last day, inclusive; None = only the first, or what `first` names.

        Raises:
            UsageError: E101, they are no days.

        Example:
            >>> site.days("2026-11-09..2026-11-11")
            Quayside Market, 2026-11-09..2026-11-11: 2026-11-09 to 2026-11-11
        """
        begin, end = _range(first if last is None else (_range(first)[0], _range(last)[1]))
        return Days(self.site, begin, end, name=f"{begin}..{end}")

    def compare(
        self, before: DaysAsked, after: DaysAsked, *, floor_id: str | None = None, area_ids: Sequence[str] = ()
    ) -> Table:
        """Return how a floor and its areas changed from one period to another, with intervals and verdicts.

        Args:
            before: Period: a week "2026-W45", a range "2026-11-02..2026-11-08", a day, or first and last date.
            after: The other period.
            floor_id: The floor; None where there is only one.
            area_ids: Areas; none = all, and the rest of the floor.

        Returns:
            A row for the floor, each area and the rest of the floor: `kind`, `area_id` (of areas), `name`, and for
            each of `violations_per_open_h` (M0), `close_time_share` (M6), `close_min_per_open_h`, `people` (M5) and
            `violations_per_person_h` (M7) the level `_before` and `_after`, `_change` (-0.2 = 20 % fewer) and
            `_verdict`. Levels and changes have `_lo`, `_hi`, `_state` and `_reason`. No row where the periods cannot
            be compared; `note` says why.

        Raises:
            UsageError: E101, a period, floor or area is unknown, or the periods have days in common.

        Example:
            >>> changed = site.compare("2026-11-09", "2026-11-10")
            >>> [name for name in changed.columns if name.startswith("close_time_share_change")][:3]
            ['close_time_share_change', 'close_time_share_change_lo', 'close_time_share_change_hi']
        """
        from vsd_analytics.answer import Answers
        from vsd_analytics.figures import compare as figures
        from vsd_analytics.figures.compare_answers import compare_answers

        a, b = _range(before), _range(after)
        with open_warehouse(self.site, *figures.days_needed(self.site, a, b)) as warehouse:
            comparison = figures.compare(warehouse, a, b, floor_id=floor_id, area_ids=area_ids)
            rest = say("reason.row.rest")
            answers = compare_answers(comparison, self.site, rest=rest, inputs=warehouse.inputs_digest)
        places = Answers(answers)["compared_places"]
        title = f"{comparison.floor_name}, {_named(a)} and {_named(b)}"
        return Table(arrow(places), title=title, note=reason_text(places.nothing))

    def forecast(self, week: str = "last", *, floor_id: str | None = None) -> Table:
        """Return what the week after a week is expected to bring, hour by hour (M25).

        Args:
            week: The last week the forecast knows: "2026-W46", "last", "last-2".
            floor_id: The floor; None = the whole site.

        Returns:
            A row for each open hour: `local_date`, `local_hour`, `people` and `violation_rate` with the `_lo` and `_hi`
            of four of five such hours. No row with fewer than four recorded weeks; `note` says so.

        Raises:
            UsageError: E101, it is no week, or there is no such floor.

        Example:
            >>> len(site.forecast())  # one week is too little
            0
        """
        from vsd_analytics.figures import forecast as figures
        from vsd_analytics.figures.forecast_answers import forecast_answers, holds_in_week

        monday = self.week(week).first
        with open_warehouse(self.site, figures.first_day(monday), monday + timedelta(days=6)) as warehouse:
            outlook = figures.forecast(warehouse, monday, floor_id=floor_id)
            holds = holds_in_week(self.site, floor_id, outlook.monday, inputs=warehouse.inputs_digest)
        hours, _ = forecast_answers(outlook, holds)
        return Table(arrow(hours), title=f"Forecast of {outlook.monday:%G-W%V}", note=reason_text(hours.nothing))

    def change(self, number: int, *, area_id: str | None = None, weeks: int = 4) -> BeforeAfterFigure:
        """Return what a change of the log did to its area, beside areas that were left alone (M27).

        Args:
            number: The entry's place in the log, from 1: row `number - 1` of `changes`.
            area_id: The area to look at; None = the entry's.
            weeks: Whole weeks to look at on either side, at most.

        Returns:
            `state` and `reason` say whether there is an answer. `burden` is the effect on person-time in violation per
            open hour: `theta` (0.8 = 20 % less) with its 95 % interval `lo`, `hi`; `running` is the verdict that may be
            read every week, `floor` what became of the whole floor.

        Raises:
            UsageError: E101, there is no such entry or area, or the entry names none; or `weeks` is no number from 1.

        Example:
            >>> site.change(1).state  # one week is too little
            'not_enough_data'
        """
        weeks = _whole_weeks("weeks", weeks)
        from vsd_analytics.figures import before_after
        from vsd_analytics.figures.change_weeks import days_needed

        with open_warehouse(self.site, *days_needed(self.site, number, weeks=weeks)) as warehouse:
            return before_after.before_after(warehouse, number, area_id=area_id, weeks=weeks)

    def plan(self, area_id: str, *, effect: float, power: float = 0.8, weeks_max: int = 26) -> ExperimentPlan:
        """Return how many weeks a change of an area must be watched until an effect is clear; stores nothing.

        Args:
            area_id: The area to be changed.
            effect: Effect looked for, a share: -0.15 = 15 % less time too close per open hour. Not 0.
            power: Chance of a clear verdict, a share.
            weeks_max: Weeks after the change one is ready to wait.

        Returns:
            `state` and `reason` say whether there is a plan; `choices[0].weeks_after` are the weeks after the change if
            it is made now, None where `weeks_max` is too few; `comparison` are the areas that serve for comparison.

        Raises:
            UsageError: E101, there is no such area, effect or power is no share, or `weeks_max` is no number from 1.

        Example:
            >>> site.plan("checkout-queue", effect=-0.2).state  # needs four weeks before the change
            'not_enough_data'
        """
        from vsd_analytics.figures.experiments import check_plan, plan_days, plan_experiment

        for name, value in (("effect", effect), ("power", power)):
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise UsageError(f"{name} {value!r} is no number", fix="effect=-0.15 is 15 % less")
        check_plan(effect=effect, power=power)
        weeks_max = _whole_weeks("weeks_max", weeks_max)
        with open_warehouse(self.site, *plan_days(self.site)) as warehouse:
            return plan_experiment(warehouse, area_id, effect=effect, power=power, weeks_max=weeks_max)

    def try_layout(self, days: DaysAsked) -> LayoutTrial:
        """Return a trial of layouts: what edits would do to the people recorded on some days, before anything is moved.

        Args:
            days: A week "2026-W45", a range "2026-11-02..2026-11-08", a day, or first and last date.

        Raises:
            UsageError: E101, they are no days.

        Example:
            >>> trial = site.try_layout("2026-11-14")
            >>> trial
            Quayside Market: a layout tried on 2026-11-14 to 2026-11-14
        """
        from vsd_analytics.api.layout_trial import LayoutTrial

        return LayoutTrial(self.site, *_range(days))

    @property
    def changes(self) -> Table:
        """Return the change log: `number`, `at`, `text`, `area_id`.

        Example:
            >>> site.changes.columns
            ['number', 'at', 'text', 'area_id']
        """
        from vsd_analytics.api.figure_tables import change_table

        return change_table(self.site)

    def ingest(
        self,
        frame: pd.DataFrame | pl.DataFrame | pa.Table | Table,
        *,
        camera: str | None = None,
        clock: str | None = None,
        name: str = "frame",
        now: datetime | None = None,
    ) -> IngestResult:
        """Store the records of a frame in memory, with the checks of `vsd ingest` on a file with these columns.

        Args:
            frame: Columns of the table format: `ts`, `camera_id`, `track_id`, `x_m`, `y_m` or `u_px`, `v_px`; for pairs
                `track_a`, `track_b`, `distance_m`.
            camera: Camera of all rows, where there is no column for it.
            clock: Zone of times without one.
            name: What messages and the list of imports call it.
            now: The clock: later records are quarantined; None = the present.

        Returns:
            `sources[0].n_records` are the records stored by table, `n_rejected` those in quarantine; the same frame
            again stores nothing.

        Raises:
            InputError: E2xx, the frame cannot be read, or would almost surely be read wrongly: nothing is stored.
            UsageError: E101, it is no frame, or there is no such camera.

        Example:
            >>> site.ingest(frame, camera="cam-1").sources[0].n_records  # doctest: +SKIP
            Counter({'observations': 1200, 'frames': 600})
        """
        from vsd_analytics.api.ingest_frame import ingest_frame

        return ingest_frame(self.site, frame, camera=camera, clock=clock, name=name, now=now)


def _range(asked: DaysAsked) -> tuple[date, date]:
    if isinstance(asked, str):
        return parse_range(asked)
    first, last = asked if isinstance(asked, tuple) and len(asked) == len(("first", "last")) else (asked, asked)
    if not (isinstance(first, date) and isinstance(last, date)):
        fix = '"2026-11-09", "2026-11-09..2026-11-15", a date, or a tuple of first and last date'
        raise UsageError(f"{asked!r} is no day or range of days", fix=fix)
    first, last = (d.date() if isinstance(d, datetime) else d for d in (first, last))
    if first > last:
        raise UsageError(f"{first} is after {last}", fix="name the first day first")
    return first, last


def _named(days: tuple[date, date]) -> str:
    return f"{days[0]}..{days[1]}"


def _whole_weeks(name: str, weeks: object) -> int:
    """Return a number of weeks, of Python or numpy; raise UsageError when it is none from 1."""
    if isinstance(weeks, bool) or not isinstance(weeks, Integral) or weeks < 1:
        raise UsageError(f"{name} {weeks!r} is no whole number of weeks from 1", fix=f"{name}=4")
    return int(weeks)
