"""Cameras that send nothing in opening hours."""

from __future__ import annotations

from datetime import datetime
from functools import lru_cache

from vsd_analytics.live.events import AlarmEvent, AlarmStep, RuleAtCamera
from vsd_analytics.site.model import AlarmRule, Site
from vsd_analytics.warehouse.dimensions import QUARTER_MS, is_open
from vsd_analytics.warehouse.owner_spans import camera_life

FOREVER_MS = 2**62
_QUARTERS_MAX = 8 * 96
"""How far ahead the closing time is looked for: 8 days; a site that is open for longer counts as never closing."""


class Opening:
    """The opening hours of a site in quarter-hours, as the calendar of the reports counts them.

    Args:
        site: The project.
        is_always: Treat the site as always open.
        life: Instants from which and to which a camera is there, UTC milliseconds; outside the site is closed for it.
    """

    def __init__(
        self, site: Site, *, is_always: bool = False, life: tuple[int, int] = (-FOREVER_MS, FOREVER_MS)
    ) -> None:
        zone = site.zone
        self._first_ms, self._end_ms = life
        self._is_always = is_always or (not site.hours.weeks and not site.closed)

        @lru_cache(maxsize=4 * _QUARTERS_MAX)
        def is_open_in(quarter: int) -> bool:
            local = datetime.fromtimestamp(quarter * QUARTER_MS / 1000, tz=zone)
            return is_open(site, local.date(), local.hour * 60 + local.minute)

        self._is_open_in = is_open_in

    def is_open(self, ts_ms: int) -> bool:
        """Return whether the site is open at an instant."""
        return self._first_ms <= ts_ms < self._end_ms and (self._is_always or self._is_open_in(ts_ms // QUARTER_MS))

    def opens(self, ts_ms: int, *, before_ms: int) -> int | None:
        """Return the first open instant from `ts_ms` on, None when there is none before `before_ms`."""
        ts_ms, before_ms = max(ts_ms, self._first_ms), min(before_ms, self._end_ms)
        while ts_ms < before_ms:
            if self.is_open(ts_ms):
                return ts_ms
            ts_ms = (ts_ms // QUARTER_MS + 1) * QUARTER_MS
        return None

    def closes(self, ts_ms: int) -> int:
        """Return when the site closes next after an instant at which it is open."""
        if self._is_always:
            return self._end_ms
        quarter = ts_ms // QUARTER_MS
        last = quarter + _QUARTERS_MAX
        while quarter < last and self._is_open_in(quarter):
            quarter += 1
        return min(quarter * QUARTER_MS, self._end_ms)


class Silence(RuleAtCamera):
    """One rule of the kind "silence" at one camera.

    A silence begins with the camera's last record, or when the site opens if that is later. It ends with the camera's
    next record, or when the site closes. A silence shorter than `for_s` within one opening gives no alarm.

    Args:
        site: The project.
        rule: The rule.
        camera_id: The camera.
    """

    def __init__(self, site: Site, *, rule: AlarmRule, camera_id: str) -> None:
        super().__init__(site, rule=rule, camera_id=camera_id)
        life = camera_life(site, site.camera(camera_id))
        self._opening = Opening(site, is_always=not rule.is_open_only, life=life)
        self._from_ms: int | None = None  # silent from here on, unless the site is closed
        self._quiet_ms = -FOREVER_MS
        self._since_ms: int | None = None  # of the open alarm
        self._reported_ms = self._closes_ms = 0

    @property
    def open_alarms(self) -> list[str]:
        """Return the id of the alarm that has started and not ended, if there is one."""
        return [] if self._since_ms is None else [self._id(self._since_ms)]

    def hear(self, ts_ms: int) -> list[AlarmEvent]:
        """Take a record of this instant, the latest so far."""
        events = [] if self._from_ms is None else self._until(ts_ms, is_heard=True)
        if self._since_ms is not None:
            events.append(self._end(ts_ms))
        self._from_ms = ts_ms
        return events

    def pass_time(self, ts_ms: int) -> list[AlarmEvent]:
        """Note that the camera sent nothing more of any instant before `ts_ms`."""
        if self._from_ms is None:
            return []
        return self._until(ts_ms, is_heard=False)

    def watch(self, ts_ms: int) -> None:
        """Expect records from `ts_ms` on, when the camera has sent none yet."""
        if self._from_ms is None:
            self._from_ms = ts_ms

    def _until(self, ts_ms: int, *, is_heard: bool) -> list[AlarmEvent]:
        """Return the events of the silence up to `ts_ms`; at that instant itself only a start, when a record came."""
        events: list[AlarmEvent] = []
        while self._from_ms is not None:
            if self._since_ms is None:
                if ts_ms - self._from_ms < self._for_ms:
                    break
                since = self._opening.opens(self._from_ms, before_ms=ts_ms)
                if since is None:
                    self._from_ms = max(self._from_ms, ts_ms // QUARTER_MS * QUARTER_MS)
                    break
                due, closes = max(since + self._for_ms, self._quiet_ms), self._opening.closes(since)
                self._from_ms = since
                if due >= closes and closes < ts_ms:
                    self._from_ms = closes
                elif due < min(closes, ts_ms) or (is_heard and due == ts_ms < closes):
                    self._since_ms, self._closes_ms = since, closes
                    events.append(self._event("start", due))
                else:
                    break
            else:
                due = min(self._reported_ms + self._update_ms, self._closes_ms)
                if due >= ts_ms:
                    break
                events.append(self._end(due) if due == self._closes_ms else self._event("update", due))
        return events

    def _end(self, at_ms: int) -> AlarmEvent:
        event = self._event("end", at_ms)
        self._since_ms, self._from_ms, self._quiet_ms = None, at_ms, at_ms + self._cooldown_ms
        return event

    def _event(self, step: AlarmStep, at_ms: int) -> AlarmEvent:
        since_ms = self._since_ms if self._since_ms is not None else at_ms
        self._reported_ms = at_ms
        return self._step_event(step, at_ms, since_ms)
