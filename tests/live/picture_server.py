"""Cameras of the network for tests, which can hang, fall silent or go away; here by HTTP (multipart JPEG)."""

from __future__ import annotations

import base64
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Literal

import cv2
import numpy as np
from engine.blob_video import SIZE, Walk, painted
from numpy.typing import NDArray

Mood = Literal["on", "hung", "silent", "away"]
FPS = 5.0


class CameraServer:
    """Shows walks as they are now; its protocol is that of a subclass.

    Args:
        walks: Who walks where, by seconds of `time.time()`.
        login: USER:PASSWORD that a client must have; None = everybody may look.

    Attributes:
        mood: "on": as it should; "hung": one picture again and again; "silent": connected, and nothing comes; "away":
            connections are closed at once.
        n_refused: Requests without the login.
        port: Where it listens on this machine.
    """

    port: int

    def __init__(self, walks: list[Walk], *, login: str | None = None) -> None:
        self.walks, self.login = walks, login
        self.mood: Mood = "on"
        self.n_refused = 0
        self._rng = np.random.default_rng(7)
        self._last = b""

    @property
    def address(self) -> str:
        """Return its address, without a login."""
        raise NotImplementedError

    def picture(self) -> bytes:
        """Return the picture of now as JPEG; each has its own noise, as a camera's has."""
        if self.mood != "hung" or not self._last:
            picture = noisy(painted(self.walks, time.time()), self._rng)
            self._last = bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1])
        return self._last

    def close(self) -> None:
        """Go away for good."""
        raise NotImplementedError


class PictureServer(CameraServer):
    """By HTTP, as `CameraServer`."""

    def __init__(self, walks: list[Walk], *, login: str | None = None) -> None:
        super().__init__(walks, login=login)
        handler = type("Handler", (_Handler,), {"camera": self})
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/video"

    def close(self) -> None:
        self.mood = "away"
        self._server.shutdown()
        self._server.server_close()


class _Handler(BaseHTTPRequestHandler):
    camera: PictureServer

    def do_GET(self) -> None:
        camera = self.camera
        if camera.mood == "away":
            self.close_connection = True
            return
        if camera.login is not None and not self._has_login(camera.login):
            camera.n_refused += 1
            self.send_response(401)
            self.send_header("WWW-Authenticate", 'Basic realm="camera"')
            self.end_headers()
            return
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=picture")
        self.end_headers()
        try:
            while camera.mood != "away":
                if camera.mood != "silent":
                    jpeg = camera.picture()
                    head = f"--picture\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                    self.wfile.write(head.encode() + jpeg + b"\r\n")
                time.sleep(1 / FPS)
        except OSError:
            return

    def _has_login(self, login: str) -> bool:
        given = self.headers.get("Authorization", "").removeprefix("Basic ")
        return given == base64.b64encode(login.encode()).decode() or f"?{login.partition(':')[2]}" in self.path

    def log_message(self, *_: object) -> None:
        """Write no line per request."""


def noisy(picture: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return a picture with noise that a detector does not mind."""
    height, width = picture.shape[:2]
    noise = rng.integers(-2, 3, (height // 8, width // 8, 1)).repeat(8, 0).repeat(8, 1)
    return np.clip(picture.astype(np.int16) + noise, 0, 255).astype(np.uint8)


def looped_video(path: object, at: Callable[[float], list[Walk]], *, seconds: float, seed: int = 1) -> None:
    """Write a noisy video of walks, to be shown in a loop."""
    rng = np.random.default_rng(seed)
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), FPS, SIZE)
    assert video.isOpened()
    for k in range(round(seconds * FPS)):
        video.write(noisy(painted(at(k / FPS), k / FPS), rng))
    video.release()
