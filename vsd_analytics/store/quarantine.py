"""The files of the quarantine: records that could not be used, stored until they are replayed or purged.

The quarantine is a folder of JSON Lines files with one entry a line. The name of a file is the hash of its entries
without their instants. So a bad file that is ingested twice is stored once, with the instant of the first time. Entries
of live sources have their instant in the hash: two equal messages are two. Only `rewrite`, `drop` and `tidy` remove
files. Track ids are here as the engine sent them, so the folder has mode 0700 and its files 0600.

`vsd_analytics.ingest.intake.quarantine_writer` puts records here; a fold and a purge change the files as well.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import msgspec

from vsd_analytics.schema import TableName
from vsd_analytics.store import durable

FOLDER = "quarantine"
SMALL_BYTES = 1 << 20
"""`tidy` merges files of live sources that are smaller than this."""


class QuarantineEntry(msgspec.Struct, frozen=True, omit_defaults=True, kw_only=True):
    """One entry of the quarantine.

    Attributes:
        at: Instant it was quarantined at (UTC).
        source: Name of the source as given.
        line: 1-based line or record number in the source.
        reason: Slug; `vsd_analytics.ingest.reading.reasons` says what to do.
        detail: One sentence for people.
        text: The record as it was sent: its whole line if `is_whole`, else an excerpt.
        is_live: It came from a broker; a replay compares its time with `at`.
        is_whole: `text` is the whole line.
        format: Adapter that can read `text` again; None = none can.
        options: Fields of `IngestOptions` that the user set for the source.
        first_line: Line needed above `text` to read it, such as the header of a table; "" = none.
        table: Raw table of `row`.
        row: Raw row in the columns of `RAW_SCHEMAS` without `line`, which can be checked again as it is.
        engines: Engine names and versions.
        import_id: Import that brought it; "" = none, such as a broker.
        n_not_kept: Above 0 the entry is no record but a count: so many more of this reason were not stored.
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
    import_id: str = ""
    n_not_kept: int = 0

    @property
    def can_be_replayed(self) -> bool:
        """Return whether the entry holds all that is needed to try it again."""
        return self.at is not None and (self.row is not None or (self.is_whole and self.format is not None))


def files(folder: Path) -> list[Path]:
    """Return the files of a quarantine by name; none when the folder does not exist."""
    return sorted(p for p in folder.glob("*.jsonl") if not p.name.startswith("."))


def entries(path: Path) -> Iterator[tuple[bytes, QuarantineEntry | None]]:
    """Yield the lines of a quarantine file with their entries, None for a line that is no entry.

    Yields nothing when the file was removed meanwhile.
    """
    decoder = msgspec.json.Decoder(QuarantineEntry)
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


def write(folder: Path, held: Sequence[QuarantineEntry | bytes], *, is_live: bool = False) -> Path:
    """Write entries, or lines as they are, to one file unless a file with the same content exists.

    Returns:
        The path of the file.
    """
    timeless = b"\n".join(map(_timeless, held))
    path = folder / f"{'live-' if is_live else ''}{durable.digest(timeless)}.jsonl"
    durable.sweep_temporaries(folder)
    if path.exists():
        durable.fsync_dir(folder)  # its writer may have been killed before it synced the folder
    else:
        data = b"".join((e if isinstance(e, bytes) else msgspec.json.encode(e)) + b"\n" for e in held)
        durable.publish(path, data, is_private=True)
    return path


def rewrite(path: Path, left: Sequence[QuarantineEntry | bytes]) -> None:
    """Replace a file by the entries that are left of it.

    The new file is durable before the old one is removed. A crash in between leaves both; the next replay or purge
    ends the same.
    """
    new = write(path.parent, left, is_live=path.name.startswith("live-")) if left else None
    if new != path:
        durable.remove(path)


def drop(folder: Path, is_dropped: Callable[[bytes, QuarantineEntry | None], bool]) -> None:
    """Remove the lines `is_dropped` is true for, durably; the caller holds the lock (`locked`).

    Args:
        folder: The quarantine.
        is_dropped: Called with each line and its entry, None when the line is no entry.
    """
    for path in files(folder):
        lines = list(entries(path))
        left: list[QuarantineEntry | bytes] = [line for line, entry in lines if not is_dropped(line, entry)]
        if len(left) < len(lines):
            rewrite(path, left)
    if folder.is_dir():
        durable.fsync_dir(folder)


def tidy(folder: Path) -> None:
    """Merge the many small files of live sources into a few; do nothing where there is no quarantine."""
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
                    durable.remove(path)
            small = small[taken:]


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock under which files of the quarantine are rewritten; remove files that dead processes left."""
    durable.make_dirs(folder)
    with durable.exclusive(folder / ".lock"):
        durable.sweep_temporaries(folder)
        yield


def _timeless(entry: QuarantineEntry | bytes) -> bytes:
    """Return the bytes that identify an entry: its line, without the instant unless the source is live."""
    if isinstance(entry, bytes):
        try:
            known = msgspec.json.decode(entry, type=QuarantineEntry)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return entry
    else:
        known = entry
    return msgspec.json.encode(known if known.is_live else msgspec.structs.replace(known, at=None))
