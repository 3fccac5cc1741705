"""Relations with a row for each record: computed when a query names them, and in no file."""

from __future__ import annotations

import shutil
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest
from warehouse.small_projects import HOUR, T0, Person, beats, fact_files, make_site, open_days, put

from vsd_analytics.retention.purge import Terms, purge_older, purge_range
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import list_parts
from vsd_analytics.warehouse import sources, units
from vsd_analytics.warehouse.analyst_query import run_query
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.relations import named_relations
from vsd_analytics.warehouse.verify_facts import verify

TWO_DAYS = ("2026-11-09", "2026-11-10")
NEXT_DAY = T0 + 24 * HOUR


@pytest.fixture
def site(tmp_path: Path) -> Site:
    site = make_site(tmp_path / "site")
    rng = np.random.default_rng(4)
    for start in (T0, T0 + HOUR, NEXT_DAY):
        people = [
            Person(start + s * 1000, who, *map(int, rng.integers(0, 4000, size=2))) for s in range(60) for who in "abc"
        ]
        put(site, [*people, *beats(start, start + 60_000)])
    return site


def near(site: Site) -> list[tuple[int, str, str, int]]:
    """Return who was within `pair_max_m` of whom, by a join of the places."""
    query = """
        select a.ts_ms, a.track_id as one, b.track_id as other,
            cast(floor(sqrt((a.x_mm - b.x_mm) ** 2 + (a.y_mm - b.y_mm) ** 2)) as integer) as distance_mm
        from located as a
        inner join located as b on a.camera_id = b.camera_id and a.ts_ms = b.ts_ms and a.track_id < b.track_id
        where (a.x_mm - b.x_mm) ** 2 + (a.y_mm - b.y_mm) ** 2 <= 2500 ** 2
    """
    with open_days(site, *TWO_DAYS) as warehouse:
        return sorted((r["ts_ms"], r["one"], r["other"], r["distance_mm"]) for r in warehouse.rows(query))


def pairs(site: Site, **options: object) -> list[tuple[int, str, str, int]]:
    with open_days(site, *TWO_DAYS, **options) as warehouse:
        rows = warehouse.rows("select ts_ms, track_a, track_b, distance_mm from pairs")
    return sorted((r["ts_ms"], r["track_a"], r["track_b"], r["distance_mm"]) for r in rows)


def test_pairs_are_those_of_the_places_and_no_file_holds_either(site: Site) -> None:
    expected = near(site)
    assert len(expected) > 100
    assert pairs(site) == expected
    assert not {n.split("/")[0] for n in fact_files(site)} & {"pairs", "located"}


def test_hours_in_several_batches_have_the_same_pairs(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = pairs(site)
    monkeypatch.setattr(units, "QUIET_ROWS", 1)
    monkeypatch.setattr(units, "BATCH_ROWS", 1)
    assert pairs(site) == expected


def test_a_query_that_names_pairs_needs_no_other_facts(site: Site) -> None:
    assert pairs(site, relations=named_relations("select * from pairs"))
    assert {n.split("/")[0] for n in fact_files(site)} == {"camera_days"}


def test_only_a_table_of_that_name_costs_the_computation(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "record_rows", lambda *_, **__: pytest.fail("records are read"))
    with open_days(site) as warehouse:
        counted = run_query(warehouse, "select count(*) as pairs from internal.exposure where camera_id <> 'located'")
    assert counted["pairs"].to_pylist() == [3]


@pytest.mark.parametrize(
    "query", ["select * from pairs", "SELECT 1 FROM exposure, Pairs", 'from hours\njoin "pairs" using (hour)']
)
def test_a_table_is_found_however_it_is_named(query: str) -> None:
    assert "pairs" in named_relations(query)


def test_purged_hours_have_no_pairs_and_the_others_have_theirs(site: Site) -> None:
    everything = pairs(site)
    terms = Terms(now=datetime(2026, 12, 1, tzinfo=UTC), is_forced=True)
    purge_older(site, before=date(2026, 11, 10), terms=terms)
    remaining = pairs(site)
    assert remaining == [row for row in everything if row[0] >= NEXT_DAY]
    assert 0 < len(remaining) < len(everything)


def older(site: Site) -> list[Path]:
    """Put the files in place that a version that stored pairs has: of days, weeks and other settings."""
    build(site)
    build(site.with_settings(distance_m=1.0))
    facts = site.root / "facts"
    (other,) = (facts / "beside").iterdir()
    for root in (facts, facts / "weeks", other):
        source = facts if root == facts / "weeks" else root
        shutil.copytree(source / "episode_segments", root / "pairs")
    return sorted(p for p in facts.rglob("*.parquet") if "pairs" in p.parts)


def test_a_build_removes_the_pairs_that_an_older_version_stored(site: Site) -> None:
    before = older(site)
    assert len(before) == 6
    found = verify(site)
    assert found.is_whole
    assert {note.path for note in found.notes} >= {p for p in before if "beside" not in p.parts}
    build(site)
    assert [p for p in before if p.exists()] == []
    assert not list((site.root / "facts").rglob("pairs")), "not even an empty folder is left"
    assert not verify(site).notes


def test_a_purge_removes_the_pairs_that_an_older_version_stored_of_these_hours(site: Site) -> None:
    """They hold places of single people; a build may come days later."""
    older(site)
    terms = Terms(now=datetime(2026, 12, 1, tzinfo=UTC), is_forced=True)
    purge_range(site, camera_id="cam", first_ms=T0, after_ms=T0 + HOUR, terms=terms)
    left = list_parts(site.root / "facts", "pairs", site.site_id)
    assert [p.hour // 24 for p in left] == [NEXT_DAY // HOUR // 24]
