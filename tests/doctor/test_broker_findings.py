"""What `vsd doctor` says of listener and broker."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from live.local_broker import MOSQUITTO, WHY_NOT, Mosquitto, free_port, write_project

from vsd_analytics.cli import cli
from vsd_analytics.config.project import load_site
from vsd_analytics.doctor import broker
from vsd_analytics.doctor.broker import ask, config_faults, examine_config, examine_listener, parse_config
from vsd_analytics.errors import LiveError
from vsd_analytics.live.mqtt import recommended_config
from vsd_analytics.live.status import FILE, Status, read_status, write_status
from vsd_analytics.live.watch import read_watch_status
from vsd_analytics.site.model import Broker, Site

NOW = datetime(2026, 11, 20, 12, tzinfo=UTC)
GONE_PID = 2**22 - 7
ALONE = f"{recommended_config()}persistence_location /var/lib/mosquitto/\n"
"""The recommended configuration without Debian's own file beside it."""


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return load_site(write_project(tmp_path / "project", port=1883))


def heartbeat(**changes: Any) -> dict[str, Any]:
    status = Status(started=NOW - timedelta(hours=2), state="listening", connected_since=NOW - timedelta(hours=1))
    for name in ("cam-1", "cam-2"):
        status.camera(name).last_ms = int(NOW.timestamp() * 1000) - 2000
    status.newest_ms = int(NOW.timestamp() * 1000) - 2000
    return {**status.as_dict(now=NOW), **changes}


def states(site: Site, told: dict[str, Any] | None) -> list[tuple[str, str]]:
    return [(f.subject, f.state) for f in examine_listener(site, status=told, now=NOW + timedelta(seconds=5))]


def test_a_listener_that_does_well_is_ok(site: Site) -> None:
    assert states(site, heartbeat()) == [("listener", "ok")]


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (None, "note"),
        ({"state": "stopped"}, "note"),
        ({"pid": GONE_PID}, "needs you"),
        ({"at": "2026-11-20T11:58:00+00:00"}, "needs you"),
        ({"state": "waiting for the broker", "error": "connection refused"}, "needs you"),
        ({"state": "cannot store", "error": "no space left"}, "needs you"),
        ({"rejected": 5}, "needs you"),
        ({"at": "yesterday"}, "needs you"),
        ({"state": "starting"}, "needs you"),
        ({"state": "starting", "started": NOW.isoformat()}, "note"),
    ],
)
def test_a_listener_in_trouble_is_reported(site: Site, told: dict[str, Any] | None, expected: str) -> None:
    assert states(site, None if told is None else heartbeat(**told))[0] == ("listener", expected)


def test_silent_cameras_rejects_gaps_and_qos_0_are_reported(site: Site) -> None:
    told = heartbeat(rejected={"bad-json": 3}, qos0=2)
    told["cameras"]["cam-1"]["missing"] = 4
    del told["cameras"]["cam-2"]
    found = {f.subject: f for f in examine_listener(site, status=told, now=NOW)}
    assert "cam-2" in found["live cameras"].detail
    assert "cam-1" not in found["live cameras"].detail
    assert "3 bad-json" in found["live records in quarantine"].detail
    assert "4 numbers" in found["live messages"].detail
    assert "QoS 0" in found["live delivery"].detail


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ({"state": "on", "error": None, "pictures": 100, "too_slow": 4}, None),
        ({"state": "on", "error": None, "pictures": 100, "too_slow": 6}, "6 of 100 pictures came while"),
        ({"state": "lost", "error": "it does not answer", "pictures": 0, "too_slow": 0}, "lost: it does not answer"),
        ({"state": "hung", "error": "the same picture", "pictures": 9, "too_slow": 0}, "hung: the same picture"),
        ({"state": "connecting", "error": None, "pictures": 0, "too_slow": 0}, "connecting: no picture yet"),
    ],
)
def test_live_cameras_in_trouble_are_reported(site: Site, source: dict[str, Any], expected: str | None) -> None:
    told = heartbeat(engine={"cameras": {"cam-1": source}, "picture_ms": 20.0})
    details = [f.detail for f in examine_listener(site, status=told, now=NOW) if f.subject == "pictures of cam-1"]
    assert len(details) == (expected is not None)
    assert all(expected in detail for detail in details if expected is not None)


def test_a_heartbeat_is_written_whole_and_read_again(site: Site) -> None:
    told = heartbeat()
    write_status(site.root, told)
    assert read_status(site.root) == told
    (site.root / FILE).write_text("{torn")
    assert read_status(site.root) is None
    assert told["pid"] == os.getpid()
    assert told["lag_s"] == 2.0
    assert told["cameras"]["cam-1"]["missing"] is None


@pytest.mark.parametrize("name", ["listen.json", "watch.json"])
def test_a_status_file_of_deep_json_is_as_none(site: Site, name: str) -> None:
    path = site.root / "status" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("[" * 100_000)
    assert (read_status(site.root), read_watch_status(site.root)) == (None, None)


def test_the_recommended_configuration_has_no_fault(tmp_path: Path) -> None:
    file = tmp_path / "mosquitto.conf"
    file.write_text(ALONE)
    assert config_faults(parse_config(file)) == []
    assert [f.state for f in examine_config(file)] == ["ok"]


def test_mosquittos_defaults_have_all_faults() -> None:
    assert len(config_faults({})) == 3
    assert len(config_faults({"persistence": "true"})) == 4


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("persistence false", "persistence"),
        ("autosave_interval 1800", "autosave_interval"),
        ("autosave_interval 0", "autosave_interval"),
        ("max_queued_messages 1000", "max_queued_messages"),
        ("max_queued_bytes 1000000", "max_queued_bytes"),
        ("max_inflight_messages 20", "max_inflight_messages"),
        ("persistent_client_expiration 2h", "persistent_client_expiration"),
    ],
)
def test_each_setting_that_loses_messages_is_reported(tmp_path: Path, line: str, words: str) -> None:
    file = tmp_path / "mosquitto.conf"
    file.write_text(f"{ALONE}\n{line}\n")
    (fault,) = config_faults(parse_config(file))
    assert words in fault


@pytest.mark.parametrize(
    "line", ["max_inflight_messages 1000", "autosave_interval 5", "persistent_client_expiration 1d"]
)
def test_what_is_as_good_is_accepted(tmp_path: Path, line: str) -> None:
    file = tmp_path / "mosquitto.conf"
    file.write_text(f"{ALONE}\n{line}\n")
    assert config_faults(parse_config(file)) == []


def test_saving_at_every_change_is_accepted_with_a_word_on_its_price(tmp_path: Path) -> None:
    file = tmp_path / "mosquitto.conf"
    file.write_text(f"{ALONE}\nautosave_on_changes true\n")
    assert [f.state for f in examine_config(file)] == ["ok", "note"]


def test_included_files_count(tmp_path: Path) -> None:
    (tmp_path / "conf.d").mkdir()
    (tmp_path / "conf.d" / "vsd.conf").write_text(recommended_config())
    file = tmp_path / "mosquitto.conf"
    file.write_text(f"# comment\npersistence false\npersistence_location /tmp/\ninclude_dir {tmp_path}/conf.d\n")
    assert config_faults(parse_config(file)) == []


def debian(folder: Path, *, included: str) -> Path:
    """Write the settings of the mosquitto.conf that Debian 12 installs, below a folder, with one included file."""
    (folder / "conf.d").mkdir(parents=True)
    (folder / "conf.d" / "vsd.conf").write_text(included)
    file = folder / "mosquitto.conf"
    settings = {
        "pid_file": folder / "mosquitto.pid",
        "persistence": "true",
        "persistence_location": f"{folder}/",
        "log_dest": f"file {folder}/mosquitto.log",
        "include_dir": folder / "conf.d",
        "user": os.environ.get("USER", "root"),  # the folders of a test are its own
    }
    file.write_text("".join(f"{key} {value}\n\n" for key, value in settings.items()))
    return file


def test_setting_that_keeps_the_broker_from_starting_is_reported(tmp_path: Path) -> None:
    (finding,) = examine_config(debian(tmp_path, included=ALONE))
    assert finding.state == "needs you"
    assert "persistence_location is there 2 times: the broker does not start" in finding.detail


@pytest.mark.skipif(MOSQUITTO is None, reason=WHY_NOT)
@pytest.mark.parametrize(("included", "starts"), [(recommended_config(), True), (ALONE, False)], ids=["as is", "twice"])
def test_recommended_configuration_starts_beside_that_of_debian(tmp_path: Path, included: str, starts: bool) -> None:
    port = free_port()
    file = debian(tmp_path, included=included.replace("listener 1883", f"listener {port}"))
    assert (examine_config_states(file) == ["ok"]) == starts
    broker = subprocess.Popen([str(MOSQUITTO), "-c", str(file)], stderr=subprocess.DEVNULL)
    try:
        assert is_listening(port, broker) == starts
    finally:
        broker.terminate()
        broker.wait(10)


def examine_config_states(file: Path) -> list[str]:
    return [f.state for f in examine_config(file)]


def is_listening(port: int, broker: subprocess.Popen[bytes]) -> bool:
    until_s = time.monotonic() + 10
    while broker.poll() is None and time.monotonic() < until_s:
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return True
        time.sleep(0.02)
    return False


def test_a_configuration_that_cannot_be_read_is_reported(tmp_path: Path) -> None:
    (finding,) = examine_config(tmp_path / "nowhere.conf")
    assert finding.state == "needs you"


def test_the_recommended_configuration_is_printed() -> None:
    done = CliRunner().invoke(cli, ["listen", "--broker-config"])
    assert done.output == recommended_config()
    assert done.exit_code == 0


def test_the_printed_configuration_has_the_port_of_the_project(site: Site) -> None:
    file = site.root / "vsd.toml"
    file.write_text(re.sub(r"(\[mqtt\]\n)", r"\1port = 18831\n", re.sub(r"\nport = .*", "", file.read_text())))
    done = CliRunner().invoke(cli, ["-C", str(site.root), "listen", "--broker-config"])
    assert "\nlistener 18831 127.0.0.1\n" in done.output
    assert "listener 1883 " not in done.output


def test_a_site_without_a_broker_cannot_listen_and_its_doctor_says_nothing_of_it(site: Site) -> None:
    file = site.root / "vsd.toml"
    file.write_text(file.read_text().partition("[mqtt]")[0])
    with pytest.raises(LiveError) as caught:
        CliRunner().invoke(cli, ["-C", str(site.root), "listen"], catch_exceptions=False, standalone_mode=False)
    assert caught.value.code == "E703"
    assert "broker" not in CliRunner().invoke(cli, ["-C", str(site.root), "doctor"]).output


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    if MOSQUITTO is None:
        pytest.skip(WHY_NOT)
    broker = Mosquitto(tmp_path_factory.mktemp("broker")).start()
    yield broker
    broker.stop()


def test_the_broker_is_asked_and_keeps_nothing_of_it(running: Mosquitto) -> None:
    answer = ask(Broker("127.0.0.1", running.port), password=None)
    assert answer.error is None
    assert answer.session_s >= 86_400
    assert answer.qos_max == 2
    assert answer.version is not None
    assert "mosquitto" in answer.version


def test_a_broker_that_is_not_there_is_reported_soon() -> None:
    assert "refused" in (ask(Broker("127.0.0.1", 1), password=None).error or "")


def test_somebody_who_speaks_no_mqtt_is_reported() -> None:
    import socket

    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        answer = ask(Broker("127.0.0.1", server.getsockname()[1]), password=None, timeout_s=0.3)
    assert answer.error is not None


def test_doctor_tells_of_listener_broker_and_configuration(tmp_path: Path, running: Mosquitto) -> None:
    root = write_project(tmp_path / "p", port=running.port)
    done = CliRunner().invoke(cli, ["-C", str(root), "doctor", "--broker-config", str(running.config)])
    assert "listener: it never ran" in done.output
    assert f"ok         broker 127.0.0.1:{running.port}: answers (mosquitto" in done.output
    assert f"ok         broker configuration {running.config}" in done.output


@pytest.mark.parametrize(
    ("lines", "is_judged"), [("", True), ("listener 1883 127.0.0.1\n", True), ("listener 1884\nport 0\n", False)]
)
def test_the_usual_configuration_is_judged_only_where_its_broker_has_the_port_of_the_site(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: str, is_judged: bool
) -> None:
    usual = tmp_path / "mosquitto.conf"
    usual.write_text(f"persistence false\n{lines}")
    monkeypatch.setattr(broker, "USUAL_CONFIG", usual)
    monkeypatch.setattr(broker, "_examine_broker", lambda *_, **__: iter(()))
    found = [f for f in broker.examine_live(site, now=NOW, environ={}) if str(usual) in f.subject + f.detail]
    assert [f.state == "needs you" for f in found] == [is_judged]


@pytest.mark.parametrize("has_site", [False, True])
def test_a_named_configuration_is_judged_without_a_project_and_without_a_broker_in_it(
    tmp_path: Path, has_site: bool
) -> None:
    config = tmp_path / "mosquitto.conf"
    config.write_text("persistence false\n")
    if has_site:
        (tmp_path / "vsd.toml").write_text(
            '[site]\nid = "s"\nname = "S"\ntimezone = "UTC"\n[[floor]]\nid = "g"\nname = "G"\n'
            '[[camera]]\nid = "cam-1"\nname = "C"\n'
        )
    bad = CliRunner().invoke(cli, ["-C", str(tmp_path), "doctor", "--broker-config", str(config)])
    assert f"needs you  broker configuration {config}" in bad.output
    printed = CliRunner().invoke(cli, ["listen", "--broker-config"]).output
    config.write_text(f"{printed}\npersistence_location {tmp_path}/\n")
    good = CliRunner().invoke(cli, ["-C", str(tmp_path), "doctor", "--broker-config", str(config)])
    assert f"ok         broker configuration {config}" in good.output
    assert ("only the machine and the broker configuration are checked" in good.output) is not has_site
    assert ("needs you" in good.output) is has_site, "of a project without records, the store does"
