"""Pictures of a camera as it is now: a thread for each source keeps the newest picture, and connects again.

Time is cut into slots of 1/hz seconds. The first picture of each slot stays until it is taken, or until that of the
next slot replaces it. What is read in between is not converted. So what is slow never falls behind: it misses pictures.

Only the newest picture of a source is in memory, and none is written anywhere. The password is put into an address when
it is opened, and into no message.
"""

from __future__ import annotations

import os
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, Protocol
from urllib.parse import quote, urlsplit, urlunsplit

import cv2
import numpy as np

from vsd_analytics.engine.frame_pictures import Picture
from vsd_analytics.owners import is_there

SourceState = Literal["connecting", "on", "hung", "lost", "stopped"]

OPEN_S: Final = 10.0
"""A source that does not open within this time is away."""
READ_S: Final = 10.0
"""And one that sends no picture for so long is lost."""
HUNG_S: Final = 5.0
"""A picture that stays the same to the byte for longer shows nothing of now: a camera's noise changes every picture."""
PORTS: Final = {"rtsp": 554, "rtsps": 322, "http": 80, "https": 443}
DEVICE: Final = re.compile(r"/dev/video(\d+)")
QUIET_LOG: Final = {"OPENCV_LOG_LEVEL": "SILENT", "OPENCV_FFMPEG_LOGLEVEL": "-8", "OPENCV_VIDEOIO_DEBUG": "0"}
"""What OpenCV and FFmpeg print has addresses in it, with their passwords."""


class Video(Protocol):
    """What is used of `cv2.VideoCapture`."""

    def isOpened(self) -> bool:  # noqa: N802 - name of the library
        """Return whether pictures can be read."""

    def grab(self) -> bool:
        """Go to the next picture; return False at the end, or when none came in time."""

    def retrieve(self) -> tuple[bool, Any]:
        """Return the picture as pixels."""

    def get(self, propId: int) -> float:  # noqa: N803 - name of the library
        """Return a property."""

    def set(self, propId: int, value: float) -> bool:  # noqa: N803 - name of the library
        """Set a property, such as the number of the next picture."""

    def release(self) -> None:
        """Close it."""


@dataclass(frozen=True, slots=True)
class LivePicture:
    """A picture of now.

    Attributes:
        ms: When it was read, UTC milliseconds.
        picture: Its pixels.
        same_s: For how many seconds the source has shown this very picture, to the byte; 0 = it is a new one.
    """

    ms: int
    picture: Picture
    same_s: float


@dataclass(slots=True)
class SourceCounts:
    """What a source did since the start.

    Attributes:
        n_pictures: Pictures read, one a slot at most.
        n_replaced: Those of them that nobody took in time.
        n_connections: How often it was opened.
        n_repeated: Those that equalled the last one for longer than `HUNG_S`.
    """

    n_pictures: int = 0
    n_replaced: int = 0
    n_connections: int = 0
    n_repeated: int = 0


def open_video(address: str) -> Video:
    """Return an address, a device or a file as a video, which may not be open."""
    if device := DEVICE.fullmatch(address):
        return cv2.VideoCapture(int(device[1]), cv2.CAP_V4L2)
    if "://" not in address:
        return cv2.VideoCapture(address, cv2.CAP_FFMPEG)
    limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, int(OPEN_S * 1000), cv2.CAP_PROP_READ_TIMEOUT_MSEC, int(READ_S * 1000)]
    return cv2.VideoCapture(address, cv2.CAP_FFMPEG, limits)


@dataclass
class LiveSource:
    """One source, read in a thread of its own.

    Args:
        address: Address, device or file, without a password.
        username: Who logs in; None = nobody.
        password: Password, for a login or for `{password}` in the address.
        hz: Slots a second.
        now_ms: Returns the clock, UTC milliseconds.
        delays_s: Returns waiting times before it is opened again.
        has_news: Set whenever a picture is there.
        opener: Opens an address.

    Attributes:
        state: What it is doing.
        error: Why it is not on; None = it is. Never has an address in it.
        counts: What it did.
        size_px: Width and height of the last picture; None = none came.
    """

    address: str
    hz: float
    now_ms: Callable[[], int]
    delays_s: Callable[[], Iterator[float]]
    has_news: threading.Event
    username: str | None = None
    password: str | None = field(default=None, repr=False)
    opener: Callable[[str], Video] = open_video

    def __post_init__(self) -> None:
        self.state: SourceState = "connecting"
        self.error: str | None = None
        self.counts = SourceCounts()
        self.size_px: tuple[int, int] | None = None
        self._newest: LivePicture | None = None
        self._last: Picture | None = None
        self._last_new_s = 0.0
        self._slot = -1
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="source", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> None:
        """Ask it to end; a thread that waits for a camera ends with the process."""
        self._stop.set()

    def join(self, timeout_s: float) -> None:
        """Wait until it has ended, or for so long."""
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def take(self) -> LivePicture | None:
        """Return the newest picture, once; None when there is no new one."""
        with self._lock:
            newest, self._newest = self._newest, None
        return newest

    def _run(self) -> None:
        delays = self.delays_s()
        while not self._stop.is_set():
            n_before = self.counts.n_pictures
            try:
                self._read()
            except Exception as error:  # of any library: its text may name the address
                self._lose(f"{type(error).__name__} while reading")
            if self.counts.n_pictures > n_before:
                delays = self.delays_s()  # it was there: back to short waits
            self._stop.wait(next(delays))
        self.state = "stopped"

    def _read(self) -> None:
        """Read one connection to its end."""
        if not self._answers():
            self._lose("it does not answer")
            return
        video = self.opener(self._with_login())
        try:
            if not video.isOpened():
                self._lose(self._why_closed())
                return
            self.counts.n_connections += 1
            self._last = None
            if self._is_file:
                while self._show(video) and video.set(cv2.CAP_PROP_POS_FRAMES, 0):
                    pass
            else:
                self._watch(video)
        finally:
            video.release()

    def _watch(self, video: Video) -> None:
        """Keep the first picture of each slot until the connection ends."""
        while not self._stop.is_set():
            if not video.grab():
                self._lose(f"no picture for {READ_S:g} s, or the connection ended")
                return
            self._note(video)

    def _show(self, video: Video) -> bool:
        """Show a file at its own pace to its end; return whether it may begin again."""
        began_s, n_grabbed = time.monotonic(), 0
        while not self._stop.is_set():
            if not video.grab():
                if not n_grabbed:
                    self._lose("the file has no picture")
                    return False
                self._wait_until(began_s + n_grabbed / max(1.0, video.get(cv2.CAP_PROP_FPS)))
                return True
            self._wait_until(began_s + video.get(cv2.CAP_PROP_POS_MSEC) / 1000)
            n_grabbed += 1
            self._note(video)
        return False

    def _note(self, video: Video) -> None:
        """Keep the picture that was grabbed where it is the first of its slot."""
        ms = self.now_ms()
        if (slot := int(ms * self.hz // 1000)) == self._slot:
            return
        self._slot = slot
        is_read, picture = video.retrieve()
        if is_read:
            self._keep(np.asarray(picture, dtype=np.uint8), ms)

    def _answers(self) -> bool:
        """Return whether somebody listens at an address of the network.

        OpenCV opens one source at a time in the whole process: one that is away must not keep the others from it.
        """
        parts = urlsplit(self.address)
        if not parts.hostname:
            return True
        try:
            with socket.create_connection((parts.hostname, parts.port or PORTS[parts.scheme]), timeout=OPEN_S):
                return True
        except OSError:
            return False

    def _keep(self, picture: Picture, ms: int) -> None:
        now_s = time.monotonic()
        is_same = self._last is not None and np.array_equal(self._last, picture)
        if not is_same:
            self._last, self._last_new_s = picture, now_s
        same_s = now_s - self._last_new_s
        is_hung = same_s > HUNG_S
        with self._lock:
            self.counts.n_pictures += 1
            self.counts.n_repeated += is_hung
            self.counts.n_replaced += self._newest is not None
            self._newest = LivePicture(ms, picture, same_s)
        self.size_px = (int(picture.shape[1]), int(picture.shape[0]))
        self.state = "hung" if is_hung else "on"
        self.error = f"the same picture for more than {HUNG_S:g} s" if is_hung else None
        self.has_news.set()

    def _lose(self, why: str) -> None:
        self.state, self.error = "lost", why

    def _wait_until(self, due_s: float) -> None:
        left_s = due_s - time.monotonic()
        if left_s > 0:
            self._stop.wait(left_s)

    @property
    def _is_file(self) -> bool:
        return "://" not in self.address and DEVICE.fullmatch(self.address) is None

    def _why_closed(self) -> str:
        if self._is_file:
            return _why_no_video(Path(self.address))
        if DEVICE.fullmatch(self.address):
            return _why_no_device(Path(self.address))
        return f"it answers and shows nothing: a wrong path, a wrong login, or no picture within {OPEN_S:g} s"

    def _with_login(self) -> str:
        """Return the address with its login, to be opened and never shown."""
        secret = quote(self.password or "", safe="")
        address = self.address.replace("{password}", secret)
        if self.username is None or "://" not in address:
            return address
        parts = urlsplit(address)
        login = quote(self.username, safe="") + (f":{secret}" if self.password is not None else "")
        return urlunsplit(parts._replace(netloc=f"{login}@{parts.netloc}"))


def _why_no_video(file: Path) -> str:
    try:
        return "the file is no video" if is_there(file) else "there is no such file"
    except PermissionError:
        return "this user may not read it"


def _why_no_device(device: Path) -> str:
    if not is_there(device):
        return "there is no such device"
    if not os.access(device, os.R_OK | os.W_OK):
        return "this user may not read it: add the user to its group, mostly video"
    return "another program has it, or it gives no pictures"


def be_quiet() -> None:
    """Keep OpenCV and FFmpeg from printing addresses; call it before the first source is opened."""
    os.environ.update(QUIET_LOG)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
