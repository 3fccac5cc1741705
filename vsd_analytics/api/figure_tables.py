"""Figures with their statistics as tables: areas with intervals, hotspots."""

from __future__ import annotations

from datetime import date
from typing import Any

import pyarrow as pa

from vsd_analytics.api.table import Table
from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures import close_time, compare, rates
from vsd_analytics.figures import hotspots as hotspot_figures
from vsd_analytics.figures.hotspot_answers import hotspot_answers, window_holds
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.render.frame import arrow
from vsd_analytics.site.model import Area, Floor, Site
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.wording.reasons import reason_text


def area_table(site: Site, first: date, last: date, *, title: str) -> Table:
    """Return one row for each floor, area and rest of a floor; columns as of `Days.areas`.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        title: For printing.
    """
    rows: list[dict[str, Any]] = []
    with open_warehouse(site, *compare.days_needed(site, (first, last))) as warehouse:
        for floor in site.floors:
            data = FloorHours(warehouse, floor=floor)
            period = Period(data, first, last)
            places: list[Floor | Area | None] = [floor]
            if period.why_no_places is None and data.areas:
                places += [*data.areas, None]
            for where in places:
                is_floor = isinstance(where, Floor)
                area_id = where.area_id if isinstance(where, Area) else None
                place = period.whole if is_floor else period.area(area_id)
                close = close_time.close_time_share(period, close_time.close_time(period, where))
                rows.append(
                    {
                        "floor_id": floor.floor_id,
                        "kind": "floor" if is_floor else "area" if where is not None else "rest",
                        "area_id": area_id,
                        "name": "Rest of the floor" if where is None else where.name,
                        **_estimate("violations_per_open_h", rates.violation_rate_level(period, place)),
                        **_estimate("close_time_share", close),
                    }
                )
    return Table(pa.Table.from_pylist(rows), title=title)


def hotspot_table(site: Site, until: date) -> Table:
    """Return one row for each hotspot of the 28 days to `until`; columns as of `Days.hotspots`."""
    tables = []
    notes = []
    with open_warehouse(site, *hotspot_figures.days_needed(site, until)) as warehouse:
        for floor in site.floors:
            found = hotspot_figures.hotspots(warehouse, floor_id=floor.floor_id, until=until)
            holds = window_holds(site, found, inputs=warehouse.inputs_digest)
            answer = hotspot_answers(found, holds)[0]
            tables.append(arrow(answer))
            if answer.nothing is not None:
                notes.append(f"{floor.name}: {reason_text(answer.nothing)}")
    rows = pa.concat_tables(tables, promote_options="permissive")
    return Table(rows, title=f"Hotspots until {until}", note="; ".join(notes))


def _estimate(name: str, estimate: RateEstimate) -> dict[str, Any]:
    return {
        name: estimate.value,
        f"{name}_lo": estimate.lo,
        f"{name}_hi": estimate.hi,
        f"{name}_state": estimate.state,
        f"{name}_reason": reason_text(estimate.reason) or None,
    }


def change_table(site: Site, first: date | None = None, last: date | None = None) -> Table:
    """Return the entries of the change log: `number` in the whole log, from 1, `at`, `text`, `area_id`.

    Args:
        site: The project.
        first: First local day; None = the whole log.
        last: Last local day, inclusive.
    """
    rows = [
        {"number": number, "at": entry.at, "text": entry.text, "area_id": entry.area_id}
        for number, entry in enumerate(read_log(site), start=1)
        if first is None or last is None or first <= entry.at.astimezone(site.zone).date() <= last
    ]
    at = pa.timestamp("us", tz=site.timezone)
    schema = pa.schema([("number", pa.int64()), ("at", at), ("text", pa.string()), ("area_id", pa.string())])
    return Table(pa.Table.from_pylist(rows, schema=schema), title="Change log")
