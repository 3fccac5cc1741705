"""What else happened by local hour and day: summed or averaged, and unknown where open time is not covered."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import vsd_analytics as vsd
from tests.site_text import site_text
from vsd_analytics.config.context_file import ContextColumns
from vsd_analytics.config.context_series import Adds, add_context
from vsd_analytics.config.project import load_site
from vsd_analytics.site.model import Site

OPEN = 'opening = { mon-sat = "09:00-18:30" }\n'


def site_at(root: Path, opening: str = OPEN) -> Site:
    (root / "vsd.toml").write_text(site_text(site=opening), encoding="utf-8")
    return load_site(root)


def add(site: Site, lines: dict[str, float], *, every: str, adds: Adds = "sum") -> None:
    file = site.root / "series.csv"
    file.write_text("time,value\n" + "".join(f"{t},{v}\n" for t, v in lines.items()), encoding="utf-8")
    columns = ContextColumns("time", "value", "end", every, site.zone)
    add_context(site, file, columns, name="x", at=datetime(2026, 11, 16, tzinfo=UTC), unit="EUR", adds=adds)


def days(site: Site, text: str) -> vsd.Days:
    return vsd.open(site.root).days(text)


def by_hour(site: Site, day: str) -> dict[int, Any]:
    return {row["local_hour"]: row["value"] for row in days(site, day).context if row["value"] is not None}


def test_quarters_of_an_hour_add_up_and_an_hour_with_a_gap_is_unknown(tmp_path: Path) -> None:
    site = site_at(tmp_path)
    quarters = {f"2026-11-09T{h:02}:{m:02}": 2.0 for h in (9, 10, 18) for m in (0, 15, 30, 45)}
    del quarters["2026-11-09T10:30"]
    add(site, quarters, every="15min")
    assert by_hour(site, "2026-11-09") == {9: 8.0, 18: 8.0}
    hours = days(site, "2026-11-09").context
    assert (len(hours), hours["covered_s"][10], hours["open_s"][18]) == (24, 2700.0, 1800.0)


def test_the_open_part_of_an_hour_is_enough(tmp_path: Path) -> None:
    site = site_at(tmp_path)
    add(site, {"2026-11-09T18:00": 3.0, "2026-11-09T18:15": 4.0}, every="15min")
    assert by_hour(site, "2026-11-09") == {18: 7.0}


def test_a_day_is_known_where_its_open_time_is_covered(tmp_path: Path) -> None:
    site = site_at(tmp_path)
    hours = {f"2026-11-{d:02}T{h:02}:00": 1.0 for d in (9, 10) for h in range(9, 19)}
    del hours["2026-11-10T13:00"]
    add(site, hours, every="1h")
    assert days(site, "2026-11-09..2026-11-11").context_days["value"] == [10.0, None, None]


def test_a_value_of_a_day_says_nothing_about_its_hours(tmp_path: Path) -> None:
    site = site_at(tmp_path)
    add(site, {"2026-11-09": 240.0}, every="1d")
    assert by_hour(site, "2026-11-09") == {}
    assert days(site, "2026-11-09").context_days["value"] == [240.0]


def test_a_mean_is_weighted_by_open_time(tmp_path: Path) -> None:
    site = site_at(tmp_path, 'opening = { mon-sat = "10:00-11:30" }\n')
    add(site, {"2026-11-09T09:00": 90.0, "2026-11-09T10:00": 10.0, "2026-11-09T11:00": 40.0}, every="1h", adds="mean")
    assert days(site, "2026-11-09").context_days["value"] == [pytest.approx((10 + 40 / 2) / 1.5)]
    assert by_hour(site, "2026-11-09") == {9: 90.0, 10: 10.0, 11: 40.0}


@pytest.mark.parametrize(("day", "n_hours"), [("2026-03-29", 23), ("2026-10-25", 25), ("2026-11-09", 24)])
def test_days_when_clocks_change_lose_and_repeat_nothing(tmp_path: Path, day: str, n_hours: int) -> None:
    site = site_at(tmp_path, "")
    start = datetime.combine(date.fromisoformat(day), datetime.min.time(), tzinfo=site.zone).astimezone(UTC)
    add(site, {(start + timedelta(hours=k)).isoformat(): 2.0**k for k in range(n_hours)}, every="1h")
    hours = days(site, day).context
    assert hours["value"] == [2.0**k for k in range(n_hours)]
    assert len({at.astimezone(UTC) for at in hours["start"]}) == n_hours
    assert days(site, day).context_days["value"] == [2.0**n_hours - 1]


def test_sql_joins_it_with_the_hours_of_the_floor(tmp_path: Path) -> None:
    site = site_at(tmp_path)
    frames = pd.DataFrame({"ts": pd.date_range("2026-11-09T08:00Z", periods=7200, freq="1s"), "x_m": 1.0, "y_m": 1.0})
    frames["track_id"] = "1"
    vsd.open(site.root).ingest(frames, camera="cam-1", now=datetime(2026, 11, 16, tzinfo=UTC))
    add(site, {f"2026-11-09T{h:02}:00": float(h) for h in (9, 10, 14)}, every="1h")
    query = "select h.local_hour, c.value, h.n_violations from hours h join context c using (start) where c.value > 0"
    rows = list(days(site, "2026-11-09").sql(f"{query} order by 1"))
    assert rows == [{"local_hour": h, "value": float(h), "n_violations": n} for h, n in ((9, 0), (10, 0), (14, None))]


def test_without_context_the_tables_are_empty_and_have_their_columns(tmp_path: Path) -> None:
    week = days(site_at(tmp_path), "2026-11-09")
    assert (len(week.context), len(week.context_days)) == (0, 0)
    assert week.context.columns[:4] == ["name", "unit", "place", "start"]
