"""`vsd target`: the target of a floor, in violations per open hour."""

from __future__ import annotations

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError


@click.command()
@click.argument("value", type=float, required=False)
@click.option("--none", "is_taken_away", is_flag=True, help="Take the target away.")
@click.option("--floor", "floor_id", metavar="ID", help="Floor (default: the only one).")
@click.option("--by", metavar="NAME", help="Who sets it.")
@json_option
@pass_project
def target(
    project: Project, value: float | None, is_taken_away: bool, floor_id: str | None, by: str | None, as_json: bool
) -> None:
    """Set the target of a floor, violations per open hour to stay below, or list the changes of targets.

    It is target_per_open_h of the floor in vsd.toml, where one line changes. Pages draw it over the weeks and name it
    beside the figure, mails and the index name it, too. Who set it and when is in targets.jsonl.

    \b
    Example:
      vsd target 120 --by Anna
      vsd target --none --floor ground
      vsd target
    """
    from vsd_analytics.config.floor_targets import read_target_changes, set_target
    from vsd_analytics.site.places import known_floor

    if value is not None and is_taken_away:
        raise UsageError("VALUE and --none exclude each other", fix="leave one of them out")
    if value is not None or is_taken_away:
        floor = known_floor(project.site, floor_id)
        at = project.clock().astimezone(project.site.zone).replace(microsecond=0)
        changed = set_target(project.site, floor.floor_id, value, at=at, by=by)
        if as_json:
            emit_json({"floor": floor.floor_id, "target_per_open_h": value, "is_new": changed is not None})
        else:
            text = "no target" if value is None else f"{value:g} violations per open hour"
            click.echo(f"{plain(floor.floor_id)}  {text}{'' if changed else '  (as before)'}")
        return
    rows = [
        {"at": c.at.isoformat(), "floor": c.floor_id, "before": c.before, "after": c.after, "by": c.by}
        for c in read_target_changes(project.site)
        if floor_id in (None, c.floor_id)
    ]
    if as_json:
        emit_json({"targets": rows})
        return
    for row in rows:
        ends = ["none" if row[key] is None else f"{row[key]:g}" for key in ("before", "after")]
        who = f"  ({plain(str(row['by']))})" if row["by"] else ""
        click.echo(f"{row['at']}  {plain(str(row['floor']))}  {ends[0]} -> {ends[1]}{who}")
    if not rows:
        project.say("no target was set yet; set one: vsd target 120")
