"""The short cuts of facts that are arrays: each gives what the longer way gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from benchmarks.made_up_site import write_site
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vsd_analytics.warehouse.accelerated import camera_days, floor_cells, pairs
from vsd_analytics.warehouse.accelerated.columns import counted, one_alike, one_of_each, order_by, summed
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.graphs import least_connected
from vsd_analytics.warehouse.rules import RULES
from vsd_analytics.warehouse.stored_records import NotedColumns


@pytest.mark.parametrize("n_values", [1, 3, 50])
@pytest.mark.parametrize("length", [1, 20, 400])
def test_runs_are_in_the_order_of_their_rows(n_values: int, length: int) -> None:
    rng = np.random.default_rng(n_values * 1000 + length)
    of_run = rng.integers(0, n_values, 60)
    equal = np.repeat(of_run, length)
    rising = np.concatenate([np.sort(rng.integers(0, 40, length)) + 40 * run for run in of_run])
    for key in (equal, rising, rng.permutation(equal)):
        other = rng.integers(0, 2, len(key))
        assert order_by(key).tolist() == np.argsort(key, kind="stable").tolist()
        assert order_by(key, other).tolist() == np.lexsort((other, key)).tolist()
        found = summed({"key": key}, {"n": np.ones(len(key), dtype=np.int64), "other": other})
        there = np.unique(key)
        assert found["key"].tolist() == there.tolist()
        assert found["n"].tolist() == [int((key == k).sum()) for k in there]
        assert found["other"].tolist() == [int(other[key == k].sum()) for k in there]


@pytest.mark.parametrize("n_far", [0, 200, 5000])
def test_rows_almost_in_order_are_sorted_as_all_others(n_far: int) -> None:
    """People in order of frames but not within them, and some rows anywhere."""
    rng = np.random.default_rng(n_far)
    key = np.repeat(np.arange(4000), 6) * 1_000_000 + rng.integers(0, 5, 24_000)
    far = rng.choice(24_000, n_far, replace=False)
    key[far] = key[rng.permutation(far)]
    assert order_by(key).tolist() == np.argsort(key, kind="stable").tolist()
    other = rng.integers(0, 2, len(key))
    assert order_by(key, other).tolist() == np.lexsort((other, key)).tolist()


@pytest.mark.parametrize("n_frames", [1, 2, 3, 4, 50, 51])
def test_the_frame_interval_is_the_median_step(n_frames: int) -> None:
    rng = np.random.default_rng(n_frames)
    ts = rng.integers(0, 200_000, n_frames)
    steps = np.diff(np.unique(ts))
    known = np.floor(np.median(steps) + 0.5) if len(steps) else 1000
    assert camera_days._interval_ms(None, [ts, ts[:2]], RULES) == known
    assert camera_days._interval_ms(40, [ts], RULES) == 40


@pytest.mark.parametrize("n_values", [1, 2, 30])
def test_rows_with_equal_keys_are_of_one_row(n_values: int) -> None:
    """Of a place, most rows have the keys of its last row, some have others, and some of these are alike."""
    rng = np.random.default_rng(n_values)
    place = rng.integers(0, 40, 900)
    other = rng.integers(0, n_values, 900)
    found = one_alike(place, 40, place, other)
    keys = list(zip(place.tolist(), other.tolist(), strict=True))
    assert [keys[row] for row in found] == keys
    assert len({*found.tolist()}) == len({*keys})


@pytest.mark.parametrize("n_keys", [60, 10**9])
def test_keys_in_a_table_and_sorted_keys_are_counted_alike(n_keys: int) -> None:
    rng = np.random.default_rng(n_keys)
    some, others = rng.choice(n_keys, 20), rng.choice(n_keys, 40)
    both = np.concatenate([some, others])
    weights = rng.integers(0, 10**12, len(both))
    keys, (n_some, n_others, added) = counted(n_keys, (some, None), (others, None), (both, weights))
    assert keys.tolist() == np.unique(both).tolist()
    assert n_some.tolist() == [int((some == k).sum()) for k in keys]
    assert n_others.tolist() == [int((others == k).sum()) for k in keys]
    assert added.tolist() == [int(weights[both == k].sum()) for k in keys]


@pytest.mark.parametrize("n", [0, 1, 2, 5000])
@pytest.mark.parametrize("n_keys", [1, 7, 3000, 2**62])
def test_one_row_of_each_key_is_found(n: int, n_keys: int) -> None:
    keys = np.random.default_rng([n, n_keys]).integers(0, n_keys, n)
    for of in (keys, keys * 2**32):  # rows of many different keys have one hash
        assert sorted(of[one_of_each(of)].tolist()) == np.unique(of).tolist()


def test_people_are_near_across_the_ends_of_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(7)
    n_persons = np.append(rng.integers(1, 12, 80), [41, 3, 60, 40, 1])
    frame = np.repeat(np.arange(len(n_persons)), n_persons)
    x, y = rng.integers(0, 4000, (2, len(frame)))
    expected = [
        (a, b)
        for f in range(len(n_persons))
        for a in np.flatnonzero(frame == f).tolist()
        for b in np.flatnonzero(frame == f).tolist()
        if a < b and (x[a] - x[b]) ** 2 + (y[a] - y[b]) ** 2 <= 1500**2
    ]
    for at_once, kind, shift in [(5, np.int32, 0), (64, np.int32, 2**24), (10**6, np.int64, 0), (64, np.int64, 2**40)]:
        monkeypatch.setattr(pairs, "_PAIRS", at_once)
        one, other, square = pairs.near(frame, (x + shift).astype(kind), (y - shift).astype(kind), 1500)
        found = sorted((min(p), max(p)) for p in zip(one.tolist(), other.tolist(), strict=True))
        assert found == expected
        assert square.tolist() == ((x[one] - x[other]) ** 2 + (y[one] - y[other]) ** 2).tolist()
    few = frame < 80
    one, other, _ = pairs.near(frame[few], x[few], y[few], 1500)
    assert sorted(zip(one.tolist(), other.tolist(), strict=True)) == [p for p in expected if frame[p[0]] < 80]


def test_cells_in_a_table_and_sorted_cells_are_the_same_fact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    for number, (room, n_at_once) in enumerate([(0, 30_000), (10**6, 30_000), (10**6, 100)]):
        monkeypatch.setattr(floor_cells, "_ROOM", room)
        monkeypatch.setattr(floor_cells, "_COUNTED_AT_ONCE", n_at_once)
        root = tmp_path / str(number)
        root.mkdir()
        site = write_site(root, n_records=6_000, n_cameras=3, open_h=2, interval_s=10)
        build(site, facts=["floor_cells", "cell_tracks"])
        paths = [path for fact in ("floor_cells", "cell_tracks") for path in (root / "facts" / fact).rglob("*.parquet")]
        made.append([path.read_bytes() for path in paths])
    assert [pq.read_metadata(pa.BufferReader(data)).num_rows > 1000 for data in made[0]] == [True, True]
    assert made[0] == made[1] == made[2]


def test_a_footer_says_which_columns_need_not_be_read(tmp_path: Path) -> None:
    ts = pa.array([86_399_999, 1000], pa.timestamp("ms", "UTC"))
    rows = pa.table({"ts": ts, "all": [1, 2], "some": [1, None], "none": pa.nulls(2, pa.int32())})

    def noted(rows: pa.Table, **options: object) -> NotedColumns:
        pq.write_table(rows, tmp_path / "rows.parquet", **options)
        return NotedColumns(pq.read_metadata(tmp_path / "rows.parquet"))

    whole = noted(rows)
    assert whole.day == 0
    assert [whole.are_alike(c) for c in ("all", "some", "none", "missing")] == [True, False, True, True]
    assert [whole.is_known(c) for c in ("all", "none", "missing")] == [True, False, False]
    assert [whole.is_empty(c) for c in ("all", "some", "none", "missing")] == [False, False, True, True]
    assert noted(rows.set_column(0, "ts", pa.array([86_400_000, 1000], pa.timestamp("ms", "UTC")))).day is None
    silent = noted(rows, write_statistics=False)
    assert silent.day is None
    assert not any(silent.are_alike(c) or silent.is_empty(c) for c in ("all", "some", "none"))


@pytest.mark.parametrize("seed", range(20))
def test_nodes_get_the_least_node_they_are_connected_to(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 200))
    node_a, node_b = rng.integers(0, n, (2, int(rng.integers(0, 2 * n))))
    chain = rng.permutation(n)  # the longest way between two nodes, numbered at random
    for a, b in ((node_a, node_b), (chain[1:], chain[:-1]), (chain[1:], np.full(n - 1, chain[0]))):
        matrix = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
        label = connected_components(matrix, directed=False)[1]
        expected = [int(np.flatnonzero(label == own)[0]) for own in label]
        assert least_connected(a, b, n).tolist() == expected


def test_people_of_a_crowd_who_are_far_apart_are_not_near() -> None:
    """Squares of their differences need more than 32 bits."""
    x = np.zeros(50, dtype=np.int32)
    y = np.arange(50, dtype=np.int32) * 92_682  # twice its square is 16 less than 2**34
    one, _, _ = pairs.near(np.zeros(50, dtype=np.int32), x, y, 1500)
    assert len(one) == 0
