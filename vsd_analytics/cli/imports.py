"""`vsd imports`: which files were imported, and what of them is stored."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import count, emit_json, plain
from vsd_analytics.cli.project import Project, pass_project

if TYPE_CHECKING:
    from vsd_analytics.store.imports import Holding, ImportLine

_SHOWN_DIGITS = 8


@click.command()
@click.option("--all", "is_all", is_flag=True, help="Also imports whose records are all gone.")
@json_option
@pass_project
def imports(project: Project, is_all: bool, as_json: bool) -> None:
    """List the imports: id, when, file, format, the records stored of it, their days and cameras.

    A record belongs to the import that brought it first. What came from a broker, or before version 0.2, belongs to no
    import. `vsd purge --import ID` takes an import back.

    \b
    Example:
      vsd imports
      vsd purge --import 3f9c21ab --dry-run
    """
    from vsd_analytics.store.imports import Holding, holdings, imports_of
    from vsd_analytics.store.removal import reading
    from vsd_analytics.store.store import Store

    store = Store(project.site.root / "store", site_id=project.site.site_id)
    if store.root.is_dir():
        store.fold()
    with reading(store.root):
        listed, held = imports_of(store.root), holdings(store)
    ids = [i for i in (*listed, *sorted(held.keys() - listed.keys())) if is_all or i in held]
    rows = [(i, listed.get(i), held.get(i, Holding())) for i in ids]
    if as_json:
        emit_json({"imports": [_as_dict(project, *row) for row in rows]})
        return
    for import_id, line, holding in rows:
        click.echo(plain(_text(project, import_id, line, holding)))
    hidden = len(listed) + len(held.keys() - listed.keys()) - len(rows)
    if not rows:
        project.say("no import is stored")
    if hidden:
        project.say(f"{count(hidden, 'import')} of which nothing is stored: vsd imports --all")


def _text(project: Project, import_id: str, line: ImportLine | None, holding: Holding) -> str:
    at = "unknown time" if line is None else line.at.astimezone(project.site.zone).isoformat(" ", "minutes")[:16]
    source = "unknown file" if line is None else f"{_from(line)}{line.source}  [{line.format}]"
    parts = [f"{count(holding.n_records.total(), 'record')}"]
    days = _days(project, holding)
    if days:
        parts.append(days[0] if len(days) == 1 else f"{count(len(days), 'day')}, {days[0]} to {days[-1]}")
        parts.append(", ".join(sorted(holding.cameras)))
    if holding.n_again:
        parts.append(f"{holding.n_again:,} more belong to others")
    if line is not None and line.is_taken_back:
        parts.append("taken back")
    return f"{import_id[:_SHOWN_DIGITS]}  {at}  {source}  {'; '.join(parts)}"


def _from(line: ImportLine) -> str:
    return f"node {line.node}: " if line.node else ""


def _as_dict(project: Project, import_id: str, line: ImportLine | None, holding: Holding) -> dict[str, Any]:
    return {
        "id": import_id,
        "at": None if line is None else line.at.isoformat(),
        "source": None if line is None else line.source,
        "format": None if line is None else line.format,
        "node": None if line is None else line.node or None,
        "records": dict(holding.n_records),
        "belonging_to_others": holding.n_again,
        "days": _days(project, holding),
        "cameras": sorted(holding.cameras),
        "is_taken_back": line is not None and line.is_taken_back,
    }


def _days(project: Project, holding: Holding) -> list[str]:
    """Return the local dates on which the UTC hours of the records begin."""
    zone = project.site.zone
    return sorted({datetime.fromtimestamp(h * 3600, tz=UTC).astimezone(zone).date().isoformat() for h in holding.hours})
