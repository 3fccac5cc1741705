"""A listener whose own clock is wrong, or whose quarantine is full: what it acknowledges is durable, and it says so."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from live.local_broker import MOSQUITTO, WHY_NOT, Mosquitto, frame, publish, write_project

from vsd_analytics.config.project import load_site
from vsd_analytics.doctor.broker import examine_listener
from vsd_analytics.ingest.intake.replay import replay
from vsd_analytics.live.listener import Listener
from vsd_analytics.live.status import Status

pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason=WHY_NOT)

N = 30
YEARS = timedelta(days=6 * 365)


class World:
    """A project whose session at a broker has been made, and a clock that can be set."""

    def __init__(self, folder: Path, broker: Mosquitto, *, more: str = "") -> None:
        self.root = write_project(folder / "project", port=broker.port, more=more)
        self.broker = broker
        self.ahead = timedelta(0)
        self.listen(lambda status: status.connected_since is not None)

    def now(self) -> datetime:
        return datetime.now(tz=UTC) + self.ahead

    def send(self, first: int, n: int, *, camera: str = "cam-1") -> None:
        publish(self.broker.port, [frame(i, camera=camera) for i in range(first, first + n)])

    def listen(
        self, is_enough: Callable[[Status], object], *, then: Callable[[], object] = lambda: None, **options: Any
    ) -> Listener:
        """Listen until it is enough; then look, while it still listens."""
        site = load_site(self.root)
        assert site.broker is not None
        given = {"linger_s": 0.05, "status_every_s": 0.1, **options}
        listener = Listener(site, broker=site.broker, password=None, clock=self.now, **given)
        until_s = time.monotonic() + 30

        def should_stop() -> bool:
            if is_enough(listener.status):
                then()
                return True
            assert time.monotonic() < until_s, f"waited in vain: {listener.status}"
            return False

        listener.run(should_stop=should_stop)
        return listener

    def quarantined(self) -> list[str]:
        files = (self.root / "quarantine").glob("*.jsonl")
        return [json.loads(line)["reason"] for file in files for line in file.read_text().splitlines()]


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    broker = Mosquitto(tmp_path / "broker", extra=["set_tcp_nodelay true"]).start()
    yield broker
    broker.stop()


@pytest.mark.parametrize("ahead", [-YEARS, YEARS])
def test_a_wrong_clock_is_reported_and_every_message_is_durable_and_replayed_once_it_is_right(
    tmp_path: Path, broker: Mosquitto, ahead: timedelta
) -> None:
    world = World(tmp_path, broker)
    world.send(0, N)
    world.ahead = ahead
    site = load_site(world.root)
    told = []

    def look() -> None:
        status = listeners[0].as_dict(now=world.now())
        told.extend(examine_listener(site, status=status, now=world.now()))

    listeners: list[Status] = []

    def disagrees(status: Status) -> bool:
        listeners[:] = [status]
        return status.state == "clocks disagree" and status.n_acknowledged == N

    status = world.listen(disagrees, then=look).status
    assert status.error is not None
    assert f"here it is {world.now():%Y}" in status.error
    assert f"messages of cam-1 say {world.now() - ahead:%Y}" in status.error
    assert "timedatectl" in status.error
    assert (told[0].subject, told[0].state, told[0].fix) == ("listener", "needs you", "vsd explain E708")
    assert world.quarantined() == ["time-out-of-range"] * N

    world.ahead = timedelta(0)
    assert replay(site, reason="time-out-of-range", now=world.now()).n_solved == N
    assert world.quarantined() == []
    world.send(N, 1)
    world.listen(lambda status: status.state == "listening" and status.n_stored["frames"] == 1)


def test_folds_go_on_when_a_clock_that_was_ahead_is_set_right(tmp_path: Path, broker: Mosquitto) -> None:
    world = World(tmp_path, broker)
    world.send(0, N)
    world.ahead = YEARS

    def is_folded(status: Status) -> bool:
        world.ahead = timedelta(0)
        return status.n_folds > 0

    assert world.listen(is_folded, fold_every_s=1.0).status.n_stored["frames"] == N


def test_one_camera_with_a_wrong_clock_does_not_make_the_listener_doubt_its_own(
    tmp_path: Path, broker: Mosquitto
) -> None:
    world = World(tmp_path, broker)
    old = datetime.now(tz=UTC) - YEARS
    publish(broker.port, [frame(i, camera=f"cam-{1 + i % 2}", at=old if i % 2 else None) for i in range(2 * N)])
    states = set()

    def is_done(status: Status) -> bool:
        states.add(status.state)
        return status.n_acknowledged == 2 * N

    world.listen(is_done)
    assert "clocks disagree" not in states
    assert world.quarantined() == ["time-out-of-range"] * N


def test_nothing_that_a_full_quarantine_cannot_take_is_acknowledged_and_the_next_day_takes_it(
    tmp_path: Path, broker: Mosquitto
) -> None:
    world = World(tmp_path, broker, more="[ingest]\nquarantine_day_max = 15\n")
    world.send(0, 5, camera="elsewhere")  # of a frame and two people each
    sent: list[int] = []
    when_full: list[tuple[str | None, int, int]] = []

    def is_done(status: Status) -> bool:
        if status.n_acknowledged == 5 and not sent:
            world.send(5, 3, camera="elsewhere")
            sent.append(3)
        if status.state == "cannot store" and not when_full:
            when_full.append((status.error, status.n_acknowledged, len(world.quarantined())))
            world.ahead = timedelta(days=1)
        return status.n_acknowledged == 8

    world.listen(is_done)
    ((error, n_acknowledged, n_records),) = when_full
    assert error is not None
    assert "quarantine is full for this day" in error
    assert "quarantine_day_max" in error
    assert (n_acknowledged, n_records) == (5, 15)
    assert len(world.quarantined()) > 15
