"""How long the store takes for rows, beside the raw floor and beside delta-rs, in one run and on the same disk.

The unit is `pyarrow.parquet.write_table` of the same rows in one file, fsynced: no store can be faster. Run it with

    python tests/benchmarks/bench_ingest.py --rows 1000000
    python tests/benchmarks/bench_ingest.py --rows 1000000 --pairs    # pairs that an engine measured, without persons
    python tests/benchmarks/bench_ingest.py --rows 4000000 --commands # `vsd ingest` with one core and with all

and put the table into docs/performance.md. Nothing asserts a time: machines differ and are noisy, ratios less so.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).parents[1]))

from simulate.small_scenes import START_MS

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.store.store import Store

HERE = Path(__file__).resolve().parents[2]
COMMAND = "from vsd_analytics.cli import main; main()"
BATCH_ROWS = 10_000
CAMERAS = 18
PEOPLE = 15
NOW = datetime(2026, 11, 20, tzinfo=UTC)
CONFIG = '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\n[[floor]]\nid = "ground"\nname = "Ground"\n' + "".join(
    f'[[camera]]\nid = "cam-{k + 1}"\nname = "Camera {k + 1}"\n' for k in range(CAMERAS)
)

Step = Callable[[Path], int]
"""A step does its work in an empty folder and returns how many bytes of rows it left there."""


def observations(n_rows: int) -> pa.Table:
    """Return person records in the order of their arrival: 18 cameras, a frame a second each, 15 people a frame."""
    rng = np.random.default_rng(1)
    k = np.arange(n_rows)
    frame, person = k // PEOPLE, k % PEOPLE
    camera, second = frame % CAMERAS, frame // CAMERAS
    track = person + PEOPLE * (second // 40)  # everybody stays 40 s
    start, pace = rng.uniform(0, 20, (2, n_rows // 40 + PEOPLE * 2, 2))[:, (track % (n_rows // 40 + 1))]
    walked = start + (pace - 10) / 40 * (second % 40)[:, None] + rng.normal(0, 0.03, (n_rows, 2))
    walked += 40 * np.stack((camera % 5, camera // 5), axis=1)  # each camera sees a place of its own
    names = pa.array([f"cam-{c + 1}" for c in range(CAMERAS)]).take(pa.array(camera))
    ids = pa.array([f"{h:016x}" for h in rng.integers(0, 2**63, int(track.max()) + 1)]).take(pa.array(track))
    columns = {
        "camera_id": names,
        "ts": pa.array(START_MS + 1000 * second).cast(SCHEMAS["observations"].field("ts").type),
        "person": pa.array(person, pa.int32()),
        "track_id": ids,
        "x_mm": pa.array(np.round(walked[:, 0] * 1000), pa.int32()),
        "y_mm": pa.array(np.round(walked[:, 1] * 1000), pa.int32()),
        "u_px": pa.nulls(n_rows, pa.float32()),
        "v_px": pa.nulls(n_rows, pa.float32()),
        "quality": pa.repeat("metric", n_rows),
    }
    fields = SCHEMAS["observations"]
    return pa.table([columns.get(f.name, pa.nulls(n_rows, f.type)) for f in fields], schema=fields)


def messages(rows: pa.Table) -> list[bytes]:
    """Return the same records as frame messages, one line a frame."""
    columns = [rows[c].to_pylist() for c in ("camera_id", "ts", "track_id", "x_mm", "y_mm")]
    lines = []
    for first in range(0, rows.num_rows, PEOPLE):
        camera, ts, *_ = (c[first] for c in columns)
        people = [
            {"id": columns[2][i], "x_m": columns[3][i] / 1000, "y_m": columns[4][i] / 1000}
            for i in range(first, min(first + PEOPLE, rows.num_rows))
        ]
        lines.append(msgspec.json.encode({"v": 1, "camera": camera, "ts": ts, "persons": people}))
    return lines


def pairs(n_rows: int) -> pa.Table:
    """Return pair records in the order of their arrival: 18 cameras, a frame a second each, 15 pairs a frame."""
    rng = np.random.default_rng(1)
    k = np.arange(n_rows)
    frame, pair = k // PEOPLE, k % PEOPLE
    camera, second = frame % CAMERAS, frame // CAMERAS
    episode = pair + PEOPLE * (second // 12)  # each episode takes 12 s
    ids = pa.array([f"{h:016x}" for h in rng.integers(0, 2**63, 2 * (int(episode.max()) + 1))])
    given = {
        "camera_id": pa.array([f"cam-{c + 1}" for c in range(CAMERAS)]).take(pa.array(camera)),
        "ts": pa.array(START_MS + 1000 * second),
        "person_a": pa.array(2 * pair),
        "person_b": pa.array(2 * pair + 1),
        "track_a": ids.take(pa.array(2 * episode)),
        "track_b": ids.take(pa.array(2 * episode + 1)),
        "distance_mm": pa.array(np.round(rng.normal(1300, 300, n_rows)).clip(200, 2400)),
        "quality": pa.repeat("metric", n_rows),
    }
    schema = SCHEMAS["pairs"]
    return pa.table(
        [given[f.name].cast(f.type) if f.name in given else pa.nulls(n_rows, f.type) for f in schema], schema=schema
    )


def pair_messages(rows: pa.Table) -> list[bytes]:
    """Return the same pairs as frame messages, one line a frame."""
    columns = [rows[c].to_pylist() for c in ("camera_id", "ts", "track_a", "track_b", "distance_mm")]
    lines = []
    for first in range(0, rows.num_rows, PEOPLE):
        camera, ts, *_ = (c[first] for c in columns)
        found = [
            {"a": columns[2][i], "b": columns[3][i], "distance_m": columns[4][i] / 1000}
            for i in range(first, min(first + PEOPLE, rows.num_rows))
        ]
        lines.append(msgspec.json.encode({"v": 1, "camera": camera, "ts": ts, "pairs": found}))
    return lines


def size(folder: Path, pattern: str = "**/*.*") -> int:
    """Return the bytes of files with rows."""
    return sum(p.stat().st_size for p in folder.glob(pattern) if p.suffix in (".arrow", ".parquet"))


def steps(table: TableName, rows: pa.Table, lines: list[bytes]) -> dict[str, Step]:
    """Return what is measured, by name."""
    batches = [rows.slice(i, BATCH_ROWS) for i in range(0, rows.num_rows, BATCH_ROWS)]
    text = b"\n".join(lines) + b"\n"

    def floor(folder: Path) -> int:
        path = folder / "rows.parquet"
        pq.write_table(rows, path)
        with path.open("rb") as f:
            os.fsync(f.fileno())
        return size(folder)

    def append(folder: Path) -> int:
        store = Store(folder / "store", site_id="shop")
        for batch in batches:
            store.append(table, batch)
        return size(folder)

    def append_fold(folder: Path) -> int:
        append(folder)
        Store(folder / "store", site_id="shop").fold()
        return size(folder)

    def delta(folder: Path) -> int:
        from deltalake import write_deltalake

        for batch in batches:
            write_deltalake(str(folder / "table"), batch, mode="append")
        return size(folder)

    def decode(folder: Path) -> int:
        from vsd_analytics.ingest.formats.frames import FrameMessage

        decoder = msgspec.json.Decoder(FrameMessage)
        for line in text.split(b"\n"):
            if line:
                decoder.decode(line)
        return len(text)

    def whole(folder: Path) -> int:
        (folder / "vsd.toml").write_text(CONFIG)
        (folder / "rows.jsonl").write_bytes(text)
        result = ingest(load_site(folder), [folder / "rows.jsonl"], IngestOptions(), now=NOW)
        stored = result.fold.tables[table].n_new
        if stored != rows.num_rows:
            raise AssertionError(f"{stored} of {rows.num_rows} rows stored")
        return size(folder, f"store/{table}/**/*.parquet")

    return {
        "write_table, one file, fsynced (the unit)": floor,
        "append, batches of 10,000, each durable": append,
        "append and fold": append_fold,
        "delta-rs append, same batches (no fsync)": delta,
        "msgspec decodes the same rows as JSON Lines": decode,
        "ingest of the JSON Lines, in all": whole,
    }


def processor_s() -> float:
    """Return the processor time of this process and of its helpers that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(of.ru_utime + of.ru_stime for of in used)


def commands(table: TableName, lines: list[bytes], n_rows: int, rounds: int, before: Path | None) -> None:
    """Print the wall time of `vsd ingest` with all cores and with one, and of two at once into one store.

    The two files at once have the messages of half of the cameras each. Times include the start of Python and the fold.
    With `before`, the checkout of another version, that one ingests the same file with all cores.
    """
    halves: tuple[list[bytes], list[bytes]] = ([], [])
    for line in lines:
        camera = line.split(b'"', 6)[5]  # {"v":1,"camera":"cam-1"
        halves[int(camera.removeprefix(b"cam-")) % 2].append(line)
    cores = os.sched_getaffinity(0)
    ways = {
        "one core": (["all"], {min(cores)}, HERE),
        f"{len(cores)} cores": (["all"], cores, HERE),
        "two commands at once, half of the cameras each": (["half-0", "half-1"], cores, HERE),
    }
    if before is not None:
        ways[f"the version before, {len(cores)} cores"] = (["all"], cores, before.resolve())
    took: dict[str, list[tuple[float, float]]] = {way: [] for way in ways}
    with tempfile.TemporaryDirectory() as root:
        for name, some in {"all": lines, "half-0": halves[0], "half-1": halves[1]}.items():
            (Path(root) / f"{name}.jsonl").write_bytes(b"\n".join(some) + b"\n")
        for k in range(rounds):
            for way, (names, own_cores, checkout) in list(ways.items())[:: -1 if k % 2 else 1]:
                folder = Path(root) / "project"
                folder.mkdir()
                (folder / "vsd.toml").write_text(CONFIG)
                start, start_cpu = time.perf_counter(), processor_s()
                os.sched_setaffinity(0, own_cores)  # the commands have them too
                group = [
                    subprocess.Popen(
                        [sys.executable, "-c", COMMAND, "-C", folder, "ingest", Path(root) / f"{name}.jsonl"],
                        env={**os.environ, "PYTHONPATH": str(checkout)},
                        stdout=subprocess.DEVNULL,
                    )
                    for name in names
                ]
                codes = [process.wait() for process in group]
                os.sched_setaffinity(0, cores)
                if any(codes):
                    raise AssertionError("an ingest failed")
                took[way].append((time.perf_counter() - start, processor_s() - start_cpu))
                stored = pq.ParquetDataset(folder / "store" / table).read(columns=["ts"]).num_rows
                if stored != n_rows:
                    raise AssertionError(f"{stored} of {n_rows} rows stored")
                shutil.rmtree(folder)
    print(f"{n_rows:,} records of {table}; {rounds} rounds; load {os.getloadavg()[0]:.1f}\n")
    print("| vsd ingest | wall, s | least | greatest | times one core | least | greatest | processor s | records a s |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for way, of in took.items():
        wall, cpu = zip(*of, strict=True)
        ratios = [w / one for w, (one, _) in zip(wall, took["one core"], strict=True)]
        median = statistics.median(wall)
        print(
            f"| {way} | {median:.2f} | {min(wall):.2f} | {max(wall):.2f} | {statistics.median(ratios):.2f} "
            f"| {min(ratios):.2f} | {max(ratios):.2f} | {statistics.median(cpu):.2f} | {n_rows / median:,.0f} |"
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--pairs", action="store_true")
    parser.add_argument("--commands", action="store_true")
    parser.add_argument("--before", type=Path, help="with --commands: a checkout of another version, beside this one")
    given = parser.parse_args()
    table: TableName = "pairs" if given.pairs else "observations"
    rows = pairs(given.rows) if given.pairs else observations(given.rows)
    lines = pair_messages(rows) if given.pairs else messages(rows)
    if given.commands:
        commands(table, lines, given.rows, given.rounds, given.before)
        return
    measured = steps(table, rows, lines)
    times: dict[str, list[float]] = {name: [] for name in measured}
    cpu: dict[str, list[float]] = {name: [] for name in measured}
    sizes: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as root:
        for _ in range(given.rounds):
            for name, step in measured.items():
                folder = Path(root) / "step"
                folder.mkdir()
                start, start_cpu = time.perf_counter(), processor_s()
                sizes[name] = step(folder)
                times[name].append(time.perf_counter() - start)
                cpu[name].append(processor_s() - start_cpu)
                shutil.rmtree(folder)
    unit, unit_wall = (of[next(iter(measured))] for of in (cpu, times))
    print(f"{given.rows:,} records of {table}; {given.rounds} rounds; load {os.getloadavg()[0]:.1f}\n")
    heads = "processor s | times the unit, median | least | greatest | wall | records a s, processor | wall | bytes"
    print(f"| step | {heads} |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for name, took in times.items():
        ratios = [t / u for t, u in zip(cpu[name], unit, strict=True)]
        of_wall = statistics.median(t / u for t, u in zip(took, unit_wall, strict=True))
        cpu_s, wall_s = statistics.median(cpu[name]), statistics.median(took)
        print(
            f"| {name} | {cpu_s:.2f} | {statistics.median(ratios):.1f} | {min(ratios):.1f} | {max(ratios):.1f} "
            f"| {of_wall:.1f} | {given.rows / cpu_s:,.0f} | {given.rows / wall_s:,.0f} "
            f"| {sizes[name] / given.rows:.1f} |"
        )


if __name__ == "__main__":
    sys.exit(main())
