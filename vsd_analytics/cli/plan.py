"""`vsd plan`: how long a change must be watched until its effect is clear, and what was planned."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.compare_text import percent
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, plain, rounded, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.config.plans import Plan
    from vsd_analytics.figures.experiments import ExperimentPlan


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
@json_option
@pass_project
def plan(
    project: Project,
    area_id: str | None,
    effect: float | None,
    power: float,
    weeks_max: int,
    as_json: bool,
) -> int:
    """Plan how long to watch a change of an area until its effect is clear, or list the plans.

    The weeks needed follow from how the area's own weeks differ beside areas that are left alone. The plan is stored in
    plans.jsonl with what it predicts; vsd compare --change N scores it once the change is in the log.

    Exit code 1: there is too little data for a plan; the message says what is missing.

    \b
    Example:
      vsd plan --area entrance --effect -0.15
      vsd plan --area entrance --effect -0.3 --power 0.9 --json
      vsd plan
    """
    if area_id is None and effect is None:
        return _list(project, as_json=as_json)
    if area_id is None or not effect:
        raise UsageError("a plan needs an area and an effect", fix="vsd plan --area ID --effect -0.15")
    from vsd_analytics.cli.ranges import nothing_stored, warehouse_of
    from vsd_analytics.config.plans import add_plan, plan_dict
    from vsd_analytics.figures.experiments import check_plan, plan_days, plan_experiment, stored_plan
    from vsd_analytics.warehouse.stored_days import stored_extent

    check_plan(effect=effect, power=power)
    if stored_extent(project.site) is None:
        raise nothing_stored(project)
    first, last = plan_days(project.site)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        found = plan_experiment(warehouse, area_id, effect=effect, power=power, weeks_max=weeks_max)
    made = stored_plan(found, made=project.now.astimezone(project.site.zone).date())
    is_new = made is not None and add_plan(project.site, made)
    if as_json:
        stored = None if made is None else plan_dict(made)
        emit_json(rounded({**asdict(found), "stored": stored, "is_new": is_new}))
    else:
        click.echo(plain(_text(found)))
        if is_new:
            project.say("stored in plans.jsonl; after the change: vsd log add, then vsd compare --change N")
    return 0 if found.state == "ok" else 1


def _list(project: Project, *, as_json: bool) -> int:
    from vsd_analytics.config.plans import plan_dict, read_plans

    plans = read_plans(project.site)
    if as_json:
        emit_json({"plans": [plan_dict(p) for p in plans]})
    elif plans:
        click.echo("\n".join(table([_HEAD, *(_row(p) for p in plans)])))
    else:
        project.say("no plans yet; make one: vsd plan --area ID --effect -0.15")
    return 0


_HEAD = ("made", "area", "effect", "weeks before", "weeks after", "power", "measured then")


def _row(plan: Plan) -> tuple[str, ...]:
    weeks = "not enough" if plan.weeks_after is None else str(plan.weeks_after)
    measured = f"{percent(plan.theta_lo - 1)} to {percent(plan.theta_hi - 1)}"
    start = (str(plan.made), plan.area, percent(plan.effect), str(plan.weeks_before), weeks)
    return (*start, f"{plan.power_then:.0%}", measured)


def _text(found: ExperimentPlan) -> str:
    lines = [
        f"{found.area_name}: {percent(found.effect)} time too close per open hour, with a power of {found.power:.0%}"
    ]
    left_out = [f"cannot be compared with {area_id}: {reason_text(why)}" for area_id, why in found.areas_left_out]
    if found.state != "ok" or found.variation is None or found.known is None:
        return "\n".join([*lines, "", f"not enough data: {reason_text(found.reason)}", *left_out])
    varied, (first, last) = found.variation, found.known
    lines += [
        f"from {len(varied.log_ratios)} weeks, {first} to {last}: beside the comparison areas a week differs by "
        f"{varied.sd:.0%} (days {varied.sd_days:.0%}, weeks beyond {varied.sd_weeks:.0%})",
        "",
    ]
    rows = [("weeks before", "still to wait", "weeks after", "power then", "measured then")]
    for way in found.choices:
        weeks = f"more than {found.weeks_max}" if way.weeks_after is None else str(way.weeks_after)
        measured = f"{percent(way.theta_lo - 1)} to {percent(way.theta_hi - 1)}"
        rows.append((str(way.weeks_before), str(way.weeks_to_wait), weeks, f"{way.power:.0%}", measured))
    lines += [*table(rows), ""]
    serve = [("compare with", "metres away", "moves alike (correlation)", "weeks apart by")]
    for area in found.comparison:
        alike = "–" if area.correlation is None else f"{area.correlation:.2f}"
        apart = "–" if area.sd_apart is None else f"{area.sd_apart:.0%}"
        serve.append((area.area_id, f"{area.apart_m:.1f}", alike, apart))
    return "\n".join([*lines, *table(serve), *left_out])
