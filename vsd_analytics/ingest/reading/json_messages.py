"""Adapters of engines that write JSON messages, one a frame: lines, an array, or objects one after the other."""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Source, bytes_read, damaged_after
from vsd_analytics.ingest.reading.arrow_file import MAGIC as ARROW_MAGIC
from vsd_analytics.ingest.reading.arrow_file import ArrowTable
from vsd_analytics.ingest.reading.envelopes import as_object, text_before, with_body
from vsd_analytics.ingest.reading.frame_rows import FrameRows
from vsd_analytics.ingest.reading.json_values import json_values
from vsd_analytics.ingest.reading.parquet import MAGIC as PARQUET_MAGIC
from vsd_analytics.ingest.reading.parquet import ParquetTable
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.text_lines import line_blocks

_LINES_BEFORE = 20
_ARRAY = re.compile(rb"\s*\[\s*(?:[\[{\]]|$)")
"""Beginning of an array of messages, and not of a log's line such as `[INFO] ...`."""


class JsonMessages(ABC):
    """An adapter of JSON messages; a subclass says how they are recognised and what is in one."""

    name: ClassVar[str]
    coordinates: ClassVar[str]
    engine: ClassVar[str]
    """Engine name, where neither message nor user says one."""
    marks: ClassVar[tuple[str, ...]]
    """Keys that a message of this format has, for recognising it."""
    uses: ClassVar[frozenset[str]] = frozenset({"period_s", "zone"})

    def detects(self, source: Source) -> bool:
        """Return whether the file begins as JSON and its first bytes have the keys of this format."""
        return has_marks(source, self.marks)

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the messages; one that cannot be used goes to quarantine.

        Raises:
            InputError: E205, a file that is not written line by line is damaged; what came before is stored.
        """
        frames = FrameRows(options, engine=self.engine)
        done = 0
        try:
            for number, message, record, done in messages(source, options):
                if message is None:
                    reason = "line-too-long" if not record else "bad-json"
                    frames.reject(number, reason, "this is no JSON object", record)
                else:
                    for reason, detail in frames.attempt(partial(self.take, message, frames, options, number)):
                        frames.reject(number, reason, detail, record)
                if frames.n_rows >= BATCH_ROWS:
                    yield frames.batch(done, first_line="")
        except InputError:
            yield frames.batch(done, first_line="")  # what came before the damage
            raise
        yield frames.batch(source.size_bytes, first_line="")

    def check(self, options: IngestOptions) -> None:  # noqa: B027 - most formats have nothing to check
        """Raise UsageError (E101) when messages cannot be read as the user says."""

    @abstractmethod
    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add what one message says.

        Raises:
            BadRowError: It cannot be used.
        """


def has_marks(source: Source, marks: Sequence[str]) -> bool:
    """Return whether a file begins as JSON, and its first bytes have all of these keys."""
    head = json_head(source)
    return all(re.search(rf'"{m}\\?"\s*:'.encode(), head) for m in marks) if head else False


def json_head(source: Source) -> bytes:
    """Return the first bytes of a file that begins as JSON, or with text before an object; b"" for other files."""
    head = source.head().removeprefix(b"\xef\xbb\xbf").lstrip() if source.path.is_file() else b""
    if head.startswith(b"{") or _ARRAY.match(head):
        return head
    for line in head.split(b"\n", _LINES_BEFORE)[:_LINES_BEFORE]:  # a log begins with other lines
        if as_object(line) is not None:
            return head[head.index(line) + len(text_before(line)) :]
    return b""


def inner(message: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return an object inside a message; a missing one, or null, is empty.

    Raises:
        BadRowError: It is something else.
    """
    value = message.get(key)
    if value is None or isinstance(value, dict):
        return value or {}
    raise BadRowError("bad-message", f"{key} is {str(value)[:40]!r}")


def listed(message: Mapping[str, Any], key: str) -> list[Any]:
    """Return a list inside a message, as `inner`."""
    value = message.get(key)
    if value is None or isinstance(value, list):
        return value or []
    raise BadRowError("bad-message", f"{key} is {str(value)[:40]!r}")


def text(message: Mapping[str, Any], key: str) -> str:
    """Return a text of a message, as `inner`; "" when it is missing."""
    value = message.get(key)
    if value is None or isinstance(value, str):
        return value or ""
    raise BadRowError("bad-message", f"{key} is {str(value)[:40]!r}")


def messages(source: Source, options: IngestOptions) -> Iterator[tuple[int, dict[str, Any] | None, bytes, int]]:
    """Yield number, message (None = no JSON object), its bytes, and how far the file has been read.

    The rows of a Parquet or Arrow file count as messages: its structs are objects.
    """
    head = source.head().removeprefix(b"\xef\xbb\xbf")
    if head.startswith((PARQUET_MAGIC, ARROW_MAGIC)):
        table = ParquetTable(source) if head.startswith(PARQUET_MAGIC) else ArrowTable(source)
        for number, row, done in table.rows():
            yield number, row, json.dumps(row).encode(), done
        return
    first = head.lstrip().partition(b"\n")[0]
    if _ARRAY.match(head) or (b"\n" in head.strip() and first.strip() == b"{"):
        yield from _one_after_the_other(source, options)
        return
    with source.open() as stream:
        for start, lines in line_blocks(stream, max_bytes=options.line_max_bytes):
            for number, line in enumerate(lines, start):
                if line is None:
                    yield number, None, b"", bytes_read(stream)
                elif line.strip():
                    yield number, as_object(line), line, bytes_read(stream)


def _one_after_the_other(
    source: Source, options: IngestOptions
) -> Iterator[tuple[int, dict[str, Any] | None, bytes, int]]:
    """Yield objects that span lines."""

    def damaged(number: int, text: str, error: Exception) -> InputError:
        return damaged_after(source, number, why=f"it is not JSON: {str(error)[:200]}", what="message", text=text)

    for number, value, text, done in json_values(source, value_max_bytes=options.line_max_bytes, damaged=damaged):
        if isinstance(value, dict):
            yield number, with_body(value), json.dumps(value).encode(), done
        else:
            yield number, None, text.encode("utf-8", "replace"), done
