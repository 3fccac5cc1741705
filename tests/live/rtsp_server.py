"""A camera of the network for tests: RTSP with its pictures as JPEG in RTP (RFC 2435), over the same TCP connection.

It knows what a player asks a camera for (OPTIONS, DESCRIBE, SETUP, PLAY, GET_PARAMETER, TEARDOWN) and both logins of
HTTP, Basic and Digest with MD5, which is what cameras ask for.
"""

from __future__ import annotations

import base64
import hashlib
import re
import socketserver
import struct
import threading
import time
from typing import Literal

from engine.blob_video import SIZE, Walk
from live.picture_server import FPS, CameraServer

Scheme = Literal["Basic", "Digest"]
PACKET_BYTES = 1400
CLOCK_HZ = 90_000
SESSION, NONCE, REALM = "12345678", "dcd98b7102dd2f0e", "camera"
SDP = (
    "v=0\r\no=- 1 1 IN IP4 127.0.0.1\r\ns=camera\r\nc=IN IP4 0.0.0.0\r\nt=0 0\r\na=control:*\r\n"
    "m=video 0 RTP/AVP 26\r\na=control:track1\r\na=framerate:5\r\n"
)


class RtspServer(CameraServer):
    """Shows walks as they are now.

    Args:
        walks, login: As of `CameraServer`.
        scheme: How a login is asked for.
    """

    def __init__(self, walks: list[Walk], *, login: str | None = None, scheme: Scheme = "Digest") -> None:
        super().__init__(walks, login=login)
        self.scheme = scheme
        self.methods: list[str] = []
        self._server = _Server(("127.0.0.1", 0), _Handler)
        self._server.camera = self
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    @property
    def address(self) -> str:
        return f"rtsp://127.0.0.1:{self.port}/stream1"

    def close(self) -> None:
        self.mood = "away"
        self._server.shutdown()
        self._server.server_close()


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads = True
    allow_reuse_address = True
    camera: RtspServer


class _Handler(socketserver.StreamRequestHandler):
    server: _Server

    def handle(self) -> None:
        camera = self.server.camera
        self._writing, self._is_over = threading.Lock(), threading.Event()
        try:
            while camera.mood != "away" and (request := self._request()) is not None:
                self._answer(*request)
        except OSError:
            pass
        finally:
            self._is_over.set()

    def _request(self) -> tuple[str, str, dict[str, str]] | None:
        """Return method, address and fields of the next request; None at the end. What a player reports is skipped."""
        while (first := self.rfile.read(1)) == b"$":
            self.rfile.read(struct.unpack("!BH", self.rfile.read(3))[1])
        line = (first + self.rfile.readline()).decode().split()
        if len(line) != 3:
            return None
        fields = {}
        while text := self.rfile.readline().decode().strip():
            name, _, value = text.partition(":")
            fields[name.lower()] = value.strip()
        return line[0], line[1], fields

    def _answer(self, method: str, address: str, fields: dict[str, str]) -> None:
        camera = self.server.camera
        camera.methods.append(method)
        number = fields.get("cseq", "0")
        if method != "OPTIONS" and not self._has_login(method, fields.get("authorization", "")):
            camera.n_refused += 1
            asked = f'{camera.scheme} realm="{REALM}"' + (f', nonce="{NONCE}"' if camera.scheme == "Digest" else "")
            self._reply("401 Unauthorized", number, {"WWW-Authenticate": asked})
        elif method == "OPTIONS":
            self._reply("200 OK", number, {"Public": "DESCRIBE, SETUP, PLAY, GET_PARAMETER, TEARDOWN"})
        elif method == "DESCRIBE":
            self._reply("200 OK", number, {"Content-Base": f"{address}/", "Content-Type": "application/sdp"}, SDP)
        elif method == "SETUP" and "TCP" not in fields.get("transport", ""):
            self._reply("461 Unsupported Transport", number, {})
        elif method == "SETUP":
            transport = "RTP/AVP/TCP;unicast;interleaved=0-1"
            self._reply("200 OK", number, {"Session": f"{SESSION};timeout=60", "Transport": transport})
        elif method == "PLAY":
            self._reply("200 OK", number, {"Session": SESSION, "Range": "npt=0.000-"})
            threading.Thread(target=self._play, daemon=True).start()
        else:
            self._reply("200 OK", number, {"Session": SESSION})

    def _reply(self, state: str, number: str, fields: dict[str, str], body: str = "") -> None:
        lines = [f"RTSP/1.0 {state}", f"CSeq: {number}", *(f"{name}: {value}" for name, value in fields.items())]
        if body:
            lines.append(f"Content-Length: {len(body)}")
        self._write("\r\n".join([*lines, "", body]).encode())

    def _has_login(self, method: str, given: str) -> bool:
        camera = self.server.camera
        if camera.login is None:
            return True
        if camera.scheme == "Basic":
            return given == "Basic " + base64.b64encode(camera.login.encode()).decode()
        user, _, password = camera.login.partition(":")
        said = dict(re.findall(r'(\w+)="([^"]*)"', given))
        known = _md5(f"{user}:{REALM}:{password}"), NONCE, _md5(f"{method}:{said.get('uri', '')}")
        return said.get("username") == user and said.get("response") == _md5(":".join(known))

    def _play(self) -> None:
        """Send pictures until the connection or the camera is gone."""
        camera, number, began_s = self.server.camera, 0, time.monotonic()
        try:
            while not self._is_over.is_set() and camera.mood != "away":
                if camera.mood != "silent":
                    stamp = round((time.monotonic() - began_s) * CLOCK_HZ)
                    for payload, is_last in jpeg_payloads(camera.picture()):
                        head = struct.pack("!BBHII", 0x80, 26 | is_last << 7, number & 0xFFFF, stamp & 0xFFFFFFFF, 7)
                        packet = head + payload
                        self._write(struct.pack("!cBH", b"$", 0, len(packet)) + packet)
                        number += 1
                time.sleep(1 / FPS)
            self.connection.shutdown(2)
        except OSError:
            return

    def _write(self, data: bytes) -> None:
        with self._writing:
            self.connection.sendall(data)


def _md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def jpeg_payloads(jpeg: bytes) -> list[tuple[bytes, bool]]:
    """Return a baseline JPEG of 4:2:0 and the standard Huffman tables as RTP payloads; True with the last one.

    A payload has the header of RFC 2435 (offset, type, quality, size in blocks of 8 pixels) and a part of the scan. The
    first one also has the quantisation tables, which quality 255 announces.
    """
    at, tables = 2, {}
    while True:
        marker, length = struct.unpack("!HH", jpeg[at : at + 4])
        content = jpeg[at + 4 : at + 2 + length]
        at += 2 + length
        if marker == 0xFFDB:
            while content:  # a segment may have several tables
                tables[content[0] & 15], content = content[1:65], content[65:]
        if marker == 0xFFDA:
            break
    scan = jpeg[at:-2]
    quantisation = struct.pack("!BBH", 0, 0, 64 * len(tables)) + b"".join(tables[k] for k in sorted(tables))
    payloads, done = [], 0
    while done < len(scan):
        head = struct.pack("!B3sBBBB", 0, done.to_bytes(3), 1, 255, SIZE[0] // 8, SIZE[1] // 8)
        head += b"" if done else quantisation
        part = scan[done : done + PACKET_BYTES - len(head)]
        done += len(part)
        payloads.append((head + part, done == len(scan)))
    return payloads
