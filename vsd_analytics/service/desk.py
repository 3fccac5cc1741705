"""The desk over HTTP: sign in by a token of its own, read the pages, write by forms, each of them once.

A page elsewhere can write nothing through a browser that is signed in: a form must come from this address (`Origin`),
have the token that only pages of its session have, and a request id that was not done before.
"""

from __future__ import annotations

import re
import secrets
import threading
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime
from functools import partial
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import parse_qsl

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import Route

from vsd_analytics.errors import DiskError
from vsd_analytics.service.answers import NotFoundError, ReportAnswers
from vsd_analytics.service.desk_jobs import FIELD_MAX_CHARS, JOBS, PLACE_JOBS, FormMistakeError, Writing
from vsd_analytics.service.desk_page import desk_policy, render_desk, render_problem, render_sign_in
from vsd_analytics.service.desk_places import render_places
from vsd_analytics.service.desk_sessions import SESSION_S, DeskSession, DeskSessions
from vsd_analytics.service.index_files import IndexFiles
from vsd_analytics.service.now_page import now_policy
from vsd_analytics.site.model import Site
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import speaking

DESK: Final = "/desk"
SIGN_IN: Final = f"{DESK}/sign-in"
INDEX_FOLDER: Final = f"{DESK}/sites"
BODY_MAX_BYTES: Final = 16_384
FIELDS_MAX: Final = 20
HEADERS: Final = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # with no-referrer, browsers would not say where a form comes from
    "Cross-Origin-Opener-Policy": "same-origin",
    "X-Frame-Options": "DENY",
}
_REQUEST_ID: Final = re.compile(r"[A-Za-z0-9_-]{16,64}")
_AFTER: Final = re.compile(r"/desk(/[A-Za-z0-9_-]+(\.(html|pdf|json))?)*")

Handler = Callable[[Request], Awaitable[Response]]


class Desk:
    """The desk of a site.

    Args:
        answers: The pages.
        token: Its token, which is not that of readers.
        index: The index of all sites, which is shown where it was written.
        present: Returns the present.
    """

    def __init__(
        self,
        answers: ReportAnswers,
        *,
        token: str,
        index: IndexFiles,
        present: Callable[[], datetime] = lambda: datetime.now(tz=UTC),
    ) -> None:
        self._answers, self._index, self._present = answers, index, present
        self._sessions = DeskSessions(token)
        self._writing = threading.Lock()
        self._known = answers.site_now()
        self._cookie = f"vsd-desk-{self._known.site_id}"

    def routes(self) -> list[Route]:
        """Return the addresses of the desk."""
        return [
            Route(DESK, self._shown),
            Route(SIGN_IN, self._sign_in_page),
            Route(SIGN_IN, self._signed_in, methods=["POST"]),
            Route(f"{DESK}/sign-out", self._signed_out, methods=["POST"]),
            Route(f"{DESK}/now/{{floor_id}}", self._now),
            Route(f"{INDEX_FOLDER}/{{name:path}}", self._index_file),
            Route(f"{DESK}/weeks/{{week}}/floors/{{floor_id}}/{{kind}}", self._page),
            Route(f"{DESK}/places/{{floor_id}}", self._places_page),
            Route(f"{DESK}/draw", self._drawn, methods=["POST"]),
            Route(f"{DESK}/{{job}}", self._written, methods=["POST"]),
        ]

    async def _shown(self, request: Request) -> Response:
        if (session := self._session(request)) is None:
            return _moved(SIGN_IN)
        asked = {key: request.query_params.get(key, "") for key in ("question", "answer")}
        message, session.said = session.said, ""
        return await run_in_threadpool(self._desk, session, said=message, filled={"job": "answer", **asked})

    async def _page(self, request: Request) -> Response:
        if self._session(request) is None:
            return _moved(f"{SIGN_IN}?after={request.url.path}")
        render = {"page": self._answers.desk_page, "planner": self._answers.desk_planner}.get(
            request.path_params["kind"]
        )
        if render is None:
            raise NotFoundError(f"there is no {request.path_params['kind']!r} of a week")
        body = await run_in_threadpool(render, request.path_params["week"], request.path_params["floor_id"])
        return _file(body, "text/html")

    async def _index_file(self, request: Request) -> Response:
        if self._session(request) is None:
            return _moved(f"{SIGN_IN}?after={request.url.path}")
        return _file(*await run_in_threadpool(self._index.read, request.path_params["name"]))

    async def _now(self, request: Request) -> Response:
        if self._session(request) is None:
            return _moved(f"{SIGN_IN}?after={request.url.path}")
        show = partial(self._answers.floor_now, folder=f"{DESK}/now")
        body = await run_in_threadpool(show, request.path_params["floor_id"])
        return Response(body, media_type="text/html", headers={**HEADERS, "Content-Security-Policy": now_policy()})

    async def _places_page(self, request: Request) -> Response:
        if (session := self._session(request)) is None:
            return _moved(f"{SIGN_IN}?after={request.url.path}")
        notice, session.said = session.said, ""
        filled = {"floor": request.path_params["floor_id"]}
        return await run_in_threadpool(self._places, session, said=notice, filled=filled)

    async def _drawn(self, request: Request) -> Response:
        """Show a place as far as it was drawn; nothing is written."""
        fields, session = await _fields(request), self._session(request)
        if session is None:
            return _moved(SIGN_IN)
        if fields is None or not _is_from_here(request) or not session.is_own_form(fields["form"]):
            return await run_in_threadpool(self._refused)
        return await run_in_threadpool(self._places, session, filled={**fields, "job": "draw"})

    async def _sign_in_page(self, request: Request) -> Response:
        after = request.query_params.get("after", "")
        return await run_in_threadpool(self._asked_to_sign_in, after=after if _AFTER.fullmatch(after) else "")

    async def _signed_in(self, request: Request) -> Response:
        fields = await _fields(request)
        if fields is None or not _is_from_here(request):
            return await run_in_threadpool(self._refused)
        writer, after = fields.get("writer", ""), fields.get("after", "")
        after = after if _AFTER.fullmatch(after) else ""
        cookie = self._sessions.sign_in(fields.get("token", "").strip(), writer)
        if cookie is None:
            return await run_in_threadpool(self._asked_to_sign_in, after=after, writer=writer, is_wrong=True)
        is_encrypted = request.headers.get("origin", "").startswith("https://")
        answer = _moved(after or DESK)
        answer.set_cookie(
            self._cookie, cookie, max_age=int(SESSION_S), path=DESK, httponly=True, samesite="lax", secure=is_encrypted
        )
        return answer

    async def _signed_out(self, request: Request) -> Response:
        fields, session = await _fields(request), self._session(request)
        if session is not None:
            if fields is None or not _is_from_here(request) or not session.is_own_form(fields.get("form", "")):
                return await run_in_threadpool(self._refused)
            self._sessions.sign_out(request.cookies.get(self._cookie, ""))
        answer = _moved(SIGN_IN)
        answer.delete_cookie(self._cookie, path=DESK)
        return answer

    async def _written(self, request: Request) -> Response:
        """Do what a form asks for, once, and show the desk again."""
        fields, session = await _fields(request), self._session(request)
        if session is None:
            return _moved(SIGN_IN)
        is_form = fields is not None and _REQUEST_ID.fullmatch(fields.get("request", "")) is not None
        if fields is None or not is_form or not _is_from_here(request) or not session.is_own_form(fields["form"]):
            return await run_in_threadpool(self._refused)
        job = request.path_params["job"]
        if job not in JOBS:
            raise NotFoundError("there is no such form")
        return await run_in_threadpool(self._do, job, fields, session)

    def _do(self, job: str, fields: dict[str, str], session: DeskSession) -> Response:
        with self._writing:
            site = self._answers.site_now()
            after, show = DESK, self._desk
            if job in PLACE_JOBS and (floor_id := fields.get("floor")) in {f.floor_id for f in site.floors}:
                after, show = f"{DESK}/places/{floor_id}", self._places
            if fields["request"] in session.done:
                return _moved(after)
            with speaking(site.language):
                try:
                    now = self._present().astimezone(site.zone).replace(microsecond=0)
                    session.said = JOBS[job](Writing(site, fields, session.writer, now))
                except FormMistakeError as mistake:
                    words = (mistake.name, mistake.words)
                    return show(session, mistake=words, filled={**fields, "job": job}, status=422)
                except DiskError as error:
                    detail = say("desk.problem.disk_why", code=error.code)
                    page = render_problem(site, problem=say("desk.problem.disk"), detail=detail)
                    return _html(HTTPStatus.SERVICE_UNAVAILABLE, page)
            session.remember_done(fields["request"])
            self._answers.look_again()
            return _moved(after)

    def _desk(
        self,
        session: DeskSession,
        *,
        said: str = "",
        mistake: tuple[str, str] | None = None,
        filled: dict[str, str],
        status: int = 200,
    ) -> Response:
        site = self._answers.site_now()
        render = partial(render_desk, site, has_index=self._index.is_there)
        return self._filled(render, site, session, said=said, mistake=mistake, filled=filled, status=status)

    def _places(
        self,
        session: DeskSession,
        *,
        said: str = "",
        mistake: tuple[str, str] | None = None,
        filled: dict[str, str],
        status: int = 200,
    ) -> Response:
        site = self._answers.site_now()
        floor = next((f for f in site.floors if f.floor_id == filled.get("floor")), None)
        if floor is None:
            raise NotFoundError("there is no such floor")
        render = partial(render_places, site, floor)
        return self._filled(render, site, session, said=said, mistake=mistake, filled=filled, status=status)

    def _filled(
        self, render: Callable[..., str], site: Site, session: DeskSession, *, status: int, **shown: Any
    ) -> Response:
        """Return a page with forms of a session, in the site's language."""
        with speaking(site.language):
            page = render(
                writer=session.writer,
                form_token=session.form_token,
                request_id=secrets.token_urlsafe(18),
                now=self._present(),
                **shown,
            )
        return _html(status, page)

    def _asked_to_sign_in(self, *, after: str, writer: str = "", is_wrong: bool = False) -> Response:
        site = self._answers.site_now()
        with speaking(site.language):
            problem = say("desk.sign_in.wrong") if is_wrong else ""
            page = render_sign_in(site, problem=problem, writer=writer, after=after)
        return _html(HTTPStatus.FORBIDDEN if is_wrong else HTTPStatus.OK, page)

    def _refused(self) -> Response:
        site = self._answers.site_now()
        with speaking(site.language):
            page = render_problem(site, problem=say("desk.problem.form"), detail=say("desk.problem.form_why"))
        return _html(HTTPStatus.FORBIDDEN, page)

    def problem(self, status: int) -> Response:
        """Return the page of a request that cannot be answered; it works where the project cannot be read."""
        site = self._known
        with speaking(site.language):
            key = "missing" if status == HTTPStatus.NOT_FOUND else "read"
            page = render_problem(site, problem=say(f"desk.problem.{key}"), detail=say(f"desk.problem.{key}_why"))
        return _html(status, page)

    def _session(self, request: Request) -> DeskSession | None:
        return self._sessions.of(request.cookies.get(self._cookie, ""))


def is_at_desk(request: Request) -> bool:
    """Return whether an address is one of the desk."""
    return request.url.path == DESK or request.url.path.startswith(f"{DESK}/")


async def _fields(request: Request) -> dict[str, str] | None:
    """Return the fields of a form, each once; None where it is no form of the desk."""
    length = request.headers.get("content-length", "")
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/x-www-form-urlencoded" or not (length.isdecimal() and int(length) <= BODY_MAX_BYTES):
        return None
    try:
        body = (await request.body()).decode("ascii")
        pairs = parse_qsl(body, keep_blank_values=True, max_num_fields=FIELDS_MAX, errors="strict")
    except (ValueError, ClientDisconnect):
        return None
    fields = dict(pairs)
    is_bounded = all(len(value) <= FIELD_MAX_CHARS for value in fields.values())
    return {"form": "", **fields} if len(fields) == len(pairs) and is_bounded else None


def _is_from_here(request: Request) -> bool:
    """Return whether a form comes from a page of this address, by all that browsers say about it."""
    origin, host = request.headers.get("origin"), request.headers.get("host")
    is_own = host is not None and origin in (f"http://{host}", f"https://{host}")
    return is_own and request.headers.get("sec-fetch-site", "same-origin") == "same-origin"


def _moved(address: str) -> Response:
    return Response(status_code=HTTPStatus.SEE_OTHER, headers={**HEADERS, "Location": address})


def _file(body: bytes, media_type: str) -> Response:
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; " \
        "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"  # fmt: skip
    return Response(body, media_type=media_type, headers={**HEADERS, "Content-Security-Policy": policy})


def _html(status: int, page: str) -> Response:
    headers = {**HEADERS, "Content-Security-Policy": desk_policy()}
    return Response(page, status_code=status, media_type="text/html", headers=headers)
