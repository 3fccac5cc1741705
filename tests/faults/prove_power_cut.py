"""Cuts the power at every acknowledgement: what was acknowledged is on the disk.

The project stands on an ext4 file system of its own in a file (a loop device). At the moment of an acknowledgement the
file is copied: it holds what reached the disk and nothing that was only in memory. The copy is mounted, which replays
its journal as after a power cut, and read. Run it by hand (`make prove` does); it needs root, mkfs.ext4 and loop
devices, and prints why when it cannot run. To show that the method would find a loss, the same is done with fsync
switched off.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from crash_points import call
from jobs import (
    CONFIG,
    DOOR,
    START,
    WEEK,
    add_counts,
    add_to_log,
    append,
    fill_quarantine,
    make_keys,
    messages,
    remove_counts,
    tables,
    vsd,
)
from project_state import LOG, PAGES, Row, State, Truth, as_rows, counts_in, engine_tracks, glance, state

MEGABYTES = 96
N_FILES = 6
DIRTY_S = 8.0
BUILD, REPORT, PLANNER = ("build",), ("report", "--exact", "--week", WEEK), ("planner", "--exact", "--week", WEEK)
EVERYTHING = (BUILD, REPORT, PLANNER)


@dataclass
class Found:
    """What was found at the cuts of one moment."""

    n_cuts: int = 0
    n_acked: int = 0
    n_torn: int = 0
    n_harmed: int = 0
    wrong: list[str] = field(default_factory=list)


@dataclass
class Power:
    """A project on a disk whose power can be cut.

    Attributes:
        image: The file that holds the disk.
        root: The project on it.
        scratch: Where copies are put.
        truth: All there may be.
        acked: What was acknowledged so far.
        found: What the cuts showed, by moment.
    """

    image: Path
    root: Path
    scratch: Path
    truth: Truth
    acked: list[Any] = field(default_factory=list)
    found: dict[str, Found] = field(default_factory=dict)

    def ack(self, moment: str) -> Callable[[Any], None]:
        """Return what is called with each acknowledgement, and cuts."""

        def cut(value: Any) -> None:
            self.acked.append(value)
            self.cut(moment)

        return cut

    def cut(self, moment: str, *, like: State | None = None, built_by: Sequence[Sequence[str]] = ()) -> None:
        """Copy the disk as it is, mount the copy, and look at it.

        Args:
            moment: Row of the table.
            like: Rows and what purges keep must equal these, when given.
            built_by: What these commands make must come out the same as without any facts.
        """
        if (self.root / LOG).exists():
            self.truth = replace(self.truth, log=frozenset((self.root / LOG).read_text().splitlines()))
        self.truth = replace(self.truth, counts=frozenset(counts_in(self.root).values()))
        copy = self.scratch / "copy.img"
        subprocess.run(["cp", "--sparse=always", str(self.image), str(copy)], check=True)
        with mounted(copy, self.scratch / "copy") as disk:
            try:
                torn, wrong = call(after_cut, disk / self.root.name, self.truth, self.acked, like, built_by)
            except AssertionError as error:
                torn, wrong = 0, [str(error)]
        copy.unlink()
        found = self.found.setdefault(moment, Found())
        found.n_cuts += 1
        found.n_acked += sum(len(value) for kind, _, value in self.acked if kind == "rows")
        found.n_torn += torn
        found.n_harmed += bool(wrong)
        found.wrong += [f"{moment}: {w}" for w in wrong]


def after_cut(
    root: Path, truth: Truth, acked: list[Any], like: State | None, built_by: Sequence[Sequence[str]]
) -> tuple[int, list[str]]:
    """Return how many fact files are torn, and what is wrong: as the disk is, and after the next build."""
    if not (root / "vsd.toml").exists():
        return 0, ["the project is gone"]
    for name in PAGES:
        shutil.rmtree(root / name, ignore_errors=True)  # they are written anew, below
    wrong = glance(root, truth, acked, are_facts_read=False)
    torn = sum(is_torn(path) for path in (root / "facts").rglob("*.parquet"))
    if like is not None:
        shutil.rmtree(root / "facts")
        now = state(root)
        wrong += ["rows differ from those before the cut"] * (now.rows != like.rows)
        wrong += ["what the purge keeps differs"] * (now.sealed != like.sealed)
    vsd(root, "build")
    for command in built_by:
        vsd(root, *command)
    if not built_by:
        for folder in ("days", "weeks"):  # a build makes none of these anew; a report does, and looks at each it reads
            shutil.rmtree(root / "facts" / folder, ignore_errors=True)
    wrong += [f"built: {w}" for w in glance(root, truth, acked)]
    vsd(root, "verify")
    if built_by:
        trusting = state(root)
        shutil.rmtree(root / "facts")
        for command in built_by:
            vsd(root, *command)
        wrong += ["facts were trusted that differ from new ones"] * (state(root).facts != trusting.facts)
        wrong += ["pages differ from those of new facts"] * (state(root).pages != trusting.pages)
    return torn, wrong


def is_torn(path: Path) -> bool:
    """Tell whether a Parquet file cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        pq.ParquetFile(path).read()
    except pa.ArrowException:
        return True
    return False


@contextlib.contextmanager
def mounted(image: Path, at: Path) -> Iterator[Path]:
    """Mount the file system in a file."""
    at.mkdir(exist_ok=True)
    subprocess.run(["mount", "-o", "loop", str(image), str(at)], check=True, capture_output=True)
    try:
        yield at
    finally:
        subprocess.run(["umount", str(at)], check=True)


@contextlib.contextmanager
def powered(scratch: Path) -> Iterator[Power]:
    """Make a disk with a project of `N_FILES` files to ingest."""
    image = scratch / "disk.img"
    with image.open("wb") as f:
        f.truncate(MEGABYTES << 20)
    subprocess.run(["mkfs.ext4", "-q", "-F", str(image)], check=True)
    with mounted(image, scratch / "disk") as disk:
        root = disk / "project"
        root.mkdir()
        (root / "vsd.toml").write_text(CONFIG + DOOR)
        (scratch / "given").mkdir()
        for i in range(N_FILES):
            lines = messages(START + timedelta(hours=9 * i), 15, with_pairs=True)
            (scratch / "given" / f"{i}.jsonl").write_text("\n".join(lines))
        truth = call(rows_of, root, sorted((scratch / "given").iterdir()))
        os.sync()
        yield Power(image, root, scratch, Truth(truth))


def rows_of(root: Path, files: list[Path]) -> dict[str, set[Row]]:
    """Return all rows of the files, by table, with the engine's track ids."""
    found: dict[str, set[Row]] = {"frames": set(), "observations": set(), "pairs": set()}
    for file in files:
        for table, rows in tables(root, file):
            found[table] |= set(engine_tracks(root, table, as_rows(rows)))
    return found


def run(power: Power) -> None:
    """Do everything that acknowledges something, and cut the power each time."""
    root = power.root
    files = sorted((power.scratch / "given").iterdir())
    make_keys(root, power.ack("day key"))
    for text in ("opened", "moved the exhibit"):  # the first makes the file
        add_to_log(root, power.ack("log add"), text=text)
    for name in ("first.csv", "second.csv"):  # the first makes the folder
        add_counts(root, power.ack("counts add"), name=name)
    remove_counts(root, power.ack("counts remove"))
    add_counts(root, power.ack("counts add"), name="second.csv")
    for file in files[:3]:
        vsd(root, "ingest", str(file), ack=power.ack("append"))
        power.cut("fold")
    for file in files[3:5]:  # the spool holds batches of several files
        append(root, power.ack("append, in the middle of many"), file=file)
    fill_quarantine(root, power.ack("quarantine"))
    vsd(root, "build")
    power.cut("build", built_by=[BUILD])
    for name, command in (("report", REPORT), ("planner", PLANNER)):
        vsd(root, *command)
        power.cut(name, built_by=[REPORT, PLANNER])
    vsd(root, "ingest", str(files[5]), ack=power.ack("append"))
    for command in EVERYTHING:
        vsd(root, *command)
    time.sleep(DIRTY_S)
    power.cut(f"build, report and planner, {DIRTY_S:.0f} s later", built_by=EVERYTHING)
    for moment, options in (
        ("purge by camera", ("--camera", "cam-1", "--range", "2026-11-09T11:00..2026-11-09T22:00")),
        ("purge by age", ("--older-than", "2026-11-10", "--force")),
    ):
        vsd(root, "purge", *options)
        power.acked.clear()  # some of it was to go
        (power.scratch / "like").mkdir()
        like = shutil.copytree(root, power.scratch / "like" / "project")
        power.cut(moment, like=call(state_without_facts, like))
        shutil.rmtree(power.scratch / "like")


def state_without_facts(root: Path) -> State:
    """Return the state of a project whose facts may go."""
    shutil.rmtree(root / "facts")
    return state(root)


def run_without_fsync(power: Power) -> None:
    """Add counts and append as if the disk needed no waiting for: what the other rows prove would not hold."""
    fsync, os.fsync = os.fsync, lambda fd: None
    try:
        add_counts(power.root, power.ack("counts add, fsync switched off"), name="first.csv")
        for file in sorted((power.scratch / "given").iterdir()):
            append(power.root, power.ack("append, fsync switched off"), file=file)
    finally:
        os.fsync = fsync


def why_not() -> str | None:
    """Return why the power cannot be cut here, or None."""
    if os.geteuid() != 0:
        return "only root may mount"
    if missing := [name for name in ("mkfs.ext4", "mount", "umount") if shutil.which(name) is None]:
        return f"there is no {' and no '.join(missing)} here"
    try:
        with tempfile.TemporaryDirectory() as scratch, powered(Path(scratch)):
            return None
    except subprocess.CalledProcessError as error:
        return f"loop devices cannot be mounted here: {error.stderr.decode().strip()[:200]}"


def main() -> int:
    """Print the table of docs/faults.md; 1 when anything acknowledged was lost, or the method finds nothing."""
    if (reason := why_not()) is not None:
        print(f"skipped: {reason}")
        return 0
    found: dict[str, Found] = {}
    for job in (run, run_without_fsync):
        with tempfile.TemporaryDirectory() as scratch, powered(Path(scratch)) as power:
            job(power)
            found |= power.found
    print("| cut right after | cuts | acknowledged records looked for | torn fact files met | cuts with a loss |")
    print("|---|---|---|---|---|")
    for moment, f in found.items():
        print(f"| {moment} | {f.n_cuts} | {f.n_acked:,} | {f.n_torn} | {f.n_harmed} |")
    harmed = [w for moment, f in found.items() if "switched off" not in moment for w in f.wrong]
    for text in harmed:
        print(f"* {text}", file=sys.stderr)
    controls = [f for moment, f in found.items() if "switched off" in moment]
    n_cuts = sum(f.n_cuts for f in found.values()) - sum(f.n_cuts for f in controls)
    print(f"\n{n_cuts} cuts, {len(harmed)} things wrong")
    return 1 if harmed or not all(f.n_harmed for f in controls) else 0


if __name__ == "__main__":
    raise SystemExit(main())
