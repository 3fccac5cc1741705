"""Runs every query of `sql/staging` and `sql/facts` verbatim as Spark SQL, and compares its rows with DuckDB's.

Each query reads the rows that DuckDB gave the relations before it, so that one failure stays one. Floating numbers may
differ by a billionth; everything else must be equal. Needs pyspark and Java. Run it with

    PYTHONPATH=tests python tests/sql/prove_spark.py                # a made-up hour of two cameras
    PYTHONPATH=tests python tests/sql/prove_spark.py --project DIR  # the busiest hour of a project, and the one before

and put the table into docs/methods/several-machines.md. Exits with 1 when a query gives other rows; a query
that Spark cannot run at all is listed.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
from collections import Counter
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any

import duckdb
import pyarrow.parquet as pq
from benchmarks.made_up_site import write_site

from vsd_analytics.config.project import load_site
from vsd_analytics.schema import SCHEMAS, TABLES
from vsd_analytics.site.model import Site
from vsd_analytics.store.duck import connect, literal_list
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.compute import create, day_facts
from vsd_analytics.warehouse.dimensions import create_tables, quarters, register_site
from vsd_analytics.warehouse.sqlfiles import relations

CLOSE = 1e-9
HINT = " as materialized ("
"""A word for the planner of DuckDB, which Spark does not know. It changes no row; `same_pairs` takes 14 times as long
without it."""
Row = tuple[Any, ...]


def loaded(site: Site) -> duckdb.DuckDBPyConnection:
    """Return a connection with the inputs of facts: the busiest stored hour and the one before it, and the site."""
    store = Store(site.root / "store", site_id=site.site_id)
    parts = {table: store.parts(table) for table in TABLES}
    n_rows: Counter[int] = Counter()
    for part in parts["observations"]:
        n_rows[part.hour] += pq.read_metadata(part.path).num_rows
    busiest = max(n_rows, key=lambda hour: n_rows[hour])
    hours = (busiest - 1, busiest)
    con = connect(threads=1)
    register_site(con, site)
    create_tables(con, {"quarters": quarters(first_hour=hours[0], last_hour=hours[1])})
    for table in TABLES:
        paths = [p.path for p in parts[table] if p.hour in hours]
        rows = f"read_parquet({literal_list(paths)}, union_by_name = true, hive_partitioning = false)"
        con.register("_empty", SCHEMAS[table].empty_table())
        con.execute(f"create temp table stored_{table} as select * from {rows if paths else '_empty'}")
    days = {hour // 24 for hour in hours}
    con.register(
        "_days", day_facts(site, {t: [p for p in found if p.hour // 24 in days] for t, found in parts.items()})
    )
    con.execute("create temp table camera_days as select * from _days")
    return con


def session() -> Any:
    """Return a Spark session of this process: UTC, ANSI rules, one core."""
    from pyspark.sql import SparkSession

    os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
    os.environ.setdefault("SPARK_LOCAL_IP", "127.0.0.1")
    settings = {
        "spark.sql.session.timeZone": "UTC",
        "spark.sql.ansi.enabled": "true",
        "spark.sql.shuffle.partitions": "1",
        "spark.ui.enabled": "false",
        "spark.log.level": "ERROR",
    }
    builder = SparkSession.builder.master("local[1]").appName("vsd facts")
    for name, value in settings.items():
        builder = builder.config(name, value)
    return builder.getOrCreate()


def plain(value: Any) -> Any:
    """Return a value as both engines can give it: whole numbers as int, others as float, instants as milliseconds."""
    if isinstance(value, Decimal):
        return int(value) if value == value.to_integral_value() else float(value)
    if isinstance(value, datetime):
        return round(value.timestamp() * 1000)
    if isinstance(value, float):
        return None if math.isnan(value) else int(value) if value.is_integer() else value
    return value


def in_order(rows: list[Row]) -> list[Row]:
    found = [tuple(map(plain, row)) for row in rows]
    return sorted(found, key=lambda row: tuple((v is not None, str(type(v)), v) for v in row))


def n_differing(ours: list[Row], theirs: list[Row]) -> int:
    """Return how many cells differ; all of them where the number of rows does."""
    if len(ours) != len(theirs):
        return sum(map(len, ours)) or 1
    cells = ((a, b) for x, y in zip(in_order(ours), in_order(theirs), strict=True) for a, b in zip(x, y, strict=True))
    return sum(1 for a, b in cells if a != b and not _is_close(a, b))


def _is_close(a: Any, b: Any) -> bool:
    return all(isinstance(v, int | float) for v in (a, b)) and math.isclose(a, b, rel_tol=CLOSE)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--project", type=Path)
    given = parser.parse_args()
    n_wrong, n_equal, n_cells, refused = 0, 0, 0, dict[str, str]()
    with tempfile.TemporaryDirectory() as folder:
        root = given.project
        if root is None:
            root = Path(folder) / "project"
            root.mkdir()
            write_site(root, n_records=26_000, n_cameras=2, open_h=1)
        spark = session()
        con = loaded(load_site(root, environ={}))
        known: set[str] = set()

        def hand_over(name: str) -> None:
            path = f"{folder}/{name}.parquet"
            pq.write_table(con.sql(f"select * from {name}").to_arrow_table(), path)
            spark.read.parquet(path).createOrReplaceTempView(name)
            known.add(name)

        print("\n| relation | rows | cells that differ |\n|---|--:|--:|")
        for relation in relations("staging", "facts").values():
            if relation.name == "camera_days":
                continue
            for name in {*relation.reads, "params"} - known:
                hand_over(name)
            create(con, relation)
            ours = con.sql(relation.sql).fetchall()
            sql = relation.sql.replace(HINT, " as (")
            try:
                theirs = [tuple(row) for row in spark.sql(sql).collect()]
            except Exception as error:
                refused[relation.name] = " ".join(str(error).split())[:160]
                continue
            wrong = n_differing(ours, theirs)
            n_equal, n_wrong = n_equal + (wrong == 0), n_wrong + wrong
            n_cells += sum(map(len, ours))
            hint = "" if sql == relation.sql else ", without the word `materialized`"
            print(f"| `{relation.layer}/{relation.name}`{hint} | {len(ours):,} | {wrong:,} |", flush=True)
        spark.stop()
    print(f"\n{n_equal} queries with the same rows, {n_cells:,} cells compared, {n_wrong} differ")
    for name, why in refused.items():
        print(f"Spark does not run `{name}`: {why}")
    return int(n_wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
