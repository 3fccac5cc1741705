"""Tables of how a space is used: visits, flow, queues and capacity of areas that ask for them, without small counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from datetime import date
from typing import Any, Final

import pyarrow as pa

from vsd_analytics.answer import Reason
from vsd_analytics.api.table import Table
from vsd_analytics.figures.capacities import capacities
from vsd_analytics.figures.compare import days_needed
from vsd_analytics.figures.flow import flow
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.queues import queues
from vsd_analytics.figures.visits import visits
from vsd_analytics.site.model import Area, Site
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

Rows = Callable[[Period], Iterator[dict[str, Any]]]
_COLUMNS: Final = pa.schema(
    [
        *((name, pa.string()) for name in ("floor_id", "area_id", "to_area_ids", "name", "what", "unit")),
        ("local_hour", pa.int64()),
        *((name, pa.float64()) for name in ("value", "lo", "hi")),
        ("reason", pa.string()),
    ]
)


def space_use(
    site: Site,
    days: tuple[date, date],
    opened: Callable[[date, date], AbstractContextManager[Warehouse]],
    rows: Rows,
    *,
    title: str,
    none: str,
) -> Table:
    """Return the rows of all floors as one table: a row for each place and figure.

    Args:
        site: The project.
        days: First and last local day.
        opened: Opens a warehouse from one day to another.
        rows: Makes the rows of a floor.
        title: For printing.
        none: The note of an empty table.
    """
    found: list[dict[str, Any]] = []
    with opened(*days_needed(site, days)) as warehouse:
        for floor in site.floors:
            period = Period(FloorHours(warehouse, floor=floor), *days)
            found += [{"floor_id": floor.floor_id, **row} for row in rows(period)]
    made = pa.Table.from_pylist([{name: row.get(name) for name in _COLUMNS.names} for row in found], schema=_COLUMNS)
    return Table(made, title=title, note="" if found else none)


def visit_rows(period: Period) -> Iterator[dict[str, Any]]:
    """Yield visits per open hour and dwell times of each area with `visits = true`."""
    for of in visits(period):
        few = _few(period, of.dwell.n_visits, "hidden.visits")
        rate, share = of.often, of.dwell.long_share
        part = None if share.value is None else round(share.value * share.of)
        few_long = few or (None if part is None else _few(period, part) or _few(period, share.of - part))
        yield _row(of.area, "visits", "per open hour", rate.value, rate.lo, rate.hi, few or rate.reason)
        for what, q in (("median dwell", of.dwell.median), ("90 % dwell", of.dwell.p90)):
            yield _row(of.area, what, "seconds", q.value, q.lo, q.hi, few or of.dwell.reason)
        yield _row(of.area, "long visits", "share", share.value, share.lo, share.hi, few_long or share.reason)


def flow_rows(period: Period) -> Iterator[dict[str, Any]]:
    """Yield the share of those who leave each area whose next area is each other one, and the estimated links."""
    found = flow(period)
    if found is None:
        return
    for of in found.areas:
        few = _few(period, of.following.n)
        for to in of.to:
            share, ids = to.share, " ".join(a.area_id for a in to.areas)
            row = _row(of.area, "flow", "share", share.value, share.lo, share.hi, few or share.reason)
            yield {**row, "to_area_ids": ids}
    for link in found.links.found:
        row = _row(link.origin, "estimated link", "share", link.share.value, link.share.lo, link.share.hi, None)
        yield {**row, "to_area_ids": link.to.area_id, "reason": reason_text(link.share.reason) or None}


def queue_rows(period: Period) -> Iterator[dict[str, Any]]:
    """Yield people waiting, also by hour, waiting times and the share who leave of each area with `queue = true`."""
    for of in queues(period):
        waits = None if of.waiting is None else of.waiting.waits
        few = None if waits is None else _few(period, waits.n_entered)
        people = of.people
        yield _row(of.area, "people waiting", "people", people.value, people.lo, people.hi, few or people.reason)
        for hour in of.by_hour if few is None else ():
            rate = hour.people
            held = None if hour.waits is None else _few(period, hour.waits.n_entered, "hidden.entries")
            row = _row(of.area, "people waiting", "people", rate.value, rate.lo, rate.hi, held or rate.reason)
            yield {**row, "local_hour": hour.hour}
        if waits is None:
            continue
        for what, q in (("median wait", waits.median), ("90 % wait", waits.p90)):
            yield _row(of.area, what, "seconds", q.value, q.lo, q.hi, few or waits.reason)
        share = waits.left_share
        part = None if share.value is None else round(share.value * waits.n_entered)
        held = few or (None if part is None else _few(period, part) or _few(period, waits.n_entered - part))
        yield _row(of.area, "leave before the end", "share", share.value, share.lo, share.hi, held or share.reason)


def capacity_rows(period: Period) -> Iterator[dict[str, Any]]:
    """Yield how full each area and floor with a `capacity` was."""
    for of in capacities(period):
        for what, unit, rate in (
            ("people", "people", of.people),
            ("at least 60 % full", "share of time", of.busy),
            ("full or over", "share of time", of.full),
            ("over", "share of time", of.over),
            ("people beyond it", "people", of.surplus),
        ):
            area = of.place if isinstance(of.place, Area) else None
            row = _row(area, what, unit, rate.value, rate.lo, rate.hi, None)
            yield {**row, "name": of.place.name, "reason": reason_text(rate.reason) or None}


def _few(period: Period, n: int, why: str = "hidden.entries") -> Reason | None:
    below = int(period.data.site.settings.mask_below)
    return Reason(why, least=below) if 0 < n < below else None


def _row(
    area: Area | None,
    what: str,
    unit: str,
    value: float | None,
    lo: float | None,
    hi: float | None,
    reason: Reason | None,
) -> dict[str, Any]:
    if reason is not None and reason.code.startswith("hidden."):
        value = lo = hi = None
    where = {} if area is None else {"area_id": area.area_id, "name": area.name}
    why = reason_text(reason) or None
    return {**where, "what": what, "unit": unit, "value": value, "lo": lo, "hi": hi, "reason": why}
