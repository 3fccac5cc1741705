"""An analyst's own SQL query, on a connection that can read the project's data and nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime
from decimal import Decimal
from itertools import count
from typing import TYPE_CHECKING, Any, TypeVar

import pandas as pd

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse.warehouse import Warehouse

if TYPE_CHECKING:
    import duckdb

T = TypeVar("T")

EXACT_FLOAT = 2**53
"""Integers below this are exact in float64, so converting a column back to integers loses nothing."""


def run_query(warehouse: Warehouse, query: str) -> pd.DataFrame:
    """Return the rows of one `select` over the relations of a warehouse as a pandas frame.

    The statement can read the project's store and facts only: no other file, no network, no extension, no setting. It
    must be a query, so it cannot write. The connection stays restricted afterwards.

    Raises:
        SqlError: E603, the query fails (with DuckDB's message), or the text is not one query.
    """

    def read(con: duckdb.DuckDBPyConnection, statement: duckdb.Statement) -> pd.DataFrame:
        rows = con.sql(statement)
        kinds = [str(kind) for kind in rows.types]
        frame: pd.DataFrame = rows.df()
        for i, kind in enumerate(kinds):  # DuckDB sums counts to HUGEINT, which pandas would show as 12.0
            column = frame.iloc[:, i]
            if kind == "HUGEINT" and bool((column.dropna().abs() < EXACT_FLOAT).all()):
                frame.isetitem(i, column.astype("Int64").array)
        return frame

    return _run(warehouse, query, read)


def query_rows(warehouse: Warehouse, query: str) -> list[dict[str, Any]]:
    """Return the rows of one `select` as dictionaries for JSON; limits and errors as in `run_query`.

    Missing values, NaN and infinities are None, also inside lists. Types that JSON lacks become text. Columns with the
    same name get `_1`, `_2`, as in a frame.
    """

    def read(con: duckdb.DuckDBPyConnection, statement: duckdb.Statement) -> list[dict[str, Any]]:
        rows, names = con.sql(statement).to_arrow_table(), list[str]()
        for column in rows.column_names:
            again = (f"{column}_{n}" for n in count(1))
            names.append(column if column not in names else next(a for a in again if a not in names))
        return [{k: _plain(v) for k, v in row.items()} for row in rows.rename_columns(names).to_pylist()]

    return _run(warehouse, query, read)


def _run(warehouse: Warehouse, query: str, read: Callable[[duckdb.DuckDBPyConnection, duckdb.Statement], T]) -> T:
    import duckdb

    try:
        query.encode()  # a UnicodeEncodeError is a ValueError
        statements = warehouse.con.extract_statements(query)
        if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
            raise SqlError(
                "the text is not one query",
                code="E603",
                why="only a single select is allowed: a query cannot write, set or attach anything",
                fix='vsd sql "select * from hours"',
            )

        def restrict_and_read(con: duckdb.DuckDBPyConnection) -> T:
            _restrict(con, warehouse)
            return read(con, con.extract_statements(query)[0])

        return warehouse.run(query, restrict_and_read)
    except (duckdb.Error, OverflowError, ValueError) as error:  # the latter: rows Python or pandas cannot hold
        raise SqlError(
            "the query could not be run",
            code="E603",
            why=" ".join(str(error).split())[:600],
            fix="vsd sql --list, vsd sql --show hours",
        ) from None


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
    """Restrict the connection to the project's store and facts; DuckDB allows no way back."""
    if con.execute("select current_setting('lock_configuration')").fetchall()[0][0]:
        return
    folders = [f"{warehouse.site.root / name}/" for name in ("store", "facts", "sealed")]
    con.execute("set allowed_directories = $folders", {"folders": folders})
    con.execute("set enable_external_access = false")
    con.execute("set lock_configuration = true")
