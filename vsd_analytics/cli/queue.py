"""`vsd queue`: how many people wait, how long, and how many leave before they are served."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.estimates import rate_dict, rate_text, share_dict, share_text, with_limits
from vsd_analytics.cli.options import floor_option, json_option, range_options
from vsd_analytics.cli.output import emit_json, plain, rounded, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.queue_advice import forecast_dict, forecast_lines, whole_week
from vsd_analytics.cli.visits import mean_stay, time_text
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.people_present import PeopleQuantile
    from vsd_analytics.figures.periods import Period
    from vsd_analytics.figures.queues import AreaQueue
    from vsd_analytics.stats.waiting import WaitTimes

_WAITS = ("median wait", "90 % served within", "leave before")


@click.command()
@range_options
@floor_option
@click.option("--forecast", "has_forecast", is_flag=True, help="Also forecast the week after the last whole one.")
@json_option
@pass_project
def queue(
    project: Project, week: str | None, days: str | None, floor_id: str | None, has_forecast: bool, as_json: bool
) -> int:
    """Print how many people wait in an area, how long, and how many leave before the end, of areas with queue = true.

    The number of people needs no track ids; time counts where all cameras that see the area recorded. Waiting times
    need served_in, the area into which served people step. Who steps elsewhere has left before the end; a track that
    is lost inside shows that the person waited at least that long (Aalen-Johansen). Little's law checks the mean stay
    without track ids: where the two disagree, the command says so.

    With --forecast follow the people waiting in each hour of the next week, with a range that holds four of five such
    hours, from at least four recorded weeks. For queues with queue_limit, the hours that may exceed it are listed.

    Exit code 1: no number of people is known, or no waiting time of a queue that has an end.

    \b
    Example:
      vsd queue --week last
      vsd queue --week last --forecast
      vsd queue --range 2026-11-02..2026-11-15 --json
    """
    from vsd_analytics.cli.ranges import noted, period_with_history, purged_hours_notes, warn
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures.forecast import HISTORY_WEEKS
    from vsd_analytics.figures.queue_forecast import queue_forecasts
    from vsd_analytics.figures.queues import queues
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not any(a.is_queue for a in project.site.areas if a.floor_id == floor.floor_id):
        raise UsageError(
            f"no area of floor {floor.floor_id!r} is a queue",
            why="queues are computed only for areas that are said to be one",
            fix='add queue = true to an [[area]] of vsd.toml, and served_in = "till-1" for its waiting times',
        )
    n_weeks = HISTORY_WEEKS + 1 if has_forecast else None
    with period_with_history(project, floor, week=week, days=days, n_weeks=n_weeks) as period:
        found = queues(period)
        outlook = queue_forecasts(period.data, whole_week(period.last)) if has_forecast else ()
        notes = purged_hours_notes(period.data.warehouse)
    if as_json:
        printed: dict[str, Any] = {"areas": [_as_dict(q) for q in found]}
        if has_forecast:
            printed["next_week"] = [forecast_dict(f) for f in outlook]
        emit_json(noted({"first": period.first, "last": period.last, **printed}, notes))
    else:
        warn(notes)
        click.echo(plain("\n".join([_text(found, period), *forecast_lines(outlook)])))
    return 0 if all(_is_known(q) for q in found) else 1


def _is_known(of: AreaQueue) -> bool:
    has_end = of.area.served_in is not None
    return of.people.value is not None and not (has_end and (of.waiting is None or of.waiting.waits.reason is not None))


def _as_dict(of: AreaQueue) -> dict[str, Any]:
    waiting = of.waiting
    printed: dict[str, Any] = rounded(
        {
            "area_id": of.area.area_id,
            "people_waiting": rate_dict(of.people),
            "people_waiting_p90": asdict(of.busy),
            "waiting": None if waiting is None else _waits_dict(waiting.waits),
            "n_back": None if waiting is None else waiting.n_back,
            "little": None if waiting is None else asdict(waiting.stays.little),
            "why_no_waits": of.why_no_waits,
            "by_hour": [
                {"hour": h.hour, "people_waiting": rate_dict(h.people),
                 "waiting": None if h.waits is None else _waits_dict(h.waits)}
                for h in of.by_hour
            ],
            "recorded_share": of.recorded_share,
            "silent_cameras": of.silent_cameras,
            "unrecorded_hours": of.unrecorded_hours,
        }
    )  # fmt: skip
    return printed


def _waits_dict(of: WaitTimes) -> dict[str, Any]:
    return {
        "median_s": asdict(of.median),
        "p90_s": asdict(of.p90),
        "left_share": share_dict(of.left_share),
        **{name: getattr(of, name) for name in ("n_entered", "n_served", "n_left", "n_cut", "n_days")},
        "state": of.state,
        "reason": of.reason,
    }


def _text(found: tuple[AreaQueue, ...], period: Period) -> str:
    rows = [("queue", "people waiting", "90 % of the time", *_WAITS, "recorded")]
    for q in found:
        waits = None if q.waiting is None else q.waiting.waits
        rows.append(
            (q.area.name, rate_text(q.people, digits=2), _at_most(q.busy), *_waits(waits), f"{q.recorded_share:.0%}")
        )
    lines = [f"Queues, {period.first} to {period.last}", "", *table(rows)]
    for q in found:
        lines += ["", *(f"{q.area.name}: {line}" for line in _notes(q)), "", *_hours(q)]
    return "\n".join(lines)


def missed_hours(hours: tuple[int, ...]) -> list[str]:
    """Return a line on hours of the day that were never recorded; none without any."""
    if not hours:
        return []
    return [f"nothing is known of {', '.join(f'{h:02d}:00' for h in hours)}: the figures are of the other hours"]


def _at_most(of: PeopleQuantile) -> str:
    if of.value is None:
        return "–"
    return f"at most {with_limits(of.value, of.lo, of.hi, str)}"


def _waits(of: WaitTimes | None) -> tuple[str, str, str]:
    return ("–", "–", "–") if of is None else (time_text(of.median), time_text(of.p90), share_text(of.left_share))


def _hours(of: AreaQueue) -> list[str]:
    rows = [("hour", "people waiting", *_WAITS)]
    rows += [(f"{h.hour:02d}:00", rate_text(h.people, digits=2), *_waits(h.waits)) for h in of.by_hour]
    return table(rows)


def _notes(of: AreaQueue) -> list[str]:
    lines = []
    if of.silent_cameras:
        lines.append(f"nothing was recorded by {', '.join(of.silent_cameras)}: without them people are not known")
    lines += missed_hours(of.unrecorded_hours)
    if of.waiting is None:
        return lines if of.why_no_waits is None else [*lines, f"no waiting times: {reason_text(of.why_no_waits)}"]
    waits, little = of.waiting.waits, of.waiting.stays.little
    lines.append(
        f"{waits.n_entered:,} entries seen on {waits.n_days} days: {waits.n_served:,} served, {waits.n_left:,} left "
        f"before the end, {waits.n_cut:,} tracks lost; {of.waiting.n_back:,} more came back from the end"
    )
    if waits.reason is not None:
        lines.append(reason_text(waits.reason))
    return [*lines, *mean_stay(little, known=waits.reason)]
