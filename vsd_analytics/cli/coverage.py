"""`vsd coverage`: the share of opening hours that each camera recorded."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import date, timedelta
from typing import TYPE_CHECKING, Final

import click

from vsd_analytics.cli.answers import print_answers
from vsd_analytics.cli.options import json_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import not_over_note, purged_hours_notes, warehouse_of
from vsd_analytics.render.text import GridLayout, Layout, TableLayout

if TYPE_CHECKING:
    from vsd_analytics.answer import Answer

_DAYS_SHOWN: Final = 14
_GAPS_SHOWN: Final = 20
_WHEN: Final = ("camera_id", "start", "end")
LAYOUTS: Final[dict[str, Layout]] = {
    "recorded": (TableLayout(("camera_id", "recorded_share", "recorded_h", "scheduled_h")),),
    "recorded_days": (GridLayout("recorded_share", "camera_id", "local_date"),),
    "camera_outages": (TableLayout((*_WHEN, "open_h", "is_inferred")),),
    "message_gaps": (TableLayout((*_WHEN, "n_missing", "first_missing", "last_missing")),),
    "restarts": (TableLayout(_WHEN),),
    "camera_watch": (TableLayout(("camera_id", "share_verdict", "since", "people_change")),),
}


@click.command()
@range_options
@json_option
@pass_project
def coverage(project: Project, week: str | None, days: str | None, as_json: bool) -> None:
    """Print how much of the opening hours each camera recorded, and what is missing.

    Cameras are watched over weeks, too: one that loses or gains people beside its neighbours is named. Either fewer
    people were there, or fewer were detected.

    Of a week that is not over, hours that are not over count neither as recorded nor as missing. Text shows the last
    14 days and the first 20 gaps; JSON has all.

    \b
    Example:
      vsd coverage --week last
    """
    from vsd_analytics.answer import Answers
    from vsd_analytics.figures import operator_counts
    from vsd_analytics.figures.coverage_answers import coverage_answers

    read = ("hours", "camera_hours", "message_gaps", "outages", "sequence_runs")
    with warehouse_of(project, week=week, days=days, relations=read) as warehouse:
        until_ms = operator_counts.begun_until_ms(warehouse, now=project.now)
        every = coverage_answers(warehouse, until_ms=until_ms)
        notes = [*purged_hours_notes(warehouse), *not_over_note(warehouse, until_ms)]
        dates = (warehouse.first, warehouse.last)
    answers = Answers(every if as_json else _shortened(every, dates[1]))
    print_answers(answers, days=dates, layouts=LAYOUTS, as_json=as_json, notes=notes)


def _shortened(answers: tuple[Answer, ...], last: date) -> Iterator[Answer]:
    """Yield the answers as text shows them: the last days, the first gaps, and no table that is empty."""
    for answer in answers:
        rows = answer.rows
        if answer.name == "recorded_days":
            since = last - timedelta(days=_DAYS_SHOWN - 1)
            rows = tuple(row for row in rows if isinstance(day := row["local_date"], date) and day >= since)
        elif answer.name in ("message_gaps", "restarts"):
            rows = rows[:_GAPS_SHOWN]
        if rows:
            yield replace(answer, rows=rows)
