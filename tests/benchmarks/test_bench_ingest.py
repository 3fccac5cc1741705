"""The benchmark of the ingest runs to its end: its records have every column of the tables."""

from __future__ import annotations

import sys

import bench_ingest
import pytest


@pytest.mark.parametrize("options", [[], ["--pairs"]])
def test_the_benchmark_prints_each_of_its_steps(
    options: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["bench_ingest.py", "--rows", "600", "--rounds", "1", *options])
    bench_ingest.main()
    table = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    assert len(table) > 4, "a step is missing"
