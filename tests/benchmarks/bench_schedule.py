"""Where a build on many workers would end: measured units, the simulated schedule, and real runs beside it.

Measures what each unit of a build costs in a process of its own, alone and beside another one; what the driver does
before, between, for each unit and after; and what the engine adds to a unit. From these alone it predicts the wall time
of builds on a few workers of this machine, runs them (`tests/cluster/prove_cluster.py`), and prints both. Then it
simulates a longer build of such units on up to 512 workers with a core each. Run it with

    python tests/benchmarks/bench_schedule.py --engine dask

and put the tables into docs/methods/several-machines.md.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import multiprocessing
import os
import pickle
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

from build_schedule import Engine, Machines, Phase, Schedule, simulate
from made_up_site import write_site
from one_step import peak_mib

from vsd_analytics.site.model import Site
from vsd_analytics.store.seals import DAY_FACT
from vsd_analytics.warehouse.build import build, day_work, hour_work
from vsd_analytics.warehouse.distributed import Work

sys.path.append(str(Path(__file__).parents[1]))

from cluster.prove_cluster import engine, processor_s, run

from vsd_analytics.cluster.workers import workers

ENGINES = {"dask": Engine(ahead=2), "spark": Engine(ahead=4, n_series=1)}
"""How `vsd_analytics.cluster` hands out units."""
N_FIRST, N_CARRIED = 4, 30
PROBE = """
import time
begun = time.perf_counter()
while (took := time.perf_counter() - begun) < 3: pass
print(time.process_time() / took)
"""
WORKERS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512)


@dataclass
class Parts:
    """What a build is made of: processor seconds of the driver and bytes, by phase in turn.

    Attributes:
        days: UTC days of each phase.
        before_s: Before its units are handed out.
        publish_s: Median, for a unit that comes back.
        sent, returned: Bytes of a unit there and back, medians.
        after_s: After the last phase.
        peak_mib: Greatest memory of the driver.
    """

    days: list[Sequence[int]] = field(default_factory=list)
    before_s: list[float] = field(default_factory=list)
    publish_s: list[float] = field(default_factory=list)
    sent: list[int] = field(default_factory=list)
    returned: list[int] = field(default_factory=list)
    after_s: float = 0.0
    peak_mib: float = 0.0


def driver_parts(site: Site) -> Parts:
    """Build, unit by unit in another process, and return what the driver does beside the units."""
    parts, context = Parts(), multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        _build_with(site, parts, pool)
    parts.peak_mib = peak_mib()
    return parts


def _build_with(site: Site, parts: Parts, pool: ProcessPoolExecutor) -> None:
    since = time.process_time()

    def here(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Mapping[str, bytes]]]:
        nonlocal since
        parts.before_s.append(time.process_time() - since)
        publish_s, returned = [], []
        for day in days:
            files = pool.submit(work, site, day).result()
            returned.append(len(pickle.dumps(files)))
            begun = time.process_time()
            yield day, files
            publish_s.append(time.process_time() - begun)
        parts.days.append(days)
        parts.publish_s.append(statistics.median(publish_s))
        parts.sent.append(len(pickle.dumps((work, site, days[0]))))
        parts.returned.append(int(statistics.median(returned)))
        since = time.process_time()

    build(site, distributed=here)
    parts.after_s = time.process_time() - since


def forget_hourly(site: Site) -> None:
    """Remove all facts but `camera_days`, which units of hours read."""
    for folder in (site.root / "facts", site.root / "facts" / "weeks"):
        for fact in folder.iterdir() if folder.is_dir() else ():
            if fact.is_dir() and fact.name not in (DAY_FACT, "weeks"):
                shutil.rmtree(fact)


def unit_s(asked: tuple[Work, Site, int]) -> float:
    """Return the processor seconds of a unit in this process."""
    work, site, day = asked
    begun = time.process_time()
    work(site, day)
    return time.process_time() - begun


def units_s(work: Work, site: Site, days: Sequence[int], *, n_at_once: int) -> list[float]:
    """Return the processor seconds of each unit in processes of their own, of which some run at once.

    The first day runs twice: of the first time, what it takes longer is the start of its process.
    """
    asked = [(work, site, day) for day in (days[0], *days)]
    with contextlib.ExitStack() as stack:
        context = multiprocessing.get_context("spawn")
        pools = [stack.enter_context(ProcessPoolExecutor(1, mp_context=context)) for _ in range(n_at_once)]
        found = [pool.map(unit_s, asked) for pool in pools]
        return [sum(of_unit) / n_at_once for of_unit in zip(*found, strict=True)]


def carried(site: Site, day: int) -> dict[str, bytes]:
    """Return as many bytes as `day` says, which do not compress, as those of fact files.

    The first one of a worker also imports what its first unit does.
    """
    importlib.import_module("vsd_analytics.warehouse.build")
    return {"carried": random.Random(day).randbytes(day)}


@dataclass(frozen=True, slots=True)
class EngineCosts:
    """What an engine adds to the work of a build, in processor seconds.

    Attributes:
        worker_s, driver_s: For each unit, of its worker and of the driver.
        start_s, driver_start_s: Until a worker, and the driver, have done their first unit: the start of Java, imports,
            and code that is compiled when it runs.
    """

    worker_s: float
    driver_s: float
    start_s: float
    driver_start_s: float


def engine_costs(site: Site, name: str, n_bytes: int, folder: Path) -> EngineCosts:
    """Return what an engine adds to a build whose units return so many bytes."""

    def carry(n: int) -> tuple[float, float]:
        before = processor_s(started[0]), _own_s()
        list(distributed(carried, site, [n_bytes + k for k in range(n)]))
        return processor_s(started[0]) - before[0], _own_s() - before[1]

    with engine(name, 1, folder) as (address, started):
        connecting_s = processor_s(started[0])
        with workers(address) as distributed:
            connected_s = processor_s(started[0]) - connecting_s
            first_s, driver_first_s = carry(N_FIRST)
            worker_s, driver_s = (took / N_CARRIED for took in carry(N_CARRIED))
    return EngineCosts(
        worker_s,
        driver_s,
        max(0.0, connected_s + first_s - N_FIRST * worker_s),
        max(0.0, driver_first_s - N_FIRST * driver_s),
    )


def _own_s() -> float:
    """Return the processor seconds of this process and of the Java that it started in its group."""
    ticks, own = 0, os.getpid()
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            head, _, rest = path.read_text().rpartition(") ")
            of = rest.split()
            if own in (int(head.split()[0]), int(of[1])) and int(of[2]) == os.getpgrp():
                ticks += int(of[11]) + int(of[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def others() -> float:
    """Return how many processes of others want a core, given the part of a core that probes get beside them."""
    cores = os.cpu_count() or 1
    probes = [
        subprocess.Popen([sys.executable, "-c", PROBE], stdout=subprocess.PIPE, text=True, start_new_session=True)
        for _ in range(cores)
    ]
    share = statistics.mean(float(probe.communicate()[0]) for probe in probes)
    return max(0.0, cores / share - cores)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engine", choices=ENGINES, default="dask")
    parser.add_argument("--days", type=int, default=16, help="UTC days that are measured.")
    parser.add_argument("--cameras", type=int, default=18)
    parser.add_argument("--hours", type=int, default=12, help="Hours of a day with records.")
    parser.add_argument("--interval", type=int, default=4, help="Seconds from frame to frame.")
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2, 4], help="Of the real runs.")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--simulated-days", type=int, default=365)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as root:
        project, folder = Path(root) / "project", Path(root) / "workers"
        project.mkdir()
        folder.mkdir()
        per_day = given.cameras * given.hours * 3600 // given.interval * 6
        size = {"n_cameras": given.cameras, "open_h": given.hours, "interval_s": given.interval}
        site = write_site(project, n_records=given.days * per_day, **size)
        print(f"{given.days} days of {per_day:,} person records; load {os.getloadavg()[0]:.1f}\n")
        _tables(site, given, folder)


def _tables(site: Site, given: argparse.Namespace, folder: Path) -> None:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        parts, how = pool.submit(driver_parts, site).result(), ENGINES[given.engine]
    days = parts.days[-1]
    in_phase_1 = units_s(day_work, site, parts.days[0], n_at_once=1)[1:]
    forget_hourly(site)
    (first_s, *alone), (_, *beside) = (units_s(hour_work, site, days, n_at_once=n) for n in (1, 2))
    warm_up_s = max(0.0, first_s - alone[0])
    slowdown = max(1.0, statistics.median(b / a for a, b in zip(alone, beside, strict=True)))
    every = [engine_costs(site, given.engine, n_bytes, folder) for n_bytes in parts.returned]
    costs = every[-1]
    how = replace(how, start_s=costs.start_s + warm_up_s, driver_start_s=costs.driver_start_s)
    phases = [
        Phase(before_s, [unit + own.worker_s for unit in units], publish_s + own.driver_s)
        for before_s, units, publish_s, own in zip(
            parts.before_s, (in_phase_1, alone), parts.publish_s, every, strict=True
        )
    ]
    print("| of a build | value |\n|---|--:|")
    longest, mean = max(alone), statistics.mean(alone)
    serial_s = sum(parts.before_s) + parts.after_s + sum(len(p.units_s) * p.publish_s for p in phases)
    print(f"| a unit, processor s: mean, longest | {mean:.2f}, {longest:.2f} |")
    print(f"| the same beside another one, times alone | {slowdown:.2f} |")
    print(f"| a unit of `camera_days`, s | {statistics.mean(in_phase_1):.3f} |")
    print(f"| bytes of a unit: sent, returned | {parts.sent[-1]:,}, {parts.returned[-1]:,} |")
    print(f"| engine, of a unit: worker, driver, ms | {1e3 * costs.worker_s:.1f}, {1e3 * costs.driver_s:.1f} |")
    print(f"| engine, start: worker, driver, s | {how.start_s:.2f}, {costs.driver_start_s:.2f} |")
    print(f"| driver, publishing a unit, ms | {1e3 * parts.publish_s[-1]:.1f} |")
    print(f"| driver, planning, of a day, ms | {1e3 * sum(parts.before_s) / len(days):.1f} |")
    print(f"| driver, at the end, of a day, ms | {1e3 * parts.after_s / len(days):.1f} |")
    print(f"| serial share of a build | {serial_s / (serial_s + sum(sum(p.units_s) for p in phases)):.4f} |")
    print(f"| driver, greatest memory, MiB | {parts.peak_mib:.0f} |\n")
    _compare(site, given, folder, phases, how, parts.after_s, slowdown)
    _simulated(given, phases, how, parts.after_s, slowdown, parts.returned[-1])


def _compare(
    site: Site,
    given: argparse.Namespace,
    folder: Path,
    phases: Sequence[Phase],
    how: Engine,
    after_s: float,
    slowdown: float,
) -> None:
    print("| workers | predicted, s | measured, s (least to greatest) | predicted / measured | other processes |")
    print("|--:|--:|---|--:|--:|", flush=True)
    for n_workers in given.workers:
        measured, busy = [], []
        for _ in range(given.rounds):
            before = others()
            measured.append(run(site, given.engine, n_workers, folder, is_killed=False)[0])
            busy.append((before + others()) / 2)
        machines = Machines(cores=os.cpu_count() or 1, others=statistics.median(busy), slowdown=slowdown)
        predicted_s = simulate(phases, n_workers=n_workers, engine=how, machines=machines, after_s=after_s).makespan_s
        median = statistics.median(measured)
        spread = f"{median:.1f} ({min(measured):.1f} to {max(measured):.1f})"
        cells = f"{predicted_s:.1f} | {spread} | {predicted_s / median:.2f} | {machines.others:.1f}"
        print(f"| {n_workers} | {cells} |", flush=True)


def longer(phases: Sequence[Phase], after_s: float, n_days: int) -> tuple[list[Phase], float]:
    """Return the phases and the end of a build of more such days: the driver's work grows with the days."""
    times = n_days / len(phases[-1].units_s)

    def units(phase: Phase) -> list[float]:
        return [phase.units_s[k % len(phase.units_s)] for k in range(n_days)]

    return [Phase(p.before_s * times, units(p), p.publish_s) for p in phases], after_s * times


def _simulated(
    given: argparse.Namespace, phases: Sequence[Phase], how: Engine, after_s: float, slowdown: float, returned: int
) -> None:
    n_days = given.simulated_days
    more, end_s = longer(phases, after_s, n_days)
    machines = Machines(slowdown=slowdown)

    def schedule(n_workers: int) -> Schedule:
        return simulate(more, n_workers=n_workers, engine=how, machines=machines, after_s=end_s)

    one = schedule(1)
    print(f"\n{n_days} such days, simulated, a core for each worker and for the driver:\n")
    print("| workers | makespan, s | speed-up | efficiency | driver share | most results waiting, MB |")
    print("|--:|--:|--:|--:|--:|--:|")
    for n_workers in WORKERS:
        of = schedule(n_workers)
        cells = f"{of.makespan_s:.1f} | {one.makespan_s / of.makespan_s:.1f} | {of.efficiency:.2f}"
        print(f"| {n_workers} | {cells} | {of.driver_share:.2f} | {of.most_waiting * returned / 1e6:.0f} |")


if __name__ == "__main__":
    main()
