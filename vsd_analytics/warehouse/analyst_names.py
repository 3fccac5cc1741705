"""What the names in an analyst's query stand for: a table of `sql/tables`, or `internal.NAME` for all that lies behind.

A query is parsed by DuckDB itself, so a name in a text, an alias or a step of the query is never taken for a table.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse.sqlfiles import Relation, queried_relations, relations

if TYPE_CHECKING:
    import duckdb

INTERNAL: Final = "internal"
"""The schema behind which an analyst's query finds facts, marts and staging."""
INSTEAD: Final = {
    "located": "trajectories",
    "pairs": "episodes",
    "camera_episodes": "episodes",
    "whole_episodes": "episodes",
    "heatmap": "cells",
    "floor_cells": "cells",
    "cell_hours": "cells",
    "cell_days": "cells",
    "square_hours": "cells",
    "hour_states": "hours",
    "exposure": "camera_hours",
    "coverage": "camera_hours",
    "violation_time": "camera_hours",
    "camera_days": "camera_hours",
    "camera_hour_records": "camera_hours",
    "camera_slots": "camera_hours",
    "area_counts": "area_hours",
    "area_stays": "visits",
    "area_tracks": "area_hours",
    "area_people": "area_hours",
    "track_hours": "camera_hours",
    "waits": "queues",
    "moves": "flow",
}
"""The table that answers most questions asked of an internal relation."""


@dataclass(frozen=True, slots=True)
class NamedQuery:
    """An analyst's query with its names resolved.

    Attributes:
        text: The query as it runs.
        tables: Tables that it names, in order; the text calls each `table_view(name)`.
        relations: Internal relations that it names.
    """

    text: str
    tables: tuple[str, ...]
    relations: tuple[str, ...]

    @property
    def reads(self) -> tuple[str, ...]:
        """Return the internal relations that it reads, by itself or through a table."""
        files = relations("tables")
        behind = (name for table in self.tables if table in files for name in files[table].reads)
        return tuple(dict.fromkeys([*self.relations, *behind]))


def table_view(name: str) -> str:
    """Return what a table is called on the connection, where the bare name is that of a mart."""
    return f"table_{name}"


def sql_tables() -> dict[str, Relation]:
    """Return the tables that are SQL files, by name."""
    return dict(relations("tables"))


def named_query(
    con: duckdb.DuckDBPyConnection, query: str, *, tables: Collection[str], given: Collection[str] = ()
) -> NamedQuery:
    """Return a query with `hours` resolved to the table and `internal.hours` to the mart.

    Args:
        con: Any connection: it parses, and runs nothing.
        query: One `select`. A text that DuckDB cannot parse comes back as it is, for DuckDB to explain.
        tables: Names of all tables.
        given: Names of the caller's own tables.

    Raises:
        SqlError: E603, a relation is named without `internal.`, or `internal` has no such relation.
    """
    import duckdb

    try:
        [(serialized,)] = con.execute("select json_serialize_sql($query)", {"query": query}).fetchall()
    except (duckdb.Error, UnicodeEncodeError):
        return NamedQuery(query, (), ())
    parsed = json.loads(serialized)
    if parsed["error"]:
        return NamedQuery(query, (), ())
    named, internal = dict[str, None](), dict[str, None]()
    for node in list(_table_nodes(parsed["statements"], frozenset())):
        schema, name = node["schema_name"].lower(), node["table_name"].lower()
        if schema == INTERNAL:
            _check_internal(name, tables)
            internal[name] = None
            _rename(node, name, shown=node["table_name"])
        elif not schema and name in tables:
            named[name] = None
            _rename(node, table_view(name), shown=node["table_name"])
        elif not schema and name in internal_names() and name not in given:
            _check_internal(name, tables)
            instead = INSTEAD.get(name)
            raise SqlError(
                f"{name} is internal",
                code="E603",
                why="relations behind the tables change without notice, and reach beyond the days asked for",
                fix=f"use {INTERNAL}.{name}" + (f", or the table {instead}" if instead else "; vsd sql --list: tables"),
            )
    if not named and not internal:
        return NamedQuery(query, (), ())
    text = con.execute("select json_deserialize_sql($parsed::json)", {"parsed": json.dumps(parsed)}).fetchall()[0][0]
    return NamedQuery(text, tuple(named), tuple(internal))


def internal_names() -> Collection[str]:
    """Return the names of facts, marts and staging."""
    return {*queried_relations(), *relations("staging")}


def _check_internal(name: str, tables: Collection[str]) -> None:
    if name in queried_relations():
        return
    why = "it is a step of the build and exists only meanwhile" if name in relations("staging") else None
    fix = f"use {name}, without {INTERNAL}." if name in tables else "vsd sql --list names them all"
    raise SqlError(f"{INTERNAL} has no relation {name!r}", code="E603", why=why, fix=fix)


def _rename(node: dict[str, Any], name: str, *, shown: str) -> None:
    """Let a table of a parsed query be another one that the query goes on calling by its own name."""
    node.update(schema_name="", table_name=name, qualified_name={"path": [name]}, alias=node["alias"] or shown)


def _table_nodes(node: Any, steps: frozenset[str]) -> Iterator[dict[str, Any]]:
    """Yield the tables of a parsed query that are not steps of it (`with NAME as`)."""
    if isinstance(node, list):
        for part in node:
            yield from _table_nodes(part, steps)
        return
    if not isinstance(node, dict):
        return
    if node.get("type") == "BASE_TABLE":
        if node["schema_name"] or node["table_name"].lower() not in steps:
            yield node
        return
    if node.get("type") == "RECURSIVE_CTE_NODE":
        steps = steps | {str(node.get("cte_name", "")).lower()}
    for entry in (node.get("cte_map") or {}).get("map", ()):
        yield from _table_nodes(entry["value"], steps)
        steps = steps | {entry["key"].lower()}
    for key, part in node.items():
        if key != "cte_map":
            yield from _table_nodes(part, steps)
