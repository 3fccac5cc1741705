"""`vsd compare`: did it change, by how much, and were the reasons people, layout or behaviour."""

from __future__ import annotations

from datetime import date, timedelta
from typing import Final

import click

from vsd_analytics.cli.answers import print_answers
from vsd_analytics.cli.options import floor_option, json_option
from vsd_analytics.cli.output import plain
from vsd_analytics.cli.project import Project, pass_project, warn_of_broken_log_lines
from vsd_analytics.cli.ranges import last_monday, purged_hours_notes, warehouse_of
from vsd_analytics.errors import UsageError
from vsd_analytics.render.text import Layout, TableLayout
from vsd_analytics.site.instants import parse_range, parse_week
from vsd_analytics.wording.catalogue import say

_PARTS: Final = ("before", "after", "change", "verdict")
_COMPARED: Final = (
    "violations_per_open_h", "close_time_share", "close_min_per_open_h", "people", "violations_per_person_h"
)  # fmt: skip
_DAYS: Final = ("before_first", "before_last", "after_first", "after_last")
LAYOUTS: Final[dict[str, Layout]] = {
    "compared_periods": (TableLayout(("period", "first_date", "last_date", "recorded_share", "recorded_h")),),
    "compared_places": (
        *(TableLayout(("name", *(f"{rate}_{part}" for part in _PARTS))) for rate in _COMPARED),
        TableLayout(("name", "people_change_share"), only="people_change_share"),
    ),
    "change_causes": (TableLayout(("cause", "cause_change", "cause_verdict", "cause_share")),),
    "logged_change": (
        TableLayout(("entry", "at", "name", "text", "outcome", "comparison_area_ids")),
        TableLayout(
            ("n_weeks_each_side", "before_first", "before_last", "after_first", "after_last"), only="before_first"
        ),
        TableLayout(("left_out_first", "left_out_last"), only="left_out_first"),
    ),
    "change_so_far": (
        TableLayout(("effect", "so_far_change", "so_far_verdict", "e_value", "clear_since_week", "n_weeks_after")),
        TableLayout(("effect", "beside_all_change", "without_least", "without_most"), only="without_least"),
        TableLayout(("effect", "taken_up_share"), only="taken_up_share"),
    ),
    "change_receivers": (TableLayout(("name", "received_people_change")),),
    "change_foreseen": (TableLayout(("planned_change", "power_asked", "weeks_after", "power_then", "clear_by")),),
    "change_effects": (
        TableLayout(("effect", "effect_change", "n_comparison_areas")),
        TableLayout(("effect", "by_day", "by_week"), only="by_day"),
        TableLayout(("effect", "by_without"), only="by_without"),
        TableLayout(("effect", "placebo_least", "placebo_most", "by_placebo"), only="by_placebo"),
        TableLayout(("effect", "shrunken_change"), only="shrunken_change"),
        TableLayout(("effect", "by_line"), only="by_line"),
        TableLayout(("effect", "trend_per_week", "detectable_per_week", "n_trend_weeks"), only="n_trend_weeks"),
    ),
    "change_parts": (TableLayout(("whole", "part", "part_change")),),
    "change_places": (
        TableLayout(("place", "place_rate_change", "relative_change")),
        TableLayout(("place", "place_people_change")),
    ),
    "switchback": (
        TableLayout(("name", "in_turn_change", "in_turn_verdict", "p_value", "n_days_with", "n_days_without")),
        TableLayout(("planned_change", "first_date", "last_date", "comparison_area_ids")),
    ),
    "plan_score": (TableLayout(("made", "planned_change", "measured_change", "is_inside", "is_clear", "is_due")),),
}


@click.command()
@click.argument("periods", nargs=-1, metavar="[A B]")
@click.option("--change", "number", type=click.IntRange(min=1), metavar="N", help="Entry of the log: see vsd log list.")
@click.option(
    "--in-turn", "plan_number", type=click.IntRange(min=1), metavar="N", help="Plan of days in turn: see vsd plan."
)
@click.option("--area", "area_ids", metavar="ID", multiple=True, help="Only this area; may be given several times.")
@floor_option
@click.option(
    "--weeks", type=click.IntRange(1, 26), default=4, show_default=True, help="With --change: weeks on either side."
)
@json_option
@pass_project
def compare(
    project: Project,
    periods: tuple[str, ...],
    number: int | None,
    plan_number: int | None,
    area_ids: tuple[str, ...],
    floor_id: str | None,
    weeks: int,
    as_json: bool,
) -> int:
    """Compare two periods over the same hours, or the weeks before and after a change of the log.

    A and B are ISO weeks, `last`, `last-2`, or ranges of days. Days are paired by weekday, and only camera-hours that
    were recorded in both count. Prints violations per open hour, time too close, people, encounters per person-hour,
    and which of them made the change.

    With --change N, compares the area of entry N of the log before and after, relative to areas that were left
    alone (difference in differences), so that a change of the whole site does not look like an effect. Beside it: a
    verdict that may be read every week, what became of the whole floor, and how a plan (vsd plan) came out.

    With --in-turn N, compares the days with and without the change of plan N (vsd plan --in-turn), once, when they are
    over: the effect on time too close, with the randomisation test of the coins that chose the days.

    Exit code 1: the periods cannot be compared; the message says why.

    \b
    Example:
      vsd compare last-1 last
      vsd compare 2026-11-02..2026-11-08 2026-11-09..2026-11-15 --area entrance --json
      vsd compare --change 1
      vsd compare --in-turn 2
    """
    if plan_number is not None:
        if periods or number is not None or floor_id is not None or area_ids:
            raise UsageError(
                "--in-turn takes its days and area from the plan", fix=f"vsd compare --in-turn {plan_number}"
            )
        return _in_turn(project, plan_number, as_json=as_json)
    if number is not None:
        if periods or floor_id is not None or len(area_ids) > 1:
            raise UsageError("--change takes its weeks from the log, and one area", fix="vsd compare --change 1")
        return _change_of_log(project, number, area_ids[0] if area_ids else None, weeks, as_json=as_json)
    if len(periods) != 2:
        raise UsageError(
            "compare needs two periods, A and B, --change N or --in-turn N", fix="vsd compare 2026-W45 2026-W46"
        )
    return _two_periods(project, periods, area_ids, floor_id, as_json=as_json)


def _two_periods(
    project: Project, periods: tuple[str, ...], area_ids: tuple[str, ...], floor_id: str | None, *, as_json: bool
) -> int:
    from vsd_analytics.answer import Answers
    from vsd_analytics.figures import compare as figures
    from vsd_analytics.figures.compare_answers import compare_answers

    a, b = (_days(project, text) for text in periods)
    first, last = figures.days_needed(project.site, a, b)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        comparison = figures.compare(warehouse, a, b, floor_id=floor_id, area_ids=area_ids)
        answers = compare_answers(comparison, project.site, rest=say("reason.row.rest"), inputs=warehouse.inputs_digest)
        notes = purged_hours_notes(warehouse)
    days = (min(a[0], b[0]), max(a[1], b[1]))
    print_answers(Answers(answers), days=days, layouts=LAYOUTS, as_json=as_json, notes=notes)
    return 0 if comparison.state == "ok" else 1


def _change_of_log(project: Project, number: int, area_id: str | None, weeks: int, *, as_json: bool) -> int:
    from vsd_analytics.answer import Answers
    from vsd_analytics.config.plans import read_plans
    from vsd_analytics.figures.before_after import before_after
    from vsd_analytics.figures.change_answers import change_answers
    from vsd_analytics.figures.change_weeks import days_needed
    from vsd_analytics.figures.experiments import score
    from vsd_analytics.figures.week.change_effects import exact_effect
    from vsd_analytics.report.pages.change_story import came_of
    from vsd_analytics.wording.languages import speaking

    warn_of_broken_log_lines(project)
    first, last = days_needed(project.site, number, weeks=weeks)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        figure = before_after(warehouse, number, area_id=area_id, weeks=weeks)
        scored = score(figure, read_plans(project.site), zone_day=figure.at.astimezone(project.site.zone).date())
        answers = change_answers(figure, scored, project.site, inputs=warehouse.inputs_digest)
        notes = purged_hours_notes(warehouse)
    days = (answers[0].holds_for.first, answers[0].holds_for.last)
    with speaking("en"):
        story = came_of(exact_effect(project.site, figure), day=last)
    if not as_json:
        click.echo(f"{plain(figure.area_name)}: {plain(story)}\n")
    print_answers(Answers(answers), days=days, layouts=LAYOUTS, as_json=as_json, notes=notes, beside={"story": story})
    return 0 if figure.state == "ok" else 1


def _in_turn(project: Project, number: int, *, as_json: bool) -> int:
    from vsd_analytics.answer import Answers
    from vsd_analytics.figures.switchback import switchback, switchback_days
    from vsd_analytics.figures.switchback_answers import switchback_answer

    warn_of_broken_log_lines(project)
    days = switchback_days(project.site, number)
    with warehouse_of(project, week=None, days=f"{days[0]}..{days[1]}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        figure = switchback(warehouse, number)
        answer = switchback_answer(figure, project.site, inputs=warehouse.inputs_digest)
        notes = purged_hours_notes(warehouse)
    print_answers(Answers([answer]), days=days, layouts=LAYOUTS, as_json=as_json, notes=notes)
    return 0 if figure.state == "ok" else 1


def _days(project: Project, text: str) -> tuple[date, date]:
    if text.startswith("last"):
        monday = parse_week(text, last=last_monday(project))
        return monday, monday + timedelta(days=6)
    return parse_range(text)
