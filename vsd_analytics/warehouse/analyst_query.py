"""An analyst's own SQL query, on a connection that can read the project's data and nothing else."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Collection, Mapping
from datetime import datetime
from decimal import Decimal
from itertools import count
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from vsd_analytics.errors import SqlError, nearest
from vsd_analytics.warehouse.analyst_names import named_query, sql_tables, table_view
from vsd_analytics.warehouse.warehouse import Warehouse

if TYPE_CHECKING:
    import duckdb


def run_query(
    warehouse: Warehouse,
    query: str,
    *,
    computed: Mapping[str, pa.Table] | None = None,
    given: Mapping[str, Any] | None = None,
    known: Collection[str] = (),
) -> pa.Table:
    """Return the rows of one `select` over the tables of a range of days.

    A bare name is a table of `sql/tables` or of `computed`; `internal.NAME` is a fact, a mart, `located` or `pairs`.
    The statement can read the project's store and facts only: no other file, no network, no extension, no setting. It
    must be a query, so it cannot write. Instants are shown in the site's zone, and an instant without zone that meets
    one is read in it. The connection stays restricted afterwards.

    Args:
        warehouse: Open over the days.
        query: The query.
        computed: Rows of the tables that are no SQL file, by name; those that the query names are enough.
        given: The caller's own tables, by the names of the query.
        known: Names of all tables that are no SQL file, to propose one where the query names none.

    Returns:
        The rows; sums of counts, which are HUGEINT, are whole numbers.

    Raises:
        SqlError: E603, the query fails (with DuckDB's message), the text is not one query, or a name is internal.
    """
    import duckdb

    own, computed = given or {}, computed or {}
    files = sql_tables()
    try:
        query.encode()  # a UnicodeEncodeError is a ValueError
        statements = warehouse.con.extract_statements(query)
        if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
            raise SqlError(
                "the text is not one query",
                code="E603",
                why="only a single select is allowed: a query cannot write, set or attach anything",
                fix='vsd sql "select * from hours"',
                in_python='week.sql("select * from hours")',
            )
        named = named_query(warehouse.con, query, tables={*files, *computed}, given=own)
        rows = {table_view(name): computed[name] for name in named.tables if name not in files}
        views = [files[name] for name in named.tables if name in files]

        def restrict_and_read(con: duckdb.DuckDBPyConnection) -> pa.Table:
            for name, values in {**own, **rows}.items():
                con.register(name, values)
            for relation in views:
                con.execute(f"create or replace temp view {table_view(relation.name)} as {relation.sql}")
            _restrict(con, warehouse)
            return _whole_sums(con.sql(con.extract_statements(named.text)[0]))

        return warehouse.run(" ".join(f"from {name}" for name in named.reads), restrict_and_read)
    except (duckdb.Error, OverflowError, ValueError) as error:  # the latter: rows that Python cannot hold
        raise _failed(str(error), {*files, *known, *own}) from None


def _failed(said: str, tables: Collection[str]) -> SqlError:
    """Return the error of a query that DuckDB cannot run; of what it would propose, only tables for analysts."""
    why = " ".join(said.split())[:600]
    if unknown := re.match(r"(Catalog Error: Table with name (\S+) does not exist!)", why):
        why, near = unknown[1], nearest(unknown[2], tables)
        if near is not None:
            why += f" Did you mean {near!r}?"
        known = f"the tables are {', '.join(sorted(tables))}"
    else:
        known = "week.hours.columns names the columns of hours"
    fix = "vsd sql --list, vsd sql --show hours"
    return SqlError("the query could not be run", code="E603", why=why, fix=fix, in_python=known)


def query_rows(warehouse: Warehouse, query: str, **tables: Any) -> list[dict[str, Any]]:
    """Return the rows of one `select` as dictionaries for JSON; arguments, limits and errors as in `run_query`.

    Missing values, NaN and infinities are None, also inside lists. Types that JSON lacks become text. Columns with the
    same name get `_1`, `_2`.
    """
    return [{k: _plain(v) for k, v in row.items()} for row in run_query(warehouse, query, **tables).to_pylist()]


def _whole_sums(relation: duckdb.DuckDBPyRelation) -> pa.Table:
    """Return rows as an Arrow table with unique names, HUGEINT as whole numbers."""
    kinds, rows = [str(kind) for kind in relation.types], relation.to_arrow_table()
    names = list[str]()
    for column in rows.column_names:
        again = (f"{column}_{n}" for n in count(1))
        names.append(column if column not in names else next(a for a in again if a not in names))
    rows = rows.rename_columns(names)
    for i, kind in enumerate(kinds):
        if kind == "HUGEINT":
            with contextlib.suppress(pa.ArrowInvalid):  # over 64 bits: the decimal stays
                rows = rows.set_column(i, names[i], rows[i].cast(pa.int64()))
    return rows


def _plain(value: Any) -> Any:
    """Return a value in a type that JSON has."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Decimal):
        return int(value) if value.as_tuple().exponent == 0 else _plain(float(value))  # sums of counts are HUGEINT
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, datetime):
        return value.isoformat()
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _restrict(con: duckdb.DuckDBPyConnection, warehouse: Warehouse) -> None:
    """Restrict the connection to the project's store and facts, in the site's zone; DuckDB allows no way back."""
    if con.execute("select current_setting('lock_configuration')").fetchall()[0][0]:
        return
    con.execute("set timezone = $zone", {"zone": warehouse.site.timezone})
    folders = [f"{warehouse.site.root / name}/" for name in ("store", "facts", "sealed")]
    con.execute("set allowed_directories = $folders", {"folders": folders})
    con.execute("set enable_external_access = false")
    con.execute("set lock_configuration = true")
