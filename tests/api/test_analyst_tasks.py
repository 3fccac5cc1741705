"""The seven tasks of docs/python.md: each in at most five lines, with typed results that are short when printed."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pandas as pd
import pytest

import vsd_analytics as vsd

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
BEGIN, *TASKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)


@pytest.fixture(scope="module")
def done(demo_project: Path) -> dict[str, Any]:
    """Return the names that the page's code leaves behind."""
    names: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(demo_project.parent)
        patch.setenv("MPLBACKEND", "agg")
        for block in (BEGIN, *TASKS):
            exec(compile(block, "docs/python.md", "exec"), names)
    plt.close("all")
    return names


def test_seven_tasks_take_at_most_five_lines_each() -> None:
    lines = [block.count("\n") for block in TASKS]
    assert len(lines) == 7
    assert max(lines) <= 5
    rows = re.findall(r"^\| [a-z].*? \| (\d) \| [\d.]+ \|$", PAGE, re.M)
    assert [int(n) for n in rows] == lines, "the table of the page says how many"


def test_results_have_real_types_and_the_zone_of_the_site(done: dict[str, Any]) -> None:
    types = {name: str(done["hours"][name].dtype) for name in ("start", "local_date", "n_violations", "recorded_share")}
    assert re.fullmatch(r"datetime64\[\w+, Europe/Rome\]", types["start"])
    assert types["local_date"].startswith("datetime64")
    assert (types["n_violations"], types["recorded_share"]) == ("Int64", "float64")
    assert pd.api.types.is_float_dtype(done["per_sale"]["n"])
    assert len(done["per_sale"]) == 3 * 7
    assert 0 < done["near"]["n_violations"].sum() < done["hours"]["n_violations"].sum()
    assert {"close_time_share_change", "close_time_share_verdict"} <= set(done["changed"].columns)
    assert (done["longest"]["longest_s"] > 0).all()


def test_tables_without_rows_have_their_columns_and_say_why(done: dict[str, Any]) -> None:
    assert len(done["spots"]) == 0
    assert done["ax"].get_title() == done["week"].hotspots.note != ""
    nothing = done["site"].compare("2026-W45", "2026-W46")
    assert len(nothing) == 0
    assert nothing.note
    assert "violations_per_open_h_change" in nothing.df().columns


def test_whatever_is_typed_at_a_prompt_prints_little(done: dict[str, Any]) -> None:
    week, site = done["week"], done["site"]
    shown = [site, week, week.hours, week.violations, week.cells, week.areas, week.hotspots, done["risk"], site.changes]
    assert max(len(repr(thing)) for thing in shown) < 2_500


@pytest.mark.parametrize("figure", ["groups", "gatherings", "episode_figures", "coverage", "hours"])
def test_a_single_figure_prints_little(done: dict[str, Any], figure: str) -> None:
    week = done["week"]
    warehouse = vsd.open_warehouse(done["site"].site, week.first, week.last)
    assert len(repr(getattr(vsd, figure)(warehouse))) < 20_000


def test_instants_with_a_zone_are_fetched_where_pytz_is_missing(demo_project: Path) -> None:
    """DuckDB's own fetch needs pytz for them; the program and the API do not."""
    script = f"""
import sys
sys.modules["pytz"] = None
import vsd_analytics as vsd
week = vsd.open({str(demo_project)!r}).week("2026-W46")
print(week.sql("select make_timestamptz(hour_start_ms * 1000) as at from hours limit 1").df()["at"].iloc[0])
print(week.hours.df()["start"].iloc[0])
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1] == "2026-11-09 00:00:00+01:00"


def test_importing_a_room_replaces_no_function() -> None:
    importlib.import_module("vsd_analytics.figures.compare")
    importlib.import_module("vsd_analytics.ingest.pipeline")
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
