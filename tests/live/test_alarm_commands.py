"""`vsd alarms`: a stored day as a table, as JSON, as events, sent on; and the sample."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from alarm_worlds import frame, quiet, row, stand
from live.local_broker import MOSQUITTO, WHY_NOT, Mosquitto, publish
from simulate.small_scenes import merge
from site_text import site_text
from test_alarm_delivery import receiver

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.wording.catalogue import say

SITE = site_text(
    site='opening = { mon-sat = "08:00-21:00" }\n',
    more='[[area]]\nid = "queue"\nname = "Queue"\npolygon = [[0, 0], [9, 0], [9, 9], [0, 9]]\n'
    "[privacy]\npseudonyms = false\n",
)
RULES = """
[[alarm]]
id = "crowd"
kind = "gathering"
people = 4
for_s = 60
area = "queue"
[[alarm]]
id = "dead"
kind = "silence"
for_s = 3700
"""

TABLE = """\
since                lasted            rule   where                       what
2026-11-09 09:00:00  1 min 15 s        crowd  queue, cam-1 at 4.5, 3.0 m  up to 4 people, nearest 1.00 m
2026-11-09 09:03:20  3 h 55 min, open  dead   cam-1                       camera silent
2 alarms, times in Europe/Rome
"""


@pytest.fixture
def project(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    (tmp_path / "vsd.toml").write_text(SITE + RULES)
    messages = merge(stand(row(4), 75), quiet(200))
    (tmp_path / "day.jsonl").write_text("\n".join(map(json.dumps, messages)))
    assert vsd(tmp_path, "ingest", str(tmp_path / "day.jsonl")) == 0
    capsys.readouterr()
    return tmp_path


def vsd(folder: Path, *arguments: str, now: str = "2026-11-09T12:00:00Z") -> int:
    return run(cli, ["-C", str(folder), "--quiet", "--now", now, *arguments])


def json_rows(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["answers"]["alarms"]["rows"]
    return rows


def test_the_last_stored_day_as_a_table(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsd(project, "alarms") == 0
    assert capsys.readouterr().out == TABLE


def test_json_has_one_entry_an_alarm(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsd(project, "alarms", "2026-11-09", "--json", "--rule", "crowd") == 0
    (alarm,) = json_rows(capsys)
    assert (alarm["rule_id"], alarm["started"], alarm["ended"], alarm["lasted_s"]["value"]) == (
        "crowd",
        "2026-11-09T09:01:00+01:00",
        "2026-11-09T09:01:15+01:00",
        75.0,
    )
    assert vsd(project, "alarms", "2026-11-08..2026-11-08", "--json", "--rule", "crowd") == 0
    assert json_rows(capsys) == []


def test_events_are_the_lines_that_are_delivered_once(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsd(project, "alarms", "--events", "--deliver") == 0
    events = capsys.readouterr().out
    assert (project / "alarms.jsonl").read_text() == events
    assert [json.loads(line)["event"] for line in events.splitlines() if '"crowd"' in line] == ["start", "end"]
    assert vsd(project, "alarms", "--deliver") == 0
    assert (project / "alarms.jsonl").read_text() == events


def test_a_day_that_goes_on_is_listed_as_far_as_it_is_known(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsd(project, "alarms", "--json", "--rule", "dead", now="2026-11-09T08:30:00Z") == 0
    assert json_rows(capsys) == []
    assert vsd(project, "alarms", "--json", "--rule", "dead") == 0
    (alarm,) = json_rows(capsys)
    assert (alarm["since"], alarm["ended"], alarm["is_going_on"]) == ("2026-11-09T09:03:20+01:00", None, True)
    assert vsd(project, "alarms", "--json", "--rule", "dead", now="2026-11-10T03:00:00Z") == 0
    (alarm,) = json_rows(capsys)
    assert (alarm["ended"], alarm["is_going_on"]) == ("2026-11-09T21:00:00+01:00", False)


def test_the_page_shows_the_figures_of_the_json_and_is_the_operator_s(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsd(project, "alarms", "2026-W46", "--page", now="2026-11-20T00:00:00Z") == 0
    printed = capsys.readouterr().out
    assert printed.startswith("7 alarms in week 46, 5 of them at ")
    page = (project / "operator" / "2026-W46-alarms.html").read_text(encoding="utf-8")
    assert say("page.exact") in page
    assert vsd(project, "alarms", "2026-W46", "--json", now="2026-11-20T00:00:00Z") == 0
    answers = json.loads(capsys.readouterr().out)["answers"]
    for rule in answers["alarm_rules"]["rows"]:
        row = re.search(rf'<th scope="row">{rule["rule_id"]}: .*?</tr>', page)
        assert row is not None
        assert re.findall(r"<td[^>]*>([^<]*)</td>", row[0])[:2] == [
            str(rule["n_alarms"]["value"]),
            str(rule["n_days"]),
        ]
    assert vsd(project, "alarms", "2026-11-09", "--out", str(project / "elsewhere"), "--language", "it") == 0
    assert 'lang="it-IT"' in (project / "elsewhere" / "2026-11-09-alarms.html").read_text(encoding="utf-8")


def test_a_page_without_rules_says_so(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / "vsd.toml").write_text(SITE)
    assert vsd(project, "alarms", "--page") == 0
    assert capsys.readouterr().out.startswith("No alarm rules\n")


@pytest.mark.parametrize("options", [("--page", "--json"), ("--open", "--events"), ("--page", "--deliver")])
def test_outputs_that_do_not_go_together_are_refused(project: Path, options: tuple[str, ...]) -> None:
    assert vsd(project, "alarms", *options) == 2


def test_what_cannot_be_done_is_reported(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsd(project, "alarms", "--rule", "crows") == 2
    assert "--rule crowd" in capsys.readouterr().err
    assert vsd(project, "alarms", "someday") == 2
    assert vsd(project, "alarms", "--test") == 2
    assert "nowhere to send" in capsys.readouterr().err
    (project / "vsd.toml").write_text(SITE)
    assert vsd(project, "alarms") == 0
    assert "no [[alarm]]" in capsys.readouterr().out


def test_an_empty_store_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vsd.toml").write_text(SITE + RULES)
    assert vsd(tmp_path, "alarms") == 2
    assert "E301" in capsys.readouterr().err


def test_the_sample_goes_to_the_webhook_and_not_into_the_log(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VSD_WEBHOOK_TOKEN", "t0ken")
    with receiver() as server:
        (project / "vsd.toml").write_text(f'{SITE}{RULES}[alarms]\nwebhook = "{server.url}"\n')
        assert vsd(project, "alarms", "--test") == 0
        assert [(r["alarm"], r["rule"], r["event"]) for r in server.got] == [("0" * 16, "test", "start")]
        assert server.headers[0]["Authorization"] == "Bearer t0ken"
        assert not (project / "alarms.jsonl").exists()
    with receiver(400) as server:
        (project / "vsd.toml").write_text(f'{SITE}{RULES}[alarms]\nwebhook = "{server.url}"\n')
        assert vsd(project, "alarms", "--test") == 2
        assert "HTTP 400" in (err := capsys.readouterr().err)
        assert "t0ken" not in err
    with receiver(413, 413) as server:
        (project / "vsd.toml").write_text(f'{SITE}{RULES}[alarms]\nwebhook = "{server.url}"\n')
        assert vsd(project, "alarms", "--deliver") == 1
        assert "E710" in capsys.readouterr().err


@pytest.fixture
def mosquitto(tmp_path: Path) -> Iterator[Mosquitto]:
    if MOSQUITTO is None:
        pytest.skip(WHY_NOT)
    broker = Mosquitto(tmp_path / "broker").start()
    yield broker
    broker.stop()


def test_the_topic_gets_what_the_webhook_gets(
    project: Path, mosquitto: Mosquitto, capsys: pytest.CaptureFixture[str]
) -> None:
    import threading

    import paho.mqtt.client as paho
    from paho.mqtt.enums import CallbackAPIVersion

    got: list[dict] = []
    ready, enough = threading.Event(), threading.Event()
    client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
    client.on_subscribe = lambda *_: ready.set()

    def on_message(_client: object, _data: object, message: paho.MQTTMessage) -> None:
        got.append({**json.loads(message.payload), "qos": message.qos})
        if len(got) == 3:
            enough.set()

    client.on_message = on_message
    client.connect("127.0.0.1", mosquitto.port)
    client.loop_start()
    client.subscribe("vsd/shop/alarms", qos=1)
    assert ready.wait(5)
    where = f'[mqtt]\nhost = "127.0.0.1"\nport = {mosquitto.port}\n[alarms]\ntopic = "vsd/shop/alarms"\n'
    (project / "vsd.toml").write_text(f"{SITE}{RULES}{where}")
    assert vsd(project, "alarms", "--test") == 0
    assert vsd(project, "alarms", "--rule", "crowd", "--deliver") == 0
    assert enough.wait(5)
    client.disconnect()
    client.loop_stop()
    assert [(r["rule"], r["event"], r["qos"]) for r in got] == [
        ("test", "start", 1),
        ("crowd", "start", 1),
        ("crowd", "end", 1),
    ]
    mosquitto.stop()
    assert vsd(project, "alarms", "--test") == 2
    assert "E710" in capsys.readouterr().err


def test_the_listener_tells_alarms(project: Path, mosquitto: Mosquitto) -> None:
    began = datetime.now(tz=UTC) - timedelta(seconds=100)
    start_ms = round(began.timestamp()) * 1000
    four = [{"id": str(k), "x_m": 3.0 + k, "y_m": 3.0} for k in range(4)]
    topic = "vsd/cam-1/frames"
    messages = [(topic, json.dumps(frame("cam-1", start_ms + s * 1000, four)).encode()) for s in range(90)]
    where = f'[mqtt]\nhost = "127.0.0.1"\nport = {mosquitto.port}\n[alarms]\ntopic = "vsd/shop/alarms"\n'
    rules = RULES.replace("area", "open_only = false\narea")
    (project / "vsd.toml").write_text(f"{SITE}{rules}{where}")
    shutil.rmtree(project / "store")
    assert run(cli, ["-C", str(project), "--quiet", "listen", "--once", "--connect-timeout", "5"]) == 0
    for part in (messages[:50], messages[50:]):  # a restart in the middle
        publish(mosquitto.port, part)
        assert run(cli, ["-C", str(project), "--quiet", "listen", "--once"]) == 0
    told = [json.loads(line) for line in (project / "alarms.jsonl").read_text().splitlines()]
    assert [(r["rule"], r["event"], r["lasted_s"]) for r in told] == [("crowd", "start", 60.0)]
