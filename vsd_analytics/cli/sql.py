"""`vsd sql`: a query of one's own over the tables for analysts, read only."""

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
@click.option("--show", "relation", metavar="NAME", help="Print the SQL file of a table instead.")
@click.option("--list", "as_list", is_flag=True, help="List the tables, and what lies behind them.")
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
    """Run a query over the tables of a range; nothing can be written. They are described in docs/relations.md.

    What lies behind the tables, facts, marts and places of people, is internal.NAME.

    \b
    Example:
      vsd sql --list
      vsd sql --show hours
      vsd sql "select local_hour, sum(n_violations) from hours group by all order by 1" --week last
      vsd sql "select count(*) from internal.located" --week last
    """
    from vsd_analytics.api.computed_tables import COMPUTED
    from vsd_analytics.api.days import Days
    from vsd_analytics.errors import UsageError

    if as_list:
        _list(as_json=as_json)
        return
    if relation is not None:
        click.echo(_text_of(relation), nl=False)
        return
    if query is None:
        raise UsageError("which query?", fix='vsd sql "select * from hours"')
    from vsd_analytics.api.table import Table
    from vsd_analytics.store.duck import connect
    from vsd_analytics.warehouse.analyst_names import named_query, sql_tables
    from vsd_analytics.warehouse.analyst_query import query_rows, run_query

    with connect(threads=1) as parser:
        named = named_query(parser, query, tables={*sql_tables(), *COMPUTED})
    with warehouse_of(project, week=week, days=days, relations=named.reads) as warehouse:
        asked = Days(project.site, warehouse.first, warehouse.last, name="")
        computed = {name: getattr(asked, name).arrow() for name in named.tables if name in COMPUTED}
        if as_json:
            emit_json({"rows": query_rows(warehouse, query, computed=computed, known=COMPUTED)})
            return
        frame = Table(run_query(warehouse, query, computed=computed, known=COMPUTED), title="").df()
    if kind == "csv":
        click.echo(_csv(frame), nl=False)
    else:
        click.echo(plain(_missing_as_dash(frame).to_string(index=False, max_rows=200, na_rep=_MISSING)))


def _list(*, as_json: bool) -> None:
    """Print the tables, and the relations behind them as `internal.NAME`."""
    from vsd_analytics.api.computed_tables import COMPUTED_TABLES
    from vsd_analytics.warehouse.analyst_names import INTERNAL, sql_tables
    from vsd_analytics.warehouse.sqlfiles import queried_relations

    tables = [(r.name, "table", r.description, dict(r.columns)) for r in sql_tables().values()]
    tables += [(name, "table", row, dict[str, str]()) for name, row in COMPUTED_TABLES.items()]
    behind = sorted(queried_relations().values(), key=lambda r: ("marts", "facts", "staging").index(r.layer))
    rows = [*sorted(tables), *((f"{INTERNAL}.{r.name}", r.layer, r.description, dict(r.columns)) for r in behind)]
    if as_json:
        emit_json({"relations": [dict(zip(("name", "layer", "row", "columns"), row, strict=True)) for row in rows]})
        return
    for name, layer, description, _ in rows:
        click.echo(f"{layer:<7} {name:<27} {description}")


def _text_of(name: str) -> str:
    """Return the SQL file of a table, or of a relation behind the tables with or without `internal.`."""
    from vsd_analytics.api.computed_tables import COMPUTED_TABLES
    from vsd_analytics.errors import UsageError, nearest
    from vsd_analytics.warehouse.analyst_names import INTERNAL, sql_tables
    from vsd_analytics.warehouse.sqlfiles import queried_relations, relations

    bare = name.removeprefix(f"{INTERNAL}.")
    behind = {**relations("staging"), **queried_relations()}
    relation = (sql_tables() if bare == name else {}).get(bare) or behind.get(bare)
    if bare == name and name in COMPUTED_TABLES:
        why = "it is a figure with its statistics, the change log or added context, computed in Python"
        raise UsageError(f"{name} has no SQL file", why=why, fix=f'vsd sql "select * from {name}"')
    if relation is None:
        near = nearest(bare, [*sql_tables(), *behind])
        fix = "vsd sql --list" if near is None else f"vsd sql --show {near}"
        raise UsageError(f"no table or relation is called {name!r}", fix=fix)
    return relation.path.read_text(encoding="utf-8")


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

    masked = [
        c for c, kind in frame.dtypes.items() if kind.kind == "O" or isinstance(kind, pd.api.extensions.ExtensionDtype)
    ]
    return frame.assign(**{str(c): frame[c].astype(object).where(frame[c].notna(), _MISSING) for c in masked})
