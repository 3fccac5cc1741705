"""VSD frame messages, the native format: one JSON object per processed frame, as JSON Lines or MQTT payloads.

The message is typed: what does not fit is quarantined with the decoder's reason, unknown fields are counted and never
stored. `json_schema()` publishes the same types.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import IO, Annotated, Any
from zoneinfo import ZoneInfo

import msgspec
import pyarrow as pa

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.adapter import (
    BATCH_ROWS,
    EXCERPT_CHARS,
    IngestOptions,
    RawBatch,
    Rejected,
    Source,
    bytes_read,
)
from vsd_analytics.schema import RAW_SCHEMAS, TableName
from vsd_analytics.settings import BY_NAME

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MS = timedelta(milliseconds=1)

Id = str | int


class PersonMessage(msgspec.Struct, frozen=True):
    """A person in a frame: floor metres, image pixels, or both; an id only if the engine tracks."""

    id: Id | None = None
    x_m: float | None = None
    y_m: float | None = None
    u_px: float | None = None
    v_px: float | None = None


class PairMessage(msgspec.Struct, frozen=True):
    """A pair the engine measured: ids of its persons and their distance in metres."""

    a: Id
    b: Id
    distance_m: float | None = None
    sd_m: float | None = None


class FrameMessage(msgspec.Struct, frozen=True):
    """One processed frame of one camera. An empty `persons` is a heartbeat; absent `pairs` are derived."""

    v: Annotated[int, msgspec.Meta(ge=1, le=1, description="Version of this message format.")]
    camera: Annotated[str, msgspec.Meta(min_length=1, max_length=200, description="Camera id or engine_ids of vsd.toml.")]
    ts: Annotated[datetime, msgspec.Meta(description="Instant of the frame, ISO 8601; without offset in the camera's clock zone.")]
    persons: list[PersonMessage] | None = None
    pairs: list[PairMessage] | None = None
    seq: Annotated[int, msgspec.Meta(ge=0, description="Running number, so that gaps can be reported.")] | None = None
    engine: Annotated[str, msgspec.Meta(max_length=200)] | None = None
    quality: str = "metric"


_FIELDS = frozenset(FrameMessage.__struct_fields__)
_PERSON_FIELDS = frozenset(PersonMessage.__struct_fields__)
_PAIR_FIELDS = frozenset(PairMessage.__struct_fields__)
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

    def detects(self, source: Source) -> bool:
        """Tell by the first non-blank line: a JSON object with a "camera" or "v"."""
        for line in source.head().splitlines():
            if line.strip():
                return line.lstrip().startswith(b"{") and (b'"camera"' in line or b'"v"' in line)
        return False

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the messages of one file; see `Adapter.read`."""
        limit = int(BY_NAME["line_max_bytes"].default)
        builder = MessageRows(options)
        damage: InputError | None = None
        with source.open() as stream:
            lines = enumerate(_lines(stream, limit), start=1)
            while True:
                try:
                    number, line = next(lines, (0, b""))
                except InputError as error:
                    damage = error
                    break
                if not number:
                    break
                if line is None:
                    builder.reject(number, "line-too-long", f"the line is longer than {limit:,} bytes", b"")
                elif line.strip():
                    builder.add(number, line)
                if builder.n_rows >= BATCH_ROWS:
                    yield builder.batch(bytes_read(stream))
        yield builder.batch(source.size_bytes)
        if damage is not None:
            raise damage


def _lines(stream: IO[bytes], limit: int) -> Iterator[bytes | None]:
    """Yield lines; None for one longer than `limit`, which is skipped without being held in memory."""
    while line := stream.readline(limit + 1):
        if len(line) > limit:
            while line and not line.endswith(b"\n"):
                line = stream.readline(limit)
            yield None
        else:
            yield line


class MessageRows:
    """Turns message after message into raw tables; the MQTT listener uses it too.

    Args:
        options: What the user said (camera clock zone, engine).
    """

    def __init__(self, options: IngestOptions) -> None:
        self._zone = ZoneInfo(options.frame_zone)
        self._clear()

    def _clear(self) -> None:
        self._columns: dict[TableName, list[list[Any]]] = {
            name: [[] for _ in RAW_SCHEMAS[name].names] for name in ("frames", "observations", "pairs")
        }
        self._rejected: list[Rejected] = []
        self._dropped: dict[str, int] = {}
        self.engines: set[str] = set()
        self.n_rows = 0

    def reject(self, number: int, reason: str, detail: str, line: bytes) -> None:
        """Put one message into quarantine."""
        self.n_rows += 1
        self._rejected.append(Rejected(number, reason, detail, line[:EXCERPT_CHARS].decode("utf-8", "replace")))

    def add(self, number: int, line: bytes) -> None:
        """Decode one message and keep its records."""
        try:
            message = _typed.decode(line)
            self._count_unknown(_loose.decode(line))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, OverflowError) as error:
            reason = "bad-message" if isinstance(error, msgspec.ValidationError) else "bad-json"
            self.reject(number, reason, f"not a VSD frame message: {error}", line)
            return
        ts = message.ts if message.ts.tzinfo is not None else message.ts.replace(tzinfo=self._zone)
        ts_ms = (ts - _EPOCH) // _MS
        camera, quality = message.camera, message.quality
        persons, pairs = message.persons, message.pairs
        if message.engine:
            self.engines.add(message.engine)
        frames = self._columns["frames"]
        for column, value in zip(
            frames,
            (camera, ts_ms, None if persons is None else len(persons), None if pairs is None else len(pairs), number),
            strict=True,
        ):
            column.append(value)
        self.n_rows += 1
        index: dict[str, int] = {}
        if persons:
            self._add_persons(persons, camera, ts_ms, quality, number, index)
        if pairs:
            self._add_pairs(pairs, persons or [], camera, ts_ms, quality, number, index)

    def _add_persons(
        self, persons: list[PersonMessage], camera: str, ts_ms: int, quality: str, number: int, index: dict[str, int]
    ) -> None:
        cameras, times, person, tracks, xs, ys, us, vs, qualities, numbers = self._columns["observations"]
        for i, p in enumerate(persons):
            track = None if p.id is None else str(p.id)
            if track is not None:
                index.setdefault(track, i)
            cameras.append(camera)
            times.append(ts_ms)
            person.append(i)
            tracks.append(track)
            xs.append(p.x_m)
            ys.append(p.y_m)
            us.append(p.u_px)
            vs.append(p.v_px)
            qualities.append(quality)
            numbers.append(number)
        self.n_rows += len(persons)

    def _add_pairs(
        self,
        pairs: list[PairMessage],
        persons: list[PersonMessage],
        camera: str,
        ts_ms: int,
        quality: str,
        number: int,
        index: dict[str, int],
    ) -> None:
        for pair in pairs:
            a, b = str(pair.a), str(pair.b)
            ia, ib = (index.setdefault(t, len(index)) for t in (a, b))
            pa_, pb = (persons[i] if i < len(persons) else None for i in (ia, ib))
            values = (
                camera, ts_ms, ia, ib, a, b,
                pa_ and pa_.x_m, pa_ and pa_.y_m, pb and pb.x_m, pb and pb.y_m,
                pair.distance_m, pair.sd_m, quality, number,
            )  # fmt: skip
            for column, value in zip(self._columns["pairs"], values, strict=True):
                column.append(value)
        self.n_rows += len(pairs)

    def _count_unknown(self, loose: dict[str, Any]) -> None:
        if loose.keys() - _FIELDS:
            self._dropped["unknown field"] = self._dropped.get("unknown field", 0) + len(loose.keys() - _FIELDS)
        for name, known in (("persons", _PERSON_FIELDS), ("pairs", _PAIR_FIELDS)):
            for item in loose.get(name) or ():
                if len(unknown := item.keys() - known):
                    self._dropped["unknown field"] = self._dropped.get("unknown field", 0) + len(unknown)

    def batch(self, done_bytes: int) -> RawBatch:
        """Return what was added since the last call."""
        tables = {
            name: pa.table([pa.array(c, type=f.type) for c, f in zip(columns, RAW_SCHEMAS[name], strict=True)], schema=RAW_SCHEMAS[name])
            for name, columns in self._columns.items()
        }
        batch = RawBatch(tables, self._rejected, self._dropped, (), done_bytes, tuple(sorted(self.engines)))
        self._clear()
        return batch
