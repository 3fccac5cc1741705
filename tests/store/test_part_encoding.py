"""How a part is encoded: in little space, with the same rows, and the same bytes for the same rows."""

from __future__ import annotations

from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from vsd_analytics.schema import LATER, SCHEMAS
from vsd_analytics.store.part_files import engines_of, part_bytes, read_part
from vsd_analytics.warehouse.stored_records import NotedColumns

N = 20_000


def records(x_mm: list[int | None]) -> pa.Table:
    schema, n = SCHEMAS["observations"], len(x_mm)
    nothing = [None] * n
    values = [["cam"] * n, list(range(n)), [0] * n, nothing, x_mm, [7] * n, nothing, nothing, ["metric"] * n, nothing]
    columns = [
        pa.array(c, pa.int64()).cast(f.type) if f.name == "ts" else pa.array(c, f.type)
        for c, f in zip(values, schema, strict=True)
    ]
    return pa.table(columns, schema=schema)


def bare(schema: pa.Schema) -> pa.Schema:
    """Return the columns of a file without a value in those of `LATER`."""
    return pa.schema([f for f in schema if f.name not in LATER])


def spread(seed: int, *, step_mm: int) -> list[int]:
    """Return places along 15 m, in steps."""
    return (np.random.default_rng(seed).integers(-3000, 12_000, N) // step_mm * step_mm).tolist()


@pytest.mark.parametrize(
    ("x_mm", "is_dictionary"),
    [
        (spread(1, step_mm=1), False),  # whole millimetres, as of an engine
        (spread(2, step_mm=10), True),  # whole centimetres
        (spread(3, step_mm=10)[: N // 2] + [None] * (N // 2), True),
        ([int(x) for x in np.random.default_rng(4).integers(-(2**31), 2**31, N)], False),  # more than a table counts
        ([None] * N, False),
    ],
)
def test_millimetres_have_the_smaller_encoding_and_their_values(
    tmp_path: Path, x_mm: list[int | None], is_dictionary: bool
) -> None:
    rows = records(x_mm)
    path = tmp_path / "part.parquet"
    path.write_bytes(part_bytes("observations", rows, ["engine"]))
    assert read_part(path, "observations").equals(rows)
    column = pq.read_metadata(path).row_group(0).column(rows.column_names.index("x_mm"))
    assert ("RLE_DICTIONARY" in column.encodings) == is_dictionary
    assert ("DELTA_BINARY_PACKED" in column.encodings) != is_dictionary
    options = {"compression": "zstd", "compression_level": 4}
    one = rows.select(["x_mm"])
    pq.write_table(one, tmp_path / "a", use_dictionary=True, **options)
    pq.write_table(one, tmp_path / "b", use_dictionary=False, column_encoding="DELTA_BINARY_PACKED", **options)
    sizes = [(tmp_path / name).stat().st_size for name in "ab"]
    if any(x is not None for x in x_mm):
        assert (sizes[0] < sizes[1]) == is_dictionary


def test_a_part_has_texts_and_the_same_bytes_whether_its_rows_have_texts_or_dictionaries(tmp_path: Path) -> None:
    rows = records([1, 2, 3, 4])
    few = pa.array(["cam-2", "cam-2", "cam-1", "cam-1"]), pa.array(["metric", "body", "metric", "metric"])
    for name, values in zip(("camera_id", "quality"), few, strict=True):
        rows = rows.set_column(rows.column_names.index(name), rows.schema.field(name), values)
    names = pa.array(["others", "cam-1", "metric", "cam-2", "body"])
    coded = rows
    for name in ("camera_id", "quality"):
        numbers = pc.index_in(rows[name].combine_chunks(), names)
        coded = coded.set_column(rows.column_names.index(name), name, pa.DictionaryArray.from_arrays(numbers, names))
    data = part_bytes("observations", rows, ["engine"])
    assert part_bytes("observations", coded, ["engine"]).equals(data)
    path = tmp_path / "part.parquet"
    path.write_bytes(data)
    assert engines_of(path) == ["engine"]
    with pq.ParquetFile(path) as file:
        assert file.schema_arrow.equals(bare(SCHEMAS["observations"]))
        assert file.read().replace_schema_metadata().equals(rows.drop_columns([*LATER]))
    assert duckdb.read_parquet(str(path)).project("camera_id, quality").fetchall() == [
        ("cam-2", "metric"), ("cam-2", "body"), ("cam-1", "metric"), ("cam-1", "metric")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("ids", "is_known", "are_alike"), [("abab", True, True), ("a  b", False, False), ("    ", False, True)]
)
def test_a_part_notes_how_many_track_ids_are_missing(tmp_path: Path, ids: str, is_known: bool, are_alike: bool) -> None:
    rows = records([1, 2, 3, 4])
    tracks = pa.array([i if i != " " else None for i in ids], pa.string())
    rows = rows.set_column(rows.column_names.index("track_id"), rows.schema.field("track_id"), tracks)
    path = tmp_path / "part.parquet"
    path.write_bytes(part_bytes("observations", rows, []))
    noted = NotedColumns(pq.read_metadata(path))
    assert (noted.is_known("track_id"), noted.are_alike("track_id")) == (is_known, are_alike)
    assert noted.is_empty("track_id") == (ids == "    ")
    assert read_part(path, "observations").equals(rows)
