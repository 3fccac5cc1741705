"""The look page over HTTP, on this machine alone: a token before anything else, one host name, no other origin.

The address with the token is opened once; a cookie takes its place. The answers are made in memory and written nowhere.
"""

from __future__ import annotations

import hmac
import json
import secrets
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Any, Final

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.errors import LiveError, VsdError
from vsd_analytics.live.look_view import LookView
from vsd_analytics.service.guard import Guard
from vsd_analytics.service.http_server import HttpServer
from vsd_analytics.wording.languages import speaking

HOST: Final = "127.0.0.1"
BODY_MAX: Final = 1000
_UNKNOWN: Final = "open the address that vsd engine live --look printed"
HEADERS: Final = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "X-Frame-Options": "DENY",
}


class LookServer:
    """Serves the page and what it asks for.

    Args:
        view: What it shows.
        pages: The page of each camera; the first is shown where none is asked for.
        policy: Content security policy of the pages.
        port: Port on this machine; 0 takes a free one.
        language: Language of the site.
        clock: Returns the current instant, from which a calibration by eye holds.
        token: What a browser must have; a new one at each start.

    Raises:
        LiveError: E709, the port cannot be used.
    """

    def __init__(
        self,
        view: LookView,
        *,
        pages: Mapping[str, str],
        policy: str,
        port: int,
        language: str,
        clock: Callable[[], datetime] = lambda: datetime.now(tz=UTC),
        token: str | None = None,
    ) -> None:
        self.view, self.pages, self.policy, self.language, self.clock = view, pages, policy, language, clock
        self.token = token or secrets.token_urlsafe(24)
        guard = Guard(
            self._answer,
            may_ask=self._may_ask,
            refuse=_refused,
            unknown=(_UNKNOWN, {}),
            is_from_here=self._is_from_here,
        )
        try:
            self._server = HttpServer(guard, host=HOST, port=port)
        except OSError as error:
            raise LiveError(
                f"--look: nothing can listen at {HOST}:{port}",
                code="E709",
                why=str(error.strerror or error),
                fix="--look 0 takes a free port",
            ) from None
        self.port = self._server.port
        self.hosts = (f"{HOST}:{self.port}", f"localhost:{self.port}")
        self.cookie = f"vsd-look-{self.port}"
        self._server.start()

    @property
    def address(self) -> str:
        """Return the address to open, with the token."""
        return f"http://{HOST}:{self.port}/?token={self.token}"

    def close(self) -> None:
        """Stop."""
        self._server.close()

    def _may_ask(self, request: Request) -> bool:
        """Return whether a request has the cookie, or the token that gives one."""
        if _is_same(request.query_params.get("token", ""), self.token) and request.method == "GET":
            return True
        return _is_same(request.cookies.get(self.cookie, ""), self.token)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        request = Request(scope, receive)
        if request.method == "GET":
            answer = await run_in_threadpool(self._shown, request.url.path, dict(request.query_params))
        elif request.method == "POST":
            answer = await self._calibrated(request)
        else:
            answer = _refused(HTTPStatus.METHOD_NOT_ALLOWED, "a page is read, and a calibration is posted")
        await answer(scope, receive, send)

    def _shown(self, path: str, asked: Mapping[str, str]) -> Response:
        """Return the page, or the newest frame of a camera."""
        if _is_same(asked.get("token", ""), self.token):  # before any routing; the cookie takes its place
            cookie = f"{self.cookie}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return _text(HTTPStatus.SEE_OTHER, "", **{"Location": "/", "Set-Cookie": cookie})
        camera_id = asked.get("camera", next(iter(self.pages)))
        if camera_id not in self.pages:
            return _text(HTTPStatus.NOT_FOUND, "there is no such camera\n")
        if path == "/":
            page = {"Content-Security-Policy": self.policy}
            return _text(HTTPStatus.OK, self.pages[camera_id], media_type="text/html", **page)
        if path != "/now":
            return _text(HTTPStatus.NOT_FOUND, "there is no such address\n")
        try:
            ratios = _ratios(asked) if "horizontal" in asked else None
        except (VsdError, ValueError):
            return _text(HTTPStatus.BAD_REQUEST, "two ratios between 0 and 1\n")
        with speaking(self.language):
            return _json(HTTPStatus.OK, self.view.now(camera_id, ratios))

    async def _calibrated(self, request: Request) -> Response:
        """Put a calibration by eye into force."""
        length = request.headers.get("content-length", "")
        is_json = request.headers.get("content-type", "").partition(";")[0] == "application/json"
        if request.url.path != "/calibration" or not is_json or not (length.isdecimal() and int(length) <= BODY_MAX):
            return _refused(HTTPStatus.BAD_REQUEST, "a small JSON object goes to /calibration")
        try:
            asked = json.loads(await request.body())
            camera_id, ratios = str(asked["camera"]), _ratios(asked)
            known = self.pages[camera_id]
        except (ValueError, KeyError, TypeError, VsdError, RecursionError, ClientDisconnect):
            return _text(HTTPStatus.BAD_REQUEST, "a camera and two ratios between 0 and 1\n")
        assert known
        return await run_in_threadpool(self._saved, camera_id, ratios)

    def _saved(self, camera_id: str, ratios: Ratios) -> Response:
        try:
            with speaking(self.language):
                saved = self.view.save(camera_id, ratios, now=self.clock().replace(microsecond=0))
        except (VsdError, OSError) as error:
            why = error.what if isinstance(error, VsdError) else "the disk refused it"
            return _json(HTTPStatus.INTERNAL_SERVER_ERROR, {"calibration": None, "error": why})
        return _json(HTTPStatus.OK, {"calibration": saved, "error": None})

    def _is_from_here(self, request: Request) -> bool:
        """Return whether a request names this server and comes from its own page.

        Another host name is that of a page elsewhere that was led to this address (DNS rebinding).
        """
        origin = request.headers.get("origin")
        is_change = request.method == "POST"
        is_own = origin in [f"http://{host}" for host in self.hosts] or (origin is None and not is_change)
        return request.headers.get("host") in self.hosts and is_own


def _is_same(token: str, wanted: str) -> bool:
    return hmac.compare_digest(token.encode("utf-8", "replace"), wanted.encode())


def _refused(status: int, title: str, *, detail: str | None = None, headers: dict[str, str] | None = None) -> Response:
    """Return the answer to a request whose body was not read."""
    return _text(status, f"{title}{f': {detail}' if detail else ''}\n", **{**(headers or {}), "Connection": "close"})


def _json(status: int, content: Mapping[str, Any]) -> Response:
    return _text(status, json.dumps(content, allow_nan=False), media_type="application/json")


def _text(status: int, text: str, *, media_type: str = "text/plain", **headers: str) -> Response:
    named = {**HEADERS, "Content-Security-Policy": "default-src 'none'", **headers}
    named["Content-Type"] = f"{media_type}; charset=utf-8"
    return Response(text.encode(), status, named)


def _ratios(asked: Mapping[str, Any]) -> Ratios:
    """Return the ratios of a request; ValueError, TypeError or VsdError where they are none."""
    return Ratios(float(asked.get("horizontal", "nan")), float(asked.get("vertical", "nan")))
