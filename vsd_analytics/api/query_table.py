"""The rows of a query over the tables of some days and tables of the caller's."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from vsd_analytics.api.computed_tables import COMPUTED
from vsd_analytics.api.table import Table
from vsd_analytics.errors import UsageError
from vsd_analytics.store.duck import connect
from vsd_analytics.warehouse.analyst_names import internal_names, named_query, sql_tables
from vsd_analytics.warehouse.analyst_query import run_query
from vsd_analytics.warehouse.warehouse import open_warehouse

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from vsd_analytics.api.asked_days import AskedDays


def query_table(days: AskedDays, query: str, tables: Mapping[str, pd.DataFrame | pa.Table | Table]) -> Table:
    """Return the rows of one `select`, as `Days.sql` describes it.

    Args:
        days: The days.
        query: The query.
        tables: Tables of the caller's, by name.
    """
    if not isinstance(query, str):
        raise UsageError(f"{query!r} is no query", fix='week.sql("select * from hours")')
    for name in tables:
        if name in {*sql_tables(), *COMPUTED, *internal_names()} or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            why = "a table or relation has this name, or it is no plain name"
            raise UsageError(f"{name!r} cannot be the name of a table of yours", why=why, fix=f"my_{name}=...")
    with connect(threads=1) as parser:
        named = named_query(parser, query, tables={*sql_tables(), *COMPUTED}, given=tables)
    computed = {name: getattr(days, name).arrow() for name in named.tables if name in COMPUTED}
    given = {name: rows.arrow() if isinstance(rows, Table) else rows for name, rows in tables.items()}
    with open_warehouse(days.site, days.first, days.last, relations=named.reads) as warehouse:
        rows = run_query(warehouse, query, computed=computed, given=given, known=COMPUTED)
    return Table(rows, title="Query")
