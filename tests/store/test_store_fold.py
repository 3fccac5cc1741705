"""Append and fold: at least once in, exactly once in the table, the same bytes whatever came in which order."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stored_rows import HOUR, NINE, frame, pair, part_names, person, stored, table

from vsd_analytics.errors import StoreError
from vsd_analytics.schema import TableName
from vsd_analytics.store import spans
from vsd_analytics.store.part_files import engines_of
from vsd_analytics.store.store import Store, TableCounts


def _folded(root: Path, *batches: list[dict[str, Any]], name: TableName = "observations") -> TableCounts:
    store = Store(root, site_id="shop")
    for batch in batches:
        store.append(name, table(name, batch))
    return store.fold().tables.get(name, TableCounts())


def _keys(rows: list[dict[str, Any]]) -> list[tuple[Any, ...]]:
    return [(r["camera_id"], r["ts"], r["track_id"], r["x_mm"]) for r in rows]


def test_what_was_acknowledged_is_in_the_spool_before_and_in_its_hour_after_a_fold(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", site_id="shop")
    assert store.append("observations", table("observations", [person(), person(NINE + HOUR)])) == 2
    assert store.n_spooled() == 2
    assert store.parts("observations") == []
    result = store.fold()
    assert result.tables["observations"] == TableCounts(2, 0, 0)
    assert result.hours == {NINE // HOUR, NINE // HOUR + 1}
    assert store.n_spooled() == 0
    assert [p.hour for p in store.parts("observations")] == [NINE // HOUR, NINE // HOUR + 1]
    folders = {p.path.parent.relative_to(tmp_path).as_posix() for p in store.parts("observations")}
    assert folders == {"store/observations/site=shop/date=2026-11-09"}
    assert store.hours() == (NINE // HOUR, NINE // HOUR + 1)
    assert store.damaged() == []


def test_an_hour_is_utc_and_ends_before_the_next(tmp_path: Path) -> None:
    midnight = NINE // (24 * HOUR) * (24 * HOUR)
    _folded(tmp_path, [person(midnight - 1), person(midnight), person(midnight + HOUR - 1)])
    names = [n.split("/")[2:] for n in part_names(tmp_path)]
    assert [(day, name[:2]) for day, name in names] == [("date=2026-11-08", "23"), ("date=2026-11-09", "00")]


def test_nothing_appended_is_nothing_written(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", site_id="shop")
    assert store.append("frames", table("frames", [])) == 0
    assert store.fold().tables == {}
    assert store.hours() is None
    assert list(tmp_path.iterdir()) == []


def test_folding_twice_is_folding_once(tmp_path: Path) -> None:
    _folded(tmp_path, [person(track=t) for t in "abc"])
    before = part_names(tmp_path)
    assert _folded(tmp_path) == TableCounts()
    assert part_names(tmp_path) == before


def test_a_redelivered_batch_counts_nothing_and_writes_nothing(tmp_path: Path) -> None:
    batch = [person(track=t, x_mm=i) for i, t in enumerate("abc")]
    _folded(tmp_path, batch)
    before = part_names(tmp_path)
    assert _folded(tmp_path, batch) == TableCounts(0, 3, 0)
    assert part_names(tmp_path) == before


def test_the_same_batch_twice_before_a_fold_is_one_file_of_the_spool(tmp_path: Path) -> None:
    assert _folded(tmp_path, [person()], [person()]) == TableCounts(1, 0, 0)
    assert _keys(stored(tmp_path)["observations"]) == _keys([{**person(), "ts": _ts()}])


def test_the_same_record_in_two_batches_is_known_and_another_value_is_a_second_sighting(tmp_path: Path) -> None:
    found = _folded(tmp_path, [person(), person(track="b")], [person(), person(track="b", x_mm=7)])
    assert found == TableCounts(2, 1, 1)
    assert [(r["track_id"], r["x_mm"]) for r in stored(tmp_path)["observations"]] == [("a", 1000), ("b", 7)]


def test_the_first_write_wins_over_later_deliveries_of_a_key(tmp_path: Path) -> None:
    _folded(tmp_path, [person(x_mm=900)])
    assert _folded(tmp_path, [person(x_mm=5)]) == TableCounts(0, 1, 0)
    assert [r["x_mm"] for r in stored(tmp_path)["observations"]] == [900]


def test_late_data_make_an_extra_part_with_the_new_rows_only(tmp_path: Path) -> None:
    _folded(tmp_path, [person(), person(NINE + 200)])
    before = part_names(tmp_path)
    assert _folded(tmp_path, [person(), person(NINE + 100)]) == TableCounts(1, 1, 0)
    after = part_names(tmp_path)
    assert set(before) < set(after)
    assert len(after) == 2
    assert len(stored(tmp_path)["observations"]) == 3


def test_people_without_track_are_known_by_where_they_are(tmp_path: Path) -> None:
    batch = [person(track=None, x_mm=x, index=i) for i, x in enumerate((1, 2, 3))]
    assert _folded(tmp_path, batch) == TableCounts(3, 0, 0)
    other_order = [person(track=None, x_mm=x, index=i) for i, x in enumerate((3, 1, 2, 4))]
    assert _folded(tmp_path, other_order) == TableCounts(1, 3, 0)


def test_a_missing_track_is_not_the_track_of_another_missing_one_elsewhere(tmp_path: Path) -> None:
    found = _folded(tmp_path, [person(track=None, camera="cam-1"), person(track=None, camera="cam-2")])
    assert found == TableCounts(2, 0, 0)


def test_frames_are_known_by_camera_and_instant(tmp_path: Path) -> None:
    assert _folded(tmp_path, [frame(), frame(camera="cam-2"), frame(NINE + 1)], name="frames") == TableCounts(3, 0, 0)
    assert _folded(tmp_path, [frame(n_persons=4)], name="frames") == TableCounts(0, 1, 0)


def test_pairs_are_known_by_both_tracks_or_by_both_members(tmp_path: Path) -> None:
    batch = [pair(), pair(b="c"), pair(a=None, b=None), pair(a=None, b=None, members=(0, 2))]
    assert _folded(tmp_path, batch, name="pairs") == TableCounts(4, 0, 0)
    assert _folded(tmp_path, [*batch, pair(b="d")], name="pairs") == TableCounts(1, 4, 0)


def test_pairs_without_ids_at_one_instant_are_distinguished_by_their_distance(tmp_path: Path) -> None:
    batch = [pair(a=None, b=None, mm=1500), pair(a=None, b=None, mm=1501)]
    assert _folded(tmp_path, batch, name="pairs") == TableCounts(2, 0, 0)
    assert _folded(tmp_path, batch, name="pairs") == TableCounts(0, 2, 0)


rows_of_two_hours = st.lists(
    st.builds(
        person,
        ts=st.sampled_from([NINE, NINE + 40, NINE + HOUR]),
        track=st.sampled_from(["a", "b", None]),
        x_mm=st.sampled_from([1, 2, None]),
        camera=st.sampled_from(["cam-1", "cam-2"]),
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=rows_of_two_hours, seed=st.integers(0, 99))
def test_order_and_batches_do_not_change_a_byte(
    rows: list[dict[str, Any]], seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    shuffled = random.Random(seed).sample(rows, len(rows))
    cut = seed % (len(rows) + 1)
    one, other = tmp_path_factory.mktemp("one"), tmp_path_factory.mktemp("other")
    counts = _folded(one, rows)
    assert _folded(other, shuffled[:cut], shuffled[cut:]).n_new == counts.n_new
    assert part_names(one) == part_names(other)


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(batches=st.lists(rows_of_two_hours, max_size=4))
def test_every_key_is_stored_exactly_once_however_it_is_delivered(
    batches: list[list[dict[str, Any]]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("store")
    total = TableCounts()
    for batch in batches:
        total += _folded(root, batch)
    sent = [r for batch in batches for r in batch]
    wanted = {(r["camera_id"], r["ts"], r["track_id"], None if r["track_id"] else r["x_mm"]) for r in sent}
    assert total.n_new == len(wanted) == len(stored(root)["observations"])
    assert total.n_new + total.n_known + total.n_second == len(sent)


def test_busy_days_folded_hour_by_hour_are_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [person(NINE + k * HOUR // 2, track=str(k % 3)) for k in range(-6, 14)]
    _folded(tmp_path / "days", rows, rows[::2])
    monkeypatch.setattr(spans, "SPAN_ROWS", 5)
    assert _folded(tmp_path / "hours", rows[::2], rows) == TableCounts(20, 10, 0)
    assert part_names(tmp_path / "days") == part_names(tmp_path / "hours")


def test_progress_reaches_the_number_of_spooled_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spans, "SPAN_ROWS", 5)
    store = Store(tmp_path, site_id="shop")
    store.append("observations", table("observations", [person(NINE + k * HOUR) for k in range(9)]))
    done: list[int] = []
    store.fold(on_rows=done.append)
    assert sum(done) == 9


def test_engines_travel_in_the_metadata(tmp_path: Path) -> None:
    store = Store(tmp_path, site_id="shop")
    store.append("frames", table("frames", [frame()]), engines=["b 2", "a 1", "a 1"])
    store.fold()
    assert engines_of(store.parts("frames")[0].path) == ["a 1", "b 2"]


def test_days_folded_together_are_the_parts_of_days_folded_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [person(NINE + k * HOUR * 5, track=str(k % 3)) for k in range(40)]
    folded = []
    for n_rows in (1_000_000, 8):
        monkeypatch.setattr(spans, "SPAN_ROWS", n_rows)
        store = Store(tmp_path / str(n_rows), site_id="shop")
        for k in range(0, 40, 4):
            store.append("observations", table("observations", rows[k : k + 4]), engines=[f"acme {k}"])
        folded.append(store.fold().tables["observations"])
    assert folded[0] == folded[1] == TableCounts(40, 0, 0)
    assert part_names(tmp_path / "1000000") == part_names(tmp_path / "8")
    engines = [engines_of(part.path) for part in store.parts("observations")]
    assert engines[:4] == [["acme 0"]] * 3 + [["acme 0", "acme 4"]], "the engines of a part's own day, of no other"


def test_foreign_files_are_ignored(tmp_path: Path) -> None:
    _folded(tmp_path, [person()])
    day = next((tmp_path / "observations").rglob("date=*"))
    for path in (day / "notes.txt", day / "09-short.parquet", day.parent / "date=never" / "09-x.parquet"):
        path.parent.mkdir(exist_ok=True)
        path.write_text("not ours")
    (tmp_path / "live" / "observations" / "mine.parquet").write_text("not ours")
    (tmp_path / "observations" / "site=other" / "date=2026-11-09").mkdir(parents=True)
    store = Store(tmp_path, site_id="shop")
    assert len(store.parts("observations")) == 1
    assert store.damaged() == []
    assert _folded(tmp_path, [person(track="z")]) == TableCounts(1, 0, 0)


@pytest.mark.parametrize("where", [0.1, 0.5, 0.95])
def test_the_hash_in_the_name_detects_one_flipped_bit(tmp_path: Path, where: float) -> None:
    _folded(tmp_path, [person(track=str(k), x_mm=k) for k in range(50)])
    store = Store(tmp_path, site_id="shop")
    part = store.parts("observations")[0].path
    data = bytearray(part.read_bytes())
    data[int(len(data) * where)] ^= 1
    part.write_bytes(data)
    assert store.damaged() == [part]


def test_a_damaged_file_of_the_spool_stops_the_fold_and_nothing_is_lost(tmp_path: Path) -> None:
    store = Store(tmp_path, site_id="shop")
    store.append("observations", table("observations", [person()]))
    store.append("observations", table("observations", [person(track="b")]))
    segment = sorted((tmp_path / "live" / "observations").iterdir())[0]
    segment.write_bytes(segment.read_bytes()[:-7])
    with pytest.raises(StoreError) as caught:
        store.fold()
    assert caught.value.code == "E302"
    assert caught.value.where is not None
    assert caught.value.where.file == str(segment)
    assert len(list((tmp_path / "live" / "observations").iterdir())) == 2


def test_a_damaged_part_of_the_hour_is_named_when_it_cannot_be_read(tmp_path: Path) -> None:
    _folded(tmp_path, [person()])
    part = Store(tmp_path, site_id="shop").parts("observations")[0].path
    part.write_bytes(part.read_bytes()[:-9])
    with pytest.raises(StoreError) as caught:
        _folded(tmp_path, [person(track="b")])
    assert caught.value.where is not None
    assert caught.value.where.file == str(part)


def _ts() -> Any:
    from datetime import UTC, datetime

    return datetime.fromtimestamp(NINE / 1000, tz=UTC)
