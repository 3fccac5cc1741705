"""Discovery messages: Home Assistant then shows the figures of the day as sensors of one device per floor.

Source: Home Assistant's documentation of MQTT discovery and of the MQTT sensor. A template that gives `None`, as that
of a JSON null does, sets the sensor to unknown.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from vsd_analytics.live.day_topics import day_topic
from vsd_analytics.site.model import Broker, Floor, Site
from vsd_analytics.version import VERSION

PREFIX: Final = "homeassistant"
EXPIRES_S: Final = 3 * 3600
"""Without an update for so long a sensor is unavailable: nobody knows what the hours since then were like."""


class _Sensor(NamedTuple):
    """A figure of the day: its key, its name, where it is in the JSON object, unit and icon."""

    key: str
    name: str
    value: str
    unit: str | None
    icon: str


_SENSORS: Final = (
    _Sensor("violations", "Violations today", "violations", "violations", "mdi:account-multiple"),
    _Sensor("usual", "Violations beside usual", "position", None, "mdi:gauge"),
    _Sensor("hour_violations", "Violations last hour", "last_hour.violations", "violations", "mdi:account-multiple"),
    _Sensor("hour_people", "People in view last hour", "last_hour.people_in_view", "people", "mdi:account-group"),
    _Sensor("silent_cameras", "Cameras without data", "silent_cameras", "cameras", "mdi:camera-off"),
)


def discovery_messages(site: Site, broker: Broker, floor: Floor) -> dict[str, dict[str, Any]]:
    """Return the retained messages that announce a floor's sensors, by topic.

    Args:
        site: The site.
        broker: Where figures are published; with a `status_topic` the sensors are unavailable while the listener is.
        floor: The floor.
    """
    device_id = f"vsd-{site.site_id}-{floor.floor_id}"
    return {
        f"{PREFIX}/sensor/{device_id}-{sensor.key}/config": _config(sensor, site, broker, floor, device_id=device_id)
        for sensor in _SENSORS
    }


def _config(sensor: _Sensor, site: Site, broker: Broker, floor: Floor, *, device_id: str) -> dict[str, Any]:
    topic = day_topic(broker, floor)
    parent = sensor.value.partition(".")[0]
    template = f"{{{{ value_json.{sensor.value} }}}}"
    if "." in sensor.value:
        template = f"{{{{ value_json.{sensor.value} if value_json.{parent} else none }}}}"
    config: dict[str, Any] = {
        "name": sensor.name,
        "unique_id": f"{device_id}-{sensor.key}",
        "state_topic": topic,
        "value_template": template,
        "expire_after": EXPIRES_S,
        "icon": sensor.icon,
        "qos": 1,
        "device": {
            "identifiers": [device_id],
            "name": f"{site.name}, {floor.name}",
            "manufacturer": "vsd_analytics",
            "model": "Figures of the day",
            "sw_version": VERSION,
        },
        "origin": {"name": "vsd_analytics", "sw_version": VERSION},
    }
    if sensor.unit is None:
        config |= {"device_class": "enum", "options": ["below", "within", "above"]}
    else:
        config |= {"unit_of_measurement": sensor.unit, "state_class": "measurement"}
    if sensor.key == "violations":
        config["json_attributes_topic"] = topic
    if broker.status_topic is not None:
        config["availability_topic"] = broker.status_topic
        config["availability_template"] = "{{ 'offline' if value_json.state in ('offline', 'stopped') else 'online' }}"
    return config
