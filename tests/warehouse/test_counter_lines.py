"""Sums of door counters by quarter-hour: exact over whole intervals, unknown where no sum was sent."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.site_text import site_text
from vsd_analytics.config.context_file import ContextColumns
from vsd_analytics.config.door_counts import add_counts
from vsd_analytics.config.project import load_site
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.counter_lines import counter_lines, counter_quarters

LINE = '[[line]]\nid = "door"\nname = "Door"\ncounted_by = "counter"\nfrom = 2026-11-01\n'
EIGHT = int(datetime(2026, 11, 9, 8, tzinfo=UTC).timestamp()) // 900
"""The quarter-hour that begins at 08:00 UTC."""


def counted(folder: Path, *lines: str, every: str, timezone: str = "UTC") -> Site:
    (folder / "vsd.toml").write_text(site_text(more=LINE, timezone=timezone), encoding="utf-8")
    site = load_site(folder)
    file = folder / "doors.csv"
    file.write_text("\n".join(["time,in,out", *lines]), encoding="utf-8")
    times = ContextColumns("time", "", "end", every, site.zone)
    add_counts(site, file, "door", {"left": "in", "right": "out"}, times=times)
    return site


def quarters(site: Site, first: int = EIGHT, last: int = EIGHT + 7) -> list[dict[str, Any]]:
    return counter_quarters(site, pa.chunked_array([list(range(first, last + 1))])).to_pylist()


def test_a_sum_of_an_hour_is_spread_evenly_and_stays_exact(tmp_path: Path) -> None:
    rows = quarters(counted(tmp_path, "2026-11-09T08:00,10,3", every="1h"))
    assert [row["quarter"] - EIGHT for row in rows] == [0, 1, 2, 3]
    assert [row["n_to_left"] for row in rows] == [2, 3, 2, 3]
    assert sum(row["n_to_right"] for row in rows) == 3
    assert {(row["recorded_s"], row["interval_s"], row["n_both"]) for row in rows} == {(900, 3600, None)}


def test_short_intervals_are_added_up_and_what_was_not_sent_is_missing(tmp_path: Path) -> None:
    lines = [f"2026-11-09T08:{m:02},{m},0" for m in (0, 5, 10, 15, 20)]
    rows = quarters(counted(tmp_path, *lines, every="5min"))
    assert [(row["quarter"] - EIGHT, row["n_to_left"], row["recorded_s"]) for row in rows] == [
        (0, 15, 900),
        (1, 35, 600),
    ]


def test_an_interval_over_the_edge_of_the_range_gives_its_part(tmp_path: Path) -> None:
    site = counted(tmp_path, "2026-11-09T08:00,10,3", every="1h")
    assert [row["n_to_left"] for row in quarters(site, first=EIGHT + 2)] == [2, 3]
    assert quarters(site, first=EIGHT + 4, last=EIGHT + 9) == []


def test_hours_of_a_zone_at_half_past_are_local_hours(tmp_path: Path) -> None:
    site = counted(tmp_path, "2026-11-09T13:00,8,0", every="1h", timezone="Asia/Kolkata")
    rows = quarters(site, first=EIGHT - 4)
    assert [row["quarter"] - EIGHT for row in rows] == [-2, -1, 0, 1], "13:00 there is 07:30 UTC"


def test_a_line_has_the_life_that_vsd_toml_gives_it(tmp_path: Path) -> None:
    site = counted(tmp_path, "2026-11-09T08:00,1,1", every="1h")
    (row,) = counter_lines(site).to_pylist()
    assert (row["line_id"], row["line_no"], row["floor_id"]) == ("door", 0, "ground")
    assert row["from_ms"] == int(datetime(2026, 11, 1, tzinfo=UTC).timestamp()) * 1000


@given(data=st.data())
def test_nobody_is_lost_or_added_by_spreading(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    every = data.draw(st.sampled_from([1, 4, 5, 10, 15, 20, 30, 60]))
    starts = [m for m in range(0, 120, every) if m // 60 == (m + every - 1) // 60]
    n = data.draw(st.lists(st.integers(0, 999), min_size=len(starts), max_size=len(starts)))
    lines = [f"2026-11-09T{8 + m // 60:02}:{m % 60:02},{k},{2 * k}" for m, k in zip(starts, n, strict=True)]
    rows = quarters(counted(tmp_path_factory.mktemp("spread"), *lines, every=f"{every}min"))
    for hour in (0, 1):
        inside = [row for row in rows if (row["quarter"] - EIGHT) // 4 == hour]
        sent = sum(k for m, k in zip(starts, n, strict=True) if m // 60 == hour)
        assert sum(row["n_to_left"] for row in inside) == sent
        assert sum(row["n_to_right"] for row in inside) == 2 * sent
        assert sum(row["recorded_s"] for row in inside) == 60 * every * sum(m // 60 == hour for m in starts)
