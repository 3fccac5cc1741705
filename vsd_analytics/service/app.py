"""The HTTP side of the service: token, rate, entity tags, and errors as problem documents (RFC 9457)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import Any, Final

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from vsd_analytics.errors import ConfigError, StoreError, VsdError
from vsd_analytics.service.access import RateLimit, is_allowed
from vsd_analytics.service.answers import NotFoundError, ReportAnswers
from vsd_analytics.service.desk import Desk, is_at_desk
from vsd_analytics.service.guard import Guard
from vsd_analytics.service.openapi import ADDRESSES, Address, document

HEADERS: Final = {
    "Cache-Control": "private, no-cache",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
        "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    ),
}
"""Of every answer. The pages are one file each, so nothing else may be loaded."""
_CHALLENGES: Final = ('Basic realm="vsd", charset="UTF-8"', "Bearer")
"""Each in a header of its own: of a list in one header, Chromium reads the first alone, and asks for nothing."""


def make_app(
    answers: ReportAnswers, *, token: str, limit: RateLimit, title: str, desk: Desk | None = None
) -> Starlette:
    """Return the service as an ASGI application.

    Args:
        answers: What it answers.
        token: What a client must send.
        limit: How often each client may ask.
        title: Name of the site, for the OpenAPI document.
        desk: Where people write; None = nothing can be changed.
    """
    described = (json.dumps(document(title=title), ensure_ascii=False, indent=1) + "\n").encode()

    async def health(request: Request) -> Response:
        return _answer(request, b'{"ok": true}\n', "application/json")

    async def openapi(request: Request) -> Response:
        return _answer(request, described, "application/json")

    async def answer(request: Request, *, address: Address) -> Response:
        ask: Callable[..., bytes] = getattr(answers, address.name)
        body = await run_in_threadpool(ask, *request.path_params.values())
        return _answer(request, body, address.media_type, policy=address.policy)

    routes = [Route("/health", health), Route("/openapi.json", openapi)]
    routes += [Route(a.path, partial(answer, address=a)) for a in ADDRESSES]
    routes += [] if desk is None else desk.routes()
    app = Starlette(
        routes=routes,
        exception_handlers={
            HTTPException: partial(_http_problem, desk=desk),
            VsdError: partial(_problem, desk=desk),
            Exception: _unexpected,
        },
    )
    app.router.redirect_slashes = False  # a redirect names the host that the caller named
    app.add_middleware(
        Guard,
        may_ask=lambda request: (
            is_allowed(request.headers.get("authorization"), token=token)
            or (desk is not None and is_at_desk(request))  # the desk asks for its own token
        ),
        refuse=_problem_response,
        unknown=("the token is missing or wrong", {}),
        limit=limit,
        open_paths=("/health",),
    )
    return app


def _answer(request: Request, body: bytes, media_type: str, *, policy: str | None = None) -> Response:
    """Return a body with its entity tag, or 304 when the client has it already."""
    tag = f'"{hashlib.blake2b(body, digest_size=16).hexdigest()}"'
    headers = {**HEADERS, "ETag": tag} | ({} if policy is None else {"Content-Security-Policy": policy})
    given = [one.strip().removeprefix("W/") for one in request.headers.get("if-none-match", "").split(",")]
    if tag in given or "*" in given:
        return Response(status_code=304, headers=headers)
    return Response(body, media_type=media_type, headers=headers)


async def _problem(request: Request, error: Exception, *, desk: Desk | None) -> Response:
    """Return an error of the program as it is printed on a terminal: what, why, how to fix it, code."""
    assert isinstance(error, VsdError)
    status = 404 if isinstance(error, NotFoundError) else 503 if isinstance(error, StoreError | ConfigError) else 500
    if desk is not None and is_at_desk(request):
        return await run_in_threadpool(desk.problem, status)
    return _problem_response(status, error.what, detail=error.why, fix=error.fix, code=error.code)


async def _http_problem(request: Request, error: Exception, *, desk: Desk | None) -> Response:
    assert isinstance(error, HTTPException)
    if desk is not None and is_at_desk(request):
        return await run_in_threadpool(desk.problem, error.status_code)
    problems = {
        404: ("there is no such address", "/openapi.json lists all"),
        405: ("the service is read-only", "use GET"),
    }
    title, fix = problems.get(error.status_code, (str(error.detail), None))
    return _problem_response(error.status_code, title, fix=fix, headers=dict(error.headers or {}))


async def _unexpected(request: Request, error: Exception) -> Response:
    return _problem_response(500, "the answer could not be made", detail="the log of vsd serve has the reason")


def _problem_response(
    status: int,
    title: str,
    *,
    detail: str | None = None,
    fix: str | None = None,
    code: str | None = None,
    headers: dict[str, str] | None = None,
) -> Response:
    if status == HTTPStatus.UNAUTHORIZED:
        detail, fix = "every address but /health needs it", "send the header Authorization: Bearer TOKEN"
    body: dict[str, Any] = {"type": "about:blank", "title": title, "status": status, "detail": detail, "fix": fix}
    if code is not None:
        body |= {"type": f"urn:vsd-analytics:{code}", "code": code}
    text = json.dumps(body, ensure_ascii=True) + "\n"
    answer = Response(
        text, status_code=status, media_type="application/problem+json", headers={**HEADERS, **(headers or {})}
    )
    for challenge in _CHALLENGES if status == HTTPStatus.UNAUTHORIZED else ():
        answer.headers.append("WWW-Authenticate", challenge)
    return answer
