"""Rules over stored days: what a longer `for_s` would give is what it gives, and trying it changes nothing else."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import date, datetime, timedelta
from pathlib import Path

import pytest
from alarm_worlds import GATHERING, NOW, SILENCE, quiet, row, stand
from simulate.small_scenes import START_MS, Message, merge
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.alarms import WAITS_S, alarm_answers, local_hour_ms
from vsd_analytics.live.alarm_days import alarm_days
from vsd_analytics.live.stored_frames import replay
from vsd_analytics.site.model import AlarmRule, Site

DAY = date(2026, 11, 9)
AREA = '[[area]]\nid = "queue"\nname = "Queue"\npolygon = [[0, 0], [9, 0], [9, 9], [0, 9]]\n'


def stored(folder: Path, messages: Sequence[Message]) -> Site:
    """Return a site that has stored these messages."""
    (folder / "vsd.toml").write_text(
        site_text(site='opening = { mon-sat = "08:00-21:00" }\n', more=f"{AREA}[privacy]\npseudonyms = false\n")
    )
    (folder / "day.jsonl").write_text("\n".join(map(json.dumps, messages)))
    assert run(cli, ["-C", str(folder), "--quiet", "--now", NOW.isoformat(), "ingest", str(folder / "day.jsonl")]) == 0
    return load_site(folder)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Crowds of 90, 200, 130, 400 and 700 s, some within the cool-down of the one before, and silences between."""
    messages: list[Message] = []
    at = 0.0
    for number, (lasts_s, pause_s) in enumerate(((90, 10), (200, 400), (130, 20), (400, 900), (700, 30))):
        messages = merge(messages, stand(row(4), lasts_s, start_s=at, first_id=10 * number + 1))
        messages = merge(messages, quiet(min(pause_s, 60) - 2, start_s=at + lasts_s + 1))
        at += lasts_s + pause_s
    return stored(tmp_path_factory.mktemp("crowds"), messages)


def alarms_with(site: Site, rule: AlarmRule) -> int:
    return len({event.alarm for event in replay(site, DAY, DAY, rules=[rule], now=NOW)})


@pytest.mark.parametrize(
    "rule", [GATHERING, replace(GATHERING, cooldown_s=0.0), SILENCE], ids=["cooldown", "none", "silence"]
)
def test_a_longer_wait_gives_the_count_that_the_page_promised(site: Site, rule: AlarmRule) -> None:
    found = alarm_days(site, DAY, DAY, rules=[rule], now=NOW)
    assert found.n_waited == {(rule.alarm_id, s): alarms_with(site, replace(rule, for_s=s)) for s in WAITS_S}


def test_the_counts_of_the_crowds_are_those_of_their_durations(site: Site) -> None:
    no_cooldown = replace(GATHERING, cooldown_s=0.0)
    found = alarm_days(site, DAY, DAY, rules=[no_cooldown], now=NOW)
    assert [found.n_waited["crowd", s] for s in (120.0, 180.0, 300.0, 600.0)] == [4, 3, 2, 1]
    assert [a.lasted_s for a in found.alarms] == [90.0, 200.0, 130.0, 400.0, 700.0]


def test_an_alarm_that_a_cool_down_held_back_counts_with_a_longer_wait(tmp_path: Path) -> None:
    """So the durations of the alarms there were give neither the count nor a bound of it."""
    crowds = merge(stand(row(4), 90), stand(row(4), 200, start_s=100, first_id=11))
    found = alarm_days(stored(tmp_path, crowds), DAY, DAY, rules=[GATHERING], now=NOW)
    assert [a.lasted_s for a in found.alarms] == [90.0]
    assert found.n_waited["crowd", 120.0] == 1


def test_trying_other_waits_changes_no_alarm_of_the_rules(site: Site) -> None:
    rules = [GATHERING, SILENCE]
    plain = replay(site, DAY, DAY, rules=rules, now=NOW)
    found = alarm_days(site, DAY, DAY, rules=rules, now=NOW)
    assert {a.alarm_id for a in found.alarms} == {e.alarm for e in plain}
    assert {a.alarm_id for a in found.alarms if a.ended} == {e.alarm for e in plain if e.event == "end"}
    counted = {row["rule_id"]: row["n_alarms"].value for row in alarm_answers(found, site)["alarm_rules"].rows}  # type: ignore[union-attr]
    assert counted == {r: len({e.alarm for e in plain if e.rule == r}) for r in ("crowd", "dead")}


def test_hours_that_nobody_recorded_have_no_count(site: Site) -> None:
    found = alarm_days(site, DAY, DAY + timedelta(days=1), rules=[GATHERING], now=NOW)
    assert found.recorded == {("cam-1", START_MS)}
    hours = {(r["local_date"], r["local_hour"]): r for r in alarm_answers(found, site)["alarm_hours"].rows}
    first = datetime.fromtimestamp(START_MS / 1000, tz=site.zone).hour
    assert hours[DAY, first]["n_alarms"].value == len(found.alarms)  # type: ignore[union-attr]
    assert hours[DAY, first + 1]["state"] == "no_data"
    assert hours[DAY, first + 1]["n_alarms"].value is None  # type: ignore[union-attr]
    assert hours[DAY, 3]["state"] == "closed"
    [rule] = alarm_answers(found, site)["alarm_rules"].rows
    assert rule["n_days"] == 1  # of two open days, the one that was recorded


def test_the_suggested_wait_is_the_least_that_rings_at_most_three_times_a_day(site: Site) -> None:
    found = alarm_days(site, DAY, DAY, rules=[replace(GATHERING, cooldown_s=0.0)], now=NOW)
    waits = alarm_answers(found, site)["alarm_waits"].rows
    assert [row["for_s"] for row in waits if row["is_suggested"]] == [180.0]
    few = alarm_days(site, DAY, DAY, rules=[replace(GATHERING, cooldown_s=0.0, for_s=150.0)], now=NOW)
    assert not any(row["is_suggested"] for row in alarm_answers(few, site)["alarm_waits"].rows)


def test_the_start_of_a_local_hour_in_a_zone_with_half_hours(site: Site) -> None:
    far = replace(site, timezone="Asia/Kolkata")
    assert (local_hour_ms(START_MS + 45 * 60_000, far) - START_MS) % 3_600_000 == 1_800_000
