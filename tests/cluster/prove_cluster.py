"""Builds facts on workers of Dask and Spark, with one worker, with two, and with one of two killed in mid-run.

Every run starts without facts, in a project on a disk that all workers see, and must leave the files of a local build,
byte for byte. Scheduler, master and workers are the real ones, as processes of their own on this machine. Run it with

    PYTHONPATH=tests python tests/cluster/prove_cluster.py --engine dask

and put the table into docs/methods/several-machines.md. Exits with 1 when a file differs. Wall time needs a core for
each worker; where there are fewer, the processor time of the busiest worker beside that of all says how well the work
was divided.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.made_up_site import write_site

from vsd_analytics.cluster.workers import workers
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.build import build


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def start(*command: str, **environment: str) -> subprocess.Popen[bytes]:
    """Start a process with all its children in a group of their own, to be killed together."""
    return subprocess.Popen(
        command,
        env={**os.environ, **environment},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def kill(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextlib.contextmanager
def engine(name: str, n_workers: int, folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Start a scheduler or master and its workers of one core each; yield the address and the workers."""
    port = str(free_port())
    if name == "dask":
        address = f"tcp://127.0.0.1:{port}"
        cli = f"{sys.executable} -m distributed.cli.dask_"
        master = tuple(f"{cli}scheduler --host 127.0.0.1 --port {port} --no-dashboard".split())
        worker = f"{cli}worker {address} --no-nanny --nthreads 1 --no-dashboard --local-directory {folder}".split()
        environment: dict[str, str] = {}
    else:
        import pyspark

        home = Path(pyspark.__file__).parent
        address, run = f"spark://127.0.0.1:{port}", str(home / "bin" / "spark-class")
        deploy = "org.apache.spark.deploy"
        master = (run, f"{deploy}.master.Master", "--host", "127.0.0.1", "--port", port, "--webui-port", "0")
        worker = [
            *(run, f"{deploy}.worker.Worker", address, "--cores", "1", "--memory", "2g", "--host", "127.0.0.1"),
            *("--webui-port", "0", "--work-dir", str(folder)),
        ]
        environment = {"SPARK_HOME": str(home), "SPARK_SCALA_VERSION": "2.13", "SPARK_LOCAL_IP": "127.0.0.1"}
        os.environ["SPARK_LOCAL_IP"] = "127.0.0.1"
    started = [start(*master, **environment)]
    try:
        wait_for(int(port))
        started += [start(*worker, **environment) for _ in range(n_workers)]
        time.sleep(15 if name == "spark" else 5)  # workers register by themselves
        yield address, started[1:]
    finally:
        for process in reversed(started):
            kill(process)


def processor_s(process: subprocess.Popen[bytes]) -> float:
    """Return the processor seconds of all living processes in the group of a process."""
    ticks = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            of = path.read_text().rpartition(") ")[2].split()  # from the state on: the name may hold spaces
            if int(of[2]) == process.pid:
                ticks += int(of[11]) + int(of[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def wait_for(port: int, *, limit_s: float = 60) -> None:
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return
        time.sleep(0.2)
    raise TimeoutError(f"nothing listens on port {port}")


def tree(site: Site) -> dict[str, str]:
    """Return the digest of each fact file."""
    facts = site.root / "facts"
    return {
        str(p.relative_to(facts)): hashlib.blake2b(p.read_bytes()).hexdigest() for p in sorted(facts.rglob("*.parquet"))
    }


def run(site: Site, name: str, n_workers: int, folder: Path, *, is_killed: bool) -> tuple[float, list[float], int]:
    """Build without facts; return wall seconds, processor seconds of each worker, and the number of workers killed.

    Connecting does not count, nor does the time that a worker needed until then.
    """
    shutil.rmtree(site.root / "facts", ignore_errors=True)
    killed: list[int] = []
    with engine(name, n_workers, folder) as (address, started), workers(address) as distributed:

        def on_hours(n_hours: int) -> None:
            if is_killed and not killed:
                killed.append(started[0].pid)
                kill(started[0])

        before = [processor_s(process) for process in started]
        begun = time.perf_counter()
        build(site, distributed=distributed, on_hours=on_hours)
        took = time.perf_counter() - begun
        return took, [processor_s(p) - b for p, b in zip(started, before, strict=True) if p.poll() is None], len(killed)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engine", choices=("dask", "spark"), default="dask")
    parser.add_argument("--records", type=int, default=6_000_000)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as root:
        project, folder = Path(root) / "project", Path(root) / "workers"
        project.mkdir()
        folder.mkdir()
        site = write_site(project, n_records=given.records, open_h=1)
        begun, begun_cpu = time.perf_counter(), time.process_time()
        build(site)
        here = time.perf_counter() - begun
        expected, is_right = tree(site), True
        n_days = len({name.split("date=")[1][:10] for name in expected})
        print(
            f"{given.records:,} person records, {n_days} days, {len(expected)} files; load {os.getloadavg()[0]:.1f}; "
            f"here alone: {here:.1f} s, {time.process_time() - begun_cpu:.1f} s of processor time\n"
        )
        print(f"| {given.engine} workers | wall, s | times one worker | processor s, all | busiest | files equal |")
        print("|---|--:|--:|--:|--:|---|")
        for _ in range(given.rounds):
            one = 0.0
            cases = [(n, False) for n in given.workers] + [(2, True)]
            for n_workers, is_killed in cases:
                took, cpu, n_killed = run(site, given.engine, n_workers, folder, is_killed=is_killed)
                one, is_equal = one or took, tree(site) == expected
                is_right &= is_equal and n_killed == int(is_killed)
                words = f"{n_workers}, one of them killed after the first day" if is_killed else str(n_workers)
                times = f"{took:.1f} | {took / one:.2f} | {sum(cpu):.1f} | {max(cpu):.1f}"
                print(f"| {words} | {times} | {'yes' if is_equal else 'NO'} |", flush=True)
    return int(not is_right)


if __name__ == "__main__":
    sys.exit(main())
