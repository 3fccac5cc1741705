"""A build whose days are computed elsewhere has the files of one that computes everything here."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from benchmarks import made_up_site
from warehouse.small_projects import FACTS_WITHOUT_AREAS

from vsd_analytics.cluster.workers import workers
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.site.model import Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.distributed import Work

N_FACTS = 1 + len(FACTS_WITHOUT_AREAS)
Files = Mapping[str, bytes]


def tree(root: Path) -> dict[str, bytes]:
    """Return the bytes of all files below a folder."""
    return {str(p.relative_to(root)): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def facts(site: Site) -> dict[str, bytes]:
    return {name: data for name, data in tree(site.root / "facts").items() if name.endswith(".parquet")}


@pytest.fixture(scope="module")
def three_days(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with three days of one camera, an hour each, without facts."""
    root = tmp_path_factory.mktemp("three") / "project"
    root.mkdir()
    return made_up_site.write_site(root, n_records=9_000, n_cameras=1, open_h=1, interval_s=5).root


def copy(project: Path, to: Path) -> Site:
    shutil.copytree(project, to)
    return load_site(to, environ={})


def elsewhere(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Files]]:
    """Run each unit twice, the last day first, from pickles as another process would; nothing may be written there."""
    for day in reversed(days):
        sent = pickle.dumps((work, site, day))
        before = tree(site.root)
        results = []
        for _ in range(2):
            there, its_site, its_day = pickle.loads(sent)
            results.append(there(its_site, its_day))
        assert results[0] == results[1]
        assert tree(site.root) == before
        yield day, pickle.loads(pickle.dumps(results[0]))


def test_files_are_byte_for_byte_those_of_a_local_build_also_after_late_records(
    three_days: Path, tmp_path: Path
) -> None:
    here, there = copy(three_days, tmp_path / "here"), copy(three_days, tmp_path / "there")
    n_hours: list[int] = []
    assert build(there, distributed=elsewhere, on_hours=n_hours.append).reasons == build(here).reasons == {"new": 3}
    assert facts(there) == facts(here)
    assert len(facts(here)) == 3 * N_FACTS
    assert sum(n_hours) == 3
    for site in (here, there):  # an hour beside the first one of two days, whose other rows are used again
        store = Store(site.root / "store", site_id=site.site_id)
        for day in (0, 1):
            store.append("observations", part_of_second_hour(day))
        store.fold()
    assert build(there, distributed=elsewhere).reasons == build(here).reasons
    assert facts(there) == facts(here)


def part_of_second_hour(day: int) -> pa.Table:
    start_ms = made_up_site.FIRST_MS + made_up_site.DAY_MS * day + 3_600_000
    return dict(made_up_site.camera_hour(np.random.default_rng(day), 0, start_ms, most=1000))["observations"]


def test_a_worker_that_computes_other_facts_publishes_nothing(three_days: Path, tmp_path: Path) -> None:
    site = copy(three_days, tmp_path / "project")

    def other_version(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Files]]:
        for day in days:
            yield day, {f"{name}x": data for name, data in work(site, day).items()}

    with pytest.raises(StoreError) as caught:
        build(site, distributed=other_version)
    assert caught.value.code == "E315"
    assert facts(site) == {}


def test_a_stopped_run_leaves_the_days_that_were_done_and_the_next_one_computes_the_others(
    three_days: Path, tmp_path: Path
) -> None:
    site, asked = copy(three_days, tmp_path / "project"), list[tuple[str, int]]()

    def stopping(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Files]]:
        for day in days:
            if work.__name__ == "hour_work" and day == days[-1]:
                raise KeyboardInterrupt
            yield day, work(site, day)

    def noting(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Files]]:
        asked.extend((work.__name__, day) for day in days)
        yield from ((day, work(site, day)) for day in days)

    with pytest.raises(KeyboardInterrupt):
        build(site, distributed=stopping)
    done = facts(site)
    assert len(done) == 2 * N_FACTS + 1
    assert build(site, distributed=noting).reasons == {"new": 1}
    assert asked == []  # one day alone is computed here
    assert done.items() <= facts(site).items()
    assert facts(site) == facts(rebuilt(site, tmp_path / "again"))


def test_days_with_most_hours_to_compute_are_handed_out_first(three_days: Path, tmp_path: Path) -> None:
    site, asked = copy(three_days, tmp_path / "project"), dict[str, list[int]]()
    store = Store(site.root / "store", site_id=site.site_id)
    store.append("observations", part_of_second_hour(1))
    store.fold()

    def noting(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Files]]:
        asked[work.__name__] = list(days)
        yield from elsewhere(work, site, days)

    build(site, distributed=noting)
    first, second, third = asked["day_work"]
    assert asked["hour_work"] == [second, first, third]


def rebuilt(site: Site, to: Path) -> Site:
    again = copy(site.root, to)
    shutil.rmtree(to / "facts")
    build(again)
    return again


def test_dask_workers_in_processes_of_their_own_make_the_same_files(three_days: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    here, there = copy(three_days, tmp_path / "here"), copy(three_days, tmp_path / "there")
    build(here)
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        workers(cluster.scheduler_address) as distributed,
    ):
        assert build(there, distributed=distributed).reasons == {"new": 3}
    assert facts(there) == facts(here)


@pytest.mark.parametrize("address", ["http://localhost:8786", "localhost", ""])
def test_an_address_of_no_engine_is_refused(address: str) -> None:
    with pytest.raises(UsageError, match="--on cannot use"), workers(address):
        pass


def test_an_address_where_nobody_answers_ends_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    from vsd_analytics.cluster import dask_workers

    monkeypatch.setattr(dask_workers, "TIMEOUT_S", 1)
    with pytest.raises(StoreError) as caught, workers("tcp://127.0.0.1:9"):
        pass
    assert caught.value.code == "E316"
