"""An analyst's own query, on a connection that can read facts and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse.warehouse import Warehouse

if TYPE_CHECKING:
    import duckdb


def run_query(warehouse: Warehouse, query: str) -> pd.DataFrame:
    """Return the rows of one `select` over the relations of a warehouse.

    The statement may read the project's store and facts only: no other file, no network, no extension, no setting; and
    it can write nothing, as it must be a query. The connection stays closed to everything else afterwards.

    Raises:
        SqlError: E603 with DuckDB's message, or because the text is not one query.
    """
    import duckdb

    con = warehouse.con
    try:
        _shut(con, warehouse)
        statements = con.extract_statements(query)
        if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
            raise SqlError(
                "this is not one query",
                code="E603",
                why="only a single select can be run: nothing is written, set or attached",
                mend='vsd sql "select * from hours"',
            )
        return con.execute(statements[0]).df()
    except duckdb.Error as error:
        raise SqlError(
            "the query could not be run",
            code="E603",
            why=" ".join(str(error).split())[:600],
            mend="vsd sql --list, vsd sql --show hours",
        ) from None


def _shut(con: duckdb.DuckDBPyConnection, warehouse: Warehouse) -> None:
    """Lock the connection to the project's store and facts, for good."""
    if con.execute("select current_setting('lock_configuration')").fetchall()[0][0]:
        return
    folders = [f"{warehouse.site.root / name}/" for name in ("store", "facts")]
    con.execute("set allowed_directories = $folders", {"folders": folders})
    con.execute("set enable_external_access = false")
    con.execute("set lock_configuration = true")
