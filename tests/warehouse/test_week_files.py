"""Week files: the rows of their seven days, whichever were stored when, and gone with the records they came from."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Sequence
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from warehouse.small_projects import Frame, Person, make_site, put

from vsd_analytics.retention.purge import Terms, purge_older, purge_range
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.warehouse import fact_weeks as fact_weeks_module
from vsd_analytics.warehouse import week_files as week_files_module
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.day_files import relations_stored_by_day
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.verify_facts import verify
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.warehouse.week_files import DAYS, FOLDER

MONDAY = date(2026, 3, 16)
SUNDAY = MONDAY + timedelta(days=20)  # the clocks of Rome change on the 29th
CAMERAS = [Camera("left", "Left", "ground", hz=0.5), Camera("right", "Right", "ground", hz=0.5)]
MARTS = [r.name for r in relations_stored_by_day() if r.layer == "marts"]
FACTS = ["camera_days", "exposure", "floor_cells", "sequence_runs", "violation_time"]
ALL = (*FACTS, *MARTS)
SOME = (*FACTS, "camera_hours", "violations", "together_days")
"""Marts of each way to be stored by day. Only the test of what each mart reads asks for all."""
NOW = datetime(2026, 4, 20, tzinfo=UTC)


def some_minutes(day: date, seed: int, *, hour: int = 12) -> list[Person | Frame]:
    """Return four people who walk about for a minute in view of each camera."""
    rng = np.random.default_rng([seed, day.toordinal(), hour])
    start = round(datetime(day.year, day.month, day.day, hour, tzinfo=UTC).timestamp() * 1000)
    found: list[Person | Frame] = []
    xy = rng.uniform(0, 4, (4, 2))
    for i in range(30):
        xy = np.clip(xy + rng.normal(0, 0.2, xy.shape), 0, 4)
        for camera, beside in (("left", 0), ("right", 9000)):
            ts = start + i * 2000
            found.append(Frame(ts, camera))
            found += [
                Person(ts, f"{camera}-{day}-{hour}-{j}", int(x) + beside, int(y), camera)
                for j, (x, y) in enumerate(xy * 1000)
            ]
    return found


def put_days(site: Site, days: Sequence[date], *, hour: int = 12) -> None:
    put(site, [record for day in days for record in some_minutes(day, 1, hour=hour)])


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with records of most days of three weeks and no facts."""
    root = tmp_path_factory.mktemp("weeks") / "shop"
    put_days(make_site(root, timezone="Europe/Rome", cameras=CAMERAS), [MONDAY + timedelta(days=k) for k in range(19)])
    return root


@pytest.fixture(scope="module")
def read(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same project after a first reader."""
    root = Path(shutil.copytree(stored, tmp_path_factory.mktemp("read") / "shop"))
    rows(site_of(root))
    return root


@pytest.fixture
def project(read: Path, tmp_path: Path) -> Site:
    return site_of(Path(shutil.copytree(read, tmp_path / "shop")))


def site_of(root: Path) -> Site:
    return make_site(root, timezone="Europe/Rome", cameras=CAMERAS)


def rows(
    site: Site, names: Sequence[str] = SOME, *, uses_days: bool = True, last: date = SUNDAY
) -> dict[str, tuple[str, list]]:
    """Return types and rows of facts and marts that are stored by day."""
    with Warehouse(site, MONDAY, last, uses_days=uses_days) as warehouse:
        warehouse.prepare(
            " ".join(names)
        )  # one after the other, each opens a warehouse for each run of days to compute
        tables = {name: warehouse.table(f"select * from {name}") for name in names}
        return {name: (str(table.schema), table.to_pylist()) for name, table in tables.items()}


def weeks(site: Site) -> list[Path]:
    return sorted((site.root / "facts" / FOLDER).rglob("*.parquet"))


def test_a_range_is_read_by_weeks_facts_without_the_last_days(project: Site) -> None:
    found: dict[str, list[date]] = {name: [] for name in SOME}
    for path in weeks(project):
        name, _, day, _ = path.relative_to(project.root / "facts" / FOLDER).parts
        found.setdefault(name, []).append(date.fromisoformat(day.removeprefix("date=")))
    mondays = [MONDAY + timedelta(days=k) for k in (0, DAYS, 2 * DAYS)]
    facts = relations("facts")
    assert found == {name: mondays[: 1 if name in facts else 3] for name in found}


@pytest.mark.parametrize("seed", [1, 2])
def test_whichever_days_came_and_were_read_first_the_rows_are_those_of_the_whole_range(
    seed: int, tmp_path: Path
) -> None:
    site = site_of(tmp_path)
    rng = np.random.default_rng(seed)
    days = [MONDAY + timedelta(days=int(k)) for k in rng.permutation(21)[:12]]
    for some in (days[:7], days[7:]):
        put_days(site, some, hour=int(rng.integers(0, 24)))
        rows(site, ALL, last=max(days) if seed == 1 else SUNDAY)
    by_weeks = rows(site, ALL)
    at_once = rows(site, ALL, uses_days=False)
    assert {p.relative_to(site.root / "facts" / FOLDER).parts[0] for p in weeks(site)} >= {*MARTS}
    for name in at_once:
        assert by_weeks[name] == at_once[name], name


def test_late_records_replace_the_files_of_their_week(project: Site) -> None:
    before, was = weeks(project), rows(project)
    put_days(project, [MONDAY + timedelta(days=2)], hour=9)
    now = rows(project)
    assert now != was
    assert rows(project) == now  # the first reader removed the older files of the day, so that this one writes the week
    assert now == rows(project, uses_days=False)
    after = weeks(project)
    assert len(after) == len(before)
    changed = {p.parent.name for p in set(before) - set(after)}
    assert changed == {f"date={MONDAY}"}


def test_an_older_week_whose_remover_was_killed_goes_with_the_next_reader(project: Site) -> None:
    before = weeks(project)
    older = before[0].with_name(f"00-{'0' * 16}.parquet")
    shutil.copy(before[0], older)
    rows(project)
    assert weeks(project) == before


def test_where_no_week_can_be_written_the_days_are_read(stored: Path, tmp_path: Path, read: Path) -> None:
    site = site_of(Path(shutil.copytree(stored, tmp_path / "shop")))

    def refused(*args: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.MonkeyPatch.context() as full:
        full.setattr(week_files_module, "publish", refused)
        full.setattr(fact_weeks_module, "publish", refused)
        without = rows(site)
    assert not weeks(site)
    assert rows(site) == without
    assert [p.name for p in weeks(site)] == [p.name for p in weeks(site_of(read))]


def test_weeks_that_are_written_hold_no_memory(stored: Path, tmp_path: Path) -> None:
    """Else a report of many new weeks needs more with each of them."""
    site = site_of(Path(shutil.copytree(stored, tmp_path / "shop")))
    with Warehouse(site, MONDAY, SUNDAY) as warehouse:
        before = pa.total_allocated_bytes()
        warehouse.prefetch("violations", "cell_hours")
        held = pa.total_allocated_bytes() - before
    assert held < sum(path.stat().st_size for path in (site.root / "facts" / FOLDER).glob("*/**/*.parquet")) / 10


def test_verify_finds_a_flipped_bit_and_a_wrong_name(project: Site) -> None:
    assert not verify(project).damages
    own, *_, other = (p for p in weeks(project) if "camera_hours" in p.parts)
    whole, data = own.read_bytes(), bytearray(own.read_bytes())
    data[len(data) // 2] ^= 1
    own.write_bytes(data)
    assert [f.path for f in verify(project).damages] == [own]
    own.write_bytes(whole)
    other.write_bytes(whole)
    assert [f.path for f in verify(project).damages] == [other]


def test_weeks_of_purged_records_go_with_them(project: Site) -> None:
    with Warehouse(project, MONDAY, SUNDAY) as warehouse:
        assert len(warehouse.rows("select distinct camera_id from camera_hours where person_records > 0")) == len(
            CAMERAS
        )
    first = round(datetime(2026, 3, 19, tzinfo=UTC).timestamp() * 1000)
    terms = Terms(now=NOW, is_forced=True)
    purge_range(project, camera_id="left", first_ms=first, after_ms=first + 86_400_000, terms=terms)
    left = {p.parent.name for p in weeks(project)}
    assert left == {f"date={MONDAY + timedelta(days=k)}" for k in (DAYS, 2 * DAYS)}
    assert rows(project) == rows(project, uses_days=False)


def test_weeks_of_sealed_days_have_the_same_rows(project: Site) -> None:
    was = rows(project)
    purge_older(project, before=MONDAY + timedelta(days=9), terms=Terms(now=NOW, is_forced=True))
    now = rows(project)
    assert now == rows(project)
    assert now == rows(project, uses_days=False)
    assert now["camera_hours"] == was["camera_hours"]


def test_a_purge_leaves_the_weeks_of_marts_whose_rows_follow_from_sealed_facts(project: Site) -> None:
    was = rows(project)
    before = {path: path.read_bytes() for path in weeks(project)}
    for n_days in (9, 16):
        purge_older(project, before=MONDAY + timedelta(days=n_days), terms=Terms(now=NOW, is_forced=True))
        left = {path: path.read_bytes() for path in weeks(project)}
        marts = {path.relative_to(project.root).parts[2] for path in left}
        assert marts == set(SOME) - set(FACTS), "facts go: they are sealed"
        assert left.items() <= before.items()
        assert {path for path in before if path.relative_to(project.root).parts[2] in marts} == left.keys()
        assert rows(project) == rows(project, uses_days=False)
        assert rows(project)["camera_hours"] == was["camera_hours"]
        assert left.items() <= {path: path.read_bytes() for path in weeks(project)}.items()


def test_a_purge_removes_weeks_of_marts_that_are_stale(project: Site) -> None:
    """Nobody could tell from what records their rows came."""
    rows(project)
    fresh = next((project.root / "facts" / FOLDER / "violations").rglob(f"date={MONDAY}/*.parquet"))
    stale = fresh.with_name("00-0123456789abcdef.parquet")
    stale.write_bytes(fresh.read_bytes())
    _purge_half(project)
    assert fresh.exists()
    assert not stale.exists()


@pytest.mark.parametrize(("folder", "name"), [("days", "violations"), (FOLDER, "episode_areas")])
def test_files_of_a_mart_that_are_no_longer_stored_go_with_the_next_build_and_with_a_purge(
    project: Site, folder: str, name: str
) -> None:
    """Older versions stored days of marts, and `episode_areas`, which names tracks."""
    today = project.root / "facts" / FOLDER / "violations"
    source = next(today.rglob(f"date={MONDAY}/*.parquet"))
    old = project.root / "facts" / folder / name / source.relative_to(today)
    data = source.read_bytes()
    for remove in (build, _purge_half):
        old.parent.mkdir(parents=True, exist_ok=True)
        old.write_bytes(data)
        remove(project)
        assert not old.exists(), remove


def _purge_half(site: Site) -> None:
    purge_older(site, before=MONDAY + timedelta(days=9), terms=Terms(now=NOW, is_forced=True))
