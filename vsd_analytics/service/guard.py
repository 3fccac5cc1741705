"""Who may ask, before anything looks at the address: the guard of every HTTP door."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final, Protocol

from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from vsd_analytics.service.access import RateLimit

_HOST = re.compile(r"[A-Za-z0-9._-]{1,253}(:\d{1,5})?|\[[0-9A-Fa-f:.]{2,45}\](:\d{1,5})?")
_READING: Final = ("GET", "HEAD", "OPTIONS")


class Refusal(Protocol):
    """Makes the answer of a refusal."""

    def __call__(
        self, status: int, title: str, *, detail: str | None = None, headers: dict[str, str] | None = None
    ) -> Response:
        """Return it."""


@dataclass(frozen=True, slots=True)
class Guard:
    """An ASGI application before another one.

    A request is refused for its form, then for its rate, then for its token; what is refused ends its connection,
    because its body was not read.

    Attributes:
        app: What answers the others.
        may_ask: Tells whether a request has the token or cookie that it needs.
        refuse: Makes the answers of refusals.
        unknown: Title and headers of the answer to who may not ask.
        is_from_here: Tells whether Host and Origin are those of this door; None = any Host of the right form is taken,
            because nothing that is answered is made of it. A door that browsers open by a cookie needs it: the page of
            another name may be led to this address (DNS rebinding).
        limit: How often each client may ask; None = as often as it likes.
        open_paths: Addresses for everybody.
    """

    app: ASGIApp
    may_ask: Callable[[Request], bool]
    refuse: Refusal
    unknown: tuple[str, dict[str, str]]
    is_from_here: Callable[[Request], bool] | None = None
    limit: RateLimit | None = None
    open_paths: Collection[str] = ()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or pass it on."""
        refusal = self._refusal(Request(scope)) if scope["type"] == "http" else None
        if refusal is None:
            await self.app(scope, receive, send)
        else:
            refusal.headers["Connection"] = "close"
            await refusal(scope, receive, send)

    def _refusal(self, request: Request) -> Response | None:
        headers = request.headers
        host = headers.getlist("host")
        if len(host) > 1 or (host and not _HOST.fullmatch(host[0])):
            return self.refuse(400, "the header Host is not a name")
        if self.is_from_here is not None and not self.is_from_here(request):
            return self.refuse(403, "this is for pages of this address alone")
        has_length, is_chunked = "content-length" in headers, "transfer-encoding" in headers
        if has_length and is_chunked:
            return self.refuse(400, "a body has a Content-Length or a Transfer-Encoding, not both")
        if request.method in _READING and (is_chunked or headers.get("content-length", "0").strip("0")):
            return self.refuse(400, f"{request.method} has no body")
        client = request.client.host if request.client is not None else ""
        if self.limit is not None and (wait_s := self.limit.wait_s(client)) > 0:
            again = {"Retry-After": str(math.ceil(wait_s))}
            return self.refuse(429, "too many requests", detail=f"ask again in {wait_s:.1f} s", headers=again)
        if request.scope["path"] not in self.open_paths and not self.may_ask(request):
            title, more = self.unknown
            return self.refuse(401, title, headers=more)
        return None
