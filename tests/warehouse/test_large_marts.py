"""Marts of a large site stay views of their files: the same rows, which fill no memory."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from benchmarks.made_up_site import write_site

from vsd_analytics.site.model import Site
from vsd_analytics.warehouse import sources
from vsd_analytics.warehouse.warehouse import MEMORY_LIMIT, Warehouse

FIRST = date(2026, 11, 9)
ASKED = ("violations", "camera_hours", "cell_hours")
QUESTIONS = [f"select * from {name} limit {n}" for name in ASKED for n in (1_000_001, 1_000_002, 1_000_003)]
"""A question asked again would be answered from memory."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    root = tmp_path_factory.mktemp("large")
    return write_site(root, n_records=9_000, n_cameras=1, open_h=1, interval_s=5)


def answers(site: Site) -> tuple[list[list[dict[str, object]]], set[str]]:
    """Return the rows of three marts, each asked for several times, and the names of those held in memory."""
    with Warehouse(site, FIRST, FIRST + timedelta(days=2)) as warehouse:
        warehouse.materialise("violations", "camera_hours")
        found = [warehouse.table(query).to_pylist() for query in QUESTIONS]
        held = {r for (r,) in warehouse.con.execute("select table_name from duckdb_tables()").fetchall()}
    return found, held & set(ASKED)


def test_large_marts_are_not_held_in_memory_and_have_the_same_rows(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, held = answers(site)
    assert held == {"violations", "camera_hours"}
    assert all(whole)
    monkeypatch.setattr(sources, "HELD_BYTES", 0)
    in_files, held = answers(site)
    assert held == set()
    assert in_files == whole


def test_a_mart_with_a_row_for_every_cell_is_held_only_where_somebody_asks_for_that(site: Site) -> None:
    with Warehouse(site, FIRST, FIRST + timedelta(days=2)) as warehouse:
        for _ in range(3):
            warehouse.frame("select count(*) as n from cell_hours")
        assert not warehouse._catalog.is_table("cell_hours")
        warehouse.materialise("cell_hours")
        assert warehouse._catalog.is_table("cell_hours")


def test_a_warehouse_has_a_memory_limit(site: Site) -> None:
    with Warehouse(site, FIRST, FIRST) as warehouse:
        limit = warehouse.con.execute("select current_setting('memory_limit')").fetchall()[0][0]
    assert MEMORY_LIMIT == "800MB"
    assert limit == "762.9 MiB"
