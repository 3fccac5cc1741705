"""Given rows in, expected rows out: the cases of `tests/sql/*.toml`, one file per relation.

```toml
relation = "facts/coverage"
[defaults.instants]            # values of columns a table of the file does not name
camera_id = "cam"
[[case]]
name = "the rule in words"
params = { distance_mm = 1500 }
given.instants = '''
ts_ms  covered_ms
0      1000
'''
expect = '''
quarter  recorded_ms
0        1000
'''
```
Tables are columns separated by blanks; `null` is missing. Stored tables take `ts_ms` for their `ts`. Only the columns
named under `expect` are compared, rows in any order.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import duckdb

from vsd_analytics.schema import SCHEMAS
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.store.duck import connect
from vsd_analytics.warehouse.compute import create
from vsd_analytics.warehouse.counter_lines import counter_quarters
from vsd_analytics.warehouse.dimensions import calendar, create_tables, quarters, register_site, site_days
from vsd_analytics.warehouse.sqlfiles import Relation, relations

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Case:
    relation: str
    name: str
    given: Mapping[str, list[dict[str, str]]]
    expect: list[dict[str, str]]
    params: Mapping[str, Any]
    defaults: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def label(self) -> str:
        return f"{self.relation}: {self.name}"


def cases() -> Iterator[Case]:
    for path in sorted(HERE.glob("*.toml")):
        told = tomllib.loads(path.read_text(encoding="utf-8"))
        for case in told["case"]:
            given = {name: _rows(text) for name, text in case.get("given", {}).items()}
            yield Case(
                told["relation"],
                case["name"],
                given,
                _rows(case["expect"]),
                case.get("params", {}),
                told.get("defaults", {}),
            )


def run(case: Case) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Return the rows a case's relation gives and those expected, both sorted, as texts."""
    layer, _, name = case.relation.partition("/")
    relation = relations(layer)[name]
    # a table may have the name of a mart that it reads
    created = replace(relation, name=f"table_{relation.name}") if layer == "tables" else relation
    with inputs(*relation.reads, *([] if layer == "tables" else [relation.name])) as con:
        for table, rows in case.given.items():
            assert table in relation.reads, f"{case.label}: {name} does not read {table}"
            _fill(con, table, rows, case.defaults.get(table, {}))
        for key, value in case.params.items():
            con.execute(f"update params set {key} = {value}")
        columns = list(case.expect[0]) if case.expect else list(relation.columns)
        con.execute(f"drop table if exists {created.name}")
        create(con, created)
        found = con.execute(f"select {', '.join(columns)} from {created.name}").fetchall()
    return sorted(tuple(map(_text, row)) for row in found), sorted(tuple(row.values()) for row in case.expect)


@contextmanager
def inputs(*names: str) -> Iterator[duckdb.DuckDBPyConnection]:
    """Yield a connection on which these relations exist, typed and without rows, and the filled dimensions.

    All cases share it. What one creates and changes is rolled back after it.
    """
    con = _dimensions()
    con.execute("begin")
    try:
        for name in names:
            columns = types().get(name)
            if columns is not None:
                con.execute(f"create temp table {name} ({', '.join(f'{c} {t}' for c, t in columns.items())})")
        yield con
    finally:
        con.execute("rollback")


@cache
def _dimensions() -> duckdb.DuckDBPyConnection:
    con = connect(threads=1)
    register_site(con, site())
    create_tables(con, {"quarters": quarters(first_hour=0, last_hour=5)})
    return con


def site() -> Site:
    cameras = tuple(Camera(camera_id, camera_id, "ground") for camera_id in ("cam", "cam-2"))
    return Site("shop", "Shop", "UTC", Path(), floors=(Floor("ground", "Ground"),), cameras=cameras)


@cache
def types() -> Mapping[str, Mapping[str, str]]:
    """Return columns and their types of every relation and stored table that is not a dimension."""
    con = connect(threads=1)
    register_site(con, site())
    create_tables(con, {"quarters": quarters(first_hour=0, last_hour=0)})
    found: dict[str, dict[str, str]] = {}
    for table, schema in SCHEMAS.items():
        con.register("_empty", schema.empty_table())
        con.execute(f"create temp table stored_{table} as select * from _empty")
        found[f"stored_{table}"] = _described(con, f"stored_{table}")
        con.execute(f"create temp table part_{table} as select *, 0 as part, 0 as part_hour, 0 as part_row from _empty")
        found[f"part_{table}"] = _described(con, f"part_{table}")
    day = date(1970, 1, 1)
    hours = calendar(site(), day, day)
    of_days = {
        "calendar": hours,
        "counter_quarters": counter_quarters(site(), hours["quarter"]),
        "site_days": site_days(site(), day, day),
    }
    create_tables(con, {name: rows.slice(0, 0) for name, rows in of_days.items()})
    found.update({name: _described(con, name) for name in of_days})
    for relation in (r for r in all_relations() if r.layer != "tables"):
        create(con, relation)
        found[relation.name] = _described(con, relation.name)
    return found


def all_relations() -> list[Relation]:
    layers = (("staging", "facts"), ("marts",), ("tables",), ("audits",))
    return [relation for some in layers for relation in relations(*some).values()]


def _described(con: duckdb.DuckDBPyConnection, table: str) -> dict[str, str]:
    return {row[0]: row[1] for row in con.execute(f"describe {table}").fetchall()}


def _rows(text: str) -> list[dict[str, str]]:
    lines = [line.split() for line in text.strip().splitlines()]
    return [dict(zip(lines[0], line, strict=True)) for line in lines[1:]]


def _fill(con: duckdb.DuckDBPyConnection, table: str, rows: list[dict[str, str]], defaults: Mapping[str, Any]) -> None:
    kinds = _described(con, table)
    con.execute(f"delete from {table}")
    for row in rows:
        values = {**{k: _text(v) for k, v in defaults.items()}, **row}
        if table.startswith(("stored_", "part_")):
            values["ts"] = values.pop("ts_ms")
        given = {c: v for c, v in values.items() if v != "null"}
        assert given.keys() <= kinds.keys(), f"{table} has no column {given.keys() - kinds.keys()}"
        places = ", ".join(
            "make_timestamptz(?::bigint * 1000)" if c == "ts" else f"cast(? as {kinds[c]})" for c in given
        )
        bound = [
            v.rpartition(" ")[2] if c == "ts" else v.replace("_", " ") if v == "_" else v for c, v in given.items()
        ]
        con.execute(f"insert into {table} ({', '.join(given)}) values ({places})", bound)


def _text(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}" if abs(value) < 1e6 else str(int(value))
    return str(value)
