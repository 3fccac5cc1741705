"""Events arrive at least once at a real HTTP server that fails, redirects, hangs or is dead; nobody waits for it."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from alarm_worlds import GATHERING, make_site, quiet, row, run, stand
from simulate.small_scenes import merge

from vsd_analytics.live.delivery import AlarmLog, AlarmSender, Webhook, webhook_of
from vsd_analytics.live.events import AlarmEvent
from vsd_analytics.site.model import AlarmDelivery

QUICK = (0.01, 0.05)
Answer = int | float
"""A status; or, below 100, seconds to hang before it is 200."""


class Receiver(ThreadingHTTPServer):
    """A webhook that answers as `answers` says, then 200; keeps what it was sent."""

    daemon_threads = True

    def __init__(self, answers: list[Answer]) -> None:
        self.answers, self.got, self.headers = answers, [], []  # type: ignore[var-annotated]
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                receiver.headers.append(dict(self.headers))
                answer = receiver.answers.pop(0) if receiver.answers else 200
                if answer < 100:
                    time.sleep(answer)
                    answer = 200
                if answer == 200:
                    receiver.got.append(json.loads(body))
                try:
                    self.send_response(int(answer))
                    if answer in (301, 302, 307):
                        self.send_header("Location", f"{receiver.url}/other")
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                except OSError:  # it did not wait
                    pass

            def do_GET(self) -> None:
                receiver.got.append("a redirect was followed")
                self.send_response(200)
                self.end_headers()

            def log_message(self, *_: Any) -> None: ...

        super().__init__(("127.0.0.1", 0), Handler)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/hook"


@contextmanager
def receiver(*answers: Answer) -> Iterator[Receiver]:
    server = Receiver(list(answers))
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()


def until(condition: Callable[[], bool], timeout_s: float = 5.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.005)


def some_events() -> list[AlarmEvent]:
    return run(make_site(GATHERING), merge(stand(row(4), 130), quiet(150)))


def test_events_arrive_in_order_with_the_token() -> None:
    with receiver() as server:
        webhook = Webhook(server.url, token="secret\n")
        for n in range(5):
            webhook.send({"n": n})
        assert webhook.stop(timeout_s=5)
    assert [r["n"] for r in server.got] == list(range(5))
    assert {h["Authorization"] for h in server.headers} == {"Bearer secret"}
    assert {h["Content-Type"] for h in server.headers} == {"application/json"}
    assert (webhook.n_sent, webhook.n_failed, webhook.error) == (5, 0, None)


@pytest.mark.parametrize("answer", [500, 503, 404, 401, 429, 301, 302, 307])
def test_what_may_pass_is_tried_again_and_no_redirect_followed(answer: int) -> None:
    with receiver(answer, answer, answer) as server:
        webhook = Webhook(server.url, waits_s=QUICK)
        webhook.send({"n": 1})
        webhook.send({"n": 2})
        assert webhook.stop(timeout_s=5)
    assert server.got == [{"n": 1}, {"n": 2}]
    assert (webhook.n_sent, webhook.n_failed) == (2, 3)


def test_what_will_never_do_is_counted_and_holds_up_nothing() -> None:
    with receiver(400) as server:
        webhook = Webhook(server.url, waits_s=QUICK)
        webhook.send({"n": 1})
        webhook.send({"n": 2})
        assert webhook.stop(timeout_s=5)
    assert server.got == [{"n": 2}]
    assert (webhook.n_sent, webhook.n_refused) == (1, 1)
    assert webhook.refusal is not None
    assert webhook.refusal.startswith("HTTP 400")


def test_a_receiver_that_hangs_is_left_and_asked_again() -> None:
    with receiver(0.5) as server:
        webhook = Webhook(server.url, timeout_s=0.1, waits_s=QUICK)
        began_s = time.monotonic()
        webhook.send({"n": 1})
        assert time.monotonic() - began_s < 0.05
        assert webhook.stop(timeout_s=5)
        assert webhook.n_failed >= 1
        until(lambda: len(server.got) >= 2)  # at least once: the one that hung came through as well
    assert all(r == {"n": 1} for r in server.got)


def test_a_dead_receiver_costs_the_oldest_and_comes_back() -> None:
    with receiver() as server:
        url = server.url
    webhook = Webhook(url, waits_s=QUICK, queue_max=10)
    began_s = time.monotonic()
    for n in range(25):
        webhook.send({"n": n})
    assert time.monotonic() - began_s < 0.2
    until(lambda: webhook.n_failed > 2)
    assert (webhook.n_waiting, webhook.n_dropped, webhook.n_sent) == (10, 15, 0)
    assert webhook.error is not None
    assert not webhook.stop(timeout_s=0.05)


def test_back_off_grows() -> None:
    with receiver(*[500] * 4) as server:
        webhook = Webhook(server.url, waits_s=(0.05, 0.2))
        began_s = time.monotonic()
        webhook.send({"n": 1})
        assert webhook.stop(timeout_s=5)
        assert time.monotonic() - began_s >= 0.05 + 0.1 + 0.2 + 0.2


def test_only_a_site_with_a_webhook_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert webhook_of(AlarmDelivery(), environ={}) is None
    with receiver() as server:
        webhook = webhook_of(AlarmDelivery(webhook=server.url), environ={"VSD_WEBHOOK_TOKEN": "t"})
        assert webhook is not None
        webhook.send({"n": 1})
        assert webhook.stop(timeout_s=5)
        assert server.headers[0]["Authorization"] == "Bearer t"


def test_the_log_keeps_every_event_once_for_its_owner_alone(tmp_path: Path) -> None:
    path, events = tmp_path / "alarms.jsonl", some_events()
    delivery = AlarmSender(make_site(), log=AlarmLog(path))
    assert [r["event"] for r in delivery.send(events)] == ["start", "update", "end"]
    assert delivery.send(events) == []
    again = AlarmSender(make_site(), log=AlarmLog(path))
    assert again.send(events) == []
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert lines == [e.as_dict(make_site().zone) for e in events]
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_torn_line_and_foreign_lines_are_passed_over(tmp_path: Path) -> None:
    path, events = tmp_path / "alarms.jsonl", some_events()
    AlarmSender(make_site(), log=AlarmLog(path)).send(events[:2])
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    log = AlarmLog(path)
    assert [r["event"] for r in AlarmSender(make_site(), log=log).send(events)] == ["update", "end"]
    assert log.open_alarms == {}
    path.write_bytes(b'[]\n{}\n{"alarm": 1}\n{"alarm": "x", "event": "start", "at": "now", "since": 3}\n\xff\n' + whole)
    assert list(AlarmLog(path).open_alarms) == [events[0].alarm]


def test_a_disk_that_refuses_stops_no_delivery(tmp_path: Path) -> None:
    with receiver() as server:
        webhook = Webhook(server.url)
        log = AlarmLog(tmp_path / "none" / "alarms.jsonl")
        delivery = AlarmSender(make_site(), log=log, webhook=webhook)
        delivery.send(some_events())
        assert webhook.stop(timeout_s=5)
    assert len(server.got) == 3
    assert delivery.n_unlogged == 3


def test_the_topic_waits_for_a_connection() -> None:
    site = replace(make_site(), alarm_delivery=AlarmDelivery(topic="vsd/shop/alarms"))
    delivery, sent = AlarmSender(site), []
    is_connected = False

    def publish(topic: str, payload: bytes) -> bool:
        if is_connected:
            sent.append((topic, json.loads(payload)["event"]))
        return is_connected

    delivery.send(some_events()[:1])
    delivery.publish = publish
    delivery.send(some_events()[1:])
    assert (sent, delivery.n_unpublished) == ([], 3)
    is_connected = True
    delivery.publish_waiting()
    assert sent == [("vsd/shop/alarms", step) for step in ("start", "update", "end")]


def test_what_leaves_names_nobody() -> None:
    messages = stand(row(4), 100)
    for message in messages:
        message["persons"] = [{**p, "id": f"secret{p['id']}"} for p in message["persons"]]
    told = json.dumps([e.as_dict(make_site().zone) for e in run(make_site(GATHERING), messages)])
    assert "crowd" in told
    assert "secret" not in told
