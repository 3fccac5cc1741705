"""Marts of many new days are computed a few days at a time: the same files, and one warehouse of days at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from benchmarks.made_up_site import write_site

from vsd_analytics.planner.planner_data import planner_pages
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse import sources
from vsd_analytics.warehouse import warehouse as warehouse_module
from vsd_analytics.warehouse.day_pieces import pieces
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS

FIRST = date(2026, 11, 9)
ASKED = ("violations", "cell_hours", "camera_hours", "track_groups")


def days(*numbers: int) -> list[date]:
    return [FIRST + timedelta(days=n) for n in numbers]


def test_a_piece_ends_where_its_bytes_or_a_run_of_days_end() -> None:
    first = (FIRST - date(1970, 1, 1)).days
    n_bytes = {first: 4, first + 1: 5, first + 2: 2, first + 3: 30}
    found = pieces(days(0, 1, 2, 3, 4, 8), n_bytes, most=10)
    assert found == [days(0, 1), days(2), days(3), days(4), days(8)]
    assert pieces(days(0, 1, 2, 3, 4, 8), n_bytes, most=41) == [days(0, 1, 2, 3, 4), days(8)]
    assert pieces([], n_bytes, most=10) == []


def test_pieces_of_one_day_make_the_same_files_one_warehouse_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = write_site(tmp_path, n_records=9_000, n_cameras=1, open_h=1, interval_s=5)
    inner: list[tuple[date, date]] = []
    n_open, most_open = 0, 0

    class Watched(Warehouse):
        def __init__(self, *args: object, **options: object) -> None:
            nonlocal n_open, most_open
            super().__init__(*args, **options)  # type: ignore[arg-type]
            inner.append((self.first, self.last))
            n_open += 1
            most_open = max(most_open, n_open)

        def __exit__(self, *error: object) -> None:
            nonlocal n_open
            super().__exit__(*error)  # type: ignore[arg-type]
            n_open -= 1

    monkeypatch.setattr(warehouse_module, "Warehouse", Watched)

    def made(most: int) -> dict[str, bytes]:
        monkeypatch.setattr(sources, "PIECE_BYTES", most)
        inner.clear()
        with Warehouse(site, FIRST, FIRST + timedelta(days=2)) as warehouse:
            warehouse.materialise(*ASKED)
        found = {str(p.relative_to(tmp_path)): p.read_bytes() for p in (tmp_path / "facts" / WEEKS).rglob("*.parquet")}
        for path in found:
            (tmp_path / path).unlink()
        return found

    whole = made(10**12)
    assert len(inner) == 1
    single = made(1)
    # track_groups has rows of the site day that begins on the day before, too
    assert inner == [(FIRST, FIRST - timedelta(days=1)), *((d, d) for d in days(0, 1, 2))]
    assert most_open == 1
    assert n_open == 0
    assert single == whole
    relations = {path.split("/")[2] for path in whole}
    assert relations == {"violations", "cell_hours", "camera_hours", "track_groups"}
    assert len(whole) == 4


@pytest.mark.parametrize("page", [week_report, planner_pages])
def test_a_page_computes_the_marts_of_a_new_day_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, page: Callable[[Site, date], object]
) -> None:
    site = write_site(tmp_path, n_records=9_000, n_cameras=1, open_h=1, interval_s=5)
    pieces_of = Counter[tuple[date, date]]()
    opened = Warehouse.__init__

    def counted(self: Warehouse, of: Site, first: date, last: date, **options: Any) -> None:
        if options.get("uses_days") is False:
            pieces_of[first, last] += 1
        opened(self, of, first, last, **options)

    monkeypatch.setattr(Warehouse, "__init__", counted)
    monkeypatch.setattr(sources, "PIECE_BYTES", 1)
    page(site, FIRST)
    assert len(pieces_of) > 2
    assert set(pieces_of.values()) == {1}


def test_marts_that_are_computed_ahead_and_not_read_leave_no_older_file(tmp_path: Path) -> None:
    site = write_site(tmp_path, n_records=9_000, n_cameras=1, open_h=1, interval_s=5)
    assert site.opening is not None
    later = replace(site, opening=(((9 * 60, 20 * 60),), *site.opening[1:]))
    for of_rules in (site, later):
        with Warehouse(of_rules, FIRST, FIRST + timedelta(days=6)) as warehouse:
            warehouse.prefetch("cell_days")
        assert len(list((tmp_path / "facts" / WEEKS / "cell_days").rglob("*.parquet"))) == 1
