"""Messages that wait to be stored, and for whom: whoever offers them learns when they are durable."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from vsd_analytics.ingest.reading.adapter import Rejected
from vsd_analytics.live.batches import HELD_MAX_BYTES, ReceivedMessage

MESSAGES_MAX: Final = 1000
LINGER_S: Final = 0.1


@dataclass(slots=True)
class OfferedMessages:
    """Messages of one sender, and the answer once they are stored.

    Attributes:
        messages: In the order they were sent.
        n_bytes: Their size.
        bad: Rejected records, by number of the message; None until the messages are durable.
        tell: Called, in the thread that stores, when `bad` is set or nothing is taken any more.
    """

    messages: Sequence[ReceivedMessage]
    n_bytes: int
    bad: Sequence[tuple[int, Rejected]] | None = None
    tell: Callable[[], None] = lambda: None


class MessageDoor(Protocol):
    """Where messages come in, beside the broker; the listener stores them."""

    name: str
    """What quarantine calls it."""

    def wait(self, timeout_s: float, *, not_before_s: float = 0.0) -> None:
        """Wait until messages should be stored, as `MessageQueue.wait`."""

    def due_in_s(self) -> float | None:
        """Return in how many seconds what waits should be stored; None = nothing waits."""

    def take(self) -> list[OfferedMessages]:
        """Return what waits, in its order; it waits until `settle`."""

    def settle(self, offered: Sequence[OfferedMessages], bad: Mapping[int, Sequence[Rejected]]) -> None:
        """Note that messages are durable, as `MessageQueue.settle`."""

    def close(self) -> None:
        """Take nothing more."""


class MessageQueue:
    """A bounded queue between those who offer messages and the one who stores them."""

    def __init__(self, *, linger_s: float = LINGER_S) -> None:
        self._waiting: list[OfferedMessages] = []
        self._linger_s = linger_s
        self._n_messages = self._n_bytes = 0
        self._first_s = 0.0
        self._changed = threading.Condition()
        self._is_closed = False

    def put(self, offered: OfferedMessages) -> bool:
        """Queue messages; return False when too much waits, or the listener stops."""
        with self._changed:
            n, n_bytes = self._n_messages + len(offered.messages), self._n_bytes + offered.n_bytes
            if self._is_closed or (self._waiting and (n > MESSAGES_MAX or n_bytes > 2 * HELD_MAX_BYTES)):
                return False
            if not self._waiting:
                self._first_s = time.monotonic()
            self._waiting.append(offered)
            self._n_messages, self._n_bytes = n, n_bytes
            self._changed.notify_all()
            return True

    def wait(self, timeout_s: float, *, not_before_s: float = 0.0) -> None:
        """Wait until messages should be stored.

        Args:
            timeout_s: Longest wait.
            not_before_s: Monotonic instant before which nothing can be stored.
        """
        with self._changed:
            if not self._waiting:
                self._changed.wait(timeout_s)
        due_s = self.due_in_s()
        if due_s is not None:
            time.sleep(min(timeout_s, max(due_s, not_before_s - time.monotonic())))

    def due_in_s(self) -> float | None:
        """Return in how many seconds what waits should be stored; None = nothing waits."""
        with self._changed:
            if not self._waiting:
                return None
            return max(0.0, self._first_s + self._linger_s - time.monotonic())

    def take(self) -> list[OfferedMessages]:
        """Return what waits, in its order; it waits until `settle`."""
        with self._changed:
            return list(self._waiting)

    def settle(self, offered: Sequence[OfferedMessages], bad: Mapping[int, Sequence[Rejected]]) -> None:
        """Answer those whose messages are durable.

        Args:
            offered: The first of those that wait.
            bad: Rejected records by number of the message, over all of them.
        """
        at = 0
        for one in offered:
            one.bad = [(i, r) for i in range(len(one.messages)) for r in bad.get(at + i, ())]
            at += len(one.messages)
            one.tell()
        with self._changed:
            del self._waiting[: len(offered)]
            self._n_messages -= at
            self._n_bytes -= sum(one.n_bytes for one in offered)
            self._first_s = time.monotonic()

    def close(self) -> None:
        """Take nothing more, and tell those that wait that they are not stored."""
        with self._changed:
            self._is_closed = True
            waiting, self._waiting = self._waiting, []
        for one in waiting:
            one.tell()
