"""Every number that several outputs give is the same in all of them, or has another name.

Violations of an hour or a day are all that were counted in opening hours. "Counted" (M8) are those of the camera-hours
that enter rates; the estimate of `vsd today` makes up for cameras that were down.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
import shapely
from one_number.outputs import Outputs, outputs
from one_number.sections import repeated
from realdata import prove_atc

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.planner.page import render_planner
from vsd_analytics.simulate.canteen_project import write_canteen_project
from vsd_analytics.simulate.demo import ingest_demo
from vsd_analytics.simulate.demo_project import write_demo_project
from vsd_analytics.warehouse.build import build

README = Path(__file__).resolve().parents[2] / "README.md"
MONDAY = date(2026, 11, 9)
SIX_DIGITS = 2e-5
"""JSON and CSV are written with six digits."""
READ = """hash => {
  history.replaceState(null, '', '#' + hash); dispatchEvent(new HashChangeEvent('hashchange'));
  return {...document.getElementById('now-close').dataset};
}"""


def _demo(root: Path, *, weeks: int, place: str = "shop") -> date:
    write = write_demo_project if place == "shop" else write_canteen_project
    write(root, seed=4, weeks=weeks)
    ingest_demo(load_site(root), sorted((root / "engine").iterdir()), seed=4)
    build(load_site(root))
    return MONDAY


def _atc(root: Path, folder: Path) -> date:
    (root / "vsd.toml").write_text(prove_atc.TOML.format(plan=folder / "atc-occu.png"), encoding="utf-8")
    files = [folder / name for name in prove_atc.FILES]
    ingest(load_site(root), files, prove_atc.OPTIONS, now=prove_atc.NOW)
    build(load_site(root))
    return prove_atc.MONDAY


@pytest.fixture(
    scope="module",
    params=[
        "demo",
        "canteen",
        pytest.param("twelve weeks", marks=pytest.mark.long),
        pytest.param("atc", marks=pytest.mark.realdata),
    ],
)
def told(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Outputs:
    """Return what all outputs of a project say of one week."""
    base = tmp_path_factory.mktemp("one")
    root = base / "project"
    if request.param == "demo":
        root, monday = request.getfixturevalue("demo_project"), MONDAY
    else:
        root.mkdir()
        if request.param == "atc":
            monday = _atc(root, request.getfixturevalue("realdata")("atc"))
        else:
            monday = _demo(root, weeks=12, place="canteen" if request.param == "canteen" else "shop")
    folder = base / "out"
    folder.mkdir()
    return outputs(root, monday, folder)


def _differ(a: Any, b: Any) -> bool:
    if isinstance(a, str) or isinstance(b, str) or a is None or b is None:
        return bool(a != b)
    return not np.isclose(float(a), float(b), rtol=SIX_DIGITS, atol=1e-9)


def test_a_number_is_the_same_in_all_outputs_that_have_it(told: Outputs) -> None:
    shared = {key: values for key, values in told.numbers.items() if len(values) > 1}
    different = {
        key: values
        for key, values in shared.items()
        if any(_differ(v, next(iter(values.values()))) for v in values.values())
    }
    assert not different
    kinds = {key[0] for key in shared}
    assert {"counted", "hour", "day", "M0", "M6", "M7", "recorded share", "hotspots from"} <= kinds


def test_a_logged_change_is_the_same_on_page_and_planner_in_command_and_python(told: Outputs) -> None:
    of_changes = {key: values for key, values in told.numbers.items() if key[0] == "change"}
    everywhere = {"page changes", "planner changes", "vsd compare --change", "Python change"}
    n_areas = sum(change.answers is not None for change in told.planner.changes)
    assert sum(everywhere <= values.keys() for key, values in of_changes.items() if key[2] == "outcome") == n_areas
    for change in told.page["change_effects"]:
        if change["running"] is not None and change["running"]["change"] is not None:
            key = ("change", str(change["number"]), "running", "value")
            assert of_changes[key].keys() == everywhere
    assert not {
        key
        for key, values in of_changes.items()
        if any(_differ(v, next(iter(values.values()))) for v in values.values())
    }


@pytest.mark.parametrize("told", ["canteen"], indirect=True)
def test_the_sentence_that_the_readme_quotes_is_on_the_page(told: Outputs) -> None:
    quoted = re.search(r"^> Till: (.*\n(?:> .*\n)*)", README.read_text(encoding="utf-8"), re.M)
    assert quoted is not None
    assert quoted[1].replace("\n> ", " ").strip() in json.dumps(told.page, ensure_ascii=False)


def test_what_a_section_of_the_page_repeats_is_the_number_of_its_answer(told: Outputs) -> None:
    pairs = list(repeated(told.page))
    assert {name.partition(".")[0] for name, section, _ in pairs if section is not None} >= {
        "level",
        "areas",
        "coverage",
    }
    assert not [pair for pair in pairs if _differ(*pair[1:])]


def test_the_share_between_groups_is_that_of_the_counts_beside_it(told: Outputs) -> None:
    answers = told.page["answers"]
    figure = answers["between_groups"]["rows"][0]["between_share"]
    if figure["value"] is None:
        assert figure["reason"]
        return
    n = {row["reading"]: row["n_violations"]["value"] for row in answers["readings"]["rows"]}
    [share] = answers["between_groups"]["rows"]
    known, unknown = share["n_violations"]["value"], n["all"] - share["n_violations"]["value"]
    assert figure["value"] == pytest.approx((n["between_groups"] - unknown) / known, abs=1e-6)


def test_hotspots_begin_with_the_records(told: Outputs) -> None:
    assert told.hotspots.first >= told.first_stored


def test_a_hotspot_lies_where_the_planner_s_map_says_more_than_the_crowd_explains(told: Outputs) -> None:
    cells = told.planner.week.cells
    if cells is None or cells.excess.cells is None:
        assert not told.planner.hotspots.spots
        return
    grid, ratio = cells.excess.grid, cells.excess.cells.ratio
    assert grid is not None
    assert (cells.excess.first, cells.excess.last) == (told.planner.hotspots.first, told.planner.hotspots.last)
    x, y = np.meshgrid(grid.x_m(np.arange(grid.shape[1])), grid.y_m(np.arange(grid.shape[0])))
    for spot in told.planner.hotspots.spots:
        outline = shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in spot.place.polygons])
        inside = shapely.contains_xy(outline, x, y)
        assert inside.sum() * grid.cell_m**2 == pytest.approx(spot.place.area_m2)
        assert (ratio[inside] >= told.least_ratio).all()
        assert outline.area < (cells.excess.cells.label > 0).sum() * grid.cell_m**2  # not what only smoothing brings


@pytest.mark.browser
def test_the_planner_s_script_has_the_report_s_share_of_time_too_close(
    told: Outputs, tab: Callable[..., Any], tmp_path: Path
) -> None:
    path = tmp_path / "planner.html"
    path.write_text(render_planner(told.planner), encoding="utf-8")
    page = tab(path.as_uri())
    page.wait_for_function("document.body.dataset.first")
    for row in told.planner.places:
        shown = page.evaluate(READ, f"place={quote(row.place_id)}")["rate"]
        value = told.numbers["M6", row.place_id.removeprefix("area:")].get("page")
        if value is None:
            assert shown == "", row.place_id
        else:
            assert float(shown) == pytest.approx(value, rel=SIX_DIGITS), row.place_id
