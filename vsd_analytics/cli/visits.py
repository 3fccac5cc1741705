"""`vsd visits`: how many people visit an area, and how long they stay."""

from __future__ import annotations

from typing import Final

import click

from vsd_analytics.cli.answers import has_value, print_answers
from vsd_analytics.cli.options import exact_option, floor_option, json_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.render.text import Layout, TableLayout

_STAYS: Final = ("dwell_median_s", "dwell_p90_s", "long_share", "long_visit_s")
_MEANS: Final = ("dwell_mean_s", "dwell_mean_little_s")
LAYOUTS: Final[dict[str, Layout]] = {
    "visits": (
        TableLayout(("name", "visits_per_open_h", *_STAYS, "recorded_share")),
        TableLayout(("name", "n_visits", "n_cut", "n_began_inside", "n_days", *_MEANS)),
    )
}


@click.command()
@range_options
@floor_option
@exact_option
@json_option
@pass_project
def visits(project: Project, week: str | None, days: str | None, floor_id: str | None, as_json: bool) -> int:
    """Print how many people visit an area and how long they stay (dwell time), of areas with visits = true.

    A visit counts where its entry was seen. A track that is lost inside shows that the person stayed at least that
    long (Kaplan-Meier); one that begins inside tells nothing. Little's law gives the mean stay without track ids:
    where the two disagree, the command says so.

    Exit code 1: no area asks for visits, or none has enough of them.

    \b
    Example:
      vsd visits --week last
      vsd visits --range 2026-11-02..2026-11-15 --json
    """
    from vsd_analytics.cli.ranges import period_with_history, purged_hours_notes
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures import visits as figures
    from vsd_analytics.figures.share.answers import audience_answers
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not any(a.has_visits for a in project.site.areas if a.floor_id == floor.floor_id):
        raise UsageError(
            f"no area of floor {floor.floor_id!r} asks for visits",
            why="visits are computed only for areas that ask for them",
            fix="add visits = true to an [[area]] of vsd.toml; door = true where people come and go",
        )
    with period_with_history(project, floor, week=week, days=days) as period:
        answers = audience_answers([figures.visits(period)], period.data.site)
        notes = purged_hours_notes(period.data.warehouse)
    print_answers(answers, days=(period.first, period.last), layouts=LAYOUTS, as_json=as_json, notes=notes)
    return 0 if has_value(answers, "visits", ["dwell_median_s"]) else 1
