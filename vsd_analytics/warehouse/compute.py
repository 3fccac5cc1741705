"""The work of a build: rows of facts, computed from stored parts in one DuckDB connection."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import pyarrow as pa

from vsd_analytics.duck import connect, literal_list
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.site import Site
from vsd_analytics.store.layout import HOUR_MS, Part
from vsd_analytics.warehouse.causes import made_of
from vsd_analytics.warehouse.dimensions import params, register_quarters, register_site
from vsd_analytics.warehouse.graphs import components
from vsd_analytics.warehouse.sqlfiles import Relation, relations

if TYPE_CHECKING:
    import duckdb

Parts = Mapping[TableName, Sequence[Part]]

_UNUSED = ("quality", "distance_sd_mm")
_INTERVAL_MAX_MS = 1_200_000  # of the fact camera_days


def day_facts(site: Site, parts: Parts) -> pa.Table:
    """Return the rows of the fact `camera_days` of the UTC days whose stored parts are given."""
    with connect() as con:
        register_site(con, site)
        for table in TABLES:
            rows = f"read_parquet({literal_list(p.path for p in parts[table])}, union_by_name = true)"
            con.execute(
                f"create temp view stored_{table} as select * from {rows if parts[table] else _empty(con, table)}"
            )
        return con.sql(relations("facts")["camera_days"].sql).to_arrow_table()


def hour_facts(
    site: Site, *, facts: Collection[str], parts: Parts, camera_days: pa.Table, first_hour: int, last_hour: int
) -> Iterator[tuple[Relation, pa.Table]]:
    """Yield hourly facts with their rows of the hours from `first_hour` to `last_hour`, by hour and grain.

    The rows of an hour depend on the parts of that hour and of those beside it alone, whatever is computed with it.

    Args:
        site: The project.
        facts: Names of the facts wanted; what these are made of is computed too, and not handed out.
        parts: Stored parts of those hours and of the hours beside them.
        camera_days: The fact of all UTC days these lie in.
        first_hour: First UTC hour number.
        last_hour: Last one, inclusive.
    """
    with connect() as con:
        register_site(con, site)
        register_quarters(con, first_hour=first_hour - 1, last_hour=last_hour + 1)
        con.register("_camera_days", camera_days)
        con.execute("create temp table camera_days as select * from _camera_days")
        margin_ms = _margin_ms(site)
        made, inputs = made_of(facts)
        for table in (t for t in TABLES if f"stored_{t}" in inputs):
            _load(con, table, parts[table], first_hour * HOUR_MS - margin_ms, (last_hour + 1) * HOUR_MS + margin_ms)
        for relation in (r for r in relations("staging", "facts").values() if r.name in made):
            create(con, relation)
            if relation.name in facts:
                inside = f"select * from {relation.name} where hour between {first_hour:d} and {last_hour:d}"
                yield relation, con.sql(inside).to_arrow_table()


def create(con: duckdb.DuckDBPyConnection, relation: Relation) -> None:
    """Create a relation on a connection on which all that it reads stands: its rows, or the components of its edges."""
    if not relation.is_graph:
        con.execute(f"create temp table {relation.name} as {relation.sql}")
        return
    con.register(f"_{relation.name}", components(con.sql(relation.sql).to_arrow_table()))
    con.execute(f"create temp table {relation.name} as select * from _{relation.name}")
    con.unregister(f"_{relation.name}")


def _margin_ms(site: Site) -> int:
    """Return how far the facts of an hour look beyond it: to the next frame, and over the longest gap of an episode."""
    s = params(site)
    return max(int(s["coverage_gap_ms"]), int(s["episode_gap_ms"]), _INTERVAL_MAX_MS * 5 // 2)


def _load(
    con: duckdb.DuckDBPyConnection, table: TableName, parts: Sequence[Part], first_ms: int, after_ms: int
) -> None:
    columns = ", ".join(c for c in SCHEMAS[table].names if c not in _UNUSED)
    rows = _empty(con, table)
    if parts:  # parts written before a column existed lack it
        rows = f"(select * from {rows} union all by name select * from read_parquet($names, union_by_name = true))"
    con.execute(
        f"create temp table stored_{table} as select {columns} from {rows} "
        f"where epoch_ms(ts) >= {first_ms:d} and epoch_ms(ts) < {after_ms:d}",
        {"names": [str(p.path) for p in parts]} if parts else {},
    )


def _empty(con: duckdb.DuckDBPyConnection, table: TableName) -> str:
    con.register(f"_empty_{table}", SCHEMAS[table].empty_table())
    return f"_empty_{table}"
