"""Pictures of cameras as a door of the listener: one loop runs the network over all cameras in turn.

A picture that nobody took before the next one came is missing, and so is one that could not be read or stored: nothing
is sent for it. Only a picture that was looked at makes a frame message, also where nobody is on it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.live_camera import LiveCamera, PersonFinder
from vsd_analytics.live.message_queue import MessageQueue, OfferedMessages

LINGER_S: Final = 1.0
"""How long a frame waits for others before it is stored, as the messages of a broker do."""
WAKE_S: Final = 0.25
STOP_S: Final = 3.0


class PictureDoor(MessageQueue):
    """Looks at the pictures of several cameras.

    Args:
        cameras: The cameras; their sources are started here and stopped by `close`.
        detector: Finds the people, for all of them.
        has_news: Set by a source that has a picture.
        report: Called with lines for the log.
    """

    name = "pictures"

    def __init__(
        self,
        cameras: Sequence[LiveCamera],
        detector: PersonFinder,
        *,
        has_news: threading.Event,
        report: Callable[[str], None] = lambda _line: None,
    ) -> None:
        super().__init__(linger_s=LINGER_S)
        self.cameras = cameras
        self._detector, self._has_news, self._report = detector, has_news, report
        self._network_ms: float | None = None
        self._states: dict[str, tuple[str, str | None]] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="network", daemon=True)
        for camera in cameras:
            camera.source.start()
        self._thread.start()

    def as_dict(self) -> dict[str, Any]:
        """Return its state for the heartbeat: each camera, and how long a picture takes."""
        return {
            "cameras": {camera.camera.camera_id: camera.as_dict() for camera in self.cameras},
            "picture_ms": None if self._network_ms is None else round(self._network_ms, 1),
        }

    def close(self) -> None:
        """Stop the sources and the loop."""
        self._stop.set()
        self._has_news.set()
        for camera in self.cameras:
            camera.source.stop()
        self._thread.join(STOP_S)
        until_s = time.monotonic() + STOP_S
        for camera in self.cameras:
            camera.source.join(max(0.0, until_s - time.monotonic()))
        super().close()

    def _run(self) -> None:
        first = 0
        while not self._stop.is_set():
            self._has_news.wait(WAKE_S)
            self._has_news.clear()
            n = len(self.cameras)
            for k in range(n):  # another camera begins each time: none always waits for all others
                if self._stop.is_set():
                    return
                self._look(self.cameras[(first + k) % n])
            first = (first + 1) % n
            self._log_changes()

    def _look(self, camera: LiveCamera) -> None:
        live = camera.source.take()
        if live is None:
            return
        began_s = time.perf_counter()
        try:
            messages = camera.messages(live, self._detector)
        except Exception as error:  # one camera's picture stops no other camera; the frame is missing
            camera.error = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"[:200]
            return
        took_ms = (time.perf_counter() - began_s) * 1000
        if live.same_s == 0:
            self._network_ms = took_ms if self._network_ms is None else 0.9 * self._network_ms + 0.1 * took_ms
        topic = f"picture of {camera.camera.camera_id}"
        for message in messages:
            one = OfferedMessages([ReceivedMessage(topic, message, len(message))], len(message))
            if not self.put(one):
                camera.n_unstored += 1

    def _log_changes(self) -> None:
        """Log each camera whose state changed."""
        for camera in self.cameras:
            state = camera.as_dict()
            now = (state["state"], state["error"])
            if now != self._states.get(camera.camera.camera_id, ("connecting", None)):
                why = "" if now[1] is None else f": {now[1]}"
                self._report(f"camera {camera.camera.camera_id} {now[0]}{why}")
            self._states[camera.camera.camera_id] = now
