r"""A test kit for adapters, such as those of plug-ins: tries what every format must do on a sample file of yours.

Example:
    A test of a plug-in::

        def test_acme(tmp_path):
            prove(Acme, AdapterSample(b"#acme\n1762761600;7;1.0;2.0\n", n_records=1), tmp_path)
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, Adapter, IngestOptions, RawBatch, Source
from vsd_analytics.schema import RAW_SCHEMAS
from vsd_analytics.store.layout import HOUR_MS

OTHER_FILES: Final = (b"", b"\n", b"ts,track_id,x_m,y_m\n", b'{"v": 1, "camera": "a"}\n', bytes(range(256)) * 4)
"""Files that no adapter of one engine may take for its own."""
BATCH_MAX: Final = 2 * BATCH_ROWS
_CUTS: Final = 25
_PERIOD_MS: Final = 7_000
_TOKYO: Final = "Asia/Tokyo"  # nine hours before UTC, all year
_ONE_CAMERA: Final = IngestOptions(camera="cam-1")


@dataclass(frozen=True, slots=True)
class AdapterSample:
    """A good file of the format, and what is in it.

    Attributes:
        data: Its bytes.
        n_records: Person or pair records in it.
        first_ms: Instant of its first record (UTC milliseconds); None = not compared.
        file_name: Its name.
        header_lines: Lines above the records.
        bad_line: A line that cannot be used and that no other line depends on, such as one person's below the line of a
            frame; None = the format has no lines. What a bad line of a frame costs needs a test of your own.
        options: What the user says, with the camera of formats that name none.
    """

    data: bytes
    n_records: int
    first_ms: int | None = None
    file_name: str = "sample.txt"
    header_lines: int = 1
    bad_line: bytes | None = b"\xff;bad;\x00"
    options: IngestOptions = _ONE_CAMERA


def prove(make: Callable[[], Adapter], sample: AdapterSample, folder: Path) -> None:
    """Try an adapter on a sample, on damaged copies of it, and on files of other formats.

    Args:
        make: Returns the adapter, as its entry point does.
        sample: A good file.
        folder: Where copies are written.

    Raises:
        AssertionError: The adapter breaks a promise; the message says which, and on what.
    """
    reader = make()
    for part in ("name", "coordinates", "detects", "read"):
        assert hasattr(reader, part), f"the adapter has no {part}"
    assert reader.name == "-".join(reader.name.lower().split()), f"{reader.name!r} is no value of --format"
    whole = _file(folder, sample, sample.data)
    assert reader.detects(whole), "detects() does not recognise the sample"
    for other in OTHER_FILES:
        assert not reader.detects(_file(folder, sample, other)), f"detects() takes {other[:30]!r} for its own"
    rows = _records(make, sample, sample.data, folder)
    assert len(rows) == sample.n_records, f"{len(rows)} records were read, the sample has {sample.n_records}"
    first_ms = min((row["ts_ms"] for row in rows), default=None)
    assert sample.first_ms in (None, first_ms), f"the first record is at {first_ms} ms, not at {sample.first_ms}"
    assert rows == _records(make, sample, sample.data, folder), "the same file gives other records the second time"
    _prove_zones(make, sample, folder)
    _prove_period(make, sample, folder)
    if sample.bad_line is not None:
        _prove_lines(make, sample, folder, rows)
    _prove_damage(make, sample, folder)


def _prove_zones(make: Callable[[], Adapter], sample: AdapterSample, folder: Path) -> None:
    """Times without an offset, which have a zone, are read on the clock that the user states."""
    read = {}
    for zone in ("UTC", _TOKYO):
        stated = replace(sample, options=replace(sample.options, zone=zone, frame_zone=zone, clocks={}))
        read[zone] = _records(make, stated, sample.data, folder)
    for here, there in zip(read["UTC"], read[_TOKYO], strict=True):
        if here["zone"] is not None:
            assert there["zone"] == _TOKYO, "the zone of a record must be the clock that its time was read on"
            assert here["ts_ms"] - there["ts_ms"] == 9 * HOUR_MS, (
                "a time without an offset must be read on the clock of its zone: local_to_utc() in "
                "vsd_analytics.ingest.reading.instants; --zone would change nothing"
            )


def _prove_period(make: Callable[[], Adapter], sample: AdapterSample, folder: Path) -> None:
    """Records of one sampling period, which the user states, are one frame."""
    stated = replace(sample, options=replace(sample.options, period_s=_PERIOD_MS / 1000))
    for row in _records(make, stated, sample.data, folder):
        assert row["ts_ms"] % _PERIOD_MS == 0, (
            "times must be floored to options.period_s: floored() in vsd_analytics.ingest.reading.raw; "
            "--period would change nothing"
        )


def _prove_lines(make: Callable[[], Adapter], sample: AdapterSample, folder: Path, rows: Sequence[Any]) -> None:
    """A bad line costs itself, and many lines come in many batches."""
    assert sample.bad_line is not None
    lines = sample.data.splitlines()
    head, body = lines[: sample.header_lines], lines[sample.header_lines :]
    spoilt = b"\n".join([*head, *body[:1], sample.bad_line, *body[1:]]) + b"\n"
    batches = _batches(make, sample, spoilt, folder)
    bad = [r for batch in batches for r in batch.rejected]
    assert len(bad) == 1, f"a bad line must be rejected, alone; {len(bad)} records were"
    assert "" not in (bad[0].reason, bad[0].detail), "a rejected line has no reason"
    assert bad[0].line == sample.header_lines + 2, (
        f"the bad line is number {sample.header_lines + 2}, not {bad[0].line}"
    )
    n_rows = sum(_n_records(batch) for batch in batches)
    assert n_rows >= len(rows), "a bad line must not cost the records beside it"
    assert n_rows == len(rows), f"{n_rows - len(rows)} records of the bad line were read: choose a line without any"
    n_times = math.ceil(2.5 * BATCH_ROWS / max(1, len(rows)))
    for batch in _batches(make, sample, b"\n".join([*head, *(body * n_times)]) + b"\n", folder):
        n = max((table.num_rows for table in batch.tables.values()), default=0)
        assert n <= BATCH_MAX, f"a batch has {n:,} rows: yield at most about {BATCH_ROWS:,}, so that memory is bounded"


def _prove_damage(make: Callable[[], Adapter], sample: AdapterSample, folder: Path) -> None:
    """Whatever is cut off or flipped ends in records, rejected ones, or an InputError."""
    chance = random.Random(0)
    for i in range(_CUTS):
        cut = sample.data[: len(sample.data) * i // _CUTS]
        flipped = bytearray(sample.data)
        for _ in range(3):
            flipped[chance.randrange(len(flipped))] = chance.randrange(256)
        for what, data in (("cut off", cut), ("damaged", bytes(flipped))):
            try:
                _batches(make, sample, data, folder)
            except InputError:
                continue
            except Exception as error:
                text = f"a file that is {what} raised {type(error).__name__}: {error}; bad records must be rejected"
                raise AssertionError(text) from error


def _file(folder: Path, sample: AdapterSample, data: bytes) -> Source:
    path = folder / sample.file_name
    path.write_bytes(data)
    return Source(path)


def _batches(make: Callable[[], Adapter], sample: AdapterSample, data: bytes, folder: Path) -> list[RawBatch]:
    batches = []
    for batch in make().read(_file(folder, sample, data), sample.options):
        for name, table in batch.tables.items():
            assert table.schema.equals(RAW_SCHEMAS[name]), f"{name} has other columns than RAW_SCHEMAS: use raw_table()"
        batches.append(batch)
    return batches


def _records(make: Callable[[], Adapter], sample: AdapterSample, data: bytes, folder: Path) -> list[dict[str, Any]]:
    batches = _batches(make, sample, data, folder)
    return [row for batch in batches for name in ("observations", "pairs") for row in batch.table(name).to_pylist()]


def _n_records(batch: RawBatch) -> int:
    return int(batch.table("observations").num_rows + batch.table("pairs").num_rows)
