"""`vsd forecast`: the next week hour by hour, the score of the last forecast, and unusual hours."""

from __future__ import annotations

from dataclasses import asdict
from datetime import timedelta
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, plain, rounded
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import last_monday, warehouse_of
from vsd_analytics.site.instants import parse_week
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from datetime import date

    from vsd_analytics.figures.forecast import FloorForecast, HourForecast, SeriesForecast
    from vsd_analytics.figures.unusual import UnusualWeek
    from vsd_analytics.stats.unusual import Unusual

_CELL = 15


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
    from vsd_analytics.figures import forecast as forecasting
    from vsd_analytics.figures import unusual as looking

    monday = parse_week(week, last=last_monday(project))
    days = f"{forecasting.first_day(monday)}..{monday + timedelta(days=6)}"
    with warehouse_of(project, week=None, days=days) as warehouse:
        warehouse.materialise("violations", "camera_hours", "camera_slots")
        odd = looking.unusual(warehouse, monday, floor_id=floor_id)
        outlook = None if is_unusual_only else forecasting.forecast(warehouse, monday, floor_id=floor_id)
    if as_json:
        printed = {} if outlook is None else {"forecast": asdict(outlook)}
        emit_json(rounded({**printed, "unusual": asdict(odd)}))
    else:
        if outlook is not None:
            click.echo(_outlook_text(outlook, name=project.site.name))
        click.echo(_unusual_text(odd))
    has_result = odd.state == "ok" if outlook is None else outlook.has_forecast
    return 0 if has_result else 1


def _outlook_text(outlook: FloorForecast, *, name: str) -> str:
    sunday = outlook.monday + timedelta(days=6)
    place = plain(name).replace("\n", " ") + (f", floor {outlook.floor_id}" if outlook.floor_id else "")
    lines = [f"{outlook.week} at {place}: {_day(outlook.monday)} to {_day(sunday)} {sunday.year}"]
    if outlook.left_out:
        lines.append(f"left out, without a recorded hour: {', '.join(outlook.left_out)}")
    titles = {
        "people": ("People in view, mean of the hour", outlook.people),
        "violations": ("Violations per open hour", outlook.violations),
        "gatherings": ("Chance of at least one gathering", outlook.gatherings),
    }
    for key, (title, series) in titles.items():
        if series.state == "ok":
            lines += ["", *_table(title, series, outlook, is_chance=key == "gatherings")]
        elif key != "gatherings":
            lines += ["", f"{title}: no forecast, {reason_text(series.reason)}"]
    if outlook.has_forecast:
        lines += ["", *_score_lines(outlook)]
    return "\n".join(lines)


def _table(title: str, series: SeriesForecast, outlook: FloorForecast, *, is_chance: bool) -> list[str]:
    of_range = f" ({series.range_share:.0%} range)" if series.range_share is not None else ""
    weeks = f"from the last {max(r.n_weeks for r in series.rows)} recorded weeks of each hour"
    level = "" if series.level is None else f", late weeks {_change(series.level)} the usual"
    days = [outlook.monday + timedelta(days=i) for i in range(7)]
    lines = [f"{title}{of_range}; {weeks}{level}"]
    lines.append("".join(["     ", *(f"{d:%a} {d.day}".rjust(_CELL) for d in days)]).rstrip())
    cells = {(r.hour, r.day): _cell(r, is_chance=is_chance) for r in series.rows}
    for hour in sorted({r.hour for r in series.rows}):
        row = [cells.get((hour, d), "closed" if d in outlook.closed else "") for d in days]
        lines.append(f"{hour:02d}-{hour + 1:02d}".ljust(5) + "".join(c.rjust(_CELL) for c in row).rstrip())
    if any(r.value is None for r in series.rows):
        lines.append("–: recorded in fewer than four of the weeks")
    return lines


def _cell(row: HourForecast, *, is_chance: bool) -> str:
    if row.value is None:
        return "–"
    if is_chance:
        return f"{row.value:.0%}"
    if row.lo is None or row.hi is None:
        return _number(row.value)
    return f"{_number(row.value)} ({_number(row.lo)}–{_number(row.hi)})"


def _score_lines(outlook: FloorForecast) -> list[str]:
    lines = [f"How good the forecast of {outlook.last_week} was, beside the naive one (the week before again):"]
    lines.append(f"  {'':<12}{'hours':>6}  {'off by':>8} {'naive':>8}  {'MASE':>6} {'naive':>8}  {'in range':>9}")
    for name, series in (("people", outlook.people), ("violations", outlook.violations)):
        score = series.score
        if score is None or score.state != "ok":
            reason = series.reason if score is None else score.reason
            lines.append(f"  {name:<12}not scored: {reason_text(reason)}")
            continue
        lines.append(
            f"  {name:<12}{score.n_hours:>6}  {_percent(score.wape):>8} {_percent(score.wape_naive):>8}  "
            f"{_number(score.mase):>6} {_number(score.mase_naive):>8}  {_percent(score.hit_rate):>9}"
            f" (to be {score.share:.0%})"
        )
    lines.append("  off by: sum of errors / sum of what happened; MASE: error / usual change from week to week")
    return lines


def _unusual_text(odd: UnusualWeek) -> str:
    title = f"\nUnusual hours of {odd.week}"
    if odd.state != "ok":
        return f"{title}: not known, {reason_text(odd.reason)}"
    if not odd.rows:
        return f"{title}: none in {odd.n_tested} recorded hours"
    more = f", the {len(odd.rows)} least likely of {odd.n_unusual}" if odd.n_unusual > len(odd.rows) else ""
    lines = [f"{title}, in violations (four of five such hours are in the usual range){more}:"]
    return "\n".join([*lines, *(_unusual_row(row) for row in odd.rows)])


def _unusual_row(row: Unusual) -> str:
    times = "" if row.ratio is None else f"   {row.ratio:.1f} times the usual"
    when = f"{row.day:%a} {_day(row.day)} {row.hour:02d}-{row.hour + 1:02d}"
    return f"  {when:<24}{row.violations:>6,}   usually {_number(row.usual)} ({row.lo:,.0f}–{row.hi:,.0f}){times}"


def _day(day: date) -> str:
    return f"{day.day} {day:%B}"


def _change(level: float) -> str:
    return "like" if abs(level - 1) < 0.005 else f"{abs(level - 1):.0%} {'above' if level > 1 else 'below'}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.0%}"


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    if value >= 9.95 or value == round(value):
        return f"{value:,.0f}"
    return f"{value:.1f}" if value >= 1 else f"{value:.2g}"
