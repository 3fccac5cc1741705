"""A large file that several processes read gives the same batches, in the same order, whatever happens to a helper."""

from __future__ import annotations

import gzip
import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from raw_reading import Reading, read

from vsd_analytics.cli.output import progress
from vsd_analytics.errors import InputError
from vsd_analytics.ingest.formats import frames
from vsd_analytics.ingest.formats.frames import Frames
from vsd_analytics.ingest.reading import helper_processes
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch
from vsd_analytics.ingest.reading.helper_processes import LARGE_BYTES, in_order, n_helpers
from vsd_analytics.ingest.reading.reasons import TOO_MANY

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="helpers are copies of the process on Linux alone")

TEST = os.getpid()
Block = tuple[int, bytes | None, int]
Work = Callable[[Block], list[RawBatch]]


def squared(number: int) -> tuple[int, bytes]:
    """Return a square, and bytes that take long enough to come out of order."""
    time.sleep(0.002 if number % 3 == 0 else 0)
    return number * number, bytes(number % 7)


@settings(max_examples=15, deadline=None)
@given(numbers=st.lists(st.integers(0, 99), max_size=40), n=st.integers(1, 3))
def test_results_come_in_the_order_of_the_parts(numbers: list[int], n: int) -> None:
    assert list(in_order(squared, iter(numbers), n_helpers=n)) == [squared(k) for k in numbers]


def test_helpers_do_a_share_of_the_work() -> None:
    assert len(set(in_order(pid_of, iter(range(20)), n_helpers=2)) - {os.getpid()}) == 2


def pid_of(_part: int) -> int:
    time.sleep(0.01)
    return os.getpid()


def damaged_after_nine() -> Iterator[int]:
    yield from range(9)
    raise InputError("damaged", code="E205")


def test_what_comes_before_damage_comes_before_its_error() -> None:
    results = in_order(squared, damaged_after_nine(), n_helpers=2)
    assert [next(results) for _ in range(9)] == [squared(k) for k in range(9)]
    with pytest.raises(InputError, match="damaged"):
        next(results)


def wrong_at_five(number: int) -> int:
    if number == 5:
        raise ValueError("five")
    return number


def test_an_error_of_the_work_comes_in_its_place() -> None:
    results = in_order(wrong_at_five, iter(range(9)), n_helpers=1)
    assert [next(results) for _ in range(5)] == list(range(5))
    with pytest.raises(ValueError, match="five"):
        list(results)


def deadly(number: int) -> int:
    time.sleep(0.005)
    if number in {3, 11} and os.getpid() != TEST:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.parametrize("n", [1, 2])
def test_the_parts_of_a_killed_helper_are_done_here(n: int) -> None:
    assert list(in_order(deadly, iter(range(20)), n_helpers=n)) == list(range(20))


def test_without_more_processes_all_parts_are_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> int:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(os, "fork", refuse)
    assert set(in_order(pid_of, iter(range(9)), n_helpers=2)) == {os.getpid()}


def test_who_stops_early_leaves_no_helper() -> None:
    results = in_order(squared, iter(range(1000)), n_helpers=2)
    assert next(results) == squared(0)
    results.close()  # type: ignore[attr-defined]
    assert multiprocessing.active_children() == []


KILLED = """
import os, signal, sys, time
sys.path.insert(0, {folder!r})
from test_helper_processes import pid_of
from vsd_analytics.ingest.reading.helper_processes import in_order
found = set()
for pid in in_order(pid_of, iter(range(10**6)), n_helpers=2):
    found.add(pid)
    if len(found) == 3:
        print(*(found - {{os.getpid()}}), flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_helpers_end_with_their_parent(tmp_path: Path) -> None:
    code = KILLED.format(folder=str(Path(__file__).parent))
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    helpers = [int(pid) for pid in ended.stdout.split()]
    assert (ended.returncode, len(helpers)) == (-signal.SIGKILL, 2), ended.stderr
    until = time.monotonic() + 20
    while any(is_running(pid) for pid in helpers):
        assert time.monotonic() < until, "a helper runs on"
        time.sleep(0.05)


def is_running(pid: int) -> bool:
    """Return whether a process runs; one that has ended may wait for its parent."""
    try:
        return "zombie" not in Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def lines(n: int) -> bytes:
    """Return messages of several cameras, one in ten wrong, odd, crowded or too long."""
    draw = random.Random(4)
    found = []
    for k in range(n):
        people = [{"id": f"t{k % 7}-{i}", "x_m": draw.random(), "y_m": i} for i in range(draw.randrange(5))]
        at = f"2026-11-09T09:{k // 60 % 60:02}:{k % 60:02}"
        message = {"v": 1, "camera": f"cam-{k % 3}", "ts": f"{at}Z"}
        odd = {
            1: message | {"persons": people, "colour": "red"},
            2: message | {"persons": people * 50},
            3: message | {"ts": at, "persons": people},
            4: message | {"pairs": [{"a": 1, "b": 2, "distance_m": 1.2}], "engine": f"acme {k % 2}"},
            5: "x" * 30_000,
            6: [],
        }.get(draw.randrange(60), message | {"persons": people})
        found.append(json.dumps(odd).encode() + draw.choice([b"\n", b"\n", b"\r\n", b"\n\n"]))
    return b"".join(found)


def everything_of(reading: Reading) -> list[object]:
    return [
        [(b.tables, b.rejected, b.n_dropped, b.notes, b.done_bytes, b.engines, b.first_line) for b in reading.batches],
        str(reading.error),
    ]


@pytest.mark.parametrize("kind", ["plain", "packed", "damaged", "without an end", "nothing"])
def test_a_file_gives_the_same_batches_with_helpers_and_without(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = b"\n\n" if kind == "nothing" else lines(4_000)
    packed = gzip.compress(text)
    path = tmp_path / "a.jsonl"
    path.write_bytes(
        {"packed": packed, "damaged": packed[: len(packed) // 2], "without an end": text.rstrip()}.get(kind, text)
    )
    options = IngestOptions(line_max_bytes=20_000, persons_max=100)
    monkeypatch.setattr(frames, "_BLOCK_BYTES", 20_000)
    found, asked, helped = {}, list[int](), list[int]()

    def spied(work: Work, parts: Iterator[Block], *, n_helpers: int) -> Iterator[list[RawBatch]]:
        helped.append(n_helpers)
        return in_order(work, parts, n_helpers=n_helpers)

    def asked_for(n_bytes: int) -> int:
        asked.append(n_bytes)
        return len(asked) - 1

    monkeypatch.setattr(frames, "in_order", spied)
    monkeypatch.setattr(frames, "n_helpers", asked_for)
    for n in (0, 1, 2):
        found[n] = read(Frames(), path, options)
    assert (asked, helped) == ([path.stat().st_size] * 3, [0, 1, 2])
    assert everything_of(found[0]) == everything_of(found[1]) == everything_of(found[2])
    assert (found[0].error is not None) == (kind == "damaged")
    if kind == "plain":
        assert set(found[0].reasons.values()) >= {"bad-message", TOO_MANY, "line-too-long"}
        assert len(found[0].batches) > 20


def test_no_process_decodes_more_records_at_once_than_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    persons = {"v": 1, "camera": "cam-1", "ts": "2026-11-09T09:00:00Z", "persons": [{}] * 40}
    text = "\n".join(json.dumps(persons) for _ in range(500)) + "\n" + json.dumps(persons | {"persons": [{}] * 300})
    (tmp_path / "a.jsonl").write_text(text)
    most, decoded = 200, list[tuple[int, int, int]]()

    def spied(
        work: Callable[..., object], parts: Iterator[tuple[int, bytes, int]], *, n_helpers: int
    ) -> Iterator[object]:
        for part in parts:
            first, lines, _ = part
            decoded.append((first, lines.count(b"\n") + 1, lines.count(b"{")))
            yield work(part)

    monkeypatch.setattr(frames, "_BLOCK_RECORDS", most)
    monkeypatch.setattr(frames, "in_order", spied)
    found = read(Frames(), tmp_path / "a.jsonl", IngestOptions(persons_max=1_000))
    assert all(n_records <= most or n_lines == 1 for _, n_lines, n_records in decoded)
    assert [first for first, _, _ in decoded] == [1 + sum(n for _, n, _ in decoded[:k]) for k in range(len(decoded))]
    assert found.column("line", "frames") == list(range(1, 502))
    assert len(found.people) == 500 * 40 + 300


def test_small_files_and_processes_with_threads_have_no_helpers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(2)))
    assert (n_helpers(LARGE_BYTES - 1), n_helpers(LARGE_BYTES)) == (0, 1)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)))
    assert n_helpers(LARGE_BYTES) == helper_processes.HELPERS_MAX
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    assert n_helpers(LARGE_BYTES) == 0
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)))
    monkeypatch.setattr(threading, "active_count", lambda: 2)
    assert n_helpers(LARGE_BYTES) == 0


def test_a_progress_bar_starts_no_thread() -> None:
    before = threading.active_count()
    with progress(None, total=10, label="reading", unit="B", quiet=False):
        assert threading.active_count() == before
