"""Answers of some days as tables for analysts, over all floors, and the change log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from datetime import date, timedelta
from typing import Final

import pyarrow as pa

from vsd_analytics.answer import Answer
from vsd_analytics.api.table import Table
from vsd_analytics.config.change_log import read_log
from vsd_analytics.errors import UsageError, nearest
from vsd_analytics.figures import compare
from vsd_analytics.figures import hotspots as hotspot_figures
from vsd_analytics.figures.area_answers import place_rates
from vsd_analytics.figures.hotspot_answers import hotspot_answers, window_holds
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.answers import audience_answers
from vsd_analytics.render.frame import arrow
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse
from vsd_analytics.wording.reasons import reason_text

CONTEXT_FIGURES: Final = ("context_change", "context_conversion", "context_value")


def answer_table(
    site: Site,
    days: tuple[date, date],
    opened: Callable[[], AbstractContextManager[Warehouse]],
    answers: Callable[[Period], Sequence[Answer]],
    *,
    name: str,
    title: str,
) -> Table:
    """Return one answer over all floors as a table, without small counts.

    Args:
        site: The project.
        days: First and last local day.
        opened: Opens a warehouse over the days and what the answers read before them.
        answers: Makes the answers of a floor that belong together.
        name: Name of the answer.
        title: For printing.
    """
    tables, why = [], []
    with opened() as warehouse:
        for floor in site.floors:
            period = Period(FloorHours(warehouse, floor=floor), *days)
            answer = audience_answers(answers(period), site, leaves=False)[name]
            tables.append(arrow(answer))
            if answer.nothing is not None:
                why.append(reason_text(answer.nothing))
    rows = pa.concat_tables(tables, promote_options="permissive")
    return Table(rows, title=title, note="" if rows.num_rows else "; ".join(dict.fromkeys(why)))


def context_figure_table(site: Site, first: date, last: date, *, name: str) -> Table:
    """Return figures of a week that use what else happened, a row for each floor and series.

    Args:
        site: The project.
        first: Monday of a week.
        last: Its Sunday.
        name: context_change, context_conversion or context_value.

    Raises:
        UsageError: E101, these days are no week, or there are no such figures.
    """
    if name not in CONTEXT_FIGURES:
        near = nearest(str(name), CONTEXT_FIGURES) or CONTEXT_FIGURES[0]
        raise UsageError(
            f"there are no figures {name!r}",
            why=f"there are {', '.join(CONTEXT_FIGURES)}",
            fix=f'context_figures("{near}")',
        )
    if first.weekday() or last - first != timedelta(days=6):
        raise UsageError(
            f"{first} to {last} is no week from Monday to Sunday",
            why="figures that use a series compare a week with the week before",
            fix='site.week("2026-W46").context_figures()',
        )
    answers = [week_report(site, first, floor_id=f.floor_id, has_context=True).answers[name] for f in site.floors]
    rows = pa.concat_tables([arrow(answer) for answer in answers], promote_options="permissive")
    why = dict.fromkeys(reason_text(answer.nothing) for answer in answers if answer.nothing is not None)
    title = f"{name.replace('_', ' ').capitalize()}, {first} to {last}"
    return Table(rows, title=title, note="" if rows.num_rows else "; ".join(why))


def area_table(site: Site, first: date, last: date, *, title: str) -> Table:
    """Return one row for each floor, area and rest of a floor; columns as of `Days.areas`.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        title: For printing.
    """
    with open_warehouse(site, *compare.days_needed(site, (first, last))) as warehouse:
        periods = [Period(FloorHours(warehouse, floor=floor), first, last) for floor in site.floors]
        tables = [arrow(place_rates(period, rest="Rest of the floor")) for period in periods]
    return Table(pa.concat_tables(tables, promote_options="permissive"), title=title)


def hotspot_table(site: Site, until: date) -> Table:
    """Return one row for each hotspot of the 28 days to `until`; columns as of `Days.hotspots`."""
    tables = []
    notes = []
    with open_warehouse(site, *hotspot_figures.days_needed(site, until)) as warehouse:
        for floor in site.floors:
            floor_hotspots = hotspot_figures.hotspots(warehouse, floor_id=floor.floor_id, until=until)
            holds = window_holds(site, floor_hotspots, inputs=warehouse.inputs_digest)
            answer = hotspot_answers(floor_hotspots, holds)[0]
            tables.append(arrow(answer))
            if answer.nothing is not None:
                notes.append(f"{floor.name}: {reason_text(answer.nothing)}")
    rows = pa.concat_tables(tables, promote_options="permissive")
    return Table(rows, title=f"Hotspots until {until}", note="; ".join(notes))


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
