"""Putting bad records into quarantine, with source, line and reason, so that people can look at them and replay them.

`vsd_analytics.store.quarantine` has their files. Records of a file beyond `stored_max` are only counted, because the
file can be read again. A broker forgets a message once it is acknowledged, so a live quarantine stores all or refuses.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from vsd_analytics.errors import StoreError
from vsd_analytics.ingest.reading.adapter import IngestOptions, Rejected
from vsd_analytics.store.quarantine import QuarantineEntry, entries, files, write

STORED_PER_SOURCE = 100_000
CHUNK = 10_000
CHUNK_BYTES = 16 << 20
_ENTRY_BYTES = 300
_OF_THE_SITE = frozenset(
    {
        "format",
        "site_map",
        "camera_from_name",
        "frame_zone",
        "clocks",
        "pictures",
        "line_max_bytes",
        "persons_max",
        "pairs_max",
        "staff_classes",
        "is_sure",
    }
)
_DEFAULTS = IngestOptions()


@dataclass(frozen=True, slots=True)
class SourceReading:
    """How records of a source were read, so that single ones can be read again.

    Attributes:
        format: Name of the adapter.
        options: What the user says.
        first_line: See `RawBatch.first_line`; None = single lines cannot be read again.
        engines: Engine names and versions.
        import_id: The import of the source; "" = none, such as a broker.
    """

    format: str
    options: IngestOptions = _DEFAULTS
    first_line: str | None = None
    engines: Sequence[str] = ()
    import_id: str = ""

    @property
    def user_options(self) -> dict[str, Any]:
        """Return the options that differ from their defaults and do not come from vsd.toml."""
        names = [f.name for f in dataclasses.fields(IngestOptions) if f.name not in _OF_THE_SITE]
        values = {n: getattr(self.options, n) for n in names}
        return {n: v for n, v in values.items() if v != getattr(_DEFAULTS, n)}


class Quarantine:
    """The quarantine of one source.

    Args:
        folder: `<project>/quarantine`; None = count only, write nothing.
        source: Name of the source as given.
        at: The clock.
        is_live: The source is a broker.
        stored_max: Most records stored until `close`; more of a file are only counted, more of a broker refused.
    """

    def __init__(
        self,
        folder: Path | None,
        *,
        source: str,
        at: datetime | None = None,
        is_live: bool = False,
        stored_max: int = STORED_PER_SOURCE,
    ) -> None:
        self._folder = folder
        self._source = _encodable(source)
        self._at = at
        self._is_live = is_live
        self._stored_max = stored_max
        self._held: list[QuarantineEntry] = []
        self._held_bytes = 0
        self._n_taken = 0
        self._not_kept: Counter[str] = Counter()
        self._import_id = ""
        self.counts: Counter[str] = Counter()
        self.examples: dict[str, Rejected] = {}

    def add(
        self, rejected: Sequence[Rejected], *, reading: SourceReading | None = None, at: datetime | None = None
    ) -> None:
        """Count and store records; beyond `stored_max`, or without a folder, they are only counted.

        Args:
            rejected: The records.
            reading: How they were read; None = their lines cannot be read again.
            at: The clock, when it has moved since the quarantine was made.

        Raises:
            StoreError: E308, the quarantine of a broker is full until the next `close`; none of the records is taken.
        """
        if self._is_live and rejected and self._n_taken >= self._stored_max:
            raise _full(self._source, self._stored_max)
        for record in rejected:
            self.counts[record.reason] += record.n
            self.examples.setdefault(record.reason, record)
        if self._folder is None:
            return
        self._import_id = self._import_id if reading is None else reading.import_id
        single = [r for r in rejected if r.n == 1]
        n_stored = len(single) if self._is_live else min(len(single), self.room)
        self._n_taken += n_stored
        for record in (*single[n_stored:], *(r for r in rejected if r.n > 1)):
            self._not_kept[record.reason] += record.n
        self._at = at or self._at
        for record in single[:n_stored]:
            entry = entry_of(record, source=self._source, at=self._at, is_live=self._is_live, reading=reading)
            self._held.append(entry)
            self._held_bytes += _ENTRY_BYTES + len(record.whole or "") + len(record.row or "")
            if len(self._held) >= CHUNK or self._held_bytes >= CHUNK_BYTES:
                self.flush()

    @property
    def room(self) -> int:
        """Return how many more records will be stored; 0 without a folder."""
        return 0 if self._folder is None else max(0, self._stored_max - self._n_taken)

    def flush(self) -> None:
        """Write the records held; they are durable when this returns.

        Raises:
            OSError: The disk refused; the records are still held.
        """
        if self._held and self._folder is not None:
            write(self._folder, self._held, is_live=self._is_live)
            self._held.clear()
            self._held_bytes = 0

    def forget(self) -> None:
        """Drop the records held: their source will send them again."""
        self._n_taken -= len(self._held)
        self._held.clear()
        self._held_bytes = 0

    def close(self) -> None:
        """Write the records held, and the number only counted; then up to `stored_max` more can be added."""
        detail = f"counted beyond the {self._stored_max:,} records stored of a source"
        for reason, n in sorted(self._not_kept.items()):
            entry = QuarantineEntry(
                at=None if self._at is None else self._at.astimezone(UTC),
                source=self._source,
                line=0,
                reason=reason,
                detail=detail,
                is_live=self._is_live,
                import_id=self._import_id,
                n_not_kept=n,
            )
            self._held.append(entry)
        self._not_kept.clear()
        self.flush()
        self._n_taken = 0


def _full(source: str, stored_max: int) -> StoreError:
    return StoreError(
        f"the quarantine is full for this day (UTC): {stored_max:,} records of {source}. "
        "See why they are bad: vsd quarantine list; or raise quarantine_day_max under [ingest]",
        code="E308",
    )


def entry_of(
    record: Rejected, *, source: str, at: datetime | None, is_live: bool = False, reading: SourceReading | None = None
) -> QuarantineEntry:
    """Return the quarantine entry of a record; for the arguments see `Quarantine`."""
    shared: dict[str, Any] = {
        "at": None if at is None else at.astimezone(UTC),
        "source": source,
        "line": record.line,
        "reason": record.reason,
        "detail": _encodable(record.detail),
        "is_live": is_live,
        "engines": () if reading is None else tuple(reading.engines),
        "import_id": "" if reading is None else reading.import_id,
    }
    if record.row is not None:
        row = msgspec.json.decode(record.row)
        return QuarantineEntry(**shared, text=_encodable(record.text), table=record.table, row=row)
    if record.whole is None:
        return QuarantineEntry(**shared, text=_encodable(record.text))
    if reading is None or reading.first_line is None:
        return QuarantineEntry(**shared, text=record.whole, is_whole=True)
    how: dict[str, Any] = {
        "format": reading.format,
        "options": reading.user_options,
        "first_line": _encodable(reading.first_line),
    }
    return QuarantineEntry(**shared, **how, text=record.whole, is_whole=True)


@dataclass
class ReasonSummary:
    """The content of the quarantine for one reason.

    Attributes:
        reason: Slug.
        n_stored: Entries.
        n_not_kept: Records that were counted only.
        n_replayable: Entries that can be tried again.
        sources: Records, stored or only counted, by source.
        examples: The first entries.
        first: The first entry, also where no examples are asked for; None = there are only counts.
    """

    reason: str
    n_stored: int = 0
    n_not_kept: int = 0
    n_replayable: int = 0
    sources: Counter[str] = field(default_factory=Counter)
    examples: list[QuarantineEntry] = field(default_factory=list)
    first: QuarantineEntry | None = None


def summarise(
    folder: Path, *, reason: str | None = None, source: str | None = None, n_examples: int = 1
) -> list[ReasonSummary]:
    """Return the content of the quarantine by reason, the most frequent first.

    Args:
        folder: `<project>/quarantine`.
        reason: This one only.
        source: Sources whose name contains this only.
        n_examples: Entries shown of each reason.
    """
    summaries: dict[str, ReasonSummary] = {}
    for path in files(folder):
        for _, entry in entries(path):
            if entry is None or not matches(entry, reason=reason, source=source):
                continue
            summary = summaries.setdefault(entry.reason, ReasonSummary(entry.reason))
            summary.sources[entry.source] += entry.n_not_kept or 1
            summary.n_not_kept += entry.n_not_kept
            if not entry.n_not_kept:
                summary.n_stored += 1
                summary.first = summary.first or entry
                summary.n_replayable += entry.can_be_replayed
                if len(summary.examples) < n_examples:
                    summary.examples.append(entry)
    return sorted(summaries.values(), key=lambda s: (-s.n_stored - s.n_not_kept, s.reason))


def matches(entry: QuarantineEntry, *, reason: str | None, source: str | None) -> bool:
    """Return whether an entry has this `reason`, and `source` in the name of its source; None = any."""
    return reason in (None, entry.reason) and (source is None or source in entry.source)


def _encodable(text: str) -> str:
    """Return `text` without lone surrogates, which UTF-8 has no bytes for."""
    return text.encode("utf-8", "backslashreplace").decode()
