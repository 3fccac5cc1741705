"""`vsd selfcheck`: how often the verdicts on this site are false alarms, found from its own weeks."""

from __future__ import annotations

from typing import Final

import click

from vsd_analytics.cli.answers import print_answers
from vsd_analytics.cli.options import floor_option, json_option
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.render.text import Layout, TableLayout

LAYOUTS: Final[dict[str, Layout]] = {
    "self_check": (TableLayout(("judged", "false_alarm_share", "verdicts_a_year", "false_a_year", "n_weeks")),)
}


@click.command()
@floor_option
@json_option
@pass_project
def selfcheck(project: Project, floor_id: str | None, as_json: bool) -> int:
    """Print how often this site's own weeks would raise a false alarm.

    Shuffles the last 26 whole weeks, so that nothing changes on average, and compares each time two of them as the
    weekly report does. A clear fall or rise is then a false one.

    Exit code 1: fewer than ten weeks are recorded well enough.

    \b
    Example:
      vsd selfcheck
      vsd selfcheck --floor ground --json
    """
    from vsd_analytics.answer import Answers
    from vsd_analytics.cli.ranges import nothing_stored, warehouse_of
    from vsd_analytics.figures.panels import FloorHours
    from vsd_analytics.figures.self_check import days_needed, self_check, self_check_answer
    from vsd_analytics.site.places import known_floor
    from vsd_analytics.warehouse.stored_days import stored_extent

    if stored_extent(project.site) is None:
        raise nothing_stored(project)
    floor = known_floor(project.site, floor_id)
    first, last = days_needed(project.site)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours")
        check = self_check(FloorHours(warehouse, floor=floor), until=last)
        answer = self_check_answer(check, project.site, until=last, inputs=warehouse.inputs_digest)
    dates = (answer.holds_for.first, answer.holds_for.last)
    print_answers(Answers([answer]), days=dates, layouts=LAYOUTS, as_json=as_json, notes=())
    return 0 if answer.rows else 1
