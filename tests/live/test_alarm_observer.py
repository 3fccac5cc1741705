"""Alarms inside the listener: each reported once, also over restarts; no mistake of theirs stops it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import pyarrow as pa
import pytest
from alarm_worlds import CONTACT, GATHERING, SILENCE, at, make_site, quiet, row, stand, tables_of
from simulate.small_scenes import START_MS, Message, merge

from vsd_analytics.live.alarm_observer import LiveAlarms
from vsd_analytics.live.alarms import AlarmEngine
from vsd_analytics.live.delivery import FILE, AlarmLog, AlarmSender
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import AlarmRule, Site
from vsd_analytics.store.store import Store

WORLD = [
    *merge(stand(row(4), 900, start_s=30), quiet(1000), stand(row(3, y=8.0), 100, start_s=500, first_id=21)),
    *quiet(300, camera="cam-2"),
    *quiet(200, start_s=800, camera="cam-2"),
]
RULES = (GATHERING, replace(GATHERING, alarm_id="three", n_people=3, for_s=20.0), CONTACT, SILENCE)


def live(site: Site, messages: Sequence[Message], *, killed_s: Sequence[int] = (), away_s: int = 0) -> list[dict]:
    """Listen for 5 s at a time, dying and starting again at some; return what is in alarms.jsonl."""
    store = Store(site.root / "store", site_id=site.site_id)
    tables = tables_of(site, messages)
    ages = {t: rows["ts"].cast(pa.int64()).to_numpy() - START_MS for t, rows in tables.items()}
    now = at(0)
    site.root.mkdir(parents=True, exist_ok=True)

    def start() -> LiveAlarms:
        delivery = AlarmSender(site, log=AlarmLog(site.root / FILE))
        return LiveAlarms(site, delivery=delivery, clock=lambda: now, report=lambda _: None)

    alarms = start()
    last, taken, kept = 1020, 0, 0

    def between(low_s: int, high_s: int) -> dict[TableName, pa.Table]:
        return {t: tables[t].filter(pa.array((ms >= low_s * 1000) & (ms < high_s * 1000))) for t, ms in ages.items()}

    for s in range(0, last, 5):
        now = at(s + 5)
        if any(k <= s < k + away_s for k in killed_s):  # the broker keeps what comes
            continue
        if s - away_s in killed_s:  # by then everything it took is in the store
            for table, rows in between(kept, taken).items():
                store.append(table, rows)
            if s == 400:
                store.fold()
            kept, alarms = taken, start()
            alarms.on_tick(now)
        alarms.on_stored(between(taken, s + 5))
        taken = s + 5
        alarms.on_tick(now)
    alarms.on_tick(at(last + 10))
    log = site.root / FILE
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


def ordered(records: list[dict]) -> list[tuple]:
    return sorted((r["at"], r["camera"], r["rule"], r["event"], r["alarm"]) for r in records)


def test_a_restart_tells_no_alarm_twice_and_forgets_none(tmp_path: Path) -> None:
    sites = [make_site(*RULES, root=tmp_path / name) for name in ("a", "b")]
    whole = live(sites[0], WORLD)
    assert {(r["kind"], r["event"]) for r in whole} >= {
        (kind, step) for kind in ("gathering", "silence", "contact") for step in ("start", "end")
    }
    killed = live(sites[1], WORLD, killed_s=(15, 90, 95, 400, 930, 960))
    assert ordered(killed) == ordered(whole)


def test_time_we_were_away_is_no_silence(tmp_path: Path) -> None:
    sites = [make_site(SILENCE, root=tmp_path / name) for name in ("a", "b")]
    world = [*quiet(1010), *quiet(1010, camera="cam-2")]
    assert live(sites[0], world, killed_s=(300,), away_s=200) == []
    lost = [m for m in world if m not in quiet(150, start_s=320)]
    told = live(sites[1], lost, killed_s=(300,), away_s=200)  # the camera itself was silent in that time
    assert [(r["camera"], r["event"]) for r in told if r["event"] != "update"] == [("cam-1", "start"), ("cam-1", "end")]


def test_an_alarm_that_is_not_found_again_is_ended(tmp_path: Path) -> None:
    site = make_site(GATHERING, root=tmp_path)
    record = {**_start(site), "rule": "gone"}
    AlarmLog(tmp_path / FILE).append(record)
    for _ in range(2):
        alarms = LiveAlarms(site, delivery=AlarmSender(site, log=AlarmLog(tmp_path / FILE)), clock=lambda: at(500))
    told = [json.loads(line) for line in (tmp_path / FILE).read_text().splitlines()]
    assert told == [record, {**record, "event": "end", "at": "2026-11-09T08:08:20.000+00:00", "lasted_s": 500.0}]
    assert alarms.as_dict()["open"] == 0


def _start(site: Site) -> dict:
    engine = AlarmEngine(site)
    (event,) = engine.feed(tables_of(site, stand(row(4), 80)))
    return event.as_dict(site.zone)


def test_the_heartbeat_counts(tmp_path: Path) -> None:
    site = make_site(GATHERING, root=tmp_path)
    alarms = LiveAlarms(site, delivery=AlarmSender(site), clock=lambda: at(100), report=lambda _: None)
    alarms.on_stored(tables_of(site, stand(row(4), 100)))
    alarms.on_stored(tables_of(site, stand(row(4), 10)))
    assert alarms.as_dict() == {
        "open": 1,
        "told": 1,
        "too_late": 55,
        "without_track": 0,
        "not_logged": 0,
        "not_published": 0,
        "webhook": None,
    }


@pytest.mark.parametrize("hours", [1, 30])
def test_a_silence_of_hours_is_known_again(tmp_path: Path, hours: int) -> None:
    rule = AlarmRule("dead", "silence", for_s=600.0, is_open_only=False)
    site = make_site(rule, root=tmp_path)
    store = Store(tmp_path / "store", site_id=site.site_id)
    for table, rows in tables_of(site, [*quiet(60), *quiet(60, camera="cam-2")]).items():
        store.append(table, rows)
    ends = [at(900), at(hours * 3600.0)]

    def restart(now: datetime) -> LiveAlarms:
        delivery = AlarmSender(site, log=AlarmLog(tmp_path / FILE))
        alarms = LiveAlarms(site, delivery=delivery, clock=lambda: now, report=lambda _: None)
        for s in range(0, 700, 50):
            alarms.on_tick(now + timedelta(seconds=s))
        return alarms

    before = set(restart(ends[0]).engine.open_alarms)
    assert len(before) == 2
    after = set(restart(ends[1]).engine.open_alarms)
    assert (before == after) == (hours < 24)
    told = [json.loads(line) for line in (tmp_path / FILE).read_text().splitlines()]
    assert sum(r["event"] == "start" for r in told) == (2 if hours < 24 else 4)
    assert sum(r["event"] == "end" for r in told) == (0 if hours < 24 else 2)


def test_what_was_there_before_the_records_begin_is_reported_only_while_it_lasts(tmp_path: Path) -> None:
    """A listener starts in the middle of it, nothing reported before: a gathering is news, a contact may be old."""
    ended, lasting = (make_site(GATHERING, CONTACT, root=tmp_path / name) for name in ("ended", "lasting"))
    for site, until_s in ((ended, 1600), (lasting, 2100)):
        store = Store(site.root / "store", site_id=site.site_id)
        messages = merge(stand(row(4), until_s), quiet(2200))
        for table, rows in tables_of(site, messages[:1990]).items():
            store.append(table, rows)
        delivery = AlarmSender(site, log=AlarmLog(site.root / FILE))
        alarms = LiveAlarms(site, delivery=delivery, clock=lambda: at(2200), report=lambda _: None)
        alarms.on_stored(tables_of(site, messages[1990:]))
    assert not (ended.root / FILE).exists()
    told = [json.loads(line) for line in (lasting.root / FILE).read_text().splitlines()]
    assert {(r["rule"], r["event"]) for r in told} == {("crowd", "start"), ("crowd", "update"), ("crowd", "end")}


def test_a_damaged_store_stops_no_listener(tmp_path: Path) -> None:
    site = make_site(GATHERING, root=tmp_path)
    store = Store(tmp_path / "store", site_id=site.site_id)
    for table, rows in tables_of(site, stand(row(4), 50)).items():
        store.append(table, rows)
    store.fold()
    for path in (tmp_path / "store" / "observations").rglob("*.parquet"):
        path.write_bytes(path.read_bytes()[:-100])
    said: list[str] = []
    alarms = LiveAlarms(site, delivery=AlarmSender(site), clock=lambda: at(60), report=said.append)
    assert len(said) == 1
    assert "damaged" in said[0]
    alarms.on_stored(tables_of(site, stand(row(4), 100, start_s=60)))
    assert alarms.as_dict()["open"] == 1
