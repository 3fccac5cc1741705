"""The figures of the day by MQTT: unknown is null, small counts are hidden, Home Assistant finds its sensors."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import paho.mqtt.client as paho
import pytest
from jinja2 import Environment
from live.local_broker import MOSQUITTO, WHY_NOT, Mosquitto, frame, write_project
from paho.mqtt.enums import CallbackAPIVersion
from report.sample_cards import SATURDAY, card, hour, level

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.live.day_topics import day_figures
from vsd_analytics.live.home_assistant import discovery_messages
from vsd_analytics.site.model import Broker, Site

TEXT = {"type": "string", "minLength": 1}
DEVICE_TEXTS = (
    *("configuration_url", "hw_version", "manufacturer", "model", "model_id", "name"),
    *("serial_number", "suggested_area", "sw_version", "via_device"),
)
DEVICE = {
    "type": "object",
    "anyOf": [{"required": ["identifiers"]}, {"required": ["connections"]}],
    "additionalProperties": False,
    "properties": {
        "identifiers": {"type": "array", "items": TEXT, "minItems": 1},
        "connections": {"type": "array"},
        **dict.fromkeys(DEVICE_TEXTS, TEXT),
    },
}
SENSOR_TEXTS = (
    *("availability_template", "availability_topic", "default_entity_id", "encoding", "entity_picture"),
    *("json_attributes_template", "json_attributes_topic", "last_reset_value_template", "name"),
    *("payload_available", "payload_not_available", "unit_of_measurement", "value_template"),
)
SENSOR = {
    "type": "object",
    "required": ["state_topic", "unique_id", "device"],
    "additionalProperties": False,
    "properties": {
        **dict.fromkeys(SENSOR_TEXTS, TEXT),
        "enabled_by_default": {"type": "boolean"},
        "force_update": {"type": "boolean"},
        "state_topic": {"type": "string", "pattern": "^[^+#]+$"},
        "unique_id": {"type": "string", "pattern": "^[a-zA-Z0-9_-]+$"},
        "availability": {"type": "array"},
        "availability_mode": {"enum": ["all", "any", "latest"]},
        "expire_after": {"type": "integer", "minimum": 0},
        "suggested_display_precision": {"type": "integer"},
        "qos": {"enum": [0, 1, 2]},
        "icon": {"type": "string", "pattern": "^mdi:[a-z-]+$"},
        "entity_category": {"enum": ["config", "diagnostic"]},
        "device_class": {"enum": ["enum"]},
        "options": {"type": "array", "items": TEXT, "minItems": 1},
        "state_class": {"enum": ["measurement", "total", "total_increasing"]},
        "device": DEVICE,
        "origin": {
            "type": "object",
            "required": ["name"],
            "additionalProperties": False,
            "properties": dict.fromkeys(("name", "sw_version", "support_url"), TEXT),
        },
    },
    # an enum has options and neither unit nor state class
    "if": {"required": ["options"]},
    "then": {"properties": {"unit_of_measurement": False, "state_class": False}, "required": ["device_class"]},
}
"""The keys that Home Assistant documents for sensors found by MQTT discovery."""
CONFIG_TOPIC = re.compile(r"homeassistant/sensor/[a-zA-Z0-9_-]+/config")
ASKED = 'figures_topic = "vsd/shop/today"\nhome_assistant = true\nstatus_topic = "vsd/shop/status"\n'


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return load_site(write_project(tmp_path / "site", port=1883, more=ASKED))


def broker_of(site: Site) -> Broker:
    assert site.broker is not None
    return site.broker


def shown(site: Site, message: dict[str, Any]) -> dict[str, str]:
    """Return what Home Assistant's templates make of a message, by sensor."""
    configs = discovery_messages(site, broker_of(site), site.floors[0]).values()
    return {
        str(c["name"]): Environment().from_string(str(c["value_template"])).render(value_json=message) for c in configs
    }


def test_discovery_messages_have_documented_fields_only_and_one_device(site: Site) -> None:
    messages = discovery_messages(site, broker_of(site), site.floors[0])
    assert len(messages) == 5
    for topic, config in messages.items():
        assert CONFIG_TOPIC.fullmatch(topic), topic
        jsonschema.validate(config, SENSOR)
        assert topic.split("/")[2] == config["unique_id"]
        assert config["availability_topic"] == "vsd/shop/status"
    assert len({c["unique_id"] for c in messages.values()}) == 5
    assert len({json.dumps(c["device"]) for c in messages.values()}) == 1
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**config, "state_topics": "a/b"}, SENSOR)


@pytest.mark.parametrize(("state", "is_there"), [("listening", True), ("stopped", False), ("offline", False)])
def test_sensors_are_unavailable_while_the_listener_is_off(site: Site, state: str, is_there: bool) -> None:
    [config, *_] = discovery_messages(site, broker_of(site), site.floors[0]).values()
    template = Environment().from_string(str(config["availability_template"]))
    assert template.render(value_json={"state": state}) == ("online" if is_there else "offline")
    without = discovery_messages(site, replace(broker_of(site), status_topic=None), site.floors[0])
    assert not any("availability_topic" in c for c in without.values())


def test_what_is_unknown_is_null_and_shown_as_unknown_never_as_zero(site: Site) -> None:
    nothing = card(so_far=level(SATURDAY, None, usual=None, state="not_enough_data"), hours=())
    message = day_figures(nothing, site, site.floors[0])
    assert (message["violations"], message["last_hour"], message["position"]) == (None, None, None)
    values = shown(site, message)
    assert values.pop("Cameras without data") == "0"
    assert set(values.values()) == {"None"}, "which Home Assistant takes for unknown"
    assert day_figures(card(so_far=None, hours=()), site, site.floors[0])["state"] == "closed"


def test_counts_are_those_of_the_card_for_the_operator_s_own_tools(site: Site) -> None:
    for n in (0, 1, 4, 27):
        made = card(so_far=level(SATURDAY, float(n)), hours=(hour(SATURDAY, 9, float(n)),))
        message = day_figures(made, site, site.floors[0])
        assert (message["violations"], message["last_hour"]["violations"]) == (n, n)


def test_home_assistant_without_a_topic_for_figures_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="1 mistake"):
        load_site(write_project(tmp_path / "p", port=1883, more="home_assistant = true\n"))
    with pytest.raises(ConfigError, match="1 mistake"):
        load_site(write_project(tmp_path / "q", port=1883, more='figures_topic = "vsd/#"\n'))


@pytest.mark.skipif(MOSQUITTO is None, reason=WHY_NOT)
def test_published_figures_stay_at_the_broker_for_whoever_comes_later(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broker = Mosquitto(tmp_path / "broker").start()
    try:
        root = write_project(tmp_path / "shop", port=broker.port, n_cameras=1, more=ASKED)
        begin = datetime(2026, 11, 9, 8, tzinfo=UTC)
        seconds = np.arange(0, 3600, 3)
        lines = [frame(0, at=begin + timedelta(seconds=int(s)))[1] for s in seconds]
        (root / "frames.jsonl").write_bytes(b"\n".join(lines))
        clock = ("-C", str(root), "--now", "2026-11-09T10:05+01:00")
        assert run(cli, [*clock, "ingest", str(root / "frames.jsonl")]) == 0
        assert run(cli, [*clock, "today", "--exact", "--publish", "--out", str(tmp_path)]) == 0
        assert "6 messages published below vsd/shop/today" in "".join(capsys.readouterr())
        found: dict[str, Any] = {}
        reader = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        reader.on_message = lambda _c, _d, m: found.update({m.topic: (m.retain, json.loads(m.payload))})
        reader.connect("127.0.0.1", broker.port)
        reader.subscribe([("vsd/shop/today/#", 1), ("homeassistant/#", 1)])
        until = datetime.now(tz=UTC) + timedelta(seconds=10)
        while len(found) < 6 and datetime.now(tz=UTC) < until:
            reader.loop(0.1)
        reader.disconnect()
    finally:
        broker.stop()
    assert sum(bool(CONFIG_TOPIC.fullmatch(topic)) for topic in found) == 5
    assert all(is_retained for is_retained, _ in found.values())
    _, message = found["vsd/shop/today/ground"]
    assert message["last_hour"]["hour"] == 9
    assert message["violations"] == message["last_hour"]["violations"] == 1


def test_publishing_without_a_topic_says_what_to_add(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = write_project(tmp_path / "shop", port=1883)
    assert run(cli, ["-C", str(root), "today", "--exact", "--publish"]) == 2
    assert "figures_topic" in capsys.readouterr().err
