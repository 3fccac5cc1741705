"""`vsd sql`: a query of one's own over facts and marts, read only."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.options import choice_option, json_option, range_options
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import warehouse_of

if TYPE_CHECKING:
    import pandas as pd

_MISSING = "–"


@click.command()
@click.argument("query", required=False)
@range_options
@click.option("--show", "relation", metavar="NAME", help="Print the SQL file of a relation instead.")
@click.option("--list", "as_list", is_flag=True, help="List the relations that can be queried.")
@choice_option("--format", "kind", choices=["table", "csv"], default="table", help="Form of the rows.")
@json_option
@pass_project
def sql(
    project: Project,
    query: str | None,
    week: str | None,
    days: str | None,
    relation: str | None,
    as_list: bool,
    kind: str,
    as_json: bool,
) -> None:
    """Run a query over facts, marts, and places of people of a range; nothing can be written.

    \b
    Example:
      vsd sql --list
      vsd sql --show hours
      vsd sql "select local_hour, sum(n_violations) from hours group by all order by 1" --week last
    """
    from vsd_analytics.errors import UsageError
    from vsd_analytics.warehouse.sqlfiles import queried_relations, relations

    known = sorted(queried_relations().values(), key=lambda r: ("staging", "facts", "marts").index(r.layer))
    if as_list:
        if as_json:
            rows = [{"name": r.name, "layer": r.layer, "row": r.description, "columns": dict(r.columns)} for r in known]
            emit_json({"relations": rows})
            return
        for r in known:
            click.echo(f"{r.layer:<7} {r.name:<18} {r.description}")
        return
    if relation is not None:
        found = [r for r in (*known, *relations("staging").values()) if r.name == relation]
        if not found:
            raise UsageError(f"no relation is called {relation!r}", fix="vsd sql --list")
        click.echo(found[0].path.read_text(encoding="utf-8"), nl=False)
        return
    if query is None:
        raise UsageError("which query?", fix='vsd sql "select * from hours"')
    from vsd_analytics.warehouse.analyst_query import query_rows, run_query
    from vsd_analytics.warehouse.relations import named_relations

    with warehouse_of(project, week=week, days=days, relations=named_relations(query)) as warehouse:
        if as_json:
            emit_json({"rows": query_rows(warehouse, query)})
            return
        frame = run_query(warehouse, query)
    if kind == "csv":
        click.echo(_csv(frame), nl=False)
    else:
        click.echo(plain(_missing_as_dash(frame).to_string(index=False, max_rows=200, na_rep=_MISSING)))


def _csv(frame: pd.DataFrame) -> str:
    """Return a frame as CSV in which no text is a formula to a spreadsheet and no control character is left."""
    from vsd_analytics.store.spreadsheet import safe_cell

    def shown(value: object) -> object:
        return safe_cell(plain(value)) if isinstance(value, str) else value

    texts = {c: frame[c].map(shown) for c in frame.columns[frame.dtypes.map(lambda kind: kind.kind == "O")]}
    named = frame.assign(**texts).set_axis([shown(str(c)) for c in frame.columns], axis="columns")
    return named.to_csv(index=False, lineterminator="\n")


def _missing_as_dash(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a frame whose masked columns hold a dash for what is missing; `na_rep` does it for all others."""
    import pandas as pd

    masked = [c for c, kind in frame.dtypes.items() if isinstance(kind, pd.api.extensions.ExtensionDtype)]
    return frame.assign(**{str(c): frame[c].astype(object).where(frame[c].notna(), _MISSING) for c in masked})
