"""Real faults of a disk: full, read-only, broken, with a flipped bit, a torn part, a foreign file; then fixed."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.store.segments import about
from vsd_analytics.store.store import FoldResult, Store
from vsd_analytics.warehouse.verify_facts import verify

CONFIG = site_text(timezone="UTC", more="hz = 1\n[ingest]\nballast_mb = {ballast_mb}\n")
MB = 1_000_000
HOURS = ("hours", "--range", "2026-11-09")


@dataclass
class Told:
    """What a command said."""

    code: int
    out: str
    err: str

    def has(self, error: str, *words: str) -> bool:
        """Tell whether it ended with a whole message for people: code, where, why, fix."""
        lines = [f"error[{error}]: ", "\n  why: ", "\n  fix: ", f"\n more: vsd explain {error}"]
        return self.code == 2 and all(w in self.err for w in (*lines, *words))


Vsd = Callable[..., Told]


@pytest.fixture
def vsd(capsys: pytest.CaptureFixture[str]) -> Vsd:
    def call(root: Path, *arguments: str | Path) -> Told:
        code = run(cli, ["-C", str(root), "--now", "2026-11-20T00:00:00Z", *map(str, arguments)])
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        assert "E900" not in err
        return Told(code, out, err)

    return call


def mount(folder: Path, *options: str) -> None:
    done = subprocess.run(["mount", *options, str(folder)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"mounting is not allowed here: {done.stderr.strip()[:100]}")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """Return a project on a disk of its own of 6 MB."""
    if shutil.which("mount") is None:
        pytest.skip("there is no mount command here")
    folder = tmp_path / "disk"
    folder.mkdir()
    mount(folder, "-t", "tmpfs", "-o", "size=6m", "tmpfs")
    try:
        yield project(folder)
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.fixture
def here(tmp_path: Path) -> Path:
    return project(tmp_path / "here")


def project(root: Path, *, ballast_mb: float = 0.0) -> Path:
    root.mkdir(exist_ok=True)
    (root / "vsd.toml").write_text(CONFIG.format(ballast_mb=ballast_mb))
    return root


def engine_output(path: Path, *, first_s: int = 0, n: int = 300, seed: int = 1) -> Path:
    """Write n seconds of two people, from 9:00 on."""
    # each stays within 2 m, so that nobody is faster than a person can be, and the two are 50 m apart
    spots = np.random.default_rng(seed).integers(0, 2_000, size=(n, 4)) / 1000 + np.array([0, 0, 50, 50])
    lines = ["ts,camera_id,track_id,x_m,y_m"]
    for k, (a, b, c, d) in enumerate(spots):
        ts = f"2026-11-09T{9 + (first_s + k) // 3600:02}:{(first_s + k) // 60 % 60:02}:{(first_s + k) % 60:02}Z"
        lines += [f"{ts},cam-1,p,{a},{b}", f"{ts},cam-1,q,{c},{d}"]
    path.write_text("\n".join(lines) + "\n")
    return path


def fill(root: Path, *, leave_bytes: int = 0) -> Path:
    """Fill the disk but for some bytes; return the file to delete."""
    filler = root / "filler"
    with filler.open("wb", buffering=0) as f:  # a buffer would be flushed again when the file is closed
        try:
            while True:
                f.write(b"\0" * 65536)
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
    with filler.open("r+b") as f:
        f.truncate(max(0, filler.stat().st_size - leave_bytes))
    return filler


def parts(root: Path) -> list[Path]:
    return sorted((root / "store" / "observations").rglob("*.parquet"))


def n_stored(root: Path) -> int:
    """Return the rows anybody finds by reading parts and spool."""
    spooled = sorted((root / "store" / "live" / "observations").glob("*.arrow"))
    return sum(about(p).n_rows for p in (*parts(root), *spooled))


def litter(root: Path) -> list[Path]:
    return sorted(root.rglob("*.tmp"))


def test_a_full_disk_acknowledges_nothing_more_and_goes_on_when_there_is_room(
    disk: Path, tmp_path: Path, vsd: Vsd
) -> None:
    assert vsd(disk, "ingest", engine_output(tmp_path / "a.csv")).code == 0
    before = vsd(disk, *HOURS)
    filler = fill(disk, leave_bytes=8192)
    second = engine_output(tmp_path / "b.csv", first_s=300, n=3000)
    told = vsd(disk, "ingest", second, engine_output(tmp_path / "c.csv", first_s=9000, n=3000))
    assert told.has("E304", "  --> ", str(disk / "store"), "nothing counts twice")
    assert told.err.count("E304]") == 1, "it stops at once"
    assert n_stored(disk) == 600
    assert litter(disk) == []
    assert vsd(disk, *HOURS) == before
    assert vsd(disk, "verify").code == 0
    assert vsd(disk, "ingest", second, "--json").out.count('"code": "E304"') == 1
    filler.unlink()
    assert "6,000 new records stored" in vsd(disk, "ingest", second).out
    assert (n_stored(disk), vsd(disk, *HOURS).code, vsd(disk, "verify").code) == (6600, 0, 0)


@pytest.fixture
def stopped_before_the_fold(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path, Path, Vsd], None]:
    """Return a function that ingests a file and is stopped right after the acknowledgement."""

    def ingest(root: Path, file: Path, vsd: Vsd) -> None:
        with monkeypatch.context() as patched:
            patched.setattr(Store, "fold", lambda self, **more: FoldResult())
            assert vsd(root, "ingest", file, "--yes").code <= 1  # 1: warned of, as the same walks come hours later

    return ingest


def test_a_full_disk_stops_a_fold_and_what_was_acknowledged_stays(
    disk: Path, tmp_path: Path, vsd: Vsd, stopped_before_the_fold: Callable[[Path, Path, Vsd], None]
) -> None:
    stopped_before_the_fold(disk, engine_output(tmp_path / "a.csv", n=4000), vsd)
    filler = fill(disk)
    for command in (("build",), HOURS, ("ingest", engine_output(tmp_path / "b.csv", first_s=9000, n=9))):
        assert vsd(disk, *command).has("E304", "  --> ", str(disk / "store"))
    assert (n_stored(disk), litter(disk)) == (8000, [])
    assert vsd(disk, "verify").code == 0
    filler.unlink()
    assert vsd(disk, "build").code == 0
    assert (n_stored(disk), len(parts(disk)), vsd(disk, "verify").code) == (8000, 2, 0)


def test_ballast_lets_a_fold_run_on_a_full_disk_and_comes_back(
    disk: Path, tmp_path: Path, vsd: Vsd, stopped_before_the_fold: Callable[[Path, Path, Vsd], None]
) -> None:
    project(disk, ballast_mb=0.1)
    ballast = disk / "store" / ".ballast"
    vsd(disk, "ingest", engine_output(tmp_path / "small.csv", n=300))
    assert not ballast.exists(), "a store lighter than its ballast takes none"
    vsd(disk, "ingest", engine_output(tmp_path / "a.csv", n=15_000))
    assert ballast.stat().st_size == 100_000
    stopped_before_the_fold(disk, engine_output(tmp_path / "b.csv", first_s=20_000, n=1000), vsd)
    filler = fill(disk)
    folded = vsd(disk, "ingest", tmp_path / "small.csv", "--json")
    assert (folded.code, '"E304"' in folded.out) == (2, True), "ballast is for the fold alone, not for more records"
    told = vsd(disk, "build")
    assert "warning[W304]: the disk is full: the ballast" in told.err
    assert not ballast.exists()
    assert not list((disk / "store" / "live").rglob("*.*"))
    assert n_stored(disk) == 32_000
    filler.unlink()
    assert vsd(disk, "build").code == 0
    assert ballast.stat().st_size == 100_000
    assert vsd(disk, "verify").code == 0


def test_a_full_disk_stops_a_build_which_leaves_nothing_half_done(disk: Path, tmp_path: Path, vsd: Vsd) -> None:
    vsd(disk, "ingest", engine_output(tmp_path / "a.csv"))
    filler = fill(disk)
    for command in (("build",), HOURS):
        assert vsd(disk, *command).has("E304", "  --> ", str(disk / "facts"))
    assert litter(disk) == []
    assert vsd(disk, "verify").code == 0
    filler.unlink()
    assert (vsd(disk, *HOURS).code, vsd(disk, "verify").code) == (0, 0)


def test_a_disk_that_can_only_be_read_refuses_records_and_answers_questions(
    disk: Path, tmp_path: Path, vsd: Vsd
) -> None:
    vsd(disk, "ingest", engine_output(tmp_path / "a.csv"))
    before = vsd(disk, *HOURS)
    vsd(disk, "build")
    second = engine_output(tmp_path / "b.csv", first_s=300, n=9)
    mount(disk, "-o", "remount,ro")
    assert vsd(disk, "ingest", second).has("E305", "  --> ", "mount it for writing")
    assert n_stored(disk) == 600
    assert vsd(disk, *HOURS) == before
    assert (vsd(disk, "build").code, vsd(disk, "verify").code) == (0, 0)
    (changed := tmp_path / "changed.toml").write_text(CONFIG.format(ballast_mb=0) + "[rule]\ncoverage_gap_s = 5\n")
    mount(disk, "-o", "remount,rw")
    shutil.copy(changed, disk / "vsd.toml")
    mount(disk, "-o", "remount,ro")
    assert vsd(disk, *HOURS).has("E305", "  --> ", str(disk / "facts"))
    mount(disk, "-o", "remount,rw")
    assert (vsd(disk, "ingest", second).code, n_stored(disk)) == (0, 618)
    assert (vsd(disk, *HOURS).code, vsd(disk, "verify").code) == (0, 0)


@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC])
def test_a_sync_that_fails_is_not_stored_and_never_tried_again_on_the_same_file(
    here: Path, tmp_path: Path, vsd: Vsd, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    file = engine_output(tmp_path / "a.csv")
    vsd(here, "ingest", engine_output(tmp_path / "z.csv", first_s=300, n=9))  # makes folders and the day's key
    tried: list[int] = []

    def failing(fd: int) -> None:
        tried.append(os.fstat(fd).st_ino)
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", failing)
        told = vsd(here, "ingest", file)
    assert told.has("E306" if number == errno.EIO else "E304", "  --> ")
    assert len(tried) == len(set(tried)) > 0
    assert (n_stored(here), litter(here)) == (18, [])
    assert vsd(here, "ingest", file).code == 0
    assert (n_stored(here), vsd(here, "verify").code) == (618, 0)


def test_a_folder_whose_sync_fails_holds_nothing_that_was_not_acknowledged(
    here: Path, tmp_path: Path, vsd: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = engine_output(tmp_path / "a.csv")
    vsd(here, "ingest", engine_output(tmp_path / "z.csv", first_s=300, n=9))
    real, spool = os.fsync, (here / "store" / "live" / "observations").stat().st_ino

    def failing(fd: int) -> None:
        if os.fstat(fd).st_ino == spool:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        real(fd)

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", failing)
        assert vsd(here, "ingest", file).has("E306")
    assert not list((here / "store" / "live").rglob("*.*"))
    assert (vsd(here, "ingest", file).code, n_stored(here)) == (0, 618)


def damaged_ways(data: bytes, n_flips: int) -> Iterator[bytes]:
    """Yield a part with one flipped bit at some places, and empty, and without its last byte."""
    for bit in range(0, len(data) * 8, len(data) * 8 // n_flips):
        changed = bytearray(data)
        changed[bit // 8] ^= 1 << bit % 8
        yield bytes(changed)
    yield from (data[:n] for n in (0, len(data) - 1))


@pytest.mark.parametrize("n_flips", [3, 12])
def test_no_figure_is_made_from_a_damaged_part_and_no_record_put_beside_it(
    here: Path, tmp_path: Path, vsd: Vsd, n_flips: int
) -> None:
    vsd(here, "ingest", engine_output(tmp_path / "a.csv"))
    before = vsd(here, *HOURS)
    late = engine_output(tmp_path / "b.csv", first_s=400, n=9)
    (part,) = parts(here)
    data = part.read_bytes()
    for changed in damaged_ways(data, n_flips):
        part.write_bytes(changed)
        shutil.rmtree(here / "facts", ignore_errors=True)
        for command in (("build",), HOURS, ("ingest", late)):
            told = vsd(here, *command)
            assert told.has("E302", str(part), "the disk or a program changed them", "restore it from a backup")
        (finding,) = verify(load_site(here)).damages
        assert finding.path == part
    part.write_bytes(data)
    assert vsd(here, *HOURS).code == 0
    assert "18 person records" in vsd(here, "ingest", late).out
    assert (n_stored(here), vsd(here, "verify").code) == (618, 0)
    assert before.code == 0


def test_a_part_cut_off_after_its_facts_were_computed_is_named_by_every_command_that_opens_it(
    here: Path, tmp_path: Path, vsd: Vsd
) -> None:
    week = ("--week", "2026-W46")
    vsd(here, "ingest", engine_output(tmp_path / "a.csv"))
    assert vsd(here, "report", *week).code == 0  # from here on facts are fresh
    (part,) = parts(here)
    data = part.read_bytes()
    hour = ("--range", "2026-11-09T08:00..2026-11-09T11:00")
    commands = (
        ("report", *week),
        ("planner", "--exact", *week),
        ("purge", "--older-than", "2026-11-12", "--dry-run", "--force"),
        ("purge", "--camera", "cam", *hour, "--dry-run", "--force"),
        ("export", "--out", tmp_path / "all.jsonl"),
    )
    for changed, some in ((b"", commands), (data[:-1], commands[2:])):
        part.write_bytes(changed)
        for command in some:
            assert vsd(here, *command).has("E302", str(part), "restore it from a backup"), command


def test_a_damaged_part_moved_away_is_ingested_again(here: Path, tmp_path: Path, vsd: Vsd) -> None:
    vsd(here, "ingest", engine_output(tmp_path / "a.csv"))
    (part,) = parts(here)
    data = part.read_bytes()
    part.write_bytes(data[:-1])
    assert vsd(here, "verify").code == 1
    shutil.move(part, tmp_path / "away.parquet")
    assert "600 new records" in vsd(here, "ingest", tmp_path / "a.csv").out
    assert parts(here) == [part]
    assert part.read_bytes() == data
    assert vsd(here, "verify").code == 0


@pytest.mark.parametrize("n_flips", [3, 12])
def test_one_flipped_bit_in_the_spool_stops_the_fold_and_is_named(
    here: Path, tmp_path: Path, vsd: Vsd, stopped_before_the_fold: Callable[[Path, Path, Vsd], None], n_flips: int
) -> None:
    stopped_before_the_fold(here, engine_output(tmp_path / "a.csv"), vsd)
    (segment,) = (here / "store" / "live").rglob("*.arrow")
    data = segment.read_bytes()
    for changed in damaged_ways(data, n_flips):
        segment.write_bytes(changed)
        for command in (("build",), HOURS, ("ingest", engine_output(tmp_path / "b.csv", first_s=400, n=9))):
            assert vsd(here, *command).has("E302", str(segment), "ingest their source again")
        (finding,) = verify(load_site(here)).damages
        assert finding.path == segment
    segment.write_bytes(data)
    assert (vsd(here, "build").code, n_stored(here), vsd(here, "verify").code) == (0, 618, 0)


def test_a_foreign_file_among_the_parts_disturbs_nothing_and_is_named(here: Path, tmp_path: Path, vsd: Vsd) -> None:
    vsd(here, "ingest", engine_output(tmp_path / "a.csv"))
    before = vsd(here, *HOURS)
    (part,) = parts(here)
    strangers = [part.with_name("junk.txt"), part.with_name("junk.parquet"), part.with_name(f"{part.stem} (2).parquet")]
    for path in strangers:
        path.write_bytes(b"not Parquet")
    shutil.rmtree(here / "facts")
    assert vsd(here, "build").code == 0
    assert vsd(here, *HOURS) == before
    assert "0 new records" in vsd(here, "ingest", tmp_path / "a.csv").out
    assert sorted(f.path for f in verify(load_site(here)).damages) == sorted(strangers)
    told = vsd(here, "verify")
    assert told.code == 1
    assert told.err.count("damaged[E307]: a file that does not belong there") == 3
    for path in strangers:
        path.unlink()
    assert vsd(here, "verify").code == 0


def test_ballast_is_taken_with_plenty_of_room_alone_and_given_back_when_set_to_nothing(
    here: Path, tmp_path: Path, vsd: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    vsd(here, "ingest", engine_output(tmp_path / "a.csv", n=2000))
    root = here / "store"
    with monkeypatch.context() as patched:
        patched.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=99_999))
        Store(root, site_id="shop", ballast_mb=0.01).fold()
        assert not (root / ".ballast").exists()
    Store(root, site_id="shop", ballast_mb=0.01).fold()
    Store(root, site_id="shop").fold()
    assert (root / ".ballast").stat().st_size == 10_000
    assert vsd(here, "verify").code == 0
    Store(root, site_id="shop", ballast_mb=0).fold()
    assert not (root / ".ballast").exists()
