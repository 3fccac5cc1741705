"""`vsd queue`: how many people wait, how long, and how many leave before they are served."""

from __future__ import annotations

from typing import Final

import click

from vsd_analytics.cli.answers import has_value, print_answers
from vsd_analytics.cli.options import exact_option, floor_option, json_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.render.text import GridLayout, Layout, TableLayout

WAITS: Final = ("wait_median_s", "wait_p90_s", "left_share")
_ENDS: Final = ("n_served", "n_left", "n_cut", "n_back")
LAYOUTS: Final[dict[str, Layout]] = {
    "queues": (
        TableLayout(("name", "people_waiting", "people_waiting_p90", *WAITS, "recorded_share")),
        TableLayout(("name", "n_entered", *_ENDS, "n_days", "stay_mean_s", "stay_mean_little_s")),
    ),
    "queue_hours": (TableLayout(("name", "local_hour", "people_waiting", *WAITS)),),
    "queue_forecast": (
        GridLayout("people_waiting", down="local_hour", over="local_date"),
        TableLayout(("name", "local_date", "local_hour", "people_waiting", "queue_limit", "chance"), only="chance"),
    ),
    "queue_forecast_score": (
        TableLayout(("name", "scored_week", "off_share", "in_range_share", "range_share", "n_hours")),
    ),
}


@click.command()
@range_options
@floor_option
@click.option("--forecast", "has_forecast", is_flag=True, help="Also forecast the week after the last whole one.")
@exact_option
@json_option
@pass_project
def queue(
    project: Project,
    week: str | None,
    days: str | None,
    floor_id: str | None,
    has_forecast: bool,
    as_json: bool,
) -> int:
    """Print how many people wait in an area, how long, and how many leave before the end, of areas with queue = true.

    The number of people needs no track ids; time counts where all cameras that see the area recorded. Waiting times
    need served_in, the area into which served people step. Who steps elsewhere has left before the end; a track that
    is lost inside shows that the person waited at least that long (Aalen-Johansen). Little's law checks the mean stay
    without track ids: where the two disagree, the command says so.

    With --forecast, which needs --exact, follow the people waiting in each hour of the next week, with a range that
    holds four of five such hours, from at least four recorded weeks. For queues with queue_limit, the hours that may
    exceed it are listed.

    Exit code 1: no number of people is known, or no waiting time of a queue that has an end.

    \b
    Example:
      vsd queue --week last
      vsd queue --week last --forecast --exact
      vsd queue --range 2026-11-02..2026-11-15 --json
    """
    from vsd_analytics.cli.ranges import period_with_history, purged_hours_notes, whole_week
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures.forecast import HISTORY_WEEKS
    from vsd_analytics.figures.queue_forecast import queue_forecast
    from vsd_analytics.figures.queues import queues
    from vsd_analytics.figures.share.answers import audience_answers
    from vsd_analytics.figures.share.counts import mask_of
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not any(a.is_queue for a in project.site.areas if a.floor_id == floor.floor_id):
        raise UsageError(
            f"no area of floor {floor.floor_id!r} is a queue",
            why="queues are computed only for areas that are said to be one",
            fix='add queue = true to an [[area]] of vsd.toml, and served_in = "till-1" for its waiting times',
        )
    if has_forecast and mask_of(project.site).is_on:
        raise UsageError(
            "a forecast of people waiting is for the operator",
            code="E105",
            why="it is made of single hours of a place, and tells of single people",
            fix="vsd queue --forecast --exact",
        )
    n_weeks = HISTORY_WEEKS + 1 if has_forecast else None
    with period_with_history(project, floor, week=week, days=days, n_weeks=n_weeks) as period:
        every = [*queues(period)]
        if has_forecast:
            every += queue_forecast(period.data, whole_week(period.last))
        answers = audience_answers(every, period.data.site)
        notes = purged_hours_notes(period.data.warehouse)
    print_answers(answers, days=(period.first, period.last), layouts=LAYOUTS, as_json=as_json, notes=notes)
    has_end = any(a.served_in is not None for a in period.data.areas if a.is_queue)
    is_known = has_value(answers, "queues", ["people_waiting"])
    return 0 if is_known and (not has_end or has_value(answers, "queues", ["wait_median_s"])) else 1
