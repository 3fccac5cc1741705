"""`vsd forecast`: the next week hour by hour, the score of the last forecast, and unusual hours."""

from __future__ import annotations

from datetime import timedelta
from typing import Final

import click

from vsd_analytics.cli.answers import print_answers
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import last_monday, warehouse_of
from vsd_analytics.render.text import GridLayout, Layout, TableLayout
from vsd_analytics.site.instants import parse_week

LAYOUTS: Final[dict[str, Layout]] = {
    "forecast": tuple(GridLayout(name, "local_hour", "local_date") for name in ("people", "violation_rate")),
    "forecast_score": (
        TableLayout(("series", "scored_week", "n_hours", "off_share", "off_share_naive")),
        TableLayout(("series", "scaled_error", "scaled_error_naive", "in_range_share", "range_share", "late_level")),
    ),
    "unusual_hours": (TableLayout(("local_date", "local_hour", "n_violations", "usual", "times_usual")),),
}


@click.command()
@click.option(
    "--week",
    metavar="WEEK",
    default="last",
    show_default=True,
    help="The week just over, the last one the forecast knows: 2026-W46, last, last-2.",
)
@click.option("--floor", "floor_id", metavar="FLOOR", help="Only this floor (default: the whole site).")
@click.option("--unusual", "is_unusual_only", is_flag=True, help="Only the unusual hours of the week just over.")
@json_option
@pass_project
def forecast(project: Project, week: str, floor_id: str | None, is_unusual_only: bool, as_json: bool) -> int:
    """Forecast next week, hour by hour, and score the last forecast.

    People are the mean number in view, violations are per open hour; the range in brackets contains four of five such
    hours. Then follow the score of the last forecast, compared with the naive one (the same hour of the week before),
    and the hours of last week with far more or fewer violations than usual. With fewer than four recorded weeks the
    command says so and exits with 1.

    \b
    Example:
      vsd forecast
      vsd forecast --week 2026-W46 --json
      vsd forecast --week last --unusual
    """
    from vsd_analytics.answer import Answers
    from vsd_analytics.figures import forecast as forecasting
    from vsd_analytics.figures import unusual as looking
    from vsd_analytics.figures.forecast_answers import forecast_answers, holds_in_week, unusual_answer

    monday = parse_week(week, last=last_monday(project))
    days = f"{forecasting.first_day(monday)}..{monday + timedelta(days=6)}"
    with warehouse_of(project, week=None, days=days) as warehouse:
        warehouse.materialise("violations", "camera_hours", "camera_slots")
        odd = looking.unusual(warehouse, monday, floor_id=floor_id)
        outlook = None if is_unusual_only else forecasting.forecast(warehouse, monday, floor_id=floor_id)
        inputs = warehouse.inputs_digest
    shown_monday = monday if outlook is None else outlook.monday
    holds = [holds_in_week(project.site, floor_id, day, inputs=inputs) for day in (shown_monday, monday)]
    every = [] if outlook is None else [*forecast_answers(outlook, holds[0])]
    answers = Answers([*every, unusual_answer(odd, holds[1])])
    dates = (shown_monday, shown_monday + timedelta(days=6))
    print_answers(answers, days=dates, layouts=LAYOUTS, as_json=as_json, notes=())
    has_result = odd.state == "ok" if outlook is None else outlook.has_forecast
    return 0 if has_result else 1
