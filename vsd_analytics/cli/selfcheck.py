"""`vsd selfcheck`: how often the verdicts on this site are false alarms, found from its own weeks."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.options import floor_option, json_option
from vsd_analytics.cli.output import emit_json, plain, rounded, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.self_check import FloorSelfCheck
    from vsd_analytics.stats.false_alarms import FalseAlarms


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
    from vsd_analytics.cli.ranges import nothing_stored, warehouse_of
    from vsd_analytics.figures.panels import FloorHours
    from vsd_analytics.figures.self_check import days_needed, self_check
    from vsd_analytics.site.places import known_floor
    from vsd_analytics.warehouse.stored_days import stored_extent

    if stored_extent(project.site) is None:
        raise nothing_stored(project)
    floor = known_floor(project.site, floor_id)
    first, last = days_needed(project.site)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours")
        found = self_check(FloorHours(warehouse, floor=floor), until=last)
    if as_json:
        more = {"verdicts_a_year": found.verdicts_a_year, "false_a_year": found.false_a_year}
        emit_json(rounded({**asdict(found), **more}))
    else:
        click.echo(plain(_text(found)))
    return 0 if found.state == "ok" else 1


def _text(found: FloorSelfCheck) -> str:
    if found.both is None or found.false_a_year is None or found.weeks is None:
        return f"false alarms here: unknown; {reason_text(found.reason)}"
    n, lo, hi = found.false_a_year
    rows = [("verdict on", "false alarms", "likely between")]
    for name, figure in (("violation rate", found.violation_rate), ("risk per person-hour", found.encounter_rate)):
        if figure is not None:
            rows.append((name, f"{figure.value:.0%}", f"{figure.lo:.0%} and {figure.hi:.0%}"))
    first, last = found.weeks
    return "\n".join(
        [
            f"false alarms here: {_share(found.both)}, so about {n:.0f} a year ({lo:.0f} to {hi:.0f}) "
            f"of {found.verdicts_a_year} verdicts on the floor",
            f"from {found.n_weeks} weeks, {first} to {last}, in random order",
            "",
            *table(rows),
        ]
    )


def _share(found: FalseAlarms) -> str:
    return f"{found.value:.0%} ({found.lo:.0%} to {found.hi:.0%})"
