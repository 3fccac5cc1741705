"""`vsd coverage`: the share of opening hours that each camera recorded."""

from __future__ import annotations

from typing import Any

import click

from vsd_analytics.cli.options import json_option, range_options
from vsd_analytics.cli.output import emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import not_over_note, noted, purged_hours_notes, warehouse_of, warn

_GAPS_SHOWN = 20


@click.command()
@range_options
@json_option
@pass_project
def coverage(project: Project, week: str | None, days: str | None, as_json: bool) -> None:
    """Print how much of the opening hours each camera recorded, and what is missing.

    Of a week that is not over, hours that are not over count neither as recorded nor as missing.

    \b
    Example:
      vsd coverage --week last
    """
    from vsd_analytics.figures import operator_counts

    read = ("hours", "camera_hours", "message_gaps", "outages", "sequence_runs")
    with warehouse_of(project, week=week, days=days, relations=read) as warehouse:
        until_ms = operator_counts.begun_until_ms(warehouse, now=project.now)
        found = operator_counts.coverage(warehouse, until_ms=until_ms)
        notes, unfinished = purged_hours_notes(warehouse), not_over_note(warehouse, until_ms)
    if as_json:
        emit_json(noted(found, notes + unfinished))
        return
    warn(notes)
    for note in unfinished:
        project.say(note)
    dates = [d["date"][5:] for c in found["cameras"][:1] for d in c["days"][-14:]]
    click.echo(f"{'camera':<16} {'recorded':<28} {' '.join(dates)}")
    for camera in found["cameras"]:
        strip = " ".join("    –" if d["share"] is None else f"{d['share']:5.0%}" for d in camera["days"][-14:])
        share = (
            "no opening hours"
            if camera["share"] is None
            else f"{camera['share']:.0%} of {round(camera['scheduled_h'], 1):g} open hours"
        )
        click.echo(f"{camera['camera_id']:<16} {share:<28} {strip}")
    if found["outages"]:
        click.echo("\nmissing (10 minutes or more of opening hours):")
    for o in found["outages"]:
        inferred = "  inferred: the engine sends no heartbeat" if o["is_inferred"] else ""
        click.echo(f"  {o['camera_id']:<14} {o['start']} to {o['end']}  {o['open_h']:.1f} open h{inferred}")
    if found["gaps"]:
        _print_gaps(found)
    for r in found["restarts"][:_GAPS_SHOWN]:
        click.echo(f"  {r['camera_id']:<14} {r['start']} to {r['end']}  the engine began a new count")


def _print_gaps(found: dict[str, Any]) -> None:
    n, gaps = found["n_missing"], found["gaps"]
    plural = "" if n == 1 else "s"
    click.echo(f"\n{n:,} message{plural} never arrived (or went to quarantine), by the engine's running number:")
    for g in gaps[:_GAPS_SHOWN]:
        numbers = f"{g['first_missing']}" + (f" to {g['last_missing']}" if g["n_missing"] > 1 else "")
        click.echo(f"  {g['camera_id']:<14} {g['start']} to {g['end']}  {g['n_missing']:,}: {numbers}")
    if len(gaps) > _GAPS_SHOWN:
        click.echo(f"  and {len(gaps) - _GAPS_SHOWN:,} more gaps: vsd coverage --json")
