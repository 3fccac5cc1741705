"""A crash anywhere in a purge and the same command again end as without; all points: `prove_purge_crashes.py`."""

from __future__ import annotations

from pathlib import Path

import pytest
from purge_crashes import JOBS, outcome, points_of, prepare, start_of

N_TRIED = {"age": 4, "range": 5, "sealed": 7, "keys": 5}


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return prepare(tmp_path_factory.mktemp("crashes"))


@pytest.mark.parametrize("job", JOBS)
def test_killed_anywhere_and_run_again_is_the_same_end(prepared: Path, tmp_path: Path, job: str) -> None:
    start = start_of(job, prepared, tmp_path)
    n_points = points_of(job, start)
    assert n_points >= 7
    tried = sorted({round(k * (n_points - 1) / (N_TRIED[job] - 1)) for k in range(N_TRIED[job])})
    wrong = {at: what for at in tried if (what := outcome(job, start, tmp_path / f"{job}-{at}", at=at))}
    assert wrong == {}
