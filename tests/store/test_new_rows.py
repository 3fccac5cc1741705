"""What a fold takes of the spool: by hashes of keys the same as by the keys themselves, in the order of a part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.store import new_rows
from vsd_analytics.store.duck import connect
from vsd_analytics.store.layout import HOUR_MS, segment_paths
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.spans import FoldSpan
from vsd_analytics.store.store import Store

HOUR = 497_000


def rows(table: TableName, seed: int, n: int = 400) -> pa.Table:
    """Return records of two hours with few different values, so that many keys and many whole rows come again."""
    rng = np.random.default_rng(seed)

    def column(field: pa.Field) -> pa.Array:
        is_null = rng.random(n) < (0.3 if field.nullable else 0)
        if field.name == "ts":
            return pa.array(HOUR * HOUR_MS + 1_000_000 * rng.integers(0, 7, n), field.type)
        if pa.types.is_string(field.type):
            return pa.array(np.array(["b", "a", "ä", "Z"])[rng.integers(0, 4, n)], field.type, mask=is_null)
        if pa.types.is_floating(field.type):
            values = np.array([-0.0, 0.0, 1.25], np.float32)[rng.integers(0, 3, n)]
            return pa.array(values, field.type, mask=is_null)
        return pa.array(rng.integers(-1, 2, n), field.type, mask=is_null)

    return pa.table([column(f) for f in SCHEMAS[table]], schema=SCHEMAS[table])


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("seed", [1, 2])
def test_rows_found_by_hashes_are_those_found_by_keys(
    table: TableName, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path / "store", site_id="shop")
    store.append(table, rows(table, seed, n=60), import_id="before")
    store.fold()
    for k, import_id in enumerate(("", "one", "two")):
        store.append(table, rows(table, 10 * seed + k), import_id=import_id)
    span = FoldSpan({HOUR // 24: segment_paths(store.root, table)}, HOUR, HOUR + 1)
    known = [p.path for p in store.parts(table)]
    found = new_rows.new_rows(table, span, known=known, noted=[])
    monkeypatch.setattr(new_rows, "_key_hashes", lambda _table, keys: np.zeros(keys.num_rows, np.uint64))
    by_keys = new_rows.new_rows(table, span, known=known, noted=[])
    assert found.fresh.to_pylist() == by_keys.fresh.to_pylist()  # dictionaries may number the same texts otherwise
    assert found.again.to_pylist() == by_keys.again.to_pylist()
    for name in ("n_read", "n_second", "engines"):
        assert getattr(found, name) == getattr(by_keys, name), name
    assert 0 < found.fresh.num_rows < found.n_read == 1200
    assert found.again.num_rows > 0
    with connect() as con:
        con.register("fresh", found.fresh)
        columns = ", ".join([*SCHEMAS[table].names, OWNER])
        order = f"cast(floor(epoch_ms(ts) / {HOUR_MS}) as bigint), {columns}"
        in_order = con.sql(f"select * from fresh order by {order}").to_arrow_table()
    assert found.fresh.to_pylist() == in_order.to_pylist()
