"""An hour's facts read records of the hours beside it only so near: no others may change a row or make it stale."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from warehouse.small_projects import (
    HOUR,
    T0,
    Frame,
    Pair,
    Person,
    build_hour_by_hour,
    fact_files,
    fact_hours,
    make_site,
    put,
)

from vsd_analytics.site.model import Camera, Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse import compute
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.lookback import NearParts, lookback_ms, noted_spans, spans_of
from vsd_analytics.warehouse.rules import RULES
from vsd_analytics.warehouse.units import PartIndex

GAPS = {"episode_gap_ms": 3000, "visit_gap_ms": 5000, "gathering_link_ms": 5000, "coverage_gap_ms": 600_000, **RULES}
HOURS = 4
Record = Person | Pair | Frame


def world(seed: int, *, has_heartbeat: bool, every_ms: int) -> list[Record]:
    """Return people around the ends of hours, with silences of all lengths, sent pairs, and counts that fall."""
    rng = np.random.default_rng(seed)
    found: list[Record] = []
    ts, seq = T0 + 40 * 60_000, 0
    while ts < T0 + HOURS * HOUR:
        near = min(ts % HOUR, HOUR - ts % HOUR) < 12 * 60_000
        steps = [every_ms, 2 * every_ms, 5 * every_ms // 2, 5 * every_ms // 2 + 1, 59_000, 61_000, 299_000, 301_000]
        likely = [0.6, 0.12, 0.1, 0.1, 0.02, 0.02, 0.02, 0.02]
        ts += int(rng.choice(steps, p=likely)) if near else int(rng.integers(60_000, 1_800_000))
        seq = int(rng.integers(0, 3)) if rng.random() < 0.02 else seq + int(rng.integers(1, 3))
        where = rng.integers(-2000, 2000, size=(5, 2))
        found += [Person(ts, f"t{i}", int(x), int(y)) for i, (x, y) in enumerate(where[: rng.integers(0, 6)])]
        if has_heartbeat:
            found.append(Frame(ts, seq=seq, n_pairs=1 if rng.random() < 0.1 else None))
            found += [Pair(ts, "t0", "t1", int(rng.integers(0, 2500)))] if found[-1].n_pairs else []
    return found


def site_of(root: Path, hz: float | None) -> Site:
    return make_site(root, cameras=[Camera("cam", "Cam", "ground", hz=hz)])


CASES = [(1, True, 1000, 1.0), (2, True, 200, None), (3, False, 1000, None), (4, True, 61_000, None)]


@pytest.mark.parametrize(("seed", "has_heartbeat", "every_ms", "hz"), CASES)
def test_records_beyond_reach_change_no_byte(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    seed: int,
    has_heartbeat: bool,
    every_ms: int,
    hz: float | None,
) -> None:
    """Hour by hour with what is within reach, and with whole hours on both sides."""
    near, wide = site_of(tmp_path / "near", hz), site_of(tmp_path / "wide", hz)
    put(near, world(seed, has_heartbeat=has_heartbeat, every_ms=every_ms))
    shutil.copytree(near.root / "store", wide.root / "store")
    assert build_hour_by_hour(near).n_built >= 3
    monkeypatch.setattr(compute, "lookback_ms", lambda *_: HOUR)
    build_hour_by_hour(wide)
    assert fact_files(near) == fact_files(wide)


def rows(site: Site) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for path in sorted((site.root / "facts").rglob("*.parquet")):
        found[path.relative_to(site.root).parts[1]] = pq.ParquetFile(path).read().to_pylist()
    return found


@pytest.mark.parametrize("is_in_order", [True, False], ids=["as they happen", "in any order"])
@pytest.mark.parametrize(("seed", "has_heartbeat", "every_ms", "hz"), CASES)
def test_records_that_come_one_batch_after_the_other_give_the_same_rows(
    tmp_path: Path, seed: int, has_heartbeat: bool, every_ms: int, hz: float | None, is_in_order: bool
) -> None:
    """With a build after each: what was fresh stays as it is, and must be what a first build would make."""
    records = world(seed, has_heartbeat=has_heartbeat, every_ms=every_ms)
    whole, stepwise = site_of(tmp_path / "whole", hz), site_of(tmp_path / "stepwise", hz)
    put(whole, records)
    build(whole)
    rng = np.random.default_rng(seed)
    instants = np.unique([r.ts for r in records])
    batches = np.array_split(instants, 14) if is_in_order else np.array_split(rng.permutation(instants), 6)
    for batch in batches:
        chosen = set(batch.tolist())
        put(stepwise, [r for r in records if r.ts in chosen])
        build(stepwise)
    assert rows(stepwise) == rows(whole)
    again = site_of(tmp_path / "again", hz)
    shutil.copytree(stepwise.root / "store", again.root / "store")
    build(again)
    assert fact_files(again) == fact_files(stepwise)


def test_a_message_of_the_running_hour_leaves_the_hour_before_it_alone(tmp_path: Path) -> None:
    site = site_of(tmp_path, 1.0)
    put(site, [r for ts in range(T0, T0 + 2 * HOUR, 60_000) for r in (Frame(ts), Person(ts, "a", 0, 0))])
    minutes = iter(range(5, 40, 7))
    put(site, [Person(T0 + 2 * HOUR + 1000, "a", 0, 0), Frame(T0 + 2 * HOUR + 1000)])
    build(site)
    for minute in minutes:
        before = fact_hours(site)
        put(site, [Frame(T0 + 2 * HOUR + minute * 60_000), Person(T0 + 2 * HOUR + minute * 60_000, "a", 0, 0)])
        assert dict(build(site).reasons) == {"late data": 1}
        after = fact_hours(site)
        assert {hour for name, hour in after if after[name, hour] != before[name, hour]} == {T0 // HOUR + 2}


def test_without_a_heartbeat_a_silence_reaches_farther(tmp_path: Path) -> None:
    site = site_of(tmp_path, 1.0)
    put(site, [Person(ts, "a", 0, 0) for ts in range(T0, T0 + 2 * HOUR, 60_000)])
    build(site)
    put(site, [Person(T0 + HOUR + 500_001, "b", 0, 0)])
    assert dict(build(site).reasons) == {"late data": 2}
    put(site, [Person(T0 + HOUR + 600_001, "b", 0, 0)])
    assert dict(build(site).reasons) == {"late data": 1}


def test_reach_is_the_longest_gap_that_is_bridged() -> None:
    day = {"interval_ms": 1000, "has_heartbeat": True}
    assert lookback_ms(GAPS, [day]) == 300_000
    assert lookback_ms({**GAPS, "visit_gap_ms": 400_000}, [day]) == 400_000
    assert lookback_ms(GAPS, [day, {**day, "has_heartbeat": False}]) == 600_000
    assert lookback_ms(GAPS, [day, {**day, "interval_ms": 1_200_000}]) == 3_000_000


def test_parts_are_near_by_their_first_and_last_instant(tmp_path: Path) -> None:
    site = site_of(tmp_path, 1.0)
    for ts in (T0 - 1000, T0 - 2000, T0 + HOUR + 9000, T0 + 3000):
        put(site, [Person(ts, "a", 0, 0)])
    index = PartIndex(Store(site.root / "store", site_id=site.site_id), first_hour=None, last_hour=None)
    parts = index.between(T0 // HOUR - 1, T0 // HOUR + 1)
    noted = noted_spans(parts)
    near = NearParts(index, spans_of(noted))
    assert {p.hour - T0 // HOUR for p in near(T0 // HOUR, 1999)} == {-1, 1}, "a part that is alone always counts"
    assert [len(near(T0 // HOUR, reach)) for reach in (999, 1000, 1999, 2000)] == [1, 2, 2, 3]
    unknown = NearParts(index, {})
    assert len(unknown(T0 // HOUR, 0)) == 3, "a file of an older version notes no spans: all parts count"


def test_spans_are_noted_where_parts_share_an_hour_only(tmp_path: Path) -> None:
    site = site_of(tmp_path, 1.0)
    put(site, [Person(T0, "a", 0, 0), Person(T0 + HOUR, "a", 0, 0)])
    build(site)
    (path,) = (site.root / "facts" / "camera_days").rglob("*.parquet")
    assert b"vsd.spans" not in (pq.read_metadata(path).metadata or {}), "the file has the bytes it always had"
    put(site, [Person(T0 + 1, "b", 0, 0)])
    build(site)
    (path,) = (site.root / "facts" / "camera_days").rglob("*.parquet")
    noted = pq.read_metadata(path).metadata[b"vsd.spans"]
    assert sorted(spans_of({b"vsd.spans": noted}).values()) == [(T0, T0), (T0 + 1, T0 + 1)]


@pytest.mark.parametrize(("silence_ms", "restarts"), [(300_000, 1), (300_001, 0)])
def test_a_count_that_began_again_in_the_silence_before_the_hour(
    tmp_path: Path, silence_ms: int, restarts: int
) -> None:
    """The reach of running numbers is that of their query: after a longer silence it does not ask what came before."""
    site = site_of(tmp_path, 1.0)
    earlier = [Frame(T0 - silence_ms + k * 1000 - 9000, seq=1000 + k) for k in range(10)]
    put(site, [*earlier, *(Frame(T0 + k * 1000, seq=k) for k in range(10))])
    build_hour_by_hour(site)
    runs = fact_hours(site)["sequence_runs", T0 // HOUR][0]
    assert [(run["restarts"], run["first_seq"], run["last_seq"]) for run in runs] == [(restarts, 0, 9)]
