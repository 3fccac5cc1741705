"""`published/current`: whoever reads it by a glob sees the facts of one build whole, or an error; never double rows."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path

import duckdb
import pytest
from warehouse.small_projects import DAY, T0, Person, Site, beats, make_site, put

from vsd_analytics.retention.purge import Terms, purge_older, purge_range
from vsd_analytics.store import published
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.warehouse import Warehouse

N_DAYS = 3
NEAR, FAR = 2.0, 5.0
BUILDS = """
import sys
sys.path[:0] = sys.argv[2:]
from pathlib import Path
from warehouse.test_published_facts import FAR, NEAR, shop
from vsd_analytics.warehouse.build import build

print("ready", flush=True)
for n in range(1000):
    build(shop(Path(sys.argv[1]), FAR if n % 2 else NEAR), is_published=True)
"""


def shop(root: Path, pair_max_m: float = NEAR) -> Site:
    """Return a shop; another `pair_max_m` makes the distances of all days stale, and gives each other rows."""
    return make_site(root, pair_max_m=pair_max_m)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a site with two people 1 m apart and one 3 m off, a few seconds on each of some days."""
    site = shop(tmp_path_factory.mktemp("published") / "shop")
    for day in range(N_DAYS):
        t = T0 + day * DAY
        places = (("a", 0), ("b", 1000), ("c", 4000))
        people = [Person(t + s * 1000, who, x, 0) for s in range(10 + day) for who, x in places]
        put(site, [*people, *beats(t, t + 60_000)])
    build(site, is_published=True)
    return site.root


@pytest.fixture
def root(built: Path, tmp_path: Path) -> Path:
    """Return a copy of the site: all links below `published/` are relative."""
    return Path(shutil.copytree(built, tmp_path / "shop", symlinks=True))


def by_day(folder: Path, fact: str = "distance_times") -> dict[int, int]:
    """Return the rows of a fact by UTC day, as any program reads them: by a glob."""
    query = f"select hour // 24, count(*) from read_parquet('{folder}/{fact}/*.parquet') group by 1"
    return dict(duckdb.connect().execute(query).fetchall())


def states(root: Path) -> list[dict[int, int]]:
    """Return what a reader may see: the distances of either setting."""
    found = []
    for most in (FAR, NEAR):
        build(shop(root, most), is_published=True)
        found.append(by_day(root / "published" / "current"))
    assert [len(s) for s in found] == [N_DAYS, N_DAYS]
    assert all(found[0][d] > found[1][d] for d in found[0])
    return found


@contextmanager
def reader(look: Callable[[], dict[int, int]]) -> Iterator[tuple[list[dict[int, int]], list[str]]]:
    """Look again and again in another thread; yield what it saw, and its errors."""
    seen: list[dict[int, int]] = []
    errors: list[str] = []
    is_over = threading.Event()

    def run() -> None:
        while not is_over.is_set():
            try:
                seen.append(look())
            except duckdb.IOException as error:
                errors.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield seen, errors
    finally:
        is_over.set()
        thread.join()


def test_readers_during_rebuilds_see_one_build_whole_and_with_the_lock_never_an_error(root: Path) -> None:
    allowed = states(root)
    current = root / "published" / "current"

    def with_lock() -> dict[int, int]:
        fd = os.open(root / "facts", os.O_RDONLY)
        try:
            fcntl.flock(fd, fcntl.LOCK_SH)  # as flock(1) does
            return by_day(current.resolve())
        finally:
            os.close(fd)

    with reader(lambda: by_day(current)) as (plain, refused), reader(with_lock) as (careful, errors):
        for n in range(4):
            build(shop(root, FAR if n % 2 else NEAR), is_published=True)
            before = len(careful)
            while len(careful) == before and not errors:
                time.sleep(0.005)
    assert errors == []
    assert [s for s in [*plain, *careful] if s not in allowed] == []
    assert all(state in careful for state in allowed)
    assert all("No such file" in r or "No files found" in r for r in refused)


def test_a_killed_build_leaves_one_build_to_readers(root: Path) -> None:
    allowed = states(root)
    command = [sys.executable, "-c", BUILDS, root, Path(__file__).parents[1]]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=os.environ) as building:
        assert building.stdout is not None
        building.stdout.readline()
        time.sleep(0.5)
        os.kill(building.pid, signal.SIGKILL)
    assert by_day(root / "published" / "current") in allowed
    build(shop(root), is_published=True)
    assert by_day(root / "published" / "current") == allowed[1]
    assert len(list((root / "published").iterdir())) == 2  # the current generation and its name


class Stop(BaseException):
    """The process ends here."""


def test_a_stop_at_any_step_leaves_the_old_generation_or_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new = (
        [tmp_path / "facts" / "pairs" / "site=s" / f"date=2026-11-{d:02}" / f"00-{name}.parquet" for d in (9, 10)]
        for name in ("old", "new")
    )
    for path in [*old, *new]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(path.name)
    n_left = [10**9]

    def stopping(step: Callable[..., object]) -> Callable[..., object]:
        def run(*given: object) -> object:
            if not n_left[0]:
                raise Stop
            n_left[0] -= 1
            return step(*given)

        return run

    for name in ("symlink_to", "rename"):
        monkeypatch.setattr(Path, name, stopping(getattr(Path, name)))
    monkeypatch.setattr(published, "fsync_dir", stopping(published.fsync_dir))
    for n in range(100):
        n_left[0] = 10**9
        assert published.publish_links(tmp_path, {"pairs": old})
        published.sweep_generations(tmp_path)
        assert len(list((tmp_path / "published").iterdir())) == 2
        n_left[0] = n
        try:
            published.publish_links(tmp_path, {"pairs": new})
        except Stop:
            files = sorted(p.read_text() for p in (tmp_path / "published" / "current" / "pairs").iterdir())
            assert files in (["00-old.parquet"] * 2, ["00-new.parquet"] * 2)
            continue
        break
    assert 5 < n < 100
    assert published.published_files(tmp_path) == {p.relative_to(tmp_path) for p in new}


def test_a_report_removes_no_file_that_is_published(root: Path) -> None:
    before = by_day(root / "published" / "current")
    with Warehouse(shop(root, FAR), date(2026, 11, 9), date(2026, 11, 9)) as warehouse:
        warehouse.materialise("episodes")
    assert by_day(root / "published" / "current") == before
    build(shop(root, FAR), is_published=True)
    assert len(list((root / "facts" / "distance_times").rglob("*.parquet"))) == N_DAYS


def test_a_full_disk_leaves_the_old_generation(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = by_day(root / "published" / "current")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(published, "_write", full)
        assert build(shop(root, FAR), is_published=True).n_built
    assert by_day(root / "published" / "current") == before


def test_other_settings_of_the_environment_publish_nothing(root: Path) -> None:
    generation = os.readlink(root / "published" / "current")
    site = shop(root)
    other = replace(site, settings=site.settings.with_values({"pair_max_m": FAR}), own_settings=site.settings)
    build(other, is_published=True)
    assert os.readlink(root / "published" / "current") == generation


def test_a_purge_withdraws_what_is_published_and_the_next_build_publishes_what_remains(root: Path) -> None:
    site, now = shop(root), datetime(2026, 11, 16, tzinfo=UTC)
    everything = by_day(root / "published" / "current")
    terms = Terms(now=now, is_forced=True)
    copied = Path(shutil.copytree(root, root.parent / "copied"))  # a copy that has files in the place of links
    for project in (root, copied):
        purge_range(replace(site, root=project), camera_id="cam", first_ms=T0, after_ms=T0 + DAY // 2, terms=terms)
        assert list((project / "published").iterdir()) == []
    build(site, is_published=True)
    first = min(everything)
    remaining = {d: n for d, n in everything.items() if d != first}
    current = root / "published" / "current"
    assert by_day(current) == remaining
    sealed = by_day(current, "exposure")
    purge_older(site, before=date(2026, 11, 11), terms=terms)
    build(site, is_published=True)
    assert by_day(current, "exposure") == sealed  # of days whose records are gone
    assert by_day(current) == remaining


def test_a_build_takes_the_place_of_a_copy_that_has_files_for_links(root: Path) -> None:
    copied = Path(shutil.copytree(root, root.parent / "copied"))
    build(shop(copied, FAR), is_published=True)
    assert os.readlink(copied / "published" / "current")
    assert len(by_day(copied / "published" / "current")) == N_DAYS
