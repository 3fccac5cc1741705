"""Listening to a real Mosquitto on this machine: nothing lost, nothing doubled, acknowledged only when durable."""

from __future__ import annotations

import contextlib
import json
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import duckdb
import paho.mqtt.client as paho
import pytest
from live.local_broker import MOSQUITTO, WHY_NOT, Mosquitto, frame, publish, write_project
from paho.mqtt.enums import CallbackAPIVersion

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import LiveError
from vsd_analytics.ingest.intake.quarantine_writer import Quarantine
from vsd_analytics.live import listener as listening
from vsd_analytics.live.listener import Listener
from vsd_analytics.live.mqtt import password_of
from vsd_analytics.live.single_instance import single_listener
from vsd_analytics.live.status import FILE, Status
from vsd_analytics.schema import TABLES
from vsd_analytics.store.store import Store

pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason=WHY_NOT)
VSD = [sys.executable, "-c", "from vsd_analytics.cli import main; main()"]
FREE = ["set_tcp_nodelay true"]


@pytest.fixture(scope="module")
def shared_broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    broker = Mosquitto(tmp_path_factory.mktemp("broker"), extra=FREE).start()
    yield broker
    broker.stop()


@pytest.fixture
def own_broker(tmp_path: Path) -> Iterator[Mosquitto]:
    broker = Mosquitto(tmp_path / "broker", extra=FREE).start()
    yield broker
    broker.stop()


def project(tmp_path: Path, broker: Mosquitto, *, more: str = "") -> Path:
    """Return a project with a client id and topic of its own."""
    name = tmp_path.name
    own = f'client_id = "{name}"\ntopics = ["{name}/+/frames"]\n'
    return write_project(tmp_path / "project", port=broker.port, more=own + more)


def own(tmp_path: Path, messages: Sequence[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
    return [(topic.replace("vsd", tmp_path.name, 1), payload) for topic, payload in messages]


class Run:
    """A listener in a thread of this process."""

    def __init__(self, root: Path, *, environ: dict[str, str] | None = None, **options: Any) -> None:
        site = load_site(root)
        assert site.broker is not None
        given: dict[str, Any] = {"linger_s": 0.05, "status_every_s": 0.1, "fold_every_s": 3600.0, **options}
        self.lines: list[str] = []
        self.listener = Listener(
            site,
            broker=site.broker,
            password=password_of(site.broker, environ=environ or {}),
            clock=lambda: datetime.now(tz=UTC),
            report=self.lines.append,
            **given,
        )
        self.error: BaseException | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        try:
            self.listener.run(should_stop=self._stop.is_set)
        except BaseException as error:
            self.error = error

    def __enter__(self) -> Run:
        self._thread.start()
        wait_for(lambda: self.listener.link.is_connected or self.error is not None)
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(10)
        assert not self._thread.is_alive()


def wait_for(condition: Callable[[], Any], *, timeout_s: float = 30.0) -> None:
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s, "waited in vain"
        time.sleep(0.02)


@contextlib.contextmanager
def command(root: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run `vsd listen` as a process of its own."""
    process = subprocess.Popen([*VSD, "-C", str(root), "listen", "--status-every", "0.1", *arguments])
    try:
        wait_for(lambda: told(root).get("pid") == process.pid and told(root)["connected_since"])
        yield process
    finally:
        process.kill()
        process.wait()


def told(root: Path) -> dict[str, Any]:
    try:
        status: dict[str, Any] = json.loads((root / FILE).read_text())
    except (OSError, ValueError):
        return {}
    return status


def numbers(root: Path) -> list[int]:
    """Fold, and return the `seq` of all stored frames, sorted, as often as they are stored."""
    store = Store(root / "store", site_id="shop")
    store.fold()
    names = [str(p.path) for p in store.parts("frames")]
    rows = (
        duckdb.execute("select seq from read_parquet($names) order by 1", {"names": names}).fetchall() if names else []
    )
    return [seq for (seq,) in rows]


def quarantined(root: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for p in (root / "quarantine").glob("*.jsonl") for line in p.read_text().splitlines()]


def make_session(root: Path) -> None:
    with Run(root):
        pass


def take_all(root: Path, *, folds: bool = False) -> Status:
    """Take what the broker has queued, as `vsd listen --once` does."""
    run = Run(root)
    if not folds:
        run.listener._fold_now = lambda: None  # type: ignore[method-assign]
    return run.listener.run(should_stop=lambda: False, is_once=True)


@contextlib.contextmanager
def watched(broker: Mosquitto, topic: str) -> Iterator[list[str]]:
    """Collect the states that heartbeats tell."""
    states: list[str] = []
    watcher = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
    watcher.on_message = lambda _c, _d, message: states.append(json.loads(message.payload)["state"])
    watcher.connect("127.0.0.1", broker.port)
    watcher.subscribe(topic)
    watcher.loop_start()
    try:
        yield states
    finally:
        watcher.disconnect()
        watcher.loop_stop()


def test_messages_in_are_stored_once_and_the_status_tells(tmp_path: Path, shared_broker: Mosquitto) -> None:
    root = project(tmp_path, shared_broker)
    with Run(root) as run:
        messages = own(tmp_path, [frame(i, camera=f"cam-{1 + i % 2}") for i in range(0, 300)])
        publish(shared_broker.port, [*messages, *messages[:50]])
        wait_for(lambda: run.listener.status.n_acknowledged == 350)
    assert numbers(root) == list(range(300))
    status = told(root)
    assert status["state"] == "stopped"
    assert (status["received"], status["acknowledged"], status["rejected"]) == (350, 350, {})
    assert status["stored"]["observations"] == 700
    assert status["cameras"]["cam-1"]["last_seq"] == 298
    assert 0 < status["lag_s"] < 120
    assert status["peak_mb"] > 10


def test_what_cannot_be_stored_is_not_acknowledged_and_comes_again(
    tmp_path: Path, shared_broker: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = project(tmp_path, shared_broker)
    make_session(root)
    append, is_full = Store.append, True

    def refusing(self: Store, table: Any, rows: Any, **options: Any) -> int:
        if is_full and table == "frames":
            raise OSError(28, "No space left on device")
        return append(self, table, rows, **options)

    monkeypatch.setattr(Store, "append", refusing)
    publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(20)]))
    with Run(root) as run:
        wait_for(lambda: told(root).get("state") == "cannot store")
        assert "No space left" in told(root)["error"]
        assert run.listener.status.n_acknowledged == 0
    assert numbers(root) == []
    with Run(root) as run:  # they were not acknowledged, so the broker has them still; then the disk is fixed
        wait_for(lambda: told(root).get("state") == "cannot store")
        is_full = False
        wait_for(lambda: run.listener.status.n_acknowledged == 20)
        wait_for(lambda: told(root).get("state") == "listening")
        assert told(root)["error"] is None
    assert numbers(root) == list(range(20))


def test_rejects_that_cannot_be_stored_are_not_acknowledged(
    tmp_path: Path, shared_broker: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = project(tmp_path, shared_broker)
    refusals = [OSError(5, "Input/output error")] * 2
    flush = Quarantine.flush

    def refusing(self: Any) -> None:
        if refusals:
            raise refusals.pop()
        flush(self)

    monkeypatch.setattr(Quarantine, "flush", refusing)
    with Run(root) as run:
        publish(shared_broker.port, own(tmp_path, [("vsd/x/frames", b"{nope")]))
        wait_for(lambda: run.listener.status.n_acknowledged == 1)
    assert not refusals
    assert [q["reason"] for q in quarantined(root)] == ["bad-json"]


def test_bad_messages_are_quarantined_and_acknowledged_not_sent_for_ever(
    tmp_path: Path, shared_broker: Mosquitto
) -> None:
    root = project(tmp_path, shared_broker)
    old = datetime(2020, 1, 1, tzinfo=UTC)
    kept = ("vsd/cam-2/frames", frame(9, camera="cam-2")[1])
    publish(shared_broker.port, own(tmp_path, [kept]), retain=True)
    with Run(root) as run:
        bad = [("vsd/x/frames", b"{nope"), ("vsd/x/frames", b""), ("vsd/x/frames", b"[" * 1_000_100)]
        publish(shared_broker.port, own(tmp_path, [*bad, frame(1, at=old, n_persons=0)]))
        wait_for(lambda: run.listener.status.n_acknowledged == 5)
        publish(shared_broker.port, own(tmp_path, [frame(2)]))
        wait_for(lambda: run.listener.status.n_acknowledged == 6)
    expected = ["bad-json", "bad-json", "line-too-long", "retained", "time-out-of-range"]
    assert sorted(q["reason"] for q in quarantined(root)) == expected
    assert all("topic " in q["detail"] for q in quarantined(root))
    with Run(root) as run:
        time.sleep(0.3)
        assert run.listener.status.n_received == 0
    assert numbers(root) == [2]


def test_a_killed_listener_loses_nothing_doubles_nothing_and_its_will_tells(
    tmp_path: Path, shared_broker: Mosquitto
) -> None:
    topic = f"{tmp_path.name}/status"
    root = project(tmp_path, shared_broker, more=f'status_topic = "{topic}"\n')
    step = 500
    with watched(shared_broker, topic) as states:
        with command(root) as process:
            wait_for(lambda: "listening" in states)
            with pytest.raises(LiveError) as refused, single_listener(root):
                pass
            assert refused.value.code == "E706"
            assert str(process.pid) in (refused.value.why or "")
            publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(step)]))
            process.kill()  # in the middle of storing
            wait_for(lambda: states[-1] == "offline")
        publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(step, 2 * step)]))
        with command(root) as process:
            publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(2 * step, 3 * step)]))
            began_s = time.monotonic()
            process.terminate()
            assert process.wait(5) == 0
            assert time.monotonic() - began_s < 5
            wait_for(lambda: states[-1] == "stopped")
    rest = take_all(root)
    assert told(root)["state"] == "stopped"
    assert rest.n_redelivered <= 3 * step
    assert numbers(root) == list(range(3 * step))


def test_a_restarted_broker_is_found_again_and_nothing_is_lost(tmp_path: Path, own_broker: Mosquitto) -> None:
    root = project(tmp_path, own_broker)
    with Run(root) as run:
        publish(own_broker.port, own(tmp_path, [frame(i) for i in range(200)]))
        own_broker.stop()
        wait_for(lambda: told(root).get("state") == "waiting for the broker")
        assert told(root)["connected_since"] is None
        own_broker.start()
        wait_for(lambda: run.listener.link.epoch == 2)
        publish(own_broker.port, own(tmp_path, [frame(i) for i in range(200, 400)]))
        wait_for(lambda: run.listener.status.camera("cam-1").numbering.highest == 399)
        assert run.listener.status.camera("cam-1").numbering.n_missing == 0
    assert numbers(root) == list(range(400))
    assert any("with its earlier session" in line for line in run.lines)


def test_what_a_crashed_broker_had_delivered_is_stored_all_the_same(tmp_path: Path, own_broker: Mosquitto) -> None:
    root = project(tmp_path, own_broker)
    with Run(root, linger_s=30.0) as run:
        publish(own_broker.port, own(tmp_path, [frame(i) for i in range(100)]))
        wait_for(lambda: len(run.listener.link.held) == 100)
        own_broker.stop(signal.SIGKILL)
        wait_for(lambda: run.listener.status.n_stored["frames"] == 100)
        assert run.listener.status.n_acknowledged == 0
    assert numbers(root) == list(range(100))


def test_a_broker_that_is_away_at_the_start_is_waited_for(tmp_path: Path, own_broker: Mosquitto) -> None:
    root = project(tmp_path, own_broker)
    own_broker.stop()
    run = Run(root)
    run._thread.start()
    wait_for(lambda: told(root).get("state") == "waiting for the broker")
    assert "refused" in told(root)["error"]
    own_broker.start()
    wait_for(lambda: run.listener.link.is_connected)
    run.__exit__()


def test_a_slow_store_leaves_the_queue_with_the_broker(
    tmp_path: Path, shared_broker: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = project(tmp_path, shared_broker)
    append, held = Store.append, []

    def slow(self: Store, table: Any, rows: Any, **options: Any) -> int:
        held.append(len(run.listener.link.held))
        time.sleep(0.01)
        return append(self, table, rows, **options)

    monkeypatch.setattr(Store, "append", slow)
    with Run(root, window=50) as run:
        publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(2000)]))
        wait_for(lambda: run.listener.status.n_acknowledged == 2000)
    assert max(held) <= 50
    assert numbers(root) == list(range(2000))


def test_stopping_stores_and_acknowledges_what_is_held(tmp_path: Path, shared_broker: Mosquitto) -> None:
    root = project(tmp_path, shared_broker)
    with Run(root, linger_s=30.0) as run:
        publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(100)]))
        wait_for(lambda: len(run.listener.link.held) == 100)
        assert run.listener.status.n_acknowledged == 0
    assert told(root)["acknowledged"] == 100
    assert take_all(root).n_received == 0
    assert numbers(root) == list(range(100))


def test_two_listeners_with_one_client_id_do_not_fight(tmp_path: Path, shared_broker: Mosquitto) -> None:
    more = f'client_id = "{tmp_path.name}"\n'
    first, second = (write_project(tmp_path / n, port=shared_broker.port, more=more) for n in ("one", "two"))
    with Run(first) as run, Run(second) as other:
        wait_for(lambda: run.error is not None or other.error is not None)
        loser, winner = (run, other) if run.error is not None else (other, run)
        assert isinstance(loser.error, LiveError)
        assert loser.error.code == "E702"
        wait_for(lambda: winner.listener.link.is_connected)
        epoch = winner.listener.link.epoch
        time.sleep(1.0)
        assert winner.listener.link.is_connected
        assert winner.listener.link.epoch == epoch
    assert winner.error is None


def test_no_broker_within_the_time_given_is_an_error(tmp_path: Path) -> None:
    run = Run(write_project(tmp_path, port=1))
    with pytest.raises(LiveError) as caught:
        run.listener.run(should_stop=lambda: False, connect_timeout_s=0.3)
    assert caught.value.code == "E701"
    assert "refused" in (caught.value.why or "")


def test_once_takes_what_is_queued_folds_and_stops(tmp_path: Path, shared_broker: Mosquitto) -> None:
    root = project(tmp_path, shared_broker)
    make_session(root)
    publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(30)]))
    status = take_all(root, folds=True)
    assert status.n_acknowledged == 30
    assert (status.spool_rows, status.spool_segments) == (0, 0)
    assert status.fold is not None
    assert status.fold.n_new == 90
    assert not list((root / "store" / "live").rglob("*.*"))


def test_a_growing_spool_is_folded_beside_receipt(
    tmp_path: Path, shared_broker: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listening, "FOLD_SEGMENTS", 4)
    root = project(tmp_path, shared_broker)
    with Run(root, linger_s=0.01) as run:
        for first in range(0, 60, 10):
            publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(first, first + 10)]))
            # one delivery at a time: a slow machine must not take all of them as one part
            wait_for(lambda n=first + 10: run.listener.status.n_acknowledged == n, timeout_s=60)
        wait_for(lambda: run.listener.status.fold is not None, timeout_s=120)
        assert run.listener.status.fold is not None
        assert run.listener.status.fold.error is None
        assert run.listener.status.fold.peak_mb > 10
    assert list((root / "store" / "frames").rglob("*.parquet"))
    assert numbers(root) == list(range(60))


def test_observers_see_what_is_durable_and_cannot_stop_the_listener(tmp_path: Path, shared_broker: Mosquitto) -> None:
    root = project(tmp_path, shared_broker)
    seen: list[int] = []
    ticks: list[datetime] = []

    class Observer:
        def on_stored(self, tables: Any) -> None:
            assert any((root / "store" / "live" / "frames").iterdir())
            seen.append(tables["frames"].num_rows)
            raise RuntimeError("an alarm went wrong")

        def on_tick(self, now: datetime) -> None:
            ticks.append(now)

    with Run(root, observers=[Observer()]) as run:
        publish(shared_broker.port, own(tmp_path, [frame(i) for i in range(10)]))
        wait_for(lambda: run.listener.status.n_acknowledged == 10)
        wait_for(lambda: len(ticks) > 2)
    assert sum(seen) == 10
    assert any("an alarm went wrong" in line for line in run.lines)
    assert set(TABLES) >= {"frames"}


AUTHORITY = ("-addext", "keyUsage=critical,keyCertSign")
"""Python 3.13 asks for this, and for the key of the authority in each certificate (RFC 5280)."""


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not on this machine")
def test_tls_and_password(tmp_path: Path) -> None:
    tls = tmp_path / "tls"
    tls.mkdir()

    def openssl(*arguments: str) -> None:
        subprocess.run(["openssl", *arguments], check=True, capture_output=True, cwd=tls)

    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2")
    openssl("req", "-x509", *key, "-keyout", "ca.key", "-out", "ca.pem", "-subj", "/CN=test ca", *AUTHORITY)
    openssl("req", *key, "-keyout", "server.key", "-out", "server.csr", "-subj", "/CN=localhost")
    (tls / "names").write_text("subjectAltName=DNS:localhost\nauthorityKeyIdentifier=keyid\n")
    signed = ("-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-days", "2", "-extfile", "names")
    openssl("x509", "-req", "-in", "server.csr", *signed, "-out", "server.pem")
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(tls / "users"), "vsd", "secret"], check=True)
    files = [f"cafile {tls}/ca.pem", f"certfile {tls}/server.pem", f"keyfile {tls}/server.key"]
    secured = [*files, f"password_file {tls}/users"]
    broker = Mosquitto(tmp_path / "broker", extra=secured, replace={"allow_anonymous": "false"}).start()
    (tls / "password").write_text("secret\n")
    more = f'tls = true\nusername = "vsd"\npassword_file = "{tls}/password"\n'
    right = write_project(tmp_path / "p", port=broker.port, more=more + f'ca_file = "{tls}/ca.pem"\n', host="localhost")
    untrusting = write_project(tmp_path / "q", port=broker.port, more=more, host="localhost")
    try:
        with Run(right) as run:
            wait_for(lambda: told(right).get("state") == "listening")
        assert run.error is None
        for root, environ, words in (
            (right, {"VSD_MQTT_PASSWORD": "guess"}, "Not authorized"),
            (untrusting, {}, "certificate"),
        ):
            run = Run(root, environ=environ)
            with pytest.raises(LiveError) as caught:
                run.listener.run(should_stop=lambda: False, connect_timeout_s=0.5)
            assert words in (caught.value.why or "")
            assert not any("secret" in line or "guess" in line for line in run.lines)
    finally:
        broker.stop()


def test_its_own_status_does_not_come_back_where_a_topic_filter_takes_it_in(
    tmp_path: Path, own_broker: Mosquitto
) -> None:
    more = 'client_id = "own"\ntopics = ["vsd/#"]\nstatus_topic = "vsd/shop/status"\n'
    root = write_project(tmp_path / "project", port=own_broker.port, more=more)
    for first in (0, 10):  # the second session begins with the status the broker has retained of the first
        publish(own_broker.port, [frame(first + k) for k in range(5)])
        with Run(root) as run:
            publish(own_broker.port, [frame(first + 5 + k) for k in range(5)])
            wait_for(lambda: run.listener.status.n_acknowledged >= 5)
            run.listener.beat()
            publish(own_broker.port, [frame(first + 9)])
            wait_for(lambda: run.listener.status.n_received >= 6)
        status = run.listener.status
        assert (dict(status.n_rejected), status.n_qos0) == ({}, 0)
    assert not list((root / "quarantine").glob("*.jsonl"))
