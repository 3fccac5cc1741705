"""Rows stored by day: the same as computed at once, and computed again only where what they depend on changed."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from warehouse.small_projects import FACTS_WITHOUT_AREAS, HOUR, Frame, Person, beats, make_site, put

from vsd_analytics.errors import StoreError
from vsd_analytics.retention.purge import Terms, purge_older, purge_range
from vsd_analytics.site.model import Area, Camera, Site
from vsd_analytics.store import durable
from vsd_analytics.warehouse import day_files as day_files_module
from vsd_analytics.warehouse import sources
from vsd_analytics.warehouse.analyst_query import run_query
from vsd_analytics.warehouse.day_files import FOLDER, relations_stored_by_day
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.verify_facts import verify
from vsd_analytics.warehouse.warehouse import Warehouse

KEPT = [r.name for r in relations_stored_by_day() if r.layer == "marts"]
SOME = ("camera_hours", "episodes", "area_hours", "together_days")
"""Marts of each way to be stored by day, for tests of what holds for all marts alike."""
OF_SEALED = [r.name for r in relations_stored_by_day() if r.layer == "facts"]
CAMERAS = [
    Camera("left", "Left", "ground", hz=0.5, view=((0, 0), (7, 0), (7, 10), (0, 10))),
    Camera("right", "Right", "ground", hz=0.5, view=((3, 0), (10, 0), (10, 10), (3, 10))),
]
AREAS = (Area("door", "Door", "ground", ((0, 0), (5, 0), (5, 5), (0, 5))),)
FIRST, LAST = date(2026, 3, 27), date(2026, 3, 30)  # the clocks of Rome change on the 29th
ZONES = ["Europe/Rome", "Asia/Kathmandu", "Australia/Lord_Howe"]


def crowd(seed: int, zone: str) -> list[Person | Frame]:
    """Return five people who walk about for a minute around midnight, the start of the site day, and noon."""
    found: list[Person | Frame] = []
    rng = np.random.default_rng(seed)
    for k in range(-1, (LAST - FIRST).days + 2):
        for hour in (0, 4, 12):
            day = FIRST + timedelta(days=k)
            middle = datetime(day.year, day.month, day.day, hour, tzinfo=ZoneInfo(zone)).astimezone(UTC)
            start = round(middle.timestamp() * 1000) - 40_000
            xy = rng.uniform(0, 10, (5, 2))
            for i in range(40):
                xy = np.clip(xy + rng.normal(0, 0.25, xy.shape), 0, 10)
                ts = start + i * 2000
                for j, (x, y) in enumerate(xy * 1000):
                    seen = [c for c, low, high in (("left", 0, 7000), ("right", 3000, 10_000)) if low <= x < high]
                    found += [Person(ts, f"{c}-{k}-{hour}-{j}", int(x), int(y), c) for c in seen]
                found += [Frame(ts, c) for c in ("left", "right")]
    return found


def site_of(root: Path, zone: str = "Europe/Rome") -> Site:
    site = make_site(root, timezone=zone, cameras=CAMERAS)
    return replace(site, areas=AREAS)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("days") / "shop"
    put(site_of(root), crowd(1, "Europe/Rome"))
    rows(site_of(root), KEPT)
    return root


@pytest.fixture
def project(stored: Path, tmp_path: Path) -> Site:
    return site_of(Path(shutil.copytree(stored, tmp_path / "shop")))


def rows(
    site: Site, names: Sequence[str] = SOME, *, first: date = FIRST, last: date = LAST, uses_days: bool = True
) -> dict[str, tuple[str, list]]:
    """Return types and rows of relations that are stored by day."""
    with Warehouse(site, first, last, uses_days=uses_days) as warehouse:
        # one after the other, each would open a warehouse for each run of days to compute
        warehouse.prepare(" ".join(names))
        tables = {name: warehouse.table(f"select * from {name}") for name in names}
        return {name: (str(table.schema), table.to_pylist()) for name, table in tables.items()}


def day_files(site: Site) -> dict[str, int]:
    """Return when each day file was written."""
    root = site.root / FOLDER
    return {str(p.relative_to(root)): p.stat().st_mtime_ns for p in root.rglob("*.parquet")}


@pytest.mark.parametrize("zone", ZONES)
def test_days_one_by_one_have_the_rows_of_the_whole_range(zone: str, tmp_path: Path) -> None:
    """Whichever days were stored before: alone, together, or none."""
    site = site_of(tmp_path, zone)
    put(site, crowd(ZONES.index(zone), zone))
    at_once = rows(site, KEPT, uses_days=False)
    assert all(found for _, found in at_once.values())
    assert rows(site, KEPT, first=FIRST + timedelta(days=1), last=FIRST + timedelta(days=1))
    kept = rows(site, KEPT)
    for name in KEPT:
        assert kept[name] == at_once[name], name
    assert rows(site, KEPT) == kept


def test_a_day_is_computed_once(project: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    before = day_files(project)
    assert len({name.split("/")[0] for name in before}) == len(KEPT)

    def never(*args: object, **options: object) -> None:
        raise AssertionError("a mart was computed")

    with Warehouse(project, FIRST, LAST) as warehouse:
        monkeypatch.setattr(warehouse._sources, "_rows_of_days", never)
        warehouse.materialise(*KEPT)
    assert day_files(project) == before


def test_days_while_a_place_is_closed_are_computed_once_until_late_records_come(
    project: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed, first, last = FIRST - timedelta(days=8), FIRST - timedelta(days=12), FIRST
    at_once = rows(project, SOME, first=first, last=last, uses_days=False)
    with monkeypatch.context() as nothing_written:
        nothing_written.setattr(day_files_module, "NEAR_DAYS", 0)
        assert rows(project, SOME, first=first, last=last) == at_once
        assert not any(f"date={closed}" in name for name in day_files(project))
    assert rows(project, SOME, first=first, last=last) == at_once
    assert any(f"date={closed}" in name for name in day_files(project))

    def never(*args: object) -> None:
        raise AssertionError

    with monkeypatch.context() as nothing_computed:
        nothing_computed.setattr(Warehouse, "_rows_of_days", never)
        assert rows(project, SOME, first=first, last=last) == at_once
    noon_ms = round(datetime(closed.year, closed.month, closed.day, 12, tzinfo=UTC).timestamp() * 1000)
    put(project, [Frame(noon_ms, "left"), Person(noon_ms, "late", 1000, 1000, "left")])
    now = rows(project, SOME, first=first, last=last)
    assert now == rows(project, SOME, first=first, last=last, uses_days=False) != at_once


def test_facts_of_no_records_have_the_types_of_their_files(project: Site) -> None:
    n_files = 0
    with Warehouse(project, FIRST, LAST) as warehouse:
        for name, relation in relations("facts").items():
            for path in [*(project.root / "facts" / name).rglob("*.parquet")][:1]:
                file = warehouse.con.sql(f"select * from read_parquet('{path}', hive_partitioning = false)")
                assert warehouse.con.sql(sources._empty(relation)).types == file.types, name
                n_files += 1
    assert n_files == 1 + len(FACTS_WITHOUT_AREAS)


def test_days_with_sealed_hours_have_their_facts_in_one_file(project: Site) -> None:
    """Sealed facts are a file for each hour; the others need no copy, because a day of them is one file already."""

    def facts(*, uses_days: bool) -> dict[str, list[dict[str, object]]]:
        with Warehouse(project, FIRST, LAST, uses_days=uses_days) as warehouse:
            return {name: warehouse.rows(f"select * from {name}") for name in OF_SEALED}

    before = facts(uses_days=True)
    assert not [n for n in day_files(project) if n.split("/")[0] in OF_SEALED]
    terms = Terms(now=datetime(2026, 4, 10, tzinfo=UTC), is_forced=True)
    purge_older(project, before=FIRST + timedelta(days=2), terms=terms)  # of 29 March no hour is sealed
    assert facts(uses_days=True) == facts(uses_days=False) == before
    written = [n for n in day_files(project) if n.split("/")[0] in OF_SEALED]
    assert {n.split("date=")[1][:10] for n in written} == {"2026-03-26", "2026-03-27", "2026-03-28"}
    assert facts(uses_days=True) == before


def test_late_records_renew_the_days_around_them_and_no_other(project: Site) -> None:
    before, was = day_files(project), rows(project)
    noon = round(datetime(2026, 3, 30, 10, 30, tzinfo=UTC).timestamp() * 1000)
    late = [Person(noon + s * 2000, t, x, 1000, "left") for s in range(60) for t, x in (("m", 1000), ("n", 2000))]
    put(project, [*late, *beats(noon, noon + 120_000, every=2000, camera="left")])
    now = rows(project)
    assert len(now["episodes"][1]) == len(was["episodes"][1]) + 1
    assert now == rows(project, uses_days=False)
    after = day_files(project)
    gone = {name.split("date=")[1][:10] for name in set(before) - set(after)}
    assert gone <= {"2026-03-29", "2026-03-30", "2026-03-31"}
    assert "2026-03-30" in gone
    folders = [name.rsplit("/", 1)[0] for name in after]
    assert len(set(folders)) == len(folders)  # the file of before is gone


def test_a_changed_area_renews_what_reads_areas_and_nothing_else(project: Site) -> None:
    before = day_files(project)
    moved = replace(project, areas=(replace(AREAS[0], polygon=((0, 0), (8, 0), (8, 8), (0, 8))),))
    others = ("episodes", "track_days", "coverage", "distances", "gatherings")
    asked = ("area_hours", *others)
    assert rows(moved, asked)["area_hours"][1] != rows(project, asked, uses_days=False)["area_hours"][1]
    renewed = {name.split("/")[0] for name in set(day_files(moved)) - set(before)}
    assert "area_hours" in renewed
    assert not renewed & {*others}


def test_changed_opening_hours_renew_the_weekdays_they_change(project: Site) -> None:
    before = day_files(project)
    always = [[(0, 1440)]] * 7
    opened = replace(project, opening=[*always[:6], [(600, 720)]])
    rows(replace(project, opening=always))
    between = day_files(project)
    rows(opened)
    renewed = {n.split("date=")[1][:10] for n in set(day_files(opened)) - set(between) if n.startswith("camera_hours/")}
    assert renewed == {"2026-03-29"}  # the Sunday
    assert set(before) != set(between)


def test_a_disk_that_takes_no_day_file_costs_time_and_no_rows(project: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    was, before = rows(project, SOME), day_files(project)
    moved = replace(project, areas=(replace(AREAS[0], polygon=((0, 0), (8, 0), (8, 8), (0, 8))),))

    def full(path: Path, data: bytes, **options: bool) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(sources, "publish", full)
    assert rows(moved, SOME)["area_hours"] == rows(moved, SOME, uses_days=False)["area_hours"]
    assert day_files(project) == before  # what cannot be replaced stays
    shutil.rmtree(project.root / FOLDER)
    assert rows(project, SOME) == was
    assert day_files(project) == {}
    monkeypatch.setattr(sources, "publish", durable.publish)
    assert rows(project, SOME) == was


def test_a_torn_day_file_is_made_anew(project: Site) -> None:
    was = rows(project)
    paths = sorted((project.root / FOLDER / "episodes").rglob("*.parquet"))
    for path, n_bytes in zip(paths, (0, 7, 200), strict=False):
        path.write_bytes(path.read_bytes()[:n_bytes])
    assert len(paths) >= 3
    assert rows(project) == was


def test_a_day_file_of_garbage_says_how_to_fix_it(project: Site) -> None:
    path = sorted((project.root / FOLDER / "camera_hours").rglob("*.parquet"))[0]
    path.write_bytes(b"PAR1" + b"\xff" * 50 + (20).to_bytes(4, "little") + b"PAR1")
    with pytest.raises(StoreError, match="facts") as caught:
        rows(project)
    assert (caught.value.code, "delete the folder facts" in str(caught.value.fix)) == ("E302", True)


def test_a_damaged_day_file_is_reported_to_an_analyst_as_well(project: Site) -> None:
    path = sorted((project.root / FOLDER / "episodes").rglob("*.parquet"))[-1]
    path.write_bytes(b"PAR1" + b"\xff" * 50 + (20).to_bytes(4, "little") + b"PAR1")
    with Warehouse(project, FIRST, LAST) as warehouse, pytest.raises(StoreError) as caught:
        run_query(warehouse, "select sum(duration_s) from episodes")
    assert caught.value.code == "E302"


def test_a_relation_that_could_not_be_stored_is_there_for_the_next_question(project: Site) -> None:
    with Warehouse(project, FIRST, LAST) as warehouse:
        path = sorted((project.root / FOLDER / "episodes").rglob("*.parquet"))[-1]
        whole = path.read_bytes()
        n = warehouse.rows("select count(*) as n from episodes")
        path.write_bytes(b"PAR1" + b"\xff" * 50 + (20).to_bytes(4, "little") + b"PAR1")
        with pytest.raises(StoreError):
            warehouse.materialise("episodes")
        path.write_bytes(whole)
        assert warehouse.rows("select count(*) as n from episodes") == n


def test_what_a_killed_process_left_half_written_is_swept(project: Site) -> None:
    path = sorted((project.root / FOLDER / "episodes").rglob("*.parquet"))[0]
    torn = path.with_name(f".{path.name}.4194999.tmp")
    torn.write_bytes(path.read_bytes()[:100])
    path.unlink()
    assert verify(project).is_whole
    rows(project)
    assert path.is_file()
    assert not torn.exists()


def test_verify_tells_of_a_flipped_bit_and_of_a_file_under_another_name(project: Site) -> None:
    assert verify(project).is_whole
    path = sorted((project.root / FOLDER / "episodes").rglob("*.parquet"))[0]
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + bytes([whole[len(whole) // 2] ^ 1]) + whole[len(whole) // 2 + 1 :])
    assert [f.path for f in verify(project).damages] == [path]
    path.write_bytes(whole)
    other = sorted((project.root / FOLDER / "episodes").rglob("*.parquet"))[1]
    other.write_bytes(whole)
    assert [f.path for f in verify(project).damages] == [other]


def test_what_day_files_hold_of_purged_records_goes_with_them(project: Site) -> None:
    def told() -> set[str]:
        with Warehouse(project, FIRST, LAST) as warehouse:
            return {r["camera_id"] for r in warehouse.rows("select distinct camera_id from episodes")}

    assert told() == {"left", "right"}
    first = round(datetime(2026, 3, 20, tzinfo=UTC).timestamp() * 1000)
    terms = Terms(now=datetime(2026, 4, 10, tzinfo=UTC), is_forced=True)
    purge_range(project, camera_id="left", first_ms=first, after_ms=first + 24 * 20 * HOUR, terms=terms)
    assert day_files(project) == {}
    assert told() == {"right"}
