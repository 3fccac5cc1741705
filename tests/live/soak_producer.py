"""Producers of frame messages for the soak: PUBLISH packets made beforehand, written to plain sockets as fast as asked.

A producer numbers its messages, keeps what the broker has not acknowledged, and sends it again by its next connection.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import time
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

WINDOW = 200
MIDS = 65_000


@dataclass(frozen=True)
class Load:
    """What cameras send: message i of a camera has seq i and the instant `first_ms + i * step_ms`.

    Positions are whole millimetres by a fixed rule, so that the truth needs no log of its own.
    """

    n_cameras: int
    n_people: int
    first_ms: int
    step_ms: int
    track_frames: int = 300

    def positions_mm(self, camera: int, seq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y, shape (messages, people)."""
        person = np.arange(self.n_people)
        x = (seq[:, None] * 7 + person * 1013 + camera * 131) % 20_000
        y = (seq[:, None] * 3 + person * 769 + camera * 57) % 9_000
        return x, y

    def tracks(self, seq: np.ndarray) -> np.ndarray:
        """Return track numbers, shape (messages, people): each lasts for `track_frames` frames."""
        return np.arange(self.n_people) + (seq[:, None] // self.track_frames) * self.n_people

    def packets(self, camera: int, first: int, end: int) -> tuple[bytes, np.ndarray]:
        """Return the PUBLISH packets (MQTT 3.1.1, QoS 1) of messages first to end - 1, and where each begins.

        The packet id is seq % MIDS + 1: windows are far smaller than that.
        """
        seq = np.arange(first, end)
        x, y = (self._metres(v) for v in self.positions_mm(camera, seq))
        track = pa.array(self.tracks(seq).ravel()).cast(pa.string())
        persons = pc.binary_join_element_wise('{"id":"', track, '","x_m":', x, ',"y_m":', y, "}", "")
        offsets = pa.array(np.arange(0, len(persons) + 1, self.n_people, dtype=np.int32))
        joined = pc.binary_join(pa.ListArray.from_arrays(offsets, persons), ",")
        at = np.datetime_as_string((self.first_ms + seq * self.step_ms).astype("datetime64[ms]"), unit="ms")
        name = f"cam-{camera + 1}"
        lines = pc.binary_join_element_wise(
            f'{{"v":1,"camera":"{name}","ts":"', pa.array(at), 'Z","seq":', pa.array(seq).cast(pa.string()),
            ',"engine":"soak 1.0","persons":[', joined, "]}", "",
        ).to_pylist()  # fmt: skip
        topic = f"vsd/{name}/frames".encode()
        packets = [_publish(topic, i % MIDS + 1, line.encode()) for i, line in zip(seq.tolist(), lines, strict=True)]
        starts = np.concatenate([[0], np.cumsum([len(p) for p in packets])])
        return b"".join(packets), starts

    @staticmethod
    def _metres(mm: np.ndarray) -> pa.Array:
        flat = mm.ravel()
        whole, rest = pa.array(flat // 1000).cast(pa.string()), pa.array(flat % 1000).cast(pa.string())
        return pc.binary_join_element_wise(whole, pc.utf8_lpad(rest, 3, "0"), ".")


def _publish(topic: bytes, mid: int, payload: bytes) -> bytes:
    body = len(topic).to_bytes(2, "big") + topic + mid.to_bytes(2, "big") + payload
    return b"\x32" + _length(len(body)) + body


def _length(n: int) -> bytes:
    out = bytearray()
    while True:
        n, digit = divmod(n, 128)
        out.append(digit | (0x80 if n else 0))
        if not n:
            return bytes(out)


def _connect_packet(client_id: str) -> bytes:
    body = b"\x00\x04MQTT\x04\x02\x00\x3c" + len(client_id).to_bytes(2, "big") + client_id.encode()
    return b"\x10" + _length(len(body)) + body


@dataclass
class Camera:
    """One camera's connection and what it still has to send."""

    index: int
    port: int
    data: memoryview = field(default_factory=lambda: memoryview(b""))
    starts: np.ndarray = field(default_factory=lambda: np.zeros(1, np.int64))
    first: int = 0  # seq of the first message in data
    n_acknowledged: int = 0  # all below it, counted from seq 0
    n_sent: int = 0
    sock: socket.socket | None = None
    is_accepted: bool = False
    incoming: bytes = b""
    outgoing: memoryview = field(default_factory=lambda: memoryview(b""))
    try_again_s: float = 0.0
    n_connections: int = 0

    def connect(self, selector: selectors.BaseSelector) -> None:
        now_s = time.monotonic()
        if now_s < self.try_again_s:
            return
        self.try_again_s = now_s + 0.2
        with contextlib.suppress(OSError):
            sock = socket.create_connection(("127.0.0.1", self.port), timeout=2)
            sock.sendall(_connect_packet(f"producer-{self.index}"))
            sock.setblocking(False)
            self.sock, self.is_accepted, self.incoming, self.outgoing = sock, False, b"", memoryview(b"")
            self.n_sent = self.n_acknowledged  # what was not acknowledged is sent again
            self.n_connections += 1
            selector.register(sock, selectors.EVENT_READ, self)

    def drop(self, selector: selectors.BaseSelector) -> None:
        if self.sock is not None:
            selector.unregister(self.sock)
            self.sock.close()
            self.sock = None

    def read(self) -> int:
        """Take in acknowledgements; return how many messages they settled. OSError when the connection is over."""
        assert self.sock is not None
        data = self.sock.recv(1 << 16)
        if not data:
            raise ConnectionResetError
        data = self.incoming + data
        n_before, at = self.n_acknowledged, 0
        while at + 2 <= len(data) and at + 2 + data[at + 1] <= len(data):
            kind, length = data[at] >> 4, data[at + 1]
            if kind == 2:
                self.is_accepted = True
            elif kind == 4:
                mid = int.from_bytes(data[at + 2 : at + 4], "big")
                assert mid == self.n_acknowledged % MIDS + 1, "mosquitto acknowledges in order"
                self.n_acknowledged += 1
            at += 2 + length
        self.incoming = data[at:]
        return self.n_acknowledged - n_before

    def write(self, allowed: int) -> int:
        """Send up to `allowed` more messages as far as window and socket let; return how many were begun."""
        if self.sock is None or not self.is_accepted:
            return 0
        n_new = 0
        try:
            if not self.outgoing:
                end = min(self.n_sent + allowed, self.n_acknowledged + WINDOW, self.first + len(self.starts) - 1)
                if end <= self.n_sent:
                    return 0
                n_new = end - self.n_sent
                low, high = self.starts[self.n_sent - self.first], self.starts[end - self.first]
                self.outgoing, self.n_sent = self.data[low:high], end
            n_bytes = self.sock.send(self.outgoing)
            self.outgoing = self.outgoing[n_bytes:]
        except BlockingIOError:
            pass
        return n_new


def produce(cameras: list[Camera], *, end: int, rate: float, sleep_s: float = 0.002) -> float:
    """Send each camera's messages below `end`, `rate` a second over all, until the broker has acknowledged all.

    Returns:
        Seconds it took.
    """
    selector = selectors.DefaultSelector()
    for camera in cameras:
        if camera.sock is not None:
            selector.register(camera.sock, selectors.EVENT_READ, camera)
    began_s = time.monotonic()
    start = [c.n_acknowledged for c in cameras]
    while any(c.n_acknowledged < end for c in cameras):
        due = (time.monotonic() - began_s) * rate / len(cameras)
        for camera, first in zip(cameras, start, strict=True):
            if camera.sock is None:
                camera.connect(selector)
            try:
                camera.write(max(0, min(end, int(first + due)) - camera.n_sent))
            except OSError:
                camera.drop(selector)
        for key, _ in selector.select(sleep_s):
            try:
                key.data.read()
            except (BlockingIOError, InterruptedError):
                pass
            except OSError:
                key.data.drop(selector)
        time.sleep(sleep_s)
    for camera in cameras:
        if camera.sock is not None:
            selector.unregister(camera.sock)
    selector.close()
    return time.monotonic() - began_s
