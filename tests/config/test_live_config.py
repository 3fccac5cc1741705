"""`[mqtt]` of vsd.toml: what loads, what is refused, and that it never holds a password."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from site_text import site_text

from vsd_analytics.config.access_token import UnsafeTokenError, access_token
from vsd_analytics.config.broker_and_alarms import is_topic_filter
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, LiveError, VsdError
from vsd_analytics.live.mqtt import password_of
from vsd_analytics.site.model import Broker

SITE = site_text()


def broker(folder: Path, mqtt: str) -> Broker | None:
    (folder / "vsd.toml").write_text(SITE + mqtt, encoding="utf-8")
    return load_site(folder).broker


def the_problem(folder: Path, mqtt: str) -> VsdError:
    with pytest.raises(ConfigError) as caught:
        broker(folder, mqtt)
    (problem,) = caught.value.problems
    return problem


def test_without_mqtt_there_is_no_broker(tmp_path: Path) -> None:
    assert broker(tmp_path, "") is None


def test_a_host_is_enough(tmp_path: Path) -> None:
    assert broker(tmp_path, '[mqtt]\nhost = "localhost"\n') == Broker("localhost")
    assert Broker("localhost").topics == ("vsd/+/frames",)


def test_tls_changes_the_port_that_is_meant(tmp_path: Path) -> None:
    found = broker(tmp_path, '[mqtt]\nhost = "broker.example"\ntls = true\n')
    assert found is not None
    assert (found.port, found.is_tls) == (8883, True)


def test_everything_can_be_said(tmp_path: Path) -> None:
    for name in ("ca.pem", "cert.pem", "key.pem", "password"):
        (tmp_path / name).write_text("x")
    text = """[mqtt]
host = "10.0.0.7"
port = 8884
topics = ["engines/+/out", "hall/#"]
client_id = "listener-1"
username = "vsd"
password_file = "password"
tls = true
ca_file = "ca.pem"
cert_file = "cert.pem"
key_file = "key.pem"
status_topic = "vsd/shop/status"
figures_topic = "vsd/shop/today"
home_assistant = true
"""
    assert broker(tmp_path, text) == Broker(
        host="10.0.0.7",
        port=8884,
        topics=("engines/+/out", "hall/#"),
        client_id="listener-1",
        username="vsd",
        password_file=tmp_path / "password",
        is_tls=True,
        ca_file=tmp_path / "ca.pem",
        cert_file=tmp_path / "cert.pem",
        key_file=tmp_path / "key.pem",
        status_topic="vsd/shop/status",
        figures_topic="vsd/shop/today",
        is_home_assistant=True,
    )


@pytest.mark.parametrize(
    ("line", "code", "words"),
    [
        ("", "E123", "no host"),
        ('host = "h"\nport = 70000', "E124", "outside 1 to 65,535"),
        ('host = "h"\nport = 1883.5', "E124", "a whole number"),
        ('host = "h"\ntopics = ["vsd/cam+/frames"]', "E124", "no topic filter"),
        ('host = "h"\ntopics = "vsd/+/frames"', "E124", "a list of texts"),
        ('host = "h"\nstatus_topic = "vsd/#"', "E124", "no topic"),
        ('host = "h"\nfigures_topic = "vsd/+"', "E124", "no topic"),
        ('host = "h"\nhome_assistant = true', "E123", "no figures_topic"),
        ('host = "h"\npassword_file = "nowhere"', "E126", "no file"),
        ('host = "h"\npassword = "secret"', "E122", "no key"),
        ('host = "h"\ncert_file = "vsd.toml"', "E123", "no key_file"),
        ('host = "h"\ntls = "yes"', "E124", "true or false"),
    ],
)
def test_mistakes_are_reported(tmp_path: Path, line: str, code: str, words: str) -> None:
    problem = the_problem(tmp_path, f"[mqtt]\n{line}\n")
    assert problem.code == code
    assert words in problem.what


@pytest.mark.parametrize("text", ["a", "+", "#", "a/+/b", "a/#", "+/+", "/", "a//b"])
def test_topic_filters(text: str) -> None:
    assert is_topic_filter(text)


@pytest.mark.parametrize("text", ["", "a+", "+a/b", "#/a", "a#", "a/b#", "a\0b", "x" * 65_536])
def test_no_topic_filters(text: str) -> None:
    assert not is_topic_filter(text)


@given(st.text(alphabet="ab+#/", max_size=12))
def test_topic_filters_are_those_of_the_reference_client(text: str) -> None:
    from paho.mqtt.client import Client
    from paho.mqtt.enums import MQTTErrorCode

    assert is_topic_filter(text) == (
        Client._filter_wildcard_len_check(text.encode()) == MQTTErrorCode.MQTT_ERR_SUCCESS and len(text) > 0
    )


def test_the_password_is_the_environments_then_the_files_first_line(tmp_path: Path) -> None:
    file = tmp_path / "password"
    file.write_text("from the file\nsecond line\n")
    with_file = Broker("h", password_file=file)
    assert password_of(with_file, environ={"VSD_MQTT_PASSWORD": "from outside"}) == "from outside"
    assert password_of(with_file, environ={}) == "from the file"
    assert password_of(Broker("h"), environ={}) is None


@pytest.mark.parametrize("content", [b"", b"\nsecond", b"\xff\xfe\x00"])
def test_a_password_file_without_a_password_is_reported(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "password"
    file.write_bytes(content)
    with pytest.raises(LiveError) as caught:
        password_of(Broker("h", password_file=file), environ={})
    assert caught.value.code == "E704"


def test_a_token_is_private_from_its_first_moment_and_the_same_at_the_next_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing may change the mode afterwards: in between, others could read it."""
    monkeypatch.setattr(Path, "chmod", lambda *_: pytest.fail("the file was readable before"))
    path = tmp_path / "secrets" / "token"
    token = access_token(path, variable="VSD_TOKEN", environ={})
    assert path.stat().st_mode & 0o777 == 0o600
    assert access_token(path, variable="VSD_TOKEN", environ={}) == token
    assert access_token(path, variable="VSD_TOKEN", environ={"VSD_TOKEN": "x" * 16}) == "x" * 16


@pytest.mark.parametrize("text", ["short", "has a blank in the middle", "", "ünsafe-token-of-letters"])
def test_a_token_that_keeps_nobody_out_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(UnsafeTokenError, match="16 or more"):
        access_token(tmp_path / "token", variable="VSD_TOKEN", environ={"VSD_TOKEN": text})
    (tmp_path / "token").write_bytes(b"\xff\xfe")
    with pytest.raises(UnsafeTokenError):
        access_token(tmp_path / "token", variable="VSD_TOKEN", environ={})
