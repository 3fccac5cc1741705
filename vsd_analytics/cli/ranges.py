"""The range a command works on: a week, days, or everything stored; and the warehouse of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import date, timedelta
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.shared import F, Project, parse_range, parse_week, progress
from vsd_analytics.errors import StoreError

if TYPE_CHECKING:
    from vsd_analytics.warehouse.warehouse import Warehouse


def range_options(command: F) -> F:
    """Add `--week` and `--range` to a command."""
    for option in (
        click.option(
            "--range", "days", metavar="DAYS", help="Local days: 2026-11-09..2026-11-15 (default: everything stored)."
        ),
        click.option("--week", metavar="WEEK", help="ISO week: 2026-W46, last, last-2."),
    ):
        command = option(command)
    return command


def resolve(project: Project, *, week: str | None, days: str | None) -> tuple[date, date]:
    """Return first and last local day of what the user asked for.

    Raises:
        StoreError: E301, nothing is stored and no range was given.
    """
    from vsd_analytics.warehouse.warehouse import stored_extent

    if week is not None:
        monday = parse_week(week, last=last_monday(project))
        return monday, monday + timedelta(days=6)
    if days is not None:
        return parse_range(days)
    extent = stored_extent(project.site)
    if extent is None:
        raise nothing_stored(project)
    return extent.first_day, extent.last_day


def last_monday(project: Project) -> date:
    """Return the Monday that `--week last` means: of the last whole week before the clock, but not after the data."""
    from vsd_analytics.warehouse.warehouse import stored_extent

    today = project.now.astimezone(project.site.zone).date()
    whole = today - timedelta(days=today.weekday() + 7)
    extent = stored_extent(project.site)
    if extent is None:
        return whole
    stored = extent.last_day - timedelta(days=extent.last_day.weekday())
    return min(whole, stored)


def nothing_stored(project: Project) -> StoreError:
    """Return the error of an empty store."""
    return StoreError(
        "nothing is stored yet",
        code="E301",
        why=f"the store of site {project.site.site_id!r} holds no records",
        mend="vsd ingest FILES...",
    )


@contextmanager
def warehouse_of(project: Project, *, week: str | None, days: str | None, **options: Any) -> Iterator[Warehouse]:
    """Open the warehouse of a range with a progress bar over what must be computed first."""
    from vsd_analytics.warehouse.warehouse import open_warehouse

    first, last = resolve(project, week=week, days=days)
    with progress(None, total=None, label="facts", unit="h", quiet=project.quiet) as bar:

        def plan(n_hours: int) -> None:
            bar.total = n_hours

        update: Callable[[int], Any] = bar.update
        warehouse = open_warehouse(project.site, first, last, on_plan=plan, on_hours=update, **options)
    with warehouse:
        yield warehouse
