"""When to store, when to fold, when to try again, and which sequence numbers are missing: listening without I/O."""

from __future__ import annotations

import random
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

GRACE_S = 60.0
"""A fold by the clock waits this long after the hour, for its last messages."""
FOLD_SEGMENTS = 2000
"""Files in the spool after which a fold does not wait for the hour."""
FOLD_ROWS = 1_000_000
"""Rows in the spool after which a fold does not wait for the hour."""

APART_MIN = 20
"""After so many messages in a row outside the limits of time, this machine's clock may be the wrong one."""

HELD_MAX_BYTES = 16 << 20

FRAMES = "frames"
"""Path of VSD frame messages by HTTP; any other path is the id of a `[[source]]`."""
TOPIC = "POST /"
"""Front of the topic that a posted message has in quarantine and logs."""
RESTARTED = 10_000
RANGES_MAX = 1000


@dataclass(frozen=True, slots=True)
class ReceivedMessage:
    """One message as the broker delivered it.

    Attributes:
        topic: Topic it was published to.
        payload: Its bytes; of a message that is too long only the beginning.
        n_bytes: Length of the whole payload.
        mid: Packet id to acknowledge it by, valid within its connection only.
        qos: Quality of service it came with; 0 = it may get lost on the way.
        epoch: Number of the connection it came by.
        is_retained: A stored copy that the broker sent because of the subscription.
        is_redelivered: The broker has sent it before.
    """

    topic: str
    payload: bytes
    n_bytes: int
    mid: int = 0
    qos: int = 1
    epoch: int = 0
    is_retained: bool = False
    is_redelivered: bool = False


def is_due(n_held: int, *, n_bytes: int, age_s: float, window: int, linger_s: float) -> bool:
    """Return whether the messages held should be stored now.

    Args:
        n_held: Messages held.
        n_bytes: Bytes held.
        age_s: Seconds since the first of them arrived.
        window: Messages the broker sends without an acknowledgement. At half of it the batch is stored, so that the
            broker fills the other half meanwhile.
        linger_s: How long a message waits for others, which makes files fewer when little happens.
    """
    return n_held > 0 and (n_held >= max(1, window // 2) or n_bytes >= HELD_MAX_BYTES or age_s >= linger_s)


def next_fold_s(after_s: float, *, every_s: float) -> float:
    """Return the first instant after `after_s` (UNIX seconds) that is `GRACE_S` past a multiple of `every_s`.

    With 3600 s that is a minute past each full hour: soon after the hour is complete.
    """
    grace_s = min(GRACE_S, every_s / 2)
    return (int((after_s - grace_s) // every_s) + 1) * every_s + grace_s


def delays_s(*, first_s: float = 0.5, most_s: float = 30.0, seed: int = 0) -> Iterator[float]:
    """Yield waiting times that double from `first_s` to `most_s`, each shortened at random by up to a half.

    The shortening (jitter) keeps many listeners from connecting to a restarted broker at once.

    Args:
        first_s: The first, before shortening.
        most_s: The longest.
        seed: Seed of the random numbers; the same seed gives the same times.
    """
    chance = random.Random(seed)
    delay_s = first_s
    while True:
        yield delay_s * (1 - chance.random() / 2)
        delay_s = min(most_s, delay_s * 2)


@dataclass
class ClockAgreement:
    """Counts messages whose times disagree with the machine's clock.

    Attributes:
        n_apart: Messages outside the limits of time since the last one within.
    """

    n_apart: int = 0

    @property
    def is_lost(self) -> bool:
        """Return whether at least `APART_MIN` messages in a row disagree with the clock."""
        return self.n_apart >= APART_MIN

    def see(self, *, n_within: int, n_outside: int) -> None:
        """Count the messages of one batch; a single one that agrees is enough to trust the clock."""
        self.n_apart = 0 if n_within else self.n_apart + n_outside


@dataclass
class Numbering:
    """Sequence numbers of one camera: which were skipped, in bounded memory.

    Numbers may come again or in another order. A number more than `RESTARTED` below the highest means that the engine
    started again. Beyond `RANGES_MAX` separate gaps the oldest ones are forgotten and stay missing.

    Attributes:
        highest: Highest number seen since the engine started; None = none yet.
        n_missing: Numbers skipped that have not come since.
    """

    highest: int | None = None
    n_missing: int = 0
    _ranges: list[tuple[int, int]] = field(default_factory=list)  # open gaps, first and last, ascending

    def see(self, seq: int) -> None:
        """Note one number."""
        if self.highest is None or seq < self.highest - RESTARTED:
            self.highest = seq
            self._ranges.clear()
        elif seq > self.highest:
            if seq > self.highest + 1:
                self._ranges.append((self.highest + 1, seq - 1))
                self.n_missing += seq - self.highest - 1
                del self._ranges[:-RANGES_MAX]
            self.highest = seq
        else:
            self._fill(seq)

    def see_all(self, numbers: Sequence[int | None]) -> None:
        """Note several numbers; None is a message without one."""
        for seq in numbers:
            if seq is not None:
                self.see(seq)

    def _fill(self, seq: int) -> None:
        i = bisect_right(self._ranges, (seq, 2**63)) - 1
        if i < 0 or not self._ranges[i][0] <= seq <= self._ranges[i][1]:
            return  # seen before, or a gap already forgotten
        first, last = self._ranges[i]
        self._ranges[i : i + 1] = [r for r in ((first, seq - 1), (seq + 1, last)) if r[0] <= r[1]]
        del self._ranges[:-RANGES_MAX]
        self.n_missing -= 1
