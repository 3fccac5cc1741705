"""Bad records are kept with source, line and reason, so that they can be looked at and replayed, and are counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import msgspec

from vsd_analytics.ingest.adapter import Rejected
from vsd_analytics.store.durable import digest, publish

KEPT_PER_SOURCE = 100_000
CHUNK = 10_000


class Quarantine:
    """The quarantine of one source.

    Args:
        folder: `<project>/quarantine`.
        source: Name of the source as given.
    """

    def __init__(self, folder: Path, *, source: str) -> None:
        self._folder = folder
        self._source = source
        self._held: list[Rejected] = []
        self._n_kept = 0
        self.counts: Counter[str] = Counter()
        self.examples: dict[str, Rejected] = {}

    def add(self, rejected: Sequence[Rejected]) -> None:
        """Count and keep records; beyond `KEPT_PER_SOURCE` they are only counted."""
        for record in rejected:
            self.counts[record.reason] += 1
            self.examples.setdefault(record.reason, record)
        room = KEPT_PER_SOURCE - self._n_kept - len(self._held)
        self._held.extend(rejected[: max(0, room)])
        if len(self._held) >= CHUNK:
            self.flush()

    def flush(self) -> None:
        """Write what is held as JSON Lines, named by the hash of its bytes: the same bad file twice is kept once."""
        if not self._held:
            return
        lines = [
            msgspec.json.encode(
                {"source": self._source, "line": r.line, "reason": r.reason, "detail": r.detail, "text": r.text}
            )
            for r in self._held
        ]
        data = b"\n".join(lines) + b"\n"
        publish(self._folder / f"{digest(data)}.jsonl", data)
        self._n_kept += len(self._held)
        self._held.clear()
