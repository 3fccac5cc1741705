"""Two notebooks on a real hour: the ATC shopping centre, 24 October 2012 from 9, beside counts of its raw files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from notebooks.executed import execute, figures
from prove_atc import NOW, OPTIONS, TOML

from vsd_analytics.config import load_site
from vsd_analytics.ingest.pipeline import ingest

pytestmark = pytest.mark.realdata
WEEK = "2012-W43"


@pytest.fixture(scope="module")
def files(realdata: Callable[[str], Path]) -> list[Path]:
    return [realdata(f"atc/atc-1024-9_{part}.csv.gz") for part in ("train", "test")]


@pytest.fixture(scope="module")
def project(realdata: Callable[[str], Path], files: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("atc")
    (root / "vsd.toml").write_text(TOML.format(plan=realdata("atc/atc-occu.png")), encoding="utf-8")
    assert not any(source.error for source in ingest(load_site(root), files, OPTIONS, now=NOW).sources)
    return root


def test_a_first_look_at_a_real_hour_counts_its_raw_records_and_says_what_is_not_known(
    project: Path, files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    n_records = sum(len(pd.read_csv(path, header=None)) for path in files)
    then = f"""
assert hours["person_records"].sum() == {n_records}
assert counts.index.strftime("%a %H").tolist() == ["Wed 09"]
assert [f"{{hour:%a %H}}" for hour in silent] == ["Wed 10", "Wed 11"], "open, and not in the recording"
assert counts.iloc[0] == len(week.violations) > 100
assert risk.note and shown.kind == "burden", "an hour is too little for shares, cell by cell"
assert -60 < x_m < 80 and -40 < y_m < 20, "on the plan"
assert known.empty and areas["close_time_share"].notna().any(), "one day has levels and no interval"
"""
    done = execute("first-look", tmp_path, monkeypatch, then=then, VSD_PROJECT=str(project), VSD_WEEK=WEEK)
    assert figures(done) == 2  # the site has no picture of a camera


def test_on_one_real_hour_no_hotspot_is_found_and_the_reason_is_given(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    then = """
assert len(found) == 0 and "hotspots need 14" in spots.note
assert area.area_id == "east", "the corridor is there"
assert by_hour["per_day"].tolist() == [(week.violations.df()["area_id"] == "east").sum()]
assert (maps["exposure"].exposure_h.sum() * 3600 / week.hours.df()["exposure_s"].sum()).round(2) == 1
"""
    done = execute("find-a-hotspot", tmp_path, monkeypatch, then=then, VSD_PROJECT=str(project), VSD_WEEK=WEEK)
    assert figures(done) == 2
