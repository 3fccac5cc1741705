"""Segments of the spool: the same rows come back, of either kind, and a damaged one is refused or harmless."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from stored_rows import HOUR, NINE, frame, pair, person, stored, table

from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.owners import OWNER, owned_by
from vsd_analytics.store.part_files import engines_in, with_every_column
from vsd_analytics.store.segments import About, about, owners_in, read_segment, segment_bytes, sent_bytes
from vsd_analytics.store.store import Store

Write = Callable[[TableName, pa.Table, Sequence[str]], pa.Buffer]
KINDS = [pytest.param(segment_bytes, ".arrow", id="arrow"), pytest.param(sent_bytes, ".parquet", id="parquet")]
ROWS = {
    "frames": [frame(NINE + HOUR), frame(NINE, None, camera="cam-2")],
    "observations": [person(NINE + HOUR), person(NINE, None, None), person(NINE, "b", -5, camera="cam-2")],
    "pairs": [pair(NINE + HOUR), pair(NINE, None), pair(NINE, "a", "c", mm=7)],
}


def written(folder: Path, data: pa.Buffer, suffix: str) -> Path:
    path = folder / f"{durable.digest(data)}{suffix}"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(("write", "suffix"), KINDS)
@pytest.mark.parametrize("name", TABLES)
def test_a_segment_gives_back_its_rows_and_notes_their_ends(
    tmp_path: Path, name: TableName, write: Write, suffix: str
) -> None:
    rows = table(name, ROWS[name])
    path = written(tmp_path, write(name, rows, ["b 2", "a 1"]), suffix)
    read = read_segment(path)
    assert with_every_column(name, read).cast(SCHEMAS[name]).replace_schema_metadata().equals(rows)
    assert engines_in(read.schema.metadata) == ["b 2", "a 1"]
    assert about(path) == About(len(ROWS[name]), NINE, NINE + HOUR)
    assert read_segment(path, columns=["ts"]).column_names == ["ts"]


@pytest.mark.parametrize(("write", "suffix"), KINDS)
def test_owners_are_written_where_there_is_one(tmp_path: Path, write: Write, suffix: str) -> None:
    rows = table("observations", ROWS["observations"])
    several = pa.concat_tables([owned_by("", rows.slice(0, 1)), owned_by("0000000000000001", rows.slice(1))])
    path = written(tmp_path, write("observations", several, []), suffix)
    assert read_segment(path)[OWNER].to_pylist() == ["", "0000000000000001", "0000000000000001"]
    assert owners_in(path) == {"", "0000000000000001"}
    path = written(tmp_path, write("observations", owned_by("", rows), []), suffix)
    assert OWNER not in read_segment(path).column_names
    assert owners_in(path) == {""}


def test_rows_with_dictionaries_of_several_pieces_are_the_same_rows(tmp_path: Path) -> None:
    rows = table("observations", ROWS["observations"])
    texts = {"camera_id", "track_id", "quality"}
    pieces = [rows.slice(i, 1) for i in range(rows.num_rows)]
    coded = pa.concat_tables(
        pa.table({c: piece[c].dictionary_encode() if c in texts else piece[c] for c in rows.column_names})
        for piece in pieces
    )
    for kind in KINDS:
        write, suffix = kind.values
        read = read_segment(written(tmp_path, write("observations", coded, []), suffix))
        whole = with_every_column("observations", read)
        assert whole.cast(SCHEMAS["observations"]).replace_schema_metadata().equals(rows)


def test_a_spool_of_both_kinds_is_folded_as_one(tmp_path: Path) -> None:
    rows = table("observations", ROWS["observations"])
    for folder, as_parquet in ((tmp_path / "a", False), (tmp_path / "b", True)):
        store = Store(folder, site_id="shop")
        store.append("observations", rows.slice(0, 2), engines=["a 1"], import_id="0000000000000001")
        if as_parquet:
            (folder / "live" / "observations").mkdir(exist_ok=True)
            written(folder / "live" / "observations", sent_bytes("observations", rows.slice(1), ["b 2"]), ".parquet")
        else:
            store.append("observations", rows.slice(1), engines=["b 2"])
        assert (store.n_spooled(), store.fold().n_new, store.n_spooled()) == (4, 3, 0)
    assert stored(tmp_path / "a") == stored(tmp_path / "b")
    names = [[p.path.name for p in Store(tmp_path / f, site_id="shop").parts("observations")] for f in "ab"]
    assert names[0] == names[1]


def test_a_damaged_segment_is_refused_or_harmless(tmp_path: Path) -> None:
    rows = table("observations", [person(NINE + i, f"t{i % 7}", i) for i in range(300)])
    data = segment_bytes("observations", owned_by("0000000000000001", rows), ["a 1"]).to_pybytes()
    path, rng = tmp_path / "0123456789abcdef.arrow", np.random.default_rng(5)
    n_refused = 0
    for bit in rng.integers(0, 8 * len(data), 2000).tolist():
        changed = bytearray(data)
        changed[bit // 8] ^= 1 << bit % 8
        path.write_bytes(changed)
        for read in (
            lambda: read_segment(path).unify_dictionaries().nbytes,
            lambda: about(path),
            lambda: owners_in(path),
        ):
            try:
                read()
            except (pa.ArrowException, ValueError, OSError):
                n_refused += 1
    assert n_refused > 100
    path.write_bytes(data[:-100])
    with pytest.raises((pa.ArrowException, OSError)):
        read_segment(path)
