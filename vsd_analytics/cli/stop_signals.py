"""SIGTERM and Ctrl-C as a wish to stop, for commands that run until they are stopped."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def stop_signals(*, is_second_final: bool = False) -> Iterator[threading.Event]:
    """Yield an event that SIGTERM and Ctrl-C set instead of ending the process.

    Args:
        is_second_final: The second of them interrupts the command at once.
    """
    stopped = threading.Event()

    def note(*_: object) -> None:
        if is_second_final and stopped.is_set():
            raise KeyboardInterrupt
        stopped.set()

    before = {s: signal.signal(s, note) for s in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
