"""Rows of a test's own in the place of a mart."""

from __future__ import annotations

from typing import Any

import pyarrow as pa

from vsd_analytics.warehouse.warehouse import Warehouse

_schemas: dict[str, pa.Schema] = {}
"""Columns of marts: they do not depend on a site, and to ask for them makes all relations that a mart reads."""


def plant(warehouse: Warehouse, mart: str, rows: Any) -> None:
    """Put `rows` (an Arrow table or a frame) in the place of a mart; columns they lack are there, and null."""
    if mart not in _schemas:
        _schemas[mart] = warehouse.table(f"select * from {mart} limit 0").schema
    con, catalog = warehouse.con, warehouse._catalog
    for kind, names in (("view", catalog._views), ("table", catalog._tables)):
        if mart in names:
            con.execute(f"drop {kind} {mart}")
            names.discard(mart)
    con.register("_columns", _schemas[mart].empty_table())
    con.register("_planted", rows)
    con.execute(f"create temp table {mart} as select * from _columns union all by name select * from _planted")
    con.unregister("_planted")
    con.unregister("_columns")
    catalog._tables.add(mart)
