"""Rows of a test's own in the place of a mart."""

from __future__ import annotations

from typing import Any

from vsd_analytics.warehouse.warehouse import Warehouse


def plant(warehouse: Warehouse, mart: str, rows: Any) -> None:
    """Put `rows` (an Arrow table or a frame) in the place of a mart; columns they lack are there, and null."""
    con = warehouse.con
    warehouse.prepare(mart)
    con.register("_planted", rows)
    con.execute(f"create or replace temp table _columns as select * from {mart} limit 0")
    is_view = con.execute("select count(*) > 0 from duckdb_views() where view_name = $m", {"m": mart}).fetchall()[0][0]
    con.execute(f"drop {'view' if is_view else 'table'} {mart}")
    con.execute(f"create temp table {mart} as select * from _columns union all by name select * from _planted")
    con.unregister("_planted")
