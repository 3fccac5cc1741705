"""A bare name in an analyst's query is a table; what lies behind the tables is `internal.NAME`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import duckdb
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse.analyst_names import INSTEAD, NamedQuery, internal_names, named_query, sql_tables
from vsd_analytics.warehouse.sqlfiles import queried_relations

TABLES = {*sql_tables(), "queues"}


@pytest.fixture(scope="module", name="con")
def _con() -> Iterator[duckdb.DuckDBPyConnection]:
    with duckdb.connect() as con:
        for name in ("hours", "located", "table_hours"):
            con.execute(f"create table {name} as select '{name}' as which, 1 as n")
        yield con


def named(con: duckdb.DuckDBPyConnection, query: str, **options: object) -> NamedQuery:
    return named_query(con, query, tables=TABLES, **options)  # type: ignore[arg-type]


def first(con: duckdb.DuckDBPyConnection, query: str) -> object:
    [row] = con.execute(named(con, query).text).fetchall()
    return row[0]


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("select which from hours", "table_hours"),
        ("select hours.which from HOURS", "table_hours"),
        ("select which from internal.hours", "hours"),
        ("select located.which from internal.located", "located"),
        ("select h.which from hours as h", "table_hours"),
        ("select which from (select * from hours)", "table_hours"),
        ("select (select max(which) from internal.hours) from hours", "hours"),
        ("select which from hours where exists (select 1 from internal.located)", "table_hours"),
        ("with hours as (select 'mine' as which) select which from hours", "mine"),
        ("with hours as (select * from hours) select which from hours", "table_hours"),
        ("with a as (select 1), hours as (select 'mine' as which from a) select which from hours", "mine"),
        ("select 'located'", "located"),
        ("select n as located from hours", 1),
    ],
)
def test_a_name_means_the_table_unless_the_query_says_otherwise(
    con: duckdb.DuckDBPyConnection, query: str, expected: object
) -> None:
    assert first(con, query) == expected


def test_what_a_query_reads_is_known_before_it_runs(con: duckdb.DuckDBPyConnection) -> None:
    query = named(con, "select 1 from area_hours, queues, internal.located where 'pairs' = 'episodes'")
    assert (query.tables, query.relations) == (("area_hours", "queues"), ("located",))
    assert set(query.reads) >= {"located", "camera_hours", "area_hours"}
    assert "episodes" not in query.reads


@pytest.mark.parametrize("name", sorted({*queried_relations()} - TABLES))
def test_the_old_bare_name_of_every_relation_says_what_to_use(con: duckdb.DuckDBPyConnection, name: str) -> None:
    with pytest.raises(SqlError) as caught:
        named(con, f"select * from {name}")
    assert f"use internal.{name}" in str(caught.value)
    assert named(con, f"select * from internal.{name}").relations == (name,), "and that is understood"
    assert name not in INSTEAD or f"the table {INSTEAD[name]}" in str(caught.value)


def test_a_step_of_the_build_is_refused_with_the_table_that_answers_such_questions(
    con: duckdb.DuckDBPyConnection,
) -> None:
    for name in sorted({*internal_names()} - {*queried_relations()} - TABLES):
        with pytest.raises(SqlError, match="exists only meanwhile") as caught:
            named(con, f"select * from {name}")
        assert "internal." not in str(caught.value.fix)


def test_tables_that_stand_in_are_tables() -> None:
    assert {*INSTEAD.values()} <= {*TABLES, "visits", "flow"}
    assert {*INSTEAD} <= {*internal_names()}


@pytest.mark.parametrize("query", ["select * from internal.days", "select * from internal.nope"])
def test_what_is_not_internal_is_refused_with_a_way_out(con: duckdb.DuckDBPyConnection, query: str) -> None:
    with pytest.raises(SqlError) as caught:
        named(con, query)
    assert caught.value.fix


def test_a_table_of_the_callers_own_may_have_the_name_of_a_relation_elsewhere(con: duckdb.DuckDBPyConnection) -> None:
    assert named(con, "select * from located", given={"located"}).relations == ()


@given(st.text(max_size=60))
def test_any_text_ends_in_a_query_or_an_error_for_people(text: str) -> None:
    with duckdb.connect() as con, contextlib.suppress(SqlError):
        assert isinstance(named(con, text), NamedQuery)


def test_half_a_surrogate_is_left_to_whoever_runs_the_query(con: duckdb.DuckDBPyConnection) -> None:
    assert named(con, "select '\ud800'").tables == ()
