"""A column that older files lack: files without a value in it are as they were, and files with and without it mix."""

from __future__ import annotations

from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from stored_rows import HOUR, NINE, person, table

from vsd_analytics.cluster.parts_of_nodes import HandedPart
from vsd_analytics.schema import LATER
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.store import durable
from vsd_analytics.store.outbox import make_ready
from vsd_analytics.store.part_files import part_bytes, read_part
from vsd_analytics.store.segments import schema_of, segment_bytes, sent_bytes
from vsd_analytics.store.store import Store
from vsd_analytics.store.undo_import import undo_import

OLD = [person(NINE + i, "a", i) for i in range(3)]
TAGGED = [{**person(NINE + i, "b", i), "is_staff": tag} for i, tag in enumerate((True, False, None))]


def rows(of: list[dict[str, object]]) -> pa.Table:
    return table("observations", of)


def tags(store: Store) -> dict[str, list[bool | None]]:
    """Return the tags of each track, in order of time."""
    found: dict[str, list[bool | None]] = {}
    read = [row for p in store.parts("observations") for row in read_part(p.path, "observations").to_pylist()]
    for row in sorted(read, key=lambda r: r["ts"]):
        found.setdefault(row["track_id"], []).append(row["is_staff"])
    return found


@pytest.mark.parametrize("write", [part_bytes, segment_bytes, sent_bytes])
def test_a_file_without_tags_has_the_bytes_it_had_before_there_were_tags(write: object) -> None:
    whole = rows(OLD)
    assert write("observations", whole, []).equals(write("observations", whole.drop_columns([*LATER]), []))  # type: ignore[operator]


def test_old_and_new_files_are_one_table(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", site_id="shop")
    store.append("observations", rows(OLD))
    store.fold()
    [old] = store.parts("observations")
    assert not LATER & {*pq.read_schema(old.path).names}
    store.append("observations", rows([person(NINE + HOUR, "a")]), import_id="0000000000000001")
    store.append("observations", rows([*TAGGED, OLD[0]]), import_id="0000000000000002")
    suffixes = {LATER & {*schema_of(p).names} for p in (tmp_path / "store/live/observations").iterdir()}
    assert suffixes == {frozenset(), LATER}
    assert store.fold().n_new == 4
    assert tags(store) == {"a": [None] * 4, "b": [True, False, None]}
    assert {p.path for p in store.parts("observations")} >= {old.path}, "no file is written again"
    glob = f"read_parquet('{tmp_path}/store/observations/**/*.parquet', union_by_name = true)"
    counted = duckdb.sql(f"select count(*), count(is_staff), count(*) filter (is_staff) from {glob}").fetchall()
    assert counted == [(7, 2, 1)]


def test_a_record_keeps_its_first_tag_and_the_next_when_the_first_import_is_taken_back(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", site_id="shop")
    for import_id, tag in (("0000000000000001", None), ("0000000000000002", True)):
        store.append("observations", rows([{**OLD[0], "is_staff": tag}]), import_id=import_id)
        store.fold()
    assert tags(store) == {"a": [None]}
    [part] = store.parts("observations")
    undo_import(store.root, part.path, "observations", "0000000000000001", order={})
    assert tags(store) == {"a": [True]}


def test_a_node_hands_on_tags_and_records_without(tmp_path: Path) -> None:
    outbox = tmp_path / "outbox"
    for of in (OLD, TAGGED):
        data = segment_bytes("observations", rows(of), [])
        path = outbox / "live/observations" / f"{durable.digest(data)}.arrow"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    assert make_ready(outbox) == 6
    [ready] = (outbox / "ready/observations").iterdir()
    for path, found in ((ready, [True, False]), (tmp_path / "old.parquet", [])):
        if not path.exists():
            path.write_bytes(sent_bytes("observations", rows(OLD), []))
        part = HandedPart(path, "observations", name="x", settings=DEFAULTS)
        handed = [tag for piece in part.pieces() for tag in piece.rows["is_staff"].to_pylist()]
        assert [tag for tag in handed if tag is not None] == found
