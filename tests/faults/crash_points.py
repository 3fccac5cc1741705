"""Runs a job in a process of its own and stops it, or refuses it, at one chosen system call.

A clean server process forks each child with the libraries already imported and `refuse.c` loaded before the C library:
that counts the calls which change files below the job's folder, notes them, and disturbs the one asked for. The points
are those of the main thread, which makes every write of the store and of facts (`Run.n_elsewhere` would tell). That no
call escapes it is checked with strace, which counts at the kernel: `Run.n_traced`.
"""

from __future__ import annotations

import ctypes
import errno
import multiprocessing
import os
import re
import shutil
import subprocess
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

KINDS = ("create", "write", "fsync", "rename", "link", "unlink", "mkdir", "truncate")
"""In the order of `enum kind` of refuse.c."""
_TRACED = {
    **dict.fromkeys(("open", "openat", "creat"), "create"),
    **dict.fromkeys(("write", "pwrite64", "writev", "pwritev", "sendfile", "copy_file_range"), "write"),
    **dict.fromkeys(("fsync", "fdatasync"), "fsync"),
    **dict.fromkeys(("rename", "renameat", "renameat2"), "rename"),
    **dict.fromkeys(("link", "linkat"), "link"),
    **dict.fromkeys(("unlink", "unlinkat", "rmdir"), "unlink"),
    **dict.fromkeys(("mkdir", "mkdirat"), "mkdir"),
    **dict.fromkeys(("ftruncate", "truncate", "fallocate"), "truncate"),
}
CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["warm_start"])
PATIENCE_S = 120.0
_CALL = re.compile(r"^\d+\s+(\w+)\((.*)$")
_TOKEN = re.compile(r"\.[^./]+\.tmp\b")
_STARTING = threading.Lock()

Ack = Callable[[Any], None]


@dataclass(frozen=True, slots=True)
class Fault:
    """What happens at a point.

    Attributes:
        name: As the tables name it.
        how: In `enum how` of refuse.c.
        number: The error number of what fails.
        kinds: Kinds of calls it can happen to.
    """

    name: str
    how: int
    number: int = 0
    kinds: tuple[str, ...] = KINDS


FAULTS = {
    fault.name: fault
    for fault in (
        Fault("kill -9", 1),
        Fault("EIO", 2, errno.EIO),
        Fault("ENOSPC", 2, errno.ENOSPC),
        Fault("EDQUOT", 2, errno.EDQUOT),
        Fault("ENOSPC that stays", 3, errno.ENOSPC),
        Fault("short write", 4, kinds=("write",)),
        Fault("short write, then ENOSPC", 5, errno.ENOSPC, kinds=("write",)),
    )
}


@dataclass(frozen=True, slots=True)
class Point:
    """One call of a job.

    Attributes:
        kind: As the tables name it.
        turn: It is the so many-th of its kind below the job's folder.
        call: Its name in the C library.
        path: The first path it names, below the job's folder; of a temporary file without what makes its name unique.
    """

    kind: str
    turn: int
    call: str
    path: str


@dataclass(frozen=True, slots=True)
class Run:
    """What became of a job.

    Attributes:
        status: "ok", "error" (one meant for people, or of the operating system), "unclear" (any other) or "killed".
        told: What it returned, or the error's text.
        acked: What it acknowledged, in order.
        points: The calls it made below its folder.
        n_elsewhere: Such calls by other threads.
        struck: The point at which it was stopped or refused.
        retried: Files whose fsync had failed and was tried again on the same descriptor.
        n_traced: Number of calls by kind that strace saw; empty without it.
    """

    status: str
    told: Any
    acked: Sequence[Any]
    points: Sequence[Point]
    n_elsewhere: int
    struck: Point | None
    retried: Sequence[str]
    n_traced: Counter[str]


def why_not() -> str | None:
    """Return why calls cannot be counted here, or None."""
    if missing := [name for name in ("strace", "cc") if shutil.which(name) is None]:
        return f"there is no {' and no '.join(missing)} here"
    with tempfile.TemporaryDirectory() as folder:
        try:
            run(_nothing, Path(folder), is_traced=True)
        except PermissionError as error:
            return str(error)
    return None


def call(function: Callable[..., Any], *arguments: Any, patience_s: float = PATIENCE_S) -> Any:
    """Return what `function` returns in a fresh process, which is given up after `patience_s`."""
    done = run(_plainly, Path("/nowhere"), function, arguments, patience_s=patience_s)
    assert done.status == "ok", done.told
    return done.told


def run(
    job: Callable[..., Any],
    folder: Path,
    /,
    *arguments: Any,
    point: Point | None = None,
    fault: Fault | None = None,
    is_traced: bool = False,
    patience_s: float = PATIENCE_S,
) -> Run:
    """Run `job(folder, *arguments, ack)` in a fresh process.

    Args:
        job: A function of an importable module.
        folder: Calls on paths below it are the points.
        arguments: More arguments.
        point: Where to disturb it.
        fault: How.
        is_traced: Let strace count calls as well.
        patience_s: Kill it when it says nothing for so long.

    Raises:
        PermissionError: strace may not attach.
    """
    ours, theirs = CONTEXT.Pipe()
    with tempfile.NamedTemporaryFile("r", suffix=".calls") as notes, tempfile.NamedTemporaryFile("r") as trace:
        where = (0, 0, 0, 0) if fault is None else _where(point, fault)
        child = CONTEXT.Process(target=_child, args=(theirs, job, folder, arguments, notes.name, where))
        with _STARTING:
            _start_server()
            child.start()
        theirs.close()
        assert ours.poll(PATIENCE_S)
        ours.recv()
        tracer = _attach(child, trace.name) if is_traced else None
        ours.send("go")
        messages = []
        try:
            while ours.poll(patience_s):
                messages.append(ours.recv())
            child.kill()
        except (EOFError, ConnectionResetError):
            pass
        child.join()
        if tracer is not None:
            tracer.wait()
        calls, traced = notes.read().splitlines(), trace.read().splitlines()
    acked = [value for word, value in messages if word == "ack"]
    status, told = next((m for m in messages if m[0] != "ack"), ("killed", child.exitcode))
    return Run(status, told, acked, *_noted(calls, str(folder)), _n_traced(traced, str(folder)))


def _where(point: Point | None, fault: Fault) -> tuple[int, int, int, int]:
    assert point is not None
    return KINDS.index(point.kind), point.turn, fault.how, fault.number


def _start_server() -> None:
    """Start the server that forks, with refuse.c before the C library, when there is none."""
    if forkserver._forkserver._forkserver_pid is not None:  # type: ignore[attr-defined]
        return
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "refuse.so"
        source = Path(__file__).with_name("refuse.c")
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
        before = dict(os.environ)
        paths = [str(source.parent), *before.get("PYTHONPATH", "").split(os.pathsep)]  # warm_start.py is there
        os.environ |= {"LD_PRELOAD": str(library), "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        try:
            forkserver.ensure_running()
            child = CONTEXT.Process(target=_nowhere)  # it answers when the library has been loaded
            child.start()
            child.join()
        finally:
            os.environ.clear()
            os.environ |= before


def _attach(child: ForkServerProcess, log: str) -> subprocess.Popen[str]:
    command = [
        "strace",
        "-f",
        "-y",
        "-s",
        "0",
        "-o",
        log,
        "-e",
        f"trace={','.join(f'?{c}' for c in _TRACED)}",
        "-p",
        str(child.pid),
    ]
    tracer = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    status = Path(f"/proc/{child.pid}/status")
    while "TracerPid:\t0\n" in status.read_text():
        if tracer.poll() is not None:
            child.kill()
            assert tracer.stderr is not None
            raise PermissionError(tracer.stderr.read().strip())
        time.sleep(0.001)
    # only after its word has strace interrupted the process: calls before would be missed
    assert tracer.stderr is not None
    assert "attached" in tracer.stderr.readline()
    return tracer


def _child(
    conn: Connection,
    job: Callable[..., Any],
    folder: Path,
    arguments: Sequence[Any],
    notes: str,
    where: tuple[int, int, int, int],
) -> None:
    from vsd_analytics.errors import VsdError

    os.environ.pop("LD_PRELOAD", None)
    _let_be_traced()
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[os.getpid() % len(cores)]})  # DuckDB then needs no threads: the same calls each time
    noted = os.open(notes, os.O_WRONLY | os.O_APPEND)
    conn.send("ready")
    conn.recv()
    kind, turn, how, number = where
    ctypes.CDLL(None).refuse_at(os.fsencode(folder), kind, ctypes.c_long(turn), how, number, noted)
    try:
        conn.send(("ok", job(folder, *arguments, lambda value: conn.send(("ack", value)))))
    except (VsdError, OSError) as error:
        conn.send(("error", f"{type(error).__name__}: {error}"))
    except BaseException as error:
        conn.send(("unclear", f"{type(error).__name__}: {error}"))


def _let_be_traced() -> None:
    """Let strace attach where only ancestors may (Yama's ptrace_scope 1); it is a cousin."""
    set_ptracer, anybody = 0x59616D61, ctypes.c_ulong(-1)
    ctypes.CDLL(None).prctl(set_ptracer, anybody, 0, 0, 0)


def _nothing(folder: Path, ack: Ack) -> None:
    pass


def _nowhere() -> None:
    pass


def _plainly(folder: Path, function: Callable[..., Any], arguments: Sequence[Any], ack: Ack) -> Any:
    return function(*arguments)


def without_token(path: str) -> str:
    """Return a path without what makes the name of a temporary file unique: `.name.4711.tmp` is `.name.*.tmp`."""
    return _TOKEN.sub(".*.tmp", path)


def _noted(lines: Sequence[str], folder: str) -> tuple[list[Point], int, Point | None, list[str]]:
    """Return the calls, how many more other threads made, the disturbed one, and the files synced again."""
    n_of_kind: Counter[str] = Counter()
    points, n_elsewhere, struck, again = [], 0, None, []
    for line in lines:
        is_main, number, name, word, path = line.split("\t", 4)
        path = without_token(path.removeprefix(folder))
        if word == "again":
            again.append(path)
        elif is_main == "0":
            n_elsewhere += 1
        else:
            kind = KINDS[int(number)]
            n_of_kind[kind] += 1
            points.append(Point(kind, n_of_kind[kind], name, path))
            struck = points[-1] if word == "struck" else struck
    return points, n_elsewhere, struck, again


def _n_traced(lines: Sequence[str], folder: str) -> Counter[str]:
    calls = [match.groups() for line in lines if (match := _CALL.match(line))]
    inside = re.compile(re.escape(folder) + '[/>"]')
    return Counter(
        _TRACED[n] for n, rest in calls if inside.search(rest) and (_TRACED[n] != "create" or "O_CREAT" in rest)
    )
