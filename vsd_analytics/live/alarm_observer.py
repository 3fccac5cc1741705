"""The alarms of a listener: every stored batch goes through the alarm engine, which sends its events at once.

A listener that starts again sends no event twice: the engine first replays the records stored lately, and an event that
is in `alarms.jsonl` is not sent again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from datetime import datetime, timedelta
from typing import Any

import pyarrow as pa

from vsd_analytics.errors import VsdError
from vsd_analytics.live.alarms import AlarmEngine
from vsd_analytics.live.delivery import AlarmSender, Record
from vsd_analytics.live.events import AlarmEvent
from vsd_analytics.live.stored_frames import DAY_S, lookback_s, stored_minutes
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import Site

_BEFORE_S = 60.0
"""Alarms that are still open are replayed from this long before they began."""


class LiveAlarms:
    """Observes a listener (`listener.StoredObserver`).

    Args:
        site: The project, with its rules.
        delivery: Sends the events; its log holds the events sent before.
        clock: Returns the current instant.
        report: Called with lines for the log.
    """

    def __init__(
        self, site: Site, *, delivery: AlarmSender, clock: Callable[[], datetime], report: Callable[[str], None] = print
    ) -> None:
        self._site, self.delivery, self._clock, self._report = site, delivery, clock, report
        self._passed_over: set[str] = set()
        try:
            self.engine = self._warm(clock())
        except (VsdError, OSError) as error:
            report(f"alarms start without the records stored before: {error}")
            self.engine = AlarmEngine(site, start=clock())

    def on_stored(self, tables: Mapping[TableName, pa.Table]) -> None:
        """Take a batch that is durable."""
        self._send(self.engine.feed(tables, now=self._clock()))

    def on_tick(self, now: datetime) -> None:
        """Take the time, for cameras that fall silent."""
        self._send(self.engine.tick(now))
        self.delivery.publish_waiting()

    def stop(self) -> None:
        """Give the webhook a moment; events it has not taken by then are in alarms.jsonl."""
        if self.delivery.webhook is not None:
            self.delivery.webhook.stop(timeout_s=2.0)

    def as_dict(self) -> dict[str, Any]:
        """Return the state for a heartbeat: counts, no events."""
        webhook = self.delivery.webhook
        return {
            "open": len(self.engine.open_alarms),
            "told": self.delivery.n_sent,
            "too_late": self.engine.n_late,
            "without_track": self.engine.n_untracked,
            "not_logged": self.delivery.n_unlogged,
            "not_published": self.delivery.n_unpublished + self.delivery.n_dropped,
            "webhook": None
            if webhook is None
            else {
                "sent": webhook.n_sent,
                "waiting": webhook.n_waiting,
                "refused": webhook.n_refused,
                "dropped": webhook.n_dropped,
                "error": webhook.error,
            },
        }

    def _warm(self, now: datetime) -> AlarmEngine:
        """Return an engine that has replayed the records stored lately, and older ones of cameras with open alarms.

        The replay may begin in the middle of a situation. Such a situation seems to begin later than it did, so its
        alarm has another id than the one sent before. It is sent only if it is a gathering that still goes on.
        """
        site = self._site
        early = now - timedelta(seconds=lookback_s(site.alarms, lateness_s=site.settings.lateness_s))
        end = now + timedelta(seconds=site.settings.live_ahead_max_s)
        logged = {} if self.delivery.log is None else dict(self.delivery.log.open_alarms)
        rules = {r.alarm_id for r in site.alarms}
        known = {a: datetime.fromisoformat(r["since"]) for a, r in logged.items() if r.get("rule") in rules}
        cameras = {str(logged[alarm].get("camera")) for alarm in known}
        earliest = max(min([early, *known.values()]) - timedelta(seconds=_BEFORE_S), now - timedelta(seconds=DAY_S))
        engine = AlarmEngine(site)
        begins = {c.camera_id: earliest if c.camera_id in cameras else early for c in site.cameras}
        cut: list[AlarmEvent] = []
        for start, stop, only in ((earliest, early, cameras), (early, end, None)):
            for _, tables in stored_minutes(site, start, stop, cameras=only) if only != set() else ():
                events = engine.feed(tables)
                cut += [e for e in events if _is_cut(e, begins[e.camera])]
                self._send(e for e in events if not _is_cut(e, begins[e.camera]))
        for alarm, began in known.items():
            if logged[alarm].get("kind") == "silence":
                engine.watch(max(began, earliest), cameras=[str(logged[alarm].get("camera"))])
        engine.resume(now)
        still = {e.alarm for e in cut if e.kind == "gathering"}.intersection(engine.open_alarms)
        self._passed_over = {e.alarm for e in cut} - still
        self._send([e for e in cut if e.alarm in still])
        silent = {a for a, began in known.items() if logged[a].get("kind") == "silence" and began > earliest}
        for alarm in set(logged) - set(engine.open_alarms) - silent:
            self._end(alarm, now)
        return engine

    def _send(self, events: Iterable[AlarmEvent]) -> None:
        self._report_sent(self.delivery.send(e for e in events if e.alarm not in self._passed_over))

    def _end(self, alarm: str, now: datetime) -> None:
        """Send the end of an alarm that the replay did not find: it is more than a day old, or its rule is gone."""
        record = {} if self.delivery.log is None else self.delivery.log.open_alarms.get(alarm)
        if record:
            at = now.astimezone(self._site.zone)
            lasted_s = round((at - datetime.fromisoformat(record["since"])).total_seconds(), 3)
            ended = {**record, "event": "end", "at": at.isoformat(timespec="milliseconds"), "lasted_s": lasted_s}
            if self.delivery.send_record(ended):
                self._report_sent([ended])

    def _report_sent(self, records: list[Record]) -> None:
        for r in records:
            self._report(f"alarm {r['event']}: {r['rule']} at {r['camera']} since {r['since']}")


def _is_cut(event: AlarmEvent, begins: datetime) -> bool:
    """Return whether a situation may have begun before the records that were replayed."""
    return event.kind != "silence" and bool(event.since_ms < (begins.timestamp() + _BEFORE_S / 2) * 1000)
