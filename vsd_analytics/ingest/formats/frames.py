"""VSD frame messages, the native format: one JSON object per processed frame, as JSON Lines or MQTT payloads.

The message is typed. A message that does not fit is quarantined with the decoder's reason. Unknown fields are counted
and never stored. `json_schema()` publishes the same types.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from functools import partial
from operator import attrgetter
from typing import Annotated, Any

import msgspec
import numpy as np
import pyarrow as pa

from vsd_analytics.ingest.formats.message_columns import Columns, pair_columns, person_columns
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source, bytes_read
from vsd_analytics.ingest.reading.envelopes import bare, text_before
from vsd_analytics.ingest.reading.helper_processes import in_order, n_helpers
from vsd_analytics.ingest.reading.instants import ambiguous_note, local_to_utc
from vsd_analytics.ingest.reading.raw import raw_table, rejected
from vsd_analytics.ingest.reading.reasons import NO_PLACE, TOO_MANY, UNKNOWN_FIELD
from vsd_analytics.ingest.reading.text_lines import lines_of, text_blocks
from vsd_analytics.schema import TableName

_LONG_BYTES = 2 << 20  # a first line that is damaged may be long
_BLOCK_BYTES = 12 << 20
"""Text that is decoded at once: some 200,000 records."""
_BLOCK_RECORDS = 400_000
"""More are decoded at once only where one line has more: persons without a place take three bytes each."""
_HELD_ROWS = 8_192
"""Messages become columns while the processor's cache still has them: in two thirds of the time."""
_OF_FRAME = ("camera", "ts", "seq", "engine", "quality")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_OWN = re.compile(rb'"v\\?"\s*:\s*\d\s*[,}]')
_OWN_KEYS = tuple(re.compile(rb'"%s\\?"\s*:' % key) for key in (b"persons", b"camera", b"ts"))
_ARRAY = re.compile(rb"\s*\[\s*\{")

Id = str | int


class PersonMessage(msgspec.Struct, frozen=True, gc=False):
    """A person in a frame: floor metres, image pixels, or both; an id only if the engine tracks.

    `tag` is what the engine says somebody is, such as staff. Only whether it is one of `staff_classes` is stored.
    """

    id: Id | None = None
    x_m: float | None = None
    y_m: float | None = None
    u_px: float | None = None
    v_px: float | None = None
    tag: str | None = None


class PairMessage(msgspec.Struct, frozen=True, gc=False):
    """A pair the engine measured: ids of its persons and their distance in metres."""

    a: Id
    b: Id
    distance_m: float | None = None
    sd_m: float | None = None


class FrameMessage(msgspec.Struct, frozen=True, gc=False):
    """One processed frame of one camera. An empty `persons` is a heartbeat; absent `pairs` are derived."""

    v: Annotated[int, msgspec.Meta(ge=1, le=1, description="Version of this message format.")]
    camera: Annotated[
        str, msgspec.Meta(min_length=1, max_length=200, description="Camera id or engine_ids of vsd.toml.")
    ]
    ts: Annotated[
        datetime, msgspec.Meta(description="Instant of the frame, ISO 8601; without offset in the camera's clock zone.")
    ]
    persons: tuple[PersonMessage, ...] | None = None
    pairs: tuple[PairMessage, ...] | None = None
    seq: (
        Annotated[
            int, msgspec.Meta(ge=0, le=2**62, description="Running number of this camera, so that gaps can be found.")
        ]
        | None
    ) = None
    engine: Annotated[str, msgspec.Meta(max_length=200)] | None = None
    quality: str = "metric"
    unplaced: Annotated[
        int, msgspec.Meta(ge=0, le=2**31, description="People who were seen and whose place nobody knows.")
    ] = 0


class _KnownPerson(PersonMessage, frozen=True, gc=False, forbid_unknown_fields=True): ...


class _KnownPair(PairMessage, frozen=True, gc=False, forbid_unknown_fields=True): ...


class _KnownFrame(FrameMessage, frozen=True, gc=False, forbid_unknown_fields=True):
    """The same message, refused with unknown fields: they are counted only in messages that have some."""

    persons: tuple[_KnownPerson, ...] | None = None
    pairs: tuple[_KnownPair, ...] | None = None


_FIELDS = frozenset(FrameMessage.__struct_fields__)
_PERSON_FIELDS = frozenset(PersonMessage.__struct_fields__)
_PAIR_FIELDS = frozenset(PairMessage.__struct_fields__)
_known = msgspec.json.Decoder(_KnownFrame)
_typed = msgspec.json.Decoder(FrameMessage)
_loose = msgspec.json.Decoder()


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of the VSD frame message, version 1."""
    schema = msgspec.json.schema(FrameMessage)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "vsd-frame-message-1",
        "title": "VSD frame message, version 1",
        **schema,
    }


class Frames:
    """Adapter of VSD frame messages in JSON Lines files (plain, gz, bz2 or zst)."""

    name = "frames"
    coordinates = "floor metres, image pixels, or both, as each message says"
    uses = frozenset({"zone"})

    def detects(self, source: Source) -> bool:
        """Return whether a line begins as an object with "v": 1, or our keys; lines before it may be damaged."""
        head = source.head()
        if _ARRAY.match(head.removeprefix(_BYTE_ORDER_MARK)):  # an array of objects is a table
            return False
        if b"\n" not in head:
            head = source.head(_LONG_BYTES)
        lines = head.removeprefix(_BYTE_ORDER_MARK).splitlines()
        return any((n.lstrip().startswith(b"{") or text_before(n)) and _is_own(n) for n in lines)

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the messages of one file, a large one in several processes; see `Adapter.read`."""
        with source.open() as stream:
            texts = text_blocks(stream, max_bytes=options.line_max_bytes, block_bytes=_BLOCK_BYTES)
            blocks = ((n, piece, bytes_read(stream)) for first, text in texts for n, piece in _bounded(first, text))
            helpers = n_helpers(source.size_bytes)
            is_empty = True
            for batches in in_order(partial(_batches, options), blocks, n_helpers=helpers):
                yield from batches
                is_empty = is_empty and not batches
            if is_empty:
                yield MessageRows(options).batch(source.size_bytes)


def _bounded(first: int, text: bytes | None) -> Iterator[tuple[int, bytes | None]]:
    """Yield some whole lines in pieces that cannot hold more than `_BLOCK_RECORDS`, as each record has a brace."""
    end = -1
    if text is not None and text.count(b"{") > _BLOCK_RECORDS:
        behind_half = text.find(b"\n", len(text) // 2)
        end = behind_half if behind_half >= 0 else text.rfind(b"\n")
    if text is None or end < 0:
        yield first, text
        return
    yield from _bounded(first, text[:end])
    yield from _bounded(first + text.count(b"\n", 0, end) + 1, text[end + 1 :])


def _batches(options: IngestOptions, block: tuple[int, bytes | None, int]) -> list[RawBatch]:
    """Return the records of some whole lines, of which one that is too long is None; see `text_blocks`."""
    first, text, done_bytes = block
    batches: list[RawBatch] = []
    builder = MessageRows(options)
    for number, line in enumerate(lines_of(text, max_bytes=options.line_max_bytes), first):
        if line is None:
            too_long = f"the line is longer than {options.line_max_bytes:,} bytes"
            builder.reject(number, "line-too-long", too_long, b"")
        elif line:
            builder.add(number, line)
        if builder.n_rows >= BATCH_ROWS:
            batches.append(builder.batch(done_bytes))
    if builder.n_rows:
        batches.append(builder.batch(done_bytes))
    return batches


def _is_own(line: bytes) -> bool:
    return _OWN.search(line) is not None or all(key.search(line) is not None for key in _OWN_KEYS)


class MessageRows:
    """Turns message after message into raw tables; the MQTT listener uses it too.

    Args:
        options: What the user says (such as clock zones of times without an offset).
    """

    def __init__(self, options: IngestOptions) -> None:
        self._options = options
        self._clear()

    def _clear(self) -> None:
        self._held: list[FrameMessage] = []
        self._n_held = 0
        self._frame: dict[str, list[Any]] = {name: [] for name in _OF_FRAME}
        self._n_persons: list[int | None] = []
        self._n_pairs: list[int | None] = []
        self._persons: list[Columns] = []
        self._pairs: list[Columns] = []
        self._numbers: list[int] = []
        self._rejected: list[Rejected] = []
        self._dropped: Counter[str] = Counter()
        self.n_rows = 0

    def reject(self, number: int, reason: str, detail: str, line: bytes) -> None:
        """Put one message into quarantine."""
        self.n_rows += 1 + len(line) // 256  # bad lines stay in memory whole, so a long one counts as several rows
        self._rejected.append(rejected(number, reason=reason, detail=detail, record=line))

    def add(self, number: int, line: bytes) -> None:
        """Decode one message and add its records; a blank line is no message."""
        try:
            message: FrameMessage | None = _known.decode(line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            message = self._second_look(number, line)
        if message is None:
            return
        n_persons, n_pairs = len(message.persons or ()), len(message.pairs or ())
        if n_persons > self._options.persons_max:
            self._reject_crowd(number, f"{n_persons:,} persons", self._options.persons_max, line)
        elif n_pairs > self._options.pairs_max:
            self._reject_crowd(number, f"{n_pairs:,} pairs", self._options.pairs_max, line)
        else:
            self._held.append(message)
            self._numbers.append(number)
            if message.unplaced:
                self._dropped[NO_PLACE] += message.unplaced
            self.n_rows += 1 + n_persons + n_pairs
            self._n_held += 1 + n_persons + n_pairs
            if self._n_held >= _HELD_ROWS:
                self._take_columns()

    def _reject_crowd(self, number: int, shown: str, most: int, line: bytes) -> None:
        """Put a message with more persons or pairs than a camera sees into quarantine as a whole."""
        self.reject(number, TOO_MANY, f"{shown} in one frame; at most {most:,} are read", line)

    def _second_look(self, number: int, line: bytes) -> FrameMessage | None:
        """Decode a message that is wrong, has something around it, or has unknown fields, and count these."""
        if not line.strip():
            return None
        bare_line = bare(line)
        try:
            message = _typed.decode(bare_line)
            loose: dict[str, Any] = _loose.decode(bare_line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            reason = "bad-message" if isinstance(error, msgspec.ValidationError) else "bad-json"
            self.reject(number, reason, f"not a VSD frame message: {error}", line)
            return None
        n_unknown = len(loose.keys() - _FIELDS)
        for name, known in (("persons", _PERSON_FIELDS), ("pairs", _PAIR_FIELDS)):
            n_unknown += sum(len(item.keys() - known) for item in loose.get(name) or ())
        self._dropped[UNKNOWN_FIELD] += n_unknown
        return message

    def _take_columns(self) -> None:
        """Turn the messages held into columns."""
        held = self._held
        for name, values in self._frame.items():
            values.extend(map(attrgetter(name), held))
        self._n_persons += [None if m.persons is None else len(m.persons) for m in held]
        self._n_pairs += [None if m.pairs is None else len(m.pairs) for m in held]
        if any(m.persons for m in held):
            self._persons.append(person_columns(held, self._options))
        if any(m.pairs for m in held):
            self._pairs.append(pair_columns(held))
        self._held, self._n_held = [], 0

    def batch(self, done_bytes: int) -> RawBatch:
        """Return the records added since the last call."""
        self._take_columns()
        lines = np.array(self._numbers, dtype=np.int64)
        cameras, qualities = (pa.array(self._frame[name], pa.string()) for name in ("camera", "quality"))
        ts_ms, zones, notes = self._instants()
        tables: dict[TableName, pa.Table] = {
            "frames": raw_table(
                "frames",
                camera=cameras,
                ts_ms=ts_ms,
                zone=zones,
                n_persons=self._n_persons,
                n_pairs=self._n_pairs,
                seq=self._frame["seq"],
                line=lines,
            )
        }
        parts: tuple[tuple[TableName, list[Columns], list[int | None]], ...] = (
            ("observations", self._persons, self._n_persons),
            ("pairs", self._pairs, self._n_pairs),
        )
        for name, chunks, n_of_frame in parts:
            if not chunks:
                continue
            counts = np.array([n or 0 for n in n_of_frame], dtype=np.int64)
            of_row = np.repeat(np.arange(len(counts)), counts)
            at = pa.array(of_row)
            columns: dict[str, Any] = {c: pa.concat_arrays([part[c] for part in chunks]) for c in chunks[0]}
            if name == "observations":
                columns["person"] = np.arange(len(of_row)) - np.repeat(np.cumsum(counts) - counts, counts)
            tables[name] = raw_table(
                name,
                camera=cameras.take(at),
                ts_ms=ts_ms[of_row],
                zone=zones.take(at),
                quality=qualities.take(at),
                line=lines[of_row],
                **columns,
            )
        engines = sorted({e for e in self._frame["engine"] if e})
        batch = RawBatch(tables, self._rejected, +self._dropped, notes, done_bytes, engines, first_line="")
        self._clear()
        return batch

    def _instants(self) -> tuple[np.ndarray, pa.Array, list[str]]:
        """Return UTC milliseconds, the zones of times without an offset, and notes."""
        instants = self._frame["ts"]
        ts_ms = np.asarray(pa.array(instants, pa.timestamp("us", "UTC")).cast(pa.int64())) // 1000
        naive: dict[str, list[int]] = {}
        for i, ts in enumerate(instants):
            if ts.tzinfo is None:
                zone = self._options.clocks.get(self._frame["camera"][i], self._options.frame_zone)
                naive.setdefault(zone, []).append(i)
        notes = []
        for zone, at in naive.items():
            ts_ms[at], is_ambiguous = local_to_utc(ts_ms[at], zone)
            notes += [ambiguous_note(zone)] if is_ambiguous.any() else []
        zones = np.full(len(ts_ms), None, dtype=object)
        for zone, at in naive.items():
            zones[at] = zone
        return ts_ms, pa.array(zones, pa.string()), notes
