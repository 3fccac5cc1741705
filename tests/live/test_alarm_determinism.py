"""The same records give the same alarms: in any order within the lateness, in any batches, twice, live or replayed."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from alarm_worlds import CONTACT, GATHERING, SILENCE, at, make_site, quiet, row, stand, tables_of
from simulate.small_scenes import START_MS, Message

from vsd_analytics.live.alarms import AlarmEngine
from vsd_analytics.live.events import AlarmEvent
from vsd_analytics.live.stored_frames import replay
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.model import Camera
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.store import Store

Tables = dict[TableName, pa.Table]
RULES = (
    replace(GATHERING, for_s=15.0, n_people=3, cooldown_s=30.0),
    replace(GATHERING, alarm_id="anywhere", area_id=None, for_s=5.0, n_people=2, cooldown_s=0.0),
    replace(CONTACT, for_s=4.0, cooldown_s=20.0),
    replace(SILENCE, for_s=20.0, cooldown_s=0.0),
)
CAMERAS = tuple(Camera(f"cam-{k}", f"{k}", "ground") for k in (1, 2, 3))
SITE = make_site(*RULES, cameras=CAMERAS)
SECONDS = 400


@cache
def world(seed: int) -> tuple[tuple[str, ...], Tables]:
    """Return the records of three cameras: restless people, lost frames, silences; camera 3 sends pairs itself."""
    rng = np.random.default_rng(seed)
    messages: list[Message] = []
    for camera in CAMERAS:
        xy = rng.uniform(0, 8, (8, 2))
        goals = rng.uniform(0, 8, (8, 2))
        dead_s, alive_s = (
            np.sort(rng.integers(0, SECONDS, 2)) if camera.camera_id != "cam-1" else (90, 90 + 30 * (seed + 1))
        )
        for s in range(SECONDS):
            step = goals - xy
            far = np.hypot(*step.T)[:, None]
            xy = xy + step * np.minimum(0.8, far) / np.maximum(far, 1e-9)
            new = rng.random(8) < 0.02
            goals[new] = rng.uniform(0, 8, (int(new.sum()), 2))
            if dead_s < s < alive_s or rng.random() < 0.03:
                continue
            seen = [k for k in range(8) if rng.random() > 0.05]
            persons = [
                {"id": f"{k}-{s // 150}", "x_m": round(float(xy[k, 0]), 3), "y_m": round(float(xy[k, 1]), 3)}
                for k in seen
            ]
            (message,) = quiet(0, start_s=s + 0.1 * int(camera.camera_id[-1]), camera=camera.camera_id)
            message["persons"] = persons
            if camera.camera_id == "cam-3":
                d = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
                message["pairs"] = [
                    {"a": f"{a}-{s // 150}", "b": f"{b}-{s // 150}", "distance_m": float(d[a, b])}
                    for a in seen
                    for b in seen
                    if a < b and d[a, b] < 2.4
                ]
            messages.append(message)
    return tuple(TABLES), tables_of(SITE, messages)


def rows_of(tables: Tables) -> list[tuple[int, TableName, int]]:
    """Return every row as (instant, table, number)."""
    return [(ms, t, i) for t in TABLES for i, ms in enumerate(tables[t]["ts"].cast(pa.int64()).to_pylist())]


def deliver(tables: Tables, order: list[tuple[TableName, int]], cuts: list[int]) -> list[AlarmEvent]:
    """Return the events when rows come in this order, cut into batches."""
    engine = AlarmEngine(SITE)
    events = []
    for low, high in zip([0, *cuts], [*cuts, len(order)], strict=True):
        batch = {t: tables[t].take(pa.array([i for u, i in order[low:high] if u == t], pa.int64())) for t in TABLES}
        events += engine.feed(batch)
    assert engine.n_late == 0
    return sorted(events + engine.close(), key=lambda e: e.order)


def clean(tables: Tables) -> list[AlarmEvent]:
    return deliver(tables, [(t, i) for _, t, i in sorted(rows_of(tables))], [])


@pytest.mark.parametrize("seed", range(3))
def test_order_within_the_lateness_duplicates_and_batches_change_nothing(seed: int) -> None:
    _, tables = world(seed)
    expected = clean(tables)
    assert {e.kind for e in expected} == {"gathering", "contact", "silence"}
    assert {e.event for e in expected} == {"start", "update", "end"}
    assert len({(e.alarm, e.event, e.at_ms) for e in expected}) == len(expected)
    rng = np.random.default_rng(100 + seed)
    rows = rows_of(tables)
    for n_batches in (1, 40, 400):
        twice = [rows[i] for i in rng.integers(0, len(rows), len(rows) // 5)]
        late_ms = SITE.settings.lateness_s * 1000
        delayed = sorted((ms + rng.uniform(0, late_ms), t, i) for ms, t, i in [*rows, *twice])
        cuts = sorted(rng.integers(0, len(delayed), n_batches - 1).tolist())
        assert deliver(tables, [(t, i) for _, t, i in delayed], cuts) == expected


def test_a_record_later_than_the_lateness_is_counted_and_changes_nothing() -> None:
    _, tables = world(0)
    engine = AlarmEngine(SITE)
    halves = between(tables, 0, 200), between(tables, 200, SECONDS + 1)
    early = engine.feed(halves[0])
    assert engine.feed(halves[0]) == []
    n_late = engine.n_late
    assert n_late > 0.9 * sum(t.num_rows for t in halves[0].values())
    events = early + engine.feed(halves[1]) + engine.close()
    assert sorted(events, key=lambda e: e.order) == clean(tables)
    assert engine.n_late == n_late


def test_of_two_places_of_one_person_the_same_counts_in_any_order() -> None:
    still = stand(row(4), 70)
    away = [{**m, "persons": [{**p, "x_m": p["x_m"] + 50} for p in m["persons"]]} for m in still]
    unknown = [{**m, "persons": [{"id": p["id"], "u_px": 1, "v_px": 1} for p in m["persons"]]} for m in still]
    found = []
    for messages in ([*still, *away, *unknown], [*unknown, *away, *still]):
        engine = AlarmEngine(SITE)
        found.append([*engine.feed(tables_of(SITE, messages)), *engine.close()])
    assert found[0] == found[1]
    assert {e.rule for e in found[0]} == {"crowd", "anywhere", "close"}


def between(tables: Tables, start_s: int, end_s: int) -> Tables:
    ms = {t: rows["ts"].cast(pa.int64()).to_numpy() - START_MS for t, rows in tables.items()}
    return {t: rows.filter(pa.array((ms[t] >= start_s * 1000) & (ms[t] < end_s * 1000))) for t, rows in tables.items()}


def stored(root: Path, tables: Tables, *, n_pieces: int, fold_at: int) -> Store:
    store = Store(root / "store", site_id=SITE.site_id)
    for k in range(n_pieces):
        for table in TABLES:
            n = tables[table].num_rows // n_pieces + 1
            store.append(table, tables[table].slice(k * n, n))
        if k == fold_at:
            store.fold()
    return store


@pytest.mark.parametrize("seed", [5])
def test_a_replay_of_the_store_is_what_came_live(tmp_path: Path, seed: int) -> None:
    _, tables = world(seed)
    site = replace(SITE, root=tmp_path)
    stored(tmp_path, tables, n_pieces=5, fold_at=2)  # half of it is in the spool still
    live = clean(tables)
    day = date(2026, 11, 9)
    replayed = replay(site, day, day, now=at(SECONDS))
    cameras_silent_before = {e.alarm for e in replayed if e.since_ms < START_MS}
    assert [e for e in replayed if e.at_ms <= live[-1].at_ms and e.alarm not in cameras_silent_before] == live
    Store(tmp_path / "store", site_id=SITE.site_id).fold()
    assert replay(site, day, day, now=at(SECONDS)) == replayed


def test_a_day_on_the_clock_is_what_a_replay_of_it_says(tmp_path: Path) -> None:
    """Live, all cameras stop at once; the clock ticks, and they come back: as stored."""
    site = make_site(replace(SILENCE, cooldown_s=0.0), root=tmp_path, opening=(((480, 1260),),) * 7)
    first, second = ([*quiet(100, start_s=s, camera="cam-1"), *quiet(90, start_s=s, camera="cam-2")] for s in (0, 1000))
    tables = tables_of(site, [*first, *second])
    store = Store(tmp_path / "store", site_id=site.site_id)
    engine = AlarmEngine(site, start=at(0))
    live: list[AlarmEvent] = []
    for s in range(1200):
        now = between(tables, s, s + 1)
        live += [*engine.feed(now, now=at(s + 0.3)), *engine.tick(at(s + 0.5))]
    for table, rows in tables.items():
        store.append(table, rows)
    day = date(2026, 11, 9)
    replayed = replay(site, day, day, now=at(1200))
    last = at(1200 - site.settings.lateness_s).timestamp() * 1000
    # a tick trusts a camera lateness_s longer than the replay does, which knows that nothing came
    assert sorted(live, key=lambda e: e.order) == [e for e in replayed if e.at_ms < last - 500]
    assert [e.event for e in live].count("start") == 4
    assert [e.event for e in live].count("end") == 2


def test_a_replay_tells_alarms_that_were_open_in_its_range_alone(tmp_path: Path) -> None:
    site = make_site(replace(GATHERING, is_open_only=False, cooldown_s=0.0), root=tmp_path)
    store = Store(tmp_path / "store", site_id=site.site_id)
    midnight_s = 16 * 3600
    # the second is over before the second day, within what is read back for it
    for k, start_s in enumerate((100, midnight_s - 920, midnight_s - 300, midnight_s + 4000)):
        tables = tables_of(
            site, [*stand(row(4), 590, start_s=start_s, first_id=10 * k), *quiet(9, start_s=start_s + 591)]
        )
        for table, rows in tables.items():
            store.append(table, rows)
    store.fold()
    days = [replay(site, day, day, now=at(10 * 86400)) for day in (date(2026, 11, 9), date(2026, 11, 10))]
    told = [
        [(e.event, (e.at_ms - START_MS) // 1000 - midnight_s) for e in found if e.event != "update"] for found in days
    ]
    first, evening = [("start", 160 - midnight_s), ("end", 690 - midnight_s)], [("start", -860), ("end", -330)]
    over_midnight, night = [("start", -240), ("end", 290)], [("start", 4060), ("end", 4590)]
    assert told == [[*first, *evening, *over_midnight], [*over_midnight, *night]]
    assert {e.alarm for e in days[0]} & {e.alarm for e in days[1]} == {days[0][-1].alarm}
    assert START_MS % HOUR_MS == 0
