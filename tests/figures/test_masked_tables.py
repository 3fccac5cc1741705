"""Tables that leave the operator's hands hold small counts back, and nothing else."""

from __future__ import annotations

import csv
import io
import json
from datetime import date
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from retention.aged_projects import DAYS, make_project, vsd, write

from vsd_analytics.errors import UsageError
from vsd_analytics.figures.masked_tables import ReportsHold, shared_cells, shared_hours

counts = st.one_of(st.none(), st.integers(0, 12))
rows = st.lists(st.tuples(counts, counts, counts, st.floats(0, 100), st.floats(0, 100)), min_size=1, max_size=12)
COUNTS = ("person_records", "violation_records", "n_violations")


def hourly(values: list[tuple[Any, ...]]) -> pd.DataFrame:
    frame = pd.DataFrame(values, columns=[*COUNTS, "exposure_s", "violation_s"])
    return frame.astype(dict.fromkeys(COUNTS, "Int64"))


@given(rows, st.integers(2, 6))
def test_no_small_count_is_printed_and_no_large_one_lost(values: list[tuple[Any, ...]], below: int) -> None:
    frame = hourly(values)
    shared = shared_hours(frame, below=below)
    for i, old in enumerate(frame.to_dict("records")):
        new = shared.iloc[i]
        small = [c for c in COUNTS if not pd.isna(old[c]) and 0 < old[c] < below]
        shown = [int(new[c]) for c in COUNTS if not pd.isna(new[c])]
        assert all(n == 0 or n >= below for n in shown)
        assert bool(new["masked"]) == bool(small)
        if not small:
            assert all(pd.isna(new[c]) == pd.isna(old[c]) and (pd.isna(new[c]) or new[c] == old[c]) for c in COUNTS)
            assert (new["exposure_s"], new["violation_s"]) == (old["exposure_s"], old["violation_s"])
        if "n_violations" in small:
            assert pd.isna(new["violation_s"]) or new["violation_s"] == 0
        if "person_records" in small:
            assert pd.isna(new["exposure_s"]) or new["exposure_s"] == 0


def test_a_small_count_of_an_area_is_not_the_rest_of_its_hour_or_its_week() -> None:
    starts = [f"2026-11-09T{hour:02d}:00:00+01:00" for hour in (9, 10, 11)]
    n = {"queue": (3, 7, 12), "door": (9, 8, 20), "aisle": (0, 30, 40)}
    rows = [(start, "ground", area, 60.0, n[area][k]) for k, start in enumerate(starts) for area in n]
    frame = pd.DataFrame(rows, columns=["start", "floor_id", "area_id", "exposure_s", "n_violations"])
    shared = shared_hours(frame.astype({"n_violations": "Int64"}), below=5, reports=ReportsHold())
    hidden = {(r.start[11:13], r.area_id) for r in shared.itertuples() if pd.isna(r.n_violations)}
    assert hidden == {("09", "queue"), ("09", "door"), ("10", "queue"), ("10", "door")}
    assert [r.area_id for r in shared.itertuples() if r.masked] == ["queue"]
    assert shared["held_back"].sum() == 3


def test_what_the_report_holds_back_is_not_in_the_table() -> None:
    frame = pd.DataFrame({"start": ["a", "b"], "area_id": [None, None], "floor_id": ["ground"] * 2})
    frame = frame.assign(start=["2026-11-09T09:00:00+01:00", "2026-11-09T10:00:00+01:00"], exposure_s=1.0)
    frame["n_violations"] = pd.array([9, 12], dtype="Int64")
    held = ReportsHold(hours=frozenset({"2026-11-09T09:00:00+01:00"}))
    of_floor = frame.drop(columns=["area_id", "floor_id"]).assign(person_records=pd.array([90, 90], dtype="Int64"))
    assert shared_hours(of_floor, below=5, reports=held)["n_violations"].isna().tolist() == [True, False]
    held = ReportsHold(areas=frozenset({(date(2026, 11, 9), "ground", None)}))
    assert shared_hours(frame, below=5, reports=held)["n_violations"].isna().tolist() == [True, True]


def test_cells_hold_small_counts_back_and_tell_no_path() -> None:
    cells = pd.DataFrame({"cx": [0, 1, 2], "cy": [0, 0, 0], "records": [0, 3, 7], "exposure_s": [9.0, 9.0, 9.0]})
    shared = shared_cells(cells, below=5)
    assert list(shared.columns) == ["cx", "cy", "records", "masked"]
    assert [(r.cx, None if pd.isna(r.records) else r.records, r.masked) for r in shared.itertuples()] == [
        (1, None, True),
        (2, 7, False),
    ]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One hour with a violation of four records, one with many."""
    root = make_project(tmp_path_factory.mktemp("kept") / "p")
    found = []
    for hour, n_close in ((9, 4), (10, 80)):
        for k in range(90):
            persons = [{"id": "a", "x_m": 1.1, "y_m": 1.1}] + [{"id": "b", "x_m": 1.6, "y_m": 1.1}] * (k < n_close)
            ts = f"{DAYS[0]}T{hour:02d}:{k // 6:02d}:{10 * (k % 6):02d}Z"
            found.append({"v": 1, "camera": "cam-1", "ts": ts, "persons": [*persons, {"id": "c", "x_m": 9, "y_m": 9}]})
    vsd(root, "ingest", str(write(root / "f.jsonl", found)))
    return root


def test_hours_for_sharing(project: Path) -> None:
    told = json.loads(vsd(project, "hours", "--range", DAYS[0], "--share", "--json"))["hours"]
    of_hour = {h["start"][11:13]: h for h in told}
    assert (of_hour["10"]["violation_records"], of_hour["10"]["n_violations"], of_hour["10"]["masked"]) == (
        None,
        None,
        True,
    )
    assert of_hour["10"]["person_records"] == 184
    assert of_hour["12"]["masked"] is False
    text = vsd(project, "hours", "--range", DAYS[0], "--share")
    (line,) = [row for row in text.splitlines() if "T10:00" in row]
    assert line.split()[1:4] == ["184", "<5", "<5"]
    assert "<5" not in vsd(project, "hours", "--range", DAYS[0])
    by_area = json.loads(vsd(project, "hours", "--range", DAYS[0], "--by", "area", "--share", "--json"))["hours"]
    assert all("exposure_s" not in row for row in by_area)


def test_heatmap_for_sharing(project: Path) -> None:
    at_nine = f"{DAYS[0]}"
    text = vsd(project, "heatmap", "--range", at_nine, "--cell", "0.25", "--share")
    exact = vsd(project, "heatmap", "--range", at_nine, "--cell", "0.25")
    assert {r["records"] for r in csv.DictReader(io.StringIO(exact))} == {"84"}
    assert text == exact
    told = json.loads(vsd(project, "heatmap", "--range", at_nine, "--at", "person", "--share", "--json"))
    assert all(set(c) == {"cx", "cy", "records", "masked"} for c in told["cells"])
    with pytest.raises(UsageError):
        vsd(project, "heatmap", "--range", at_nine, "--share", "--format", "svg", "--out", "x.svg")


def test_a_small_cell_is_reported_as_small(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    persons = [{"id": "a", "x_m": 1.1, "y_m": 1.1}, {"id": "b", "x_m": 1.6, "y_m": 1.1}]
    found = [{"v": 1, "camera": "cam-1", "ts": f"{DAYS[0]}T09:00:{10 * k:02d}Z", "persons": persons} for k in range(3)]
    vsd(root, "ingest", str(write(root / "f.jsonl", found)))
    assert vsd(root, "heatmap", "--share") == "cx,cy,records\n1,1,<5\n"
    assert vsd(root, "heatmap") == "cx,cy,records\n1,1,3\n"
