"""Which days, records and cameras a command means, as people type them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import date, timedelta
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.output import facts_progress, render_error
from vsd_analytics.cli.project import Project
from vsd_analytics.errors import StoreError, UsageError, VsdError
from vsd_analytics.site.cameras_by_name import nearest_camera_id
from vsd_analytics.site.instants import instant, parse_range, parse_week

if TYPE_CHECKING:
    from vsd_analytics.figures.periods import Period
    from vsd_analytics.site.model import Floor
    from vsd_analytics.warehouse.warehouse import Warehouse


def resolve(project: Project, *, week: str | None, days: str | None) -> tuple[date, date]:
    """Return first and last local day of what the user asked for.

    Raises:
        StoreError: E301, nothing is stored and no range was given.
    """
    from vsd_analytics.warehouse.stored_days import stored_extent

    if week is not None:
        monday = parse_week(week, last=last_monday(project))
        return monday, monday + timedelta(days=6)
    if days is not None:
        return parse_range(days)
    extent = stored_extent(project.site)
    if extent is None:
        raise nothing_stored(project)
    return extent.first_day, extent.last_day


def shared_days(project: Project, *, week: str | None, days: str | None) -> tuple[date, date]:
    """Return first and last day of what the user asked for and may share; by default the last week that is over.

    Raises:
        UsageError: E105, they are no week that is over, and `--exact` was not given.
        StoreError: E301, nothing is stored and no range was given.
    """
    from vsd_analytics.figures.share.counts import mask_of
    from vsd_analytics.figures.share.periods import check_days

    if week is None and days is None and mask_of(project.site).is_on:
        week = "last"
    first, last = resolve(project, week=week, days=days)
    check_days(project.site, first, last, clock=project.now)
    return first, last


def last_monday(project: Project) -> date:
    """Return the Monday that `--week last` means: of the last whole week before the clock, but not after the data."""
    from vsd_analytics.warehouse.stored_days import stored_extent

    today = project.now.astimezone(project.site.zone).date()
    whole = today - timedelta(days=today.weekday() + 7)
    extent = stored_extent(project.site)
    if extent is None:
        return whole
    stored = extent.last_day - timedelta(days=extent.last_day.weekday())
    return min(whole, stored)


def whole_week(last: date) -> date:
    """Return the Monday of the last week that is over on a day, that day included."""
    return last - timedelta(days=(last.weekday() + 1) % 7 + 6)


def nothing_stored(project: Project) -> StoreError:
    """Return the error of an empty store."""
    return StoreError(
        "nothing is stored yet",
        code="E301",
        why=f"the store of site {project.site.site_id!r} holds no records",
        fix="vsd ingest FILES...",
    )


@contextmanager
def warehouse_of(project: Project, *, week: str | None, days: str | None, **options: Any) -> Iterator[Warehouse]:
    """Open the warehouse of a range with a progress bar over what must be computed first."""
    from vsd_analytics.store.stretches import FAR_OFF_FIX
    from vsd_analytics.warehouse.warehouse import open_warehouse

    first, last = resolve(project, week=week, days=days)
    if week is None and days is None:  # everything stored, and no more
        options["spare_days"] = 0
    with facts_progress(quiet=project.quiet) as (on_plan, on_hours):
        warehouse = open_warehouse(project.site, first, last, on_plan=on_plan, on_hours=on_hours, **options)
    with warehouse:
        for note in warehouse.left_out():
            project.say(render_error(VsdError(note, code="W311", fix=FAR_OFF_FIX), word="warning"))
        yield warehouse


def purged_hours_notes(warehouse: Warehouse) -> list[str]:
    """Return what a reader must know about figures of purged hours."""
    return [run.warning(warehouse.site) for run in warehouse.other_rules()]


def not_over_note(warehouse: Warehouse, until_ms: int | None) -> list[str]:
    """Return what a reader must know of a range that is not over."""
    from vsd_analytics.figures.operator_counts import local_iso

    return (
        []
        if until_ms is None
        else [f"the range is not over at {local_iso(warehouse.site.zone, until_ms)}: later hours are not missing"]
    )


def noted(printed: Mapping[str, Any], notes: Sequence[str]) -> dict[str, Any]:
    """Return what `--json` prints, with notes where there are any."""
    return {**printed, **({"notes": notes} if notes else {})}


def warn(notes: Iterable[str]) -> None:
    """Print notes as warnings W310 on standard error."""
    for note in notes:
        click.echo(render_error(VsdError(note, code="W310"), word="warning"), err=True)


@contextmanager
def period_with_history(
    project: Project, floor: Floor, *, week: str | None, days: str | None, n_weeks: int | None = None
) -> Iterator[Period]:
    """Open the days asked for on one floor, and the weeks before them: five, or as many as asked for.

    These weeks tell which cameras see an area, so that a camera that was silent all the time is named.
    """
    from vsd_analytics.figures.panels import WEEK, FloorHours
    from vsd_analytics.figures.periods import Period
    from vsd_analytics.stats.rates import HISTORY_WEEKS

    first, last = shared_days(project, week=week, days=days)
    with warehouse_of(project, week=None, days=f"{first - (n_weeks or HISTORY_WEEKS) * WEEK}..{last}") as warehouse:
        yield Period(FloorHours(warehouse, floor=floor, clock=project.now), first, last)


RECORD_NAMES = {"observations": "person record", "pairs": "pair record", "frames": "frame"}


def parse_span(text: str, *, project: Project) -> tuple[int, int]:
    """Return first instant and end (exclusive), in UTC milliseconds, of local days or times, or of an ISO week.

    Raises:
        UsageError: E101.
    """
    zone = project.site.timezone
    first, dots, last = text.partition("..")
    if "T" in text:
        if not dots:
            raise UsageError(f"--range {text!r} has no end", fix="--range 2026-11-09T10:00..2026-11-09T12:00")
        ends = [_end(part, is_last=i == 1, zone=zone) for i, part in enumerate((first, last))]
    else:
        days = parse_range(text)
        ends = [_end(f"{d}", is_last=i == 1, zone=zone) for i, d in enumerate(days)]
    if ends[0] >= ends[1]:
        raise UsageError(f"--range {text!r} ends before it begins", fix="write the earlier time first")
    return ends[0], ends[1]


def _end(text: str, *, is_last: bool, zone: str) -> int:
    """Return one end of a range; of a day its start, or its end where it comes last."""
    end = instant(text, zone=zone, what="--range")
    if "T" not in text and is_last:
        end = instant(f"{end.date() + timedelta(days=1)}", zone=zone, what="--range")
    return round(end.timestamp() * 1000)


def camera_id_of(project: Project, camera: str | None) -> str | None:
    """Return a camera's id, also one that only records still name."""
    if camera is None:
        return None
    known = {name: c.camera_id for c in project.site.cameras for name in (c.camera_id, *c.engine_ids)}
    if camera not in known and not re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,62}", camera):
        near = nearest_camera_id(camera, project.site.cameras)
        raise UsageError(
            f"--camera {camera!r} is no camera",
            why=f"known: {', '.join(list(known)[:20])}",
            fix=f"--camera {near}" if near else "--camera with one of them",
        )
    return known.get(camera, camera)
