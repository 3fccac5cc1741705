"""What `refuse.c` does to a process: calls it counts, and calls it stops, refuses or shortens."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import pytest
from crash_points import FAULTS, Ack, Run, run, why_not

DATA = b"12345678"


@pytest.fixture(scope="module", autouse=True)
def _counting_is_possible() -> None:
    if (reason := why_not()) is not None:
        pytest.skip(reason)


def write_twice(folder: Path, ack: Ack) -> list[int]:
    """Write a file by two calls; return how many bytes each took, or the error number."""
    taken = []
    fd = os.open(folder / "file", os.O_WRONLY | os.O_CREAT, 0o600)
    for _ in range(2):
        try:
            taken.append(os.write(fd, DATA))
        except OSError as error:
            taken.append(-(error.errno or 0))
    os.close(fd)
    ack("closed")
    try:
        (folder / "file").unlink()
    except OSError as error:
        taken.append(-(error.errno or 0))
    return taken


def sync_again(folder: Path, ack: Ack) -> None:
    fd = os.open(folder, os.O_RDONLY)
    for _ in range(2):
        try:
            os.fsync(fd)
        except OSError:
            continue
    os.close(fd)


def disturbed(folder: Path, fault: str, *, kind: str = "write") -> Run:
    [point] = [p for p in run(write_twice, folder).points if (p.kind, p.turn) == (kind, 1)]
    return run(write_twice, folder, point=point, fault=FAULTS[fault])


def test_strace_counts_the_same_calls(tmp_path: Path) -> None:
    done = run(write_twice, tmp_path, is_traced=True)
    assert Counter(p.kind for p in done.points) == done.n_traced == {"create": 1, "write": 2, "unlink": 1}


def test_a_short_write_reaches_the_file_by_half(tmp_path: Path) -> None:
    assert disturbed(tmp_path, "short write").told == [4, 8]


def test_a_short_write_can_be_followed_by_a_refused_one(tmp_path: Path) -> None:
    assert disturbed(tmp_path, "short write, then ENOSPC").told == [4, -28]


def test_one_call_is_refused_or_all_from_there_on(tmp_path: Path) -> None:
    assert disturbed(tmp_path, "EIO").told == [-5, 8]
    assert disturbed(tmp_path, "EDQUOT").told == [-122, 8]
    assert disturbed(tmp_path, "ENOSPC that stays").told == [-28, -28, -28]


def test_a_killed_process_has_not_made_the_call(tmp_path: Path) -> None:
    done = disturbed(tmp_path, "kill -9", kind="unlink")
    assert (done.status, done.acked, (tmp_path / "file").read_bytes()) == ("killed", ["closed"], 2 * DATA)


def test_a_sync_tried_again_on_the_same_open_file_is_reported(tmp_path: Path) -> None:
    [first, _] = run(sync_again, tmp_path).points
    assert run(sync_again, tmp_path, point=first, fault=FAULTS["EIO"]).retried == [""]
