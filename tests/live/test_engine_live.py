"""`vsd engine live`: each picture once, outages missing and never empty, nothing lost by a kill or a full disk."""

from __future__ import annotations

import errno
import gc
import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pytest
from engine.blob_video import SIZE, painted
from live.listener_thread import ListenerThread
from live.live_shop import VSD, engine_live, live_shop, pair_walks, status_of, stored_instants, vsd_json
from live.picture_server import CameraServer, Mood, PictureServer
from live.prove_engine_live import TRACE, outside, written_paths
from live.rtsp_server import RtspServer
from live.small_disk import fill, small_disk

from vsd_analytics.config.project import load_site
from vsd_analytics.engine import live_sources
from vsd_analytics.engine.detector import Detector
from vsd_analytics.engine.live_sources import LiveSource, be_quiet
from vsd_analytics.live import picture_door
from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.listener import Listener
from vsd_analytics.live.live_camera import LiveCamera, TileChoice
from vsd_analytics.live.message_queue import MessageQueue, OfferedMessages
from vsd_analytics.live.picture_door import PictureDoor
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.store import Store

HZ = 5.0
PASSWORD = "sword fish/+9&%"


def now_ms() -> int:
    return round(time.time() * 1000)


def until(is_so: Callable[[], object], *, timeout_s: float = 40.0) -> None:
    """Wait until something is so."""
    end_s = time.monotonic() + timeout_s
    while not is_so():
        assert time.monotonic() < end_s
        time.sleep(0.02)


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_sources, "HUNG_S", 0.6)
    monkeypatch.setattr("vsd_analytics.live.live_camera.HUNG_S", 0.6)
    monkeypatch.setattr(live_sources, "READ_S", 1.0)
    monkeypatch.setattr(live_sources, "OPEN_S", 2.0)
    monkeypatch.setattr(picture_door, "LINGER_S", 0.1)


@pytest.fixture
def camera() -> Iterator[PictureServer]:
    served = PictureServer(pair_walks(0))
    yield served
    served.close()


class Run(ListenerThread):
    """The engine in a thread."""

    def __init__(self, root: Path, detector: Any = None) -> None:
        be_quiet()
        site: Site = load_site(root)
        news = threading.Event()
        self.cameras = []
        for each in site.cameras:
            assert each.source is not None
            address = each.source.address
            source = LiveSource(
                address if each.source.is_network else str(root / address),
                hz=HZ,
                now_ms=now_ms,
                delays_s=lambda: itertools.repeat(0.05),
                has_news=news,
            )
            self.cameras.append(LiveCamera(each, source, within_m=5.0, distance_m=2.0, tiles=TileChoice()))
        self.said: list[str] = []
        detector = detector or Detector(root / "blobs.onnx")
        self.door = PictureDoor(self.cameras, detector, has_news=news, report=self.said.append)
        super().__init__(site, self.door)
        self.listener.status.engine = self.door.as_dict

    def state(self, name: str) -> str:
        return str(self.door.as_dict()["cameras"][name]["state"])

    def n_processed(self, name: str) -> int:
        return next(c.n_processed for c in self.cameras if c.camera.camera_id == name)


def test_all_cameras_are_looked_at_in_turn_and_each_picture_is_stored_once(
    tmp_path: Path, camera: PictureServer
) -> None:
    names = live_shop(tmp_path, camera, seconds=1)  # the videos end several times meanwhile
    with Run(tmp_path) as run:
        until(lambda: all(run.n_processed(name) >= 12 for name in names))
    instants = stored_instants(tmp_path)
    assert sorted(instants) == names
    for name in names:
        assert len(instants[name]) == len(set(instants[name]))
        assert run.n_processed(name) - 3 <= len(instants[name]) <= run.n_processed(name)
        assert len({ms * int(HZ) // 1000 for ms in instants[name]}) == len(instants[name])  # one a slot
    assert status_of(tmp_path)["state"] == "stopped"


@pytest.mark.parametrize("kind", [PictureServer, RtspServer])
@pytest.mark.parametrize("mood", ["hung", "silent", "away"])
def test_a_camera_that_hangs_or_is_away_is_missing_and_never_empty(
    mood: Mood, kind: type[CameraServer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_sources, "OPEN_S", 10.0)  # OpenCV reads RTSP for four seconds before it says it is open
    camera = kind(pair_walks(0))
    live_shop(tmp_path, camera, seconds=2, hz=HZ)
    expected = {"hung": "hung", "silent": "lost", "away": "lost"}[mood]
    with Run(tmp_path) as run:
        until(lambda: run.n_processed("cam-3") >= 5)
        camera.mood = mood
        began_ms = now_ms()
        until(lambda: run.state("cam-3") == expected)
        others = run.n_processed("cam-1")
        time.sleep(1.5)
        assert run.n_processed("cam-1") > others
        ended_ms = now_ms()
        camera.mood = "on"
        n = run.n_processed("cam-3")
        until(lambda: run.n_processed("cam-3") >= n + 5)
        assert run.state("cam-3") == "on"
    instants = stored_instants(tmp_path)["cam-3"]
    assert len(instants) == len(set(instants))
    on_its_way_ms = 700  # the last new picture may be read after the mood changed
    assert [ms for ms in instants if began_ms + on_its_way_ms < ms < ended_ms] == []
    assert any(ms > ended_ms for ms in instants)
    assert any(line.startswith(f"camera cam-3 {expected}: ") for line in run.said)
    assert "camera cam-3 on" in run.said
    query = "select started_ms, ended_ms from internal.recorded_spans where camera_id = 'cam-3'"
    spans = vsd_json(tmp_path, "sql", query)
    assert all(s["ended_ms"] < ended_ms or s["started_ms"] > began_ms for s in spans["rows"])
    camera.close()


class Nobody:
    """A detector that finds nobody."""

    n = 0

    def people(self, _picture: Any, *, tiles: Any = None) -> Any:
        from vsd_analytics.engine.detections import Detections

        self.n += 1
        return Detections.of(np.empty((0, 4)), np.empty(0))


def quiet_camera(root: Path) -> LiveCamera:
    live_shop(root, seconds=1)
    site = load_site(root)
    source = LiveSource("cam-1.avi", hz=1, now_ms=now_ms, delays_s=lambda: iter([]), has_news=threading.Event())
    return LiveCamera(site.cameras[0], source, within_m=5.0, distance_m=2.0, tiles=TileChoice())


def shown(ms: int, same_s: float) -> live_sources.LivePicture:
    return live_sources.LivePicture(ms, np.zeros((SIZE[1], SIZE[0], 3), np.uint8), same_s)


def times(messages: list[bytes]) -> list[bytes]:
    return [message.split(b'"ts":"')[1][17:23] for message in messages]


def test_a_scene_that_stands_still_for_a_moment_counts_once_it_moves_again(tmp_path: Path) -> None:
    camera, nobody = quiet_camera(tmp_path), Nobody()
    begin = 1_780_000_000_000
    assert times(camera.messages(shown(begin, 0.0), nobody)) == [b"40.000"]
    assert camera.messages(shown(begin + 200, 0.2), nobody) == []
    assert camera.messages(shown(begin + 400, 0.4), nobody) == []
    assert times(camera.messages(shown(begin + 600, 0.0), nobody)) == [b"40.200", b"40.400", b"40.600"]
    assert (camera.n_processed, camera.n_hung, nobody.n) == (4, 0, 2)


def test_of_a_hang_not_one_frame_counts(tmp_path: Path) -> None:
    camera, nobody = quiet_camera(tmp_path), Nobody()
    begin = 1_780_000_000_000
    camera.messages(shown(begin, 0.0), nobody)
    for k in range(1, 10):
        assert camera.messages(shown(begin + 200 * k, 0.2 * k), nobody) == []
    assert times(camera.messages(shown(begin + 2000, 0.0), nobody)) == [b"42.000"]
    assert (camera.n_processed, camera.n_hung) == (2, 9)


def test_nothing_stays_in_memory_of_a_picture_that_was_stored(tmp_path: Path) -> None:
    live_shop(tmp_path, seconds=1)
    site, door, detector = load_site(tmp_path), MessageQueue(), Detector(tmp_path / "blobs.onnx")
    door.name = "pictures"
    source = LiveSource("cam-1.avi", hz=1, now_ms=now_ms, delays_s=lambda: iter([]), has_news=threading.Event())
    camera = LiveCamera(site.cameras[0], source, within_m=5.0, distance_m=2.0, tiles=TileChoice())
    begin_ms, walks, seconds = 1_780_000_000_000, pair_walks(0), itertools.count()
    now = [begin_ms]
    listener = Listener(
        site, broker=None, password=None, door=door, clock=lambda: datetime.fromtimestamp(now[0] / 1000, tz=UTC)
    )

    def alive_after(n: int) -> int:
        """Look at pictures of n seconds; return how many blocks of memory Python holds."""
        for second in itertools.islice(seconds, n):
            now[0] = begin_ms + 1000 * second
            messages = camera.messages(live_sources.LivePicture(now[0], painted(walks, second), 0.0), detector)
            received = [ReceivedMessage("pictures", message, len(message)) for message in messages]
            door.put(OfferedMessages(received, sum(map(len, messages))))
            assert listener.store_offered()
            if second % 5 == 0:
                listener.beat()
        gc.collect()
        return sys.getallocatedblocks()

    n = 25
    alive_after(10 * n)  # until what is made once is made, and Python's free lists are long enough
    held = [alive_after(n) for _ in range(9)]
    assert listener.status.n_stored["frames"] == 19 * n
    # less than a block for each picture, in the quietest stretch: Python's free lists still settle now and then
    assert min(later - earlier for earlier, later in itertools.pairwise(held)) < n


def test_a_detector_that_is_too_slow_misses_pictures_and_counts_them(tmp_path: Path) -> None:
    class Slow(Nobody):
        def people(self, picture: Any, *, tiles: Any = None) -> Any:
            time.sleep(0.4)
            return super().people(picture, tiles=tiles)

    names = live_shop(tmp_path, seconds=2)
    with Run(tmp_path, Slow()) as run:
        until(lambda: all(run.n_processed(name) >= 3 for name in names))  # each in turn, none starves
        states = run.door.as_dict()["cameras"]
    for name in names:
        assert states[name]["too_slow"] > 0
        assert states[name]["pictures"] - states[name]["too_slow"] - run.n_processed(name) in {-1, 0, 1}


def test_a_picture_that_the_detector_fails_on_is_missing_and_said_and_others_go_on(tmp_path: Path) -> None:
    class Fails(Nobody):
        def people(self, picture: Any, *, tiles: Any = None) -> Any:
            self.n += 1
            if self.n % 2:
                raise RuntimeError("the network failed")
            return super().people(picture, tiles=tiles)

    live_shop(tmp_path, seconds=2)
    with Run(tmp_path, Fails()) as run:
        until(lambda: any("failing: RuntimeError: the network failed" in line for line in run.said))
        until(lambda: sum(camera.n_processed for camera in run.cameras) >= 5)


@pytest.mark.parametrize("state", ["missing", "unreadable", "no camera"])
def test_a_device_that_gives_no_picture_is_lost_with_the_reason(
    state: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = tmp_path / "video0"
    if state != "missing":
        device.touch()
    if state == "unreadable":
        monkeypatch.setattr(os, "access", lambda *_: False)  # who runs the tests may read everything
    monkeypatch.setattr(live_sources, "DEVICE", re.compile(f"{tmp_path}/video(\\d+)"))
    source = LiveSource(
        str(device),
        hz=1,
        now_ms=now_ms,
        delays_s=lambda: itertools.repeat(0.05),
        has_news=threading.Event(),
        opener=lambda _: cv2.VideoCapture(),
    )
    source.start()
    until(lambda: source.state == "lost")
    source.stop()
    expected = {
        "missing": "there is no such device",
        "unreadable": "this user may not read it: add the user to its group, mostly video",
        "no camera": "another program has it, or it gives no pictures",
    }
    assert source.error == expected[state]


def test_a_device_is_read_as_a_camera_and_lost_when_it_is_pulled_out(tmp_path: Path) -> None:
    class Camera:
        """What OpenCV opens as a device, pulled out after three pictures."""

        n = 0

        def isOpened(self) -> bool:
            return True

        def grab(self) -> bool:
            time.sleep(0.05)
            self.n += 1
            return self.n <= 3

        def retrieve(self) -> tuple[bool, Any]:
            return True, np.full((SIZE[1], SIZE[0], 3), self.n, np.uint8)

        def release(self) -> None:
            pass

    opened: list[str] = []

    def opener(address: str) -> Any:
        opened.append(address)
        return Camera()

    source = LiveSource(
        "/dev/video7",
        hz=100,
        now_ms=now_ms,
        delays_s=lambda: itertools.repeat(0.05),
        has_news=threading.Event(),
        opener=opener,
    )
    source.start()
    until(lambda: source.counts.n_connections >= 2 and source.state == "lost")
    source.stop()
    assert set(opened) == {"/dev/video7"}
    assert source.counts.n_pictures >= 3
    assert source.error == "no picture for 1 s, or the connection ended"


def test_pictures_of_another_shape_than_the_calibration_are_refused(tmp_path: Path) -> None:
    live_shop(tmp_path, seconds=1)
    text = (tmp_path / "vsd.toml").read_text()
    (tmp_path / "vsd.toml").write_text(text.replace("[320, 240]", "[320, 200]", 1))
    with Run(tmp_path) as run:
        until(lambda: run.state("cam-1") == "failing")
        assert "its pictures are 320x240, picture_px says 320x200" in run.door.as_dict()["cameras"]["cam-1"]["error"]
        until(lambda: run.n_processed("cam-2") >= 2)
    assert "cam-1" not in stored_instants(tmp_path)


def test_a_full_disk_loses_no_frame_that_there_is_room_to_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, camera: PictureServer
) -> None:
    names = live_shop(tmp_path, camera, seconds=2)
    append, is_full = Store.append, threading.Event()

    def full(self: Store, table: TableName, rows: pa.Table, **more: Any) -> int:
        if is_full.is_set():
            raise OSError(errno.ENOSPC, "No space left on device")
        return append(self, table, rows, **more)

    monkeypatch.setattr(Store, "append", full)
    with Run(tmp_path) as run:
        until(lambda: run.n_processed("cam-3") >= 3)
        is_full.set()
        until(lambda: run.listener.status.state == "cannot store")
        n = run.n_processed("cam-3")
        until(lambda: run.n_processed("cam-3") >= n + 5)
        is_full.clear()
        until(lambda: run.listener.status.state == "listening")
        until(lambda: run.door.due_in_s() is None)
    for name, instants in stored_instants(tmp_path).items():
        assert name in names
        assert len(instants) == len(set(instants))
        assert run.n_processed(name) - 3 <= len(instants)


@pytest.mark.long
def test_a_disk_that_is_really_full_is_said_and_doubles_nothing_and_its_gap_is_missing(
    tmp_path: Path, camera: PictureServer
) -> None:
    with small_disk(tmp_path / "disk", size_mb=24) as root:
        names = live_shop(root, camera, seconds=2, hz=HZ, keys="[ingest]\nballast_mb = 1\n")
        process = engine_live(root, "--fold-every", "3")
        until(lambda: status_of(root).get("acknowledged", 0) >= 30)
        filler = fill(root / "filler")
        until(lambda: status_of(root).get("state") == "cannot store")
        assert "No space left on device" in status_of(root)["error"]
        assert "No space left on device" in str(vsd_json(root, "doctor"))
        n = status_of(root)["acknowledged"]
        first_full_ms = now_ms()
        time.sleep(2)
        freed_ms = now_ms()
        filler.unlink()
        until(lambda: status_of(root).get("state") == "listening")
        until(lambda: status_of(root)["acknowledged"] >= n + 30)  # what was held is stored now
        filler = fill(root / "filler")
        full_ms = now_ms()
        until(lambda: status_of(root).get("state") == "cannot store")
        time.sleep(2)
        assert status_of(root)["state"] == "cannot store"
        process.kill()  # what was held is gone
        printed = process.communicate(timeout=20)[0]
        filler.unlink()
        again_ms = now_ms()
        process = engine_live(root)
        until(lambda: status_of(root)["pid"] == process.pid and status_of(root)["acknowledged"] >= 30)
        process.terminate()
        assert process.wait(20) == 0
        instants = stored_instants(root)
        spans = vsd_json(root, "sql", "select camera_id, started_ms, ended_ms from internal.recorded_spans")["rows"]
    assert printed.count("nothing can be stored") == 2  # a line each time, and not one for each try
    for name in names:
        assert len(instants[name]) == len(set(instants[name]))
        assert any(first_full_ms < ms < freed_ms for ms in instants[name])  # the first time it was held, and stored
        assert not any(full_ms + 1000 < ms < again_ms for ms in instants[name])
        own = [(s["started_ms"], s["ended_ms"]) for s in spans if s["camera_id"] == name]
        assert any(end < again_ms for _, end in own)
        assert not any(start < again_ms < end for start, end in own)


def test_what_finds_no_room_on_a_full_disk_is_missing_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_shop(tmp_path, seconds=2)
    monkeypatch.setattr("vsd_analytics.live.message_queue.MESSAGES_MAX", 6)

    def full(*_: Any, **__: Any) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as during:
        during.setattr(Store, "append", full)
        with Run(tmp_path) as run:
            until(lambda: all(camera.n_unstored >= 2 for camera in run.cameras))
    assert stored_instants(tmp_path) == {}


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_whatever_ends_it_nothing_acknowledged_is_lost_and_nothing_is_doubled(number: int, tmp_path: Path) -> None:
    names = live_shop(tmp_path, seconds=2, hz=HZ)
    n_acknowledged, ends_ms = 0, []
    for _ in range(2):
        process = engine_live(tmp_path)
        until(
            lambda p=process: status_of(tmp_path).get("acknowledged", 0) >= 15 and status_of(tmp_path)["pid"] == p.pid
        )
        process.send_signal(number)
        code = process.wait(20)
        ends_ms.append(now_ms())
        assert code == (-9 if number == signal.SIGKILL else 0), process.communicate()[0]
        n_acknowledged += status_of(tmp_path)["acknowledged"]
    instants = stored_instants(tmp_path)
    assert sorted(instants) == names
    assert sum(len(set(ms)) for ms in instants.values()) == sum(len(ms) for ms in instants.values()) >= n_acknowledged
    spans = vsd_json(tmp_path, "sql", "select camera_id, started_ms, ended_ms from internal.recorded_spans")["rows"]
    for name in names:  # the time between the two is missing
        assert not any(s["camera_id"] == name and s["started_ms"] < ends_ms[0] < s["ended_ms"] - 600 for s in spans)


@pytest.mark.parametrize(
    "served",
    [PictureServer, partial(RtspServer, scheme="Basic"), partial(RtspServer, scheme="Digest")],
    ids=["http", "rtsp-basic", "rtsp-digest"],
)
def test_a_password_reaches_its_camera_and_no_output(served: Callable[..., CameraServer], tmp_path: Path) -> None:
    camera = served(pair_walks(0), login=f"viewer:{PASSWORD}")
    live_shop(tmp_path, camera, seconds=2, keys='source_username = "viewer"\n')
    words = ("--hz", "5", "--camera", "cam-3")
    said = []
    variable = {"VSD_SOURCE_PASSWORD_CAM_3": PASSWORD}
    process = engine_live(tmp_path, *words, **variable)
    until(lambda: status_of(tmp_path).get("acknowledged", 0) >= 5)
    said += [subprocess.run(["cat", f"/proc/{process.pid}/cmdline"], capture_output=True, text=True, check=True).stdout]
    camera.mood = "away"
    until(lambda: status_of(tmp_path)["engine"]["cameras"]["cam-3"]["state"] == "lost")
    camera.mood, camera.login = "on", "viewer:another"
    until(lambda: camera.n_refused >= 2)
    process.terminate()
    said.append(process.communicate(timeout=20)[0])
    for command in (("doctor",), ("coverage",), ("doctor", "--json"), ("hours",)):
        done = subprocess.run([*VSD, "-C", str(tmp_path), *command], capture_output=True, text=True, check=False)
        said.append(done.stdout + done.stderr)
    said += [p.read_text(errors="replace") for p in tmp_path.rglob("*") if p.is_file() and p.suffix != ".avi"]
    camera.close()
    import urllib.parse

    for text in said:
        assert PASSWORD not in text
        assert urllib.parse.quote(PASSWORD, safe="") not in text
    assert any("camera cam-3 lost" in text for text in said)


def test_a_login_without_its_password_is_refused_with_a_fix(tmp_path: Path) -> None:
    live_shop(tmp_path, None, seconds=1)
    text = (tmp_path / "vsd.toml").read_text()
    source = 'source = "rtsp://camera.example/stream"\nsource_username = "viewer"'
    (tmp_path / "vsd.toml").write_text(text.replace('source = "cam-3.avi"', source))
    process = engine_live(tmp_path)
    printed = process.communicate(timeout=30)[0]
    assert process.returncode == 2
    assert "error[E704]" in printed
    assert "VSD_SOURCE_PASSWORD_CAM_3" in printed


@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not on this machine")
def test_no_picture_reaches_a_disk(tmp_path: Path, camera: PictureServer) -> None:
    shop = tmp_path / "shop"
    live_shop(shop, camera, seconds=2)
    process = engine_live(shop, "--hz", "5", "--fold-every", "2", before=[*TRACE, "-o", str(tmp_path / "trace")])
    until(lambda: status_of(shop).get("acknowledged", 0) >= 30 and status_of(shop)["folds"] > 0)
    os.kill(status_of(shop)["pid"], signal.SIGTERM)
    assert process.wait(20) == 0
    paths, pictures, longest = written_paths(tmp_path / "trace", shop)
    assert len(paths) > 20
    assert outside(paths, shop) == []
    assert pictures == []
    assert longest < SIZE[0] * SIZE[1]
    assert not any(p.endswith((".jpg", ".jpeg", ".png", ".bmp", ".avi", ".mp4", ".webp", ".raw")) for p in paths)
