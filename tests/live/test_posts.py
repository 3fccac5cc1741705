"""Messages by HTTP: answered 202 only when durable, refused with a reason, nothing lost and nothing doubled."""

from __future__ import annotations

import contextlib
import http.client
import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import duckdb
import pytest
from live.listener_thread import ListenerThread
from live.local_broker import frame
from site_text import site_text

from vsd_analytics.config.project import load_site
from vsd_analytics.doctor.broker import examine_listener
from vsd_analytics.errors import LiveError
from vsd_analytics.ingest.intake.replay import replay
from vsd_analytics.live import posts, status
from vsd_analytics.live.mapped import mapped_readers
from vsd_analytics.live.message_queue import MESSAGES_MAX
from vsd_analytics.live.posts import PostInbox, host_and_port, messages_of, token_of
from vsd_analytics.live.status import read_status, write_status
from vsd_analytics.schema import TABLES
from vsd_analytics.store import durable
from vsd_analytics.store.segments import read_segment
from vsd_analytics.store.store import Store

VSD = [sys.executable, "-c", "from vsd_analytics.cli import main; main()"]
TOKEN = "a-token-of-the-tests"
ACME = """
[[source]]
id = "acme"
persons = "data.people"
map = { ts = "meta.time", track_id = "tid", x_m = "pos.0", y_m = "pos.1" }
where = "kind = 'human'"
"""


def project(tmp_path: Path) -> Path:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1", more=ACME), encoding="utf-8")
    return tmp_path


class Run(ListenerThread):
    """A listener in a thread, without a broker."""

    def __init__(self, root: Path) -> None:
        site = load_site(root)
        sources = [reader.rule_id for reader in mapped_readers(site)]
        limit = int(site.settings.line_max_bytes)
        self.posts = PostInbox("127.0.0.1:0", token=TOKEN, sources=sources, body_max_bytes=limit)
        super().__init__(site, self.posts)

    def post(self, body: bytes, path: str = "/frames", **headers: str) -> tuple[int, dict[str, Any]]:
        return post(self.posts.address, body, path, **headers)


def post(address: str, body: bytes, path: str = "/frames", **headers: str) -> tuple[int, dict[str, Any]]:
    connection = http.client.HTTPConnection(address, timeout=20)
    given = {"Authorization": f"Bearer {TOKEN}", **{k.replace("_", "-"): v for k, v in headers.items()}}
    try:
        connection.request("POST", path, body, given)
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read())
    finally:
        connection.close()


def acme(*, tid: object = 1, x: object = 1.0, time_: object = None, kind: str = "human") -> bytes:
    now = datetime.now(tz=UTC).timestamp() if time_ is None else time_
    return json.dumps({"meta": {"time": now}, "data": {"people": [{"tid": tid, "pos": [x, 2], "kind": kind}]}}).encode()


def spooled(root: Path, table: str) -> list[Path]:
    return list((root / "store" / "live" / table).glob("*.arrow"))


def stored_seq(root: Path) -> list[int]:
    store = Store(root / "store", site_id="shop")
    store.fold()
    names = [str(p.path) for p in store.parts("frames")]
    return [n for (n,) in duckdb.execute("select seq from read_parquet($n) order by 1", {"n": names}).fetchall()]


def quarantined(root: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for p in (root / "quarantine").glob("*.jsonl") for line in p.read_text().splitlines()]


def test_202_means_that_the_records_are_on_disk(tmp_path: Path) -> None:
    root = project(tmp_path)
    with Run(root) as run:
        _, payload = frame(1, at=datetime.now(tz=UTC), n_persons=2)
        assert run.post(payload) == (202, {"stored": 1, "quarantined": 0})
        assert len(spooled(root, "frames")) == len(spooled(root, "observations")) == 1
    assert stored_seq(root) == [1]


def test_json_of_another_engine_is_read_by_its_source(tmp_path: Path) -> None:
    root = project(tmp_path)
    with Run(root) as run:
        assert run.post(acme(x=3.25), "/acme")[0] == 202
        assert run.post(acme(kind="dog"), "/acme")[0] == 202
        assert run.posts.paths == ("frames", "acme")
    people, frames = ([row for p in spooled(root, t) for row in read_segment(p).to_pylist()] for t in TABLES[1::-1])
    assert [(row["x_mm"], row["y_mm"]) for row in people] == [(3250, 2000)]
    assert sorted(row["n_persons"] for row in frames) == [0, 1]


def test_what_is_bad_is_answered_422_with_its_reason_and_can_be_replayed_by_its_source(tmp_path: Path) -> None:
    root = project(tmp_path)
    with Run(root) as run:
        status, told = run.post(b"[" + acme() + b"," + acme(x="left") + b"]", "/acme")
        assert (status, told["stored"], told["quarantined"]) == (422, 1, 1)
        assert (told["rejected"][0]["message"], told["rejected"][0]["reason"]) == (1, "not-a-number")
        assert run.post(b"rubbish", "/acme")[1]["rejected"][0]["reason"] == "bad-json"
        assert run.post(b"[1,", "/frames")[0] == 422
        status, told = run.post(acme(time_=1), "/acme")
        assert told["rejected"][0]["reason"] == "time-out-of-range"
        assert run.listener.status.as_dict(now=datetime.now(tz=UTC))["rejected"]["time-out-of-range"] == 1
    assert {e["format"] for e in quarantined(root)} == {"json", "frames"}
    assert {e["source"] for e in quarantined(root)} == {"http"}
    result = replay(load_site(root), reason="time-out-of-range", now=datetime.fromtimestamp(2, tz=UTC))
    assert result.n_records == {"frames": 1, "observations": 1}


@pytest.mark.parametrize(
    ("path", "headers", "body", "status"),
    [
        ("/frames", {"Authorization": ""}, b"{}", 401),
        ("/frames", {"Authorization": f"Bearer {TOKEN}x"}, b"{}", 401),
        ("/frames", {"Authorization": "Bearer \u00e9"}, b"{}", 401),
        ("/nothing", {}, b"{}", 404),
        ("/../secrets/http-token", {}, b"{}", 404),
        ("/frames", {"Content_Encoding": "gzip"}, b"{}", 415),
        ("/frames", {"Transfer_Encoding": "chunked"}, b"0\r\n\r\n", 411),
        ("/frames", {"Content_Length": "99999999999"}, b"{}", 413),
        ("/frames", {}, b"[" + b"{}," * MESSAGES_MAX + b"{}]", 413),
        ("/frames", {}, b"  ", 400),
        ("/frames", {}, b"[]", 400),
    ],
)
def test_what_is_no_request_is_refused_and_nothing_of_it_is_stored(
    tmp_path: Path, path: str, headers: dict[str, str], body: bytes, status: int
) -> None:
    root = project(tmp_path)
    with Run(root) as run:
        answer, told = run.post(body, path, **headers)
        assert (answer, bool(told["error"])) == (status, True)
        assert run.posts.n_refused == {str(status): 1}
        assert run.post(frame(1, at=datetime.now(tz=UTC), n_persons=0)[1])[0] == 202
    assert quarantined(root) == []
    assert stored_seq(root) == [1]


def test_nothing_can_be_read_by_http(tmp_path: Path) -> None:
    with Run(project(tmp_path)) as run:
        for method in ("GET", "PUT", "DELETE", "OPTIONS"):
            connection = http.client.HTTPConnection(run.posts.address, timeout=10)
            connection.request(method, "/frames", headers={"Authorization": f"Bearer {TOKEN}"})
            assert connection.getresponse().status == 405
            connection.close()


def test_a_disk_that_refuses_is_answered_503_and_what_is_sent_again_counts_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:

    root = project(tmp_path)
    monkeypatch.setattr(posts, "ANSWER_S", 0.5)
    _, payload = frame(1, at=datetime.now(tz=UTC), n_persons=1)
    with Run(root) as run:
        append, is_full = Store.append, threading.Event()
        is_full.set()

        def refusing(self: Store, *arguments: Any, **named: Any) -> Any:
            if is_full.is_set():
                raise OSError(28, "No space left on device")
            return append(self, *arguments, **named)

        monkeypatch.setattr(Store, "append", refusing)
        status, told = run.post(payload)
        assert (status, "send it again" in told["error"]) == (503, True)
        is_full.clear()
        until_s = time.monotonic() + 20
        while (status := run.post(payload)[0]) == 503 and time.monotonic() < until_s:
            time.sleep(0.1)
        assert status == 202
    assert stored_seq(root) == [1]


def test_a_full_disk_is_in_the_status_until_something_is_stored_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also the status itself finds no room for a second file."""
    root = project(tmp_path)
    monkeypatch.setattr(posts, "ANSWER_S", 0.3)
    _, payload = frame(1, at=datetime.now(tz=UTC), n_persons=1)
    path = root / "status" / "listen.json"
    with Run(root) as run:
        until(lambda: path.exists() and json.loads(path.read_text())["state"] == "listening")
        is_full, publish = threading.Event(), durable.publish
        is_full.set()

        def refusing(path: Path, *arguments: Any, **named: Any) -> Any:
            if is_full.is_set():
                raise OSError(28, "No space left on device")
            return publish(path, *arguments, **named)

        monkeypatch.setattr(durable, "publish", refusing)
        monkeypatch.setattr(status, "publish", refusing)
        assert run.post(payload)[0] == 503
        told = set()
        until_s = time.monotonic() + 1.5
        while time.monotonic() < until_s:
            told.add(json.loads(path.read_text())["state"])
            time.sleep(0.02)
        assert told == {"cannot store"}
        assert "No space left" in json.loads(path.read_text())["error"]
        found = examine_listener(load_site(root), status=read_status(root), now=datetime.now(tz=UTC))
        assert ("needs you", "vsd explain E304") in [(f.state, f.fix) for f in found]
        is_full.clear()
        until(lambda: json.loads(path.read_text())["state"] == "listening")


def test_a_disk_that_refuses_only_the_status_is_named_in_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_status(tmp_path, {"state": "listening", "error": None})

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(status, "publish", full)
    write_status(tmp_path, {"state": "listening", "error": None})
    told = read_status(tmp_path)
    assert told == {"state": "cannot store", "error": "the disk refused the status: No space left on device"}


def until(is_so: Callable[[], bool]) -> None:
    until_s = time.monotonic() + 20
    while not is_so():
        assert time.monotonic() < until_s
        time.sleep(0.02)


def test_a_killed_listener_loses_nothing_that_it_answered_202(tmp_path: Path) -> None:
    """Four senders post numbered messages, again where no answer came; the listener is killed twice."""
    root = project(tmp_path)
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    address, stop = f"127.0.0.1:{port}", threading.Event()
    answered: list[int] = []
    began = datetime.now(tz=UTC) - timedelta(hours=12)
    (root / "secrets").mkdir()
    (root / "secrets" / "http-token").write_text(TOKEN)

    def send(sender: int) -> None:
        number = sender
        while not stop.is_set():
            _, payload = frame(number, at=began + timedelta(seconds=number), n_persons=1)
            while not stop.is_set():
                with contextlib.suppress(OSError, http.client.HTTPException, ValueError):
                    if post(address, payload)[0] == 202:
                        answered.append(number)
                        break
                time.sleep(0.05)
            number += 4

    def listener() -> subprocess.Popen[bytes]:
        command = [*VSD, "--quiet", "-C", str(root), "listen", "--http", address, "--fold-every", "2"]
        return subprocess.Popen(command)

    process = listener()
    senders = [threading.Thread(target=send, args=(i,), daemon=True) for i in range(4)]
    for thread in senders:
        thread.start()
    try:
        for _ in range(2):
            n_before, until_s = len(answered), time.monotonic() + 60
            while len(answered) < n_before + 8 and time.monotonic() < until_s:
                time.sleep(0.01)
            assert len(answered) >= n_before + 8
            process.send_signal(signal.SIGKILL)
            process.wait()
            process = listener()
        n_before = len(answered)
        while len(answered) < n_before + 8 and time.monotonic() < until_s + 60:
            time.sleep(0.01)
        stop.set()
        for thread in senders:
            thread.join(40)
        process.terminate()
        assert process.wait(30) == 0
    finally:
        stop.set()
        process.kill()
        process.wait()
    stored = stored_seq(root)
    assert len(stored) == len(set(stored))
    assert set(answered) <= set(stored)
    assert len(answered) >= 24


def test_a_token_is_made_once_and_only_its_owner_can_read_it(tmp_path: Path) -> None:
    made = token_of(tmp_path, environ={})
    path = tmp_path / "secrets" / "http-token"
    assert len(made) >= 32
    assert path.stat().st_mode & 0o777 == 0o600
    assert token_of(tmp_path, environ={}) == made
    assert token_of(tmp_path, environ={"VSD_HTTP_TOKEN": TOKEN}) == TOKEN
    path.write_text("short\n")
    with pytest.raises(LiveError) as refused:
        token_of(tmp_path, environ={})
    assert "16 or more" in str(refused.value.why)


@pytest.mark.parametrize("address", ["127.0.0.1:http", "127.0.0.1:99999", "::1:80", "http://127.0.0.1:80"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(LiveError, match="HOST:PORT"):
        host_and_port(address)


def test_a_port_that_is_taken_is_an_error_with_a_code(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(LiveError) as refused:
            PostInbox(f"127.0.0.1:{taken.getsockname()[1]}", token=TOKEN, sources=(), body_max_bytes=1)
    assert refused.value.code == "E709"


def test_a_body_is_one_message_an_array_or_lines() -> None:
    assert messages_of(b'{"a": [1]}') == [b'{"a": [1]}']
    assert messages_of(b' [{"a": 1}, {"b": 2}]') == [b'{"a": 1}', b'{"b": 2}']
    assert messages_of(b'{"a": 1}\n\n{"b": 2}\n', is_lines=True) == [b'{"a": 1}', b'{"b": 2}']
    assert messages_of(b"[1, 2") == [b"[1, 2"]
