"""A sample of the points of `prove_crashes.py`, those that once went wrong among them, and who may remove facts."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from datetime import date
from pathlib import Path

import pytest
from crash_points import FAULTS, run, why_not
from jobs import JOBS, START, messages, vsd, write_project
from prove_crashes import Unharmed, disturb, unharmed

from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse.warehouse import Warehouse

POINTS = [
    ("append", "kill -9", "rename", "/store/live/observations"),
    ("append", "EIO", "fsync", "/store/live/frames"),
    ("append", "ENOSPC", "write", "/store/live/frames"),
    ("append", "ENOSPC that stays", "fsync", "/store/live/frames"),
    ("append", "EDQUOT", "mkdir", "/store/live"),
    ("append", "short write", "write", "/store/live/frames"),
    ("append", "short write, then ENOSPC", "write", "/store/live/frames"),
    ("fold", "kill -9", "rename", "/store/observations"),
    ("fold", "kill -9", "unlink", "/store/live/observations"),
    ("fold", "EIO", "fsync", "/store/frames"),
    ("fold", "ENOSPC", "create", "/store/observations"),
    ("day keys", "kill -9", "unlink", "2026-11-10"),  # a hard link of the key stayed for good
    ("day keys", "EIO", "link", "2026-11-09"),
    ("quarantine", "kill -9", "rename", "/quarantine"),  # half a file stayed for good
    ("build", "kill -9", "write", "/facts/coverage"),
    ("build", "kill -9", "unlink", "/facts/coverage"),  # older facts stayed for good
    ("build", "ENOSPC", "create", "/facts/exposure"),
    ("log add", "EIO", "fsync", ""),  # of the folder: the entry was there, and twice when it was added again
    ("log add", "ENOSPC", "write", "log.jsonl"),  # written all the same when the file was closed
    ("first log add", "short write, then ENOSPC", "write", "log.jsonl"),  # half an entry stayed
    ("counts add", "kill -9", "rename", "/counts"),
    ("counts add", "EIO", "fsync", "/counts"),
    ("counts add", "ENOSPC", "write", "/counts"),
    ("counts add", "short write, then ENOSPC", "write", "/counts"),
    ("first counts add", "kill -9", "fsync", "/counts"),
    ("first counts add", "ENOSPC that stays", "rename", "/counts"),
    ("counts remove", "kill -9", "fsync", "/counts"),  # the same command again said that there are no counts
    ("counts remove", "EIO", "unlink", "/counts"),
    ("report", "kill -9", "write", "/facts/weeks"),  # superseded files stayed for good
    ("report", "kill -9", "unlink", "/facts/weeks"),
    ("report", "ENOSPC that stays", "create", "/facts/weeks"),
    ("planner", "kill -9", "rename", "/operator"),  # a temporary file stayed for good
    ("purge by camera", "kill -9", "rename", "/store/observations"),  # a glob showed records twice
]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Unharmed]:
    """Return a function from a job's name to its undisturbed run; skips where calls cannot be counted."""
    if (reason := why_not()) is not None:
        pytest.skip(reason)
    known: dict[str, Unharmed] = {}

    def find(name: str) -> Unharmed:
        if name not in known:
            known[name] = unharmed(JOBS[name], tmp_path_factory.mktemp("job"))
        return known[name]

    return find


@pytest.mark.parametrize(("name", "fault", "kind", "text"), POINTS)
def test_a_job_stopped_or_refused_at_a_call_and_run_again_ends_as_if_nothing_had_happened(
    undisturbed: Callable[[str], Unharmed], tmp_path: Path, name: str, fault: str, kind: str, text: str
) -> None:
    given = undisturbed(name)
    assert given.wrong == ()
    point = [p for p in given.points if p.kind == kind and text in p.path][-1]
    assert disturb(JOBS[name], given, point, FAULTS[fault], folder=tmp_path / "disturbed") == []


def test_counts_are_on_the_disk_before_their_name_and_the_name_before_they_are_acknowledged(
    undisturbed: Callable[[str], Unharmed],
) -> None:
    kinds = [p.kind for p in undisturbed("counts add").points if p.path.startswith("/counts")]
    assert [kind for kind in kinds if kind not in ("write", "unlink")] == ["create", "fsync", "rename", "fsync"]
    kinds = [p.kind for p in undisturbed("counts remove").points if p.path.startswith("/counts")]
    assert kinds == ["unlink", "fsync"]


def test_counts_of_a_stopped_command_are_acknowledged_only_once_their_name_is_on_the_disk(
    undisturbed: Callable[[str], Unharmed], tmp_path: Path
) -> None:
    given = undisturbed("counts add")
    point = [p for p in given.points if p.kind == "fsync" and p.path.startswith("/counts")][-1]
    root = Path(shutil.copytree(given.before.parent, tmp_path / "stopped")) / "project"
    assert run(JOBS["counts add"].act, root, point=point, fault=FAULTS["kill -9"]).status == "killed"
    again = run(JOBS["counts add"].act, root)
    assert [p.kind for p in again.points if p.path.startswith("/counts")] == ["fsync"]


def test_facts_that_somebody_reads_stay_until_nobody_does(tmp_path: Path) -> None:
    root = tmp_path / "project"
    write_project(root)
    given = tmp_path / "given"
    vsd(root, "ingest", str(given / "first.jsonl"))
    day = date(2026, 11, 9)
    with Warehouse(load_site(root, environ={}), day, day) as warehouse:
        before = warehouse.rows("select count(*) as n from pairs")
        old = set((root / "facts").rglob("*.parquet"))
        (given / "late.jsonl").write_text("\n".join(messages(START.replace(minute=0), 5)))
        vsd(root, "ingest", str(given / "late.jsonl"))
        vsd(root, "build")
        assert old < set((root / "facts").rglob("*.parquet"))
        assert warehouse.rows("select count(*) as n from pairs") == before
    vsd(root, "build")
    hours = [(p.parent, p.name[:2]) for p in (root / "facts").rglob("*.parquet")]
    assert len(hours) == len(set(hours))
