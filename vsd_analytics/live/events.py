"""The events of an alarm: one when it starts, one for each change worth reporting, one when it ends."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal
from zoneinfo import ZoneInfo

from vsd_analytics.site.model import AlarmKind, AlarmRule, Site

AlarmStep = Literal["start", "update", "end"]
_STEPS = ("start", "update", "end")
_PLACE_STEP_MM = 500


@dataclass(frozen=True, slots=True)
class AlarmEvent:
    """One step of an alarm. It holds no track id: what leaves the site says that people were there, not who.

    Attributes:
        alarm: Id of the alarm, the same in every replay and re-delivery: 16 hexadecimal digits.
        rule: `id` of the `[[alarm]]`.
        kind: "gathering", "contact" or "silence".
        event: "start", "update" or "end".
        at_ms: UTC milliseconds; of an end, when it was last true (silence: when the camera sent again).
        since_ms: When the situation began.
        site, camera, floor: Ids of the place.
        area: Area of the rule, None when it has none.
        x_mm, y_mm: Mean place of its people, None when unknown.
        n_people: People in it now; None for a silence.
        n_people_max: Most people in it since it began.
        nearest_mm: Least distance within it since it began.
    """

    alarm: str
    rule: str
    kind: AlarmKind
    event: AlarmStep
    at_ms: int
    since_ms: int
    site: str
    camera: str
    floor: str
    area: str | None = None
    x_mm: float | None = None
    y_mm: float | None = None
    n_people: int | None = None
    n_people_max: int | None = None
    nearest_mm: int | None = None

    @property
    def order(self) -> tuple[Any, ...]:
        """Return the sort key of events: time, then camera and alarm, then its steps."""
        return self.at_ms, self.camera, self.rule, self.alarm, _STEPS.index(self.event)

    def as_dict(self, zone: ZoneInfo) -> dict[str, Any]:
        """Return the record that is sent: local times with offset, seconds, places rounded to half a metre.

        Args:
            zone: Zone of the local times.
        """

        def metres(mm: float | None) -> float | None:
            return None if mm is None else round(mm / _PLACE_STEP_MM) * _PLACE_STEP_MM / 1000

        return {
            "alarm": self.alarm,
            "rule": self.rule,
            "kind": self.kind,
            "event": self.event,
            "at": _local(self.at_ms, zone),
            "since": _local(self.since_ms, zone),
            "lasted_s": (self.at_ms - self.since_ms) / 1000,
            "site": self.site,
            "area": self.area,
            "camera": self.camera,
            "floor": self.floor,
            "x_m": metres(self.x_mm),
            "y_m": metres(self.y_mm),
            "n_people": self.n_people,
            "n_people_max": self.n_people_max,
            "nearest_m": None if self.nearest_mm is None else round(self.nearest_mm / 1000, 2),
        }


def _local(ms: int, zone: ZoneInfo) -> str:
    return datetime.fromtimestamp(ms / 1000, tz=zone).isoformat(timespec="milliseconds")


def alarm_id(site: Site, rule: AlarmRule, *, camera_id: str, since_ms: int, number: int = 0) -> str:
    """Return the id of an alarm: the BLAKE2 hash of site, rule, camera, when its situation began, and its number.

    Args:
        site: The project.
        rule: The rule.
        camera_id: The camera.
        since_ms: When the situation began.
        number: Distinguishes situations that began at the same instant.
    """
    identity = json.dumps([site.site_id, rule.alarm_id, rule.kind, camera_id, since_ms, number])
    return hashlib.blake2b(identity.encode(), digest_size=8).hexdigest()
