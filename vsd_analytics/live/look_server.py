"""The look page over HTTP, on this machine alone: a token before anything else, one host name, no other origin.

The address with the token is opened once; a cookie takes its place. The answers are made in memory and written nowhere.
"""

from __future__ import annotations

import hmac
import json
import secrets
import threading
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, ClassVar, Final
from urllib.parse import parse_qs, urlsplit

from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.errors import LiveError, VsdError
from vsd_analytics.live.look_view import LookView
from vsd_analytics.wording.languages import speaking

HOST: Final = "127.0.0.1"
BODY_MAX: Final = 1000
READ_S: Final = 10.0
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
        try:
            self._server = _LookHTTPServer((HOST, port), _LookHandler)
        except OSError as error:
            raise LiveError(
                f"--look: nothing can listen at {HOST}:{port}",
                code="E709",
                why=str(error.strerror or error),
                fix="--look 0 takes a free port",
            ) from None
        self._server.look = self
        self.port = int(self._server.server_address[1])
        self.hosts = (f"{HOST}:{self.port}", f"localhost:{self.port}")
        self.cookie = f"vsd-look-{self.port}"
        threading.Thread(target=self._server.serve_forever, args=(0.2,), name="look", daemon=True).start()

    @property
    def address(self) -> str:
        """Return the address to open, with the token."""
        return f"http://{HOST}:{self.port}/?token={self.token}"

    def close(self) -> None:
        """Stop."""
        self._server.shutdown()
        self._server.server_close()


class _LookHTTPServer(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    look: LookServer

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a connection that broke off."""


class _LookHandler(BaseHTTPRequestHandler):
    """One connection."""

    server_version = "vsd"
    sys_version = ""
    timeout: ClassVar[float] = READ_S
    server: _LookHTTPServer

    def do_GET(self) -> None:
        """Show the page, or the newest frame of a camera."""
        look = self.server.look
        parts = urlsplit(self.path)
        asked = {key: values[0] for key, values in parse_qs(parts.query).items()}
        if not self._is_from_here(look):
            return
        if self._is_known(asked.get("token", "")):  # before any routing
            self._answer(HTTPStatus.SEE_OTHER, "", "text/plain", Location="/", **self._cookie(look))
            return
        if not self._has_cookie(look):
            return
        camera_id = asked.get("camera", next(iter(look.pages)))
        if camera_id not in look.pages:
            self._answer(HTTPStatus.NOT_FOUND, "there is no such camera\n", "text/plain")
        elif parts.path == "/":
            page = {"Content-Security-Policy": look.policy}
            self._answer(HTTPStatus.OK, look.pages[camera_id], "text/html", **page)
        elif parts.path == "/now":
            try:
                ratios = _ratios(asked) if "horizontal" in asked else None
            except (VsdError, ValueError):
                self._answer(HTTPStatus.BAD_REQUEST, "two ratios between 0 and 1\n", "text/plain")
                return
            with speaking(look.language):
                self._json(HTTPStatus.OK, look.view.now(camera_id, ratios))
        else:
            self._answer(HTTPStatus.NOT_FOUND, "there is no such address\n", "text/plain")

    def do_POST(self) -> None:
        """Put a calibration by eye into force."""
        look = self.server.look
        if not self._is_from_here(look, is_change=True) or not self._has_cookie(look):
            return
        length = self.headers.get("Content-Length", "")
        is_json = self.headers.get("Content-Type", "").partition(";")[0] == "application/json"
        if self.path != "/calibration" or not is_json or not (length.isdecimal() and int(length) <= BODY_MAX):
            self._answer(HTTPStatus.BAD_REQUEST, "a small JSON object goes to /calibration\n", "text/plain")
            return
        try:
            asked = json.loads(self.rfile.read(int(length)))
            camera_id, ratios = str(asked["camera"]), _ratios(asked)
            known = look.pages[camera_id]
        except (ValueError, KeyError, TypeError, VsdError, OSError):
            self._answer(HTTPStatus.BAD_REQUEST, "a camera and two ratios between 0 and 1\n", "text/plain")
            return
        assert known
        try:
            with speaking(look.language):
                saved = look.view.save(camera_id, ratios, now=look.clock().replace(microsecond=0))
        except (VsdError, OSError) as error:
            why = error.what if isinstance(error, VsdError) else "the disk refused it"
            self._json(HTTPStatus.INTERNAL_SERVER_ERROR, {"calibration": None, "error": why})
            return
        self._json(HTTPStatus.OK, {"calibration": saved, "error": None})

    def log_message(self, *_: Any) -> None:
        """Write no line per request: the first has the token."""

    def _is_from_here(self, look: LookServer, *, is_change: bool = False) -> bool:
        """Return whether a request names this server and comes from its own page; else refuse it.

        Another host name is that of a page elsewhere that was led to this address (DNS rebinding).
        """
        origin = self.headers.get("Origin")
        is_own = origin in [f"http://{host}" for host in look.hosts] or (origin is None and not is_change)
        if self.headers.get("Host") in look.hosts and is_own:
            return True
        self._answer(HTTPStatus.FORBIDDEN, "this is for pages of this address alone\n", "text/plain")
        return False

    def _is_known(self, token: str) -> bool:
        return hmac.compare_digest(token.encode("utf-8", "replace"), self.server.look.token.encode())

    def _has_cookie(self, look: LookServer) -> bool:
        try:
            cookie = SimpleCookie(self.headers.get("Cookie", "")).get(look.cookie)
        except CookieError:
            cookie = None
        if cookie is not None and self._is_known(cookie.value):
            return True
        self._answer(HTTPStatus.UNAUTHORIZED, "open the address that vsd engine live --look printed\n", "text/plain")
        return False

    def _cookie(self, look: LookServer) -> dict[str, str]:
        return {"Set-Cookie": f"{look.cookie}={look.token}; HttpOnly; SameSite=Strict; Path=/"}

    def _json(self, status: HTTPStatus, content: Mapping[str, Any]) -> None:
        self._answer(status, json.dumps(content, allow_nan=False), "application/json")

    def _answer(self, status: HTTPStatus, text: str, media_type: str, **headers: str) -> None:
        body = text.encode()
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Security-Policy": "default-src 'none'", **headers}.items():
            self.send_header(name, value)
        self.send_header("Content-Type", f"{media_type}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)


def _ratios(asked: Mapping[str, Any]) -> Ratios:
    """Return the ratios of a request; ValueError, TypeError or VsdError where they are none."""
    return Ratios(float(asked.get("horizontal", "nan")), float(asked.get("vertical", "nan")))
