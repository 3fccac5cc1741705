"""The contract between engine formats and the store.

An adapter knows one format: it recognises its files, states what its coordinates are, and streams *raw batches* in
bounded memory. The work that is the same for all formats (known cameras, finite numbers, plausible times, millimetres,
pseudonyms, quarantine) is done once, in `vsd_analytics.ingest.intake.normalise`.
"""

from __future__ import annotations

import contextlib
import io
import os
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Final, Protocol

import pyarrow as pa

from vsd_analytics.config.file_columns import FILE_TAG
from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.ingest.reading.limits import unpacked_max, unpacks_too_far
from vsd_analytics.schema import RAW_SCHEMAS, TableName
from vsd_analytics.settings import DEFAULTS, Settings

BATCH_ROWS = 200_000
EXCERPT_CHARS = 500
WHOLE_MAX_BYTES = 10_000
_HELD_MAX = 4 << 20
_MAGIC = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd", b"BZh": "bz2"}


@dataclass(frozen=True, slots=True)
class Rejected:
    """One record that cannot be used and goes to quarantine.

    Attributes:
        line: 1-based line or record number in the source.
        reason: A short, stable slug such as "not-a-number"; counts are given per reason.
        detail: One sentence for people.
        text: The record as it was sent, shortened to `EXCERPT_CHARS`.
        whole: The record's whole line, so that it can be read again; None when it is too long or not text.
        table: Raw table the record was a row of; None for one that could not be read at all.
        row: That row as a JSON object, so that it can be checked again; None when it is too long.
        n: Above 1 it represents so many records of one reason that are only counted, and shows the first of them.
    """

    line: int
    reason: str
    detail: str
    text: str = ""
    whole: str | None = None
    table: TableName | None = None
    row: str | None = None
    n: int = 1


@dataclass(frozen=True, slots=True)
class RawBatch:
    """Records of one source before validation, in the schemas of `vsd_analytics.schema.RAW_SCHEMAS`.

    Attributes:
        tables: Raw tables by name; a missing name is an empty table.
        rejected: Records the adapter could not read at all.
        n_dropped: Counts by reason of records left out on purpose, such as second sightings in one sampling period.
        notes: Things the user should know about the whole source, each once: a warning begins with its code ("W208: "),
            information with "info:".
        done_bytes: How far into the source the batch reaches, for the progress bar.
        engines: Engine names and versions the records came from.
        first_line: Line needed above a rejected line to read it again: a table's header, "" for none. None = lines of
            this format cannot be read on their own.
        values: How often each value occurs in columns that nobody mapped, and whose names tell of cameras or classes.
    """

    tables: Mapping[TableName, pa.Table] = field(default_factory=dict)
    rejected: Sequence[Rejected] = ()
    n_dropped: Mapping[str, int] = field(default_factory=dict)
    notes: Sequence[str] = ()
    done_bytes: int = 0
    engines: Sequence[str] = ()
    first_line: str | None = None
    values: Mapping[str, Counter[str]] = field(default_factory=dict)

    def table(self, name: TableName) -> pa.Table:
        """Return the raw table `name`, empty if the batch has none."""
        rows = self.tables.get(name)
        return RAW_SCHEMAS[name].empty_table() if rows is None else rows


@dataclass(frozen=True, slots=True)
class IngestOptions:
    """What the user says about the files, by options of the command or in `vsd.toml`.

    Attributes:
        format: Name of an adapter, or None to detect it.
        camera: Camera id for records that name none.
        camera_from_name: `camera_from_name` of vsd.toml, for the files of a folder or archive.
        columns: Column names of a headerless table, in order.
        map: Our column names to theirs; a name that the file lacks is an error.
        site_map: `[ingest.map]` of vsd.toml, our column names to theirs, used for files that have such columns.
        period_s: Sampling period: times are floored to it, so that records of one period are one frame.
        fps: Frames per second, for files that have frame numbers.
        start: Instant of frame 0 (UTC milliseconds), for files that have frame numbers.
        first_frame: Number of the frame taken at `start`; None = the format's first (0, MOTChallenge 1).
        frame_zone: IANA zone of times without an offset.
        clocks: IANA zones of times without an offset by camera (what the engine calls it), where cameras differ.
        line_max_bytes: Lines longer than this are quarantined unread.
        persons_max: Frame messages with more persons are quarantined.
        pairs_max: Frame messages with more pairs are quarantined.
        coordinates: "floor" or "image", for formats that carry both (MOTChallenge: world columns or boxes).
        method: smart-social-distancing: "center-points" or "four-corner".
        resolution_px: smart-social-distancing: width and height at which boxes were logged.
        threshold_m: smart-social-distancing: distance under which its pairs were counted.
        engine: Engine name and version to note when the file does not say.
        per_camera: wildtrack: each view is a camera of its own, instead of the positions fused from all.
        unit: Unit of positions and distances whose column does not name one, a key of `file_columns.METRES`.
        where: Which rows of a table are read, see `vsd_analytics.ingest.reading.where`.
        zone: IANA zone of times without an offset, as the user states it; it takes the place of all clocks.
        time_format: How a table writes its times, in the words of strptime.
        size_px: Width and height of the picture, for positions given as shares of it (0 to 1).
        pictures: Width and height of the picture by camera, from vsd.toml, for the same.
        is_sure: The user says that the file is right, whatever looks wrong about it.
        persons: Path of the list of persons in a JSON message that is read by `map`; None = a message is one person.
        no_list_is_nobody: A JSON frame without a list of persons is one without persons; else it goes to quarantine.
        profile: Id of the `[[source]]` of vsd.toml that gave some of them; None = none fits.
        is_only_camera: `camera` is the site's only one, and nobody said that it is meant.
        staff_classes: `staff_classes` of vsd.toml: the classes and tags of engines that mean staff, in lower case.
    """

    format: str | None = None
    camera: str | None = None
    columns: tuple[str, ...] | None = None
    map: Mapping[str, str] = field(default_factory=dict)
    site_map: Mapping[str, str] = field(default_factory=dict)
    period_s: float | None = None
    fps: float | None = None
    start: int | None = None
    first_frame: float | None = None
    frame_zone: str = "UTC"
    clocks: Mapping[str, str] = field(default_factory=dict)
    line_max_bytes: int = DEFAULTS.line_max_bytes
    persons_max: int = DEFAULTS.persons_max
    pairs_max: int = DEFAULTS.pairs_max
    coordinates: str | None = None
    method: str = "center-points"
    resolution_px: tuple[int, int] = (640, 480)
    threshold_m: float = 1.5
    engine: str | None = None
    per_camera: bool = False
    unit: str | None = None
    where: str | None = None
    zone: str | None = None
    time_format: str | None = None
    size_px: tuple[int, int] | None = None
    pictures: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    is_sure: bool = False
    persons: str | None = None
    no_list_is_nobody: bool | None = None
    profile: str | None = None
    is_only_camera: bool = False
    camera_from_name: str | None = None
    staff_classes: tuple[str, ...] = ()

    def is_staff(self, tag: object) -> bool | None:
        """Return whether an engine's class or tag of a person, or one of a list, is of `staff_classes`.

        None = the engine gives none, or `staff_classes` is empty.
        """
        tags = [t.strip().lower() for t in (tag if isinstance(tag, list) else [tag]) if isinstance(t, str)]
        return any(t in self.staff_classes for t in tags if t) if self.staff_classes and any(tags) else None


_UNSAID: Final = IngestOptions()
CHOICES: Final = {
    "columns": "--columns",
    "map": "--map",
    "where": "--where",
    "persons": "--persons",
    "no_list_is_nobody": "--no-list-is-nobody",
    "unit": "--unit",
    "zone": "--zone",
    "time_format": "--time-format",
    "period_s": "--period",
    "fps": "--fps",
    "start": "--start",
    "first_frame": "--first-frame",
    "size_px": "--size",
    "coordinates": "--coordinates",
    "method": "--method",
    "resolution_px": "--resolution",
    "threshold_m": "--threshold",
    "per_camera": "--per-camera",
}
"""Fields of `IngestOptions` of which an adapter may read some, and their options of the command line."""


def refuse_unused(source: Source, reader: Adapter, options: IngestOptions) -> None:
    """Refuse what the user says that a format does not read: figures would be those of a file read otherwise.

    Raises:
        UsageError: E101, naming the options, and those that the format reads.
    """
    if FILE_TAG in {*options.map, *options.site_map} and not options.staff_classes:
        raise UsageError(
            f"the tag of the map is not used to read {source.file_name}",
            where=Where(source.name),
            why="vsd.toml does not say which tags mean staff",
            fix='in vsd.toml: [staff] staff_classes = ["staff"]; or leave out tag',
        )
    uses = uses_of(reader)
    unused = [o for name, o in CHOICES.items() if name not in uses and getattr(options, name) != getattr(_UNSAID, name)]
    if unused:
        read = [option for name, option in CHOICES.items() if name in uses]
        raise unused_options(source, unused, why=f"the format {reader.name} reads {', '.join(read) or 'none of them'}")


def uses_of(reader: Adapter) -> frozenset[str]:
    """Return the fields of `CHOICES` that an adapter reads: all, where it does not say."""
    return getattr(reader, "uses", frozenset(CHOICES))


def unused_options(source: Source, unused: Sequence[str], *, why: str) -> UsageError:
    """Return the error of options that are not used: E101."""
    is_one = len(unused) == 1
    return UsageError(
        f"{', '.join(unused)} {'is' if is_one else 'are'} not used to read {source.file_name}",
        where=Where(source.name),
        why=why,
        fix=f"leave out {', '.join(unused)}; in a [[source]] of vsd.toml as well",
    )


@dataclass(frozen=True, slots=True)
class Source:
    """One thing the user named: a file, an archive or a folder.

    Attributes:
        path: As given.
        settings: The bounds of what it may ask for; see `vsd_analytics.ingest.reading.limits`.
        shown: What messages call it, where `path` is a copy of it; None = the path.
    """

    path: Path
    settings: Settings = field(default_factory=Settings, repr=False, kw_only=True)
    shown: str | None = field(default=None, kw_only=True)

    @property
    def name(self) -> str:
        """Return the path as shown in messages; bytes that are not UTF-8 are shown as replacement characters."""
        return os.fsencode(self.path if self.shown is None else self.shown).decode("utf-8", "replace")

    @property
    def file_name(self) -> str:
        """Return the last part of the path, for messages."""
        return self.path.name if self.shown is None else self.shown.rpartition("/")[2]

    @property
    def size_bytes(self) -> int:
        """Return the size of a file, or the sum over a folder's files."""
        if self.path.is_dir():
            return sum(p.stat().st_size for p in self.path.rglob("*") if p.is_file())
        return self.path.stat().st_size

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Return lower-case suffixes without those of compression: `a.csv.gz` gives (".csv",)."""
        return tuple(s for s in (x.lower() for x in self.path.suffixes) if s not in {".gz", ".zst", ".bz2"})

    def open(self) -> IO[bytes]:
        """Open a file for reading, decompressing .gz, .bz2 and .zst by its content's magic number.

        Returns:
            A buffered stream of bytes. Reading it raises `InputError` E205 when the compressed data are damaged, and
            E206 when they unpack to an absurd size.

        Raises:
            InputError: E120, the path is no regular file: a pipe or a device would be read for ever.
        """
        if not self.path.is_file():
            raise not_a_file(self)
        with self.path.open("rb") as f:
            magic = f.read(4)
        codec = next((c for start, c in _MAGIC.items() if magic.startswith(start)), None)
        if codec is None:
            return self.path.open("rb")
        return io.BufferedReader(_Decompressed(self, codec), buffer_size=1 << 20)

    def head(self, n_bytes: int = 65536) -> bytes:
        """Return the first decompressed bytes of a file, for recognising its format; b"" for a folder.

        Of a file that is damaged further on, what comes before the damage is returned.
        """
        if self.path.is_dir():
            return b""
        head = b""
        with self.open() as f, contextlib.suppress(InputError):
            while len(head) < n_bytes and (more := f.read1(n_bytes - len(head))):  # type: ignore[attr-defined]
                head += more
        return head


def not_a_file(source: Source) -> InputError:
    """Return the error of a path that is no regular file: E120."""
    return InputError(
        f"{source.file_name} is not a regular file",
        code="E120",
        where=Where(source.name),
        why="pipes, devices and sockets have no end, and a link may lead nowhere",
        fix="name a file; write the output of a pipe to a file first",
    )


def empty(source: Source) -> InputError:
    """Return the error of a file without content: E202, or E205 when it is damaged from its first line on."""
    try:
        if source.size_bytes:
            with source.open() as f:
                f.read(1)
    except InputError as error:
        return error
    return InputError(
        f"{source.file_name} is empty",
        code="E202",
        where=Where(source.name),
        why="even an hour without people has a header, or messages without persons",
        fix="export it again",
    )


def damaged_after(
    source: Source, number: int, *, why: str, what: str = "record", text: str | None = None
) -> InputError:
    """Return the error of a file of which only so many records can be read: E205."""
    return InputError(
        f"{source.file_name} is damaged after {what} {number:,}",
        code="E205",
        where=Where(source.name, number + 1, text),
        why=why,
        fix="copy or export the file again; the records before the damage are stored",
    )


def bytes_read(stream: IO[bytes]) -> int:
    """Return how far a stream of `Source.open` has read its file, in bytes on disk."""
    raw = getattr(stream, "raw", None)
    return raw.bytes_read() if isinstance(raw, _Decompressed) else stream.tell()


class _Decompressed(io.RawIOBase):
    """A decompressed stream whose damage is an `InputError`, raised after every whole line before it was handed out.

    Bytes after the last newline are held back until more arrive, so that damage never cuts a number in two.
    """

    def __init__(self, source: Source, codec: str) -> None:
        self._path = source.path
        self._settings = source.settings
        self._n_packed = source.path.stat().st_size
        self._held = b""
        self._ready = b""
        self._n_unpacked = 0
        self._error: InputError | None = None
        self._file = source.path.open("rb")
        self._raw: IO[bytes]
        if codec == "gzip":
            import gzip

            self._raw = gzip.GzipFile(fileobj=self._file)  # type: ignore[assignment]
        elif codec == "bz2":
            import bz2

            self._raw = bz2.BZ2File(self._file)
        else:
            self._raw = pa.CompressedInputStream(pa.PythonFile(self._file, mode="r"), "zstd")

    def bytes_read(self) -> int:
        """Return how many compressed bytes have been read."""
        return self._file.tell()

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer) -> int:  # type: ignore[no-untyped-def]
        """Fill `buffer` with decompressed bytes; 0 at the end."""
        while not self._ready and self._error is None:
            try:
                data = self._raw.read(1 << 20) if not hasattr(self._raw, "read1") else self._raw.read1(1 << 20)
            except (EOFError, OSError, ValueError, zlib.error) as error:
                self._error = InputError(
                    f"{self._path.name} is damaged: its compressed data end early",
                    code="E205",
                    where=Where(str(self._path)),
                    why=f"the decompressor says: {error}",
                    fix="copy or export the file again; the records before the damage are stored",
                )
                break
            if not data:
                self._ready, self._held = self._held, b""
                break
            self._n_unpacked += len(data)
            if self._n_unpacked > unpacked_max(self._n_packed, self._settings):
                self._error = unpacks_too_far(str(self._path), n_bytes=self._n_packed, settings=self._settings)
                break
            whole, newline, self._held = (self._held + data).rpartition(b"\n")
            self._ready = whole + newline
            if len(self._held) > _HELD_MAX:
                self._ready, self._held = self._ready + self._held, b""
        if not self._ready and self._error is not None:
            raise self._error
        n = min(len(buffer), len(self._ready))
        buffer[:n], self._ready = self._ready[:n], self._ready[n:]
        return n

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._raw.close()
            self._file.close()
        super().close()


class Adapter(Protocol):
    """One engine format."""

    name: str
    """Value of `--format`."""
    coordinates: str
    """What the positions are, as text for the manual and `vsd check`."""

    # An adapter may also have `uses: frozenset[str]`, the fields of `CHOICES` that it reads, and `head`, see
    # `checks.understanding.table_head`. Without `uses` it is taken to read them all.

    def detects(self, source: Source) -> bool:
        """Return whether the source is of this format, from its name and first bytes only."""
        ...

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the source.

        Yields:
            Raw batches of at most about `BATCH_ROWS` rows a table.

        Raises:
            InputError: The source as a whole cannot be used (E2xx). Batches yielded before stay valid.
        """
        ...
