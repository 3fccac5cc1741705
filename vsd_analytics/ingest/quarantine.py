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
        folder: `<project>/quarantine`; None = count only, write nothing.
        source: Name of the source as given.
    """

    def __init__(self, folder: Path | None, *, source: str) -> None:
        self._folder = folder
        self._source = source
        self._held: list[Rejected] = []
        self._n_kept = 0
        self.counts: Counter[str] = Counter()
        self.examples: dict[str, Rejected] = {}

    def add(self, rejected: Sequence[Rejected]) -> None:
        """Count and keep records; beyond `KEPT_PER_SOURCE` they are only counted, as are all without a folder."""
        for record in rejected:
            self.counts[record.reason] += 1
            self.examples.setdefault(record.reason, record)
        if self._folder is None:
            return
        room = KEPT_PER_SOURCE - self._n_kept - len(self._held)
        self._held.extend(rejected[: max(0, room)])
        if len(self._held) >= CHUNK:
            self.flush()

    def flush(self) -> None:
        """Write what is held as JSON Lines, named by the hash of its bytes: the same bad file twice is kept once."""
        if not self._held or self._folder is None:
            return
        lines = [
            msgspec.json.encode(
                {
                    "source": self._source,
                    "line": r.line,
                    "reason": r.reason,
                    "detail": _encodable(r.detail),
                    "text": _encodable(r.text),
                }
            )
            for r in self._held
        ]
        data = b"\n".join(lines) + b"\n"
        publish(self._folder / f"{digest(data)}.jsonl", data)
        self._n_kept += len(self._held)
        self._held.clear()


def _encodable(text: str) -> str:
    """Return `text` without lone surrogates, which UTF-8 has no bytes for."""
    return text.encode("utf-8", "backslashreplace").decode()
