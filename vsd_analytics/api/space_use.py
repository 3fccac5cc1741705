"""Answers of some days as tables for analysts: one for each name, over all floors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from datetime import date

import pyarrow as pa

from vsd_analytics.answer import Answer
from vsd_analytics.api.table import Table
from vsd_analytics.figures.compare import days_needed
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.answers import audience_answers
from vsd_analytics.render.frame import arrow
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text


def answer_table(
    site: Site,
    days: tuple[date, date],
    opened: Callable[[date, date], AbstractContextManager[Warehouse]],
    answers: Callable[[Period], Sequence[Answer]],
    *,
    name: str,
    title: str,
) -> Table:
    """Return one answer over all floors as a table, without small counts.

    Args:
        site: The project.
        days: First and last local day.
        opened: Opens a warehouse from one day to another.
        answers: Makes the answers of a floor that belong together.
        name: Name of the answer.
        title: For printing.
    """
    tables, why = [], []
    with opened(*days_needed(site, days)) as warehouse:
        for floor in site.floors:
            period = Period(FloorHours(warehouse, floor=floor), *days)
            answer = audience_answers(answers(period), site)[name]
            tables.append(arrow(answer))
            if answer.nothing is not None:
                why.append(reason_text(answer.nothing))
    rows = pa.concat_tables(tables, promote_options="permissive")
    return Table(rows, title=title, note="" if rows.num_rows else "; ".join(dict.fromkeys(why)))
