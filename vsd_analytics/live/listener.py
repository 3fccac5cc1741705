"""`vsd listen`: live messages into the store. A message is acknowledged only after its records are durable.

One thread talks to the broker and appends to the spool; folding has a process, the HTTP server and what looks at
pictures have threads that wait for it. Every batch: read, check, quarantine, append, call the observers, acknowledge.
"""

from __future__ import annotations

import contextlib
import json
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, Protocol

import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.errors import LiveError, VsdError
from vsd_analytics.ingest.reading.adapter import Rejected
from vsd_analytics.live.batches import (
    FOLD_ROWS,
    FOLD_SEGMENTS,
    GRACE_S,
    ClockAgreement,
    ReceivedMessage,
    delays_s,
    is_due,
    next_fold_s,
)
from vsd_analytics.live.decode import Prepared, Preparer
from vsd_analytics.live.folding import Folded, Folding
from vsd_analytics.live.mapped import mapped_readers, topics_of
from vsd_analytics.live.message_queue import MessageDoor
from vsd_analytics.live.mqtt import SESSION_MIN_S, WINDOW, BrokerLink
from vsd_analytics.live.quarantining import LiveQuarantine
from vsd_analytics.live.status import CANNOT_STORE, CLOCKS_DISAGREE, LISTENING, Status, offline, write_status
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.model import Broker, Site
from vsd_analytics.store.layout import segment_paths
from vsd_analytics.store.seals import SEALED
from vsd_analytics.store.store import Store

LINGER_S = 1.0
FOLD_EVERY_S = 3600.0
STATUS_EVERY_S = 5.0
CAMERAS_SHOWN = 5
_STEP_MAX_S = 0.25
_DOOR_STEP_S = 0.05
_QUIET_S = 1.0


class StoredObserver(Protocol):
    """An object that is called with the stored records, such as the alarms."""

    def on_stored(self, tables: Mapping[TableName, pa.Table]) -> None:
        """Take a batch that is durable and not acknowledged yet; after a crash the same rows may come again."""

    def on_tick(self, now: datetime) -> None:
        """Take the time, about every `status_every_s`, also when no message comes."""


class Listener:
    """Stores the messages of one site: those of its broker, those of another door, or both.

    Args:
        site: The site.
        broker: Its broker; None = none.
        password: Password of the broker's user; None = none.
        clock: Returns the current instant, for the limits of live times, for lag and status.
        door: Where messages come in beside the broker: by HTTP, or of pictures; None = nowhere. The listener closes it.
        observers: Called with every durable batch.
        fold_every_s: Folds a minute after each multiple of this.
        status_every_s: Seconds between two heartbeats.
        linger_s: How long a message waits for others before it is stored.
        window: Messages held at most.
        seed: Seed of the jitter of waiting times.
        report: Called with lines for the log.
    """

    def __init__(
        self,
        site: Site,
        *,
        broker: Broker | None,
        password: str | None,
        clock: Callable[[], datetime],
        door: MessageDoor | None = None,
        observers: Sequence[StoredObserver] = (),
        fold_every_s: float = FOLD_EVERY_S,
        status_every_s: float = STATUS_EVERY_S,
        linger_s: float = LINGER_S,
        window: int = WINDOW,
        seed: int = 0,
        report: Callable[[str], None] = lambda _line: None,
    ) -> None:
        self.site, self.broker, self.door = site, broker, door
        self.status = Status(started=clock())
        self._clock, self._observers, self._report = clock, observers, report
        self._fold_every_s, self._status_every_s, self._linger_s = fold_every_s, status_every_s, linger_s
        self._store = Store(site.acknowledged, site_id=site.site_id)
        self._folding = Folding(self._store.root, site_id=site.site_id, ballast_mb=site.settings.ballast_mb)
        readers = mapped_readers(site)
        self._preparer = Preparer(site, now=clock(), readers=readers)
        self._delays_s = partial(delays_s, seed=seed)
        self._store_waiting_s = self._delays_s()
        self._store_again_s = 0.0
        self._fold_at_s = next_fold_s(clock().timestamp(), every_s=fold_every_s)
        self._fold_again_s = 0.0
        self._spooled_since_fold = [0, 0]
        self._status_at_s = 0.0
        self._is_refused = False
        names = (broker and f"mqtt://{broker.host}:{broker.port}", door and door.name)
        self._quarantines = [LiveQuarantine(site, source=name, now=clock()) for name in names if name]
        self._agreement = ClockAgreement()
        self._disagreement: str | None = None
        self._epoch_reported = 0
        self._error_reported: str | None = None
        self.link = (
            None
            if broker is None
            else BrokerLink(
                replace(broker, topics=topics_of(broker.topics, readers)),
                password=password,
                session_s=max(SESSION_MIN_S, int(site.settings.live_late_max_s)),
                payload_max_bytes=int(site.settings.line_max_bytes),
                delays_s=self._delays_s,
                will=offline(self.status.started),
                window=window,
            )
        )

    def run(
        self, *, should_stop: Callable[[], bool], is_once: bool = False, connect_timeout_s: float | None = None
    ) -> Status:
        """Listen until asked to stop; then store and acknowledge the messages held, and leave.

        Args:
            should_stop: Called several times a second.
            is_once: Stop when the broker has sent nothing for a second, and fold.
            connect_timeout_s: Give up when there is no connection for so long at the start; None = never.

        Returns:
            The counts of this run.

        Raises:
            LiveError: E701, no connection within `connect_timeout_s`; E702, another client took over the session.
        """
        began_s = time.monotonic()
        self._count_spool()
        is_fold_owed = self.status.spool_segments > 0
        try:
            while not should_stop():
                self._wait()
                self._note_link()
                if self._is_store_due():
                    self.store_held()
                if self._is_door_due():
                    self.store_offered()
                self._start_or_end_fold(is_owed=is_fold_owed)
                is_fold_owed = False
                if time.monotonic() >= self._status_at_s:
                    self.beat()
                if self.link is not None and self.link.epoch == 0 and connect_timeout_s is not None:
                    self._give_up_after(connect_timeout_s, since_s=began_s)
                if is_once and self._is_quiet(began_s):
                    break
            if self.link is not None and self.link.held:
                self.store_held()
            if self._is_door_due(is_last=True):
                self.store_offered()
            if is_once:
                self._fold_now()
        finally:
            self._folding.stop()
            with contextlib.suppress(OSError):
                for quarantine in self._quarantines:
                    quarantine.close()
            self.status.state = "stopped"
            self.beat()
            for opened in (self.door, self.link):
                if opened is not None:
                    opened.close()
        return self.status

    def store_held(self) -> bool:
        """Store the broker's messages and acknowledge them; return False, with nothing done, when disk or key refused.

        The acknowledgement comes last: the broker forgets a message with it. A crash before it makes the broker send
        the messages again, and the fold recognises the records that are stored already.
        """
        assert self.link is not None
        deliveries = self.link.take()
        ready = self._stored(deliveries, self._quarantines[0])
        if ready is None:
            return False
        self.status.n_acknowledged += self.link.acknowledge(deliveries)
        return True

    def store_offered(self) -> bool:
        """Store the messages of the other door and answer them; return False as `store_held`."""
        assert self.door is not None
        offered = self.door.take()
        deliveries = [message for one in offered for message in one.messages]
        first = self._preparer.n_messages + 1
        ready = self._stored(deliveries, self._quarantines[-1])
        if ready is None:
            return False
        bad: dict[int, list[Rejected]] = {}
        for r in ready.rejected:
            bad.setdefault(r.line - first, []).append(r)
        self.status.n_acknowledged += len(deliveries)
        self.door.settle(offered, bad)
        return True

    def _stored(self, deliveries: Sequence[ReceivedMessage], quarantine: LiveQuarantine) -> Prepared | None:
        """Make good and bad records of messages durable; return None when disk or key refused."""
        now = self._clock()
        try:
            ready = self._preparer.prepare(deliveries, now=now)
            quarantine.add(ready, now=now)
            n_segments = 0
            for name in reversed(TABLES):  # a frame is stored after the persons it counts
                rows = ready.tables.get(name)
                if rows is not None and rows.num_rows:
                    self._store.append(name, rows, engines=ready.engines)
                    n_segments += 1
        except (VsdError, OSError) as error:
            # the messages stay held and fill the window, so that the broker queues the rest on its own disk
            self._store_again_s, self._is_refused = time.monotonic() + next(self._store_waiting_s), True
            self._report_error(f"nothing can be stored, so nothing is acknowledged: {error}", state=CANNOT_STORE)
            return None
        self._store_waiting_s, self._store_again_s, self._is_refused = self._delays_s(), 0.0, False
        self._note_times(ready, now=now)
        self._show(ready.tables)
        self._note_stored(deliveries, ready.tables, n_segments=n_segments)
        self.status.n_rejected.update(Counter(r.reason for r in ready.rejected))
        self.status.n_dropped.update(ready.n_dropped)
        return ready

    def beat(self) -> None:
        """Write the heartbeat, publish it, and pass the time to the observers."""
        now = self._clock()
        status = self.status.as_dict(now=now)
        write_status(self.site.root, status)
        if self.link is not None and self.link.broker.status_topic is not None:
            self.link.publish(self.link.broker.status_topic, json.dumps(status).encode(), retain=True)
        for observer in self._observers:
            self._guarded(observer.on_tick, now)
        self._status_at_s = time.monotonic() + self._status_every_s

    def _wait(self) -> None:
        """Wait for messages of the broker, of the other door, or for the clock."""
        patience_s = self._patience_s()
        if self.link is not None:
            self.link.step(patience_s if self.door is None else min(patience_s, _DOOR_STEP_S))
        elif self.door is not None:
            self.door.wait(patience_s, not_before_s=self._store_again_s)

    def _patience_s(self) -> float:
        until_s = [_STEP_MAX_S, self._status_at_s - time.monotonic()]
        if self.link is not None and self.link.held:
            wake_s = max(self.link.first_held_s + self._linger_s, self._store_again_s)
            until_s.append(wake_s - time.monotonic())
        return max(0.0, min(until_s))

    def _is_store_due(self) -> bool:
        now_s = time.monotonic()
        return (
            self.link is not None
            and now_s >= self._store_again_s
            and is_due(
                len(self.link.held),
                n_bytes=self.link.held_bytes,
                age_s=now_s - self.link.first_held_s,
                window=self.link.window,
                linger_s=self._linger_s if self.link.is_connected else 0.0,
            )
        )

    def _is_door_due(self, *, is_last: bool = False) -> bool:
        due_s = None if self.door is None else self.door.due_in_s()
        return due_s is not None and (is_last or (due_s <= 0 and time.monotonic() >= self._store_again_s))

    def _note_link(self) -> None:
        """Update the status from the connection, and log changes."""
        link, status = self.link, self.status
        if link is None:
            self._note_well()
            return
        if link.taken_over:
            raise LiveError(
                f"another client took over the session {link.broker.client_id!r}",
                code="E702",
                why="two clients with one client id disconnect each other again and again",
                fix='stop the other listener, or give this one its own client_id = "..." under [mqtt]',
            )
        if link.is_connected and link.epoch != self._epoch_reported:
            self._epoch_reported = status.n_connections = link.epoch
            status.connected_since = self._clock()
            known = "with its earlier session" if link.session_was_present else "with a new session"
            self._report(f"connected to {link.broker.host}:{link.broker.port}, {known}")
        if link.is_connected and link.error is None:
            self._note_well()
        elif link.error is not None:
            if not link.is_connected:
                status.connected_since = None
            state = LISTENING if link.is_connected else "waiting for the broker"
            self._report_error(f"{link.broker.host}:{link.broker.port}: {link.error}", state=state)

    def _note_well(self) -> None:
        """Note that messages come in, unless the disk refuses or the clocks disagree."""
        status = self.status
        if self._is_refused:  # until something is stored again: that it is tried again does not make it well
            return
        if self._disagreement is not None:
            self._report_error(self._disagreement, state=CLOCKS_DISAGREE)
        else:
            status.state, status.error, self._error_reported = LISTENING, None, None

    def _note_times(self, ready: Prepared, *, now: datetime) -> None:
        """Check whether this machine's clock and the messages agree, and report it once when they do not."""
        frames = ready.tables.get("frames")
        self._agreement.see(n_within=0 if frames is None else frames.num_rows, n_outside=len(ready.apart))
        if not self._agreement.is_lost:
            self._disagreement = None
        elif self._disagreement is None and ready.apart:
            cameras = ", ".join(sorted({camera for camera, _ in ready.apart})[:CAMERAS_SHOWN])
            here, there = (datetime.fromtimestamp(s, tz=UTC) for s in (now.timestamp(), ready.apart[-1][1] / 1000))
            self._disagreement = (
                "this machine's clock and the messages disagree: "
                f"here it is {here:%Y-%m-%d %H:%M} UTC, messages of {cameras} say {there:%Y-%m-%d %H:%M}. They go to "
                "quarantine. Correct the wrong clock (this one: timedatectl set-ntp true), then replay the messages: "
                "vsd explain E708"
            )
            self._report_error(self._disagreement, state=CLOCKS_DISAGREE)

    def _report_error(self, text: str, *, state: str) -> None:
        self.status.state, self.status.error = state, text
        if text != self._error_reported:
            self._error_reported = text
            self._report(text)
            self.beat()

    def _show(self, tables: Mapping[TableName, pa.Table]) -> None:
        for observer in self._observers:
            self._guarded(observer.on_stored, tables)

    def _guarded(self, call: Callable[[Any], None], value: Any) -> None:
        """Call an observer; its errors are reported and stop nothing."""
        try:
            call(value)
        except Exception as error:
            self._report(f"an observer failed: {type(error).__name__}: {error}")

    def _note_stored(
        self, deliveries: Sequence[ReceivedMessage], tables: Mapping[TableName, pa.Table], *, n_segments: int
    ) -> None:
        status = self.status
        status.n_received += len(deliveries)
        status.n_redelivered += sum(d.is_redelivered for d in deliveries)
        status.n_qos0 += sum(d.qos == 0 for d in deliveries)
        n_rows = 0
        for name, rows in tables.items():
            status.n_stored[name] += rows.num_rows
            n_rows += rows.num_rows
        status.spool_rows += n_rows
        status.spool_segments += n_segments
        self._spooled_since_fold[0] += n_rows
        self._spooled_since_fold[1] += n_segments
        frames = tables.get("frames")
        if frames is None or not frames.num_rows:
            return
        for camera_id in pc.unique(frames["camera_id"]).to_pylist():
            rows = frames.filter(pc.equal(frames["camera_id"], camera_id))
            camera = status.camera(camera_id)
            camera.n_frames += rows.num_rows
            camera.last_ms = max(camera.last_ms, pc.max(rows["ts"].cast(pa.int64())).as_py())
            camera.numbering.see_all(rows["seq"].to_pylist())
            status.newest_ms = max(status.newest_ms or camera.last_ms, camera.last_ms)

    def _count_spool(self) -> None:
        """Count the files and rows that an earlier run left in the spool."""
        with contextlib.suppress(VsdError, OSError):
            self.status.spool_segments = sum(len(segment_paths(self._store.root, t)) for t in TABLES)
            self.status.spool_rows = self._store.n_spooled()

    def _start_or_end_fold(self, *, is_owed: bool) -> None:
        """Note the end of a running fold, or start one: by the clock, by the size of the spool, or when one is owed."""
        status = self.status
        if self._folding.is_running:
            if (folded := self._folding.poll()) is not None:
                self._note_fold(folded)
            return
        now_s = self._clock().timestamp()
        # the clock was set back: the next fold would wait until it has caught up
        was_set_back = self._fold_at_s - now_s > self._fold_every_s + GRACE_S
        is_clock_due = now_s >= self._fold_at_s or was_set_back
        if is_clock_due:
            self._fold_at_s = next_fold_s(now_s, every_s=self._fold_every_s)
        is_full = status.spool_segments >= FOLD_SEGMENTS or status.spool_rows >= FOLD_ROWS
        has_work = status.spool_segments > 0 or (is_clock_due and sum(status.n_rejected.values()) > 0)
        if has_work and (is_clock_due or is_full or is_owed) and time.monotonic() >= self._fold_again_s:
            self._spooled_since_fold = [0, 0]
            self._folding.start()

    def _note_fold(self, folded: Folded) -> None:
        status = self.status
        status.fold, status.fold_at = folded, self._clock()
        if folded.error is not None:
            self._fold_again_s = time.monotonic() + max(60.0, 10 * folded.took_s)
            self._report(f"folding failed, all records stay in the spool: {folded.error}")
            return
        status.n_folds += 1
        status.n_doubles += folded.n_known + folded.n_second
        status.n_rejected.update({SEALED: folded.n_sealed} if folded.n_sealed else {})
        status.spool_rows, status.spool_segments = self._spooled_since_fold

    def _fold_now(self) -> None:
        """Fold all records: a second time when a running fold began before the last records came."""
        for is_first in (True, False):
            if not self._folding.is_running:
                if not (is_first or self.status.spool_segments):
                    return
                self._spooled_since_fold = [0, 0]
                self._folding.start()
            while (folded := self._folding.poll()) is None:
                time.sleep(0.02)
            self._note_fold(folded)

    def _is_quiet(self, began_s: float) -> bool:
        """Return whether there is a connection, no message is held, and none came for a second."""
        assert self.link is not None
        since_s = max(self.link.first_held_s, self.link.connected_s, began_s)
        return self.link.is_connected and not self.link.held and time.monotonic() - since_s > _QUIET_S

    def _give_up_after(self, timeout_s: float, *, since_s: float) -> None:
        assert self.link is not None
        broker = self.link.broker
        if time.monotonic() - since_s > timeout_s:
            raise LiveError(
                f"no connection to the broker {broker.host}:{broker.port} within {timeout_s:g} s",
                code="E701",
                why=self.link.error,
                fix="is it running and reachable, are user and password right: vsd doctor",
            )
