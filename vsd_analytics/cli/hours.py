"""`vsd hours`: hourly counts."""

from __future__ import annotations

from typing import Literal

import click

from vsd_analytics.cli.options import json_option, range_options
from vsd_analytics.cli.output import emit_json, rows_of
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import not_over_note, noted, purged_hours_notes, warehouse_of, warn
from vsd_analytics.errors import UsageError

_HOUR_COLUMNS = (
    *("start", "camera_id", "area_id", "person_records", "violation_records", "n_violations"),
    *("recorded_s", "cameras_down", "state"),
)

_HOUR_MIN = 60


@click.command()
@range_options
@click.option("--by", type=click.Choice(["camera", "area"]), help="One row per camera or area as well.")
@click.option("--minutes", type=int, default=60, show_default=True, help="Length of a row: 60 or 15.")
@json_option
@pass_project
def hours(
    project: Project,
    week: str | None,
    days: str | None,
    by: Literal["camera", "area"] | None,
    minutes: int,
    as_json: bool,
) -> None:
    """Print counts by hour or quarter-hour: people, violations, recorded time, state of the hour.

    An hour without data has state no_data: what happened is unknown, which does not mean that nothing happened. Over
    several cameras, recorded_s is their mean, and cameras_down says how many recorded less than half of the hour. Hours
    to come are left out. The counts are exact, for the operator: the table to share is hours.csv of vsd report.

    \b
    Example:
      vsd hours --week last
      vsd hours --range 2026-11-09..2026-11-15 --by camera --json
      vsd hours --range 2026-11-09 --minutes 15
    """
    from vsd_analytics.figures import operator_counts

    is_quarters = minutes == operator_counts.QUARTER_HOUR_MIN
    _check_length(minutes, is_quarters, by)
    read = ("hours", "camera_hours", *(["area_hours"] if by == "area" else ["quarter_hours"] if is_quarters else []))
    with warehouse_of(project, week=week, days=days, relations=read) as warehouse:
        until_ms = operator_counts.begun_until_ms(warehouse, now=project.now)
        if is_quarters:
            frame = operator_counts.quarter_hours(warehouse, until_ms=until_ms)
        else:
            frame = operator_counts.hours(warehouse, by=by, until_ms=until_ms)
        notes, hour_notes = purged_hours_notes(warehouse), not_over_note(warehouse, until_ms)
        if by is None and (silent := operator_counts.silent_cameras(warehouse)):
            of_all = f"{len(silent)} of {len(project.site.cameras)}"
            hour_notes.append(
                f"{', '.join(silent)} recorded nothing; recorded_s is the mean over cameras, {of_all} with 0 s"
            )
    if as_json:
        emit_json(noted({"quarter_hours" if is_quarters else "hours": rows_of(frame)}, notes + hour_notes))
        return
    warn(notes)
    for note in hour_notes:
        project.say(note)
    if by != "area":
        frame = frame[(frame["recorded_s"] > 0) | (frame["open_s"] > 0)]
    is_mean = len(project.site.cameras) > 1 and "cameras_down" in frame and bool(frame["cameras_down"].any())
    columns = [c for c in _HOUR_COLUMNS if c in frame and (c != "cameras_down" or is_mean)]
    shown = frame[columns].astype(dict.fromkeys(frame[columns].select_dtypes("Int64").columns, "float64"))
    click.echo(shown.to_string(index=False, na_rep="–", float_format=lambda v: f"{v:,.0f}"))


def _check_length(minutes: int, is_quarters: bool, by: str | None) -> None:
    """Raise UsageError (E101) for rows of a length that nothing counts."""
    if not is_quarters and minutes != _HOUR_MIN:
        raise UsageError(
            f"--minutes {minutes} is not counted",
            why="people and recorded time are stored by quarter-hours",
            fix="--minutes 15",
        )
    if is_quarters and by is not None:
        raise UsageError(f"--by {by} is counted by hour", why="--minutes 15 is of all cameras", fix="leave out --by")
