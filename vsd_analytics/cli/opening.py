"""`vsd opening`: opening hours that hold from a day on."""

from __future__ import annotations

import shlex
from datetime import date
from typing import Any

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError


@click.command()
@click.argument("hours", required=False)
@click.option("--from", "first_text", metavar="DATE", help="First day they hold, of the running week or later.")
@click.option("--take-back", "gone_text", metavar="DATE", help="Delete the change that begins on this day.")
@click.option("--by", metavar="NAME", help="Who changes them.")
@json_option
@pass_project
def opening(
    project: Project, hours: str | None, first_text: str | None, gone_text: str | None, by: str | None, as_json: bool
) -> None:
    """Change the opening hours from a day on, or list them.

    HOURS are words such as "mon-sat 08:00-20:00, sun 10:00-13:00 15:00-18:00"; days that are not named are closed.
    Weeks that are over keep the hours they had, and so do their figures. A change is a table [[opening]] at the end of
    vsd.toml.

    \b
    Example:
      vsd opening "mon-sat 08:00-20:00, sun 10:00-18:00" --from 2026-12-01 --by Anna
      vsd opening --take-back 2026-12-01
      vsd opening
    """
    from vsd_analytics.config.first_config import parse_opening_words
    from vsd_analytics.config.opening import parse_opening
    from vsd_analytics.config.opening_changes import change_opening, in_words, take_opening_back
    from vsd_analytics.site.instants import parse_range

    def day(text: str) -> date:
        first, last = parse_range(text)
        if first != last:
            raise UsageError(f"{text!r} is not one day", fix=f"{first}")
        return first

    site = project.site
    today = project.clock().astimezone(site.zone).date()
    if gone_text is not None:
        if hours is not None or first_text is not None or by is not None:
            raise UsageError(
                "--take-back takes a day and nothing else", fix=f"vsd opening --take-back {shlex.quote(gone_text)}"
            )
        gone = take_opening_back(site, day(gone_text), today=today)
        if as_json:
            emit_json({"from": gone_text, "is_taken_back": gone is not None})
        else:
            click.echo("taken back" if gone else "no opening hours begin on that day")
        return
    if hours is not None:
        if first_text is None:
            raise UsageError("from which day on?", fix=f"vsd opening {shlex.quote(hours)} --from {today}")
        week, _ = parse_opening(parse_opening_words(hours))
        changed = change_opening(site, week, first=day(first_text), today=today, by=by)
        if as_json:
            emit_json({"from": first_text, "hours": in_words(week), "is_new": changed is not None})
        else:
            click.echo(f"from {first_text}: {_line(in_words(week))}{'' if changed else '  (as before)'}")
        return
    if first_text is not None or by is not None:
        since = shlex.quote(first_text or f"{today}")
        raise UsageError(
            "--from and --by go with opening hours", fix=f'vsd opening "mon-sat 08:00-20:00" --from {since}'
        )
    rows: list[dict[str, Any]] = [
        {"from": None, "hours": None if site.opening is None else in_words(site.opening), "by": None},
        *({"from": f"{c.first}", "hours": in_words(c.opening), "by": c.by} for c in site.opening_changes),
    ]
    if as_json:
        emit_json({"opening": rows})
        return
    for row in rows:
        since = f"from {row['from']}" if row["from"] else "until then" if len(rows) > 1 else "always"
        who = f"  ({plain(str(row['by']))})" if row["by"] else ""
        click.echo(f"{since}: {_line(row['hours'])}{who}")


def _line(hours: object) -> str:
    if not isinstance(hours, dict):
        return "open around the clock"
    return ", ".join(f"{day} {spans or 'closed'}" for day, spans in hours.items())
