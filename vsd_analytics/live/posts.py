"""Messages by HTTP: a server in threads of its own, which answers when the listener has stored them.

A request is answered 202 only after its messages are durable. It speaks plain HTTP and is meant for this machine; for
others put a proxy with TLS before it.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import os
import threading
import time
from collections import Counter
from collections.abc import Collection, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar, Final

import msgspec

from vsd_analytics.config.access_token import UnsafeTokenError, access_token, is_loopback
from vsd_analytics.errors import LiveError, Where
from vsd_analytics.ingest.reading.adapter import EXCERPT_CHARS
from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.message_queue import MESSAGES_MAX, MessageQueue, OfferedMessages

DEFAULT_ADDRESS: Final = "127.0.0.1:8765"
TOKEN_VARIABLE: Final = "VSD_HTTP_TOKEN"
TOKEN_FILE: Final = Path("secrets") / "http-token"
FRAMES: Final = "frames"
"""Path of VSD frame messages; any other path is the id of a `[[source]]`."""
TOPIC: Final = "POST /"
"""Front of the topic that a posted message has in quarantine and logs."""
STOP_POLL_S: Final = 0.2
"""How often the server looks whether it shall stop."""
CONNECTIONS_MAX: Final = 64
REJECTED_SHOWN: Final = 100
READ_S: Final = 15.0
ANSWER_S: Final = 30.0


class PostInbox(MessageQueue):
    """An HTTP server and the requests that wait to be stored.

    Args:
        address: HOST:PORT to listen at; port 0 takes a free one.
        token: Every request has it, as `Authorization: Bearer TOKEN`.
        sources: Paths that may be posted to, beside `frames`.
        body_max_bytes: Longest body.

    Raises:
        LiveError: E709, the address cannot be used.
    """

    def __init__(self, address: str, *, token: str, sources: Collection[str], body_max_bytes: int) -> None:
        super().__init__()
        self.name = "http"
        self.token = token.encode()
        self.paths = (FRAMES, *sources)
        self.body_max_bytes = body_max_bytes
        self.n_refused: Counter[str] = Counter()
        host, port = host_and_port(address)
        try:
            self._server = _Server((host, port), _Handler)
        except OSError as error:
            raise LiveError(
                f"--http {address}: nothing can listen there",
                code="E709",
                why=str(error.strerror or error),
                fix="name another port, or stop the program that has it: ss -ltnp",
            ) from None
        self._server.inbox = self
        self.address = f"{host}:{self._server.server_address[1]}"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(STOP_POLL_S,), daemon=True)
        self._thread.start()

    @property
    def is_loopback(self) -> bool:
        """Return whether only this machine can reach it."""
        return is_loopback(self.address.rpartition(":")[0])

    def as_dict(self) -> dict[str, Any]:
        """Return its state for the heartbeat: address, and refused requests by status."""
        return {"address": self.address, "refused": dict(self.n_refused)}

    def close(self) -> None:
        """Stop taking requests, and answer those that wait with 503."""
        super().close()
        self._server.shutdown()
        self._server.finish()


class _Server(ThreadingHTTPServer):
    """The server: a thread a connection, a bounded number of them."""

    daemon_threads = True
    block_on_close = False
    inbox: PostInbox

    def __init__(self, *arguments: Any) -> None:
        self._room = threading.BoundedSemaphore(CONNECTIONS_MAX)
        self._n_busy = 0
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread; close it where too many are open."""
        if not self._room.acquire(blocking=False):
            self.inbox.n_refused["too many connections"] += 1
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a connection that broke off: its sender got no answer and sends again."""

    def finish(self) -> None:
        """Close the port, after a moment for answers that are on their way."""
        until_s = time.monotonic() + 1.0
        while self._n_busy and time.monotonic() < until_s:
            time.sleep(0.01)
        self.server_close()

    @contextlib.contextmanager
    def answering(self) -> Any:
        """Count a request that will be answered."""
        self._n_busy += 1
        try:
            yield
        finally:
            self._n_busy -= 1


class _Refusal(Exception):  # noqa: N818 - an answer, not an error of the program
    """An answer that is not 202: status, a sentence for people."""


class _Handler(BaseHTTPRequestHandler):
    """One connection."""

    protocol_version = "HTTP/1.1"
    server_version = "vsd"
    sys_version = ""
    timeout: ClassVar[float] = READ_S
    server: _Server

    def do_POST(self) -> None:
        """Take messages, and answer when they are stored."""
        inbox = self.server.inbox
        with self.server.answering():
            try:
                posted = self._posted(inbox)
                if not inbox.put(posted):
                    raise _Refusal(HTTPStatus.SERVICE_UNAVAILABLE, "too much waits to be stored: send it again later")
                posted.is_done.wait(ANSWER_S)
                if posted.bad is None:
                    text = "not stored yet: send it again, records that were stored meanwhile count once"
                    raise _Refusal(HTTPStatus.SERVICE_UNAVAILABLE, text)
            except _Refusal as refusal:
                status, why = refusal.args
                inbox.n_refused[str(int(status))] += 1
                self._answer(status, {"error": why})
                return
            n_bad = len({number for number, _ in posted.bad})
            shown = posted.bad[:REJECTED_SHOWN]
            rejected = [{"message": n, "reason": r.reason, "detail": r.detail[:EXCERPT_CHARS]} for n, r in shown]
            self._answer(
                HTTPStatus.UNPROCESSABLE_ENTITY if n_bad else HTTPStatus.ACCEPTED,
                {
                    "stored": len(posted.messages) - n_bad,
                    "quarantined": n_bad,
                    **({"rejected": rejected} if rejected else {}),
                },
            )

    def do_GET(self) -> None:
        """Refuse to show anything."""
        self._answer(HTTPStatus.METHOD_NOT_ALLOWED, {"error": "messages are posted here; nothing can be read"})

    do_PUT = do_DELETE = do_PATCH = do_HEAD = do_OPTIONS = do_GET  # noqa: N815 - names of the library

    def log_message(self, *_: Any) -> None:
        """Write no line per request."""

    def _posted(self, inbox: PostInbox) -> OfferedMessages:
        """Read a request; what is refused before its body was read ends the connection."""
        self.close_connection = True
        given = self.headers.get("Authorization", "").encode("utf-8", "replace")
        if not hmac.compare_digest(given, b"Bearer " + inbox.token):
            raise _Refusal(HTTPStatus.UNAUTHORIZED, "the header Authorization: Bearer TOKEN is missing or wrong")
        path = self.path.partition("?")[0].strip("/")
        if path not in inbox.paths:
            known = ", ".join(f"/{p}" for p in inbox.paths[:20])
            raise _Refusal(HTTPStatus.NOT_FOUND, f"nothing is taken there; there are {known}")
        if self.headers.get("Content-Encoding", "identity") != "identity":
            raise _Refusal(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send the body as it is, not compressed")
        length = self.headers.get("Content-Length", "")
        if "Transfer-Encoding" in self.headers or not (length.isascii() and length.isdigit() and len(length) < 12):
            raise _Refusal(HTTPStatus.LENGTH_REQUIRED, "send a Content-Length")
        if int(length) > inbox.body_max_bytes:
            text = f"a body has at most {inbox.body_max_bytes:,} bytes (line_max_bytes)"
            raise _Refusal(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, text)
        body = self._body(int(length))
        is_lines = any(kind in self.headers.get("Content-Type", "").lower() for kind in ("ndjson", "jsonl"))
        messages = messages_of(body, is_lines=is_lines)
        if not messages:
            raise _Refusal(HTTPStatus.BAD_REQUEST, "the body holds no message")
        if len(messages) > MESSAGES_MAX:
            raise _Refusal(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"a request has at most {MESSAGES_MAX:,} messages")
        self.close_connection = self.headers.get("Connection", "").lower() == "close"
        return OfferedMessages([ReceivedMessage(TOPIC + path, m, len(m)) for m in messages], len(body))

    def _body(self, length: int) -> bytes:
        try:
            body = self.rfile.read(length)
        except OSError:
            body = b""
        if len(body) < length:
            raise _Refusal(HTTPStatus.BAD_REQUEST, "the body ended early")
        return body

    def _answer(self, status: HTTPStatus, content: Mapping[str, Any]) -> None:
        body = json.dumps(content).encode() + b"\n"
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        if status == HTTPStatus.UNAUTHORIZED:
            self.send_header("WWW-Authenticate", "Bearer")
        if status == HTTPStatus.SERVICE_UNAVAILABLE:
            self.send_header("Retry-After", "1")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)


def messages_of(body: bytes, *, is_lines: bool = False) -> list[bytes]:
    """Return the messages of a body: the elements of a JSON array, the lines, or the body itself.

    Args:
        body: What was posted.
        is_lines: The sender says that each line is a message.
    """
    if is_lines:
        return [line for line in body.splitlines() if line.strip()]
    if body.lstrip().startswith(b"["):
        try:
            return [bytes(raw) for raw in msgspec.json.decode(body, type=list[msgspec.Raw])]
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return [body]  # quarantined as it is, with the reason
    return [body] if body.strip() else []


def host_and_port(address: str) -> tuple[str, int]:
    """Return host and port of HOST:PORT, of HOST, or of :PORT.

    Raises:
        LiveError: E709, it is neither.
    """
    host, _, port = (address if ":" in address else f"{address}:{DEFAULT_ADDRESS.rpartition(':')[2]}").rpartition(":")
    if not (port.isascii() and port.isdigit() and int(port) < 65536) or "/" in host or ":" in host:
        fix = f"--http {DEFAULT_ADDRESS}"
        raise LiveError(f"--http {address!r} is not HOST:PORT", code="E709", why="an IPv4 address or a name", fix=fix)
    return host or "127.0.0.1", int(port)


def token_of(root: Path, *, environ: Mapping[str, str]) -> str:
    """Return the token of the environment's VSD_HTTP_TOKEN, else of `secrets/http-token`, which is made when missing.

    Raises:
        LiveError: E704, it cannot be read, or has fewer than 16 characters.
    """
    path = root / TOKEN_FILE
    try:
        return access_token(path, variable=TOKEN_VARIABLE, environ=environ)
    except UnsafeTokenError as error:
        raise LiveError(
            "the token of --http cannot be used",
            code="E704",
            where=Where(os.fspath(path)),
            why=str(error),
            fix=f"delete the file, and vsd listen makes a new one; or set {TOKEN_VARIABLE}",
        ) from None
