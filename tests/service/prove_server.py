"""`vsd serve` and `vsd listen --http` under hundreds of hostile connections, with their real limits.

Each attack goes on for some seconds against a server in a process of its own, while one good client asks again and
again. It prints: good requests that were answered, how often one was sent again, how long the slowest took with
that, connections that the server held at most, and how much memory it gained. Run it with

    python tests/service/prove_server.py --seconds 20 --connections 300

and put the table into docs/faults.md. Exits with 1 where a good request was not answered, a smuggled one was answered
twice, or a bound does not hold.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

from live.local_broker import frame  # noqa: E402
from service.hostile_clients import (  # noqa: E402
    HELD,
    SMUGGLED,
    TOKEN,
    Door,
    answered_s,
    connect,
    drip,
    n_answers,
    posting,
    reading,
    rest,
)
from site_text import site_text  # noqa: E402

GROWTH_MAX_MB = 120
"""64 bodies of a megabyte, read in pieces and once more as a whole."""
CONNECTIONS_MAX = 64
SLOWEST_S = 5.0
TRIES = 5
"""Of a good client, as senders do: a flood of new connections from somebody with the token may cut its connection."""


def rss_mb(pid: int) -> float:
    text = Path(f"/proc/{pid}/status").read_text()
    return int(text.split("VmRSS:")[1].split()[0]) / 1024


def n_sockets(pid: int) -> int:
    names = []
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            names.append(os.readlink(entry))
    return sum(name.startswith("socket:") for name in names)


@contextlib.contextmanager
def server(which: str, root: Path) -> Iterator[tuple[int, Callable[[], Door]]]:
    """Run a server; yield its process and what makes good requests."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = int(found.getsockname()[1])
    words = ["serve", "--port", str(port), "--per-minute", "1000000"]
    if which == "listen":
        words = ["listen", "--http", f"127.0.0.1:{port}"]
    environ = {**os.environ, "VSD_SERVE_TOKEN": TOKEN, "VSD_HTTP_TOKEN": TOKEN}
    command = [sys.executable, "-c", "from vsd_analytics.cli import main; main()", "--quiet", "-C", str(root), *words]
    process = subprocess.Popen(command, env=environ, stderr=subprocess.DEVNULL)
    numbers = iter(range(10**9))

    def door() -> Door:
        if which == "serve":
            return Door(port, reading("/v1/site"), lambda answer: b"HTTP/1.1 200 " in answer)
        _, payload = frame(next(numbers), at=datetime.now(tz=UTC), n_persons=1)
        return Door(port, posting(payload), lambda answer: b"HTTP/1.1 202 " in answer)

    try:
        for _ in range(200):
            with contextlib.suppress(OSError, AssertionError):
                answered_s(door())
                break
            time.sleep(0.1)
        yield process.pid, door
    finally:
        process.terminate()
        process.wait(20)


def hold(port: int, data: bytes, n: int, until_s: float) -> None:
    """Keep connections open byte by byte, and open new ones for those that were cut."""
    opened: list[socket.socket] = []
    while time.monotonic() < until_s:
        with contextlib.suppress(OSError):
            while len(opened) < n:
                opened.append(connect(port, data))
        drip(opened[: n // 2], b"x")
        left = []
        for one in opened:
            one.setblocking(False)
            try:
                is_open = bool(one.recv(4096))
            except BlockingIOError:
                is_open = True
            except OSError:
                is_open = False
            left.append(one) if is_open else one.close()
        opened = left
        time.sleep(0.5)
    for one in opened:
        one.close()


def smuggle(port: int, _data: bytes, _n: int, until_s: float) -> int:
    """Send what can be read in two ways; return how often it was answered twice."""
    twice = 0
    while time.monotonic() < until_s:
        for data in SMUGGLED.values():
            with contextlib.suppress(OSError), connect(port) as opened:
                with contextlib.suppress(OSError):
                    opened.sendall(data)
                twice += n_answers(rest(opened, timeout_s=0.3)) > 1
    return twice


def flood(port: int, _data: bytes, _n: int, until_s: float) -> None:
    """Open and leave connections as fast as possible."""
    while time.monotonic() < until_s:
        with contextlib.suppress(OSError):
            connect(port, b"GET /nothing HTTP/1.1\r\nHost: a\r\n\r\n").close()


def bodies(port: int, _data: bytes, n: int, until_s: float) -> None:
    """Send all of a megabyte but its last byte, with the token, on many connections."""
    data = posting(b"[" + b" " * 999_990)[:-1]
    while time.monotonic() < until_s:
        opened = []
        for _ in range(n):
            with contextlib.suppress(OSError):
                one = connect(port)
                one.settimeout(0.2)
                opened.append(one)
                one.sendall(data)
        time.sleep(0.2)
        for one in opened:
            one.close()


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--connections", type=int, default=300)
    given = parser.parse_args()
    attacks = {name: (hold, data) for name, data in HELD.items()}
    attacks |= {"smuggling": (smuggle, b""), "unknown addresses": (flood, b""), "bodies of 1 MB": (bodies, b"")}
    is_wrong = False
    print(f"{given.connections} connections, {given.seconds:g} s each\n")
    print(
        "| server | attack | answered | sent again | failed | slowest (s) | connections at most | memory gained (MB) |"
    )
    print("|---|---|--:|--:|--:|--:|--:|--:|")
    for which in ("serve", "listen"):
        root = Path(tempfile.mkdtemp())
        (root / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
        try:
            with server(which, root) as (pid, door):
                for name, (act, data) in attacks.items():
                    before_mb, until_s = rss_mb(pid), time.monotonic() + given.seconds
                    results: list[int | None] = []
                    port = door().port
                    words = (port, data, given.connections, until_s)
                    attacker = threading.Thread(target=lambda w=words, a=act, t=results: t.append(a(*w)))
                    attacker.start()
                    time.sleep(1)
                    took_s, n_failed, n_again, most, most_mb = [0.0], 0, 0, 0, before_mb
                    while time.monotonic() < until_s:
                        began_s = time.monotonic()
                        for _ in range(TRIES):
                            with contextlib.suppress(OSError, AssertionError):
                                answered_s(door())
                                took_s.append(time.monotonic() - began_s)
                                break
                            n_again += 1
                        else:
                            n_failed += 1
                        most, most_mb = max(most, n_sockets(pid)), max(most_mb, rss_mb(pid))
                        time.sleep(0.05)
                    attacker.join()
                    grown_mb = most_mb - before_mb
                    cells = (len(took_s) - 1, n_again, n_failed, f"{max(took_s):.2f}", most, f"{grown_mb:.0f}")
                    print(f"| {which} | {name} | {' | '.join(map(str, cells))} |", flush=True)
                    is_wrong |= n_failed > 0 or max(took_s) > SLOWEST_S or bool(results[0])
                    is_wrong |= most > 3 * CONNECTIONS_MAX or grown_mb > GROWTH_MAX_MB
        finally:
            shutil.rmtree(root, ignore_errors=True)
    return int(is_wrong)


if __name__ == "__main__":
    sys.exit(main())
