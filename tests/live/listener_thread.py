"""A listener that runs in a thread of a test until the test is over."""

from __future__ import annotations

import threading
from datetime import UTC, datetime
from typing import Self

from vsd_analytics.live.listener import Listener
from vsd_analytics.live.message_queue import MessageDoor
from vsd_analytics.site.model import Site


class ListenerThread:
    """A listener of one door, without a broker, between `with` and its end."""

    def __init__(self, site: Site, door: MessageDoor) -> None:
        self.listener = Listener(
            site, broker=None, password=None, door=door, clock=lambda: datetime.now(tz=UTC), status_every_s=0.1
        )
        self._stop = threading.Event()
        stop = self._stop.is_set
        self._thread = threading.Thread(target=lambda: self.listener.run(should_stop=stop), daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(20)
        assert not self._thread.is_alive()
