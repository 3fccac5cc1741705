"""A frame in memory is stored with the checks of a file."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import vsd_analytics as vsd
from vsd_analytics.errors import UsageError

NOW = datetime(2026, 12, 1, tzinfo=UTC)
TOML = """[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground"
[[camera]]
id = "cam"
name = "Camera"
floor = "ground"
"""


@pytest.fixture
def site(tmp_path: Path) -> vsd.OpenProject:
    (tmp_path / "vsd.toml").write_text(TOML)
    return vsd.open(tmp_path)


def walk(n: int = 300) -> pd.DataFrame:
    """Return two people who walk side by side, a record a second each."""
    ts = pd.date_range("2026-11-10 09:00", periods=n, freq="s", tz="Europe/Rome")
    people = [pd.DataFrame({"ts": ts, "track_id": str(k), "x_m": 0.9 * k + 0.01 * i, "y_m": 2.0 + 0.1 * k})
              for k, i in ((0, pd.Series(range(n))), (1, pd.Series(range(n))))]  # fmt: skip
    return pd.concat(people, ignore_index=True)


@pytest.mark.parametrize(
    "form", [lambda f: f, pl.from_pandas, lambda f: pa.Table.from_pandas(f, preserve_index=False)],
    ids=["pandas", "polars", "arrow"],
)  # fmt: skip
def test_a_frame_is_stored_once_whatever_library_made_it(
    site: vsd.OpenProject, form: Callable[[pd.DataFrame], Any]
) -> None:
    [source] = site.ingest(form(walk()), camera="cam", now=NOW).sources
    assert source.n_records["observations"] == 600
    assert source.n_rejected == {}
    again = site.ingest(form(walk()), camera="cam", now=NOW)
    assert sum(counts.n_new for counts in again.fold.tables.values()) == 0
    day = site.days("2026-11-10")
    assert (len(day.trajectories), len(day.violations)) == (600, 1)
    assert day.violations["started"][0].hour == 9


def test_bad_rows_are_in_quarantine_and_counted(site: vsd.OpenProject) -> None:
    frame = walk()
    frame.loc[5, "x_m"] = 1e9
    result = site.ingest(frame, camera="cam", now=NOW)
    assert (result.sources[0].n_records["observations"], result.n_rejected) == (599, 1)


def test_a_frame_that_would_be_read_wrongly_is_refused_and_stores_nothing(site: vsd.OpenProject) -> None:
    with pytest.raises(vsd.VsdError) as caught:
        site.ingest(pd.DataFrame({"a": [1], "b": [2]}), camera="cam", now=NOW)
    assert caught.value.fix
    assert not list((site.site.root / "store").rglob("*.parquet"))


def test_an_unknown_camera_and_a_thing_that_is_no_frame_are_refused(site: vsd.OpenProject) -> None:
    with pytest.raises(UsageError, match="cam"):
        site.ingest(walk(), camera="nope", now=NOW)
    with pytest.raises(UsageError, match="no frame"):
        site.ingest([1, 2, 3], camera="cam", now=NOW)


def test_a_table_of_one_project_is_a_frame_of_another(site: vsd.OpenProject, tmp_path: Path) -> None:
    site.ingest(walk(), camera="cam", now=NOW)
    other = tmp_path / "other"
    other.mkdir()
    shutil.copy(tmp_path / "vsd.toml", other)
    rows = site.days("2026-11-10").sql("select t as ts, camera_id, track_id, x_m, y_m from trajectories")
    result = vsd.open(other).ingest(rows, now=NOW)
    assert result.sources[0].n_records["observations"] == 600
