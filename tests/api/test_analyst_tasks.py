"""The twelve tasks of docs/python.md: three lines at most, typed, and right by plain pandas over stored files.

Violations are those of the relation behind the tables; what that has is tested in tests/sql and tests/invariances.
"""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import polars as pl
import pytest
from api.test_types import check
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import vsd_analytics as vsd
from vsd_analytics.report.pages.json_and_csv import to_json

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.M | re.S)
EXAMPLE, _, REST = PAGE.partition("## Twelve tasks")
BEGIN, *TASKS = BLOCK.findall(REST.partition("## The tables")[0])
SHOWN = BLOCK.findall(EXAMPLE) + BLOCK.findall(REST.partition("## The tables")[2])
FIRST, END = (pd.Timestamp(day, tz="Europe/Rome") for day in ("2026-11-09", "2026-11-16"))
INTERVAL_S = 2
"""Between two frames of a camera of the demo."""
OPEN = {6: range(10, 18)}
"""Opening hours of Sunday; on other days the shop is open from 8 to 21."""


@pytest.fixture(scope="module")
def done(demo_project: Path) -> dict[str, Any]:
    """Return the names that the page's code leaves behind."""
    names: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(demo_project.parent)
        patch.setenv("MPLBACKEND", "agg")
        for block in (BEGIN, *TASKS, *SHOWN):
            exec(compile(block, "docs/python.md", "exec"), names)
    plt.close("all")
    return names


def stored(root: Path, table: str) -> pd.DataFrame:
    """Return the stored records of a table in the week, with their local hour."""
    files = sorted((root / "store" / table).rglob("*.parquet"))
    rows = pd.concat((pd.read_parquet(path) for path in files), ignore_index=True)
    rows["local"] = rows["ts"].dt.tz_convert("Europe/Rome")
    rows["hour"] = rows["local"].dt.floor("h")
    return rows[(rows["local"] >= FIRST) & (rows["local"] < END)].reset_index(drop=True)


def is_open(local: pd.Series) -> NDArray[np.bool_]:
    return np.array([t.hour in OPEN.get(t.weekday(), range(8, 21)) for t in local])


@pytest.fixture(scope="module")
def people(demo_project: Path, done: dict[str, Any]) -> pd.DataFrame:
    """Return every stored person record with its place, whether its camera counts the place, and whether it is close.

    Close: another person of the same frame is nearer than 2 m. The program says which camera counts a place.
    """
    rows = stored(demo_project, "observations")
    rows["x"], rows["y"] = rows["x_mm"].astype(float), rows["y_mm"].astype(float)
    assert rows["x"].notna().all()
    squares = done["week"].sql("select camera_id as owner, cx, cy from owner_cells").df()
    rows["cx"], rows["cy"] = ((rows[c] // 500).astype(int) for c in "xy")
    rows = rows.merge(squares, how="left", on=["cx", "cy"])
    rows["is_owned"] = (rows["owner"] == rows["camera_id"]) | rows["owner"].isna()
    second = (rows["ts"] - FIRST).dt.total_seconds().to_numpy()
    rows["is_close"] = False
    for camera in rows["camera_id"].unique():
        of_camera = np.flatnonzero(rows["camera_id"] == camera)
        at = np.c_[rows["x"].to_numpy()[of_camera], rows["y"].to_numpy()[of_camera], second[of_camera] * 1e4]
        near = cKDTree(at).query_pairs(2000 - 1e-6, output_type="ndarray").ravel()
        rows.loc[of_camera[np.unique(near)], "is_close"] = True
    return rows


@pytest.fixture(scope="module")
def listed(done: dict[str, Any]) -> pd.DataFrame:
    """Return the violations of the week, of the relation behind the tables."""
    frame: pd.DataFrame = done["week"].sql("select * from internal.violations where is_open").df()
    return frame


@pytest.fixture(scope="module")
def recorded(demo_project: Path) -> pd.DataFrame:
    """Return the recorded share of each open hour (rows) by camera (columns), by counting frames."""
    frames = stored(demo_project, "frames")
    hours = pd.Series(pd.date_range(FIRST, END, freq="h", inclusive="left"))
    hours = hours[is_open(hours)]
    interval_s = frames.groupby("camera_id")["ts"].apply(lambda ts: ts.sort_values().diff().median().total_seconds())
    counts = (
        frames.groupby(["hour", "camera_id"])
        .size()
        .reset_index(name="n")
        .pivot_table("n", "hour", "camera_id")
        .reindex(hours)
        .fillna(0)
    )
    return counts.mul(interval_s, axis="columns") / 3600


def test_fifteen_tasks_take_at_most_three_lines_each() -> None:
    assert len(TASKS) == 15
    assert max(block.count("\n") for block in TASKS) <= 3


def test_a_strict_type_checker_passes_the_tasks(tmp_path: Path) -> None:
    path = tmp_path / "tasks.py"
    path.write_text("\n".join([BEGIN, *TASKS, *SHOWN]), encoding="utf-8")
    assert "Success" in check(path)


def test_the_time_of_visitors_and_that_of_staff_is_the_time_of_all(done: dict[str, Any]) -> None:
    week = done["week"]
    staff_s = week.at(people="staff").hours.total("exposure_s") or 0.0
    assert done["visitors_s"] + staff_s == pytest.approx(week.hours.total("exposure_s"), rel=1e-9)


def test_an_average_per_hour_counts_quiet_hours_and_leaves_out_those_hardly_recorded(
    done: dict[str, Any], listed: pd.DataFrame, recorded: pd.DataFrame, people: pd.DataFrame
) -> None:
    in_area = people["x"].between(3600, 14200) & people["y"].between(4200, 5900) & people["is_owned"]
    seers = sorted(people.loc[in_area, "camera_id"].unique())
    assert seers == ["cam-2", "cam-3"]
    in_rates = recorded.index[recorded[seers].mean(axis="columns") >= 0.5]
    queue = listed[listed["area_id"] == "checkout-queue"]
    hour = pd.to_datetime(queue["hour_start_ms"], unit="ms", utc=True).dt.tz_convert("Europe/Rome")
    expected = hour.isin(in_rates).sum() / len(in_rates)
    assert done["per_hour"] == pytest.approx(expected, rel=1e-12)
    wrong = done["week"].sql(
        "select avg(n_violations_open) as n from internal.area_hours where area_id = 'checkout-queue'"
    )
    assert wrong["n"][0] < 0.6 * expected, "a row by camera and none for quiet hours: the trap"


def test_ten_minutes_and_quarter_hours_have_the_time_of_their_hours(done: dict[str, Any]) -> None:
    hours = done["week"].hours.total("exposure_s")
    assert done["ten_minutes"]["exposure_s"].sum() == pytest.approx(hours)
    assert done["week"].quarter_hours.total("exposure_s") == pytest.approx(hours)
    assert len(done["fullest"]) == 3


def test_the_busiest_hour_is_an_instant_of_the_site(done: dict[str, Any], people: pd.DataFrame) -> None:
    assert done["busiest"] == people[people["is_owned"]].groupby("hour").size().idxmax()
    assert str(done["busiest"].tz) == "Europe/Rome"


def test_a_week_without_records_is_unknown_not_0(done: dict[str, Any]) -> None:
    in_pandas, total = done["n_unknown"]
    assert in_pandas is pd.NA
    assert total is None
    unknown = done["unknown"]
    assert len(unknown) == 7 * 24
    assert set(unknown["state"]) == {"no_data", "closed"}
    frame = unknown.df()
    assert frame.groupby("local_date")["n_violations"].sum().isna().all()
    assert frame[["n_violations", "exposure_s"]].sum().isna().all()
    assert frame.groupby("state").agg(n=("exposure_s", "sum"))["n"].isna().all()
    assert pd.concat([frame, frame])["violation_s"].sum() is pd.NA
    assert frame.query("local_hour > 7")["violation_s"].sum() is pd.NA
    areas = done["site"].week("2026-W30").areas
    reasons = {*areas["violations_per_open_h_reason"], *areas["close_time_share_reason"]}
    assert reasons == {"no open hour was recorded"}


def test_what_pandas_and_polars_do_by_their_own_rules_is_as_the_page_says(done: dict[str, Any]) -> None:
    unknown = done["unknown"]
    assert (unknown.df()["n_violations"] + 1).sum() == 0
    assert unknown.pl()["n_violations"].sum() == 0
    assert not unknown.pl()["n_violations"].is_not_null().any()


def test_a_person_in_several_views_is_there_once(done: dict[str, Any], people: pd.DataFrame) -> None:
    of_day = people[people["local"].dt.strftime("%F") == "2026-11-10"]
    assert done["n_people"] == of_day["is_owned"].sum()
    assert done["n_people"] < 0.6 * len(of_day), "the trap: views overlap"
    assert str(done["people"].arrow().schema.field("t").type.tz) == "Europe/Rome"


def test_time_too_close_by_area_adds_up_to_the_floor(done: dict[str, Any], people: pd.DataFrame) -> None:
    close = people[people["is_close"] & people["is_owned"] & is_open(people["local"])]
    inside = close["x"].between(3600, 14200, inclusive="left") & close["y"].between(4250, 6000, inclusive="left")
    per_record = done["week"].hours.total("exposure_s") / people["is_owned"].sum()
    assert done["close_s"].sum() == pytest.approx(len(close) * per_record)
    assert done["close_s"].sum() == pytest.approx(done["week"].hours.total("violation_s"))
    assert done["close_s"]["checkout-queue"] == pytest.approx(inside.sum() * per_record, rel=0.1), "cells of 0.25 m"
    assert len(done["close_s"]) == 5


def test_cameras_add_up_to_the_site(done: dict[str, Any], people: pd.DataFrame) -> None:
    records = people[people["is_owned"]].groupby("camera_id").size()
    per_record = done["person_s"].sum() / records.sum()
    assert done["person_s"].to_dict() == pytest.approx((records * per_record).to_dict())
    assert done["person_s"].sum() == done["week"].hours.total("exposure_s")


def test_own_data_are_joined_by_instant_in_the_zone_of_the_site(done: dict[str, Any], listed: pd.DataFrame) -> None:
    hour = pd.to_datetime(listed["hour_start_ms"], unit="ms", utc=True).dt.tz_convert("Europe/Rome")
    expected = [(hour == FIRST + pd.Timedelta(hours=h)).sum() / n for h, n in ((10, 31), (11, 44), (12, 58))]
    assert sorted(done["per_sale"]["per_sale"]) == pytest.approx(sorted(expected))
    aware = done["sales"].assign(at=done["sales"]["at"].dt.tz_localize("Europe/Rome").dt.tz_convert("UTC"))
    again = done["week"].sql(done["query"], sales=pl.from_pandas(aware).to_arrow())
    assert sorted(again["per_sale"]) == pytest.approx(sorted(expected))


def test_the_number_of_the_page_is_found_in_the_tables(
    done: dict[str, Any], listed: pd.DataFrame, recorded: pd.DataFrame
) -> None:
    hour = pd.to_datetime(listed["hour_start_ms"], unit="ms", utc=True).dt.tz_convert("Europe/Rome")
    share = [recorded.loc[h, c] for h, c in zip(hour, listed["camera_id"], strict=True)]
    assert done["counted"] == (np.array(share) >= 0.5).sum() < len(listed)
    report = json.loads(to_json(vsd.week_report(done["site"].site, done["week"].first)))
    assert done["counted"] == report["level"]["violations"]


def test_recorded_days_are_those_of_the_frames(done: dict[str, Any], recorded: pd.DataFrame) -> None:
    by_day = recorded.mean(axis="columns").groupby(recorded.index.strftime("%F")).mean()
    assert done["recorded"].tolist() == pytest.approx(by_day.tolist(), abs=0.01)


def test_time_too_close_falls_with_the_distance(done: dict[str, Any]) -> None:
    assert 0 < done["near_s"] < 0.9 * done["week"].hours.total("violation_s")


def test_the_longest_violation_of_each_area(done: dict[str, Any], listed: pd.DataFrame) -> None:
    expected = listed.assign(area_id=listed["area_id"].fillna("rest")).groupby("area_id")["duration_s"].max()
    assert done["longest"].to_dict() == expected.to_dict()


def test_places_are_points_in_floor_metres(done: dict[str, Any], people: pd.DataFrame) -> None:
    here = people[people["is_owned"]]
    cells = {(x + 0.5, y + 0.5) for x, y in zip(here["x"] // 1000, here["y"] // 1000, strict=True)}
    points = done["places"]["features"]
    assert {tuple(f["geometry"]["coordinates"]) for f in points} == cells
    assert set(points[0]["properties"]) == {"floor_id", "exposure_s", "violation_s", "recorded_s"}


def test_tables_without_rows_have_their_columns_and_say_why(done: dict[str, Any]) -> None:
    assert len(done["week"].hotspots) == 0
    assert done["week"].hotspots.note != ""
    nothing = done["site"].compare("2026-W45", "2026-W46")
    assert len(nothing) == 0
    assert nothing.note
    assert "violations_per_open_h_change" in nothing.df().columns


def test_whatever_is_typed_at_a_prompt_prints_little(done: dict[str, Any]) -> None:
    week, site = done["week"], done["site"]
    shown = [
        site,
        week,
        week.hours,
        week.violations,
        week.cells,
        week.areas,
        week.hotspots,
        week.heatmap("risk"),
        site.changes,
    ]
    assert max(len(repr(thing)) for thing in shown) < 2_500


@pytest.mark.parametrize("figure", ["groups", "gatherings", "episode_figures", "coverage", "hours"])
def test_a_single_figure_prints_little(done: dict[str, Any], figure: str) -> None:
    week = done["week"]
    warehouse = vsd.open_warehouse(done["site"].site, week.first, week.last)
    assert len(repr(getattr(vsd, figure)(warehouse))) < 20_000


@pytest.mark.skipif(pd.__version__ < "3", reason="pandas 2 needs pytz itself")
def test_instants_with_a_zone_are_fetched_where_pytz_is_missing(demo_project: Path) -> None:
    """DuckDB's own fetch needs pytz for them; the program and the API do not."""
    script = f"""
import sys
sys.modules["pytz"] = None
import vsd_analytics as vsd
week = vsd.open({str(demo_project)!r}).week("2026-W46")
print(week.sql("select start as at from hours limit 1").df()["at"].iloc[0])
print(week.hours.df()["start"].iloc[0])
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["2026-11-09 00:00:00+01:00"] * 2


def test_importing_a_room_replaces_no_function() -> None:
    importlib.import_module("vsd_analytics.figures.compare")
    importlib.import_module("vsd_analytics.ingest.intake.pipeline")
    assert callable(vsd.compare)
    assert not hasattr(vsd, "nope")
    assert "homography" not in dir(vsd)


def test_what_looks_natural_ends_in_words_not_in_tracebacks(demo_project: Path) -> None:
    with pytest.raises(vsd.VsdError):
        vsd.open("demo-that-is-not-there")
    with pytest.raises(vsd.VsdError, match=r"vsd\.toml"):
        vsd.load_site("demo")
    warehouse = vsd.open_warehouse(vsd.load_site(str(demo_project)), "2026-11-09", "2026-11-12")
    assert vsd.compare(warehouse, "2026-11-09..2026-11-10", "2026-11-11..2026-11-12").state == "ok"
    with pytest.raises(vsd.VsdError, match="tomorrow"):
        vsd.compare(warehouse, "2026-11-09", "tomorrow")
