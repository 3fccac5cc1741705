"""How millimetres of a part are encoded: whichever takes less space, and with the same rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vsd_analytics.schema import SCHEMAS
from vsd_analytics.store.part_files import part_bytes, read_part

N = 20_000


def records(x_mm: list[int | None]) -> pa.Table:
    schema, n = SCHEMAS["observations"], len(x_mm)
    nothing = [None] * n
    values = [["cam"] * n, list(range(n)), [0] * n, nothing, x_mm, [7] * n, nothing, nothing, ["metric"] * n]
    columns = [
        pa.array(c, pa.int64()).cast(f.type) if f.name == "ts" else pa.array(c, f.type)
        for c, f in zip(values, schema, strict=True)
    ]
    return pa.table(columns, schema=schema)


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
