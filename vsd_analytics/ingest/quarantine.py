"""Bad records are kept with source, line and reason, so that they can be looked at and replayed, and are counted.

The quarantine is a folder of JSON Lines files, one entry a line, each file named by the hash of its entries without the
instant they came at: the same bad file ingested twice is kept once, with the instant of the first time. (Entries of
live sources keep their instant in the hash: two equal messages are two.) Nothing but `rewrite` and `tidy` ever removes
a file. Track ids stand here as the engine sent them: folder 0700, files 0600.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from vsd_analytics.ingest.adapter import IngestOptions, Rejected
from vsd_analytics.schema import TableName
from vsd_analytics.store.durable import digest, exclusive, fsync_dir, make_dirs, publish, remove, sweep_temporaries

KEPT_PER_SOURCE = 100_000
CHUNK = 10_000
CHUNK_BYTES = 16 << 20
SMALL_BYTES = 1 << 20
"""Files of live sources below this are put together by `tidy`."""

_ENTRY_BYTES = 300
_OF_THE_SITE = frozenset({"format", "site_map", "frame_zone", "clocks", "line_max_bytes"})
_DEFAULTS = IngestOptions()


class Entry(msgspec.Struct, frozen=True, omit_defaults=True, kw_only=True):
    """One entry of the quarantine.

    Attributes:
        at: Instant it was quarantined at (UTC).
        source: Name of the source as given.
        line: 1-based line or record number in the source.
        reason: Slug; `vsd_analytics.ingest.reasons` says what to do.
        detail: One sentence for people.
        text: The record as it stood: its whole line if `is_whole`, else an excerpt.
        is_live: It came from a broker; its time is held against `at`.
        is_whole: `text` is the whole line.
        format: Adapter that can read `text` again; None = none can.
        options: What the user said about the source, as fields of `IngestOptions` that are not at their defaults.
        first_line: Line that has to stand above `text` for it to be read: the header of a table; "" = none.
        table: Raw table `row` is of.
        row: Raw row in the columns of `RAW_SCHEMAS` without `line`, which can be checked again as it is.
        engines: Engine names and versions.
        n_not_kept: Above 0 the entry is no record: so many of this reason were counted beyond what is kept of a source.
    """

    at: datetime | None = None
    source: str
    line: int
    reason: str
    detail: str = ""
    text: str = ""
    is_live: bool = False
    is_whole: bool = False
    format: str | None = None
    options: dict[str, Any] = {}
    first_line: str = ""
    table: TableName | None = None
    row: dict[str, Any] | None = None
    engines: tuple[str, ...] = ()
    n_not_kept: int = 0

    @property
    def can_be_replayed(self) -> bool:
        """Tell whether the entry holds all that is needed to try it again."""
        return self.at is not None and (self.row is not None or (self.is_whole and self.format is not None))


@dataclass(frozen=True, slots=True)
class Reading:
    """How records of a source were read, so that single ones can be read again.

    Attributes:
        format: Name of the adapter.
        options: What the user said.
        first_line: See `RawBatch.first_line`; None = single lines cannot be read again.
        engines: Engine names and versions.
    """

    format: str
    options: IngestOptions = _DEFAULTS
    first_line: str | None = None
    engines: Sequence[str] = ()

    @property
    def said(self) -> dict[str, Any]:
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
        kept_max: Records kept until `close`; more are only counted.
    """

    def __init__(
        self,
        folder: Path | None,
        *,
        source: str,
        at: datetime | None = None,
        is_live: bool = False,
        kept_max: int = KEPT_PER_SOURCE,
    ) -> None:
        self._folder = folder
        self._source = _encodable(source)
        self._at = at
        self._is_live = is_live
        self._kept_max = kept_max
        self._held: list[Entry] = []
        self._held_bytes = 0
        self._n_taken = 0
        self._not_kept: Counter[str] = Counter()
        self.counts: Counter[str] = Counter()
        self.examples: dict[str, Rejected] = {}

    def add(self, rejected: Sequence[Rejected], *, reading: Reading | None = None, at: datetime | None = None) -> None:
        """Count and keep records; beyond `kept_max` they are only counted, as are all without a folder.

        Args:
            rejected: The records.
            reading: How they were read; None = their lines cannot be read again.
            at: The clock, when it has moved since the quarantine was made.
        """
        for record in rejected:
            self.counts[record.reason] += 1
            self.examples.setdefault(record.reason, record)
        if self._folder is None:
            return
        n_kept = max(0, min(len(rejected), self._kept_max - self._n_taken))
        self._n_taken += n_kept
        self._not_kept.update(r.reason for r in rejected[n_kept:])
        self._at = at or self._at
        for record in rejected[:n_kept]:
            entry = entry_of(record, source=self._source, at=self._at, is_live=self._is_live, reading=reading)
            self._held.append(entry)
            self._held_bytes += _ENTRY_BYTES + len(record.whole or "") + len(record.row or "")
            if len(self._held) >= CHUNK or self._held_bytes >= CHUNK_BYTES:
                self.flush()

    def flush(self) -> None:
        """Write what is held; it is durable when this returns.

        Raises:
            OSError: The disk refused; what is held stays held.
        """
        if self._held and self._folder is not None:
            write(self._folder, self._held, is_live=self._is_live)
            self._held.clear()
            self._held_bytes = 0

    def close(self) -> None:
        """Write what is held and how many were only counted; the quarantine may be used on, with a new `kept_max`."""
        said = f"counted beyond the {self._kept_max:,} records kept of a source"
        for reason, n in sorted(self._not_kept.items()):
            entry = Entry(
                at=None if self._at is None else self._at.astimezone(UTC),
                source=self._source,
                line=0,
                reason=reason,
                detail=said,
                is_live=self._is_live,
                n_not_kept=n,
            )
            self._held.append(entry)
        self._not_kept.clear()
        self.flush()
        self._n_taken = 0


def entry_of(
    record: Rejected, *, source: str, at: datetime | None, is_live: bool = False, reading: Reading | None = None
) -> Entry:
    """Return the entry a record is kept as; `Quarantine` says what the arguments are."""
    shared: dict[str, Any] = {
        "at": None if at is None else at.astimezone(UTC),
        "source": source,
        "line": record.line,
        "reason": record.reason,
        "detail": _encodable(record.detail),
        "is_live": is_live,
        "engines": () if reading is None else tuple(reading.engines),
    }
    if record.row is not None:
        row = msgspec.json.decode(record.row)
        return Entry(**shared, text=_encodable(record.text), table=record.table, row=row)
    if record.whole is None:
        return Entry(**shared, text=_encodable(record.text))
    if reading is None or reading.first_line is None:
        return Entry(**shared, text=record.whole, is_whole=True)
    how: dict[str, Any] = {
        "format": reading.format,
        "options": reading.said,
        "first_line": _encodable(reading.first_line),
    }
    return Entry(**shared, **how, text=record.whole, is_whole=True)


@dataclass
class ReasonSummary:
    """What is in quarantine for one reason.

    Attributes:
        reason: Slug.
        n_kept: Entries.
        n_not_kept: Records that were counted only.
        n_replayable: Entries that can be tried again.
        sources: Records, kept or not, by source.
        examples: The first entries.
    """

    reason: str
    n_kept: int = 0
    n_not_kept: int = 0
    n_replayable: int = 0
    sources: Counter[str] = field(default_factory=Counter)
    examples: list[Entry] = field(default_factory=list)


def summarise(
    folder: Path, *, reason: str | None = None, source: str | None = None, n_examples: int = 1
) -> list[ReasonSummary]:
    """Return what is in quarantine by reason, most first.

    Args:
        folder: `<project>/quarantine`.
        reason: This one only.
        source: Sources whose name contains this only.
        n_examples: Entries shown of each reason.
    """
    found: dict[str, ReasonSummary] = {}
    for path in files(folder):
        for _, entry in entries(path):
            if entry is None or not matches(entry, reason=reason, source=source):
                continue
            summary = found.setdefault(entry.reason, ReasonSummary(entry.reason))
            summary.sources[entry.source] += entry.n_not_kept or 1
            summary.n_not_kept += entry.n_not_kept
            if not entry.n_not_kept:
                summary.n_kept += 1
                summary.n_replayable += entry.can_be_replayed
                if len(summary.examples) < n_examples:
                    summary.examples.append(entry)
    return sorted(found.values(), key=lambda s: (-s.n_kept - s.n_not_kept, s.reason))


def matches(entry: Entry, *, reason: str | None, source: str | None) -> bool:
    """Tell whether an entry is of `reason` and its source's name contains `source`; None = any."""
    return reason in (None, entry.reason) and (source is None or source in entry.source)


def files(folder: Path) -> list[Path]:
    """Return the files of a quarantine by name; none when the folder does not exist."""
    return sorted(p for p in folder.glob("*.jsonl") if not p.name.startswith("."))


def entries(path: Path) -> Iterator[tuple[bytes, Entry | None]]:
    """Yield the lines of a quarantine file with their entries; None for a line that is none. A file may be gone."""
    decoder = msgspec.json.Decoder(Entry)
    try:
        stream = path.open("rb")
    except FileNotFoundError:
        return
    with stream:
        for line in stream:
            try:
                yield line.rstrip(b"\n"), decoder.decode(line)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
                yield line.rstrip(b"\n"), None


def write(folder: Path, held: Sequence[Entry | bytes], *, is_live: bool = False) -> Path:
    """Publish entries (or lines that are none, as they stand) as one file, unless there is one of the same content.

    Returns:
        The file they stand in.
    """
    timeless = b"\n".join(map(_timeless, held))
    path = folder / f"{'live-' if is_live else ''}{digest(timeless)}.jsonl"
    sweep_temporaries(folder)
    if path.exists():
        fsync_dir(folder)  # whoever wrote it may have been stopped before this
    else:
        data = b"".join((e if isinstance(e, bytes) else msgspec.json.encode(e)) + b"\n" for e in held)
        publish(path, data, is_private=True)
    return path


def rewrite(path: Path, left: Sequence[Entry | bytes]) -> None:
    """Replace a file by what is left of it: first the new one, durably, then the old one goes.

    A crash in between leaves both; whoever replays or purges again comes to the same end.
    """
    new = write(path.parent, left, is_live=path.name.startswith("live-")) if left else None
    if new != path:
        remove(path)


def drop(folder: Path, is_dropped: Callable[[Entry], bool]) -> int:
    """Remove the entries `is_dropped` is true for, durably; return how many records (kept or counted) went."""
    n_dropped = 0
    with locked(folder):
        for path in files(folder):
            left: list[Entry | bytes] = []
            n_gone = 0
            for line, entry in entries(path):
                if entry is not None and is_dropped(entry):
                    n_gone += entry.n_not_kept or 1
                else:
                    left.append(line)
            if n_gone:
                rewrite(path, left)
                n_dropped += n_gone
    return n_dropped


def tidy(folder: Path) -> None:
    """Put the many small files of live sources together into few; nothing happens where there is no quarantine."""
    if not folder.is_dir():
        return
    with locked(folder):
        small = [p for p in files(folder) if p.name.startswith("live-") and p.stat().st_size < SMALL_BYTES]
        while len(small) > 1:
            taken, n_bytes = 0, 0
            while taken < len(small) and n_bytes < 8 * SMALL_BYTES:
                n_bytes += small[taken].stat().st_size
                taken += 1
            together = dict.fromkeys(line for path in small[:taken] for line, _ in entries(path))
            new = write(folder, list(together), is_live=True)
            for path in small[:taken]:
                if path != new:
                    remove(path)
            small = small[taken:]


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock under which files of the quarantine are rewritten; litter of dead processes is swept."""
    make_dirs(folder)
    with exclusive(folder / ".lock"):
        sweep_temporaries(folder)
        yield


def _timeless(entry: Entry | bytes) -> bytes:
    """Return what an entry is told from others by: its line, of a file's without the instant."""
    if isinstance(entry, bytes):
        try:
            known = msgspec.json.decode(entry, type=Entry)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return entry
    else:
        known = entry
    return msgspec.json.encode(known if known.is_live else msgspec.structs.replace(known, at=None))


def _encodable(text: str) -> str:
    """Return `text` without lone surrogates, which UTF-8 has no bytes for."""
    return text.encode("utf-8", "backslashreplace").decode()
