"""An analyst's own query, on a connection that can read facts and nothing else."""

from __future__ import annotations

import pandas as pd

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse.warehouse import Warehouse


def run_query(warehouse: Warehouse, query: str) -> pd.DataFrame:
    """Return the rows of one statement over the relations of a warehouse.

    The connection may read the project's store and facts only: no other file, no network, no extension, no setting.

    Raises:
        SqlError: E603 with DuckDB's message.
    """
    import duckdb

    con = warehouse.con
    folders = [str(warehouse.site.root / name) + "/" for name in ("store", "facts")]
    con.execute("set allowed_directories = $folders", {"folders": folders})
    con.execute("set enable_external_access = false")
    con.execute("set lock_configuration = true")
    try:
        return con.execute(query).df()
    except duckdb.Error as error:
        message = str(error).split("\n")
        raise SqlError(
            "the query could not be run", code="E603", why=" ".join(message)[:600], mend="vsd sql --list, vsd sql --show hours"
        ) from None
