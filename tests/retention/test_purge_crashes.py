"""A crash anywhere in a purge and the same command again end as without; all points: `prove_purge_crashes.py`."""

from __future__ import annotations

from pathlib import Path

import pytest
from purge_crashes import JOBS, Crash, outcome, points_of, prepare, start_of

from vsd_analytics.store.seals import DaySeal, Seals

N_TRIED = {"age": 4, "range": 5, "sealed": 7, "request": 4, "delivered": 6, "sealed request": 4, "keys": 5}


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


def _sealed(root: Path) -> dict[Path, bytes]:
    return {p.relative_to(root): p.read_bytes() for p in (root / "sealed").rglob("*.*") if p.is_file()}


def _stopped_before_the_seal(job: str, root: Path) -> None:
    def stop(_seals: Seals, _seal: DaySeal) -> None:
        raise Crash

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Seals, "write", stop)
        with pytest.raises(Crash):
            JOBS[job](root)


@pytest.mark.parametrize("job", ["age", "sealed"])
def test_a_stop_between_the_files_of_a_day_and_its_seal_leaves_what_was_sealed(
    prepared: Path, tmp_path: Path, job: str
) -> None:
    root = start_of(job, prepared, tmp_path)
    before, records = _sealed(root), {p: p.read_bytes() for p in (root / "store").rglob("[0-9]*-*.parquet")}
    _stopped_before_the_seal(job, root)
    now = _sealed(root)
    assert before.items() <= now.items()
    made = now.keys() - before.keys()
    assert {p.parts[1] for p in made} >= {"days"}
    assert not any(p.suffix == ".json" for p in made)
    if job == "age":  # nothing is removed before it is sealed
        assert {p: p.read_bytes() for p in records} == records
    JOBS[job](root)
    points_of(job, start_of(job, prepared, tmp_path / "other"))
    assert _sealed(root) == _sealed(tmp_path / "other" / f"unharmed-{job}")
