"""`vsd log`: the site's change log."""

from __future__ import annotations

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project, warn_of_broken_log_lines


@click.group()
def log() -> None:
    """Write and list the site's change log: what was moved, when and where.

    \b
    Example:
      vsd log add "moved the exhibit" --at 2026-11-11T12:00 --area entrance
      vsd log list
    """


@log.command("add")
@click.argument("text")
@click.option("--at", metavar="INSTANT", help="When, in the site's zone unless it has an offset (default: now).")
@click.option("--area", metavar="ID", help="Area it concerns (default: the whole site).")
@json_option
@pass_project
def log_add(project: Project, text: str, at: str | None, area: str | None, as_json: bool) -> None:
    """Add one entry. An entry with the same time, area and text as another is not added again.

    \b
    Example:
      vsd log add "moved the exhibit away from the entrance" --at 2026-11-11T12:00 --area entrance
    """
    from vsd_analytics.config.change_log import add_entry, entry_dict

    added = add_entry(project.site, text=text, at=at if at is not None else project.now, area=area)
    entry = added.entry
    for line in added.removed:
        click.echo(plain(f"removed an incomplete line: {line}"), err=True)
    if as_json:
        emit_json({**entry_dict(entry), "is_new": added.is_new})
        return
    click.echo(f"{entry.at.isoformat(timespec='minutes')}  {entry.area_id or 'whole site'}  {entry.text}")
    if not added.is_new:
        project.say("the log has this entry already (same time, area and text): nothing was added")


@log.command("list")
@json_option
@pass_project
def log_list(project: Project, as_json: bool) -> None:
    """List the entries by time, with their numbers for vsd compare --change.

    \b
    Example:
      vsd log list
      vsd log list --json
    """
    from vsd_analytics.config.change_log import entry_dict, read_log

    warn_of_broken_log_lines(project)
    entries = read_log(project.site)
    if as_json:
        emit_json({"log": [entry_dict(entry) for entry in entries]})
        return
    for number, entry in enumerate(entries, start=1):
        text, area = " ".join(plain(entry.text).split()), plain(entry.area_id or "whole site")
        click.echo(f"{number:>3}  {entry.at.isoformat(timespec='minutes')}  {area}  {text}")
    if not entries:
        project.say('no entries yet; add one: vsd log add "what was moved" --at 2026-11-11T12:00')
