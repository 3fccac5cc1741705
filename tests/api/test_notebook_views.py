"""What a notebook shows of the API's objects, maps over plan and picture, and tracks for other libraries."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import vsd_analytics as vsd
from vsd_analytics.api.table import Table
from vsd_analytics.errors import UsageError
from vsd_analytics.report.draw.cell_map import LOW, doubling_steps
from vsd_analytics.report.draw.svg import RAMP_LIGHT
from vsd_analytics.store.store import Store


@pytest.fixture(scope="module")
def site(demo_project: Path) -> vsd.OpenProject:
    return vsd.open(demo_project)


@pytest.fixture(scope="module")
def week(site: vsd.OpenProject) -> vsd.Days:
    return site.week("2026-W46")


@pytest.fixture(scope="module")
def risk(week: vsd.Days) -> vsd.Heatmap:
    return week.heatmap("risk")


@pytest.fixture(autouse=True)
def _no_figures_left(monkeypatch: pytest.MonkeyPatch) -> object:
    monkeypatch.setenv("MPLBACKEND", "agg")
    yield
    plt.close("all")


def test_days_show_a_strip_for_each_camera_and_day_and_the_counts_of_the_table(week: vsd.Days) -> None:
    html = week._repr_html_()
    assert html.count('viewBox="0 0 100 12"') == 4 * 7
    assert f"{len(week.violations):,} violations" in html
    coverage = week.coverage.df()
    share = coverage["recorded_h"].sum() / coverage["open_h"].sum()
    assert f"{share:.0%} of the open camera-hours recorded" in html
    assert 'class="off"' in html, "the demo's camera that was down is hatched"


def test_a_map_in_a_notebook_draws_each_known_cell_once_on_the_plan_with_its_areas(risk: vsd.Heatmap) -> None:
    html = risk._repr_html_()
    paths = re.findall(r'<path fill="(#\w+)" d="([^"]+)"', html)
    drawn = {colour: d.count("M") for colour, d in paths if colour in (LOW, *RAMP_LIGHT)}
    assert sum(drawn.values()) == int(np.isfinite(risk.array).sum())
    assert "<image" in html
    assert "Checkout queue" in html
    assert risk.unit in html


def test_colours_of_a_map_follow_its_steps(risk: vsd.Heatmap) -> None:
    steps = doubling_steps(risk.array)
    known = risk.array[np.isfinite(risk.array)]
    drawn = dict(re.findall(r'<path fill="(#\w+)" d="([^"]+)"', risk._repr_html_()))
    assert drawn[RAMP_LIGHT[4]].count("M") == int((known >= steps[4]).sum()) > 0
    assert np.allclose(np.divide(steps[1:], steps[:-1]), 2, rtol=0.1)


def test_a_map_over_the_plan_covers_the_plan_and_keeps_its_cells(risk: vsd.Heatmap) -> None:
    ax = risk.plot(over="plan")
    cells, plan = ax.images
    assert tuple(cells.get_extent()) == risk.extent_m
    assert tuple(plan.get_extent()) == (0, 24, 0, 16)
    inked = np.asarray(plan.get_array())
    assert (inked[..., 3] == 0).mean() > 0.5, "bare floor is clear, so that the cells show"
    assert (inked[..., 3] > 0).mean() > 0.1, "fixtures and walls are drawn"


def test_a_map_over_a_picture_draws_the_cells_where_the_camera_sees_them(risk: vsd.Heatmap) -> None:
    ax = risk.plot(over="cam-2")
    [cells] = ax.collections
    assert ax.get_title() == "Checkouts: risk"
    assert 20 < len(cells.get_paths()) < int(np.isfinite(risk.array).sum())
    corners = np.concatenate([path.vertices for path in cells.get_paths()])
    assert (corners >= -1).all()
    assert (corners <= np.array([1281, 721])).all()
    assert cells.get_clim() == risk.plot().images[0].get_clim(), "the same scale over every camera and the plan"
    assert cells.colorbar.ax.xaxis.get_major_formatter()(0.2) == "20%", "a share is read in percent"


def test_one_cell_above_all_others_does_not_make_them_pale_and_the_scale_says_so(week: vsd.Days) -> None:
    burden = week.heatmap("burden")
    ax = burden.plot()
    low, high = ax.images[0].get_clim()
    known = burden.array[np.isfinite(burden.array)]
    assert low == 0
    assert 0.95 < (known <= high).mean() < 1
    assert ax.images[0].colorbar.extend == "max"


def test_a_map_over_something_unknown_names_what_there_is(risk: vsd.Heatmap) -> None:
    with pytest.raises(UsageError, match="cam-9") as refused:
        risk.plot(over="cam-9")
    assert "cam-1, cam-2, cam-3, cam-4" in str(refused.value.fix)


def test_a_map_that_cannot_be_made_says_why_in_a_notebook(site: vsd.OpenProject) -> None:
    empty = site.days(date(2026, 11, 1)).heatmap("excess")  # before the first record
    assert empty.array.size == 0
    assert empty.note
    assert empty.note in empty._repr_html_()


def test_numbers_of_a_table_are_written_as_in_the_report() -> None:
    rows = pa.table({"n": [1234567, None], "share": [0.41666, None], "is_open": [True, False]})
    html = Table(rows, title="T")._repr_html_()
    assert re.findall(r"<td[^>]*>([^<]*)</td>", html) == ["1,234,567", "0.42", "yes", "–", "–", "no"]


def test_a_change_is_drawn_as_the_bar_of_the_report_and_its_ends_are_not_repeated() -> None:
    rows = pa.table({"a_change": [-0.2], "a_change_lo": [-0.3], "a_change_hi": [-0.1], "a_verdict": ["clear_fall"]})
    html = Table(rows, title="T")._repr_html_()
    assert "−20%" in html
    assert 'class="ci g"' in html
    assert "a_change_lo" not in html


@pytest.mark.parametrize("texts", [["<script>"], ["\"'><img src=x>"]])
def test_names_from_data_stay_text_in_a_notebook(texts: list[str]) -> None:
    html = Table(pa.table({"<b>x": texts}), title="<i>", note="<u>")._repr_html_()
    assert not re.search(r"<(script|img|i|u)\b", html)
    assert html.count("<b>") == 1, "only the title's own"


def test_tracks_have_the_columns_and_types_that_pedpy_and_movingpandas_read(site: vsd.OpenProject) -> None:
    walks = site.days("2026-11-09").tracks("cam-1")
    frame = walks.df()
    assert {c: str(frame[c].dtype) for c in ("id", "frame", "x", "y")} == {
        **{"id": "int64", "frame": "int64"},
        **{"x": "float64", "y": "float64"},
    }
    assert frame["t"].dt.tz is None, "movingpandas takes instants without a zone"
    assert not frame.duplicated(["id", "frame"]).any(), "PedPy refuses a person twice in a frame"
    assert list(frame["id"].unique()) == sorted(frame["id"].unique())
    seconds = (frame["t"] - frame["t"].min()).dt.total_seconds()
    assert (frame["frame"] == (seconds * walks.frame_rate_hz).round()).all()
    assert frame["id"].nunique() == frame["track_id"].nunique()


def test_tracks_are_the_stored_records_of_those_days(site: vsd.OpenProject, demo_project: Path) -> None:
    stored = pd.concat(
        pd.read_parquet(part.path, columns=["camera_id", "track_id", "ts"])
        for part in Store(demo_project / "store", site_id="quayside").parts("observations")
    )
    local = stored["ts"].dt.tz_convert("Europe/Rome")
    own = stored[(stored["camera_id"] == "cam-1") & (local.dt.date == date(2026, 11, 9))]
    walks = site.days("2026-11-09").tracks("cam-1")
    left_out = int(walks.note.split()[0].replace(",", "")) if walks.note else 0
    assert len(walks) + left_out == len(own) > 1000


def test_tracks_of_no_camera_in_particular_are_refused_where_there_are_several(site: vsd.OpenProject) -> None:
    with pytest.raises(UsageError, match="which camera"):
        site.days("2026-11-09").tracks()
