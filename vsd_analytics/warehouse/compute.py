"""Rows of facts, computed from stored parts on one DuckDB connection."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import pyarrow as pa

from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.duck import connect, literal_list
from vsd_analytics.store.layout import HOUR_MS, Part
from vsd_analytics.warehouse.accelerated.switch import (
    Accelerator,
    IdsNeededError,
    accelerated_camera_days,
    needs_only_counts,
)
from vsd_analytics.warehouse.dimensions import camera_table, params, quarters, register_site, site_relations
from vsd_analytics.warehouse.duckdb_failures import failed_inside, inside
from vsd_analytics.warehouse.graphs import components
from vsd_analytics.warehouse.held import ENUMS, Held
from vsd_analytics.warehouse.input_fingerprint import dependencies
from vsd_analytics.warehouse.lookback import lookback_ms
from vsd_analytics.warehouse.sqlfiles import Relation, relations
from vsd_analytics.warehouse.staff import NOBODY, StaffHours
from vsd_analytics.warehouse.stored_records import PartReader, columns_of, read_records, with_names

if TYPE_CHECKING:
    import duckdb

Parts = Mapping[TableName, Sequence[Part]]


def day_facts(site: Site, parts: Parts) -> pa.Table:
    """Return the rows of the fact `camera_days`.

    Args:
        site: The project.
        parts: Stored parts of whole UTC days.
    """
    rows = accelerated_camera_days(parts, camera_table(site), params(site))
    if rows is not None:
        return rows
    with connect() as con:
        register_site(con, site)
        for table in TABLES:
            rows = f"read_parquet({literal_list(p.path for p in parts[table])}, union_by_name = true)"
            con.execute(
                f"create temp view stored_{table} as select * from {rows if parts[table] else _empty(con, table)}"
            )
        return con.sql(relations("facts")["camera_days"].sql).to_arrow_table()


def hour_facts(
    site: Site,
    *,
    facts: Collection[str],
    parts: Parts,
    camera_days: pa.Table,
    first_hour: int,
    last_hour: int,
    staff: StaffHours = NOBODY,
    reader: PartReader | None = None,
) -> Iterator[tuple[Relation, pa.Table]]:
    """Yield hourly facts with their rows of the hours from `first_hour` to `last_hour`, by hour and grain.

    Ids are texts, or dictionaries that have other names, too. Relations of `sql/staging` with an instant can be asked
    for as well; their rows come in any order.

    The rows of an hour depend only on the records of that hour and of its two neighbours at most `lookback_ms` away,
    not on the other hours that are computed with it.

    Args:
        site: The project.
        facts: Names of the relations to yield. Others that these read are computed too, but not yielded.
        parts: Stored parts of the hours, and of their neighbours those that lie near enough.
        camera_days: The fact of all UTC days these lie in.
        first_hour: First UTC hour number.
        last_hour: Last one, inclusive.
        staff: Who is staff in these hours and beside them.
        reader: Has parts that the batch before read.

    Raises:
        SqlError: E604, DuckDB fails internally, also with careful settings.
    """
    computed, inputs = dependencies(facts)
    settings = params(site)
    margin_ms = lookback_ms(settings, camera_days.to_pylist())
    spans = (first_hour * HOUR_MS - margin_ms, (last_hour + 1) * HOUR_MS + margin_ms)
    around = quarters(first_hour=first_hour - 1, last_hour=last_hour + 1)
    reader = reader or PartReader()
    reader.of_site = reader.of_site or site_relations(site)
    small = {**reader.of_site, "quarters": around, "camera_days": camera_days}
    small["staff"] = staff.between(first_hour - 1, last_hour + 1)
    yielded = set[str]()  # before DuckDB failed: a second try computes them again but must not yield them twice
    tables = [t for t in TABLES if f"stored_{t}" in inputs]
    counts = needs_only_counts(facts, parts, site.settings.people)
    for only_counts, is_careful in ((True, False), (False, False), (False, True))[not counts :]:
        name = ""
        try:
            name = "stored records"
            if only_counts:
                records = reader.counted(parts, first_hour, last_hour, margin_ms)
            else:
                records = {table: read_records(table, parts[table], *spans) for table in tables}
            with _load(small, records, is_careful, only_counts) as held:
                accelerator = Accelerator(held, settings, is_careful=is_careful, only_counts=only_counts)
                order = [r for r in relations("staging", "facts").values() if r.name in computed]
                last_read = {t: n for n, r in enumerate(order) for t in r.reads if t.startswith("stored_")}
                for number, relation in enumerate(order):
                    name = relation.name
                    is_array = accelerator.computes(relation)
                    if not is_array:
                        held.publish(relation.reads)
                        create(held.con, relation)
                    if name in facts and name not in yielded:
                        hours = (first_hour, last_hour)
                        yield relation, held.table(relation, *hours) if is_array else _rows(held.con, relation, *hours)
                        yielded.add(name)
                    if relation.layer == "facts":
                        held.forget(name)
                    for table in (t for t, last in last_read.items() if last == number):
                        held.forget(table)
            return
        except IdsNeededError:
            continue
        except inside() as error:
            if is_careful:
                raise failed_inside(
                    error, relation=name, parts=parts, first_hour=first_hour, last_hour=last_hour
                ) from error


def create(con: duckdb.DuckDBPyConnection, relation: Relation) -> None:
    """Create a relation as a table; the connection must have all it reads. Of a graph, create the components."""
    if not relation.is_graph:
        con.execute(f"create temp table {relation.name} as {relation.sql}")
        return
    *keys, _, _ = relation.columns
    columns = ", ".join([*keys, "cast(node_a as bigint) as node", "cast(node_b as bigint) as component"])
    con.execute(f"create temp table {relation.name} as select {columns} from ({relation.sql}) limit 0")
    con.register(f"_{relation.name}", components(con.sql(relation.sql).to_arrow_table()))
    con.execute(f"insert into {relation.name} select * from _{relation.name}")
    con.unregister(f"_{relation.name}")


def _load(small: Mapping[str, pa.Table], records: Mapping[str, pa.Table], is_careful: bool, only_counts: bool) -> Held:
    """Return stored records by table beside the small tables; the ids of all are enums."""
    with_cameras = (rows["camera_id"] for rows in small.values() if "camera_id" in rows.column_names)
    records, names = with_names(records, (camera for column in with_cameras for camera in column.unique().to_pylist()))
    held = Held(small, names, is_careful=is_careful)
    for table, rows in records.items():
        held.add_stored(f"stored_{table}", rows, columns_of(rows, is_lean=only_counts))
    return held


def _rows(con: duckdb.DuckDBPyConnection, relation: Relation, first_hour: int, last_hour: int) -> pa.Table:
    """Return the rows of a fact in a range of hours, with texts for enums: a file holds no names of other hours."""
    columns = (f"cast({c} as varchar) as {c}" if c in ENUMS else c for c in relation.columns)
    hour = "hour" if "hour" in relation.columns else f"ts_ms // {HOUR_MS:d}"
    inside = f"{hour} between {first_hour:d} and {last_hour:d}"
    return con.sql(f"select {', '.join(columns)} from {relation.name} where {inside}").to_arrow_table()


def _empty(con: duckdb.DuckDBPyConnection, table: TableName) -> str:
    con.register(f"_empty_{table}", SCHEMAS[table].empty_table())
    return f"_empty_{table}"
