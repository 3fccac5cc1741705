"""Inputs made to take memory or time: a few bytes that unpack, expand or multiply. Bomb n of a seed is always the same.

Each maker gets a random source and an empty folder, writes one input there and returns its path and the options it is
read with. Sizes are drawn on a logarithmic scale; most are small, so that many fit into an hour.
"""

from __future__ import annotations

import bz2
import gzip
import io
import json
import tarfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from fuzz_worlds import zstd
from simulate.small_scenes import START_MS

Made = tuple[Path, dict[str, Any]]
Maker = Callable[[Random, Path], Made]

CAMERA = {"camera": "cam-1"}
CLOCK = {"camera": "cam-1", "start": START_MS, "fps": 25.0}
LOG_HEAD = b"Version,Timestamp,DetectedObjects,ViolatingObjects,EnvironmentScore,Detections,ViolationsIndexes\n"
PERSON = "{'position': [0.0, 0.0, 0.0], 'bbox': [0.1, 0.2, 0.15, 0.6], 'tracking_id': '11'}"


def size(rng: Random, low: float, high: float) -> int:
    """Return a whole number from `low` to `high` on a logarithmic scale: one in ten of all, else of its lower half."""
    return int(low * (high / low) ** (rng.random() * (1.0 if rng.random() < 0.1 else 0.5)))


# -- Parquet ---------------------------------------------------------------------------------------------------------


def constant(n: int, **changes: Any) -> pa.Table:
    """Return `n` equal rows; a change is the value of a column, or the column."""
    columns = {"ts": START_MS, "camera_id": "cam-1", "track_id": "7", "x_m": 1.0, "y_m": 2.0, **changes}
    return pa.table(
        {k: v if isinstance(v, pa.Array) else pa.repeat(pa.scalar(v), n) for k, v in columns.items() if v is not None}
    )


def wrote(folder: Path, table: pa.Table, rng: Random, **options: Any) -> Made:
    """Write a table as Parquet."""
    given = {"compression": rng.choice(("zstd", "gzip", "snappy", "brotli", "none")), **options}
    pq.write_table(table, folder / "a.parquet", **given)
    return folder / "a.parquet", dict(CAMERA)


def giant_cell(rng: Random, folder: Path) -> Made:
    text = "x" * size(rng, 1e3, 4e8 if rng.random() < 0.05 else 2e7)
    column = rng.choice(("ts", "camera_id", "track_id", "x_m"))
    value = pa.scalar(text, rng.choice((pa.string(), pa.large_string())))
    n = rng.choice((1, 1, 3))
    return wrote(folder, constant(n, **{column: pa.repeat(value, n)}), rng, compression="zstd")


def constant_rows(rng: Random, folder: Path) -> Made:
    n = size(rng, 1e3, 3e7 if rng.random() < 0.02 else 1e6)
    table = constant(min(n, 1_000_000))
    with pq.ParquetWriter(folder / "a.parquet", table.schema, compression="zstd") as writer:
        for at in range(0, n, 1_000_000):
            writer.write_table(table.slice(0, min(1_000_000, n - at)))
    return folder / "a.parquet", dict(CAMERA)


def bad_rows(rng: Random, folder: Path) -> Made:
    changes: tuple[dict[str, Any], ...] = (
        {"x_m": float("inf")}, {"x_m": "x"}, {"x_m": 1e9}, {"ts": "never"}, {"camera_id": "nobody"},
        {"track_id": "x" * 300}, {"x_m": float("nan"), "y_m": "1e400"}, {"ts": "2026-10-25T02:30:00"},
    )  # fmt: skip
    return wrote(folder, constant(size(rng, 1e3, 1e6 if rng.random() < 0.05 else 1e5), **rng.choice(changes)), rng)


def dictionary_bomb(rng: Random, folder: Path) -> Made:
    n_cells, n_bytes, n = size(rng, 1, 100), size(rng, 1e2, 1e6), size(rng, 1e3, 1e6)
    words = pa.array([f"{i:03}" + "x" * min(n_bytes, 20_000_000 // n_cells) for i in range(n_cells)])
    indices = pa.repeat(pa.scalar(0, pa.int32()), n) if rng.random() < 0.5 else pa.array(range(n)).cast(pa.int32())
    if len(words) > 1 and indices[-1].as_py():
        indices = pa.array([i % n_cells for i in range(n)], pa.int32())
    elif indices[-1].as_py():
        indices = pa.repeat(pa.scalar(0, pa.int32()), n)
    column = pa.DictionaryArray.from_arrays(indices, words)
    name = rng.choice(("track_id", "ts", "camera_id", "x_m"))
    return wrote(folder, constant(n, **{name: column}), rng, compression="zstd")


def repeated_prefixes(rng: Random, folder: Path) -> Made:
    n_bytes, n = size(rng, 10, 1e6), size(rng, 10, 1e4)
    column = pa.repeat(pa.scalar("x" * min(n_bytes, 200_000_000 // n)), n)
    encoding = rng.choice(("DELTA_BYTE_ARRAY", "DELTA_BYTE_ARRAY", "DELTA_LENGTH_BYTE_ARRAY", "PLAIN"))
    name = rng.choice(("track_id", "ts", "camera_id"))
    return wrote(
        folder, constant(n, **{name: column}), rng, use_dictionary=False, column_encoding={name: encoding},
        compression="zstd",
    )  # fmt: skip


def fixed_cells(rng: Random, folder: Path) -> Made:
    n_bytes, n = size(rng, 1, 1e6), size(rng, 10, 1e5)
    n = min(n, 100_000_000 // n_bytes)
    return wrote(folder, constant(n, track_id=pa.repeat(pa.scalar(b"x" * n_bytes, pa.binary(n_bytes)), n)), rng)


def nested_column(rng: Random, folder: Path) -> Made:
    n = size(rng, 10, 5e6)
    values = pa.repeat(pa.scalar(1.0), n)
    lists = pa.ListArray.from_arrays(pa.array([0, n], pa.int32()), values)
    column = rng.choice((lists, pa.StructArray.from_arrays([lists], ["x_m"])))
    return wrote(folder, constant(1, x_m=column), rng)


def many_columns(rng: Random, folder: Path) -> Made:
    long = "n" * size(rng, 1, 1e3)
    extra = {f"{long}{i}": 1.0 for i in range(size(rng, 10, 3e3))}
    return wrote(folder, constant(1, **(extra | rng.choice(({}, {"x_m": None}, {"ts": None})))), rng)


def many_row_groups(rng: Random, folder: Path) -> Made:
    return wrote(folder, constant(size(rng, 10, 1e3), track_id=rng.choice(("7", "x" * 1000))), rng, row_group_size=1)


def _varint(value: int) -> bytes:
    value, found = value << 1, b""
    while value > 127:
        found, value = found + bytes((value & 127 | 128,)), value >> 7
    return found + bytes((value,))


def _padded(value: int, length: int) -> bytes:
    digits = [(value << 1 >> 7 * i) & 127 for i in range(length)]
    return bytes([d | 128 for d in digits[:-1]] + [digits[-1]])


def lying_sizes(rng: Random, folder: Path) -> Made:
    """Write other numbers into the footer or the page headers: rows, sizes before and after decompression."""
    made = rng.choice((giant_cell, constant_rows, dictionary_bomb, repeated_prefixes))(rng, folder)
    path = made[0]
    if path.stat().st_size > 30_000_000:
        return made
    metadata = pq.read_metadata(path)
    data = bytearray(path.read_bytes())
    footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    numbers = {metadata.num_rows}
    for group in range(metadata.num_row_groups):
        row_group = metadata.row_group(group)
        numbers |= {row_group.num_rows, row_group.total_byte_size}
        for i in range(row_group.num_columns):
            column = row_group.column(i)
            numbers |= {column.total_uncompressed_size, column.total_compressed_size, column.num_values}
    is_footer = rng.random() < 0.7
    low, high = (footer, len(data) - 8) if is_footer else (0, min(footer, 100_000))
    for number in [n for n in sorted(numbers) if n > 63 and rng.random() < 0.7]:
        true = _varint(number)
        lie = _padded(rng.choice((1, 100, number // 2, number * 2, 2**31 - 1, 2**40)), len(true))
        at = data.find(true, low, high)
        while at >= 0:
            data[at : at + len(true)] = lie
            at = data.find(true, at + len(true), high)
    path.write_bytes(data)
    return made


# -- texts ------------------------------------------------------------------------------------------------------------

MESSAGE = b'{"v":1,"camera":"7","ts":"2026-11-09T09:00:00Z","persons":[]}\n'
ROW = b"1794211200,cam-1,7,1.0,2.0\n"
TABLE_HEAD = b"ts,camera_id,track_id,x_m,y_m\n"
SAME: Mapping[str, tuple[bytes, tuple[bytes, ...]]] = {
    "a.jsonl": (MESSAGE, (MESSAGE, b"{}\n", b"\n", b"x\n", b"[", b" ", b'"', b'{"v":1}\n', b"\x00")),
    "a.csv": (TABLE_HEAD, (ROW, b"\n", b"x\n", b",,,,\n", b",", b"x", b'"', b"1,7,7,inf,2\n", b"nan,,,,\n", b"\x00")),
    "log.csv": (LOG_HEAD, (b'1.0,2026-11-09 09:00:00,0,0,0.9,"[]","[]"\n', b"x\n", b",,,,,,\n", b"[", b'"', b"\n")),
    "gt.txt": (b"1,1,1,1,9,9\n", (b"1,1,1,1,9,9\n", b"x\n", b"\n", b",", b"9", b"2499999,1,1,1,9,9\n", b"1,1\n")),
}


def _repeated(rng: Random, n_bytes: int) -> tuple[str, bytes]:
    name = rng.choice(sorted(SAME))
    head, lines = SAME[name]
    line = rng.choice(lines)
    return name, head + line * (n_bytes // len(line))


def compressed_text(rng: Random, folder: Path) -> Made:
    name, data = _repeated(rng, size(rng, 1e4, 1e8 if rng.random() < 0.02 else 4e6))
    ending, pack = rng.choice(((".gz", gzip.compress), (".bz2", bz2.compress), (".zst", zstd)))
    data = pack(data)
    if rng.random() < 0.2:  # several streams one behind the other
        data *= size(rng, 1, 20)
    (folder / f"{name}{ending}").write_bytes(data)
    return folder / f"{name}{ending}", dict(CLOCK)


def plain_text(rng: Random, folder: Path) -> Made:
    name, data = _repeated(rng, size(rng, 1e4, 4e6 if rng.random() < 0.05 else 5e5))
    (folder / name).write_bytes(data)
    return folder / name, dict(CLOCK)


def wide_text(rng: Random, folder: Path) -> Made:
    n_columns, n_rows = size(rng, 10, 3e4), size(rng, 1, 1e3)
    n_rows = min(n_rows, 2_000_000 // n_columns)
    names = ",".join(f"c{i}" for i in range(n_columns))
    row = ROW.strip() + b"," + b",".join([b"1"] * n_columns) + b"\n"
    (folder / "a.csv").write_bytes(TABLE_HEAD.strip() + b"," + names.encode() + b"\n" + row * n_rows)
    return folder / "a.csv", dict(CAMERA)


def large_cells(rng: Random, folder: Path) -> Made:
    cell = rng.choice((b"x", b"9", b'""', b"1.", b"-", b" ", b"\xff")) * size(rng, 1e2, 5e5)
    cells = ROW.strip().split(b",")
    cells[rng.randrange(5)] = b'"' + cell + b'"' if rng.random() < 0.3 else cell
    (folder / "a.csv").write_bytes(TABLE_HEAD + (b",".join(cells) + b"\n") * size(rng, 1, 4))
    return folder / "a.csv", dict(CAMERA)


def nested_json(rng: Random, folder: Path) -> Made:
    n = size(rng, 10, 3e5)
    value = rng.choice((
        b"[" * n + b"]" * n, b'{"a":' * (n // 4) + b"1" + b"}" * (n // 4), b"[" + b"[]," * n + b"[]]", b"1" * n,
        b"[" + b"{}," * n + b"{}]", b'"' + b"\\u0000" * (n // 6) + b'"', b"[" + b'{"id":1,"x_m":1,"y_m":1},' * (n // 25)
        + b"{}]", b"[" + b'{"a":1,"b":2},' * (n // 14) + b'{"a":1,"b":2}]', b"[" + b"{}," * min(n, 400) + b"{}]",
    ))  # fmt: skip
    field = rng.choice((b"persons", b"pairs", b"extra", b"engine", b"ts"))
    line = MESSAGE.replace(b'"persons":[]', b'"%b":%b' % (field, value))
    (folder / "a.jsonl").write_bytes(MESSAGE + line * size(rng, 1, 3))
    return folder / "a.jsonl", dict(CAMERA)


def many_people(rng: Random, folder: Path) -> Made:
    """Frames whose pairs grow with the square of their people."""
    n, rows = size(rng, 10, 2e3), size(rng, 1, 8)
    if rng.random() < 0.3:
        persons = [{"id": i, "x_m": 1.0, "y_m": 1.0} for i in range(n)]
        (folder / "a.jsonl").write_text(MESSAGE.decode().replace("[]", json.dumps(persons)) * rows)
        return folder / "a.jsonl", dict(CAMERA)
    same = rng.random() < 0.5
    people = ", ".join(PERSON if same else PERSON.replace("'11'", f"'{i}'") for i in range(n))
    lines = [f'1.0,2026-11-09 09:00:{k:02},{n},0,0.9,"[{people}]","[]"\n' for k in range(rows)]
    (folder / "log.csv").write_bytes(LOG_HEAD + "".join(lines).encode())
    return folder / "log.csv", dict(CAMERA)


def python_lists(rng: Random, folder: Path) -> Made:
    n = size(rng, 10, 2e5)
    cell = rng.choice((
        "[" + "1," * n + "]", "[" * min(n, 50_000), "[" + "{}," * n + "]", "-" * n + "1", "1+" * n + "1", "(" * n,
        "[" + "np.float32(1)," * (n // 14) + "]", "['" + "x" * n + "']", "9" * n, "[" + "'a'" * n + "]",
    ))  # fmt: skip
    (folder / "log.csv").write_bytes(LOG_HEAD + f'1.0,2026-11-09 09:00:00,1,0,0.9,"{cell}","[]"\n'.encode())
    return folder / "log.csv", dict(CAMERA)


# -- archives and folders ---------------------------------------------------------------------------------------------


def _members(rng: Random) -> tuple[dict[str, bytes], dict[str, Any]]:
    n, n_bytes = size(rng, 1, 300), size(rng, 1e2, 2e7 if rng.random() < 0.02 else 1e6)
    n_bytes = min(n_bytes, 40_000_000 // n)
    kind = rng.choice(("wildtrack", "smart-social-distancing", "motchallenge"))
    if kind == "wildtrack":
        unit = rng.choice((b"{},", b" ", b"[],", b'{"personID":1,"positionID":1},', b"[", b'{"views":[]},'))
        data = b"[" + unit * (n_bytes // len(unit)) + b"{}]"
        return {f"annotations_positions/{i:08}.json": data for i in range(n)}, {**CLOCK, "format": kind}
    if kind == "motchallenge":
        head, lines = SAME["gt.txt"]
        line = rng.choice(lines)
        ini = f"[Sequence]\nframeRate=25\nseqLength={size(rng, 1, 1e7)}\n".encode()
        n = min(n, 20)
        data = head + line * (n_bytes // len(line))
        files = {f"HALL-{i:02}/gt/gt.txt": data for i in range(n)}
        return {**files, **{f"HALL-{i:02}/seqinfo.ini": ini for i in range(n)}}, {"start": START_MS, "format": kind}
    line = rng.choice(SAME["log.csv"][1])
    data = LOG_HEAD + line * (n_bytes // len(line))
    return {f"hall/objects_log/{i}.csv": data for i in range(n)}, {**CAMERA, "format": kind}


def zip_members(rng: Random, folder: Path) -> Made:
    files, options = _members(rng)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    packed = bytearray(out.getvalue())
    if rng.random() < 0.3:  # the size after decompression that headers state
        stated = len(next(iter(files.values()))).to_bytes(4, "little")
        packed = packed.replace(stated, rng.choice((10, 1000, 2**31)).to_bytes(4, "little"))
    (folder / "a.zip").write_bytes(packed)
    return folder / "a.zip", options


def tar_members(rng: Random, folder: Path) -> Made:
    files, options = _members(rng)
    with tarfile.open(folder / "a.tar.gz", "w:gz", compresslevel=6) as archive:
        for name, data in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    return folder / "a.tar.gz", options


def folder_members(rng: Random, folder: Path) -> Made:
    files, options = _members(rng)
    for name, data in list(files.items())[:50]:
        path = folder / "in" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data[: max(300, 2_000_000 // len(files))])
    return folder / "in", options


BOMBS: Mapping[str, Maker] = {
    "Parquet: a giant cell": giant_cell,
    "Parquet: constant rows": constant_rows,
    "Parquet: rows that are all bad": bad_rows,
    "Parquet: long texts in a dictionary": dictionary_bomb,
    "Parquet: texts that repeat the one before": repeated_prefixes,
    "Parquet: cells of a fixed length": fixed_cells,
    "Parquet: lists in a row": nested_column,
    "Parquet: many columns": many_columns,
    "Parquet: many row groups": many_row_groups,
    "Parquet: sizes that lie": lying_sizes,
    "gz, bz2, zst: the same again and again": compressed_text,
    "text: the same again and again": plain_text,
    "text: wide rows": wide_text,
    "text: long cells": large_cells,
    "JSON: nested, wide, long": nested_json,
    "frames with many people": many_people,
    "object log: large Python lists": python_lists,
    "zip: large, many, lying members": zip_members,
    "tar.gz: large, many members": tar_members,
    "folder: large, many files": folder_members,
}


def make_bomb(number: int, *, seed: int, folder: Path) -> tuple[str, Path, dict[str, Any]]:
    """Write bomb `number` of a seed; return its kind, its path and the options it is read with."""
    kind = sorted(BOMBS)[number % len(BOMBS)]
    path, options = BOMBS[kind](Random(f"bomb/{seed}/{number}"), folder)
    return kind, path, options
