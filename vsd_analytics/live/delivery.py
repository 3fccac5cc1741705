"""Sending alarms: to `alarms.jsonl` in the project, to a webhook, to an MQTT topic. Each event at least once.

A receiver recognises an event that comes again by `alarm`, `event` and `at`, which never change.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import threading
import time
import urllib.error
import urllib.request
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from vsd_analytics.errors import LiveError
from vsd_analytics.live.events import AlarmEvent
from vsd_analytics.live.mqtt import make_client
from vsd_analytics.live.webhook_signature import VARIABLE as SECRET_VARIABLE
from vsd_analytics.live.webhook_signature import secret_of, signature_headers
from vsd_analytics.site.model import AlarmDelivery, Broker, Site
from vsd_analytics.store.durable import fsync_dir
from vsd_analytics.version import VERSION

FILE = "alarms.jsonl"
TOKEN_VARIABLE = "VSD_WEBHOOK_TOKEN"
TIMEOUT_S = 5.0
QUEUE_MAX = 1000
KNOWN_MAX = 100_000
"""Number of the last events that are recognised when they come again."""

WAITS_S = (1.0, 60.0)
"""First and longest wait between two tries of a webhook; each wait is twice the one before."""

_FOR_GOOD = frozenset({400, 405, 406, 411, 413, 414, 415, 422})
"""HTTP codes by which a webhook refuses an event for good; after all others the event is sent again."""

Record = dict[str, Any]
Key = tuple[str, str, str]


def key_of(record: Mapping[str, Any]) -> Key:
    """Return the identity of an event: alarm, step and instant."""
    return str(record.get("alarm")), str(record.get("event")), str(record.get("at"))


class AlarmLog:
    """`alarms.jsonl`: every event sent, one JSON object a line, durable when `append` returns.

    Args:
        path: The file; made with the first event, for its owner alone.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[Key, None] = {}
        self._open: dict[str, Record] = {}
        if path.is_file():
            with path.open("rb") as lines:
                for line in lines:
                    self._note(line)

    @property
    def open_alarms(self) -> Mapping[str, Record]:
        """Return the last record of each alarm that has a start and no end in the file."""
        return self._open

    def holds(self, record: Mapping[str, Any]) -> bool:
        """Return whether an event was sent before."""
        return key_of(record) in self._known

    def append(self, record: Record) -> None:
        """Add one event, durably."""
        is_new = not self._path.exists()
        fd = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        try:
            size = os.fstat(fd).st_size
            is_torn = size > 0 and os.pread(fd, 1, size - 1) != b"\n"  # a crash in the middle of a line
            line = b"\n" * is_torn + json.dumps(record, ensure_ascii=False).encode() + b"\n"
            if os.write(fd, line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self._path))
            os.fsync(fd)
        finally:
            os.close(fd)
        if is_new:
            fsync_dir(self._path.parent)
        self._note(line)

    def _note(self, line: bytes) -> None:
        """Remember a line of the file; a line cut off by a crash, or one that is no event, is skipped."""
        try:
            record = json.loads(line)
            alarm, step, at = key = key_of(record)
            if datetime.fromisoformat(record["since"]).tzinfo is None or datetime.fromisoformat(at).tzinfo is None:
                return
        except (ValueError, KeyError, TypeError, AttributeError):
            return
        self._known[key] = None
        if len(self._known) > KNOWN_MAX:
            del self._known[next(iter(self._known))]
        if step == "end":
            self._open.pop(alarm, None)
        else:
            self._open[alarm] = record


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """Follow no redirect: a POST would become a GET, and the token would go to another address."""

    def redirect_request(self, *_: Any) -> None:
        return None


class Webhook:
    """POSTs events to an address, in order, from a thread of its own; a dead receiver delays nothing else.

    Args:
        url: http or https; certificates are verified.
        token: Sent as `Authorization: Bearer`; None = none.
        key: Signs each event (`webhook_signature`); None = no signature.
        clock: Seconds since 1970, for the signature.
        timeout_s: Longest wait for an answer.
        waits_s: First and longest wait between two tries.
        queue_max: Events waiting at most; the oldest is dropped for the newest.

    Attributes:
        n_sent: Events the receiver took (2xx).
        n_refused: Events it will never take (such as 400): not tried again.
        n_dropped: Events given up because too many waited.
        n_failed: Tries that failed.
        error: Why the last try failed; None when it did not.
        refusal: The last answer by which an event was refused.
    """

    def __init__(
        self,
        url: str,
        *,
        token: str | None = None,
        key: bytes | None = None,
        clock: Callable[[], float] = time.time,
        timeout_s: float = TIMEOUT_S,
        waits_s: tuple[float, float] = WAITS_S,
        queue_max: int = QUEUE_MAX,
    ) -> None:
        self._url, self._timeout_s, self._waits_s = url, timeout_s, waits_s
        self._headers = {"Content-Type": "application/json", "User-Agent": f"vsd-analytics/{VERSION}"}
        if token:
            self._headers["Authorization"] = f"Bearer {token.strip()}"
        self._key, self._clock = key, clock
        self._opener = urllib.request.build_opener(_NoRedirect)
        self._queue: deque[bytes] = deque()
        self._queue_max = queue_max
        self._changed = threading.Condition()
        self._is_stopping = False
        self.n_sent = self.n_refused = self.n_dropped = self.n_failed = 0
        self.error: str | None = None
        self.refusal: str | None = None
        self._thread = threading.Thread(target=self._run, name="vsd-webhook", daemon=True)
        self._thread.start()

    @property
    def n_waiting(self) -> int:
        """Return how many events are not delivered yet."""
        return len(self._queue)

    def send(self, record: Record) -> None:
        """Queue one event; returns at once."""
        with self._changed:
            if len(self._queue) >= self._queue_max:
                self._queue.popleft()
                self.n_dropped += 1
            self._queue.append(json.dumps(record).encode())
            self._changed.notify_all()

    def stop(self, *, timeout_s: float = 0.0) -> bool:
        """Wait up to `timeout_s` for the waiting events, then stop; return whether all were delivered."""
        with self._changed:
            is_done = self._changed.wait_for(lambda: not self._queue, timeout_s)
            self._is_stopping = True
            self._changed.notify_all()
        return is_done

    def _run(self) -> None:
        wait_s = self._waits_s[0]
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._queue or self._is_stopping)
                if self._is_stopping:
                    return
                body = self._queue[0]
            is_over = self._try(body)
            with self._changed:
                if is_over:
                    wait_s = self._waits_s[0]
                    if self._queue and self._queue[0] is body:  # `send` may have dropped it meanwhile
                        self._queue.popleft()
                    self._changed.notify_all()
                else:
                    self._changed.wait_for(lambda: self._is_stopping, wait_s)
                    wait_s = min(2 * wait_s, self._waits_s[1])

    def _try(self, body: bytes) -> bool:
        """Send one event; return whether it is done: delivered, or refused for good."""
        headers = self._headers
        if self._key is not None:
            headers = headers | signature_headers(body, key=self._key, at_s=int(self._clock()))
        request = urllib.request.Request(self._url, data=body, headers=headers, method="POST")
        try:
            with self._opener.open(request, timeout=self._timeout_s):
                self.n_sent += 1
                self.error = None
                return True
        except urllib.error.HTTPError as error:
            error.close()
            self.error = f"HTTP {error.code} {error.reason}"
            if error.code in _FOR_GOOD:
                self.n_refused += 1
                self.refusal = self.error
                return True
        except Exception as error:  # no name, no route, no TLS, no HTTP, no answer: whatever it is, the thread lives on
            self.error = str(getattr(error, "reason", None) or error or type(error).__name__)
        self.n_failed += 1
        return False


Publish = Callable[[str, bytes], bool]
"""Publishes a payload on an MQTT topic, QoS 1; returns whether there was a connection."""


class AlarmSender:
    """Sends events to every target that the site configures.

    Args:
        site: The project.
        log: Every event is written here first; an event that is in it is not sent again. None = no file.
        webhook: None = none.

    Attributes:
        publish: Publishes on the topic of `[alarms]`; events wait until it is set.
        n_sent: Events sent.
        n_unlogged: Events sent that could not be written to the file.
        n_dropped: Events for the topic given up because too many waited for a connection.
    """

    def __init__(self, site: Site, *, log: AlarmLog | None = None, webhook: Webhook | None = None) -> None:
        self._zone, self._topic = site.zone, site.alarm_delivery.topic
        self.log, self.webhook = log, webhook
        self.publish: Publish | None = None
        self.n_sent = self.n_unlogged = self.n_dropped = 0
        self._unpublished: deque[bytes] = deque(maxlen=QUEUE_MAX)
        self.error: str | None = None

    @property
    def n_unpublished(self) -> int:
        """Return how many events wait for a connection to the broker."""
        return len(self._unpublished)

    def send(self, events: Iterable[AlarmEvent]) -> list[Record]:
        """Send events that were not sent before; return those, as they were sent."""
        return [r for r in (e.as_dict(self._zone) for e in events) if self.send_record(r)]

    def send_record(self, record: Record) -> bool:
        """Send one record if it was not sent before; return whether it was now. Never raises for disk or network."""
        if self.log is not None:
            if self.log.holds(record):
                return False
            try:
                self.log.append(record)
            except OSError as error:
                self.n_unlogged += 1
                self.error = str(error)
        if self.webhook is not None:
            self.webhook.send(record)
        if self._topic is not None:
            self.n_dropped += len(self._unpublished) == QUEUE_MAX
            self._unpublished.append(json.dumps(record).encode())
            self.publish_waiting()
        self.n_sent += 1
        return True

    def publish_waiting(self) -> None:
        """Publish, in order, the events that wait for a connection."""
        while self._unpublished and self.publish is not None and self._topic is not None:
            if not self.publish(self._topic, self._unpublished[0]):
                return
            self._unpublished.popleft()


def webhook_of(delivery: AlarmDelivery, *, environ: Mapping[str, str]) -> Webhook | None:
    """Return the webhook of `[alarms]`, with the token and the secret of the environment; None when there is none.

    Raises:
        UsageError: E101, the secret cannot sign.
    """
    if delivery.webhook is None:
        return None
    secret = environ.get(SECRET_VARIABLE)
    key = None if not secret else secret_of(secret)
    return Webhook(delivery.webhook, token=environ.get(TOKEN_VARIABLE), key=key)


class Publisher:
    """Publishes on a topic with a connection of its own, for commands that end; use it as a context manager.

    Args:
        broker: Address and login.
        password: Password of its user; None = none.
        what: What is published, for the name of the connection and messages.

    Raises:
        LiveError: E710, no connection (on entering).
    """

    def __init__(self, broker: Broker, *, password: str | None, what: str = "alarms") -> None:
        self._broker, self._what = broker, what
        self._client = make_client(broker, client_id=f"{broker.client_id}-{what}", password=password)
        self._refusal: str | None = None

    def __enter__(self) -> Publisher:
        ready = threading.Event()

        def on_connect(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
            self._refusal = f"the broker refuses: {reason}" if reason.is_failure else None
            ready.set()

        self._client.on_connect = on_connect
        try:
            self._client.connect(self._broker.host, self._broker.port, clean_start=True)
        except (OSError, ValueError) as error:
            raise self._unreachable(str(error)) from None
        self._client.loop_start()
        if not ready.wait(TIMEOUT_S) or self._refusal is not None:
            self._client.loop_stop()
            raise self._unreachable(self._refusal or "the broker does not answer")
        return self

    def __exit__(self, *_: object) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def __call__(self, topic: str, payload: bytes, *, retain: bool = False) -> bool:
        """Publish with QoS 1 and wait for the acknowledgement; return whether it came."""
        sent = self._client.publish(topic, payload, qos=1, retain=retain)
        with contextlib.suppress(RuntimeError, ValueError):
            sent.wait_for_publish(TIMEOUT_S)
        return bool(sent.is_published())

    def _unreachable(self, why: str) -> LiveError:
        return LiveError(
            f"{self._what} cannot be published at {self._broker.host}:{self._broker.port}",
            code="E710",
            why=why,
            fix="is it running and reachable, are user and password right: vsd doctor",
        )
