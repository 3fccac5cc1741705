"""The one HTTP server against idle, slow, smuggled and lost requests: good ones are answered meanwhile."""

from __future__ import annotations

import contextlib
import json
import re
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from live.listener_thread import ListenerThread
from live.local_broker import frame
from service.hostile_clients import (
    HELD,
    SMUGGLED,
    TOKEN,
    Door,
    answered_s,
    connect,
    drip,
    is_closed,
    many,
    n_answers,
    posting,
    reading,
    rest,
    said,
)
from site_text import site_text

from vsd_analytics.config.project import load_site
from vsd_analytics.live.posts import PostInbox
from vsd_analytics.schema import TABLES
from vsd_analytics.service import http_server
from vsd_analytics.service.access import RateLimit
from vsd_analytics.service.answers import ReportAnswers
from vsd_analytics.service.app import make_app
from vsd_analytics.service.http_server import CONNECTIONS_MAX, HttpServer
from vsd_analytics.store.layout import segment_paths

DOORS = ("serve", "listen")


class Doors:
    """Both servers, on ports of this machine."""

    def __init__(self, root: Path) -> None:
        (root / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
        self.root = root
        answers = ReportAnswers(root)
        limit = RateLimit(per_min=1e6, burst=10**6)
        self.serve = HttpServer(make_app(answers, token=TOKEN, limit=limit, title="Shop"), host="127.0.0.1", port=0)
        self.serve.start()
        site = load_site(root)
        self.posts = PostInbox("127.0.0.1:0", token=TOKEN, sources=(), body_max_bytes=1_000_000)
        self.listener = ListenerThread(site, self.posts)
        self.n_asked = 0

    def door(self, which: str) -> Door:
        if which == "serve":
            return Door(self.serve.port, reading("/v1/site"), lambda answer: b"HTTP/1.1 200 " in answer)
        self.n_asked += 1
        _, payload = frame(self.n_asked, at=datetime.now(tz=UTC), n_persons=1)
        port = int(self.posts.address.rpartition(":")[2])
        return Door(port, posting(payload), lambda answer: b"HTTP/1.1 202 " in answer)

    def n_stored(self) -> int:
        return sum(len(segment_paths(self.root / "store", table)) for table in TABLES)


@pytest.fixture
def doors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Doors]:
    monkeypatch.setattr(http_server, "_LIMITS_S", {"head": 0.6, "body": 0.6, "taken": 0.6})
    made = Doors(tmp_path)
    with made.listener:
        yield made
    made.serve.close()


@pytest.mark.parametrize("which", DOORS)
@pytest.mark.parametrize("held", HELD)
def test_connections_that_are_held_do_not_keep_good_requests_out(doors: Doors, which: str, held: str) -> None:
    door = doors.door(which)
    with many(door.port, CONNECTIONS_MAX + 20, HELD[held]) as opened:
        for _ in range(3):
            drip(opened, b"x")
            assert answered_s(doors.door(which)) < 2
    assert answered_s(doors.door(which)) < 2


@pytest.mark.parametrize("which", DOORS)
@pytest.mark.parametrize("held", HELD)
def test_every_byte_has_its_time(doors: Doors, which: str, held: str) -> None:
    """A byte now and then does not make it longer."""
    port = doors.door(which).port
    with connect(port, HELD[held]) as opened:
        until_s = time.monotonic() + 3
        while not is_closed(opened) and time.monotonic() < until_s:
            drip([opened], b"x")
            time.sleep(0.1)
        assert time.monotonic() < until_s


def test_an_answer_that_nobody_takes_ends(doors: Doors) -> None:
    """Requests for a document that fills the buffers of both sides are sent, and nothing is read."""
    data = reading("/openapi.json").replace(b"Connection: close\r\n", b"")
    with connect(doors.serve.port) as opened:
        opened.setblocking(False)
        until_s = time.monotonic() + 10
        while doors.serve.n_cut["taken"] == 0 and time.monotonic() < until_s:
            try:
                opened.send(data)
            except BlockingIOError:
                time.sleep(0.02)
            except OSError:
                break
        assert doors.serve.n_cut["taken"] == 1
    assert answered_s(doors.door("serve")) < 2


@pytest.mark.parametrize("which", DOORS)
@pytest.mark.parametrize("name", SMUGGLED)
def test_a_request_that_can_be_read_in_two_ways_is_refused_and_ends_the_connection(
    doors: Doors, which: str, name: str
) -> None:
    with connect(doors.door(which).port) as opened:
        with contextlib.suppress(OSError):  # it may be refused while it is sent
            opened.sendall(SMUGGLED[name])
        answer = rest(opened, timeout_s=3)
        assert n_answers(answer) <= 1
        assert answer == b"" or re.match(rb"HTTP/1.1 (4\d\d|501) ", answer), answer
        assert b'"site_id"' not in answer
    assert doors.n_stored() == 0
    assert answered_s(doors.door(which)) < 2


def test_two_good_requests_on_one_connection_are_two(doors: Doors) -> None:
    keep = reading("/health").replace(b"Connection: close\r\n", b"")
    assert n_answers(said(doors.serve.port, keep + reading("/health"))) == 2


@pytest.mark.parametrize("which", DOORS)
@pytest.mark.parametrize(
    "path", ["/nothing", "/v1/site/", "/v1", "//other.example/", "/health/", "/frames/", "/openapi.json", "/%2e%2e/x"]
)
def test_without_the_token_every_address_is_the_same(doors: Doors, which: str, path: str) -> None:
    for method in ("GET", "POST", "HEAD", "PUT", "OPTIONS", "TRACE"):
        data = f"{method} {path} HTTP/1.1\r\nHost: other.example\r\nConnection: close\r\n\r\n".encode()
        answer = said(doors.door(which).port, data)
        assert answer.startswith(b"HTTP/1.1 401 "), (method, answer[:200])
        assert b"other.example" not in answer


def test_an_address_with_a_slash_too_many_is_no_redirect(doors: Doors) -> None:
    answer = said(doors.serve.port, reading("/v1/site/").replace(b"Host: 127.0.0.1", b"Host: other.example"))
    assert answer.startswith(b"HTTP/1.1 404 ")
    assert b"other.example" not in answer


def test_the_rate_holds_for_strangers_and_unknown_addresses(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
    app = make_app(ReportAnswers(tmp_path), token=TOKEN, limit=RateLimit(per_min=60, burst=4), title="Shop")
    server = HttpServer(app, host="127.0.0.1", port=0)
    server.start()
    try:
        data = b"GET /nothing HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n"
        codes = [said(server.port, data).split(b" ", 2)[1] for _ in range(6)]
    finally:
        server.close()
    assert codes == [b"401"] * 4 + [b"429"] * 2


def test_a_body_beyond_the_bound_is_refused_unread(doors: Doors) -> None:
    port = doors.door("listen").port
    head = posting(b"").replace(b"Content-Length: 0", b"Content-Length: 1000001")
    assert said(port, head).startswith(b"HTTP/1.1 413 ")
    assert doors.n_stored() == 0


def test_a_body_that_ends_early_stores_nothing(doors: Doors) -> None:
    port = doors.door("listen").port
    connect(port, HELD["half a body"]).close()
    assert answered_s(doors.door("listen")) < 2
    assert doors.n_stored() == 2


def test_what_was_cut_is_counted_in_the_heartbeat(doors: Doors) -> None:
    with many(doors.door("listen").port, 3, HELD["half a head"]):
        until_s = time.monotonic() + 5
        while doors.posts.as_dict()["cut"] != {"head": 3} and time.monotonic() < until_s:
            time.sleep(0.05)
    assert doors.posts.as_dict()["cut"] == {"head": 3}
    assert json.dumps(doors.posts.as_dict())
