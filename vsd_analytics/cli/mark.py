"""`vsd mark`: areas and fixtures that are there from a day on, or until one."""

from __future__ import annotations

import re
import shlex
from datetime import date
from typing import Any, Final

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError

EXAMPLE: Final = 'vsd mark shelf "Display" --corners "2,7 3,7 3,8 2,8"'
_CORNER: Final = re.compile(r"\s*(-?\d+(?:\.\d+)?)\s*,\s*(-?\d+(?:\.\d+)?)\s*")


@click.command()
@click.argument("kind", required=False)
@click.argument("name", required=False)
@click.option("--corners", metavar="M", help='Its corners in floor metres: "2,7 3,7 3,8 2,8".')
@click.option("--floor", "floor_id", metavar="ID", help="Its floor (default: the only one).")
@click.option("--end", "ended", metavar="ID", help="Say that this place is not there any more.")
@click.option("--take-back", "taken_back", metavar="ID", help="Take back the last change of this place.")
@click.option("--from", "first_text", metavar="DATE", help="From this day on (default: today).")
@click.option("--by", metavar="NAME", help="Who does it.")
@json_option
@pass_project
def mark(
    project: Project,
    kind: str | None,
    name: str | None,
    corners: str | None,
    floor_id: str | None,
    ended: str | None,
    taken_back: str | None,
    first_text: str | None,
    by: str | None,
    as_json: bool,
) -> None:
    """Mark an area or a fixture from a day on, say that it is gone, or list what was marked.

    KIND is area, shelf, wall, till or other. Weeks that are over keep the places they had, and so do their figures. A
    place is a table at the end of vsd.toml, an end is its key "to"; places.jsonl has who did it and when. A fixture
    that was moved is ended at one place and marked at another.

    \b
    Example:
      vsd mark area "Promotion" --corners "4,2 8,2 8,5 4,5" --from 2026-12-01 --by Anna
      vsd mark --end promotion --from 2026-12-24
      vsd mark --take-back promotion
      vsd mark
    """
    from vsd_analytics.config.place_edits import can_take_back, end_place, mark_place, standing, take_place_back

    site, at = project.site, project.clock().astimezone(project.site.zone)
    jobs = [kind is not None, ended is not None, taken_back is not None]
    if sum(jobs) > 1:
        raise UsageError("mark a place, end one, or take one back: not several at once", fix=EXAMPLE)
    if kind is None and (corners is not None or floor_id is not None):
        raise UsageError("--corners and --floor are of a place that is marked", fix=EXAMPLE)
    if not jobs[0] and not jobs[1] and first_text is not None:
        raise UsageError("--from is the day of a place that is marked or ended", fix=EXAMPLE)
    if not any(jobs):
        if by is not None:
            raise UsageError("--by goes with a change", fix=EXAMPLE)
        _print(standing(site), as_json=as_json)
        return
    first = at.date() if first_text is None else _day(first_text)
    if kind is not None:
        change = mark_place(
            site, kind=_kind(kind), name=_named(kind, name), floor_id=_floor(project, floor_id),
            polygon=_corners(kind, name or "", corners), first=first, at=at, by=by,
        )  # fmt: skip
        _print((change,), as_json=as_json)
    elif ended is not None:
        end = end_place(site, ended, first, at=at, by=by)
        _print((end,) if end is not None else (), as_json=as_json, nothing=f"{ended} has an end already")
    else:
        last = {c.place_id: c for c in (*standing(site), *can_take_back(site, today=at.date()))}.get(taken_back or "")
        is_done = last is not None and take_place_back(site, last, at=at, by=by)
        if as_json:
            emit_json({"id": taken_back, "is_taken_back": is_done})
        else:
            click.echo("taken back" if is_done else f"nothing that vsd mark wrote of {taken_back} holds")


def _print(changes: tuple[Any, ...], *, as_json: bool, nothing: str = "nothing was marked") -> None:
    if as_json:
        rows = [
            {
                "id": c.place_id,
                "kind": c.key,
                "name": c.name,
                "action": c.action,
                "day": c.day.isoformat(),
                "by": c.by,
                "at": c.at.isoformat(),
            }
            for c in changes
        ]
        emit_json({"places": rows})
        return
    for c in changes:
        words = "from" if c.action == "marked" else "no longer from"
        who = f"  ({plain(c.by)})" if c.by else ""
        click.echo(f"{c.place_id}: {plain(c.name)}, {c.key}, {words} {c.day}{who}")
    if not changes:
        click.echo(nothing)


def _kind(text: str) -> Any:
    from vsd_analytics.config.place_edits import KINDS

    if text not in KINDS:
        raise UsageError(f"{text!r} is no kind of place", why=f"it is one of {', '.join(KINDS)}", fix=EXAMPLE)
    return text


def _named(kind: str, name: str | None) -> str:
    if name is None:
        raise UsageError(f"what is the {kind} called?", fix=EXAMPLE)
    return name


def _floor(project: Project, floor_id: str | None) -> str:
    from vsd_analytics.site.places import known_floor

    return known_floor(project.site, floor_id).floor_id


def _corners(kind: str, name: str, text: str | None) -> list[tuple[float, float]]:
    fix = f'vsd mark {kind} {shlex.quote(name)} --corners "2,7 3,7 3,8 2,8"'
    if text is None:
        raise UsageError("where is it?", fix=fix)
    matches = [_CORNER.fullmatch(part) for part in re.split(r"[;\s]+(?=-?\d+(?:\.\d+)?\s*,)", text.strip())]
    if len(matches) < 3 or None in matches:
        why = "three corners or more, each as x,y in floor metres"
        raise UsageError(f"{text!r} are no corners of a place", why=why, fix=fix)
    return [(float(m[1]), float(m[2])) for m in matches if m is not None]


def _day(text: str) -> date:
    from vsd_analytics.site.instants import parse_range

    first, last = parse_range(text)
    if first != last:
        raise UsageError(f"{text!r} is not one day", fix=f"--from {first}")
    return first
