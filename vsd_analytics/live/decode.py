"""From live messages to the stored tables: decoded, checked against the live clock, pseudonymised."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

import msgspec
import pyarrow as pa

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.formats.frames import MessageRows
from vsd_analytics.ingest.intake.normalise import Normaliser
from vsd_analytics.ingest.intake.pipeline import with_site
from vsd_analytics.ingest.intake.pseudonyms import keys_of
from vsd_analytics.ingest.intake.quarantine_writer import SourceReading
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Rejected
from vsd_analytics.ingest.reading.raw import rejected
from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.mapped import MappedReader, mapped_readers
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import Site

RETAINED = "the broker stored this copy (retain flag), so its age is unknown: publish frames without the retain flag"
EMPTY = "the message is empty"
OUT_OF_RANGE = "time-out-of-range"


@dataclass(frozen=True, slots=True)
class Prepared:
    """A batch of messages ready for the store.

    Attributes:
        tables: Rows in `SCHEMAS`.
        rejected: Records for quarantine; `line` is the running number of the message.
        n_dropped: Counts by reason of records and fields left out on purpose.
        engines: Engine names and versions the rows came from.
        readings: How the rejected of a message were read, by its number; a number without one was a frame message.
        apart: Camera and instant (UTC milliseconds) of each message whose time is out of range.
    """

    tables: Mapping[TableName, pa.Table] = field(default_factory=dict)
    rejected: Sequence[Rejected] = ()
    n_dropped: Mapping[str, int] = field(default_factory=dict)
    engines: Sequence[str] = ()
    readings: Mapping[int, SourceReading] = field(default_factory=dict)
    apart: Sequence[tuple[str, int]] = ()


class Preparer:
    """Prepares the messages of one site.

    Args:
        site: The site; its cameras, settings, clocks and secrets are used.
        now: The clock at the start.
        readers: Readers of messages that are no frame messages; None = those of vsd.toml.

    Attributes:
        n_messages: Messages prepared so far; the next one has this number plus one.
    """

    def __init__(self, site: Site, *, now: datetime, readers: Sequence[MappedReader] | None = None) -> None:
        self._options = with_site(site, IngestOptions())
        keys = keys_of(site)
        self._normaliser = Normaliser(site, now=now, keys=keys)
        self._readers = mapped_readers(site) if readers is None else readers
        self.n_messages = 0

    def prepare(self, deliveries: Sequence[ReceivedMessage], *, now: datetime) -> Prepared:
        """Return the records of a batch of messages in stored form.

        A message that makes the reader itself fail is quarantined alone. It must not stop the messages beside it, and
        it must be acknowledged, or the broker would send it again for ever.

        Args:
            deliveries: Messages in the order they arrived.
            now: The clock: instants outside [now - live_late_max_s, now + live_ahead_max_s] are rejected.

        Raises:
            VsdError: E303, the key of a day is damaged; the messages can be tried again.
            OSError: The disk refused a new day's key; the messages can be tried again.
        """
        self._normaliser.live_at(now)
        first, self.n_messages = self.n_messages + 1, self.n_messages + len(deliveries)
        try:
            return self._read(deliveries, first)
        except (VsdError, OSError):
            raise
        except Exception:  # one message is the cause: find it by reading each alone
            return _joined([self._read_alone(d, number) for number, d in enumerate(deliveries, first)])

    def _read(self, deliveries: Sequence[ReceivedMessage], first: int) -> Prepared:
        limit = self._options.line_max_bytes
        rows = MessageRows(self._options)
        mapped: dict[int, MappedReader] = {}
        for reader in self._readers:
            reader.forget()
        for number, delivery in enumerate(deliveries, first):
            reader_of = next((r for r in self._readers if r.reads(delivery.topic)), None)
            if reader_of is not None:
                mapped[number] = reader_of
            if delivery.is_retained:
                rows.reject(number, "retained", RETAINED, delivery.payload)
            elif delivery.n_bytes > limit:
                rows.reject(number, "line-too-long", f"the message is longer than {limit:,} bytes", delivery.payload)
            elif not delivery.payload.strip():
                rows.reject(number, "bad-json", EMPTY, delivery.payload)
            elif reader_of is not None:
                reader_of.add(number, delivery)
            else:
                rows.add(number, delivery.payload)
        payloads = {n: d.payload for n, d in enumerate(deliveries, first)}
        used = [r for r in self._readers if r in mapped.values()]
        parts = [self._cleaned(batch, payloads) for batch in (rows.batch(0), *(r.batch() for r in used))]
        prepared = parts[0] if len(parts) == 1 else _joined(parts)
        bad = [replace(r, detail=f"{r.detail}; topic {deliveries[r.line - first].topic}") for r in prepared.rejected]
        return replace(prepared, rejected=bad, readings={n: reader.reading for n, reader in mapped.items()})

    def _cleaned(self, raw: RawBatch, payloads: Mapping[int, bytes]) -> Prepared:
        clean = self._normaliser.normalise(raw)
        bad = _by_message(clean.rejected, payloads)
        return Prepared(clean.tables, bad, clean.n_dropped, raw.engines, apart=_apart(clean.rejected))

    def _read_alone(self, delivery: ReceivedMessage, number: int) -> Prepared:
        try:
            return self._read([delivery], number)
        except (VsdError, OSError):
            raise
        except Exception as error:
            detail = f"the message cannot be read: {type(error).__name__}: {error}; topic {delivery.topic}"
            bad = rejected(number, reason="bad-message", detail=detail[:1000], record=delivery.payload)
            return Prepared(rejected=[bad])


def _apart(rejects: Sequence[Rejected]) -> list[tuple[str, int]]:
    frames = [r.row for r in rejects if r.reason == OUT_OF_RANGE and r.table == "frames" and r.row is not None]
    return [(str(row["camera"]), int(row["ts_ms"])) for row in map(msgspec.json.decode, frames)]


def _by_message(rejects: Sequence[Rejected], payloads: Mapping[int, bytes]) -> list[Rejected]:
    """Replace the rejected rows of a message whose time is out of range by the message: rows take ten times the space.

    A message too long to be held whole stays as rows, which can be replayed.
    """
    merged: list[Rejected] = []
    together: set[int] = set()
    for r in rejects:
        if r.line in together:
            continue
        whole = rejected(r.line, reason=r.reason, detail=r.detail, record=payloads[r.line])
        if r.reason == OUT_OF_RANGE and whole.whole is not None:
            together.add(r.line)
            merged.append(whole)
        else:
            merged.append(r)
    return merged


def _joined(parts: Sequence[Prepared]) -> Prepared:
    names = list(dict.fromkeys(name for p in parts for name in p.tables))
    return Prepared(
        {name: pa.concat_tables(p.tables[name] for p in parts if name in p.tables) for name in names},
        [r for p in parts for r in p.rejected],
        sum((Counter(p.n_dropped) for p in parts), Counter()),
        sorted({e for p in parts for e in p.engines}),
        {n: r for p in parts for n, r in p.readings.items()},
        [a for p in parts for a in p.apart],
    )
