"""Handing on and receiving around the clock: one round after the other, and a status for `vsd doctor`.

A link that is away, a server that does not answer and a full disk are no reason to stop: the next round tries again.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

from vsd_analytics.errors import VsdError
from vsd_analytics.live import status
from vsd_analytics.live.batches import delays_s
from vsd_analytics.live.status import iso_utc, read_json

STATUS = Path("status") / "exchange.json"
WORKING, STOPPED, REFUSED, ONCE = "working", "stopped", "refused", "once"


def keep_on(
    root: Path,
    one_round: Callable[[], dict[str, Any]],
    *,
    every_s: float,
    clock: Callable[[], datetime],
    sleep: Callable[[float], object],
    stop: Callable[[], bool],
    report: Callable[[str], None],
) -> None:
    """Do one round after the other until `stop`, and write `status/exchange.json` after each.

    Args:
        root: The project.
        one_round: Does one and returns what the status says of it.
        every_s: Seconds from the end of a round to the next; after an error they grow from one to it, at most.
        clock: The clock, for the status.
        sleep: Waits for so many seconds; may return sooner when `stop` has become true.
        stop: Called between rounds.
        report: Called with a line for people when something goes wrong, and when it is right again.
    """
    told: str | None = None
    last_round: dict[str, Any] = {}
    delays = delays_s(first_s=min(1.0, every_s), most_s=every_s)
    while not stop():
        try:
            last_round = one_round()
            error = None
        except (VsdError, OSError) as caught:
            error = _words(caught)
        if error != told:
            report("the exchange works again" if error is None else f"{error}; it is tried again")
            told = error
        write_status(root, last_round, state=WORKING if error is None else REFUSED, error=error, now=clock())
        if error is None:
            delays = delays_s(first_s=min(1.0, every_s), most_s=every_s)
        if not stop():
            sleep(every_s if error is None else next(delays))
    write_status(root, last_round, state=STOPPED, error=told, now=clock())


def write_status(root: Path, last_round: dict[str, Any], *, state: str, error: str | None, now: datetime) -> None:
    """Write what a round found."""
    about = {"state": state, "pid": os.getpid(), "at": iso_utc(now), "error": error, **last_round}
    status.write_status(root, about, file=STATUS)


def read_exchange_status(root: Path) -> dict[str, Any] | None:
    """Return the status; None where nothing was handed on or received yet."""
    return read_json(root / STATUS)


def _words(error: VsdError | OSError) -> str:
    if not isinstance(error, VsdError):
        return error.strerror or str(error)
    return error.what + (f": {error.why}" if error.why else "") + (f" ({error.where.file})" if error.where else "")
