"""An analyst may read tables, facts and marts, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
from warehouse.small_projects import T0, Person, fact_files, make_site, open_days, put

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse.analyst_query import query_rows, run_query
from vsd_analytics.warehouse.warehouse import Warehouse


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("analyst")


@pytest.fixture(scope="module")
def warehouse(folder: Path) -> Iterator[Warehouse]:
    site = make_site(folder / "pro'ject")  # a quote in the path must not matter
    put(site, [Person(T0 + k * 1000, t, x, 0) for k in range(5) for t, x in (("a", 0), ("b", 900))])
    (folder / "secret.csv").write_text("a,b\n1,2\n")
    with open_days(site) as opened:
        yield opened


def test_tables_facts_marts_and_dimensions_can_be_read(warehouse: Warehouse) -> None:
    assert run_query(warehouse, "select count(*) as n from internal.pairs;")["n"].to_pylist() == [5]
    assert run_query(warehouse, "from violations select duration_s")["duration_s"].to_pylist() == [5.0]
    assert run_query(warehouse, "with c as (select * from cameras) select camera_id from c")[
        "camera_id"
    ].to_pylist() == ["cam"]
    assert len(run_query(warehouse, "select * from hours")) == 24
    store = f"{warehouse.site.root}/store/observations/**/*.parquet".replace("'", "''")
    assert run_query(warehouse, f"select count(*) as n from read_parquet('{store}')")["n"].to_pylist() == [10]


def test_a_sum_of_counts_is_a_whole_number(warehouse: Warehouse) -> None:
    rows = run_query(warehouse, "select sum(n) as n from (select count(*) as n from internal.pairs)")
    assert (str(rows.schema.field("n").type), rows["n"].to_pylist()) == ("int64", [5])


READS = [
    "select * from read_text('/etc/passwd')",
    "select * from read_csv('/etc/passwd')",
    "select * from '/etc/passwd'",
    "select * from read_blob('/proc/self/environ')",
    "select * from glob('/etc/*')",
    "select * from read_csv('{outside}/secret.csv')",
    "select * from read_csv('{root}/store/../../secret.csv')",
    "select * from read_csv('http://localhost/x.csv')",
]
WRITES = [
    "copy (select 1) to '{root}/store/x.csv'",
    "copy (select 1) to '{root}/facts/x.parquet'",
    "copy (select 1) to '{outside}/x.csv'",
    "export database '{root}/store/dump'",
    "attach '{root}/store/x.duckdb' as x",
    "attach '{outside}/x.duckdb' as x",
    "create table t as select 1",
    "create or replace view hours as select 1",
    "drop view hours",
    "insert into coverage select * from coverage",
    "delete from coverage",
    "set enable_external_access = true",
    "set lock_configuration = false",
    "set memory_limit = '1TB'",
    "reset allowed_directories",
    "pragma memory_limit = '1TB'",
    "install httpfs",
    "load httpfs",
    "call pragma_version()",
    "select 1; select 2",
    "select 1; copy (select 1) to '{root}/store/x.csv'",
    "explain analyze copy (select 1) to '{root}/store/x.csv'",
    "explain copy (select 1) to '{root}/store/x.csv'",
    "",
    ";",
    "prepare q as copy (select 1) to '{root}/store/x.csv'",
    "execute q",
]


@pytest.mark.parametrize("query", READS + WRITES)
def test_nothing_else_can_be_read_written_or_set(warehouse: Warehouse, folder: Path, query: str) -> None:
    root = str(warehouse.site.root).replace("'", "''")
    before = sorted(folder.rglob("*")), fact_files(warehouse.site)
    with pytest.raises(SqlError) as caught:
        run_query(warehouse, query.format(root=root, outside=folder))
    assert caught.value.code == "E603"
    assert caught.value.fix
    assert (sorted(folder.rglob("*")), fact_files(warehouse.site)) == before
    assert run_query(warehouse, "select count(*) as n from hours")["n"].to_pylist() == [24], "later queries still work"


def test_python_variables_are_no_relations(warehouse: Warehouse) -> None:
    frame = pd.DataFrame({"a": [1]})
    with pytest.raises(SqlError, match="could not be run"):
        run_query(warehouse, "select * from frame")
    assert len(frame) == 1


def test_a_mistake_is_reported_in_duckdb_words_with_a_fix(warehouse: Warehouse) -> None:
    with pytest.raises(SqlError) as caught:
        run_query(warehouse, "select no_such_column from hours")
    assert "no_such_column" in str(caught.value.why)
    assert "vsd sql --list" in str(caught.value.fix)


def test_missing_inside_a_list_is_null_in_rows_not_zero(warehouse: Warehouse) -> None:
    rows = query_rows(warehouse, "select [1, null] as a, {'b': null} as c, 'nan'::double as d, null::bigint as e")
    assert rows == [{"a": [1, None], "c": {"b": None}, "d": None, "e": None}]


def test_rows_of_every_type_are_json(warehouse: Warehouse) -> None:
    query = """select uuid() as u, '\\xFF'::blob as b, 12345678901234567890123::hugeint as h, 1.5::decimal(4, 1) as d,
        interval 1 month as i, bit '101' as t, date '2026-11-10' as day, timestamptz '2026-11-10' as ts,
        [uuid()] as us, 'inf'::double as f, 1 as twice, 2 as twice"""
    (row,) = json.loads(json.dumps(query_rows(warehouse, query), allow_nan=False))
    assert (row["d"], row["day"], row["f"]) == (1.5, "2026-11-10", None)
    assert (row["h"], row["twice"], row["twice_1"]) == (12345678901234567890123, 1, 2)
    assert row["ts"].startswith("2026-11-10T00:00:00")
