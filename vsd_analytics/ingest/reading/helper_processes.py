"""Work on the parts of a large file in several processes at once, with the results in the order of the parts."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, Generic, TypeVar

Part = TypeVar("Part")
Result = TypeVar("Result")

LARGE_BYTES = 32_000_000
"""Files from this size on are read by several processes."""
HELPERS_MAX = 3
"""Checking and storing records takes one process as long as three take to decode them."""
_WAITING = 2
"""Parts given to a helper at once, so that it need not wait for the next one."""
_AHEAD = 2
"""Results for each process that may wait for an earlier one: they bound the memory."""
_WRITTEN_MOST = 2**30
_PR_SET_PDEATHSIG = 1


def n_helpers(n_bytes: int) -> int:
    """Return how many processes shall help to read a file of so many bytes.

    None where the file is small, where there is one core, or where this process cannot be copied safely: with threads,
    a copy may have a lock that nobody releases, and only Linux ends the helpers of a process that was killed.
    """
    if n_bytes < LARGE_BYTES or sys.platform != "linux" or threading.active_count() > 1:
        return 0
    return min(len(os.sched_getaffinity(0)) - 1, HELPERS_MAX)


def in_order(work: Callable[[Part], Result], parts: Iterator[Part], *, n_helpers: int) -> Iterator[Result]:
    """Yield `work(part)` of each part in order.

    Helpers are copies of this process. While the next result is not there, this process works on a part, too. It also
    does the parts of helpers that were killed or could not be started.

    Args:
        work: A function of the part alone, which can be pickled, as can parts and results.
        parts: Read only as far as needed. What comes before an error of theirs is yielded before it is raised.
        n_helpers: How many processes help; 0 = none.
    """
    if n_helpers == 0:
        yield from map(work, parts)
        return
    with contextlib.ExitStack() as at_end:
        free = [_Memory() for _ in range(_AHEAD * (n_helpers + 1))]
        for memory in free:
            at_end.callback(memory.close)
        copies = multiprocessing.get_context("fork")
        pool = ProcessPoolExecutor(n_helpers, mp_context=copies, initializer=_end_with, initargs=(os.getpid(),))
        at_end.callback(pool.shutdown, wait=True, cancel_futures=True)
        unread, row = _UntilError(parts), deque[_Given[Part, Result]]()
        most = len(free)
        while True:
            n_waiting = sum(not given.is_done() for given in row)
            while free and n_waiting < _WAITING * n_helpers and (part := next(unread, None)) is not None:
                row.append(_given(pool, work, part, free.pop()))
                n_waiting += 1
            if not row:
                break
            while not row[0].is_done() and len(row) < most and (part := next(unread, None)) is not None:
                row.append(_Given(part, own=work(part)))
            first = row.popleft()
            result = first.result(work)
            if first.memory is not None:
                free.append(first.memory)
            yield result
        if unread.error is not None:
            raise unread.error


class _UntilError(Iterator[Part]):
    """The parts up to an error, which is noted."""

    def __init__(self, parts: Iterator[Part]) -> None:
        self._parts = parts
        self.error: Exception | None = None

    def __next__(self) -> Part:
        try:
            return next(self._parts)
        except StopIteration:
            raise
        except Exception as error:
            self.error = error
            raise StopIteration from None


class _Memory:
    """Memory that this process shares with its helpers: through a pipe a part would go in hundreds of pieces."""

    def __init__(self) -> None:
        self._file = os.memfd_create("vsd")

    def put(self, value: Any) -> list[int]:
        """Write a value, and return the lengths of its pieces."""
        pieces: list[memoryview] = []
        text = pickle.dumps(value, protocol=5, buffer_callback=lambda piece: pieces.append(piece.raw()))
        pieces.insert(0, memoryview(text))
        at = 0
        for piece in pieces:
            for first in range(0, len(piece), _WRITTEN_MOST):
                at += os.pwrite(self._file, piece[first : first + _WRITTEN_MOST], at)
        return [len(piece) for piece in pieces]

    def take(self, lengths: Sequence[int]) -> Any:
        """Return the value that `put` wrote."""
        whole = memoryview(os.pread(self._file, sum(lengths), 0))
        starts = accumulate(lengths, initial=0)
        text, *pieces = [whole[start : start + length] for start, length in zip(starts, lengths, strict=False)]
        return pickle.loads(text, buffers=pieces)

    def close(self) -> None:
        """Release it; it is gone with the last process that has it."""
        os.close(self._file)


@dataclass(slots=True)
class _Given(Generic[Part, Result]):
    """A part that a helper works on (`memory`, `lengths` of the result), or that is done (`own`)."""

    part: Part
    memory: _Memory | None = None
    lengths: Future[list[int]] | None = None
    own: Result | None = None

    def is_done(self) -> bool:
        return self.lengths is None or self.lengths.done()

    def result(self, work: Callable[[Part], Result]) -> Result:
        """Return the result; this process works it out where a helper was killed or could not be started."""
        if self.memory is None or self.lengths is None:
            return work(self.part) if self.own is None else self.own
        try:
            result: Result = self.memory.take(self.lengths.result())
        except BrokenProcessPool:
            return work(self.part)
        return result


def _given(
    pool: ProcessPoolExecutor, work: Callable[[Part], Result], part: Part, memory: _Memory
) -> _Given[Part, Result]:
    try:
        return _Given(part, memory, pool.submit(_help, memory, memory.put((work, part))))
    except (BrokenProcessPool, OSError):  # the system may allow no more processes
        return _Given(part, memory)


def _help(memory: _Memory, lengths: Sequence[int]) -> list[int]:
    """Take work and a part of it from a shared memory, and put the result there."""
    work, part = memory.take(lengths)
    return memory.put(work(part))


def _end_with(parent: int) -> None:
    """Let a helper end when its parent is killed, and leave Ctrl-C to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # killed before
        os._exit(1)
