"""The benchmark compares equal answers, and says so when one differs."""

from __future__ import annotations

import json
from pathlib import Path

import bench_tools
import numpy as np
import pytest
import tool_comparison as comparison
import tool_heatmaps as heatmaps
import tool_pairs as pair_rates
from made_up_site import write_site
from tool_comparison import Took


def test_facts_and_other_tools_count_the_same_people_and_pairs(tmp_path: Path) -> None:
    write_site(tmp_path, n_records=3_000, n_cameras=2, open_h=1)
    ours = heatmaps.ours_first(tmp_path)
    assert ours.hours[:, 1].sum() == ours.cells[:, 2].sum() >= 3_000
    assert ours.hours[:, 2].sum() == ours.cells[:, 3].sum() > 0
    for other in (heatmaps.duckdb_sql, heatmaps.polars_frames, heatmaps.pandas_numpy):
        assert other(tmp_path).digest() == ours.digest(), other.__name__
    ours.cells[0, 2] += 1
    assert heatmaps.pandas_numpy(tmp_path).digest() != ours.digest()


def test_all_tools_find_the_pairs_that_comparing_each_with_each_finds() -> None:
    frame, x, y = people = pair_rates.crowd(400, per_frame=50)
    near = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2 <= pair_rates.REACH_MM**2
    n_pairs = int(np.triu(near & (frame[:, None] == frame), k=1).sum())
    assert n_pairs > 100
    assert {name: count(people) for name, count in pair_rates.PAIRS.items()} == dict.fromkeys(pair_rates.PAIRS, n_pairs)


def test_another_answer_of_one_tool_is_printed_and_is_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def measured(kind: str, step: str, folder: Path, n: int, limit_mib: int | None) -> Took:
        return Took(2.0, 4.0 if "tree" in step else 1.0, 100.0, "other" if "tree" in step else "same")

    monkeypatch.setattr(comparison, "_run", measured)
    assert bench_tools.main(["--quiet", "--only", "pairs", "--rounds", "3", "--json"]) == 1
    tables = json.loads(capsys.readouterr().out)
    rows = {row["name"]: row for row in tables["pairs within 2.5 m, 6 people in a frame"]}
    assert rows["scipy, KD-tree"]["is_equal"] is False
    assert rows["scipy, KD-tree"]["ratios"] == [4, 4, 4]
    assert rows["numpy, shifts"]["is_equal"] is True


def test_a_step_that_uses_more_memory_than_it_may_is_ended_and_printed_as_such(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = ["raw scan of four columns, DuckDB", "vsd, again"]
    monkeypatch.setattr(comparison, "HEATMAPS", {step: heatmaps.HEATMAPS[step] for step in steps})
    monkeypatch.setattr(comparison, "LOOK_S", 0.01)
    command = ["--quiet", "--records", "2000", "--only", "heatmaps", "--rounds", "2", "--in", str(tmp_path)]
    assert bench_tools.main([*command, "--memory", "0.1"]) == 0
    printed = capsys.readouterr().out
    assert "| vsd, again | – | – | – | – | – | – | over 102 | |" in printed
    assert list(tmp_path.iterdir()) == []
