"""Week files of facts: they take the place of the files of their days, and nothing but the number of files differs."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from warehouse.small_projects import Frame, Person, make_site, put

from vsd_analytics.retention.purge import Terms, purge_older, purge_range
from vsd_analytics.site.model import Site
from vsd_analytics.store.own_digest import DIGEST
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse import fact_weeks
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.camera_days import day_units, read_days
from vsd_analytics.warehouse.fact_weeks import FactWeeks, day_bytes_of, fingerprints
from vsd_analytics.warehouse.factfiles import fact_bytes
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.units import PartIndex
from vsd_analytics.warehouse.verify_facts import verify
from vsd_analytics.warehouse.warehouse import Warehouse

MONDAY = date(2026, 3, 16)
N_DAYS = 22
"""Two weeks are over, and the Monday after the third has begun."""
JOINED = [MONDAY, MONDAY + timedelta(days=7)]
CLOSED = MONDAY + timedelta(days=6)
"""A Sunday of the first week, without records."""
PURGED = MONDAY + timedelta(days=9)
TERMS = Terms(now=datetime(2026, 4, 20, tzinfo=UTC), is_forced=True)


def put_day(site: Site, day: date, *, hour: int = 12, minute: int = 0) -> None:
    """Store four people who walk past each other for a minute."""
    start = round(datetime(day.year, day.month, day.day, hour, minute, tzinfo=UTC).timestamp() * 1000)
    found: list[Person | Frame] = []
    for i in range(30):
        found.append(Frame(start + i * 2000))
        walked = ((k, 1000 + 900 * k + (-1) ** k * 40 * i) for k in range(4))
        found += [Person(start + i * 2000, f"{day}-{hour}-{minute}-{k}", x, 1000 + 200 * k) for k, x in walked]
    put(site, found)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("stored") / "shop"
    site = make_site(root)
    for day in (MONDAY + timedelta(days=k) for k in range(N_DAYS)):
        for minute in (0, 30) if day != CLOSED else ():  # two parts share an hour
            put_day(site, day, minute=minute)
    return root


@pytest.fixture(scope="module")
def whole(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with weeks of facts."""
    root = Path(shutil.copytree(stored, tmp_path_factory.mktemp("whole") / "shop"))
    build(make_site(root), is_published=True)
    return root


@pytest.fixture(scope="module")
def apart(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with a file for each fact and day."""
    root = Path(shutil.copytree(stored, tmp_path_factory.mktemp("apart") / "shop"))
    with without_weeks():
        build(make_site(root), is_published=True)
    return root


@contextmanager
def without_weeks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fact_weeks, "BYTES_MAX", 0)
        yield


Copy = Callable[[Path], Site]


@pytest.fixture
def copy(tmp_path: Path) -> Copy:
    def copied(root: Path) -> Site:
        return make_site(Path(shutil.copytree(root, tmp_path / root.parent.name / "shop", symlinks=True)))

    return copied


def weeks(site: Site, name: str = "*") -> list[Path]:
    return sorted((site.root / "facts" / "weeks").glob(f"{name}/*/*/*.parquet"))


def day_files(site: Site) -> dict[str, bytes]:
    """Return the bytes of the file of each fact and day, of those in weeks as they were made for it."""
    found = {}
    facts = site.root / "facts"
    for name in relations("facts"):
        files = FactWeeks(facts, name, site.site_id)
        for path in facts.glob(f"{name}/*/*/*.parquet"):
            found[str(path.relative_to(facts))] = path.read_bytes()
        for week in files.files():
            for day in (day for day, of in fingerprints(week.path).items() if of != fact_weeks.NO_RECORDS):
                path = files._day_path(day, fingerprints(week.path)[day])
                assert not path.exists()
                found[str(path.relative_to(facts))] = day_bytes_of(week.path, name, day)
    return found


def published(site: Site) -> dict[str, list[Any]]:
    """Return the rows that other programs read of each fact."""
    found = {}
    for folder in sorted((site.root / "published" / "current").iterdir()):
        tables = [pq.ParquetFile(path).read().replace_schema_metadata() for path in sorted(folder.iterdir())]
        found[folder.name] = pa.concat_tables(tables).to_pylist()
    return found


def counts(result: BuildResult) -> tuple[dict[str, int], dict[str, int], int]:
    return dict(result.reasons), dict(result.facts), result.n_fresh


def test_weeks_that_are_over_take_the_place_of_their_days_and_no_byte_differs(whole: Path, apart: Path) -> None:
    one, other = make_site(whole), make_site(apart)
    names = {path.parts[-4] for path in weeks(one)}
    assert names >= {"camera_days", "coverage", "exposure", "same_pairs"}
    for name in names:
        assert [path.parent.name for path in weeks(one, name)] == [f"date={monday}" for monday in JOINED]
        assert len(list((whole / "facts" / name).rglob("*.parquet"))) == N_DAYS - 14
        assert len(list((whole / "published" / "current" / name).iterdir())) == N_DAYS - 14 + 2
    assert not weeks(other)
    assert day_files(one) == day_files(other)
    assert published(one) == published(other)
    assert verify(one).is_whole
    assert not verify(one).notes


def test_a_range_that_cuts_weeks_has_the_same_rows(copy: Copy, whole: Path, apart: Path) -> None:
    first, last = MONDAY + timedelta(days=2), MONDAY + timedelta(days=11)
    names = ("camera_days", "coverage", "exposure", "violation_time", "track_lives")
    found = []
    for root in (whole, apart):
        how = without_weeks() if root == apart else nullcontext()
        with how, Warehouse(copy(root), first, last) as warehouse:
            assert warehouse.built.n_built == 0
            found.append([warehouse.table(f"select * from {name}").to_pylist() for name in names])
    assert found[0] == found[1]
    assert all(found[0])


def known_days(site: Site) -> tuple[dict[int, Any], dict[str, tuple[int, int]]]:
    store = Store(site.root / "store", site_id=site.site_id)
    index = PartIndex(store, first_hour=None, last_hour=None)
    found = read_days(site, day_units(index, index.hours(), site=site))
    spans = {digest: span for day in found.values() for digest, span in day.spans.items()}
    return {n: (d.digest, d.rows.to_pylist(), d.cameras, d.lookback_ms) for n, d in found.items()}, spans


def test_units_of_hours_are_the_same_from_weeks_of_camera_days(whole: Path, apart: Path) -> None:
    found = known_days(make_site(whole))
    assert found == known_days(make_site(apart))
    assert len(found[1]) == 2 * 2 * (N_DAYS - 1)  # frames and observations


def late_records(site: Site) -> None:
    put_day(site, MONDAY + timedelta(days=2), hour=9)
    put_day(site, CLOSED, hour=9)


def camera_purge(site: Site) -> None:
    first = round(datetime(2026, 3, 18, tzinfo=UTC).timestamp() * 1000)
    purge_range(site, camera_id="cam", first_ms=first, after_ms=first + 86_400_000, terms=TERMS)


def purge_by_age(site: Site) -> None:
    purge_older(site, before=PURGED, terms=TERMS)


@pytest.mark.parametrize("change", [late_records, camera_purge, purge_by_age])
def test_after_a_change_the_same_hours_are_computed_and_no_byte_differs(
    change: Callable[[Site], None], copy: Copy, whole: Path, apart: Path
) -> None:
    one, other = copy(whole), copy(apart)
    change(one)
    with without_weeks():
        change(other)
        expected = counts(build(other, is_published=True))
    assert counts(build(one, is_published=True)) == expected
    assert day_files(one) == day_files(other)
    assert published(one) == published(other)
    sealed = [{p.relative_to(s.root): p.read_bytes() for p in (s.root / "sealed").rglob("*.*")} for s in (one, other)]
    assert sealed[0] == sealed[1]
    assert bool(sealed[0]) == (change is purge_by_age)
    of = {path.parent.name for path in weeks(one)}
    assert of == {f"date={monday}" for monday in ([] if change is purge_by_age else JOINED)}
    assert len(weeks(one)) == len(of) * len({path.parts[-4] for path in weeks(one)})
    assert verify(one).is_whole
    assert counts(build(one))[0] == {}


def test_other_settings_make_weeks_of_their_own_stale_and_give_the_reason(copy: Copy, whole: Path) -> None:
    site = copy(whole)
    before = weeks(site)
    other = make_site(site.root, distance_m=1.0)
    assert set(build(other, is_published=True).reasons) == {"settings changed"}
    assert len(weeks(site)) == len(before)
    shared = {path.parts[-4] for path in set(before) & set(weeks(site))}
    assert "coverage" in shared
    assert "violation_time" not in shared


def test_a_worker_gets_the_stale_day_of_a_week_alone(copy: Copy, whole: Path) -> None:
    site, here = copy(whole), make_site(Path(shutil.copytree(whole, whole.parent / "here", symlinks=True)))
    days: list[int] = []

    def elsewhere(work: Any, of: Site, units: Sequence[int]) -> Iterator[tuple[int, Any]]:
        days.extend(units)
        return ((day, work(of, day)) for day in units)

    for project in (site, here):
        late_records(project)
    assert counts(build(site, distributed=elsewhere, is_published=True)) == counts(build(here, is_published=True))
    assert len(set(days)) == 2
    assert published(site) == published(here)
    assert [p.name for p in weeks(site)] == [p.name for p in weeks(here)]


def test_where_the_disk_refuses_the_days_stay_and_a_later_build_joins_them(
    copy: Copy, stored: Path, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*args: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    site = copy(stored)
    with monkeypatch.context() as full:
        full.setattr(fact_weeks, "publish", refused)
        build(site, is_published=True)
        assert not weeks(site)
        assert published(site) == published(make_site(whole))
    assert build(site, is_published=True).n_built == 0
    assert [p.name for p in weeks(site)] == [p.name for p in weeks(make_site(whole))]

    late_records(site)
    with monkeypatch.context() as full:
        full.setattr(fact_weeks, "publish", refused)
        build(site)  # the week is not taken apart: its rows are used again all the same
    expected = copy(whole)
    late_records(expected)
    build(site, is_published=True)
    build(expected, is_published=True)
    assert published(site) == published(expected)


def test_a_fact_whose_week_is_larger_than_the_limit_stays_by_days(
    copy: Copy, apart: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = copy(apart)
    days = {f"date={MONDAY + timedelta(days=k)}" for k in range(7)}
    sizes = {
        name: sum(p.stat().st_size for p in (site.root / "facts" / name).rglob("*.parquet") if p.parent.name in days)
        for name in relations("facts")
    }
    monkeypatch.setattr(fact_weeks, "BYTES_MAX", sizes["exposure"])
    build(site)
    joined = {path.parts[-4] for path in weeks(site) if path.parent.name == f"date={MONDAY}"}
    assert joined == {name for name, size in sizes.items() if 0 < size <= sizes["exposure"]}
    assert joined != {name for name, size in sizes.items() if size}


def test_a_short_week_is_computed_again(copy: Copy, whole: Path) -> None:
    """A power cut can leave one."""
    site = copy(whole)
    for path in weeks(site, "exposure"):
        path.write_bytes(path.read_bytes()[:-20])
    n_hours = len(set(_hours_of(whole, "exposure")))
    assert build(site).facts == {"exposure": n_hours}
    assert day_files(site) == day_files(make_site(whole))


def _hours_of(root: Path, name: str) -> list[int]:
    paths = (root / "facts" / "weeks" / name).rglob("*.parquet")
    return [hour for path in paths for hour in pq.ParquetFile(path).read()["hour"].to_pylist()]


def test_a_damaged_day_gets_into_no_week(copy: Copy, apart: Path) -> None:
    site = copy(apart)
    day = next((site.root / "facts" / "exposure").rglob(f"date={MONDAY}/*.parquet"))
    data = bytearray(day.read_bytes())
    data[data.rindex(DIGEST) + len(DIGEST) + 9] ^= 1  # damage that no reader stumbles over
    day.write_bytes(data)
    build(site)
    assert [path.parent.name for path in weeks(site, "exposure")] == [f"date={JOINED[1]}"]
    assert len(weeks(site, "violation_time")) == 2


def test_verify_finds_a_flipped_bit_and_a_week_under_a_wrong_name(copy: Copy, whole: Path) -> None:
    site = copy(whole)
    one, other = weeks(site, "exposure")
    data = bytearray(one.read_bytes())
    data[len(data) // 2] ^= 1
    one.write_bytes(data)
    assert [f.path for f in verify(site).damages] == [one]
    one.write_bytes(other.read_bytes())
    assert [f.path for f in verify(site).damages] == [one]


def test_days_and_weeks_of_an_older_version_are_used_and_replaced(copy: Copy, whole: Path, apart: Path) -> None:
    """It had a file of each day, and copies of some weeks beside them."""
    site = copy(apart)
    day = next((site.root / "facts" / "coverage").rglob(f"date={MONDAY}/*.parquet"))
    old = site.root / "facts" / "weeks" / "coverage" / day.relative_to(site.root / "facts" / "coverage")
    old.parent.mkdir(parents=True)
    old.write_bytes(fact_bytes(pq.ParquetFile(day).read(), inputs={"file": {"0123456789abcdef": [1]}}))
    assert build(site, is_published=True).n_built == 0
    assert not old.exists()
    assert day_files(site) == day_files(make_site(whole))
    assert published(site) == published(make_site(whole))


def test_a_week_whose_day_lost_its_records_is_written_again(copy: Copy, whole: Path) -> None:
    """Somebody took the files of a day out of the store."""
    site = copy(whole)
    for path in (site.root / "store").rglob(f"date={MONDAY + timedelta(days=3)}/*.parquet"):
        path.unlink()
    build(site, is_published=True)
    day = (MONDAY + timedelta(days=3) - date(1970, 1, 1)).days
    for name, rows in published(site).items():
        assert all(row.get("utc_day", row.get("hour", 0) // 24) != day for row in rows), name
    with Warehouse(site, MONDAY, MONDAY + timedelta(days=9)) as warehouse:
        assert warehouse.rows(f"select * from coverage where hour // 24 = {day}") == []
