"""A query on which DuckDB fails inside itself is tried once more; then people learn which relation, hour and camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from hashlib import blake2b
from pathlib import Path
from typing import Any

import duckdb
import pytest
from warehouse.small_projects import T0, Pair, Person, at, beats, fact_files, make_site, open_days, put

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse import analyst_query, compute
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.sqlfiles import Relation


def crowd(n: int, ts: int, *, step_mm: int = 300) -> Iterator[Person]:
    """Yield people in a square, with ids as long and unordered as pseudonyms."""
    for i in range(n):
        yield Person(ts, blake2b(b"%d" % i, digest_size=8).hexdigest(), i % 49 * step_mm, i // 49 * step_mm)


def day_of_walkers(root: Path) -> Any:
    site = make_site(root)
    people = [
        Person(T0 + s * 1000, track, s * 20 + k * 700, k * 300)
        for s in range(120)
        for k, track in enumerate(("ann", "bob", "cid"))
    ]
    # a pair without track ids: who is who in it is worked out by a query
    put(site, [*people, *beats(T0, T0 + 120_000), Pair(T0 + 121_000, None, None, 900)])
    return site


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Return a function that makes DuckDB fail inside itself on a relation, so many times."""
    create = compute.create

    def fail(name: str, *, times: int) -> list[str]:
        tried: list[str] = []

        def creating(con: duckdb.DuckDBPyConnection, relation: Relation) -> None:
            if relation.name == name and len(tried) < times:
                tried.append(name)
                raise duckdb.InternalException("INTERNAL Error: simulated")
            create(con, relation)

        monkeypatch.setattr(compute, "create", creating)
        return tried

    return fail


def test_one_crowded_frame_after_two_of_one_person_is_computed(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [*crowd(1, T0), *crowd(1, T0 + 1000), *crowd(2400, T0 + 2000)])
    assert build(site).n_built == 1
    with open_days(site) as warehouse:
        assert warehouse.rows("select sum(n_records) > 122_880 as is_great from episode_segments") == [
            {"is_great": True}
        ]


def test_facts_computed_the_careful_way_have_the_same_bytes(tmp_path: Path, failing: Callable[..., list[str]]) -> None:
    build(plain := day_of_walkers(tmp_path / "plain"))
    tried = failing("pairs", times=1)
    build(careful := day_of_walkers(tmp_path / "careful"))
    assert tried == ["pairs"]
    assert fact_files(careful) == fact_files(plain)


def test_a_fact_that_fails_twice_is_reported_with_its_relation_hour_and_camera(
    tmp_path: Path, failing: Callable[..., list[str]]
) -> None:
    site = make_site(tmp_path)
    put(site, [*crowd(3, T0), *crowd(7, at("2026-11-09 09:30:05")), *beats(T0, T0 + 10_000)])
    put(site, [Pair(T0 + 11_000, None, None, 900)])
    failing("pairs", times=2)
    with pytest.raises(SqlError) as caught:
        build(site)
    error = caught.value
    assert error.code == "E604"
    assert "pairs of the hours 2026-11-09T08:00Z to 2026-11-09T09:00Z" in error.what
    assert "camera cam at 2026-11-09T09:30:05.000+00:00 with 7 records" in str(error.why)
    assert "vsd purge --camera cam --range 2026-11-09T09:00Z..2026-11-09T10:00Z" in str(error.fix)


def test_a_mart_is_asked_for_again_on_a_new_connection(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site = day_of_walkers(tmp_path)
    with open_days(site) as warehouse:
        expected = warehouse.rows("select * from episodes")
    with open_days(site) as warehouse:
        first, left = warehouse.con, [1]

        def fails_once(con: duckdb.DuckDBPyConnection) -> Any:
            if left:
                left.pop()
                raise duckdb.InternalException("INTERNAL Error: simulated")
            return con.sql("select * from episodes").to_arrow_table().to_pylist()

        assert warehouse.run("select * from episodes", fails_once) == expected
        assert warehouse.con is not first
        assert warehouse.rows("select current_setting('disabled_optimizers') as o") == [{"o": "join_order"}]


def test_a_mart_that_fails_twice_is_reported_with_its_name(tmp_path: Path) -> None:
    def fails(_con: duckdb.DuckDBPyConnection) -> None:
        raise duckdb.InternalException("INTERNAL Error: simulated")

    with open_days(day_of_walkers(tmp_path)) as warehouse:
        with pytest.raises(SqlError, match="while it computed episodes of the hours") as caught:
            warehouse.run("select * from episodes", fails)
        assert caught.value.code == "E604"
        assert "camera cam at 2026-11-09T08:00:00.000+00:00 with 3 records" in str(caught.value.why)


def test_an_analyst_s_query_stays_locked_up_on_the_new_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_days(day_of_walkers(tmp_path)) as warehouse:
        shut, left = analyst_query._restrict, [1]

        def fails_once(con: duckdb.DuckDBPyConnection, of: Any) -> None:
            shut(con, of)
            if left:
                left.pop()
                raise duckdb.InternalException("INTERNAL Error: simulated")

        monkeypatch.setattr(analyst_query, "_restrict", fails_once)
        assert analyst_query.query_rows(warehouse, "select count(*) > 0 as is_any from hours") == [{"is_any": True}]
        with pytest.raises(SqlError, match="could not be run"):
            analyst_query.query_rows(warehouse, "select * from read_csv('/etc/passwd')")


def test_a_query_beyond_the_memory_limit_is_answered_with_duckdbs_own_limit(tmp_path: Path) -> None:
    """A list of one row cannot go to disk: 40 MB do not fit into 20."""
    site = day_of_walkers(tmp_path)
    asked = "select len(list(i)) as n from range(5000000) as r(i)"
    with open_days(site) as warehouse:
        warehouse.con.execute("set memory_limit = '20MB'")
        with pytest.raises(duckdb.OutOfMemoryException):
            warehouse.con.execute(asked)
        assert warehouse.rows(asked) == [{"n": 5_000_000}]
