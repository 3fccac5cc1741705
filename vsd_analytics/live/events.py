"""The events of an alarm: one when it starts, one for each change worth reporting, one when it ends."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal
from zoneinfo import ZoneInfo

from vsd_analytics.figures.alarms import Alarm
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

    @property
    def lasted_s(self) -> float:
        """Return for how long the situation had lasted."""
        return (self.at_ms - self.since_ms) / 1000

    @property
    def nearest_m(self) -> float | None:
        """Return the least distance within it, to the centimetre."""
        return None if self.nearest_mm is None else round(self.nearest_mm / 1000, 2)

    def as_dict(self, zone: ZoneInfo) -> dict[str, Any]:
        """Return the record that is sent: local times with offset, seconds, places rounded to half a metre.

        Args:
            zone: Zone of the local times.
        """
        return {
            "alarm": self.alarm,
            "rule": self.rule,
            "kind": self.kind,
            "event": self.event,
            "at": _local(self.at_ms, zone),
            "since": _local(self.since_ms, zone),
            "lasted_s": self.lasted_s,
            "site": self.site,
            "area": self.area,
            "camera": self.camera,
            "floor": self.floor,
            "x_m": _place_m(self.x_mm),
            "y_m": _place_m(self.y_mm),
            "n_people": self.n_people,
            "n_people_max": self.n_people_max,
            "nearest_m": self.nearest_m,
        }


def alarms_of(events: Sequence[AlarmEvent], zone: ZoneInfo) -> list[Alarm]:
    """Return what is known of each alarm: its last event, with when it started and ended.

    Args:
        events: In order of time.
        zone: Zone of the local times.
    """
    started: dict[str, int] = {}
    latest: dict[str, AlarmEvent] = {}
    for event in events:
        started.setdefault(event.alarm, event.at_ms)
        latest[event.alarm] = event
    return [
        Alarm(
            e.alarm,
            e.rule,
            e.kind,
            e.floor,
            e.camera,
            e.area,
            since=_instant(e.since_ms, zone),
            started=_instant(started[e.alarm], zone),
            ended=_instant(e.at_ms, zone) if e.event == "end" else None,
            lasted_s=e.lasted_s,
            n_people_max=e.n_people_max,
            nearest_m=e.nearest_m,
            x_m=_place_m(e.x_mm),
            y_m=_place_m(e.y_mm),
        )
        for e in latest.values()
    ]


def _place_m(mm: float | None) -> float | None:
    return None if mm is None else round(mm / _PLACE_STEP_MM) * _PLACE_STEP_MM / 1000


def _instant(ms: int, zone: ZoneInfo) -> datetime:
    return datetime.fromtimestamp(ms / 1000, tz=zone)


def _local(ms: int, zone: ZoneInfo) -> str:
    return _instant(ms, zone).isoformat(timespec="milliseconds")


class RuleAtCamera:
    """One rule at one camera, and the events of its alarms.

    Args:
        site: The project.
        rule: The rule.
        camera_id: The camera.
    """

    def __init__(self, site: Site, *, rule: AlarmRule, camera_id: str) -> None:
        self.rule, self._site_id = rule, site.site_id
        self._camera = site.camera(camera_id)
        self._for_ms, self._cooldown_ms = round(rule.for_s * 1000), round(rule.cooldown_s * 1000)
        self._update_ms = round(site.settings.update_s * 1000)

    def _id(self, since_ms: int, number: int = 0) -> str:
        """Return the id of an alarm: the BLAKE2 hash of site, rule, camera, when its situation began, and its number.

        The number distinguishes situations that began at the same instant.
        """
        rule = self.rule
        identity = json.dumps([self._site_id, rule.alarm_id, rule.kind, self._camera.camera_id, since_ms, number])
        return hashlib.blake2b(identity.encode(), digest_size=8).hexdigest()

    def _step_event(self, step: AlarmStep, at_ms: int, since_ms: int, *, number: int = 0, **seen: Any) -> AlarmEvent:
        """Return one step of an alarm; `seen` are the attributes of `AlarmEvent` from `x_mm` on."""
        rule, camera = self.rule, self._camera
        seen |= {"site": self._site_id, "camera": camera.camera_id, "floor": camera.floor_id, "area": rule.area_id}
        return AlarmEvent(self._id(since_ms, number), rule.alarm_id, rule.kind, step, at_ms, since_ms, **seen)
