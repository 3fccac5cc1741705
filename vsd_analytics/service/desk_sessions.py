"""Who is signed in at the desk: a session for each browser, in memory, which ends with the program."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from vsd_analytics.config.log_records import is_name

SESSIONS_MAX: Final = 256
"""Of all browsers; the one that signed in first gives way."""
SESSION_S: Final = 12 * 3600.0
DONE_MAX: Final = 1000
"""Requests a session remembers, so that none of them is done twice."""


@dataclass(slots=True)
class DeskSession:
    """A browser that signed in with the token of the desk.

    Attributes:
        writer: Name that is stored with what is written.
        form_token: What each form must send back: only pages of this session have it.
        ends_s: When it ends, on the clock of `DeskSessions`.
        done: Ids of the requests that were done.
        said: What the next page says once about what was done.
    """

    writer: str
    form_token: str
    ends_s: float
    done: OrderedDict[str, None] = field(default_factory=OrderedDict)
    said: str = ""

    def is_own_form(self, given: str) -> bool:
        """Return whether a form comes from a page of this session; compared in constant time."""
        return _is_same(given, self.form_token)

    def remember_done(self, request_id: str) -> None:
        """Note a request as done."""
        self.done[request_id] = None
        while len(self.done) > DONE_MAX:
            self.done.popitem(last=False)


class DeskSessions:
    """The sessions of a desk.

    Args:
        token: The token of the desk.
        clock: Seconds that pass steadily.
    """

    def __init__(self, token: str, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._token, self._clock, self._lock = token, clock, threading.Lock()
        self._sessions: OrderedDict[bytes, DeskSession] = OrderedDict()

    def sign_in(self, token: str, writer: str) -> str | None:
        """Return the cookie of a new session; None where the token is wrong or the name is no name."""
        if not _is_same(token, self._token) or not is_name(writer):
            return None
        cookie = secrets.token_urlsafe(32)
        session = DeskSession(" ".join(writer.split()), secrets.token_urlsafe(32), self._clock() + SESSION_S)
        with self._lock:
            self._sessions[_key(cookie)] = session
            while len(self._sessions) > SESSIONS_MAX:
                self._sessions.popitem(last=False)
        return cookie

    def of(self, cookie: str) -> DeskSession | None:
        """Return the session of a cookie; None where there is none any more."""
        with self._lock:
            session = self._sessions.get(_key(cookie))
            if session is not None and session.ends_s <= self._clock():
                del self._sessions[_key(cookie)]
                session = None
            return session

    def sign_out(self, cookie: str) -> None:
        """End a session."""
        with self._lock:
            self._sessions.pop(_key(cookie), None)


def _key(cookie: str) -> bytes:
    """Return a hash: how long a look-up takes says nothing about a cookie."""
    return hashlib.sha256(cookie.encode("utf-8", "replace")).digest()


def _is_same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "replace"), wanted.encode())
