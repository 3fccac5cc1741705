"""Runs a job in a process of its own and stops it, or refuses it, at one chosen system call.

A clean server process forks each child with the libraries already imported, strace attaches to it, and only then the
job begins: a point costs tenths of a second. strace counts calls for each thread; the points are those of the main
thread, which makes every write of the store and of facts (`Run.n_elsewhere` would tell).
"""

from __future__ import annotations

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
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

KINDS = {
    "openat": "create",
    **dict.fromkeys(("write", "pwrite64", "writev"), "write"),
    **dict.fromkeys(("fsync", "fdatasync"), "fsync"),
    **dict.fromkeys(("rename", "renameat", "renameat2"), "rename"),
    **dict.fromkeys(("link", "linkat"), "link"),
    **dict.fromkeys(("unlink", "unlinkat", "rmdir"), "unlink"),
    **dict.fromkeys(("mkdir", "mkdirat"), "mkdir"),
    **dict.fromkeys(("ftruncate", "truncate", "fallocate"), "truncate"),
}
CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(
    [
        "jobs",
        "pandas",
        "pyarrow.pandas_compat",
        "pyarrow.parquet",
        "duckdb",
        "msgspec",
        "shapely",
        "tqdm",
        "vsd_analytics.cli.data_in",
        "vsd_analytics.config",
        "vsd_analytics.ingest.columns",
        "vsd_analytics.ingest.frames",
        "vsd_analytics.ingest.pipeline",
        "vsd_analytics.ingest.reasons",
        "vsd_analytics.warehouse.build",
        "vsd_analytics.warehouse.warehouse",
    ]
)
PATIENCE_S = 120.0
TRIES = 12
_RETURNED = re.compile(r"= -?\d")
_CALL = re.compile(r"^(\d+)\s+(\w+)\((.*)$")
_STARTING = threading.Lock()

Ack = Callable[[Any], None]


@dataclass(frozen=True, slots=True)
class Point:
    """One system call of a job.

    Attributes:
        call: Its name.
        number: It is the so many-th call of that name in the main thread.
        kind: As the tables name it.
        turn: It is the so many-th of its kind below the job's folder.
        text: Its arguments and outcome.
        path: The first path it names, below the job's folder, with `{pid}` for the process.
        again: It is the so many-th of its kind with that path.
    """

    call: str
    number: int
    kind: str
    turn: int
    text: str
    path: str
    again: int


@dataclass(frozen=True, slots=True)
class Run:
    """What became of a job.

    Attributes:
        status: "ok", "error" (one meant for people, or of the operating system), "unclear" (any other) or "killed".
        told: What it returned, or the error's text.
        acked: What it acknowledged, in order.
        points: The calls it made below its folder; empty without strace.
        n_elsewhere: Such calls by other threads.
        struck: The point at which it was stopped or refused.
        retried: fsyncs on a descriptor whose fsync had failed.
    """

    status: str
    told: Any
    acked: Sequence[Any]
    points: Sequence[Point] = ()
    n_elsewhere: int = 0
    struck: Point | None = None
    retried: Sequence[str] = ()


def why_not() -> str | None:
    """Return why calls cannot be counted here, or None."""
    if shutil.which("strace") is None:
        return "strace is not installed"
    with tempfile.TemporaryDirectory() as folder:
        try:
            run(_nothing, Path(folder), is_traced=True)
        except PermissionError as error:
            return str(error)
    return None


def call(function: Callable[..., Any], *arguments: Any, patience_s: float = PATIENCE_S) -> Any:
    """Return what `function` returns in a fresh process, which is given up after `patience_s`."""
    done = run(_plainly, Path(), function, arguments, patience_s=patience_s)
    assert done.status == "ok", done.told
    return done.told


def run(
    job: Callable[..., Any],
    folder: Path,
    /,
    *arguments: Any,
    is_traced: bool = False,
    inject: str | None = None,
    path: str | None = None,
    patience_s: float = PATIENCE_S,
) -> Run:
    """Run `job(folder, *arguments, ack)` in a fresh process.

    Args:
        job: A function of an importable module.
        folder: Calls on paths below it are the points.
        arguments: More arguments.
        is_traced: Count calls.
        inject: What strace shall inject, such as "write:signal=SIGKILL:when=3".
        path: Look at calls on this path alone, `{pid}` in it being the process.
        patience_s: Kill it when it says nothing for so long.

    Raises:
        PermissionError: strace may not attach.
    """
    ours, theirs = CONTEXT.Pipe()
    child = CONTEXT.Process(target=_child, args=(theirs, job, folder, arguments))
    with _STARTING:
        child.start()
    theirs.close()
    assert ours.poll(PATIENCE_S)
    ours.recv()  # it has imported what it needs
    with tempfile.NamedTemporaryFile("r", suffix=".strace") as log:
        tracer = _attach(child, log.name, inject, path) if is_traced or inject else None
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
        lines = log.readlines()
    acked = [value for word, value in messages if word == "ack"]
    status, told = next((m for m in messages if m[0] != "ack"), ("killed", child.exitcode))
    points, n_elsewhere = _points(lines, str(child.pid), str(folder))
    struck = next((p for p in points if "(INJECTED)" in p.text), None)
    if status == "killed" and points and not _RETURNED.search(points[-1].text):
        struck = points[-1]
    return Run(status, told, acked, points, n_elsewhere, struck, _retried(lines))


def strike(
    job: Callable[..., Any], folder: Path, /, *, point: Point, fault: str, restore: Callable[[], object]
) -> Run | None:
    """Run a job and disturb it at one point; None when that point was not met in `TRIES` tries.

    A file that is made is found by its path, since the number of files that libraries open beside it varies from run to
    run. Any other point is the so many-th call of its name; a run that was struck elsewhere is done over.

    Args:
        job: See `run`.
        folder: See `run`.
        point: Where.
        fault: What strace shall inject, such as "signal=SIGKILL".
        restore: Puts the folder back as it was before the job.
    """
    if point.kind == "create":
        path = f"{folder}{point.path}"
        done = run(job, folder, inject=f"{point.call}:{fault}:when={point.again}", path=path)
        if done.struck is not None:
            return done
        restore()  # its name holds the hash of something random
    number = point.number
    for _ in range(TRIES):
        done = run(job, folder, inject=f"{point.call}:{fault}:when={number}")
        if done.struck is not None and (done.struck.kind, done.struck.turn) == (point.kind, point.turn):
            return done
        met = next((p for p in done.points if (p.kind, p.turn) == (point.kind, point.turn)), None)
        number = number + 1 if met is None else met.number
        restore()
    return None


def _attach(child: ForkServerProcess, log: str, inject: str | None, path: str | None) -> subprocess.Popen[str]:
    command = ["strace", "-f", "-y", "-s", "0", "-o", log, "-e", f"trace={','.join(KINDS)}"]
    command += ["-e", f"inject={inject}"] if inject else []
    command += ["-P", path.replace("{pid}", str(child.pid))] if path else []
    tracer = subprocess.Popen([*command, "-p", str(child.pid)], stderr=subprocess.PIPE, text=True)
    status = Path(f"/proc/{child.pid}/status")
    while "TracerPid:\t0\n" in status.read_text():
        if tracer.poll() is not None:
            child.kill()
            assert tracer.stderr is not None
            raise PermissionError(tracer.stderr.read().strip())
        time.sleep(0.001)
    return tracer


def _child(conn: Connection, job: Callable[..., Any], folder: Path, arguments: Sequence[Any]) -> None:
    from vsd_analytics.errors import VsdError

    _let_be_traced()
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[os.getpid() % len(cores)]})  # DuckDB then needs no threads: the same calls each time
    conn.send("ready")
    conn.recv()
    try:
        conn.send(("ok", job(folder, *arguments, lambda value: conn.send(("ack", value)))))
    except (VsdError, OSError) as error:
        conn.send(("error", f"{type(error).__name__}: {error}"))
    except BaseException as error:
        conn.send(("unclear", f"{type(error).__name__}: {error}"))


def _let_be_traced() -> None:
    """Let strace attach where only ancestors may (Yama's ptrace_scope 1); it is a cousin."""
    import ctypes

    set_ptracer, anybody = 0x59616D61, ctypes.c_ulong(-1)
    ctypes.CDLL(None).prctl(set_ptracer, anybody, 0, 0, 0)


def _nothing(folder: Path, ack: Ack) -> None:
    pass


def _plainly(folder: Path, function: Callable[..., Any], arguments: Sequence[Any], ack: Ack) -> Any:
    return function(*arguments)


def _points(lines: Sequence[str], main: str, folder: str) -> tuple[list[Point], int]:
    n_calls: Counter[str] = Counter()
    n_inside: Counter[str] = Counter()
    found, n_elsewhere = [], 0
    for line in lines:
        match = _CALL.match(line)
        if match is None:
            continue
        thread, name, rest = match.groups()
        is_inside = folder in rest and (name != "openat" or "O_CREAT" in rest)
        if thread != main:
            n_elsewhere += is_inside
            continue
        n_calls[name] += 1
        if is_inside:
            kind = KINDS[name]
            text = rest.strip().replace(folder, "")
            path = text.split('"')[1].replace(f".{main}.", ".{pid}.") if '"' in text else ""
            n_inside.update((kind, kind + path))
            found.append(Point(name, n_calls[name], kind, n_inside[kind], text, path, n_inside[kind + path]))
    return found, n_elsewhere


def _retried(lines: Sequence[str]) -> list[str]:
    """Return fsyncs on a file after one on the same inode's path and descriptor failed, with no new file between."""
    failed: set[str] = set()
    found = []
    for line in lines:
        match = _CALL.match(line)
        if match is None or KINDS.get(match[2]) not in ("fsync", "create"):
            continue
        if KINDS[match[2]] == "create":
            failed = {f for f in failed if f.split("<")[-1].rstrip(">") not in match[3]}
            continue
        file = match[3].split(")")[0]
        if file in failed:
            found.append(file)
        if "= -1" in match[3]:
            failed.add(file)
    return found
