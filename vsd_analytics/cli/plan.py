"""`vsd plan`: how long a change must be watched until its effect is clear, and what was planned."""

from __future__ import annotations

from datetime import timedelta
from typing import Final

import click

from vsd_analytics.cli.answers import print_answers
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError
from vsd_analytics.render.text import Layout, TableLayout

_WEEKDAYS: Final = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
_WAY: Final = ("weeks_after", "power_then", "measured_then")
LAYOUTS: Final[dict[str, Layout]] = {
    "plan": (
        TableLayout(("name", "planned_change", "power_asked")),
        TableLayout(
            ("n_known_weeks", "first_date", "last_date", "week_sd", "week_sd_days", "week_sd_beyond"),
            only="n_known_weeks",
        ),
    ),
    "plan_choices": (TableLayout(("weeks_before", "weeks_to_wait", *_WAY)),),
    "comparison_areas": (TableLayout(("area_id", "apart_m", "correlation", "week_sd_apart")),),
    "plans": (
        TableLayout(("number", "made", "area_id", "planned_change", "weeks_before", *_WAY)),
        TableLayout(("number", "n_days_in_turn"), only="n_days_in_turn"),
    ),
    "switchback_plan": (
        TableLayout(("name", "planned_change", "n_weeks_in_turn", "n_days_in_turn", "power_then", "measured_then")),
    ),
    "switchback_weeks": (TableLayout(("week_first", *_WEEKDAYS)),),
}


@click.command()
@click.option("--area", "area_id", metavar="ID", help="Area to be changed.")
@click.option(
    "--effect", type=float, metavar="SHARE",
    help="Effect to be seen: -0.15 = 15 % less time too close per open hour.",
)  # fmt: skip
@click.option(
    "--power", type=float, default=0.8, show_default=True, metavar="SHARE",
    help="Chance of a clear verdict, from 0.5 to 0.99.",
)  # fmt: skip
@click.option(
    "--weeks-max", type=click.IntRange(1, 26), default=26, show_default=True, help="Weeks after the change, at most."
)
@click.option("--in-turn", is_flag=True, help="Lay out days with and without the change in turn.")
@click.option(
    "--weeks", type=int, metavar="N",
    help="With --in-turn: weeks of it, an even number (default: the fewest with that power, up to --weeks-max).",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(min=0), metavar="S", help="With --in-turn: of the coins (default: 1).")
@json_option
@pass_project
def plan(
    project: Project,
    area_id: str | None,
    effect: float | None,
    power: float,
    weeks_max: int,
    in_turn: bool,
    weeks: int | None,
    seed: int | None,
    as_json: bool,
) -> int:
    """Plan how long to watch a change of an area until its effect is clear, or list the plans.

    The weeks needed follow from how the area's own weeks differ beside areas that are left alone. The plan is stored in
    plans.jsonl with what it predicts; vsd compare --change N scores it once the change is in the log.

    With --in-turn, the change is there on some days only: for each weekday of two successive weeks a coin says in which
    of them. Prints the days from the next Monday on and their power, and stores them; vsd compare --in-turn N reads
    them when they are over.

    Exit code 1: there is too little data for a plan; the message says what is missing.

    \b
    Example:
      vsd plan --area entrance --effect -0.15
      vsd plan --area entrance --effect -0.3 --power 0.9 --json
      vsd plan --area entrance --effect -0.3 --in-turn
      vsd plan
    """
    if not in_turn and (weeks is not None or seed is not None):
        raise UsageError("--weeks and --seed are of days in turn", fix="add --in-turn")
    if area_id is None and effect is None and not in_turn:
        return _list(project, as_json=as_json)
    if area_id is None or not effect:
        raise UsageError("a plan needs an area and an effect", fix="vsd plan --area ID --effect -0.15")
    from vsd_analytics.answer import Answers
    from vsd_analytics.cli.ranges import nothing_stored, warehouse_of
    from vsd_analytics.config.plans import add_plan, plan_dict
    from vsd_analytics.figures.experiments import check_plan, plan_days, plan_experiment, stored_plan
    from vsd_analytics.figures.plan_answers import plan_answers
    from vsd_analytics.warehouse.stored_days import stored_extent

    check_plan(effect=effect, power=power)
    if stored_extent(project.site) is None:
        raise nothing_stored(project)
    if in_turn:
        return _in_turn(project, area_id, effect, power, weeks_max, weeks, seed, as_json=as_json)
    first, last = plan_days(project.site)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        experiment_plan = plan_experiment(warehouse, area_id, effect=effect, power=power, weeks_max=weeks_max)
        inputs = warehouse.inputs_digest
    plan_record = stored_plan(experiment_plan, made=project.now.astimezone(project.site.zone).date())
    is_new = plan_record is not None and add_plan(project.site, plan_record)
    days = experiment_plan.known or (first, last)
    stored = {"stored": None if plan_record is None else plan_dict(plan_record), "is_new": is_new}
    answers = Answers(plan_answers(experiment_plan, project.site, days=days, inputs=inputs))
    print_answers(answers, days=days, layouts=LAYOUTS, as_json=as_json, notes=(), beside=stored)
    if is_new and not as_json:
        project.say("stored in plans.jsonl; after the change: vsd log add, then vsd compare --change N")
    return 0 if experiment_plan.state == "ok" else 1


def _in_turn(
    project: Project, area_id: str, effect: float, power: float, weeks_max: int, weeks: int | None, seed: int | None,
    *, as_json: bool,
) -> int:  # fmt: skip
    from vsd_analytics.answer import Answers
    from vsd_analytics.cli.ranges import warehouse_of
    from vsd_analytics.config.plans import add_plan, plan_dict, read_plans
    from vsd_analytics.figures.experiments import plan_days
    from vsd_analytics.figures.switchback import SEED, check_weeks, plan_switchback, stored_switchback
    from vsd_analytics.figures.switchback_answers import switchback_plan_answers

    if weeks is not None:
        check_weeks(weeks)
    today = project.now.astimezone(project.site.zone).date()
    first, last = plan_days(project.site)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        experiment_plan = plan_switchback(
            warehouse, area_id, effect=effect, start=today + timedelta(days=1), power=power, weeks=weeks,
            weeks_max=weeks_max, seed=SEED if seed is None else seed,
        )  # fmt: skip
        inputs = warehouse.inputs_digest
    plan_record = stored_switchback(experiment_plan, made=today)
    is_new = plan_record is not None and add_plan(project.site, plan_record)
    number = None if plan_record is None else read_plans(project.site).index(plan_record) + 1
    days = experiment_plan.known or (first, last)
    stored = {"stored": None if plan_record is None else plan_dict(plan_record), "number": number, "is_new": is_new}
    answers = Answers(switchback_plan_answers(experiment_plan, project.site, days=days, inputs=inputs))
    print_answers(answers, days=days, layouts=LAYOUTS, as_json=as_json, notes=(), beside=stored)
    if number is not None and not as_json:
        project.say(f"stored in plans.jsonl as plan {number}; when its days are over: vsd compare --in-turn {number}")
    return 0 if experiment_plan.state == "ok" else 1


def _list(project: Project, *, as_json: bool) -> int:
    from vsd_analytics.answer import Answers
    from vsd_analytics.config.plans import read_plans
    from vsd_analytics.figures.plan_answers import plans_answer

    plans = read_plans(project.site)
    if not plans and not as_json:
        project.say("no plans yet; make one: vsd plan --area ID --effect -0.15")
        return 0
    answer = plans_answer(plans, project.site, today=project.now.astimezone(project.site.zone).date())
    days = (answer.holds_for.first, answer.holds_for.last)
    print_answers(Answers([answer]), days=days, layouts=LAYOUTS, as_json=as_json, notes=())
    return 0
