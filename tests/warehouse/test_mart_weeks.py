"""Rows of marts in week files: the same as computed at once, computed again only where what they depend on changed."""

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
from retention.aged_projects import as_an_older_version_sealed
from warehouse.small_projects import FACTS_WITHOUT_AREAS, HOUR, Frame, Person, beats, make_site, put

from vsd_analytics.errors import StoreError
from vsd_analytics.retention.purge import Terms, purge_older, purge_range
from vsd_analytics.site.model import Area, Camera, Site
from vsd_analytics.store import durable
from vsd_analytics.warehouse import day_files as day_files_module
from vsd_analytics.warehouse import sources
from vsd_analytics.warehouse import week_files as week_files_module
from vsd_analytics.warehouse.analyst_query import run_query
from vsd_analytics.warehouse.day_files import FOLDER as DAYS_FOLDER
from vsd_analytics.warehouse.day_files import relations_stored_by_day
from vsd_analytics.warehouse.sources import _empty
from vsd_analytics.warehouse.sqlfiles import Relation, relations
from vsd_analytics.warehouse.verify_facts import verify
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS

KEPT = [r.name for r in relations_stored_by_day() if r.layer == "marts"]
SOME = ("camera_hours", "episodes", "area_hours", "together_days")
"""Marts of each way to be stored by day, for tests of what holds for all marts alike."""
OF_SEALED = [r.name for r in relations_stored_by_day() if r.layer == "facts"]
WEEK = timedelta(days=7)
FOLDER = Path("facts", WEEKS)
CAMERAS = [
    Camera("left", "Left", "ground", hz=0.5, view=((0, 0), (7, 0), (7, 10), (0, 10))),
    Camera("right", "Right", "ground", hz=0.5, view=((3, 0), (10, 0), (10, 10), (3, 10))),
]
AREAS = (Area("door", "Door", "ground", ((0, 0), (5, 0), (5, 5), (0, 5))),)
FIRST, LAST = date(2026, 3, 23), date(2026, 4, 5)  # two weeks; the clocks of Rome change on 29 March
SEEN = [date(2026, 3, 26) + timedelta(days=k) for k in range(6)]
"""Days with people."""
ZONES = ["Europe/Rome", "Asia/Kathmandu", "Australia/Lord_Howe"]


def crowd(seed: int, zone: str) -> list[Person | Frame]:
    """Return five people who walk about for a minute around midnight, the start of the site day, and noon."""
    found: list[Person | Frame] = []
    rng = np.random.default_rng(seed)
    for k, day in enumerate(SEEN):
        for hour in (0, 4, 12):
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
    rows(site_of(root))
    return root


@pytest.fixture
def project(stored: Path, tmp_path: Path) -> Site:
    return site_of(Path(shutil.copytree(stored, tmp_path / "shop")))


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[date, date]]:
    """Return the first and last day of all days that are computed from now on, in order."""
    found: list[tuple[date, date]] = []
    compute = Warehouse._rows_of_days

    def noted(warehouse: Warehouse, marts: Sequence[Relation], first: date, last: date) -> object:
        found.append((first, last))
        return compute(warehouse, marts, first, last)

    monkeypatch.setattr(Warehouse, "_rows_of_days", noted)
    return found


def rows(
    site: Site, names: Sequence[str] = KEPT, *, first: date = FIRST, last: date = LAST, uses_days: bool = True
) -> dict[str, tuple[str, list]]:
    """Return types and rows of relations that are stored by day."""
    with Warehouse(site, first, last, uses_days=uses_days) as warehouse:
        # one after the other, each would open a warehouse for each run of days to compute
        warehouse.prepare(" ".join(names))
        tables = {name: warehouse.table(f"select * from {name}") for name in names}
        return {name: (str(table.schema), table.to_pylist()) for name, table in tables.items()}


def files(site: Site) -> dict[str, int]:
    """Return when each file of a mart was written."""
    root = site.root / FOLDER
    written = {str(p.relative_to(root)): p.stat().st_mtime_ns for p in root.rglob("*.parquet")}
    return {name: at for name, at in written.items() if name.split("/")[0] in KEPT}


def of_sealed(site: Site) -> list[str]:
    """Return the files of days with sealed hours."""
    root = site.root / DAYS_FOLDER
    return [str(p.relative_to(root)) for p in root.rglob("*.parquet")]


def never(*args: object, **options: object) -> None:
    raise AssertionError("a mart was computed")


@pytest.mark.parametrize("zone", ZONES)
def test_weeks_have_the_rows_of_the_whole_range(zone: str, tmp_path: Path) -> None:
    """Whichever weeks were stored before, or parts of a week."""
    site = site_of(tmp_path, zone)
    put(site, crowd(ZONES.index(zone), zone))
    at_once = rows(site, uses_days=False)
    assert all(found for _, found in at_once.values())
    for first, last in ((SEEN[1], SEEN[1]), (FIRST + WEEK, LAST)):
        assert rows(site, first=first, last=last) == rows(site, first=first, last=last, uses_days=False)
    kept = rows(site)
    for name in KEPT:
        assert kept[name] == at_once[name], name
    assert rows(site) == kept


def test_a_week_is_computed_once(project: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    before = files(project)
    assert len(before) == 2 * len(KEPT)
    with Warehouse(project, FIRST, LAST) as warehouse:
        monkeypatch.setattr(warehouse._sources, "_rows_of_days", never)
        warehouse.materialise(*KEPT)
    assert files(project) == before


def test_weeks_while_a_place_is_closed_are_computed_once_until_late_records_come(
    project: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed = FIRST - timedelta(days=4)
    days = {"first": FIRST - WEEK, "last": FIRST + timedelta(days=6)}
    at_once = rows(project, SOME, **days, uses_days=False)
    with monkeypatch.context() as nothing_written:
        nothing_written.setattr(day_files_module, "NEAR_DAYS", 0)
        assert rows(project, SOME, **days) == at_once
        assert not any(f"date={FIRST - WEEK}" in name for name in files(project))
    assert rows(project, SOME, **days) == at_once
    assert any(f"date={FIRST - WEEK}" in name for name in files(project))
    with monkeypatch.context() as nothing_computed:
        nothing_computed.setattr(Warehouse, "_rows_of_days", never)
        assert rows(project, SOME, **days) == at_once
    noon_ms = round(datetime(closed.year, closed.month, closed.day, 12, tzinfo=UTC).timestamp() * 1000)
    put(project, [Frame(noon_ms, "left"), Person(noon_ms, "late", 1000, 1000, "left")])
    now = rows(project, SOME, **days)
    assert now == rows(project, SOME, **days, uses_days=False) != at_once


def test_a_running_week_is_stored_up_to_its_last_records_and_goes_on_with_the_next_day(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, computed: list[tuple[date, date]]
) -> None:
    """A range that begins after the first records or ends before the last ones stores no part of a week.

    It reads what a file has of its days.
    """
    site = site_of(tmp_path)
    put(site, crowd(1, "Europe/Rome"))
    first, last = FIRST + WEEK, SEEN[-1]  # Monday and Tuesday
    for only in (first, last):
        rows(site, SOME, first=only, last=only)
        assert not files(site)
    to_tuesday = rows(site, SOME, first=first, last=last)
    assert {name.split("date=")[1][:10] for name in files(site)} == {str(first)}
    before = files(site)
    with monkeypatch.context() as nothing_computed:
        nothing_computed.setattr(Warehouse, "_rows_of_days", never)
        assert rows(site, SOME, first=first, last=last) == to_tuesday
        monday = rows(site, SOME, first=first, last=first)
    assert files(site) == before
    assert monday == rows(site, SOME, first=first, last=first, uses_days=False)
    computed.clear()
    whole = rows(site, SOME, first=first, last=LAST)
    assert computed == [(last + timedelta(days=1), LAST)]
    assert whole == rows(site, SOME, first=first, last=LAST, uses_days=False)


def test_facts_of_no_records_have_the_types_of_their_files(project: Site) -> None:
    n_files = 0
    with Warehouse(project, FIRST, LAST) as warehouse:
        for name, relation in relations("facts").items():
            for path in [*(project.root / "facts" / name).rglob("*.parquet")][:1]:
                file = warehouse.con.sql(f"select * from read_parquet('{path}', hive_partitioning = false)")
                assert warehouse.con.sql(_empty(relation)).types == file.types, name
                n_files += 1
    assert n_files == 2 + len(FACTS_WITHOUT_AREAS), "camera_days, and area_tracks of the areas that are drawn"


def test_only_days_that_an_older_version_sealed_have_their_facts_once_more_in_one_file(project: Site) -> None:
    """It sealed each hour as a file; the others need no copy, because a day of them is one file already."""

    def facts(*, uses_days: bool) -> dict[str, list[dict[str, object]]]:
        with Warehouse(project, FIRST, LAST, uses_days=uses_days) as warehouse:
            return {name: warehouse.rows(f"select * from {name}") for name in OF_SEALED}

    before = facts(uses_days=True)
    assert not of_sealed(project)
    terms = Terms(now=datetime(2026, 4, 10, tzinfo=UTC), is_forced=True)
    purge_older(project, before=SEEN[3], terms=terms)  # of 29 March no hour is sealed
    assert facts(uses_days=True) == facts(uses_days=False) == before
    assert not of_sealed(project)
    as_an_older_version_sealed(project.root)
    assert facts(uses_days=True) == facts(uses_days=False) == before
    written = {n.split("date=")[1][:10] for n in of_sealed(project)}
    assert written == {"2026-03-25", "2026-03-26", "2026-03-27", "2026-03-28"}
    assert facts(uses_days=True) == before


def test_late_records_renew_the_days_around_them_and_no_other(project: Site, computed: list[tuple[date, date]]) -> None:
    before, was = files(project), rows(project)
    noon = round(datetime(2026, 4, 1, 10, 30, tzinfo=UTC).timestamp() * 1000)
    late = [Person(noon + s * 2000, t, x, 1000, "left") for s in range(60) for t, x in (("m", 1000), ("n", 2000))]
    put(project, [*late, *beats(noon, noon + 120_000, every=2000, camera="left")])
    now = rows(project)
    assert computed == [(date(2026, 3, 31), date(2026, 4, 3))]
    assert len(now["episodes"][1]) == len(was["episodes"][1]) + 1
    assert now == rows(project, uses_days=False)
    after = files(project)
    gone = {name.split("date=")[1][:10] for name in set(before) - set(after)}
    assert gone == {str(FIRST + WEEK)}
    folders = [name.rsplit("/", 1)[0] for name in after]
    assert len(set(folders)) == len(folders)  # the file of before is gone


def test_each_mart_renews_its_own_days_also_where_they_are_computed_one_by_one(
    project: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Late records change days of all marts, opening hours the Sundays of one."""
    noon = round(datetime(2026, 3, 31, 10, 30, tzinfo=UTC).timestamp() * 1000)
    put(project, [Person(noon, "m", 1000, 1000, "left"), *beats(noon, noon + 60_000, every=2000, camera="left")])
    opened = replace(project, opening=[*[[]] * 6, [(600, 720)]])
    monkeypatch.setattr(sources, "PIECE_BYTES", 1)
    now = rows(opened, SOME)
    assert now == rows(opened, SOME, uses_days=False)
    assert rows(opened, SOME) == now


def test_a_changed_area_renews_what_reads_areas_and_nothing_else(project: Site) -> None:
    before = files(project)
    moved = replace(project, areas=(replace(AREAS[0], polygon=((0, 0), (8, 0), (8, 8), (0, 8))),))
    assert rows(moved)["area_hours"][1] != rows(project, uses_days=False)["area_hours"][1]
    renewed = {name.split("/")[0] for name in set(files(moved)) - set(before)}
    assert "area_hours" in renewed
    assert not renewed & {"episodes", "track_days", "coverage", "distances", "gatherings"}


def test_changed_opening_hours_renew_the_weekdays_they_change(project: Site, computed: list[tuple[date, date]]) -> None:
    always = [[(0, 1440)]] * 7
    rows(replace(project, opening=always))
    computed.clear()
    rows(replace(project, opening=[*always[:6], [(600, 720)]]))
    assert {day.weekday() for days in computed for day in days} == {6}  # Sundays


def test_a_disk_that_takes_no_file_costs_time_and_no_rows(project: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    was, before = rows(project, SOME), files(project)
    moved = replace(project, areas=(replace(AREAS[0], polygon=((0, 0), (8, 0), (8, 8), (0, 8))),))

    def full(path: Path, data: bytes, **options: bool) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(week_files_module, "publish", full)
    assert rows(moved, SOME)["area_hours"] == rows(moved, SOME, uses_days=False)["area_hours"]
    assert files(project) == before  # what cannot be replaced stays
    for name in before:
        (project.root / FOLDER / name).unlink()
    assert rows(project, SOME) == was
    assert files(project) == {}
    monkeypatch.setattr(week_files_module, "publish", durable.publish)
    assert rows(project, SOME) == was


@pytest.mark.parametrize("n_bytes", [0, 7, 200])
def test_a_torn_file_is_made_anew(project: Site, n_bytes: int) -> None:
    was = rows(project)
    for path in sorted((project.root / FOLDER / "episodes").rglob("*.parquet")):
        path.write_bytes(path.read_bytes()[:n_bytes])
    assert rows(project) == was


def test_a_file_of_garbage_says_how_to_fix_it(project: Site) -> None:
    path = sorted((project.root / FOLDER / "camera_hours").rglob("*.parquet"))[0]
    path.write_bytes(b"PAR1" + b"\xff" * 50 + (20).to_bytes(4, "little") + b"PAR1")
    with pytest.raises(StoreError, match="facts") as caught:
        rows(project)
    assert (caught.value.code, "delete the folder facts" in str(caught.value.fix)) == ("E302", True)


def test_a_damaged_file_is_reported_to_an_analyst_as_well(project: Site) -> None:
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


def test_what_files_hold_of_purged_records_goes_with_them(project: Site) -> None:
    def told() -> set[str]:
        with Warehouse(project, FIRST, LAST) as warehouse:
            return {r["camera_id"] for r in warehouse.rows("select distinct camera_id from episodes")}

    assert told() == {"left", "right"}
    first = round(datetime(2026, 3, 20, tzinfo=UTC).timestamp() * 1000)
    terms = Terms(now=datetime(2026, 4, 10, tzinfo=UTC), is_forced=True)
    purge_range(project, camera_id="left", first_ms=first, after_ms=first + 24 * 20 * HOUR, terms=terms)
    assert files(project) == {}
    assert told() == {"right"}
