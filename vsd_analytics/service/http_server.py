"""The one HTTP server of the program: uvicorn, with bounds on connections, on the time of any byte, and on heads.

uvicorn alone has no limit for the time that a head or a body takes, and refuses requests while too many connections are
open, so that idle ones lock others out. Here a connection that sends nothing whole gives way to a new one, and every
state in which the other side is waited for ends after some seconds. While the program itself makes an answer there is
no limit, for it ends by itself.

A head with lines that end with LF alone, or that go on in the next line, is refused: a proxy may read it otherwise
(RFC 9112, 2.2 and 5.2). The length of a body is read by h11, which refuses two that differ.
"""

from __future__ import annotations

import asyncio
import json
import re
import socket
import threading
import time
from collections import Counter
from typing import Any, Final, Literal

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

CONNECTIONS_MAX: Final = 64
HEAD_MAX_BYTES: Final = 16_384
HEAD_S: Final = 10.0
"""For a head from its connection, or from the answer before it; without a byte of it, `IDLE_S`."""
IDLE_S: Final = 5
BODY_S: Final = 15.0
TAKEN_S: Final = 30.0
"""For an answer to be taken."""
YOUNG_S: Final = 1.0
STOP_S: Final = 1
"""For answers that are on their way when the server stops."""
_ODD_LINE = re.compile(rb"(?<!\r)\n|\r\n[ \t]|\r(?!\n|\Z)|\0")

Stage = Literal["head", "body", "answer", "taken"]
_LIMITS_S: Final[dict[Stage, float]] = {"head": HEAD_S, "body": BODY_S, "taken": TAKEN_S}


class HttpServer:
    """Serves an ASGI application.

    Args:
        app: The application.
        host: Name or address to listen at.
        port: Port; 0 takes a free one.

    Raises:
        OSError: Nothing can listen there.
    """

    def __init__(self, app: ASGIApp, *, host: str, port: int) -> None:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.create_server((host, port), family=family, backlog=CONNECTIONS_MAX)
        self.port = int(self._socket.getsockname()[1])
        config = uvicorn.Config(
            app,
            http=BoundedProtocol,
            ws="none",
            lifespan="off",
            loop="asyncio",
            log_config=None,
            log_level="error",
            access_log=False,
            backlog=CONNECTIONS_MAX,  # so many are accepted at once, before the first of them is looked at
            server_header=False,
            proxy_headers=False,  # nobody but the connection says who asks
            timeout_keep_alive=IDLE_S,
            timeout_graceful_shutdown=STOP_S,
            h11_max_incomplete_event_size=HEAD_MAX_BYTES,
        )
        self._server = _WatchingServer(config)
        self._thread: threading.Thread | None = None

    @property
    def n_cut(self) -> Counter[str]:
        """Return the connections that were cut, by what they were waited for."""
        return self._server.n_cut

    def run(self) -> None:
        """Serve until SIGTERM or Ctrl-C."""
        self._server.run(sockets=[self._socket])

    def start(self) -> None:
        """Serve in a thread, until `close`."""
        self._thread = threading.Thread(target=self.run, name="http", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take no more requests, and end after the answers that are on their way."""
        self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(STOP_S + 5)
        self._socket.close()


class _WatchingServer(uvicorn.Server):
    """uvicorn's server, which looks at all connections ten times a second."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.n_cut: Counter[str] = Counter()

    async def on_tick(self, counter: int) -> bool:
        """Cut connections whose time is over."""
        now_s = time.monotonic()
        for connection in list(self.server_state.connections):
            assert isinstance(connection, BoundedProtocol)
            stage = connection.note_stage(now_s)
            if now_s - connection.since_s > _LIMITS_S.get(stage, float("inf")):
                connection.cut()
            if connection.is_cut and not connection.is_counted:
                connection.is_counted = True
                self.n_cut[stage] += 1
        return await super().on_tick(counter)


class BoundedProtocol(H11Protocol):
    """One connection."""

    transport: asyncio.Transport
    is_cut = is_counted = False
    since_s = 0.0
    _noted: tuple[Stage, int] = ("head", 0)

    def connection_made(self, transport: Any) -> None:
        """Take a connection; where too many are open, cut the one that is least worth keeping."""
        super().connection_made(transport)
        self.since_s = time.monotonic()
        others = [c for c in self.connections if isinstance(c, BoundedProtocol) and c is not self and not c.is_cut]
        if len(others) >= CONNECTIONS_MAX:
            waited_for = [c for c in others if c.stage() in ("head", "body")]
            (min(waited_for, key=BoundedProtocol.worth) if waited_for else self).cut()

    def stage(self) -> Stage:
        """Return what the connection waits for: a head, a body, the program's answer, or that the answer is taken."""
        if self.transport.is_closing() or self.transport.get_write_buffer_size():
            return "taken"
        if self.conn.their_state is h11.SEND_BODY:
            return "body"
        return "head" if self.conn.their_state is h11.IDLE else "answer"

    def note_stage(self, now_s: float) -> Stage:
        """Return the stage, and note since when it is that of the same request."""
        noted = (self.stage(), id(self.cycle))
        if noted != self._noted:
            self._noted, self.since_s = noted, now_s
        return noted[0]

    def worth(self) -> tuple[bool, bool, float]:
        """Return the order in which connections give way: the oldest first, those that never asked before others.

        One that has just come is the last: a good request sends all it has at once.
        """
        return time.monotonic() - self.since_s < YOUNG_S, self.cycle is not None, self.since_s

    def cut(self) -> None:
        """End the connection at once, whatever is on its way."""
        self.is_cut = True
        self.transport.abort()

    def handle_events(self) -> None:
        """Read what came, unless it is a head that a proxy may have read otherwise."""
        if self.conn.their_state is h11.IDLE and _ODD_LINE.search(self.conn.trailing_data[0].partition(b"\r\n\r\n")[0]):
            self.send_400_response("Lines of a head end with CR LF and do not go on in the next one.")
            return
        super().handle_events()

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no request, as a problem document, and end the connection."""
        body = json.dumps({"type": "about:blank", "title": msg, "status": 400, "error": msg}).encode() + b"\n"
        headers = [("Content-Type", "application/problem+json"), ("Content-Length", f"{len(body)}")]
        answer = h11.Response(status_code=400, headers=[*headers, ("Connection", "close")], reason=b"Bad Request")
        for event in (answer, h11.Data(data=body), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")
        self.transport.close()
