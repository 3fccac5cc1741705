"""One persistent MQTT 5 session, driven by the caller's own loop: without a thread, no acknowledgement gets lost.

When a connection ends, the broker sends unacknowledged messages again with new packet ids. The old ids are void and
never acknowledged. The messages that had arrived are stored all the same, because a broker that crashed may have lost
them. When they do come again, the store recognises their records.
"""

from __future__ import annotations

import contextlib
import select
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vsd_analytics.errors import LiveError
from vsd_analytics.ingest.reading.adapter import EXCERPT_CHARS
from vsd_analytics.live.batches import HELD_MAX_BYTES, ReceivedMessage
from vsd_analytics.live.passwords import password_in
from vsd_analytics.site.model import Broker

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

PORT = 1883
"""Of MQTT without TLS."""
PASSWORD_VARIABLE = "VSD_MQTT_PASSWORD"
WINDOW = 1000
SESSION_MIN_S = 86_400
KEEPALIVE_S = 30
CONNECT_S = 3.0
_CONNACK_S = 10.0
_TAKEN_OVER = 142
_DUEL_S = 5.0
_DUEL_ROUNDS = 4
_EXCERPT_BYTES = 4 * EXCERPT_CHARS
_READS_MAX = 2000


def recommended_config(port: int = PORT) -> str:
    """Return the text of a mosquitto.conf with which the broker loses no message, for listeners on this machine."""
    text = Path(__file__).with_name("mosquitto.conf").read_text(encoding="utf-8")
    return text.replace(f"\nlistener {PORT} ", f"\nlistener {port} ")


def password_of(broker: Broker, *, environ: Mapping[str, str]) -> str | None:
    """Return the password: the environment's VSD_MQTT_PASSWORD, else the first line of `password_file`, else None.

    Raises:
        LiveError: E704, the file cannot be read or is empty.
    """
    return password_in(broker.password_file, variable=PASSWORD_VARIABLE, environ=environ, whose="the broker")


def make_client(broker: Broker, *, client_id: str, password: str | None) -> Client:
    """Return an MQTT 5 client with login, TLS and manual acknowledgement, not connected yet.

    Raises:
        LiveError: E705, the certificates cannot be used.
    """
    import ssl

    from paho.mqtt.client import Client, MQTTv5
    from paho.mqtt.enums import CallbackAPIVersion

    client = Client(CallbackAPIVersion.VERSION2, client_id=client_id, protocol=MQTTv5, manual_ack=True)
    client.connect_timeout = CONNECT_S
    if broker.username is not None:
        client.username_pw_set(broker.username, password)
    if broker.is_tls:
        try:
            context = ssl.create_default_context(cafile=None if broker.ca_file is None else str(broker.ca_file))
            if broker.cert_file is not None:
                context.load_cert_chain(broker.cert_file, broker.key_file)
        except (OSError, ssl.SSLError) as error:
            raise LiveError(
                "the certificates of [mqtt] cannot be used",
                code="E705",
                why=str(error),
                fix="ca_file, cert_file and key_file are PEM files; key_file belongs to cert_file",
            ) from None
        client.tls_set_context(context)
    return client


def connect_properties(*, session_s: int, window: int) -> Any:
    """Return the CONNECT properties of a session that outlives its connection by `session_s` seconds."""
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties

    properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
    properties.SessionExpiryInterval = min(session_s, 2**32 - 2)
    properties.ReceiveMaximum = window
    return properties


class BrokerLink:
    """The listener's session with the broker.

    Args:
        broker: Address, topics, login.
        password: Password of `broker.username`; None = none.
        session_s: Seconds the broker stores the session and its queue after the connection ends.
        payload_max_bytes: Longer payloads are cut to their beginning at once, so that memory stays bounded.
        delays_s: Returns new waiting times between attempts to connect; called after each success.
        will: Retained payload of `broker.status_topic` that the broker publishes when the connection breaks.
        window: Messages the broker may send without an acknowledgement: the limit of messages held.
    """

    def __init__(
        self,
        broker: Broker,
        *,
        password: str | None,
        session_s: int,
        payload_max_bytes: int,
        delays_s: Callable[[], Iterator[float]],
        will: bytes | None = None,
        window: int = WINDOW,
    ) -> None:
        self.broker = broker
        self.window = window
        self.held: deque[ReceivedMessage] = deque()
        self.held_bytes = 0
        self.first_held_s = 0.0  # monotonic instant of the oldest message held
        self.epoch = 0
        self.connected_s = 0.0  # monotonic instant of the last connection
        self.is_connected = False
        self.session_was_present: bool | None = None
        self.error: str | None = None
        self.taken_over = False  # by another client with our id, as the broker says, or as it looks: see _on_disconnect
        self._n_short = 0
        self._payload_max_bytes = payload_max_bytes
        self._delays_s = delays_s
        self._waiting_s = delays_s()
        self._try_again_s = 0.0
        self._began_s = 0.0
        self._is_open = False
        self._refusal: str | None = None
        self._n_read = 0
        self._n_unanswered = 0  # subscriptions
        self._client = make_client(broker, client_id=broker.client_id, password=password)
        if broker.status_topic is not None and will is not None:
            self._client.will_set(broker.status_topic, will, qos=1, retain=True)
        self._client.on_connect = self._on_connect
        self._client.on_disconnect = self._on_disconnect
        self._client.on_message = self._on_message
        self._client.on_subscribe = self._on_subscribe
        self._client.connect_async(
            broker.host,
            broker.port,
            keepalive=KEEPALIVE_S,
            clean_start=False,
            properties=connect_properties(session_s=session_s, window=window),
        )

    def step(self, timeout_s: float) -> None:
        """Wait at most `timeout_s` for something to read, and read all there is.

        Without a connection, connect when the next attempt is due. Never raises for an error of network or broker.

        Args:
            timeout_s: Longest wait in seconds.
        """
        sock = self._client.socket()
        if sock is None or not self._is_open:
            self._wait_and_connect(timeout_s)
            return
        if not self.is_connected and time.monotonic() - self._began_s > _CONNACK_S:
            self._lost("the broker does not answer")
            return
        read = self._has_room
        is_pending = read and hasattr(sock, "pending") and sock.pending() > 0  # decrypted already
        try:
            readable, writable, _ = select.select(
                [sock] if read else [],
                [sock] if self._client.want_write() else [],
                [],
                0.0 if is_pending else timeout_s,
            )
        except (OSError, ValueError):
            self._lost("the connection was closed")
            return
        if readable or is_pending:
            self._read_all()
        if writable and self._is_open:
            self._client.loop_write()
        if self._is_open:
            self._client.loop_misc()

    def take(self) -> list[ReceivedMessage]:
        """Return the messages held, in the order they came; they are held until acknowledged."""
        return list(self.held)

    def acknowledge(self, deliveries: Sequence[ReceivedMessage]) -> int:
        """Release messages, the first of those held, and send a PUBACK for each.

        Returns:
            How many were acknowledged. Messages of an earlier connection are not: their packet ids are void, and on
            this connection the same id may belong to another message that is not stored yet.
        """
        n_sent = 0
        for delivery in deliveries:
            self.held.popleft()
            self.held_bytes -= len(delivery.payload)
            if delivery.epoch == self.epoch and self.is_connected:
                self._client.ack(delivery.mid, delivery.qos)
                n_sent += 1
        self.first_held_s = time.monotonic()
        return n_sent

    def publish(self, topic: str, payload: bytes, *, retain: bool = False, qos: int = 0) -> bool:
        """Publish a message if there is a connection; return whether there is one."""
        if not self.is_connected:
            return False
        self._client.publish(topic, payload, qos=qos, retain=retain)
        return self.is_connected

    def close(self, *, timeout_s: float = 2.0) -> None:
        """Disconnect; the session stays at the broker.

        Waits until the broker has read all acknowledgements. A broker reads packet by packet, and discards packets it
        has not read when the next listener connects. To know that it has read them, this subscribes again: that
        changes nothing, and the broker answers it after the acknowledgements.

        Args:
            timeout_s: Longest time to wait for that.
        """
        until_s = time.monotonic() + timeout_s
        if self.is_connected:
            self._subscribe()
        while self.is_connected and self._n_unanswered and time.monotonic() < until_s:
            self.step(0.05)
        if self.is_connected:
            self._client.disconnect()
            with contextlib.suppress(OSError, ValueError):
                self._client.loop_write()
        self.is_connected = False

    @property
    def _has_room(self) -> bool:
        """Return whether more may be read: not every broker respects the window it was given."""
        return len(self.held) < self.window and self.held_bytes < 2 * HELD_MAX_BYTES

    def _read_all(self) -> None:
        for _ in range(_READS_MAX):
            n_before = self._n_read
            self._client.loop_read()
            if self._n_read == n_before or not self._is_open or not self._has_room:
                return

    def _wait_and_connect(self, timeout_s: float) -> None:
        now_s = time.monotonic()
        if now_s < self._try_again_s:
            time.sleep(min(timeout_s, self._try_again_s - now_s))
            return
        self._began_s = now_s
        self._is_open, self._refusal = True, None
        try:
            self._client.reconnect()
        except (OSError, ValueError) as error:  # refused, unreachable, no such name, a certificate that is not trusted
            self._n_short = 0
            self._lost(str(error))

    def _lost(self, why: str) -> None:
        """Note that the connection is lost, and when to try again."""
        self._is_open = self.is_connected = False  # paho closes a socket that is still open before the next attempt
        self.error = why
        self._try_again_s = time.monotonic() + next(self._waiting_s)

    def _on_connect(self, _client: Client, _data: Any, flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._refusal = f"the broker refuses: {reason}"
            return
        self.held.clear()  # of an earlier connection, and not stored since: the broker sends them again
        self.held_bytes = 0
        self.epoch += 1
        self.is_connected, self.connected_s = True, time.monotonic()
        self.error = None
        self.session_was_present = bool(flags.session_present)
        self._waiting_s = self._delays_s()
        self._n_unanswered = 0
        self._subscribe()

    def _subscribe(self) -> None:
        from paho.mqtt.subscribeoptions import SubscribeOptions

        # status and alarms go out by this session, and a topic filter may match them: noLocal stops the broker from
        # sending them back (a shared subscription must not have noLocal, by the MQTT 5 standard)
        options = {
            is_shared: SubscribeOptions(
                qos=1, noLocal=not is_shared, retainHandling=SubscribeOptions.RETAIN_SEND_IF_NEW_SUB
            )
            for is_shared in (False, True)
        }
        self._client.subscribe([(topic, options[topic.startswith("$share/")]) for topic in self.broker.topics])
        self._n_unanswered += 1

    def _on_subscribe(self, _client: Client, _data: Any, _mid: int, reasons: Any, _properties: Any) -> None:
        self._n_unanswered -= 1
        refused = [t for t, r in zip(self.broker.topics, reasons, strict=False) if r.is_failure]
        if refused:
            self.error = f"the broker refuses the subscription to {', '.join(refused)}: may this user read it?"

    # Mosquitto before 2.0.15 closes without saying that another client took the session over. Several connections in a
    # row that are accepted with our session and closed within seconds mean two clients that disconnect each other.
    def _on_disconnect(self, _client: Client, _data: Any, flags: Any, reason: Any, _properties: Any) -> None:
        is_short = self.is_connected and self.session_was_present and time.monotonic() - self.connected_s < _DUEL_S
        self._n_short = self._n_short + 1 if is_short else 0
        is_stated = flags.is_disconnect_packet_from_server and reason.value == _TAKEN_OVER
        self.taken_over = is_stated or self._n_short >= _DUEL_ROUNDS
        self._lost(self._refusal or f"the connection ended: {reason}")

    def _on_message(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        try:
            topic = message.topic
        except UnicodeDecodeError:
            topic = "(not UTF-8)"
        self._n_read += 1
        payload = bytes(message.payload)
        n_bytes = len(payload)
        if n_bytes > self._payload_max_bytes:
            payload = payload[:_EXCERPT_BYTES]
        if not self.held:
            self.first_held_s = time.monotonic()
        self.held_bytes += len(payload)
        self.held.append(
            ReceivedMessage(
                topic=topic,
                payload=payload,
                n_bytes=n_bytes,
                mid=message.mid,
                qos=message.qos,
                epoch=self.epoch,
                is_retained=message.retain,
                is_redelivered=message.dup,
            )
        )
