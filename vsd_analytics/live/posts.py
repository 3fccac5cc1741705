"""Messages by HTTP: requests are answered by a thread of their own when the listener has stored their messages.

A request is answered 202 only after its messages are durable. The server (`service.http_server`) speaks plain HTTP and
is meant for this machine; for others put a proxy with TLS before it.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import os
from collections import Counter
from collections.abc import Collection, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

import msgspec
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from vsd_analytics.config.access_token import UnsafeTokenError, access_token, is_loopback
from vsd_analytics.errors import LiveError, Where
from vsd_analytics.ingest.reading.adapter import EXCERPT_CHARS
from vsd_analytics.live.batches import FRAMES, TOPIC, ReceivedMessage
from vsd_analytics.live.message_queue import MESSAGES_MAX, MessageQueue, OfferedMessages
from vsd_analytics.service.guard import Guard
from vsd_analytics.service.http_server import HttpServer

DEFAULT_ADDRESS: Final = "127.0.0.1:8765"
TOKEN_VARIABLE: Final = "VSD_HTTP_TOKEN"
TOKEN_FILE: Final = Path("secrets") / "http-token"
REJECTED_SHOWN: Final = 100
ANSWER_S: Final = 30.0
_LATER: Final = {"Retry-After": "1"}


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
        self.paths = (FRAMES, *sources)
        self.body_max_bytes = body_max_bytes
        self.n_refused: Counter[str] = Counter()
        self._wanted = b"Bearer " + token.encode()
        unknown = ("the header Authorization: Bearer TOKEN is missing or wrong", {"WWW-Authenticate": "Bearer"})
        app = Guard(self._answer, may_ask=self._has_token, refuse=self._refused, unknown=unknown)
        host, port = host_and_port(address)
        try:
            self._server = HttpServer(app, host=host, port=port)
        except OSError as error:
            raise LiveError(
                f"--http {address}: nothing can listen there",
                code="E709",
                why=str(error.strerror or error),
                fix="name another port, or stop the program that has it: ss -ltnp",
            ) from None
        self.address = f"{host}:{self._server.port}"
        self._server.start()

    @property
    def is_loopback(self) -> bool:
        """Return whether only this machine can reach it."""
        return is_loopback(self.address.rpartition(":")[0])

    def as_dict(self) -> dict[str, Any]:
        """Return its state for the heartbeat: address, refused requests by status, and connections that were cut."""
        return {"address": self.address, "refused": dict(self.n_refused), "cut": dict(self._server.n_cut)}

    def close(self) -> None:
        """Stop taking requests, and answer those that wait with 503."""
        super().close()
        self._server.close()

    def _has_token(self, request: Request) -> bool:
        given = request.headers.get("authorization", "").encode("utf-8", "replace")
        return hmac.compare_digest(given, self._wanted)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Take the messages of one request, and answer when they are stored."""
        if scope["type"] != "http":
            return
        with contextlib.suppress(ClientDisconnect):  # it sends again what was not answered
            answer = await self._answered(Request(scope, receive))
            await answer(scope, receive, send)

    async def _answered(self, request: Request) -> Response:
        if (refusal := self._refusal(request)) is not None:
            refusal.headers["Connection"] = "close"  # its body was not read
            return refusal
        body = await request.body()
        kind = request.headers.get("content-type", "").lower()
        messages = messages_of(body, is_lines="ndjson" in kind or "jsonl" in kind)
        if not messages:
            return self._refused(HTTPStatus.BAD_REQUEST, "the body holds no message")
        if len(messages) > MESSAGES_MAX:
            return self._refused(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"a request has at most {MESSAGES_MAX:,} messages"
            )
        loop, is_done = asyncio.get_running_loop(), asyncio.Event()

        def tell() -> None:
            with contextlib.suppress(RuntimeError):  # the server has ended meanwhile
                loop.call_soon_threadsafe(is_done.set)

        topic = TOPIC + _path(request)
        posted = OfferedMessages([ReceivedMessage(topic, m, len(m)) for m in messages], len(body), tell=tell)
        if not self.put(posted):
            return self._refused(
                HTTPStatus.SERVICE_UNAVAILABLE, "too much waits to be stored: send it again later", headers=_LATER
            )
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(is_done.wait(), ANSWER_S)
        if posted.bad is None:
            text = "not stored yet: send it again, records that were stored meanwhile count once"
            return self._refused(HTTPStatus.SERVICE_UNAVAILABLE, text, headers=_LATER)
        n_bad = len({number for number, _ in posted.bad})
        shown = posted.bad[:REJECTED_SHOWN]
        rejected = [{"message": n, "reason": r.reason, "detail": r.detail[:EXCERPT_CHARS]} for n, r in shown]
        answer = {"stored": len(messages) - n_bad, "quarantined": n_bad, **({"rejected": rejected} if rejected else {})}
        return _json(HTTPStatus.UNPROCESSABLE_ENTITY if n_bad else HTTPStatus.ACCEPTED, answer)

    def _refusal(self, request: Request) -> Response | None:
        """Return why a request is refused before its body is read; None = it is not."""
        if request.method != "POST":
            return self._refused(HTTPStatus.METHOD_NOT_ALLOWED, "messages are posted here; nothing can be read")
        if _path(request) not in self.paths:
            known = ", ".join(f"/{p}" for p in self.paths[:20])
            return self._refused(HTTPStatus.NOT_FOUND, f"nothing is taken there; there are {known}")
        if request.headers.get("content-encoding", "identity") != "identity":
            return self._refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send the body as it is, not compressed")
        length = request.headers.get("content-length")
        if length is None:
            return self._refused(HTTPStatus.LENGTH_REQUIRED, "send a Content-Length")
        if int(length) > self.body_max_bytes:
            text = f"a body has at most {self.body_max_bytes:,} bytes (line_max_bytes)"
            return self._refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, text)
        return None

    def _refused(
        self, status: int, title: str, *, detail: str | None = None, headers: dict[str, str] | None = None
    ) -> Response:
        """Return an answer that stores nothing, and count it."""
        self.n_refused[str(int(status))] += 1
        return _json(status, {"error": title if detail is None else f"{title}: {detail}"}, headers)


def _path(request: Request) -> str:
    return str(request.scope["path"]).strip("/")


def _json(status: int, content: Mapping[str, Any], headers: Mapping[str, str] | None = None) -> Response:
    return Response(json.dumps(content).encode() + b"\n", status, headers, media_type="application/json")


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
