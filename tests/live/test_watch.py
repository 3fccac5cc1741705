"""Watching a folder: each file once, nothing half-written, nothing lost, bad files set aside with their reason."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from site_text import site_text

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import InputError, LiveError, UsageError
from vsd_analytics.ingest.intake.pipeline import SourceResult
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.live import inbox
from vsd_analytics.live.inbox import as_it_is, waiting
from vsd_analytics.live.watch import WatchStatus, read_watch_status, watch
from vsd_analytics.site.model import Site
from vsd_analytics.store.store import Store

NOW = datetime(2026, 11, 20, tzinfo=UTC)
CONFIG = site_text()
MESSAGE = '{"v":1,"camera":"cam-1","ts":"2026-11-09T%02d:%02d:%02dZ","persons":[{"id":1,"x_m":1,"y_m":2}]}\n'


@pytest.fixture
def site(tmp_path: Path) -> Site:
    root = tmp_path / "site"
    root.mkdir()
    (root / "vsd.toml").write_text(CONFIG)
    (tmp_path / "in").mkdir()
    return load_site(root, environ={})


def message(k: int) -> str:
    return MESSAGE % (k // 3600 % 24, k // 60 % 60, k % 60)


class World:
    """A clock that only waiting moves (2 s a look), and events between the looks."""

    def __init__(self, site: Site) -> None:
        self.site, self.folder = site, site.root.parent / "in"
        self.now_s = 0.0
        self.told: list[str] = []
        self.sources: list[SourceResult] = []

    def run(self, *events: Callable[[], object], looks: int = 0, **more: Any) -> WatchStatus:
        """Look, let the first event happen, look, ..., and a few times more; then stop."""
        n_looks, n_waits = looks or len(events) + 5, 0

        def sleep(seconds: float) -> None:
            nonlocal n_waits
            self.now_s += seconds
            if n_waits < len(events):
                events[n_waits]()
            n_waits += 1

        arguments: dict[str, Any] = {
            "clock": lambda: NOW,
            "sleep": sleep,
            "stop": lambda: n_waits >= n_looks,
            "on_source": self.sources.append,
            "report": self.told.append,
            "monotonic": lambda: self.now_s,
        }
        return watch(self.site, self.folder, IngestOptions(), **{**arguments, **more})


def n_stored(site: Site, table: str = "frames") -> int:
    parts = Store(site.root / "store", site_id="shop").parts(table)  # type: ignore[arg-type]
    return sum(pq.read_metadata(p.path).num_rows for p in parts)


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))


def nothing() -> None:
    """Let a look pass."""


def test_a_file_is_taken_once_it_grows_no_more_and_is_moved(site: Site) -> None:
    world = World(site)
    path = world.folder / "a.jsonl"
    taken: list[list[str]] = []

    def grow() -> None:
        with path.open("a") as f:
            f.write(message(len(taken)))
        taken.append([s.source for s in world.sources])

    status = world.run(grow, grow, grow, grow, nothing, nothing)
    assert taken == [[], [], [], []]  # it grew at 2, 4, 6 and 8 s, and was never 5 s old
    assert [dict(s.n_records) for s in world.sources] == [{"frames": 4, "observations": 4}]
    assert (names(world.folder), names(world.folder / "done")) == ([], ["a.jsonl"])
    assert (status.n_done, status.n_failed, status.n_open, n_stored(site)) == (1, 0, 0, 4)


def test_unfinished_names_links_and_folders_are_left_alone_and_a_renamed_file_is_taken(site: Site) -> None:
    world = World(site)
    outside = site.root.parent / "outside.jsonl"
    outside.write_text(message(5))
    for name in (".a.jsonl", "b.jsonl.part", "c.TMP"):
        (world.folder / name).write_text(message(1))
    (world.folder / "link.jsonl").symlink_to(outside)
    (world.folder / "deeper").mkdir()
    (world.folder / "deeper" / "d.jsonl").write_text(message(2))
    os.mkfifo(world.folder / "pipe.jsonl")
    world.run(looks=6)
    assert world.sources == []
    status = world.run(lambda: (world.folder / "b.jsonl.part").rename(world.folder / "b.jsonl"))
    assert [Path(s.source).name for s in world.sources] == ["b.jsonl"]
    assert (status.n_done, n_stored(site), names(world.folder / "done")) == (1, 1, ["b.jsonl"])
    assert outside.exists()


def test_a_bad_file_is_set_aside_with_its_reason_and_the_others_go_on(site: Site) -> None:
    world = World(site)
    (world.folder / "bad\x1b[2J.bin").write_bytes(b"\x00\x01 nothing known")
    (world.folder / "empty.csv").touch()
    (world.folder / "good.jsonl").write_text(message(1) + "{broken\n")
    status = world.run()
    assert (status.n_done, status.n_failed) == (1, 2)
    failed = world.folder / "failed"
    assert names(failed) == ["bad\x1b[2J.bin", "bad\x1b[2J.bin.why.txt", "empty.csv", "empty.csv.why.txt"]
    said = (failed / "bad\x1b[2J.bin.why.txt").read_text()
    assert "E204" in said
    assert "vsd explain E204" in said
    assert "\x1b" not in said
    assert "fix: export it again" in (failed / "empty.csv.why.txt").read_text()
    assert dict(status.n_rejected) == {"bad-json": 1}
    assert n_stored(site) == 1
    assert len(world.told) == 2


def test_nothing_that_was_moved_away_is_replaced(site: Site) -> None:
    world = World(site)
    long = "ü" * 120 + ".jsonl"  # 246 bytes
    for k in range(3):
        for name in ("a.jsonl", "bad.bin", long):
            content = "?" if name == "bad.bin" else message(k)
            (world.folder / name).write_text(f"{content}{'' if name != 'bad.bin' else k}")
            os.utime(world.folder / name, ns=(7, 7))
        world.run()
    assert (len(names(world.folder / "done")), len(names(world.folder / "failed")), n_stored(site)) == (6, 6, 3)
    bad = {(world.folder / "failed" / n).read_text() for n in names(world.folder / "failed") if n.endswith(".bin")}
    assert bad == {"?0", "?1", "?2"}


def test_the_oldest_come_first_and_a_listing_is_bounded(site: Site) -> None:
    world = World(site)
    for k in range(20):
        path = world.folder / f"{(k * 7) % 20:02}.jsonl"
        path.write_text(message(k))
        os.utime(path, ns=(k, k))
    found, n_open = waiting(world.folder, limit=10)
    assert ([f.mtime_ns for f in found], n_open) == (list(range(10)), 20)
    world.run()
    assert [Path(s.source).name for s in world.sources] == [f"{(k * 7) % 20:02}.jsonl" for k in range(20)]


def test_a_file_that_changes_while_it_is_read_stays_and_is_read_again(site: Site) -> None:
    world = World(site)
    path = world.folder / "a.jsonl"
    path.write_text(message(1))

    def on_source(source: SourceResult) -> None:
        world.sources.append(source)
        if len(world.sources) == 1:
            with path.open("a") as f:
                f.write(message(2))

    status = world.run(looks=9, on_source=on_source)
    assert [s.n_records["frames"] for s in world.sources] == [1, 2]
    assert (status.n_done, n_stored(site)) == (1, 2)


def test_a_full_disk_is_waited_for_and_the_file_stays(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(site)
    (world.folder / "a.jsonl").write_text(message(1))
    real, states = Store.append, []

    def refuse(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    def look() -> None:
        states.append((names(world.folder), (read_watch_status(site.root) or {})["state"]))

    monkeypatch.setattr(Store, "append", refuse)
    events = [look] * 8 + [lambda: monkeypatch.setattr(Store, "append", real)] + [nothing] * 3
    status = world.run(*events)
    assert states[-1] == (["a.jsonl"], "cannot store")
    assert world.now_s > 30  # it waited longer each time
    assert (status.n_done, status.error, n_stored(site)) == (1, None, 1)
    assert [t.split(";")[0].split(":")[0] for t in world.told] == ["the disk is full", "records can be stored again"]


def test_a_file_that_cannot_be_read_or_moved_now_is_tried_again_and_is_no_failure(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = World(site)
    path = world.folder / "a.jsonl"
    path.write_text(message(1))
    (world.folder / "b.jsonl").write_text(message(2))
    real_open, real_move = inbox.Source.open, inbox.to_done

    def refuse(self: inbox.Source) -> Any:
        if self.path.name == "a.jsonl":
            raise PermissionError(13, "Permission denied", str(self.path))
        return real_open(self)

    def stuck(folder: Path, file: inbox.Waiting) -> None:
        raise OSError(18, "Invalid cross-device link")

    with monkeypatch.context() as patched:
        patched.setattr(inbox.Source, "open", refuse)
        status = world.run(looks=6)
    assert (status.n_done, status.n_failed, status.n_open) == (1, 0, 1)
    assert "Permission denied" in str(status.error)
    with monkeypatch.context() as patched:
        patched.setattr("vsd_analytics.live.watch.to_done", stuck)
        status = world.run(looks=10)
    assert [s.n_records["frames"] for s in world.sources].count(1) == 2  # not again and again
    assert (status.n_open, names(world.folder)) == (1, ["a.jsonl"])
    assert real_move is inbox.to_done
    status = world.run()
    assert (status.n_done, n_stored(site), status.error) == (1, 2, None)


def test_a_damaged_store_does_not_end_the_watch_nor_lose_a_file(site: Site) -> None:
    world = World(site)
    segment = site.root / "store" / "live" / "frames" / "0123456789abcdef.parquet"
    segment.parent.mkdir(parents=True)
    segment.write_bytes(b"no parquet")
    (world.folder / "a.jsonl").write_text(message(1))
    status = world.run(*[nothing] * 6, segment.unlink)
    assert any("damaged" in t for t in world.told)
    assert (status.n_done, n_stored(site), status.error) == (1, 1, None)


def test_what_cannot_be_watched_is_refused(site: Site) -> None:
    world = World(site)
    with pytest.raises(InputError, match="no folder"):
        watch(site, site.root / "none", IngestOptions(), clock=lambda: NOW)
    for folder in (site.root, site.root / "store"):
        folder.mkdir(exist_ok=True)
        with pytest.raises(UsageError, match="project itself"):
            watch(site, folder, IngestOptions(), clock=lambda: NOW)
    with pytest.raises(UsageError, match="no camera"):
        watch(site, world.folder, IngestOptions(camera="cam-9"), clock=lambda: NOW)
    with inbox.single_watcher(world.folder), pytest.raises(LiveError) as caught:
        world.run()
    assert caught.value.code == "E707"


def test_the_status_tells_how_it_goes(site: Site) -> None:
    world = World(site)
    (world.folder / "a.jsonl").write_text(message(1))
    (world.folder / "b.jsonl").write_text("{}\n")
    seen: list[dict[str, Any] | None] = []
    world.run(*[lambda: seen.append(read_watch_status(site.root))] * 5)
    assert seen[0] is not None
    assert seen[-1] is not None
    assert (seen[0]["open"], seen[0]["done"], seen[0]["is_running"]) == (2, 0, True)
    assert (seen[-1]["open"], seen[-1]["done"], seen[-1]["failed"]) == (0, 1, 1)
    assert (seen[-1]["pid"], seen[-1]["folder"]) == (os.getpid(), str(world.folder))
    told = read_watch_status(site.root)
    assert told is not None
    assert (told["state"], told["is_running"]) == ("stopped", False)
    (site.root / "status" / "watch.json").write_text("[")
    assert read_watch_status(site.root) is None


def test_asked_to_stop_in_the_middle_of_a_large_file_it_stops_and_goes_on_later(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vsd_analytics.ingest.formats.frames.BATCH_ROWS", 100)
    monkeypatch.setattr("vsd_analytics.ingest.formats.frames._BLOCK_BYTES", 10_000)
    world = World(site)
    (world.folder / "0.jsonl").write_text(message(3000))
    os.utime(world.folder / "0.jsonl", ns=(7, 7))
    (world.folder / "a.jsonl").write_text("".join(message(k) for k in range(3000)))
    asked = 0

    def stop() -> bool:
        nonlocal asked
        asked += 1
        return asked > 30

    status = world.run(stop=stop)
    assert (status.state, names(world.folder / "done"), names(world.folder)) == ("stopped", ["0.jsonl"], ["a.jsonl"])
    assert 1 <= n_stored(site) < 3000
    world.run()
    assert (n_stored(site), n_stored(site, "observations"), names(world.folder)) == (3001, 3001, [])


def test_many_small_files_are_each_stored_once(site: Site) -> None:
    world = World(site)
    n = 300
    for k in range(n):
        (world.folder / f"{k}.jsonl").write_text(message(k))
    site = replace(site, settings=site.settings.with_values({"watch_settle_s": 0.0}))
    world.site = site
    status = world.run(looks=2)
    assert (status.n_done, n_stored(site), names(world.folder)) == (n, n, [])


_DIE = """
import os, sys
from vsd_analytics.cli import main
from vsd_analytics.live import watch as module
left = int(sys.argv.pop(1))
def dying(real):
    def call(*arguments, **more):
        global left
        left -= 1
        if left == 0:
            os.kill(os.getpid(), 9)
        return real(*arguments, **more)
    return call
module.to_done = dying(module.to_done)
main()
"""


def _vsd(*arguments: object, code: str = "from vsd_analytics.cli import main; main()") -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "VSD_WATCH_SETTLE_S": "0.2"}
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    )


def _wait(condition: Callable[[], bool], *, seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_killed_between_store_and_move_then_started_again_then_ended_by_a_signal(site: Site) -> None:
    folder = site.root.parent / "in"
    for k in range(6):
        (folder / f"{k}.jsonl").write_text("".join(message(10 * k + j) for j in range(10)))
    killed = _vsd(3, "-C", site.root, "ingest", "--watch", folder, code=_DIE)
    assert killed.wait(120) == -signal.SIGKILL
    assert len(names(folder / "done")) == 2
    assert (
        n_stored(site) + Store(site.root / "store", site_id="shop").n_spooled() > 20
    )  # the third is stored, not moved
    assert len(names(folder)) == 4
    told = read_watch_status(site.root)
    assert told is not None
    assert told["is_running"] is False
    assert told["state"] == "watching"
    again = _vsd("-C", site.root, "ingest", "--watch", folder, "--json")
    _wait(lambda: len(names(folder / "done")) == 6)
    began_s = time.monotonic()
    again.send_signal(signal.SIGTERM)
    out, _ = again.communicate(timeout=60)
    assert again.returncode == 0
    assert time.monotonic() - began_s < 20  # 5 s on a machine that is not busy
    assert json.loads(out.splitlines()[-1])["done"] == 4
    assert (n_stored(site), n_stored(site, "observations")) == (60, 60)
    assert Store(site.root / "store", site_id="shop").n_spooled() == 0


def test_a_file_is_known_by_more_than_its_name(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1")
    before = as_it_is(tmp_path, "a")
    os.utime(tmp_path / "a", ns=(before.mtime_ns, before.mtime_ns))
    assert as_it_is(tmp_path, "a") == before
    (tmp_path / "b").write_text("2")
    os.utime(tmp_path / "b", ns=(before.mtime_ns, before.mtime_ns))
    (tmp_path / "b").rename(tmp_path / "a")
    assert as_it_is(tmp_path, "a") != before
