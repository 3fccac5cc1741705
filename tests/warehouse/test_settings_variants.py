"""Other settings than those of vsd.toml have facts of their own: beside the stored ones, which stay as they are."""

from __future__ import annotations

import os
import shutil
from datetime import UTC, date, datetime
from pathlib import Path

import pytest
from warehouse.small_projects import HOUR, T0, Person, beats, fact_files, make_site, put

from vsd_analytics.retention.purge import Terms, purge_older, purge_range
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.settings_variants import FOLDER, MOST, folder, folders
from vsd_analytics.warehouse.verify_facts import verify
from vsd_analytics.warehouse.warehouse import Warehouse

DAY = date(2026, 11, 9)
MARTS = ("hours", "episodes", "distances")


@pytest.fixture
def site(tmp_path: Path) -> Site:
    """Two hours of three people who stand 1.2 m and 1.7 m apart, and come closer for a minute."""
    site = make_site(tmp_path / "shop")
    put(site, people(T0, T0 + 2 * HOUR))
    build(site)
    return site


def people(first: int, after: int) -> list[Person]:
    nearer = lambda ts: 400 if ts % 600_000 < 60_000 else 0  # noqa: E731
    found = [
        Person(ts, track, x - nearer(ts) * (track != "a"), 0)
        for ts in range(first, after, 10_000)
        for track, x in (("a", 0), ("b", 1200), ("c", 2900))
    ]
    return [*found, *beats(first, after, every=10_000)]  # type: ignore[list-item]


def rows(site: Site) -> dict[str, list[dict[str, object]]]:
    with Warehouse(site, DAY, DAY) as warehouse:
        return {name: warehouse.rows(f"select * from {name}") for name in MARTS}


def stored(site: Site) -> dict[str, bytes]:
    """Return name and bytes of all files of facts and days but those of other settings."""
    root = site.root / "facts"
    files = (p for p in sorted(root.rglob("*.parquet")) if not p.is_relative_to(site.root / FOLDER))
    return {str(p.relative_to(root)): p.read_bytes() for p in files}


@pytest.mark.parametrize("distance_m", [1.0, 1.5])
def test_another_distance_gives_what_a_project_with_that_distance_gives(
    site: Site, tmp_path: Path, distance_m: float
) -> None:
    own = rows(site)
    before = stored(site)
    found = rows(site.with_settings(distance_m=distance_m))
    shutil.copytree(site.root / "store", tmp_path / "other" / "store")
    assert found == rows(make_site(tmp_path / "other", distance_m=distance_m))
    assert found["episodes"] != own["episodes"]
    assert stored(site) == before, "what is stored of the settings of vsd.toml stays"
    assert build(site).n_built == 0
    assert rows(site) == own


def test_facts_that_do_not_read_the_setting_are_shared(site: Site) -> None:
    other = site.with_settings(distance_m=1.0)
    result = build(other)
    assert dict(result.reasons) == {"settings changed": 2}
    path = folder(other)
    assert path is not None
    assert {p.name for p in path.iterdir()} == set(result.facts)
    assert not set(result.facts) & {"coverage", "exposure", "camera_days", "distance_times"}
    assert build(other).n_built == 0


def test_late_records_renew_the_facts_of_all_settings_each_when_asked(site: Site, tmp_path: Path) -> None:
    other = site.with_settings(distance_m=1.5)
    rows(other)
    put(site, people(T0 + 2 * HOUR, T0 + 3 * HOUR))
    shutil.copytree(site.root / "store", tmp_path / "again" / "store")
    again = make_site(tmp_path / "again")
    assert rows(site) == rows(again)
    assert rows(other) == rows(again.with_settings(distance_m=1.5))
    assert {n.rpartition("-")[0] for n in fact_files(site)} == {n.rpartition("-")[0] for n in fact_files(again)}


def test_the_settings_that_were_longest_not_in_use_give_way(site: Site) -> None:
    sites = [site.with_settings(distance_m=m) for m in (0.5, 0.8, 1.0, 1.4)]
    assert len(sites) == MOST + 1
    for second, other in enumerate(sites[:MOST]):
        build(other)
        os.utime(folder(other), (second, second))  # type: ignore[arg-type]
    rows(sites[0])  # used again: now 0.8 is the oldest
    rows(sites[MOST])
    assert set(folders(site)) == {folder(sites[k]) for k in (0, 2, 3)}
    build(site)
    assert set(folders(site)) == {folder(sites[k]) for k in (0, 2, 3)}


def test_a_setting_of_the_environment_is_another_setting(tmp_path: Path) -> None:
    from vsd_analytics.config.project import load_site

    floor, camera = '[[floor]]\nid = "f"\nname = "F"\n', '[[camera]]\nid = "c"\nname = "C"\nfloor = "f"\n'
    (tmp_path / "vsd.toml").write_text(f'[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\n{floor}{camera}')
    own, other = (load_site(tmp_path, environ=e) for e in ({}, {"VSD_DISTANCE_M": "1"}))
    same = load_site(tmp_path, environ={"VSD_DISTANCE_M": "2"})
    assert other.with_own_settings().settings == own.settings
    assert (folder(own), folder(same)) == (None, None)
    assert folder(other) == folder(own.with_settings(distance_m=1.0)) is not None


def test_a_purge_by_age_seals_the_facts_of_vsd_toml_and_leaves_none_of_other_settings(site: Site) -> None:
    other = site.with_settings(distance_m=1.0)
    own = rows(site)
    rows(other)
    purge_older(other, before=date(2026, 11, 10), terms=Terms(now=datetime(2027, 1, 1, tzinfo=UTC), is_forced=True))
    assert [p for p in (site.root / "facts").rglob("*.parquet") if f"date={DAY}" in str(p)] == []
    assert rows(site) == own


def test_a_purge_of_a_camera_takes_it_out_of_the_facts_of_all_settings(site: Site) -> None:
    other = site.with_settings(distance_m=1.0)
    rows(other)
    terms = Terms(now=datetime(2027, 1, 1, tzinfo=UTC), is_forced=True)
    purge_range(site, camera_id="cam", first_ms=T0, after_ms=T0 + HOUR, terms=terms)
    assert list((site.root / FOLDER).rglob("*.parquet")) == []


def test_verify_knows_files_of_other_settings_and_finds_damage_in_them(site: Site) -> None:
    other = site.with_settings(distance_m=1.0)
    rows(other)
    assert (verify(site).is_whole, verify(site).notes) == (True, ())
    assert verify(other).is_whole
    path = next((site.root / FOLDER).rglob("episode_segments/*/*/*.parquet"))
    data = path.read_bytes()
    path.write_bytes(data[:100] + bytes([data[100] ^ 1]) + data[101:])
    assert [f.path for f in verify(site).damages] == [path]
