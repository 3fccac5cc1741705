"""The Python API on the demo: tables equal what the commands print, types are real, nothing is locked in between."""

from __future__ import annotations

import json
import re
import shutil
from datetime import date
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from whole_api import use

import vsd_analytics as vsd
from vsd_analytics.api.table import Table
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.errors import SqlError, UsageError
from vsd_analytics.store import removal

WEEK = "2026-W46"


@pytest.fixture(scope="module")
def site(demo_project: Path) -> vsd.OpenProject:
    return vsd.open(demo_project)


@pytest.fixture(scope="module")
def week(site: vsd.OpenProject) -> vsd.Days:
    return site.week(WEEK)


def printed(demo_project: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> object:
    run(cli, ["-C", str(demo_project), *arguments, "--json"])
    return json.loads(capsys.readouterr().out)


def test_a_site_of_one_camera_has_one_camera(tmp_path: Path) -> None:
    assert (
        run(cli, ["-C", str(tmp_path), "init", "--no-input", "--name", "Hall", "--timezone", "UTC", "--camera", "a"])
        == 0
    )
    assert repr(vsd.open(tmp_path)) == "Hall: 1 camera, 0 areas, nothing stored yet"


def test_every_part_answers(demo_project: Path) -> None:
    found = use(demo_project)
    assert [name for name, value in found.items() if value is None] == []
    assert len(found["query"]) == 14  # type: ignore[arg-type]  # two hours on seven days


def test_hours_are_those_of_the_command(demo_project: Path, week: vsd.Days, capsys: pytest.CaptureFixture[str]) -> None:
    rows = printed(demo_project, capsys, "hours", "--week", WEEK)
    frame = week.hours.df()
    assert frame["n_violations"].isna().any()
    expected = [row["n_violations"] for row in rows["hours"]]  # type: ignore[index, call-overload]
    assert [None if pd.isna(n) else int(n) for n in frame["n_violations"]] == expected


def test_instants_have_the_zone_of_the_site_and_counts_are_whole_numbers(week: vsd.Days) -> None:
    frame = week.hours.df()
    assert str(frame["start"].dt.tz) == "Europe/Rome"
    assert (frame["start"].dt.hour == frame["local_hour"]).all()
    assert str(frame["n_violations"].dtype) == "Int64"
    assert str(week.violations.df()["started"].dt.tz) == "Europe/Rome"
    assert week.hours.pl()["start"].dtype.time_zone == "Europe/Rome"  # type: ignore[attr-defined]


def test_violations_add_up_to_those_of_the_hours(week: vsd.Days) -> None:
    assert len(week.violations) == week.hours.df()["n_violations"].sum()


def test_areas_are_those_of_the_report(demo_project: Path, week: vsd.Days, capsys: pytest.CaptureFixture[str]) -> None:
    report = printed(demo_project, capsys, "report", "--week", WEEK)
    [whole] = [row for row in week.areas.arrow().to_pylist() if row["kind"] == "floor"]
    assert {row["area_id"] for row in week.areas} == {*week.area_hours["area_id"], None}, "the rest has one name"
    violation_rate, close = (report["level"][key] for key in ("violation_rate", "close_time_share"))  # type: ignore[index, call-overload]
    assert whole["violations_per_open_h"] == pytest.approx(violation_rate["value"], rel=1e-3)
    assert whole["close_time_share"] == pytest.approx(close["value"], rel=1e-3)
    values = {a["area_id"]: a["violation_rate"]["value"] for a in report["areas"]}  # type: ignore[index, call-overload]
    for row in week.areas.arrow().to_pylist():
        if row["kind"] == "area" and values[row["area_id"]] is not None:
            assert row["violations_per_open_h"] == pytest.approx(values[row["area_id"]], rel=1e-3)


def test_a_table_is_short_when_printed_and_says_how_many_rows_there_are(week: vsd.Days) -> None:
    text = repr(week.violations)
    assert len(text) < 2_500
    assert f"{len(week.violations):,} rows" in text
    html = week.violations._repr_html_()
    assert html.count("<tr") <= 10


def test_texts_of_a_table_are_escaped_in_a_notebook() -> None:
    table = Table(pa.table({"name": ["<script>alert(1)</script>"]}), title="<b>", note="<i>")
    assert not re.search(r"<script>|<b><b>|<i>", table._repr_html_())


@pytest.mark.parametrize("cell_m", [0.3, 0.1, 0.0, -0.5, 2000.0, float("nan")])
def test_cells_that_stored_cells_do_not_add_up_to_are_refused(week: vsd.Days, cell_m: float) -> None:
    with pytest.raises(UsageError, match=r"is not a multiple of 0\.25 m"):
        week.heatmap("exposure", cell_m=cell_m)


def test_a_map_is_an_array_of_metres_with_gaps_where_nobody_was(week: vsd.Days) -> None:
    exposure, burden = week.heatmap("exposure"), week.heatmap("burden")
    left, right, bottom, top = exposure.extent_m
    rows, columns = exposure.array.shape
    assert ((right - left) / columns, (top - bottom) / rows) == (exposure.cell_m, exposure.cell_m)
    assert np.isnan(exposure.array).any()
    assert np.array_equal(np.isnan(exposure.array), exposure.exposure_h == 0)
    assert (burden.array[np.isfinite(burden.array)] <= exposure.array[np.isfinite(burden.array)] + 1e-9).all()
    known = int(np.isfinite(burden.array).sum())
    assert len(burden.geojson()["features"]) == known


def test_a_map_is_drawn_over_its_metres(week: vsd.Days) -> None:
    risk = week.heatmap("risk")
    ax = risk.plot()
    assert tuple(ax.images[0].get_extent()) == risk.extent_m
    assert ax.get_title() == "Ground floor: risk"
    plt.close("all")


def test_own_tables_join_and_cannot_replace_a_relation(week: vsd.Days) -> None:
    own = pd.DataFrame({"local_hour": range(24), "sales": range(24)})
    found = week.sql("select count(*) as n from hours join tills using (local_hour)", tills=own).df()
    assert found["n"].tolist() == [168]
    for name in ("hours", "episodes", 'x"; drop table hours; --', "Tills"):
        with pytest.raises(UsageError, match="cannot be the name"):
            week.sql("select 1", **{name: own})
    with pytest.raises(SqlError):
        week.sql("create table x as select 1")


def test_periods_are_compared_by_text_or_date(site: vsd.OpenProject) -> None:
    texts = site.compare("2026-11-09..2026-11-10", "2026-11-11..2026-11-12")
    dates = site.compare((date(2026, 11, 9), date(2026, 11, 10)), (date(2026, 11, 11), date(2026, 11, 12)))
    assert texts.arrow().equals(dates.arrow())
    assert {"name", "violations_per_open_h_change", "close_time_share_verdict"} <= set(texts.columns)


@pytest.mark.parametrize("asked", ["2026-W99", "next week", "", "2026-11-09"])
def test_what_is_no_week_is_refused_in_words(site: vsd.OpenProject, asked: str) -> None:
    with pytest.raises(UsageError, match="is not a week"):
        site.week(asked)


def test_days_in_the_wrong_order_are_refused(site: vsd.OpenProject) -> None:
    with pytest.raises(UsageError):
        site.days(date(2026, 11, 12), date(2026, 11, 9))


def test_an_open_notebook_makes_no_purge_wait(demo_project: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(demo_project, tmp_path / "demo"))  # other workers read the shared one
    day = vsd.open(root).days("2026-11-15")
    assert len(day.hours)
    with removal.removing(root / "store", wait_s=1.0):
        assert day is not None


def test_another_distance_is_answered_beside_the_sites_own(demo_project: Path, tmp_path: Path) -> None:
    def stored() -> set[Path]:
        return {p for p in (root / "facts").rglob("*.parquet") if "beside" not in p.parts}

    root = Path(shutil.copytree(demo_project, tmp_path / "demo"))
    day = vsd.open(root).days("2026-11-15")
    own, before = day.violations.df(), stored()
    near = day.at(distance_m=1.0)
    assert repr(near).endswith("2026-11-15..2026-11-15 at distance_m = 1: 2026-11-15 to 2026-11-15")
    assert near.violations.df()["min_distance_m"].max() < 1.0 < own["min_distance_m"].max()
    assert stored() == before
    assert near.at(distance_m=2.0).violations.df().equals(own)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"distance": 1.0}, "distance is no setting.*did you mean distance_m"),
        ({"mask_below": 3}, "mask_below is set in vsd.toml alone"),
        ({"people": "guests"}, "people = 'guests' is not one of all, visitors, staff"),
        ({"distance_m": 11.0}, "not between 0.1 and 10 metres"),
        ({"distance_m": 2.6}, "more than pair_max_m = 2.5"),
    ],
)
def test_settings_that_no_figure_reads_or_that_cannot_be_are_refused(
    week: vsd.Days, settings: dict[str, float], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        week.at(**settings)
