"""Clients that mean no good, and one that does: what servers of the program are tried with."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

TOKEN = "a-token-of-the-tests"
HEAD = f"Host: 127.0.0.1\r\nAuthorization: Bearer {TOKEN}\r\n"


@dataclass(frozen=True, slots=True)
class Door:
    """An address to knock at.

    Attributes:
        port: Its port on this machine.
        request: A request that is answered.
        is_answer: Tells whether it was answered well.
    """

    port: int
    request: bytes
    is_answer: Callable[[bytes], bool]


def connect(port: int, data: bytes = b"") -> socket.socket:
    made = socket.create_connection(("127.0.0.1", port), timeout=20)
    if data:
        made.sendall(data)
    return made


def said(port: int, data: bytes, *, timeout_s: float = 20) -> bytes:
    """Send bytes and return all that comes until the other side ends the connection, or says nothing more."""
    with connect(port, data) as opened:
        return rest(opened, timeout_s=timeout_s)


def rest(opened: socket.socket, *, timeout_s: float = 20) -> bytes:
    opened.settimeout(timeout_s)
    answer = b""
    with contextlib.suppress(OSError):
        while more := opened.recv(65536):
            answer += more
            if timeout_s > 1:
                opened.settimeout(0.3)
    return answer


def is_closed(opened: socket.socket) -> bool:
    """Return whether the other side has ended a connection."""
    opened.setblocking(False)
    try:
        while opened.recv(65536):
            pass
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def answered_s(door: Door) -> float:
    """Ask well on a connection of its own, and return how long the answer took; an error where there is none."""
    began_s = time.perf_counter()
    answer = said(door.port, door.request)
    assert door.is_answer(answer), answer[:300]
    return time.perf_counter() - began_s


@contextlib.contextmanager
def many(port: int, n: int, data: bytes = b"") -> Iterator[list[socket.socket]]:
    """Hold many connections that have sent the same bytes."""
    opened: list[socket.socket] = []
    try:
        for _ in range(n):
            with contextlib.suppress(OSError):
                opened.append(connect(port, data))
        yield opened
    finally:
        for one in opened:
            one.close()


def drip(opened: Sequence[socket.socket], data: bytes) -> None:
    """Send the same few bytes on each connection that is still open."""
    for one in opened:
        with contextlib.suppress(OSError):
            one.setblocking(True)
            one.sendall(data)


def posting(body: bytes, *, path: str = "/frames", more: str = "") -> bytes:
    head = f"POST {path} HTTP/1.1\r\n{HEAD}Content-Length: {len(body)}\r\n{more}Connection: close\r\n\r\n"
    return head.encode() + body


def reading(path: str, *, more: str = "") -> bytes:
    return f"GET {path} HTTP/1.1\r\n{HEAD}{more}Connection: close\r\n\r\n".encode()


HELD = {
    "idle": b"",
    "half a head": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ",
    "half a body": f"POST /frames HTTP/1.1\r\n{HEAD}Content-Length: 1000\r\n\r\n".encode() + b"{",
    "a body for a stranger": b"POST /frames HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1000\r\n\r\n{",
}
"""What a connection has sent that is held open; each goes on byte by byte."""

_BODY = b"GET /v1/site HTTP/1.1\r\n" + HEAD.encode() + b"\r\n"
SMUGGLED = {
    "a GET with a body": f"GET /health HTTP/1.1\r\n{HEAD}Content-Length: {len(_BODY)}\r\n\r\n".encode() + _BODY,
    "a GET with a chunked body": f"GET /health HTTP/1.1\r\n{HEAD}Transfer-Encoding: chunked\r\n\r\n".encode()
    + b"%x\r\n" % len(_BODY)
    + _BODY
    + b"\r\n0\r\n\r\n",
    "two lengths": f"POST /frames HTTP/1.1\r\n{HEAD}Content-Length: 2\r\nContent-Length: 9\r\n\r\n".encode()
    + b"{}"
    + _BODY,
    "two lengths in one": f"POST /frames HTTP/1.1\r\n{HEAD}Content-Length: 2, 9\r\n\r\n".encode() + b"{}" + _BODY,
    "a length and chunks": f"POST /frames HTTP/1.1\r\n{HEAD}Content-Length: 5\r\n".encode()
    + b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
    + _BODY,
    "an unknown coding": f"POST /frames HTTP/1.1\r\n{HEAD}Transfer-Encoding: xchunked\r\n\r\n".encode() + _BODY,
    "a length with a sign": f"POST /frames HTTP/1.1\r\n{HEAD}Content-Length: +2\r\n\r\n".encode() + b"{}" + _BODY,
    "lines with LF alone": f"GET /health HTTP/1.1\nX: y\r\n{HEAD}\r\n".encode() + _BODY,
    "a hidden line with LF": f"GET /health HTTP/1.1\r\nX: y\nContent-Length: 9\r\n{HEAD}\r\n".encode() + _BODY,
    "a head that ends with LF": f"GET /health HTTP/1.1\r\n{HEAD}".encode() + b"\n" + _BODY,
    "a line that goes on": f"GET /health HTTP/1.1\r\n{HEAD}X: y\r\n Content-Length: 9\r\n\r\n".encode() + _BODY,
    "a blank before the colon": f"GET /health HTTP/1.1\r\n{HEAD}Content-Length : 9\r\n\r\n".encode() + _BODY,
    "a CR alone": f"GET /health HTTP/1.1\r\n{HEAD}X: y\rContent-Length: 9\r\n\r\n".encode() + _BODY,
    "a NUL": f"GET /health HTTP/1.1\r\n{HEAD}X: \0\r\n\r\n".encode() + _BODY,
    "two hosts": f"GET /health HTTP/1.1\r\nHost: other.example\r\n{HEAD}\r\n".encode() + _BODY,
    "no host": b"GET /health HTTP/1.1\r\nAuthorization: Bearer " + TOKEN.encode() + b"\r\n\r\n" + _BODY,
    "a host that is none": b"GET /health HTTP/1.1\r\nHost: a b/c\r\n\r\n" + _BODY,
    "a head of a megabyte": f"GET /health HTTP/1.1\r\n{HEAD}".encode() + b"X: " + b"y" * (1 << 20) + b"\r\n\r\n",
    "a line of a megabyte": b"GET /" + b"y" * (1 << 20) + b" HTTP/1.1\r\n\r\n",
    "another protocol": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),
}
"""Requests that two servers may read differently: each has at most one answer, and nothing of it is done."""


def n_answers(answer: bytes) -> int:
    return answer.count(b"HTTP/1.1 ")
